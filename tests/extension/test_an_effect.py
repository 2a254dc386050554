"""An effect from outside the package: impulses at given times, by whichever solver the motion is taken along.

Everything above the tests is what its author writes. It is registered by one line; steps end at its times,
and its memory is part of each checkpoint.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import test_a_solver  # noqa: F401  (which registers a solver)
from support import cases, config, loaded, run_text, same_bits

import rigidsim
from rigidsim.model.system import System
from rigidsim.solve.effects.effect import Effect, register_effect
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.stepper import Stepper

EVERY, IMPULSE = 1.7, 0.125  # s, rad/s


@register_effect("impulses")
class Impulses(Effect):
    """Adds to the spin about the z axis every so often, in scenes of one name."""

    anywhere = True

    def __init__(self, system: System, precision: Precision) -> None:
        scaling = system.scaling
        self._place = system.states.index("wz")
        self._every = math.ldexp(EVERY, -scaling.time)
        self._impulse = precision.of_double(math.ldexp(IMPULSE, -system.state_exponents[self._place]))
        self._number = precision.of_double
        self.given = 0

    @classmethod
    def of(cls, system: System, precision: Precision) -> Impulses | None:
        return cls(system, precision) if system.scene.name == "driven_by_impulses" else None

    @property
    def until(self) -> Scalar:
        return self._number((self.given + 1) * self._every)

    def due(self, stepper: Stepper, stride: int) -> bool:
        return bool(stepper.time >= self.until)

    def apply(self, stepper: Stepper, stride: int) -> bool:
        stepper.state[self._place] += self._impulse
        self.given += 1
        return True

    @property
    def memory(self) -> int:
        return self.given

    def back_to(self, memory: int, stepper: Stepper) -> None:
        self.given = memory

    def pack(self, memory: int) -> dict[str, np.ndarray]:
        return {"impulses_given": np.array([memory])}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> Any:
        return int(arrays["impulses_given"][0])


# --- the tests ----------------------------------------------------------------------------------------------

METHODS = {"taylor": 1e-16, "runge_kutta": 1e-6}
SPIN = 0.5  # rad/s


def text(method: str, samples: int = 201, end: float = 20.0) -> str:
    """Of a body that turns about its z axis."""
    return config(
        name="driven_by_impulses",
        body="principal_moments = [1, 1, 2]",
        initial=f"angular_velocity = [0, 0, {SPIN}]",
        time=f"end = {end}\nsamples = {samples}",
        integrator=f'method = "{method}"\ntolerance = {METHODS[method]}\nformulation = "quaternion"',
    )


CASES = list(product(METHODS, [2, 41, 4001]))


@pytest.mark.parametrize("case", cases(CASES, [CASES[0], CASES[2], CASES[4]]), ids=str)
def test_the_motion_is_that_of_the_impulses(case: tuple[str, int]) -> None:
    """In many steps at once, and within them: each impulse turns the body on from its time, at its rate."""
    method, samples = case
    run = run_text(text(method, samples), estimate=method == "runge_kutta")
    data = loaded(run)
    passed = np.maximum(data.time.values[:, None] - EVERY * np.arange(1, 12), 0.0)
    angle = SPIN * data.time.values + IMPULSE * passed.sum(axis=1)
    w, _, _, z = data["quaternion"].values.T
    wrong = np.abs(np.angle(np.exp(1j * (2 * np.arctan2(z, w) - angle))))
    bound = 2.0**-52 * 40 * math.sqrt(run.summary["cost"]["steps"])  # a few roundings of a turn, each step
    if method == "runge_kutta":
        bound = run.summary["accuracy"]["estimated_attitude_error"]
    assert wrong.max() < bound


@pytest.mark.parametrize("method", METHODS)
def test_it_is_missed_where_it_is_not_registered(
    method: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And where it is the run resumes bit for bit, with the errors that the solver announces."""
    given = text(method, 25, 6.0)
    run = run_text(given, "limits.max_steps=3", out=tmp_path, estimate=True)
    monkeypatch.setattr(Impulses, "of", lambda *_: None)
    with pytest.raises(rigidsim.RunFolderError, match='saved with "impulses", which is missing here'):
        rigidsim.resume(run.folder.path)
    monkeypatch.undo()
    runs = (
        rigidsim.resume(run.folder.path, overrides=["limits.max_steps=100000"]),
        run_text(given, estimate=True),
    )
    same_bits(*runs)
    announced = [one.summary["accuracy"]["estimated_attitude_error"] for one in runs]
    assert announced[0] == announced[1]
