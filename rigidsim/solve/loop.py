"""The integration loop, which takes a system from its present state to its last sample."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import ClassVar, TypeAlias

import numpy as np

from rigidsim.solve.checkpoint import Position
from rigidsim.solve.corrected_stepper import CorrectedStepper, StepBoundary
from rigidsim.solve.pacing import MEASURED, Pacing, SampleWay, WayFinder
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.sample_buffer import SampleBuffer
from rigidsim.solve.sampler import Check, Progress, Reach, SampleReceiver
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.status import Status
from rigidsim.solve.taylor_stepper import TaylorStepper

_CAREFUL = 2**20  # steps at once


class IntegrationLoop:
    """Drives an integration through the samples (a ``Sampler``).

    Each round takes either a chunk of steps or a block of samples within the last steps, so that guards
    and Ctrl-C are heeded however many samples lie in a step. Where a run ends, its steps follow from the
    samples and the motion alone, never from the chunk that happened to hold them.

    Args:
        receiver: receives finished samples in order, and may name the last one that it wants.
        check: called in each round, at least every tenth of a second or after each single step.
        start: where to continue; None starts at the beginning.
        most_steps: limit of natural steps, counted from the run's beginning, that is never exceeded.
    """

    def __init__(
        self,
        corrected: CorrectedStepper[TaylorStepper],
        clock: SampleClock,
        precision: Precision,
        receiver: SampleReceiver,
        check: Check,
        start: Position | None = None,
        pacing: Pacing = MEASURED,
        most_steps: int | None = None,
    ) -> None:
        first = 0 if start is None else start.next_sample
        if start is not None:
            corrected.back_to(start.boundary)
        self.corrected = corrected
        self.stepper = corrected.stepper
        self.clock = clock
        self.precision = precision
        self.receiver = receiver
        self.check = check
        self.progress = Progress(clock.count, first)
        self.buffer = SampleBuffer(clock, receiver, pacing, first)
        self.ways = WayFinder(corrected, clock, precision, pacing)
        self.last = clock.at(clock.count - 1)
        self.stepper.destination = float(self.last)
        self._unit = float(np.ldexp(1.0, clock.exponent))
        self._most_steps = most_steps
        self._pacing = pacing
        self._reach: Reach | None = None
        self._before: StepBoundary | None = None  # the start of the step in which the run ended
        self._careful: int | None = None  # steps at once, on the way to where the state is lost
        self._account()

    def position(self) -> Position:
        """Where to continue after the samples that were handed over.

        After the last sample this is the start of the step that holds it: a later end has samples in there.
        """
        return Position(self.buffer.boundary or self._here(), self.buffer.handed)

    def _here(self) -> StepBoundary:
        """Where to continue after the samples that were found."""
        return self._before or (self._reach.boundary if self._reach else self.corrected.boundary())

    def run(self) -> Progress:
        """Continue until the last sample is recorded or something ends the run."""
        self.progress.last_good = self.corrected.boundary()
        if self.buffer.complete:
            if self.check(self.progress) is Status.MAX_DRIFT:  # passed by a sample of an earlier session
                return self._ended(Status.MAX_DRIFT)
            self._settle(self.progress.last_good, self.last)
            return self._ended(Status.FINISHED)
        self.ways.look_ahead(self.progress.last_good)
        while True:
            stop = self.check(self.progress) or self._out_of_steps()
            if stop is None:
                if self.receiver.due():
                    if not self.buffer.whole and not self._hand_over():
                        return self.progress
                    self.receiver.save(self.position())
                stop = self._interruptible_round()
            if stop is not None:
                return self._ended(stop)
            if not self._hand_over(patiently=True):
                return self.progress

    def _interruptible_round(self) -> Status | None:
        """One round, taken back if Ctrl-C ends it, as it may while another chart is being compiled."""
        boundary, found = self._here(), self.buffer.count
        try:
            return self._round(boundary)
        except KeyboardInterrupt:
            self._reach = self._before = None
            self.buffer.back_to(found)
            self.corrected.back_to(boundary)
            self._account()
            stop = self.check(self.progress)
            if stop is None:  # nobody here wants to be told
                raise
            return stop

    def _round(self, boundary: StepBoundary) -> Status | None:
        """Take a chunk of steps, or a block of samples within those taken; returns the status if the run ends
        here.
        """
        log, finite = self.stepper.log, True
        if self._reach is not None:
            started = time.perf_counter()
            self._take_reached()
            self.progress.integration_seconds += time.perf_counter() - started
        else:
            finite = self._advance(boundary)
        if self.buffer.complete:
            return Status.FINISHED
        if log.stop is not None and self._reach is None:
            self._settle(boundary, log.stop)
            return Status.EVENT
        if self.corrected.collapsed:
            self.progress.last_good, self._before = self.corrected.boundary(), boundary
            return Status.COLLAPSED
        if not finite:
            return Status.UNRESOLVED if self.progress.detail else Status.NON_FINITE
        return None

    def _out_of_steps(self) -> Status | None:
        """MAX_STEPS once no further step is allowed; samples within the last one are still taken."""
        return Status.MAX_STEPS if self._reach is None and self._allowed(1) == 0 else None

    def _allowed(self, count: int) -> int:
        """The given number of steps, or as many as the step limit still allows."""
        return count if self._most_steps is None else min(count, self._most_steps - self.stepper.steps)

    def _ended(self, status: Status) -> Progress:
        if self._reach is not None and not self.buffer.complete:
            self.corrected.back_to(self._reach.boundary)  # some of its samples are still to be taken
            self._reach = None
            self._account()
        if self._hand_over():
            self.progress.status = status
        return self.progress

    def _hand_over(self, *, patiently: bool = False) -> bool:
        """Hand over what is collected; False if the receiver ended the run at one of the samples.

        Also False if Ctrl-C came while something that samples need was being compiled; samples not taken are
        left to the next session.
        """
        try:
            refused = self.buffer.hand_over(patiently=patiently)
        except KeyboardInterrupt:
            stop = self.check(self.progress)
            if stop is None:
                raise
            self.progress.status, self.progress.next_sample = stop, self.buffer.handed
            return False
        self.progress.next_sample = self.buffer.handed
        if refused is None:
            return True
        index, boundary = refused
        self._reach = None
        self._settle(boundary, self.clock.at(index))
        self.progress.status = Status.MAX_DRIFT
        return False

    def _account(self) -> None:
        self.progress.steps = self.stepper.steps
        self.progress.time = float(self.stepper.time) * self._unit

    def _advance(self, boundary: StepBoundary) -> bool:
        """Take one chunk of steps from a boundary, which is here; False if the state stopped being finite."""
        started, before = time.perf_counter(), self.stepper.steps
        way, count = self.ways.choose(self.buffer.count, self.buffer.upcoming)
        count = self._allowed(count)
        if self._careful is not None:
            count = min(count, self._careful)
            self._careful = 2 * self._careful if self._careful < _CAREFUL else None
        finite = self._WAYS[way](self, count, boundary)
        elapsed = time.perf_counter() - started
        self.ways.measured(way, self.stepper.steps - before, elapsed)
        self.progress.integration_seconds += elapsed
        self._account()
        return finite

    # --- the four ways ----------------------------------------------------------------------------------

    def _skip(self, count: int, boundary: StepBoundary) -> bool:
        """Take many steps towards a sample; if they pass it, go back and repeat with fewer."""
        if not self.corrected.skip(count) or self.stepper.unresolved:
            return self._lost(boundary, count)
        if self.stepper.time > self.buffer.upcoming:
            self.progress.redone_steps += self.stepper.steps - boundary.mark.steps
            self.ways.went_past()
            self.corrected.back_to(boundary)
            return True
        mark = boundary.mark
        self.ways.skipped(self.stepper.steps - mark.steps, float(self.stepper.time) - float(mark.time[0]))
        self._note_steps()
        return True

    def _grid(self, count: int, boundary: StepBoundary) -> bool:
        """Take whole strides from a whole time on, and the samples within them."""
        most = 2 * self._pacing.grid_rows
        while count > 0:
            part = min(count, self.corrected.left)
            longest = self.ways.longest
            while True:  # until the samples asked for reach as far as the steps
                horizon = float(self.stepper.time) + 2 * part * longest
                times = self.buffer.until(self.precision.scalar(horizon), most)
                if len(times) == most:  # they lie closer than those by which this way was chosen
                    return self._step_by_step(part, boundary)
                finite, states = self.stepper.grid(times, part)
                if not finite or self.stepper.unresolved:
                    return self._lost(boundary, part)
                following = self.buffer.count + len(times)
                if following >= self.clock.count or self.clock.at(following) > self.stepper.time:
                    break
                longest *= 2
                self.corrected.back_to(boundary)
            self._note_steps()
            self._take(times[: len(states)], states, boundary)
            self._none_left(boundary)
            if self.buffer.full or self.buffer.complete or self.corrected.collapsed:
                break
            if not self.stepper.at_whole_time:
                break
            count, boundary = count - part, self.corrected.boundary()
        return True

    def _block(self, count: int, boundary: StepBoundary) -> bool:
        """Take steps with continuous output, not past the next correction."""
        finite, output = self.stepper.block(count)
        if not finite or self.stepper.unresolved:
            return self._lost(boundary, count)
        self._note_steps()
        self._reached(Reach(boundary, output))
        return True

    def _step_by_step(self, count: int, boundary: StepBoundary) -> bool:
        """Take single steps up to the first that reaches a sample, and on as long as each reaches one."""
        upcoming, tried = self.buffer.upcoming, 0
        for _ in range(count):
            if tried and float(upcoming) - float(self.stepper.time) < self.stepper.largest:
                boundary, tried = self.corrected.boundary(), 0  # so that nothing is taken back at the end
            tried += 1
            if not self.stepper.step():
                return self._lost(boundary, tried)
            self._note_steps()
            reached = upcoming <= self.stepper.time
            if not reached:
                self.corrected.correct()
            else:
                self._reached(Reach(boundary, self._dense))
            if self._reach is not None or self.buffer.complete or self.buffer.full:
                break
            if self.stepper.log.stop is not None or self.corrected.collapsed:
                break
            if reached:
                upcoming, boundary, tried = self.buffer.upcoming, self.corrected.boundary(), 0
                if float(upcoming) - float(self.stepper.time) > self._pacing.skip_from * self.stepper.largest:
                    break
        return True

    _Take: TypeAlias = "Callable[[IntegrationLoop, int, StepBoundary], bool]"
    _WAYS: ClassVar[dict[SampleWay, _Take]] = {
        SampleWay.SKIP: _skip,
        SampleWay.GRID: _grid,
        SampleWay.BLOCK: _block,
        SampleWay.STEP: _step_by_step,
    }

    # --- samples, and the run's end ---------------------------------------------------------------------

    def _note_steps(self) -> None:
        self.progress.smallest_step = min(self.progress.smallest_step, self.stepper.smallest)
        self.progress.largest_step = max(self.progress.largest_step, self.stepper.largest)

    def _dense(self, times: np.ndarray) -> np.ndarray:
        return np.array([self.stepper.dense(t) for t in times])

    def _take(self, times: np.ndarray, states: np.ndarray, boundary: StepBoundary) -> None:
        self.buffer.take(self.corrected.samples(self.buffer.count, times, states), boundary)

    def _reached(self, reach: Reach) -> None:
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
            self._take(times, self._reach.states(times), self._reach.boundary)
            self.buffer.took("dense output", len(times), time.perf_counter() - started)
        if self.buffer.complete or self.buffer.upcoming > limit:
            self._none_left(self._reach.boundary)

    def _none_left(self, boundary: StepBoundary) -> None:
        """Continue after all samples within the last steps are taken: with corrections, or with the end."""
        self._reach = None
        if self.buffer.complete and self.stepper.steps == boundary.mark.steps + 1:
            self._before = boundary
        elif self.buffer.complete:
            self._settle(boundary, self.last)
        else:
            self.corrected.correct()

    def _settle(self, boundary: StepBoundary, moment: Scalar) -> None:
        """Go back to a boundary before a moment, then on to the first boundary at or past it, where every way
        ends.
        """
        self._before = self.corrected.arrive(boundary, moment)
        self._account()

    def _lost(self, boundary: StepBoundary, tried: int) -> bool:
        """After a failure among many steps, or steps too small to be taken at once, go back and continue with
        fewer at a time up to the last finite state; False if a single step fails.
        """
        self.progress.detail = self.stepper.failure if tried == 1 else ""
        self.corrected.back_to(boundary)
        self.progress.last_good = boundary
        self._careful = max(1, tried // 2)
        return tried > 1
