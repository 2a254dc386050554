"""Samples on their way from the engine to whoever keeps them."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rigidsim.solve.rhythm import Place
from rigidsim.solve.sampling import SampleClock

ROWS_AT_ONCE = 8192
_PATIENCE = 2.0  # seconds until samples of a slow run are handed over


@dataclass(frozen=True)
class Checkpoint:
    """All that the integration needs to go on with the same bits.

    Attributes:
        place: a step boundary past all samples before ``next_sample``.
        next_sample: index of the first sample that isn't handed over.
    """

    place: Place
    next_sample: int


class Keeper(Protocol):
    """Takes samples in order, and is told when what it took can be saved together with a checkpoint."""

    def take(
        self, first: int, times: np.ndarray, states: np.ndarray, turns: np.ndarray, put_back: np.ndarray
    ) -> None:
        """Samples from index ``first`` on: times (n,), states (n, states), rows of turns (n, ...) and of what
        was put back of each held scalar before the sample (n, held scalars).
        """

    def due(self) -> bool:
        """Whether it is time to save."""

    def save(self, checkpoint: Checkpoint) -> None:
        """Save everything taken so far, and the checkpoint that goes on from there."""


class Harvest:
    """Collects samples and hands them over in blocks of bounded size.

    Attributes:
        handed: samples handed over so far.
        count: samples found so far.
    """

    def __init__(self, clock: SampleClock, keeper: Keeper, first: int = 0) -> None:
        self._clock = clock
        self._keeper = keeper
        self.handed = self.count = first
        self._buffer: list[tuple[np.ndarray, ...]] = []
        self._flushed = time.perf_counter()

    @property
    def complete(self) -> bool:
        """Whether all samples are found."""
        return self.count >= self._clock.count

    @property
    def upcoming(self) -> Any:
        """Time of the next sample."""
        return self._clock.at(self.count)

    def until(self, limit: Any) -> np.ndarray:
        """Times of the next samples that lie at or before ``limit``."""
        pieces = []
        position = self.count
        while position < self._clock.count:
            times = self._clock.internal(position, min(position + ROWS_AT_ONCE, self._clock.count))
            inside = int(np.count_nonzero(times <= limit))
            pieces.append(times[:inside])
            position += inside
            if inside < len(times):
                break
        return np.concatenate(pieces) if pieces else self._clock.internal(0, 0)

    def take(self, times: np.ndarray, states: np.ndarray, turns: np.ndarray, put_back: np.ndarray) -> None:
        """The next samples, as in ``Keeper.take``; ``put_back`` (held scalars,) is the same for all."""
        if len(times):
            held = np.broadcast_to(put_back.copy(), (len(times), len(put_back)))
            self._buffer.append((times, states, turns, held))
            self.count += len(times)

    def drop_after(self, limit: Any) -> None:
        """Forget samples past a time that are not handed over yet (an event that ends the run)."""
        kept = []
        for columns in self._buffer:
            inside = columns[0] <= limit
            if inside.any():
                kept.append(tuple(column[inside] for column in columns))
        self._buffer = kept
        self.count = self.handed + sum(len(columns[0]) for columns in kept)

    def hand_over(self, *, patiently: bool = False) -> None:
        """Give what is collected to the keeper; ``patiently``: only where it is much, or old."""
        many = self.count - self.handed >= ROWS_AT_ONCE
        if patiently and not many and time.perf_counter() - self._flushed < _PATIENCE:
            return
        self._flushed = time.perf_counter()
        if not self._buffer:
            return
        times, states, turns, held = (np.concatenate(c) for c in zip(*self._buffer, strict=True))
        self._buffer = []
        for first in range(0, len(times), ROWS_AT_ONCE):
            rows = slice(first, first + ROWS_AT_ONCE)
            self._keeper.take(self.handed, times[rows], states[rows], turns[rows], held[rows])
            self.handed += len(times[rows])
