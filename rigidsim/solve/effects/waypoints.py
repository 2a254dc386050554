"""A few of a run's step boundaries and samples, spread evenly over it: its errors are followed from the ones,
and estimated at the others.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from rigidsim.solve.checkpoint import Arrays, pack, unpack
from rigidsim.solve.effects.effect import Effect
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.stepper import Stepper

_MOST_SAMPLES = {True: 64, False: 16}  # of narrow precisions, whose closed forms take arrays, and of others
_MOST = 32

Kept = tuple[Mapping[int, "Waypoint"], int]
"""Waypoints by number of their correction, and the spacing of those numbers."""


@dataclass(frozen=True)
class Waypoint:
    """A step boundary, internal units."""

    steps: int
    time: float
    state: np.ndarray
    chart: int


class Waypoints(Effect):
    """Evenly spaced boundaries of corrections; the choice depends on the steps alone."""

    memory: Kept = {}, 1

    def apply(self, stepper: Stepper, stride: int) -> bool:
        kept, spacing = self.memory
        number, state = stepper.steps // stride, stepper.state
        if number % spacing or not stepper.steps:  # a closed form takes none
            return True
        # numbers of more than 80 bits aren't numpy's own
        plain = state.astype(np.float64) if state.dtype.kind == "f" else np.array([float(x) for x in state])
        kept = {**kept, number: Waypoint(stepper.steps, float(stepper.time), plain, stepper.chart)}
        if len(kept) > _MOST:
            spacing *= 2
            kept = {n: waypoint for n, waypoint in kept.items() if n % spacing == 0}
        self.memory = kept, spacing
        return True

    def back_to(self, memory: Kept, stepper: Stepper) -> None:
        self.memory = memory

    def pack(self, memory: Kept) -> dict[str, np.ndarray]:
        kept, spacing = memory
        rows = [(number, spacing, found.steps, found.chart) for number, found in kept.items()]
        places = [[found.time, *found.state] for found in kept.values()]
        return {"waypoints": np.array(rows, dtype=np.int64), "waypoint_states": np.array(places)}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> Kept:
        """See ``Effect``; an earlier version saved none."""
        rows, places = arrays.get("waypoints", np.zeros((0, 4))), arrays.get("waypoint_states", np.zeros(0))
        found = {
            number: Waypoint(steps, time, np.array(state), chart)
            for (number, _, steps, chart), (time, *state) in zip(rows.tolist(), places.tolist(), strict=True)
        }
        return found, int(rows[0, 1]) if len(rows) else 1

    def between(self, first: float, last: float) -> list[Waypoint]:
        """Boundaries between two counts of steps, in order."""
        kept = self.memory[0].values()
        return sorted((found for found in kept if first <= found.steps < last), key=lambda found: found.steps)


@dataclass
class SampleTrail:
    """Evenly spaced samples (index, time, state, chart) and the last one, whatever blocks they came in."""

    version: ClassVar[int] = 1

    precision: Precision
    kept: list[tuple[int, Scalar, np.ndarray, int]] = field(default_factory=list)
    _stride: int = 1
    _last: tuple[int, Scalar, np.ndarray, int] | None = None

    def take(self, block: SampleBlock) -> None:
        """Take the samples that follow those taken before."""
        start = -block.first % self._stride
        for row in range(start, len(block), self._stride):
            if (block.first + row) % self._stride == 0:  # the stride may have grown on the way
                self.kept.append(self._sample(block, row))
            if len(self.kept) > _MOST_SAMPLES[self.precision.narrow]:
                self._stride *= 2
                self.kept = [sample for sample in self.kept if sample[0] % self._stride == 0]
        if len(block):
            self._last = self._sample(block, len(block) - 1)

    @property
    def samples(self) -> list[tuple[int, Scalar, np.ndarray, int]]:
        """The samples kept, and the last one."""
        more = [] if self._last is None or (self.kept and self.kept[-1][0] == self._last[0]) else [self._last]
        return [*self.kept, *more]

    def pack(self) -> Arrays:
        """See ``rigidsim.solve.checkpoint.SavedPart``."""
        if not (samples := self.samples):
            return {}
        scalar = self.precision.scalar
        times = np.array([time for _, time, _, _ in samples], dtype=scalar)
        states = np.concatenate([state for _, _, state, _ in samples]).astype(scalar)
        rows = [(index, chart, self._stride) for index, _, _, chart in samples]
        arrays = pack(times, self.precision, "trail_time") | pack(states, self.precision, "trail_state")
        return arrays | {"trail": np.array(rows, dtype=np.int64)}

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See ``rigidsim.solve.checkpoint.SavedPart``; an earlier version saved none."""
        if "trail" not in arrays:
            return
        times = unpack(arrays, self.precision, "trail_time")
        states = unpack(arrays, self.precision, "trail_state").reshape(len(times), -1)
        rows = zip(arrays["trail"].tolist(), times, states, strict=True)
        samples = [(index, time, state, chart) for (index, chart, _), time, state in rows]
        self._stride, self._last = int(arrays["trail"][0, 2]), samples[-1]
        self.kept = [sample for sample in samples if sample[0] % self._stride == 0]

    @staticmethod
    def _sample(block: SampleBlock, row: int) -> tuple[int, Scalar, np.ndarray, int]:
        return block.first + row, block.times[row], np.array(block.states[row]), int(block.chart[row])
