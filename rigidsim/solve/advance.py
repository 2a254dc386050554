"""The loop that takes a system from where it stands to its last sample."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rigidsim.solve.harvest import ROWS_AT_ONCE, Checkpoint, Harvest, Keeper
from rigidsim.solve.precision import Precision
from rigidsim.solve.rhythm import Place, Rhythm
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.status import Status

# Between two looks at the clock and at Ctrl-C; well below the half second that a user waits.
_CHUNK_SECONDS = 0.1
_BLOCK_STEPS = 4096
_WORTH_A_BLOCK = 64  # steps; fewer are cheaper one by one
_WORTH_A_GRID = 8
_GRID_STRIDES = 4.0  # per sample, up to which grids (20 us each) cost less than skipping to each (85 us)
_BLOCK_SPACING = 64.0  # steps per sample up to which blocks cost less than that: 0.8 us a step
_GRID_ROWS = 2 * ROWS_AT_ONCE  # in a stride, which can't be shortened: bounds the memory
_MOST_WAITING = 4 * ROWS_AT_ONCE  # samples in memory before they are evaluated, however fast they come
_SPARSE = 12.0  # steps to a sample from which skipping costs less than single steps
_FADING = 0.98  # of the longest step, per chunk
_LOOK_AHEAD = 16  # samples
_MARGIN = 0.9  # of the predicted steps to the next sample that are skipped at once
_HOPELESS_STEPS = 1e15
_LONG_GAP = 200.0  # steps over which the mean step is a good guide
_MEAN_MARGIN = 0.85


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
    last_good: Place | None = None

    @property
    def fraction(self) -> float:
        """Of the samples that are recorded."""
        return self.next_sample / self.samples


Check = Callable[[Progress], Status | None]
"""Looks at guards and interruptions between chunks; a status ends the run."""


@dataclass
class Advance:
    """Drives an integration through the samples.

    Attributes:
        keeper: receives finished samples in order.
        check: asked between chunks, at least every tenth of a second or after each single step.
        start: where to go on; None begins.
    """

    rhythm: Rhythm
    clock: SampleClock
    precision: Precision
    keeper: Keeper
    check: Check
    start: Checkpoint | None = None
    progress: Progress = field(init=False)
    _before_last: Place | None = field(default=None, init=False)
    _pace: float = field(default=0.0, init=False)  # steps per second, measured
    _longest: float = field(default=0.0, init=False)  # step of late, internal units
    _mean: float = field(default=0.0, init=False)  # step over the latest long skip; 0 where unknown

    def __post_init__(self) -> None:
        first = 0
        if self.start is not None:
            self.rhythm.back_to(self.start.place)
            first = self.start.next_sample
        self.stepper = self.rhythm.stepper
        self.progress = Progress(self.clock.count, first)
        self.harvest = Harvest(self.clock, self.keeper, first)
        self._last = float(self.clock.at(self.clock.count - 1))
        self._account()

    def checkpoint(self) -> Checkpoint:
        """Where to go on, at a moment when everything collected was handed over.

        After the last sample this is the start of the step that holds it: a later end has samples in there.
        """
        return Checkpoint(self._before_last or self.rhythm.place(), self.harvest.handed)

    def run(self) -> Progress:
        """Go on until the last sample is recorded or something ends the run."""
        progress, harvest = self.progress, self.harvest
        progress.last_good = self.rhythm.place()
        if self.harvest.complete:
            self._finish(progress.last_good)
        else:
            self._look_ahead()
        while not harvest.complete:
            if self.keeper.due():
                self._hand_over()
                self.keeper.save(self.checkpoint())
            stop = self.check(progress)
            if stop is not None:
                self._hand_over()
                # what is handed over may complete the run, or break a guard of its own
                if not harvest.complete:
                    progress.status = stop
                    return progress
                break
            started = time.perf_counter()
            before = self.stepper.steps
            fine = self._go_on()
            elapsed = time.perf_counter() - started
            progress.integration_seconds += elapsed
            self._account()
            self._pace = max(self.stepper.steps - before, 1) / max(elapsed, 1e-9)
            if self.stepper.log.stop is not None:
                harvest.drop_after(self.stepper.log.stop)
                return self._ended(Status.EVENT)
            if not fine:
                return self._ended(Status.NON_FINITE)
            self._hand_over(patiently=True)
            if self._hopeless():
                progress.last_good = self.rhythm.place()
                return self._ended(Status.COLLAPSED)
        return self._ended(Status.FINISHED)

    def _look_ahead(self) -> None:
        """Learn how long a step is and how long it takes, by one that is taken back."""
        place = self.rhythm.place()
        started = time.perf_counter()
        self.stepper.step()
        self._pace = 1 / max(time.perf_counter() - started, 1e-9)
        self.rhythm.back_to(place)

    def _ended(self, status: Status) -> Progress:
        self._hand_over()
        self.progress.status = status
        return self.progress

    def _account(self) -> None:
        self.progress.steps = self.stepper.steps
        self.progress.time = float(np.ldexp(float(self.stepper.time), self.clock.exponent))

    def _hand_over(self, *, patiently: bool = False) -> None:
        self.harvest.hand_over(patiently=patiently)
        self.progress.next_sample = self.harvest.handed

    def _hopeless(self) -> bool:
        step = self.stepper.largest
        return step <= 0.0 or (self._last - float(self.stepper.time)) / step > _HOPELESS_STEPS

    def _go_on(self) -> bool:
        """One chunk of steps: choose how, within the patience of a user."""
        upcoming = self.harvest.upcoming
        # steps of a tumbling body vary a lot: predict with the longest of late, which fades slowly
        self._longest = step = max(self.stepper.largest, _FADING * self._longest)
        gap = float(upcoming) - float(self.stepper.time)
        patience = max(1, int(self._pace * _CHUNK_SECONDS))
        expected = gap / step if step > 0 else 0.0
        if step > 0 and self.precision.cheap:
            left = int(min((self._last - float(self.stepper.time)) / step, 2.0**62))
            spacing = self._spacing(step)
            griddable = self.rhythm.whole_times and spacing * _GRID_ROWS >= self.rhythm.stride
            if griddable and spacing <= _GRID_STRIDES * self.rhythm.stride:
                if self.stepper.at_whole_time and left >= _WORTH_A_GRID:
                    stride = self.rhythm.stride
                    # past the end rather than almost there: what is left would go step by step
                    count = min(patience, left + left // 2 + _WORTH_A_GRID)
                    return self._grid(count - count % stride if count > stride else count)
                patience = min(patience, self.rhythm.left)  # to where grids can start
            elif spacing <= _BLOCK_SPACING and min(left, self.rhythm.left) >= _WORTH_A_BLOCK:
                most = max(1, int(ROWS_AT_ONCE * spacing), _WORTH_A_BLOCK)
                return self._block(min(_BLOCK_STEPS, most, self.rhythm.left, left))
            elif spacing <= _BLOCK_SPACING:
                patience = min(patience, self.rhythm.left)  # to where blocks are worth it again
        if expected > _SPARSE:
            steps = _MARGIN * expected - 2
            if self._mean > 0 and gap / self._mean > _LONG_GAP:
                steps = max(steps, _MEAN_MARGIN * gap / self._mean)
            return self._skip(max(1, int(min(steps, patience))), upcoming)
        return self._step_by_step(patience, upcoming)

    def _spacing(self, step: float) -> float:
        """Steps per sample, over the next samples."""
        ahead = min(self.harvest.count + _LOOK_AHEAD, self.clock.count - 1)
        span = float(self.clock.at(ahead)) - float(self.stepper.time)
        return span / step / max(ahead - self.harvest.count, 1)

    def _note_steps(self) -> None:
        self.progress.smallest_step = min(self.progress.smallest_step, self.stepper.smallest)
        self.progress.largest_step = max(self.progress.largest_step, self.stepper.largest)

    def _skip(self, count: int, upcoming: Any) -> bool:
        """Many steps towards a sample; if they went past it, back and again, nearer."""
        place, begin = self.rhythm.place(), float(self.stepper.time)
        if not self.rhythm.skip(count):
            return self._find_last_good(place)
        if self.stepper.time > upcoming:
            self.progress.redone_steps += self.stepper.steps - place.mark.steps
            self._longest = 1.5 * max(self._longest, self.stepper.largest)
            self._mean = 0.0
            self.rhythm.back_to(place)
            return True
        self._note_steps()
        if count >= _LONG_GAP / 2:
            self._mean = (float(self.stepper.time) - begin) / count
        return True

    def _grid(self, count: int) -> bool:
        """Whole strides from a whole time on, and the samples within them."""
        while count > 0 and not self.harvest.complete:
            place = self.rhythm.place()
            part = min(count, self.rhythm.left)
            longest, times = self._longest, self.clock.internal(0, 0)
            while True:  # until the samples asked for reach as far as the steps
                horizon = float(self.stepper.time) + 2 * part * longest
                times = self.harvest.until(self.precision.scalar(horizon))
                fine, states = self.stepper.grid(times, part)
                if not fine:
                    return self._find_last_good(place)
                following = self.harvest.count + len(times)
                if following >= self.clock.count or self.clock.at(following) > self.stepper.time:
                    break
                longest *= 2
                self.rhythm.back_to(place)
            self._note_steps()
            times = times[: len(states)]
            self.harvest.take(times, states, self.rhythm.rows(times), self.rhythm.put_back)
            if self.harvest.complete:
                self._finish(place)
                break
            self.rhythm.correct()
            waiting = self.harvest.count - self.harvest.handed
            if waiting >= _MOST_WAITING or not self.stepper.at_whole_time:
                break
            count -= part
        return True

    def _block(self, count: int) -> bool:
        """Steps with continuous output, not past the next corrections."""
        place = self.rhythm.place()
        fine, output = self.stepper.block(count)
        if not fine:
            return self._find_last_good(place)
        self._note_steps()
        times = self.harvest.until(self.stepper.time)
        if len(times):
            self.harvest.take(times, output(times), self.rhythm.rows(times), self.rhythm.put_back)
        if self.harvest.complete:
            self._finish(place)
        else:
            self.rhythm.correct()
        return True

    def _step_by_step(self, count: int, upcoming: Any) -> bool:
        """Single steps up to the first that reaches a sample, and on while each reaches one."""
        place = self.rhythm.place()
        for _ in range(count):
            if not self.stepper.step():
                return self._find_last_good(place)
            self._note_steps()
            reached = upcoming <= self.stepper.time
            if reached:
                self._take_step()
                if self.harvest.complete:
                    self._finish(place)
                    break
            self.rhythm.correct()
            if self.harvest.count - self.harvest.handed >= _MOST_WAITING:
                break
            if reached:
                upcoming = self.harvest.upcoming
                place = self.rhythm.place()
                if float(upcoming) - float(self.stepper.time) > _SPARSE * self.stepper.largest:
                    break
        return True

    def _finish(self, place: Place) -> None:
        """Back from where the last sample is passed to the first boundary past it, which is where every way
        through the samples ends; ``place`` is a boundary before it.
        """
        last = self.clock.at(self.clock.count - 1)
        most = self.stepper.steps - place.mark.steps  # the sample lies within so many steps
        self.rhythm.back_to(place)
        while most > 1:
            here, half = self.rhythm.place(), most // 2
            self.rhythm.skip(half)
            if self.stepper.time >= last:
                self.rhythm.back_to(here)
                most = half
            else:
                most -= half
        while True:
            self._before_last = self.rhythm.place()
            self.stepper.step()
            if self.stepper.time >= last:
                return
            self.rhythm.correct()

    def _take_step(self) -> None:
        """The samples within the step just taken."""
        times = self.harvest.until(self.stepper.time)
        states = np.array([self.stepper.dense(t) for t in times])
        self.harvest.take(times, states, self.rhythm.rows(times), self.rhythm.put_back)

    def _find_last_good(self, place: Place) -> bool:
        """After a failure somewhere in many steps: walk to the last state that is finite."""
        self.rhythm.back_to(place)
        while True:
            place = self.rhythm.place()
            if not self.stepper.step():
                self.rhythm.back_to(place)
                self.progress.last_good = place
                return False
            if not self.harvest.complete and self.harvest.upcoming <= self.stepper.time:
                self._take_step()
            self.rhythm.correct()
