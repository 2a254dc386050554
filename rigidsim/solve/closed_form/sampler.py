"""Samples straight from a closed form: no steps, and the same cost at any horizon."""

from __future__ import annotations

import time

from rigidsim.model.system import System
from rigidsim.solve.angle_state import AngleState
from rigidsim.solve.checkpoint import Position
from rigidsim.solve.closed_form.solution import ClosedForm
from rigidsim.solve.corrected_stepper import StepBoundary
from rigidsim.solve.pacing import MEASURED, Pacing
from rigidsim.solve.precision import Precision
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.sampler import Check, Progress, SampleReceiver
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.status import Status


class ClosedFormSampler:
    """Evaluates a closed form at the samples (a ``Sampler``).

    Attributes:
        progress: the run's progress, without steps.

    Args:
        begin: the integration's start, the only step boundary.
        angles: what the angle states stand for, at all samples.
        start: where to continue; None starts at the beginning.
    """

    def __init__(
        self,
        form: ClosedForm,
        system: System,
        begin: StepBoundary,
        angles: AngleState,
        clock: SampleClock,
        precision: Precision,
        receiver: SampleReceiver,
        check: Check,
        start: Position | None = None,
        pacing: Pacing = MEASURED,
    ) -> None:
        self._form = form
        self._system = system
        self._begin, self._angles = begin, angles
        self._clock = clock
        self._precision = precision
        self._receiver = receiver
        self._check = check
        self._rows = pacing.rows_at_once if precision.narrow else pacing.wide_rows_at_once
        self.progress = Progress(clock.count, 0 if start is None else start.next_sample)

    def position(self) -> Position:
        """Position to resume from, which is just the next sample."""
        return Position(self._begin, self.progress.next_sample)

    def run(self) -> Progress:
        """Continue until the last sample is recorded or something ends the run."""
        progress, clock = self.progress, self._clock
        started: float | None = None
        while progress.next_sample < clock.count:
            if self._receiver.due():
                self._receiver.save(self.position())
            stop = self._check(progress)
            if stop is not None:
                progress.status = stop
                return progress
            started = time.perf_counter()
            first = progress.next_sample
            times = clock.internal(first, min(first + self._rows, clock.count))
            states = self._form.states(self._system, self._precision, times, clock.start)
            progress.integration_seconds += time.perf_counter() - started
            try:
                self._receiver.take(SampleBlock.of(first, times, states, self._angles))
            except KeyboardInterrupt:  # while the code that counts turns was being compiled
                stop = self._check(progress)
                if stop is None:
                    raise
                progress.status = stop
                return progress
            last = self._receiver.last_wanted
            progress.next_sample = first + len(times) if last is None else last + 1
            progress.time = float(times[progress.next_sample - first - 1]) * 2.0**clock.exponent
            if last is not None:
                progress.status = Status.MAX_DRIFT
                return progress
        # a sample of an earlier session, the last one, may have passed the guard
        past = started is None and self._check(progress) is Status.MAX_DRIFT
        progress.status = Status.MAX_DRIFT if past else Status.FINISHED
        return progress
