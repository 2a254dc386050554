"""The loop that takes a system from its start to its last sample."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rigidsim.solve.precision import Precision
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.status import Status
from rigidsim.solve.stepper import Mark, Stepper
from rigidsim.solve.winding import INTERVAL, Winding

# Between two looks at the clock and at Ctrl-C; well below the half second that a user waits.
_CHUNK_SECONDS = 0.1
_BLOCK_STEPS = 4096
_WORTH_A_BLOCK = 64  # steps; fewer are cheaper one by one
_SPARSE = 12.0  # steps to a sample from which skipping costs less than single steps
_BLOCK_SPACING = 64.0  # steps per sample up to which blocks cost less: 0.8 us a step against 85 us a sample
_FADING = 0.98  # of the longest step, per chunk
_LOOK_AHEAD = 16  # samples
_MARGIN = 0.9  # of the predicted steps to the next sample that are skipped at once
_HOPELESS_STEPS = 1e15
_LONG_GAP = 200.0  # steps over which the mean step is a good guide
_MEAN_MARGIN = 0.85
_ROWS_AT_ONCE = 8192
_PATIENCE = 2.0  # seconds until samples of a slow run are handed over


@dataclass
class Progress:
    """How far a run is; the one mutable record of it.

    Attributes:
        next_sample: index of the first sample that isn't recorded yet.
        samples: their number.
        steps: natural steps taken.
        time: where the integration stands, seconds.
        integration_seconds: CPU-bound wall time in the engine, without recording.
    """

    samples: int
    next_sample: int = 0
    steps: int = 0
    time: float = 0.0
    smallest_step: float = float("inf")
    largest_step: float = 0.0
    redone_steps: int = 0
    status: Status = Status.RUNNING
    integration_seconds: float = 0.0
    last_good: Mark | None = None

    @property
    def fraction(self) -> float:
        """Of the samples that are recorded."""
        return self.next_sample / self.samples


Sink = Callable[[int, np.ndarray, np.ndarray, np.ndarray], None]
"""Takes (index of the first sample, times (n,), states (n, states), turns (n, angles))."""

Check = Callable[[Progress], Status | None]
"""Looks at guards and interruptions between chunks; a status ends the run."""


@dataclass
class Advance:
    """Drives a stepper through the samples.

    Attributes:
        sink: receives finished samples in order.
        check: asked between chunks, at least every tenth of a second or after each single step.
    """

    stepper: Stepper
    clock: SampleClock
    winding: Winding
    precision: Precision
    sink: Sink
    check: Check
    progress: Progress = field(init=False)
    _pace: float = field(default=0.0, init=False)  # steps per second, measured
    _longest: float = field(default=0.0, init=False)  # step of late, internal units
    _mean: float = field(default=0.0, init=False)  # step over the latest long skip; 0 where unknown

    def __post_init__(self) -> None:
        self.progress = Progress(self.clock.count)
        self._buffer: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self._buffered = 0
        self._flushed = time.perf_counter()
        self._last = float(self.clock.at(self.clock.count - 1))

    def run(self) -> Progress:
        """Go on until the last sample is recorded or something ends the run."""
        progress = self.progress
        progress.last_good = self.stepper.mark()
        while progress.next_sample + self._buffered < self.clock.count:
            stop = self.check(progress)
            if stop is not None:
                self._flush()
                # what is flushed may complete the run, or break a guard of its own
                if progress.next_sample < self.clock.count:
                    progress.status = stop
                    return progress
                break
            started = time.perf_counter()
            before = self.stepper.steps
            fine = self._go_on()
            elapsed = time.perf_counter() - started
            progress.integration_seconds += elapsed
            progress.steps = self.stepper.steps
            progress.time = float(np.ldexp(float(self.stepper.time), self.clock.exponent))
            taken = max(self.stepper.steps - before, 1)
            self._pace = taken / max(elapsed, 1e-9)
            if self.stepper.log.stop is not None:
                self._drop_after(self.stepper.log.stop)
                self._flush()
                progress.status = Status.EVENT
                return progress
            if not fine:
                self._flush()
                progress.status = Status.NON_FINITE
                return progress
            if self._buffered >= _ROWS_AT_ONCE or time.perf_counter() - self._flushed > _PATIENCE:
                self._flush()
            if self._hopeless():
                self._flush()
                progress.status = Status.COLLAPSED
                progress.last_good = self.stepper.mark()
                return progress
        self._flush()
        progress.status = Status.FINISHED
        return progress

    def _hopeless(self) -> bool:
        step = self.stepper.largest
        return step <= 0.0 or (self._last - float(self.stepper.time)) / step > _HOPELESS_STEPS

    def _go_on(self) -> bool:
        """One chunk: choose how, and never pass a wrap of angles or the patience of a user."""
        upcoming = self.clock.at(self.progress.next_sample + self._buffered)
        # steps of a tumbling body vary a lot: predict with the longest of late, which fades slowly
        self._longest = step = max(self.stepper.largest, _FADING * self._longest)
        gap = float(upcoming) - float(self.stepper.time)
        patience = max(1, int(self._pace * _CHUNK_SECONDS))
        wrap_in = INTERVAL - self.stepper.steps % INTERVAL if self.winding.positions else patience
        expected = gap / step if step > 0 else 0.0
        if step > 0 and self.precision.cheap and not self.winding.positions and self._dense(step):
            left = int((self._last - float(self.stepper.time)) / step)
            if left >= _WORTH_A_BLOCK:
                return self._block(min(_BLOCK_STEPS, max(patience, _WORTH_A_BLOCK), left))
        if expected > _SPARSE:
            count = _MARGIN * expected - 2
            if self._mean > 0 and gap / self._mean > _LONG_GAP:
                count = max(count, _MEAN_MARGIN * gap / self._mean)
            return self._wrapped(self._skip(max(1, int(min(count, patience, wrap_in))), upcoming))
        return self._step_by_step(min(patience, wrap_in), upcoming)

    def _dense(self, step: float) -> bool:
        """Whether the next samples lie so close that blocks cost less than skipping to each."""
        first = self.progress.next_sample + self._buffered
        ahead = min(first + _LOOK_AHEAD, self.clock.count - 1)
        span = float(self.clock.at(ahead)) - float(self.stepper.time)
        return span / step <= _BLOCK_SPACING * max(ahead - first, 1)

    def _wrapped(self, fine: bool) -> bool:
        if fine and self.winding.positions and self.stepper.steps % INTERVAL == 0:
            self.winding.wrap(self.stepper.state)
        return fine

    def _note_steps(self) -> None:
        self.progress.smallest_step = min(self.progress.smallest_step, self.stepper.smallest)
        self.progress.largest_step = max(self.progress.largest_step, self.stepper.largest)

    def _skip(self, count: int, upcoming: Any) -> bool:
        """Many steps towards a sample; if they went past it, back and again, nearer."""
        mark, before = self.stepper.mark(), self.stepper.steps
        begin = float(self.stepper.time)
        fine = self.stepper.skip(count)
        if not fine:
            return self._find_last_good(mark, before)
        if self.stepper.time > upcoming:
            self.progress.redone_steps += self.stepper.steps - before
            self._longest = 1.5 * max(self._longest, self.stepper.largest)
            self._mean = 0.0
            self.stepper.back_to(mark, before)
            return True
        self._note_steps()
        if count >= _LONG_GAP / 2:
            self._mean = (float(self.stepper.time) - begin) / count
        return True

    def _block(self, count: int) -> bool:
        mark, before = self.stepper.mark(), self.stepper.steps
        fine, output = self.stepper.block(count)
        if not fine:
            return self._find_last_good(mark, before)
        self._note_steps()
        first = self.progress.next_sample + self._buffered
        times = self._times_until(first, self.stepper.time)
        if len(times):
            self._keep(times, output(times))
        if first + len(times) == self.clock.count:
            # end at the first boundary past the last sample, so that the count of steps is no accident
            needed = int(np.searchsorted(np.asarray(output.times), times[-1]))
            self.stepper.back_to(mark, before)
            self.stepper.skip(max(needed, 1))
        return True

    def _step_by_step(self, count: int, upcoming: Any) -> bool:
        """Single steps up to the first that reaches a sample, and on while each reaches one."""
        mark, before = self.stepper.mark(), self.stepper.steps
        for _ in range(count):
            if not self.stepper.step():
                return self._find_last_good(mark, before)
            self._note_steps()
            if upcoming <= self.stepper.time:
                first = self.progress.next_sample + self._buffered
                times = self._times_until(first, self.stepper.time)
                self._keep(times, np.array([self.stepper.dense(t) for t in times]))
                self._wrapped(True)
                if first + len(times) >= self.clock.count:
                    break
                upcoming = self.clock.at(first + len(times))
                if float(upcoming) - float(self.stepper.time) > _SPARSE * self.stepper.largest:
                    break
                mark, before = self.stepper.mark(), self.stepper.steps
            else:
                self._wrapped(True)
        return True

    def _find_last_good(self, mark: Mark, before: int) -> bool:
        """After a failure somewhere in many steps: walk to the last state that is finite."""
        self.stepper.back_to(mark, before)
        while True:
            mark, before = self.stepper.mark(), self.stepper.steps
            if not self.stepper.step():
                self.stepper.back_to(mark, before)
                self.progress.last_good = mark
                return False
            first = self.progress.next_sample + self._buffered
            if first < self.clock.count and self.clock.at(first) <= self.stepper.time:
                times = self._times_until(first, self.stepper.time)
                self._keep(times, np.array([self.stepper.dense(t) for t in times]))

    def _times_until(self, first: int, limit: Any) -> np.ndarray:
        """Times of the samples from ``first`` on that lie at or before ``limit``."""
        pieces = []
        position = first
        while position < self.clock.count:
            times = self.clock.internal(position, min(position + _ROWS_AT_ONCE, self.clock.count))
            inside = int(np.count_nonzero(times <= limit))
            pieces.append(times[:inside])
            position += inside
            if inside < len(times):
                break
        return np.concatenate(pieces) if pieces else self.precision.zeros((0,))

    def _keep(self, times: np.ndarray, states: np.ndarray) -> None:
        turns = np.tile(self.winding.turns, (len(times), 1))
        self._buffer.append((times, states, turns))
        self._buffered += len(times)

    def _drop_after(self, time: Any) -> None:
        """Forget buffered samples past a time (an event that ends the run)."""
        kept = []
        for times, states, turns in self._buffer:
            inside = times <= time
            if inside.any():
                kept.append((times[inside], states[inside], turns[inside]))
        self._buffer = kept
        self._buffered = sum(len(times) for times, _, _ in kept)

    def _flush(self) -> None:
        """Hand the buffered samples over, in blocks of bounded size."""
        self._flushed = time.perf_counter()
        if not self._buffer:
            return
        times, states, turns = (np.concatenate(c) for c in zip(*self._buffer, strict=True))
        self._buffer, self._buffered = [], 0
        for first in range(0, len(times), _ROWS_AT_ONCE):
            rows = slice(first, first + _ROWS_AT_ONCE)
            self.sink(self.progress.next_sample, times[rows], states[rows], turns[rows])
            self.progress.next_sample += len(times[rows])
