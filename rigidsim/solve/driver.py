"""The driver, which takes a motion from its present state to its last sample, whatever takes its steps.

Many steps are taken in one call: without samples while the next one is far, else with the samples within
them. Steps are never shortened for a sample, and no bit depends on how many are taken at once.
"""

import time

from rigidsim.solve.corrected_stepper import CorrectedStepper
from rigidsim.solve.precision import Scalar
from rigidsim.solve.sampler import MEASURED, Check, Pacing, Progress, SampleBuffer, SampleReceiver
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.status import Status
from rigidsim.solve.stepper import Mark, SamplesWithin
from rigidsim.solve.turns import JoinedAngles


class Driver:
    """Takes steps, the samples within them, and what effects do in between; hands over and saves what it
    finds. Each round takes either some steps or, of many samples within the last step, the next ones; guards
    and Ctrl-C are looked after in between, at least every tenth of a second or after each single step. Most
    steps count from the run's beginning and are never exceeded.
    """

    def __init__(
        self,
        corrected: CorrectedStepper,
        clock: SampleClock,
        angles: JoinedAngles,
        receiver: SampleReceiver,
        check: Check,
        start: Mark | None = None,
        pacing: Pacing = MEASURED,
        most_steps: int | None = None,
        progress: Progress | None = None,
    ) -> None:
        first = 0 if start is None else start.next_row
        self.corrected, self.stepper, self.clock = corrected, corrected.stepper, clock
        self.receiver, self.check = receiver, check
        self.progress, self.rows = progress or Progress(clock.count), angles.rows(clock)
        self.progress.next_sample = self.rows.samples(first)
        self.buffer = SampleBuffer(self.rows, angles, receiver, pacing, first)
        self._pacing, self._most_steps, self._last = pacing, most_steps, clock.at(clock.count - 1)
        self._within: Mark | None = None  # before steps with samples left to take
        self._before: Mark | None = None  # the start of the step in which the run ended
        self._at_once, self._length = 1, 0.0  # steps in a call, and their mean length, internal units
        if start is not None:
            corrected.back_to(start)
        self.stepper.destination = float(self._last)
        self._account()

    def position(self) -> Mark:
        """Where to continue: after the last sample, at the start of the step that holds it."""
        return self.buffer.position(self._boundary())

    def _boundary(self) -> Mark:
        """A boundary past which all samples are still to be found; after the last sample, one before it."""
        return self._before or self._within or self.corrected.boundary()

    def run(self) -> Progress:
        """Continue until the last sample is handed over, or something ends the run."""
        self.progress.last_good = self._boundary()
        status = self._already_complete()
        while status is None:
            status = (
                self.check(self.progress)
                or self._out_of_steps()
                or self._save_if_due()
                or self._advance()
                or self._hand_over(patiently=True)
            )
        if self._within is not None and not self.buffer.complete:  # a run that is resumed takes them again
            self._back_to(self._within, self.buffer.count)
        self.progress.status = self._hand_over() or status
        return self.progress

    def _already_complete(self) -> Status | None:
        """The end of a run whose samples were all taken by earlier sessions."""
        if not self.buffer.complete:
            return None
        if self.check(self.progress) is Status.MAX_DRIFT:  # passed by one of them
            return Status.MAX_DRIFT
        self._settle(self._boundary(), self._last)
        return Status.FINISHED

    def _out_of_steps(self) -> Status | None:
        """MAX_STEPS once no further step is allowed; samples within the last one are still taken."""
        out = self._most_steps is not None and self.stepper.steps >= self._most_steps
        return Status.MAX_STEPS if out and self._within is None else None

    def _save_if_due(self) -> Status | None:
        """Save between two rounds, if it is time; what is handed over for that may end the run."""
        if not self.receiver.due():
            return None
        ended = None if self.buffer.whole else self._hand_over()
        if ended is None:
            self.receiver.save(self.position())
        return ended

    def _hand_over(self, *, patiently: bool = False) -> Status | None:
        """Hand over what was found; a status if that ends the run, by the receiver or by Ctrl-C."""
        try:
            refused = self.buffer.hand_over(patiently=patiently)
        except KeyboardInterrupt as signal:
            self._back_to(self.position(), self.buffer.handed)
            return self._asked_to_end(signal)
        finally:
            self.progress.next_sample = self.rows.samples(self.buffer.handed)
        if refused is None:
            return None
        index, boundary = refused
        self._settle(boundary, self.clock.at(index))
        return Status.MAX_DRIFT

    def _asked_to_end(self, signal: KeyboardInterrupt) -> Status:
        """The status of a run that Ctrl-C ends; where nobody asked for it, the signal goes on its way."""
        stop = self.check(self.progress)
        if stop is None:
            raise signal
        return stop

    def _back_to(self, boundary: Mark, found: int) -> None:
        """Return to an earlier boundary, past which only so many rows had been found."""
        self.buffer.back_to(found)
        self._within = self._before = None
        self.corrected.back_to(boundary)
        self._account()

    def _account(self) -> None:
        self.progress.steps = self.stepper.steps
        self.progress.time = float(self.stepper.time) * self.clock.unit

    # --- a round ----------------------------------------------------------------------------------------

    def _advance(self) -> Status | None:
        """Go on for about the time of a chunk, or until the buffer is full; the status if the motion ends.
        It is taken back if Ctrl-C ends it, as it may while something is compiled.
        """
        boundary, found, started = self._boundary(), self.buffer.count, time.perf_counter()
        try:
            return self._round(boundary)
        except KeyboardInterrupt as signal:
            self._back_to(boundary, found)
            return self._asked_to_end(signal)
        finally:
            self.progress.integration_seconds += time.perf_counter() - started

    def _round(self, boundary: Mark) -> Status | None:
        finite = True
        if self._within is not None:
            self._take_within(self._within)
        else:
            finite = self._go_on(boundary)
            self._account()
        log = self.stepper.log
        if self.buffer.complete:
            return Status.FINISHED
        if log.stop is not None and self._within is None:
            self._settle(boundary, log.stop)
            return log.status
        if self.corrected.collapsed:
            self.progress.last_good, self._before = self.corrected.boundary(), boundary
            return Status.COLLAPSED
        if not finite:
            return Status.UNRESOLVED if self.progress.detail else Status.NON_FINITE
        return None

    def _go_on(self, boundary: Mark) -> bool:
        """Take a chunk of steps, and samples within them; False if the state stopped being finite."""
        started, ahead, most = time.perf_counter(), self._steps_to(self.buffer.upcoming), self._at_once
        if self._most_steps is not None:
            most = min(most, self._most_steps - self.stepper.steps)
        if ahead > self._pacing.skipped_from:
            finite = self._skip(min(most, ahead), boundary)
        else:
            finite = self._take(min(most, max(1, self._steps_to(self._last))), boundary)
        if taken := self.stepper.steps - boundary.steps:
            self._length = (float(self.stepper.time) - float(boundary.time[0])) / taken
            pace = taken / max(time.perf_counter() - started, 1e-9)
            self._at_once = max(1, min(8 * self._at_once, int(pace * self._pacing.chunk_seconds)))
        return finite

    def _steps_to(self, moment: Scalar) -> int:
        """Steps that probably don't pass a moment; 0 while nothing is known."""
        if self._length <= 0:
            return 0
        left = (float(moment) - float(self.stepper.time)) / self._length
        return int(min(self._pacing.margin * left - self._pacing.spare, 2.0**62))

    def _skip(self, count: int, boundary: Mark) -> bool:
        """Take many steps towards a sample; if they pass it, go back."""
        if not self.corrected.skip(count) or self.stepper.unresolved:
            return self._lost(boundary, count)
        if self.stepper.time > self.buffer.upcoming:
            self.progress.redone_steps += self.stepper.steps - boundary.steps
            self._length = 2 * max(self._length, self.stepper.largest)
            self.corrected.back_to(boundary)
        else:
            self._note_sizes()
        return True

    def _take(self, count: int, boundary: Mark) -> bool:
        """Take steps up to corrections, and the samples within them."""
        stepper, buffer, left = self.stepper, self.buffer, self.corrected.left
        if count > left:  # the rest of a stride would be taken without a grid
            count -= (count - left) % self.corrected.stride
        while count > 0:
            part, before, started = min(count, self.corrected.left), stepper.steps, time.perf_counter()
            far = float(stepper.time) + 2 * part * self._length if self._length else None
            samples = SamplesWithin(buffer.ahead(far))
            if not stepper.take(part, samples) or stepper.unresolved:
                return self._lost(boundary, part)
            self._note_sizes()
            self._found(samples, boundary, started)
            self._take_within(boundary)
            if self._within is not None or stepper.log.stop is not None or self.corrected.collapsed:
                break
            if buffer.full or buffer.complete:
                break
            count, boundary = count - (stepper.steps - before), self.corrected.boundary()
        return True

    def _note_sizes(self) -> None:
        self.progress.smallest_step = min(self.progress.smallest_step, self.stepper.smallest)
        self.progress.largest_step = max(self.progress.largest_step, self.stepper.largest)

    def _lost(self, boundary: Mark, tried: int) -> bool:
        """After a failure among many steps, or steps too small to be taken at once, go back and continue with
        fewer at a time up to the last finite state; False if a single step fails.
        """
        self.progress.detail = self.stepper.failure if tried == 1 else ""
        self.corrected.back_to(boundary)
        self.progress.last_good = boundary
        self._at_once = max(1, tried // 2)
        return tried > 1

    # --- samples, and the run's end ---------------------------------------------------------------------

    def _found(self, samples: SamplesWithin, boundary: Mark, started: float) -> None:
        """Take samples that have been found past a boundary."""
        states = samples.until(self.stepper.log.stop)
        if len(states):
            times = samples.times[: len(states)]
            self.buffer.take(self.corrected.samples(self.buffer.count, times, states), boundary)
            self.buffer.took("find", len(states), time.perf_counter() - started)

    def _take_within(self, boundary: Mark) -> None:
        """Take the next samples within the latest step, as many as may wait; if none is left there, continue
        with corrections, or with the end.
        """
        self._within, stepper, started = boundary, self.stepper, time.perf_counter()
        limit = stepper.time if stepper.log.stop is None else min(stepper.time, stepper.log.stop)
        if not self.buffer.complete and not self.buffer.full and self.buffer.upcoming <= limit:
            samples = SamplesWithin(self.buffer.ahead(None))
            samples.passed(limit, stepper.dense)
            self._found(samples, boundary, started)
        if self.buffer.complete:
            self._settle(boundary, self._last)
        elif self.buffer.upcoming > limit:
            self._within = None
            self.corrected.correct()

    def _settle(self, boundary: Mark, moment: Scalar) -> None:
        """Go back to a boundary before a moment and on to the first at or past it, so that where a run ends
        follows from the samples and the motion alone.
        """
        self._within = None
        self._before = self.corrected.arrive(boundary, moment)
        self._account()
