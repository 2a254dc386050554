"""A few of a run's samples, spread evenly over it: its errors are later estimated there."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.sample_block import SampleBlock

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
