"""A solver that takes natural steps and finds the samples within them: single ones, whatever takes them."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigidsim.solve.corrected_stepper import CorrectedStepper, StepBoundary
from rigidsim.solve.precision import Scalar
from rigidsim.solve.sampler import Pacing, Progress, SampleBuffer
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.solvers.solver import Solver
from rigidsim.solve.status import Status
from rigidsim.solve.stepper import OwnErrors

_CAREFUL = 2**20  # steps at once

States = Callable[[np.ndarray], np.ndarray]
"""Function from sample times (n,) to states (n, states), both in internal units."""


@dataclass(frozen=True)
class Reach:
    """Steps just taken whose samples are still to be taken: one step can hold any number of them."""

    boundary: StepBoundary
    states: States


class StepwiseSolver(Solver):
    """Takes single steps, the samples within them, and what effects do in between.

    Each round takes either a chunk of steps or a block of samples within the last steps, so that guards
    and Ctrl-C are heeded however many samples lie in a step.
    """

    def __init__(self, corrected: CorrectedStepper, pacing: Pacing) -> None:
        self.corrected, self.stepper = corrected, corrected.stepper
        self.pacing = pacing
        self._reach: Reach | None = None
        self._before: StepBoundary | None = None  # the start of the step in which the run ended
        self._careful: int | None = None  # steps at once, on the way to where the state is lost
        self._at_once = 1

    def begin(
        self, clock: SampleClock, buffer: SampleBuffer, progress: Progress, start: StepBoundary | None
    ) -> None:
        super().begin(clock, buffer, progress, start)
        self._last = clock.at(clock.count - 1)
        if start is not None:
            self.corrected.back_to(start)
        self.stepper.destination = float(self._last)
        self._account()

    def boundary(self) -> StepBoundary:
        return self._before or (self._reach.boundary if self._reach else self.corrected.boundary())

    def back_to(self, boundary: StepBoundary) -> None:
        self._reach = self._before = None
        self.corrected.back_to(boundary)
        self._account()

    @property
    def pending(self) -> bool:
        return self._reach is not None

    def advance(self, boundary: StepBoundary, most: int | None) -> Status | None:
        finite = True
        if self._reach is not None:
            self._take_reached()
        else:
            finite = self.go_on(boundary, most)
            self._account()
        if self.buffer.complete:
            return Status.FINISHED
        stop = self.stepper.log.stop
        if stop is not None and self._reach is None:
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
                self.reached(Reach(boundary, self._dense))
            if self._reach is not None or self.buffer.complete or self.buffer.full:
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

    def _dense(self, times: np.ndarray) -> np.ndarray:
        return np.array([self.stepper.dense(t) for t in times])

    def take(self, times: np.ndarray, states: np.ndarray, boundary: StepBoundary) -> None:
        """Take samples that have been found past a boundary."""
        self.buffer.take(self.corrected.samples(self.buffer.count, times, states), boundary)

    def reached(self, reach: Reach) -> None:
        """Take samples within steps just taken, as many as may wait; the rest is left to later rounds."""
        self._reach = reach
        self._take_reached()

    def _take_reached(self) -> None:
        """Take the next of the samples within steps already taken."""
        assert self._reach is not None
        stop, room = self.stepper.log.stop, self.buffer.room
        limit = self.stepper.time if stop is None else min(self.stepper.time, stop)
        times = self.buffer.until(limit, room)
        if len(times):
            started = time.perf_counter()
            self.take(times, self._reach.states(times), self._reach.boundary)
            self.buffer.took("dense output", len(times), time.perf_counter() - started)
        if self.buffer.complete or self.buffer.upcoming > limit:
            self.none_left(self._reach.boundary)

    def none_left(self, boundary: StepBoundary) -> None:
        """Continue after all samples within the last steps are taken: with corrections, or with the end."""
        self._reach = None
        if self.buffer.complete and self.stepper.steps == boundary.mark.steps + 1:
            self._before = boundary
        elif self.buffer.complete:
            self.settle(boundary, self._last)
        else:
            self.corrected.correct()

    def settle(self, boundary: StepBoundary, moment: Scalar) -> None:
        self._reach = None
        self._before = self.corrected.arrive(boundary, moment)
        self._account()

    def stop(self) -> None:
        if self._reach is not None and not self.buffer.complete:
            self.back_to(self._reach.boundary)

    def lost(self, boundary: StepBoundary, tried: int) -> bool:
        """After a failure among many steps, or steps too small to be taken at once, go back and continue with
        fewer at a time up to the last finite state; False if a single step fails.
        """
        self.progress.detail = self.stepper.failure if tried == 1 else ""
        self.corrected.back_to(boundary)
        self.progress.last_good = boundary
        self._careful = max(1, tried // 2)
        return tried > 1

    def errors(self) -> OwnErrors | None:
        """See ``Solver``: what its stepper tells."""
        return self.stepper.errors()
