"""A few of a run's samples and step boundaries, spread evenly over it and kept in memory.

The run's errors are later estimated at the samples, and its neighbours start from the boundaries.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.sample_block import SampleBlock

_MOST_WAYPOINTS = 32
_MOST = {True: 64, False: 16}  # of narrow precisions, whose closed forms take arrays, and of others


@dataclass
class SampleTrail:
    """Evenly spaced samples and the last one; the choice doesn't depend on the blocks in which they came.

    Attributes:
        kept: (index, time, state, chart) of each: internal units.
    """

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
            if len(self.kept) > _MOST[self.precision.narrow]:
                self._stride *= 2
                self.kept = [sample for sample in self.kept if sample[0] % self._stride == 0]
        if len(block):
            self._last = self._sample(block, len(block) - 1)

    @property
    def samples(self) -> list[tuple[int, Scalar, np.ndarray, int]]:
        """The samples kept, and the last one."""
        more = [] if self._last is None or (self.kept and self.kept[-1][0] == self._last[0]) else [self._last]
        return [*self.kept, *more]

    @staticmethod
    def _sample(block: SampleBlock, row: int) -> tuple[int, Scalar, np.ndarray, int]:
        return block.first + row, block.times[row], np.array(block.states[row]), int(block.chart[row])


@dataclass(frozen=True)
class Waypoint:
    """A step boundary, internal units."""

    steps: int
    time: float
    state: np.ndarray
    chart: int


@dataclass
class Waypoints:
    """Evenly spaced boundaries of corrections; the choice depends on the steps alone."""

    _kept: dict[int, Waypoint] = field(default_factory=dict)
    _spacing: int = 1

    def note(self, number: int, steps: int, time: Scalar, state: np.ndarray, chart: int) -> None:
        """Note the boundary of correction ``number``, unless it is there already."""
        if number % self._spacing:
            return
        # numbers of more than 80 bits aren't numpy's own
        plain = state.astype(np.float64) if state.dtype.kind == "f" else np.array([float(x) for x in state])
        self._kept[number] = Waypoint(steps, float(time), plain, chart)
        if len(self._kept) > _MOST_WAYPOINTS:
            self._spacing *= 2
            self._kept = {n: kept for n, kept in self._kept.items() if n % self._spacing == 0}

    def between(self, first: float, last: float) -> list[Waypoint]:
        """Boundaries between two counts of steps, in order."""
        return sorted(
            (kept for kept in self._kept.values() if first <= kept.steps < last), key=lambda kept: kept.steps
        )
