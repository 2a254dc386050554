"""What goes between a driver and its run: progress, checks, how much at once, and the buffer of samples."""

import time
from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rigidsim.solve.corrected_stepper import Position, StepBoundary
from rigidsim.solve.precision import Scalar
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.sampling import Rows
from rigidsim.solve.status import Status
from rigidsim.solve.turns import JoinedAngles


@dataclass
class Progress:
    """Progress of a run; its one mutable record."""

    samples: int
    next_sample: int = 0  # index of the first sample that isn't handed over yet
    steps: int = 0
    time: float = 0.0  # time that the integration has reached, s
    smallest_step: float = float("inf")  # extremes of the natural steps so far, internal units
    largest_step: float = 0.0
    redone_steps: int = 0  # steps taken back because they went past a sample
    status: Status = Status.RUNNING
    integration_seconds: float = 0.0
    last_good: StepBoundary | None = None  # last step boundary with a finite state, for a run that broke down
    detail: str = ""  # why it broke down, if more is known

    @property
    def fraction(self) -> float:
        """Fraction of the samples that are recorded."""
        return self.next_sample / self.samples


Check = Callable[[Progress], Status | None]
"""Checks guards and interruptions between chunks; a status ends the run."""


class SampleReceiver(Protocol):
    """Receives samples in order, and is told when they can be saved; the base class never asks for that.

    Attributes:
        last_wanted: index of a sample that ends the run by the guard ``max_drift``; later ones weren't taken.
        rows_together: samples are saved at the least cost in multiples of so many.
    """

    last_wanted: int | None = None
    rows_together: int = 1

    def take(self, block: SampleBlock) -> None:
        """Take the samples that follow those taken before."""

    def due(self) -> bool:
        """Whether it is time to save."""
        return False

    def save(self, position: Position) -> None:
        """Save everything taken so far, and the position to resume from."""
        return None


@dataclass(frozen=True)
class Pacing:
    """Amounts; no bit depends on them. Ctrl-C is heeded after no more than a chunk and its hand-over."""

    chunk_seconds: float = 0.05  # between checks of guards and Ctrl-C; well below what a user waits
    patience: float = 2.0  # seconds until samples of a slow run are handed over
    rows_at_once: int = 8192  # samples in a block that is evaluated; more are no faster, and take memory
    rows_waiting: int = 65536  # in memory before they are evaluated: 8 MB in double precision
    skipped_from: int = 12  # steps to a sample from which a call without dense output costs less
    margin: float = 0.97  # of the steps to a sample, if as long as those of the latest call, that are skipped
    spare: float = 4.0  # and fewer by so many, some of which are far from the mean


MEASURED = Pacing()
"""The defaults, which cost least where they were measured."""


_FEWEST_ROWS = 8  # that may wait: some tens of milliseconds at 250 digits
_GROWTH = 4  # largest growth of the waiting rows from one hand-over to the next


class SampleBuffer:
    """Collects rows, the samples and what lies between them where angles are followed, and hands them over in
    blocks of bounded size and, as far as is known, duration.
    """

    def __init__(
        self, rows: Rows, angles: JoinedAngles, receiver: SampleReceiver, pacing: Pacing, first: int = 0
    ) -> None:
        self._clock, self._angles = rows, angles
        self._receiver = receiver
        self._pacing = pacing
        self.handed = self.count = first
        self._pieces: list[tuple[SampleBlock, StepBoundary]] = []  # samples, and a step boundary before them
        self._most = _FEWEST_ROWS
        self._affordable: dict[str, int] = {}
        self._handed_at = time.perf_counter()
        self._times: tuple[int, np.ndarray] = 0, rows.internal(0, 0)  # of the rows asked for last

    @property
    def complete(self) -> bool:
        """Whether all samples have been found."""
        return self.count >= self._clock.count

    @property
    def room(self) -> int:
        """Number of samples that may still be found before the waiting ones are handed over."""
        return self._most - (self.count - self.handed)

    @property
    def full(self) -> bool:
        """Whether the waiting samples must be handed over before more are found."""
        return self.room <= 0

    @property
    def upcoming(self) -> Scalar:
        """Time of the next sample."""
        first, times = self._times_around(self.count)
        return times[self.count - first]

    def until(self, limit: Scalar, most: int) -> np.ndarray:
        """Times of the next samples at or before ``limit``, at most ``most``."""
        position = self.count
        stop = min(self._clock.count, position + max(most, 0))
        found = [self._times[1][:0]]
        while position < stop:
            first, times = self._times_around(position)
            end = min(stop - first, len(times))
            past = bisect_right(times, limit, position - first, end)
            found.append(times[position - first : past])
            position = first + past
            if past < end:
                break
        return found[-1] if len(found) <= 2 else np.concatenate(found)

    def _times_around(self, index: int) -> tuple[int, np.ndarray]:
        """Times of a sample and those about it, as many as are evaluated together, and the first index."""
        first, times = self._times
        if not first <= index < first + len(times):
            rows = self._pacing.rows_at_once
            first = index - index % rows
            self._times = first, self._clock.internal(first, min(first + rows, self._clock.count))
        return self._times

    def take(self, block: SampleBlock, boundary: StepBoundary) -> None:
        """Take the next samples, with a step boundary before them."""
        if len(block):
            self._pieces.append((block, boundary))
            self.count += len(block)

    def back_to(self, count: int) -> None:
        """Forget all samples found since there were ``count``."""
        while self._pieces and self._pieces[-1][0].first >= count:
            self._pieces.pop()
        self.count = max(count, self.handed)

    @property
    def boundary(self) -> StepBoundary | None:
        """A step boundary before the first waiting sample; None if none waits."""
        return self._pieces[0][1] if self._pieces else None

    @property
    def whole(self) -> bool:
        """Whether as many have been handed over as the receiver saves at the least cost."""
        return self.handed % self._receiver.rows_together == 0

    def hand_over(self, *, patiently: bool = False) -> tuple[int, StepBoundary] | None:
        """Hand what is collected to the receiver; ``patiently`` only if it is much or old, and if much, just
        the samples that make it ``whole``.

        If the receiver wants no sample past one of them, its index and a boundary before it are returned, and
        the others dropped. A KeyboardInterrupt of the receiver is passed on: samples that it didn't take keep
        waiting.
        """
        waiting, rows = self.count - self.handed, self._pacing.rows_at_once
        waited = time.perf_counter() - self._handed_at
        old = waited >= self._pacing.patience
        if not waiting or (patiently and waiting < min(rows, self._most) and not old):
            return None
        stop = self.count - self.count % self._receiver.rows_together
        if old or not patiently or stop <= self.handed:
            stop = self.count
        started = self._handed_at = time.perf_counter()
        whole, boundaries = self._waiting_until(stop)
        handed = len(whole)
        for start in range(0, handed, rows):
            block, known = whole.rows(start, start + rows), self._angles.known
            try:
                self._receive(block)
            except KeyboardInterrupt:  # while something that it needs was compiled: it took none of these
                self._angles.known = known
                self._pieces.insert(0, (whole.rows(start, handed), _before(block.first, boundaries)))
                raise
            self.handed += len(block)
            wanted = self._receiver.last_wanted
            if wanted is not None:
                last, self._pieces, self._angles.known = self._clock.row(wanted), [], known
                self._angles.joined(block.rows(0, last + 1 - block.first))
                self.count = self.handed = last + 1
                return wanted, _before(last, boundaries)
        self.took("hand over", handed, time.perf_counter() - started)
        return None

    def _receive(self, block: SampleBlock) -> None:
        """Hand over the samples among some rows, with their angles."""
        which = self._clock.are_samples(block.first, block.first + len(block))
        block = self._angles.joined(block)
        if which.any():
            self._receiver.take(block.only(which, self._clock.samples(block.first)))

    def _waiting_until(self, stop: int) -> tuple[SampleBlock, dict[int, StepBoundary]]:
        """Take out the waiting samples before ``stop``, and boundaries before each piece, by its first."""
        cut = bisect_left(self._pieces, stop, key=lambda piece: piece[0].first)
        pieces, self._pieces = self._pieces[:cut], self._pieces[cut:]
        block, boundary = pieces[-1]
        if (inside := stop - block.first) < len(block):
            self._pieces.insert(0, (block.rows(inside, len(block)), boundary))
            pieces[-1] = block.rows(0, inside), boundary
        boundaries = {block.first: boundary for block, boundary in pieces}
        return SampleBlock.concatenated([block for block, _ in pieces]), boundaries

    def took(self, work: str, rows: int, seconds: float) -> None:
        """Adapt how many samples may wait to what each kind of work gets done in the time of a chunk."""
        if rows < _FEWEST_ROWS:  # they tell little about the cost of a row
            return
        pacing = self._pacing
        self._affordable[work] = int(rows * pacing.chunk_seconds / max(seconds, 1e-9))
        affordable = max(min(self._affordable.values()), _FEWEST_ROWS)
        self._most = min(affordable, _GROWTH * self._most, pacing.rows_waiting)


def _before(sample: int, boundaries: dict[int, StepBoundary]) -> StepBoundary:
    """The boundary before the piece in which a sample was found."""
    return boundaries[max(first for first in boundaries if first <= sample)]
