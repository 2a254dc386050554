"""A few of a run's samples, spread evenly over it and kept in memory, by which its errors are told later."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.sample_block import SampleBlock

_MOST = {True: 64, False: 16}  # of narrow precisions, whose closed forms take arrays, and of others


@dataclass
class Trail:
    """Samples of every so many, and the last; which ones doesn't depend on the blocks that they came in.

    Attributes:
        kept: (index, time, state, chart) of each: internal units.
    """

    precision: Precision
    kept: list[tuple[int, Scalar, np.ndarray, int]] = field(default_factory=list)
    _stride: int = 1
    _last: tuple[int, Scalar, np.ndarray, int] | None = None

    def take(self, block: SampleBlock) -> None:
        """The samples that follow those taken before."""
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
        """Those kept, and the last."""
        more = [] if self._last is None or (self.kept and self.kept[-1][0] == self._last[0]) else [self._last]
        return [*self.kept, *more]

    @staticmethod
    def _sample(block: SampleBlock, row: int) -> tuple[int, Scalar, np.ndarray, int]:
        return block.first + row, block.times[row], np.array(block.states[row]), int(block.chart[row])
