"""A solver that takes natural steps and finds the samples within them: single ones, whatever takes them."""

import time

import numpy as np

from rigidsim.solve.corrected_stepper import CorrectedStepper, StepBoundary
from rigidsim.solve.precision import Scalar
from rigidsim.solve.sampler import Pacing, Progress, SampleBuffer
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.status import Status

_CAREFUL = 2**20  # steps at once


class StepwiseSolver:
    """Takes single steps, the samples within them, and what effects do in between.

    Each round takes either a chunk of steps or a block of samples within the last steps, so that guards
    and Ctrl-C are heeded however many samples lie in a step.
    """

    def __init__(self, corrected: CorrectedStepper, pacing: Pacing) -> None:
        self.corrected, self.stepper = corrected, corrected.stepper
        self.pacing = pacing
        self._reached: StepBoundary | None = None  # before steps with samples left to take
        self._before: StepBoundary | None = None  # the start of the step in which the run ended
        self._careful: int | None = None  # steps at once, on the way to where the state is lost
        self._at_once = 1

    def begin(
        self, clock: SampleClock, buffer: SampleBuffer, progress: Progress, start: StepBoundary | None
    ) -> None:
        """Get ready, at a boundary or, without one, where it stands; samples go to the buffer."""
        self.clock, self.buffer, self.progress = clock, buffer, progress
        self._last = clock.at(clock.count - 1)
        if start is not None:
            self.corrected.back_to(start)
        self.stepper.destination = float(self._last)
        self._account()

    def boundary(self) -> StepBoundary:
        """A boundary past which all samples are still to be found; after the last sample, one before it."""
        return self._before or self._reached or self.corrected.boundary()

    def back_to(self, boundary: StepBoundary) -> None:
        """Return to an earlier boundary; samples found past it have been dropped."""
        self._reached = self._before = None
        self.corrected.back_to(boundary)
        self._account()

    @property
    def pending(self) -> bool:
        """Whether steps have been taken whose samples aren't all found yet."""
        return self._reached is not None

    def advance(self, boundary: StepBoundary, most: int | None) -> Status | None:
        """Go on for about the time of a chunk, or until the buffer is full, by at most so many natural steps.

        Returns:
            The status if the motion ends here: FINISHED once the last sample is found.
        """
        finite = True
        if self._reached is not None:
            self._take_reached()
        else:
            finite = self.go_on(boundary, most)
            self._account()
        if self.buffer.complete:
            return Status.FINISHED
        stop = self.stepper.log.stop
        if stop is not None and self._reached is None:
            self.settle(boundary, stop)
            return self.stepper.log.status
        if self.corrected.collapsed:
            self.progress.last_good, self._before = self.corrected.boundary(), boundary
            return Status.COLLAPSED
        if not finite:
            return Status.UNRESOLVED if self.progress.detail else Status.NON_FINITE
        return None

    def go_on(self, boundary: StepBoundary, most: int | None) -> bool:
        """Take a chunk of steps, and samples within them; False if the state stopped being finite."""
        started, before = time.perf_counter(), self.stepper.steps
        finite = self.step_by_step(self.allowed(self._at_once, most), boundary)
        pace = (self.stepper.steps - before) / max(time.perf_counter() - started, 1e-9)
        self._at_once = max(1, int(pace * self.pacing.chunk_seconds))
        return finite

    def allowed(self, count: int, most: int | None) -> int:
        """The given number of steps, or as many as the step limit and a failure nearby allow."""
        count = count if most is None else min(count, most)
        if self._careful is not None:
            count = min(count, self._careful)
            self._careful = 2 * self._careful if self._careful < _CAREFUL else None
        return count

    def step_by_step(self, count: int, boundary: StepBoundary) -> bool:
        """Take single steps, and the samples within them."""
        upcoming, tried = self.buffer.upcoming, 0
        for _ in range(count):
            if tried and float(upcoming) - float(self.stepper.time) < self.stepper.largest:
                boundary, tried = self.corrected.boundary(), 0  # so that nothing is taken back at the end
            tried += 1
            if not self.stepper.step():
                return self.lost(boundary, tried)
            self.note_steps()
            reached = upcoming <= self.stepper.time
            if not reached:
                self.corrected.correct()
            else:
                self.reached(boundary)
            if self._reached is not None or self.buffer.complete or self.buffer.full:
                break
            if self.stepper.log.stop is not None or self.corrected.collapsed:
                break
            if reached:
                upcoming, boundary, tried = self.buffer.upcoming, self.corrected.boundary(), 0
        return True

    # --- samples, and the run's end ---------------------------------------------------------------------

    def note_steps(self) -> None:
        """Note the sizes of the steps of the latest call."""
        self.progress.smallest_step = min(self.progress.smallest_step, self.stepper.smallest)
        self.progress.largest_step = max(self.progress.largest_step, self.stepper.largest)

    def _account(self) -> None:
        self.progress.steps = self.stepper.steps
        self.progress.time = float(self.stepper.time) * self.clock.unit

    def take(self, times: np.ndarray, states: np.ndarray, boundary: StepBoundary) -> None:
        """Take samples that have been found past a boundary."""
        self.buffer.take(self.corrected.samples(self.buffer.count, times, states), boundary)

    def reached(self, boundary: StepBoundary) -> None:
        """Take samples within steps just taken, as many as may wait; the rest is left to later rounds."""
        self._reached = boundary
        self._take_reached()

    def _take_reached(self) -> None:
        """Take the next of the samples within steps already taken."""
        boundary = self._reached
        assert boundary is not None
        stop, room = self.stepper.log.stop, self.buffer.room
        limit = self.stepper.time if stop is None else min(self.stepper.time, stop)
        times = self.buffer.until(limit, room)
        if len(times):
            started = time.perf_counter()
            self.take(times, self.stepper.dense_rows(times), boundary)
            self.buffer.took("dense output", len(times), time.perf_counter() - started)
        if self.buffer.complete or self.buffer.upcoming > limit:
            self.none_left(boundary)

    def none_left(self, boundary: StepBoundary) -> None:
        """Continue after all samples within the last steps are taken: with corrections, or with the end."""
        self._reached = None
        if self.buffer.complete and self.stepper.steps == boundary.mark.steps + 1:
            self._before = boundary
        elif self.buffer.complete:
            self.settle(boundary, self._last)
        else:
            self.corrected.correct()

    def settle(self, boundary: StepBoundary, moment: Scalar) -> None:
        """Go back to a boundary before a moment and on to the first at or past it, so that where a run ends
        follows from the samples and the motion alone.
        """
        self._reached = None
        self._before = self.corrected.arrive(boundary, moment)
        self._account()

    def stop(self) -> None:
        """Give up steps whose samples aren't all found: a run that is resumed takes them again."""
        if self._reached is not None and not self.buffer.complete:
            self.back_to(self._reached)

    def lost(self, boundary: StepBoundary, tried: int) -> bool:
        """After a failure among many steps, or steps too small to be taken at once, go back and continue with
        fewer at a time up to the last finite state; False if a single step fails.
        """
        self.progress.detail = self.stepper.failure if tried == 1 else ""
        self.corrected.back_to(boundary)
        self.progress.last_good = boundary
        self._careful = max(1, tried // 2)
        return tried > 1
