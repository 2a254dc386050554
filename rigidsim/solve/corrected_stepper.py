"""Corrections of the state at fixed counts of natural steps, so that bits depend on no clock or sampling.

A step is never clamped to a sample, but effects (``rigidsim.solve.effects``) are applied along the way, at
counts that are the same whichever path a run takes through them, skipping, recording or resumed; or at the
first step boundary whose state asks for it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from rigidsim.solve.checkpoint import Arrays, pack, unpack
from rigidsim.solve.effects.effect import Effect
from rigidsim.solve.precision import Scalar
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.stepper import Mark, Stepper

E = TypeVar("E", bound=Effect)

STRIDE = 1024
"""Natural steps between corrections if only time is corrected: half a millisecond, so that the calls cost
less than a hundredth of it.
"""


_NEAR = 3  # number of steps up to which they are sooner taken one by one than together


class CorrectedStepper:
    """Takes steps and applies effects when they are due, at most ``STRIDE`` natural steps apart."""

    def __init__(self, stepper: Stepper, effects: Sequence[Effect]) -> None:
        self.stepper, self.effects = stepper, tuple(effects)
        self._anywhere = [effect for effect in effects if effect.anywhere]
        self._stuck = False
        self._set_limits()

    def effect(self, kind: type[E]) -> E | None:
        """The effect of a kind; None if there is none."""
        return next((effect for effect in self.effects if isinstance(effect, kind)), None)

    def _set_limits(self) -> None:
        self.stride = min([STRIDE, *(effect.limit for effect in self.effects)])
        self._set_until()

    def _set_until(self) -> None:
        ends = [effect.until for effect in self._anywhere]
        self.stepper.until = min((end for end in ends if end is not None), default=None)

    @property
    def left(self) -> int:
        """Steps until the next corrections, at least 1."""
        return self.stride - self.stepper.steps % self.stride

    @property
    def collapsed(self) -> bool:
        """Whether steps have become too small to ever arrive, even at the next whole time."""
        return self._stuck or self.stepper.collapsed

    def boundary(self) -> Mark:
        """Remember this boundary."""
        return replace(self.stepper.mark(), effects=tuple([effect.memory for effect in self.effects]))

    def back_to(self, boundary: Mark) -> None:
        """Return to a boundary."""
        self._stuck = False
        for effect, memory in zip(self.effects, boundary.effects, strict=True):
            effect.back_to(memory, self.stepper)
        self.stepper.back_to(boundary)
        self._set_limits()

    @property
    def versions(self) -> dict[str, int]:
        """Versions of what a checkpoint holds of the stepper and of each effect, by their names."""
        return {"stepper": self.stepper.version, **{effect.name: effect.version for effect in self.effects}}

    def pack(self, mark: Mark) -> Arrays:
        """A boundary as arrays of a checkpoint."""
        precision = self.stepper.precision
        arrays = pack(np.array(mark.time, dtype=precision.scalar), precision, "time")
        arrays |= pack(mark.state, precision, "state")
        arrays["counts"] = np.array([mark.steps, mark.events], dtype=np.int64)
        arrays |= self.stepper.pack(mark.memory)
        for effect, memory in zip(self.effects, mark.effects, strict=True):
            arrays |= effect.pack(memory)
        return arrays

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> Mark:
        """A boundary restored from them; raises a KeyError or ValueError for another system or precision."""
        time, state = (unpack(arrays, self.stepper.precision, name) for name in ("time", "state"))
        steps, events, *_ = (int(n) for n in arrays["counts"])
        if time.shape != (2,) or state.shape != self.stepper.state.shape:
            raise ValueError("the checkpoint belongs to another system of equations")
        memories = tuple(effect.unpack(arrays) for effect in self.effects)
        return Mark((time[0], time[1]), state, events, steps, self.stepper.unpack(arrays), memories)

    def arrive(self, boundary: Mark, moment: Scalar) -> Mark:
        """Go back, and on to the first boundary at or past a moment; returns the boundary before that."""
        most = self.stepper.steps - boundary.steps  # within which it lies, where they reach it
        self.back_to(boundary)
        while most > _NEAR:
            here, part = self.boundary(), most // 2
            self.skip(part)
            if self.stepper.time >= moment:
                most = part
                self.back_to(here)
            else:
                most -= part
        while True:
            before = self.boundary()
            self.stepper.step()
            if self.stepper.time >= moment:
                return before
            self.correct()

    def skip(self, count: int) -> bool:
        """Take ``count`` steps without dense output, fewer if they collapse; False if the state is no longer
        finite. The stepper's smallest and largest step then refer to all of them.
        """
        stepper, smallest, largest = self.stepper, math.inf, 0.0
        while count > 0 and not self.collapsed:
            before, stride = stepper.steps, self.stride
            if not stepper.take(min(count, stride - before % stride)):
                return False
            smallest, largest = min(smallest, stepper.smallest), max(largest, stepper.largest)
            stepper.smallest, stepper.largest = smallest, largest
            count -= stepper.steps - before
            self.correct()
        return True

    def samples(self, first: int, times: np.ndarray, states: np.ndarray) -> SampleBlock:
        """Samples within the steps of the latest call, taken before the corrections that follow it."""
        known: dict[str, Any] = {}
        for effect in self.effects:
            known |= effect.of_samples(times)
        return SampleBlock.of(first, times, states, **known)

    def correct(self) -> None:
        """Apply the effects that are due; dense output of the latest step is then void."""
        stepper, stride = self.stepper, self.stride
        possible = self._anywhere if stepper.steps % stride else self.effects
        for effect in [effect for effect in possible if effect.due(stepper, stride)]:
            if not effect.apply(stepper, self.stride):
                self._stuck = True
                return
            self.stride = min(self.stride, effect.limit)  # shorter once projection has begun
            self._set_until()
