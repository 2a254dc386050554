"""The loop that takes a system from where it stands to its last sample."""

from __future__ import annotations

import time

import numpy as np

from rigidsim.solve.checkpoint import Position
from rigidsim.solve.corrected_stepper import CorrectedStepper, StepBoundary
from rigidsim.solve.pacing import MEASURED, Pacing, Way, WayFinder
from rigidsim.solve.precision import Precision
from rigidsim.solve.sample_buffer import SampleBuffer
from rigidsim.solve.sampler import Check, Progress, SampleReceiver
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.status import Status

_HOPELESS_STEPS = 1e15  # to the end; at the fastest pace they would take years


class IntegrationLoop:
    """Drives an integration through the samples (a ``Sampler``).

    Args:
        receiver: receives finished samples in order.
        check: asked between chunks, at least every tenth of a second or after each single step.
        start: where to go on; None begins.
    """

    def __init__(
        self,
        corrected: CorrectedStepper,
        clock: SampleClock,
        precision: Precision,
        receiver: SampleReceiver,
        check: Check,
        start: Position | None = None,
        pacing: Pacing = MEASURED,
    ) -> None:
        first = 0
        if start is not None:
            corrected.back_to(start.boundary)
            first = start.next_sample
        self.corrected = corrected
        self.stepper = corrected.stepper
        self.clock = clock
        self.precision = precision
        self.receiver = receiver
        self.check = check
        self.progress = Progress(clock.count, first)
        self.buffer = SampleBuffer(clock, receiver, pacing, first)
        self.ways = WayFinder(corrected, clock, precision, pacing)
        self._skip_from = pacing.skip_from
        self._before_last: StepBoundary | None = None
        self._account()

    def position(self) -> Position:
        """Where to go on, at a moment when everything collected was handed over.

        After the last sample this is the start of the step that holds it: a later end has samples in there.
        """
        return Position(self._before_last or self.corrected.boundary(), self.buffer.handed)

    def run(self) -> Progress:
        """Go on until the last sample is recorded or something ends the run."""
        self.progress.last_good = self.corrected.boundary()
        if self.buffer.complete:
            self._finish(self.progress.last_good)
        else:
            self._look_ahead()
        while not self.buffer.complete:
            if self.receiver.due():
                self._hand_over()
                self.receiver.save(self.position())
            stop = self.check(self.progress)
            if stop is not None:
                return self._ended(stop)
            finite = self._advance()
            if self.stepper.log.stop is not None:
                self.buffer.drop_after(self.stepper.log.stop)
                return self._ended(Status.EVENT)
            if not finite:
                return self._ended(Status.UNRESOLVED if self.progress.detail else Status.NON_FINITE)
            self._hand_over(patiently=True)
            if self.ways.steps_left > _HOPELESS_STEPS:
                self.progress.last_good = self.corrected.boundary()
                return self._ended(Status.COLLAPSED)
        return self._ended(Status.FINISHED)

    def _look_ahead(self) -> None:
        """Learn how long a step is and how long it takes, by one that is taken back."""
        boundary = self.corrected.boundary()
        started = time.perf_counter()
        self.stepper.step()
        self.ways.measured(Way.STEP, 1, time.perf_counter() - started)
        self.corrected.back_to(boundary)

    def _ended(self, status: Status) -> Progress:
        self._hand_over()
        self.progress.status = status
        return self.progress

    def _hand_over(self, *, patiently: bool = False) -> None:
        self.buffer.hand_over(patiently=patiently)
        self.progress.next_sample = self.buffer.handed

    def _account(self) -> None:
        self.progress.steps = self.stepper.steps
        self.progress.time = float(np.ldexp(float(self.stepper.time), self.clock.exponent))

    def _advance(self) -> bool:
        """One chunk of steps; False where the state stopped being finite."""
        started, before = time.perf_counter(), self.stepper.steps
        way, count = self.ways.choose(self.buffer.count, self.buffer.upcoming)
        if way is Way.SKIP:
            finite = self._skip(count)
        elif way is Way.GRID:
            finite = self._grid(count)
        elif way is Way.BLOCK:
            finite = self._block(count)
        else:
            finite = self._step_by_step(count)
        elapsed = time.perf_counter() - started
        self.ways.measured(way, self.stepper.steps - before, elapsed)
        self.progress.integration_seconds += elapsed
        self._account()
        return finite

    # --- the four ways ----------------------------------------------------------------------------------

    def _skip(self, count: int) -> bool:
        """Many steps towards a sample; if they went past it, back and again, nearer."""
        boundary = self.corrected.boundary()
        if not self.corrected.skip(count):
            return self._find_last_good(boundary)
        if self.stepper.time > self.buffer.upcoming:
            self.progress.redone_steps += self.stepper.steps - boundary.mark.steps
            self.ways.went_past()
            self.corrected.back_to(boundary)
            return True
        self._note_steps()
        return True

    def _grid(self, count: int) -> bool:
        """Whole strides from a whole time on, and the samples within them."""
        while count > 0 and not self.buffer.complete:
            boundary = self.corrected.boundary()
            part = min(count, self.corrected.left)
            longest = self.ways.longest
            while True:  # until the samples asked for reach as far as the steps
                horizon = float(self.stepper.time) + 2 * part * longest
                times = self.buffer.until(self.precision.scalar(horizon))
                finite, states = self.stepper.grid(times, part)
                if not finite:
                    return self._find_last_good(boundary)
                following = self.buffer.count + len(times)
                if following >= self.clock.count or self.clock.at(following) > self.stepper.time:
                    break
                longest *= 2
                self.corrected.back_to(boundary)
            self._note_steps()
            self._take(times[: len(states)], states)
            if self.buffer.complete:
                self._finish(boundary)
                break
            self.corrected.correct()
            if self.buffer.full or not self.stepper.at_whole_time:
                break
            count -= part
        return True

    def _block(self, count: int) -> bool:
        """Steps with continuous output, not past the next corrections."""
        boundary = self.corrected.boundary()
        finite, output = self.stepper.block(count)
        if not finite:
            return self._find_last_good(boundary)
        self._note_steps()
        times = self.buffer.until(self.stepper.time)
        if len(times):
            self._take(times, output(times))
        if self.buffer.complete:
            self._finish(boundary)
        else:
            self.corrected.correct()
        return True

    def _step_by_step(self, count: int) -> bool:
        """Single steps up to the first that reaches a sample, and on while each reaches one."""
        upcoming, boundary = self.buffer.upcoming, self.corrected.boundary()
        for _ in range(count):
            if not self.stepper.step():
                return self._find_last_good(boundary)
            self._note_steps()
            reached = upcoming <= self.stepper.time
            if reached:
                self._take_step()
                if self.buffer.complete:
                    self._finish(boundary)
                    break
            self.corrected.correct()
            if self.buffer.full:
                break
            if reached:
                upcoming, boundary = self.buffer.upcoming, self.corrected.boundary()
                if float(upcoming) - float(self.stepper.time) > self._skip_from * self.stepper.largest:
                    break
        return True

    # --- samples, and the run's end ---------------------------------------------------------------------

    def _note_steps(self) -> None:
        self.progress.smallest_step = min(self.progress.smallest_step, self.stepper.smallest)
        self.progress.largest_step = max(self.progress.largest_step, self.stepper.largest)

    def _take(self, times: np.ndarray, states: np.ndarray) -> None:
        self.buffer.take(self.corrected.samples(self.buffer.count, times, states))

    def _take_step(self) -> None:
        """The samples within the step just taken."""
        times = self.buffer.until(self.stepper.time)
        self._take(times, np.array([self.stepper.dense(t) for t in times]))

    def _finish(self, boundary: StepBoundary) -> None:
        """Back from where the last sample is passed to the first boundary past it, which is where every way
        through the samples ends; ``boundary`` is a boundary before it.
        """
        last = self.clock.at(self.clock.count - 1)
        most = self.stepper.steps - boundary.mark.steps  # the sample lies within so many steps
        self.corrected.back_to(boundary)
        while most > 1:
            here, half = self.corrected.boundary(), most // 2
            self.corrected.skip(half)
            if self.stepper.time >= last:
                self.corrected.back_to(here)
                most = half
            else:
                most -= half
        while True:
            self._before_last = self.corrected.boundary()
            self.stepper.step()
            if self.stepper.time >= last:
                return
            self.corrected.correct()

    def _find_last_good(self, boundary: StepBoundary) -> bool:
        """After a failure somewhere in many steps: walk to the last state that is finite; returns False."""
        self.corrected.back_to(boundary)
        while True:
            boundary = self.corrected.boundary()
            if not self.stepper.step():
                self.progress.detail = self.stepper.failure
                self.corrected.back_to(boundary)
                self.progress.last_good = boundary
                return False
            if not self.buffer.complete and self.buffer.upcoming <= self.stepper.time:
                self._take_step()
            self.corrected.correct()
