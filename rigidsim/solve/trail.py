"""A few of a run's samples, spread evenly over it: its errors are later estimated there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from rigidsim.solve.checkpoint import Arrays, pack, unpack
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.sample_block import SampleBlock

_MOST = {True: 64, False: 16}  # of narrow precisions, whose closed forms take arrays, and of others


@dataclass
class SampleTrail:
    """Evenly spaced samples and the last one, by (index, time, state, chart), internal units; the choice
    doesn't depend on the blocks in which they came.
    """

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
