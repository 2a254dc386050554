"""What goes between a driver and its run: progress, checks, how much at once, and the buffer of samples."""

import time
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from rigidsim.solve.precision import Scalar
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.sampling import Rows
from rigidsim.solve.status import Status
from rigidsim.solve.stepper import Mark
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
    last_good: Mark | None = None  # last step boundary with a finite state, for a run that broke down
    detail: str = ""  # why it broke down, if more is known

    @property
    def fraction(self) -> float:
        """Fraction of the samples that are recorded."""
        return self.next_sample / self.samples


Check = Callable[[Progress], Status | None]
"""Checks guards and interruptions between chunks; a status ends the run."""


class SampleReceiver(Protocol):
    """Receives samples in order, and hears when they can be saved; the base class never asks for that.

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

    def save(self, position: Mark) -> None:
        """Save everything taken so far, and the position to resume from."""
        return None


@dataclass(frozen=True)
class Pacing:
    """Amounts; no bit depends on them. Ctrl-C is heeded after no more than a chunk and its hand-over."""

    chunk_seconds: float = 0.1  # between checks of guards and Ctrl-C; well below what a user waits
    patience: float = 2.0  # seconds until samples of a slow run are handed over
    rows_at_once: int = 8192  # samples in a block that is evaluated; more are no faster, and take memory
    rows_waiting: int = 65536  # in memory before they are evaluated: 8 MB in double precision
    skipped_from: int = 12  # steps to a sample from which a call without dense output costs less
    margin: float = 0.97  # of the steps to a sample, if as long as in the latest call, that are skipped
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
        self._rows, self._angles, self._receiver, self._pacing = rows, angles, receiver, pacing
        self.handed = self.count = first
        self._waiting: list[SampleBlock] = []
        self._boundaries: list[tuple[int, Mark]] = []  # before the waiting rows from a number on
        self._most = _FEWEST_ROWS
        self._affordable: dict[str, int] = {}
        self._handed_at = time.perf_counter()
        self._times: tuple[int, np.ndarray] = 0, rows.internal(0, 0)  # of the rows asked for last

    @property
    def complete(self) -> bool:
        """Whether all samples have been found."""
        return self.count >= self._rows.count

    @property
    def full(self) -> bool:
        """Whether the waiting samples must be handed over before more are found."""
        return self.count - self.handed >= self._most

    @property
    def upcoming(self) -> Scalar:
        """Time of the next sample."""
        return self.ahead(None)[0]

    def ahead(self, far: float | None) -> np.ndarray:
        """Times of the next samples (n,), n > 0, up to the first past a time if one is given; as many as may
        wait, or where steps are cheap as many as memory holds, so that strides of steps aren't cut.
        """
        (first, times), cheap = self._times, self._rows.clock.precision.cheap
        if not first <= self.count < first + len(times):
            first, rows = self.count, self._pacing.rows_waiting if cheap else self._pacing.rows_at_once
            times = self._rows.internal(first, min(first + rows, self._rows.count))
            self._times = first, times
        times = times[self.count - first :]
        if far is None or not cheap:
            times = times[: max(self._most - (self.count - self.handed), 1)]
        return times if far is None else times[: bisect_right(times, far, key=float) + 1]

    def take(self, block: SampleBlock, boundary: Mark) -> None:
        """Take the next samples, with a step boundary before them."""
        self._waiting.append(block)
        self._boundaries.append((self.count, boundary))
        self.count += len(block)

    def back_to(self, count: int) -> None:
        """Forget all samples found since there were ``count``."""
        while self._waiting and self._waiting[-1].first >= count:
            self._waiting.pop()
            self._boundaries.pop()
        self.count = max(count, self.handed)

    def position(self, boundary: Mark) -> Mark:
        """Where to continue: before the first waiting sample; at a boundary if none waits."""
        found = self._before(self.handed) if self._waiting else boundary
        return replace(found, next_row=self.handed)

    def _before(self, row: int) -> Mark:
        return next(boundary for first, boundary in reversed(self._boundaries) if first <= row)

    @property
    def whole(self) -> bool:
        """Whether as many have been handed over as the receiver saves at the least cost."""
        return self.handed % self._receiver.rows_together == 0

    def hand_over(self, *, patiently: bool = False) -> tuple[int, Mark] | None:
        """Hand what is collected to the receiver; ``patiently`` only if it is much or old, and if much, just
        the samples that make it ``whole``.

        If the receiver wants no sample past one of them, its index and a boundary before it are returned, and
        the others dropped. A KeyboardInterrupt of the receiver is passed on: samples that it didn't take keep
        waiting.
        """
        begun, rows, started = self.handed, self._pacing.rows_at_once, time.perf_counter()
        old, waiting = started - self._handed_at >= self._pacing.patience, self.count - begun
        if not waiting or (patiently and waiting < min(rows, self._most) and not old):
            return None
        stop = self.count - self.count % self._receiver.rows_together
        if old or not patiently or stop <= begun:
            stop = self.count
        self._handed_at, whole = started, SampleBlock.concatenated(self._waiting)
        try:
            while self.handed < stop:
                at = self.handed - begun
                block, known = whole.rows(at, min(at + rows, stop - begun)), self._angles.known
                try:
                    self._receive(block)
                except KeyboardInterrupt:  # while something that it needs was compiled: it took none of these
                    self._angles.known = known
                    raise
                self.handed += len(block)
                if (wanted := self._receiver.last_wanted) is not None:
                    last, self._angles.known = self._rows.row(wanted), known
                    self._angles.joined(block.rows(0, last + 1 - block.first))
                    self.count = self.handed = last + 1
                    return wanted, self._before(last)
        finally:
            self._waiting = [whole.rows(self.handed - begun, self.count - begun)]
            self._boundaries = [(self.handed, self._before(self.handed))]
            if self.handed == self.count:
                self._waiting, self._boundaries = [], []
        self.took("hand over", stop - begun, time.perf_counter() - started)
        return None

    def _receive(self, block: SampleBlock) -> None:
        """Hand over the samples among some rows, with their angles."""
        which = self._rows.are_samples(block.first, block.first + len(block))
        block = self._angles.joined(block)
        if which.any():
            self._receiver.take(block.only(which, self._rows.samples(block.first)))

    def took(self, work: str, rows: int, seconds: float) -> None:
        """Adapt how many samples may wait to what each kind of work gets done in the time of a chunk."""
        if rows < _FEWEST_ROWS:  # they say little about the cost of a row
            return
        pacing = self._pacing
        self._affordable[work] = int(rows * pacing.chunk_seconds / max(seconds, 1e-9))
        affordable = max(min(self._affordable.values()), _FEWEST_ROWS)
        self._most = min(affordable, _GROWTH * self._most, pacing.rows_waiting)
