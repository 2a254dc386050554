"""Samples found by the integration, on their way to whoever keeps them."""

from __future__ import annotations

import time

import numpy as np

from rigidsim.solve.pacing import Pacing
from rigidsim.solve.precision import Scalar
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.sampler import SampleReceiver
from rigidsim.solve.sampling import SampleClock


class SampleBuffer:
    """Collects samples and hands them over in blocks of bounded size.

    Attributes:
        handed: samples handed over so far.
        count: samples found so far.
    """

    def __init__(self, clock: SampleClock, receiver: SampleReceiver, pacing: Pacing, first: int = 0) -> None:
        self._clock = clock
        self._receiver = receiver
        self._pacing = pacing
        self.handed = self.count = first
        self._blocks: list[SampleBlock] = []
        self._handed_at = time.perf_counter()
        self._upcoming: tuple[int, Scalar] | None = None

    @property
    def complete(self) -> bool:
        """Whether all samples are found."""
        return self.count >= self._clock.count

    @property
    def full(self) -> bool:
        """Whether so many wait that they are to be handed over before more are found."""
        return self.count - self.handed >= self._pacing.rows_waiting

    @property
    def upcoming(self) -> Scalar:
        """Time of the next sample."""
        if self._upcoming is None or self._upcoming[0] != self.count:
            self._upcoming = self.count, self._clock.at(self.count)
        return self._upcoming[1]

    def until(self, limit: Scalar) -> np.ndarray:
        """Times of the next samples that lie at or before ``limit``."""
        pieces = []
        position, rows = self.count, self._pacing.rows_at_once
        while position < self._clock.count:
            times = self._clock.internal(position, min(position + rows, self._clock.count))
            inside = int(np.count_nonzero(times <= limit))
            pieces.append(times[:inside])
            position += inside
            if inside < len(times):
                break
        return np.concatenate(pieces) if pieces else self._clock.internal(0, 0)

    def take(self, block: SampleBlock) -> None:
        """The next samples."""
        if len(block):
            self._blocks.append(block)
            self.count += len(block)

    def drop_after(self, limit: Scalar) -> None:
        """Forget samples past a time that are not handed over yet (an event that ends the run)."""
        kept = [block.rows(0, int(np.count_nonzero(block.times <= limit))) for block in self._blocks]
        self._blocks = [block for block in kept if len(block)]
        self.count = self.handed + sum(map(len, self._blocks))

    def hand_over(self, *, patiently: bool = False) -> None:
        """Give what is collected to the receiver; ``patiently``: only where it is much, or old."""
        rows = self._pacing.rows_at_once
        waited = time.perf_counter() - self._handed_at
        if patiently and self.count - self.handed < rows and waited < self._pacing.patience:
            return
        self._handed_at = time.perf_counter()
        if not self._blocks:
            return
        whole = SampleBlock.joined(self._blocks)
        self._blocks = []
        for start in range(0, len(whole), rows):
            block = whole.rows(start, start + rows)
            self._receiver.take(block)
            self.handed += len(block)
