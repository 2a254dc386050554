"""What happens between steps: an effect from outside, beside those of the package."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from support import config

import rigidsim
from rigidsim.solve.assembly import assemble
from rigidsim.solve.corrected_stepper import CorrectedStepper
from rigidsim.solve.effects.effect import Effect
from rigidsim.solve.problem import prepare
from rigidsim.solve.stepper import Stepper

KINK = 'kind = "torque"\ncomponents = ["0.2*sign(qw*qx)", "0", "0"]'
"""A torque that depends on the attitude alone: a motion whose rates are reversed runs back."""


class Kicks(Effect):
    """Reverses the body's spin every so many steps: the motion runs back."""

    def __init__(self) -> None:
        self.counted = 0

    @property
    def limit(self) -> int:
        return 10

    def apply(self, stepper: Stepper, stride: int) -> bool:
        stepper.state[:3] *= -1.0
        self.counted += 1
        return True

    @property
    def memory(self) -> int:
        return self.counted

    def back_to(self, memory: int, stepper: Stepper) -> None:
        self.counted = memory

    def pack(self, memory: int) -> dict[str, np.ndarray]:
        return {"kicks": np.array([memory], dtype=np.int64)}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> int:
        return int(arrays["kicks"][0])


class Reversal(Effect):
    """Reverses the body's spin once, at a time, internal units."""

    anywhere = True

    def __init__(self, when: float) -> None:
        self._when: float | None = when

    @property
    def until(self) -> float | None:
        return self._when

    def due(self, stepper: Stepper, stride: int) -> bool:
        return self._when is not None and bool(stepper.time >= self._when)

    def apply(self, stepper: Stepper, stride: int) -> bool:
        assert stepper.time == self._when
        stepper.state[:3] *= -1.0
        self._when = None
        return True


def kicked() -> tuple[CorrectedStepper, Kicks]:
    parts, kicks = assemble(prepare(rigidsim.parse(config(time="end = 1000\nsamples = 2")))), Kicks()
    return CorrectedStepper(parts.stepper, [*parts.corrected.effects, kicks]), kicks


def test_an_effect_is_applied_at_its_limit_however_steps_are_taken() -> None:
    together, kicks = kicked()
    assert together.stride == kicks.limit
    assert together.skip(35)
    assert kicks.counted == 3
    alone, others = kicked()
    for _ in range(35):
        alone.stepper.step()
        alone.correct()
    assert others.counted == 3
    assert np.array_equal(alone.stepper.state, together.stepper.state)


def test_its_memory_is_part_of_a_boundary_and_of_a_checkpoint() -> None:
    corrected, kicks = kicked()
    assert corrected.skip(25)
    boundary = corrected.boundary()
    assert corrected.skip(50)
    after = np.array(corrected.stepper.state)
    assert kicks.counted == 7
    arrays = kicks.pack(boundary.memories[-1])
    corrected.back_to(boundary)
    assert kicks.counted == kicks.unpack(arrays) == 2
    assert corrected.skip(50)
    assert np.array_equal(corrected.stepper.state, after)


@pytest.mark.parametrize(("loads", "steps"), [("", 40), (KINK, 15)])
def test_a_step_ends_at_the_time_of_an_effect(loads: str, steps: int) -> None:
    """A motion whose rates are reversed is at its start after twice the time."""
    when, found = 23.45678, []
    for together in (True, False):
        parts = assemble(prepare(rigidsim.parse(config(loads=loads, time="end = 1000\nsamples = 2"))))
        stepper = parts.stepper
        corrected = CorrectedStepper(stepper, [*parts.corrected.effects, Reversal(when)])
        begun = np.array(stepper.state)
        if together:
            assert corrected.skip(steps)
        for _ in range(0 if together else steps):
            assert stepper.step()
            corrected.correct()
        assert when < float(stepper.time) < 2 * when
        while float(stepper.time) < 2 * when:
            assert stepper.step()
        found.append(stepper.dense(2 * when))
        # rounding of some hundred steps
        assert np.abs(found[-1][3:] - begun[3:]).max() < 1e-12
        assert np.abs(found[-1][:3] + begun[:3]).max() < 1e-12
    assert np.array_equal(*found)
