"""The driver, which takes a motion from its present state to its last sample, whatever solves it."""

import time

from rigidsim.solve.corrected_stepper import Position, StepBoundary
from rigidsim.solve.sampler import MEASURED, Check, Pacing, Progress, SampleBuffer, SampleReceiver
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.solvers.stepwise import StepwiseSolver
from rigidsim.solve.status import Status
from rigidsim.solve.turns import JoinedAngles


class Driver:
    """Has a solver advance, looks after guards and Ctrl-C, and hands over and saves what it finds. The check
    is called in each round, at least every tenth of a second or after each single step; most steps count from
    the run's beginning and are never exceeded.
    """

    def __init__(
        self,
        solver: StepwiseSolver,
        clock: SampleClock,
        angles: JoinedAngles,
        receiver: SampleReceiver,
        check: Check,
        start: Position | None = None,
        pacing: Pacing = MEASURED,
        most_steps: int | None = None,
        progress: Progress | None = None,
    ) -> None:
        first = 0 if start is None else start.next_row
        self.solver, self.clock, self.receiver, self.check = solver, clock, receiver, check
        self.progress, self.rows = progress or Progress(clock.count), angles.rows(clock)
        self.progress.next_sample = self.rows.samples(first)
        self.buffer = SampleBuffer(self.rows, angles, receiver, pacing, first)
        self._most_steps = most_steps
        solver.begin(clock, self.buffer, self.progress, None if start is None else start.boundary)

    def position(self) -> Position:
        """Where to continue: after the last sample, at the start of the step that holds it."""
        return Position(self.buffer.boundary or self.solver.boundary(), self.buffer.handed)

    def run(self) -> Progress:
        """Continue until the last sample is handed over, or something ends the run."""
        self.progress.last_good = self.solver.boundary()
        status = self._already_complete()
        while status is None:
            status = (
                self.check(self.progress)
                or self._out_of_steps()
                or self._save_if_due()
                or self._advance()
                or self._hand_over(patiently=True)
            )
        self.solver.stop()
        self.progress.status = self._hand_over() or status
        return self.progress

    def _already_complete(self) -> Status | None:
        """The end of a run whose samples were all taken by earlier sessions."""
        if not self.buffer.complete:
            return None
        if self.check(self.progress) is Status.MAX_DRIFT:  # passed by one of them
            return Status.MAX_DRIFT
        self.solver.settle(self.solver.boundary(), self.clock.at(self.clock.count - 1))
        return Status.FINISHED

    def _out_of_steps(self) -> Status | None:
        """MAX_STEPS once no further step is allowed; samples within the last one are still taken."""
        return Status.MAX_STEPS if self._left() == 0 and not self.solver.pending else None

    def _left(self) -> int | None:
        return None if self._most_steps is None else self._most_steps - self.progress.steps

    def _save_if_due(self) -> Status | None:
        """Save between two rounds, if it is time; what is handed over for that may end the run."""
        if not self.receiver.due():
            return None
        ended = None if self.buffer.whole else self._hand_over()
        if ended is None:
            self.receiver.save(self.position())
        return ended

    def _advance(self) -> Status | None:
        """One round of the solver, taken back if Ctrl-C ends it, as it may while something is compiled."""
        boundary, found, started = self.solver.boundary(), self.buffer.count, time.perf_counter()
        try:
            return self.solver.advance(boundary, self._left())
        except KeyboardInterrupt as signal:
            self._back_to(boundary, found)
            return self._asked_to_end(signal)
        finally:
            self.progress.integration_seconds += time.perf_counter() - started

    def _hand_over(self, *, patiently: bool = False) -> Status | None:
        """Hand over what was found; a status if that ends the run, by the receiver or by Ctrl-C."""
        try:
            refused = self.buffer.hand_over(patiently=patiently)
        except KeyboardInterrupt as signal:
            self._back_to(self.buffer.boundary or self.solver.boundary(), self.buffer.handed)
            return self._asked_to_end(signal)
        finally:
            self.progress.next_sample = self.rows.samples(self.buffer.handed)
        if refused is None:
            return None
        index, boundary = refused
        self.solver.settle(boundary, self.clock.at(index))
        return Status.MAX_DRIFT

    def _back_to(self, boundary: StepBoundary, found: int) -> None:
        self.buffer.back_to(found)
        self.solver.back_to(boundary)

    def _asked_to_end(self, signal: KeyboardInterrupt) -> Status:
        """The status of a run that Ctrl-C ends; where nobody wants to be told, the signal goes on its way."""
        stop = self.check(self.progress)
        if stop is None:
            raise signal
        return stop
