"""Taylor series of natural steps, by heyoka: the method of every config that names no other.

Many steps are taken in one call: without dense output while the next sample is far, else with the samples
within them. Single steps, the last ones of a run, have the same bits.
"""

from __future__ import annotations

import time

from rigidsim.model.system import System
from rigidsim.scene.choices import DEFAULT_METHOD, METHODS
from rigidsim.solve.corrected_stepper import StepBoundary
from rigidsim.solve.events import EventLog
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.solvers.algorithm import Algorithm, solves
from rigidsim.solve.solvers.stepwise import StepwiseSolver
from rigidsim.solve.stepper import SamplesWithin
from rigidsim.solve.switching.stepper import stepper_of
from rigidsim.solve.taylor_stepper import TaylorStepper


class TaylorSolver(StepwiseSolver):
    """Takes many steps at once; only the last ones of a run are single."""

    stepper: TaylorStepper
    _length = 0.0  # of a step, as far as is known, internal units

    def go_on(self, boundary: StepBoundary, most: int | None) -> bool:
        started, mark = time.perf_counter(), boundary.mark
        count, ahead = self.allowed(self._at_once, most), self._steps_to(self.buffer.upcoming)
        if ahead > self.pacing.skipped_from:
            finite = self._skip(min(count, ahead), boundary)
        elif self._steps_to(self._last) < 1:
            finite = self.step_by_step(count, boundary)
        else:
            count, left = min(count, self._steps_to(self._last)), self.corrected.left
            if count > left:  # the rest of a stride would be taken without a grid
                count -= (count - left) % self.corrected.stride
            finite = self._take(count, boundary)
        if taken := self.stepper.steps - mark.steps:
            self._length = (float(self.stepper.time) - float(mark.time[0])) / taken
            pace = taken / max(time.perf_counter() - started, 1e-9)
            self._at_once = max(1, int(pace * self.pacing.chunk_seconds))
        return finite

    def _steps_to(self, moment: Scalar) -> int:
        """Steps that probably don't pass a moment; 0 while nothing is known."""
        if self._length <= 0:
            return 0
        left = (float(moment) - float(self.stepper.time)) / self._length
        return int(min(self.pacing.margin * left - self.pacing.spare, 2.0**62))

    def _skip(self, count: int, boundary: StepBoundary) -> bool:
        """Take many steps towards a sample; if they pass it, go back."""
        if not self.corrected.skip(count) or self.stepper.unresolved:
            return self.lost(boundary, count)
        if self.stepper.time > self.buffer.upcoming:
            self.progress.redone_steps += self.stepper.steps - boundary.mark.steps
            largest = self.stepper.largest
            self.corrected.back_to(boundary)
            self._length = 2 * max(self._length, largest)
        else:
            self.note_steps()
        return True

    def _take(self, count: int, boundary: StepBoundary) -> bool:
        """Take steps up to corrections, and the samples within them."""
        stepper, buffer = self.stepper, self.buffer
        while count > 0:
            part, before = min(count, self.corrected.left), stepper.steps
            samples = self._ahead(part)
            if not stepper.take(part, samples) or stepper.unresolved:
                return self.lost(boundary, part)
            self.note_steps()
            if len(found := samples.until(stepper.log.stop)):
                self.take(samples.times[: len(found)], found, boundary)
            self.reached(boundary)
            if self._reached is not None or stepper.log.stop is not None or self.corrected.collapsed:
                break
            if buffer.full or buffer.complete:
                break
            count, boundary = count - (stepper.steps - before), self.corrected.boundary()
        return True

    def _ahead(self, count: int) -> SamplesWithin:
        """The samples that may lie within so many steps: as many as may wait, or those of a stride."""
        limit, room = self._last, self.buffer.room
        if self.stepper.precision.cheap:
            room = max(room, self.pacing.rows_waiting)
        far = float(self.stepper.time) + 2 * count * self._length
        if far < float(self._last):
            limit = self.stepper.precision.of_double(far)
        times = self.buffer.until(limit, room)
        return SamplesWithin(times, times[-1] if len(times) == room else limit)


@solves(METHODS[DEFAULT_METHOD])
class Taylor(Algorithm):
    """Solves any scene."""

    title = "heyoka Taylor, natural steps, dense output"
    finds_events = sets_parameters = takes_series = True
    own_errors = False
    solver = TaylorSolver

    def stepper(
        self, system: System, precision: Precision, tolerance: Scalar | None, start: Scalar, log: EventLog
    ) -> TaylorStepper:
        return stepper_of(system, precision, tolerance, start, log)
