"""Taylor series step by step, by heyoka: four ways through the samples, which give the same bits."""

from __future__ import annotations

import time

import numpy as np

from rigidsim.model.system import System
from rigidsim.scene.choices import DEFAULT_METHOD, METHODS
from rigidsim.solve.corrected_stepper import CorrectedStepper, StepBoundary
from rigidsim.solve.events import EventLog
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.sampler import Pacing, Progress, SampleBuffer
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.solvers.algorithm import Algorithm, solves
from rigidsim.solve.solvers.solver import Solver
from rigidsim.solve.solvers.stepwise import Reach, StepwiseSolver
from rigidsim.solve.solvers.taylor.ways import SampleWay, WayFinder
from rigidsim.solve.stepper import SamplesWithin
from rigidsim.solve.switching.stepper import stepper_of
from rigidsim.solve.taylor_stepper import TaylorStepper

_NEAR = 4.0  # longest steps before the last sample, from which on single ones are taken
_SPARE = 0.9  # of the steps to the last sample, if as long as the longest recent one, that are taken at once
_MOST_SAMPLES = 1024  # asked for at once


class TaylorSolver(StepwiseSolver):
    """Takes many steps at once where that costs less than single ones."""

    stepper: TaylorStepper

    def __init__(self, corrected: CorrectedStepper, stepper: TaylorStepper, pacing: Pacing) -> None:
        super().__init__(corrected, pacing)
        self.stepper = stepper

    def begin(
        self, clock: SampleClock, buffer: SampleBuffer, progress: Progress, start: StepBoundary | None
    ) -> None:
        super().begin(clock, buffer, progress, start)
        self.ways = WayFinder(self.corrected, self.stepper, clock, self.pacing)

    def go_on(self, boundary: StepBoundary, most: int | None) -> bool:
        started, before = time.perf_counter(), self.stepper.steps
        way, count = self.ways.choose(self.buffer.count, self.buffer.upcoming)
        take = {
            SampleWay.SKIP: self._skip,
            SampleWay.GRID: self._grid,
            SampleWay.BLOCK: self._block,
            SampleWay.STEP: self._take,
        }[way]
        finite = take(self.allowed(count, most), boundary)
        self.ways.measured(way, self.stepper.steps - before, time.perf_counter() - started)
        return finite

    # --- the four ways ----------------------------------------------------------------------------------

    def _skip(self, count: int, boundary: StepBoundary) -> bool:
        """Take many steps towards a sample; if they pass it, go back and repeat with fewer."""
        if not self.corrected.skip(count) or self.stepper.unresolved:
            return self.lost(boundary, count)
        if self.stepper.time > self.buffer.upcoming:
            self.progress.redone_steps += self.stepper.steps - boundary.mark.steps
            self.ways.went_past()
            self.corrected.back_to(boundary)
            return True
        mark = boundary.mark
        self.ways.skipped(self.stepper.steps - mark.steps, float(self.stepper.time) - float(mark.time[0]))
        self.note_steps()
        return True

    def _grid(self, count: int, boundary: StepBoundary) -> bool:
        """Take whole strides from a whole time on, and the samples within them."""
        most = 2 * self.ways.numbers.grid_rows
        while count > 0:
            part = min(count, self.corrected.left)
            longest = self.ways.longest
            while True:  # until the samples asked for reach as far as the steps
                horizon = float(self.stepper.time) + 2 * part * longest
                times = self.buffer.until(self.stepper.precision.scalar(horizon), most)
                if len(times) == most:  # they lie closer than those by which this way was chosen
                    return self._take(part, boundary)
                finite, states = self.stepper.grid(times, part)
                if not finite or self.stepper.unresolved:
                    return self.lost(boundary, part)
                following = self.buffer.count + len(times)
                if following >= self.clock.count or self.clock.at(following) > self.stepper.time:
                    break
                longest *= 2
                self.corrected.back_to(boundary)
            self.note_steps()
            self.take(times[: len(states)], states, boundary)
            self.none_left(boundary)
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
            return self.lost(boundary, count)
        self.note_steps()
        self.reached(Reach(boundary, output))
        return True

    def _take(self, count: int, boundary: StepBoundary) -> bool:
        """Take steps up to corrections, and the samples within them; the last ones of the run singly."""
        stepper, buffer = self.stepper, self.buffer
        while count > 0:
            left = (float(self._last) - float(stepper.time)) / max(self.ways.longest, 1e-300)
            if left < _NEAR:
                return self.step_by_step(count, boundary)
            part = int(min(count, self.corrected.left, _SPARE * left))  # inf is left before the first
            times = buffer.until(self._last, min(buffer.room, _MOST_SAMPLES))
            samples = SamplesWithin(times)
            if not stepper.take(part, samples) or stepper.unresolved:
                return self.lost(boundary, part)
            self.note_steps()
            states, stop = samples.states, stepper.log.stop
            if stop is not None:
                states = states[: int((times[: len(states)] <= stop).sum())]
            if states:
                self.take(times[: len(states)], np.array(states), boundary)
            self.reached(Reach(boundary, self._dense))
            if self._reach is not None or stop is not None or self.corrected.collapsed:
                break
            if buffer.full or buffer.complete:
                break
            count, boundary = count - part, self.corrected.boundary()
        return True


@solves(METHODS[DEFAULT_METHOD])
class Taylor(Algorithm):
    """Solves any scene."""

    title = "heyoka Taylor, natural steps, dense output"
    finds_events = sets_parameters = takes_series = True
    own_errors = False

    def stepper(
        self, system: System, precision: Precision, tolerance: Scalar | None, start: Scalar, log: EventLog
    ) -> TaylorStepper:
        return stepper_of(system, precision, tolerance, start, log)

    def solver(self, corrected: CorrectedStepper, pacing: Pacing) -> Solver:
        assert isinstance(corrected.stepper, TaylorStepper)
        return TaylorSolver(corrected, corrected.stepper, pacing)
