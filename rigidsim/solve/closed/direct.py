"""Samples straight from a closed form: no steps, and the same cost at any horizon."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from rigidsim.solve.advance import Check, Progress
from rigidsim.solve.closed.form import ClosedForm
from rigidsim.solve.harvest import ROWS_AT_ONCE, Checkpoint, Keeper
from rigidsim.solve.rhythm import Rhythm
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.status import Status

_WIDE_ROWS = 64  # beyond double a row takes about a millisecond; nobody waits longer for Ctrl-C


class Direct:
    """Takes the place of ``Advance`` where a scene is solved in closed form.

    Attributes:
        progress: how far it is; it takes no steps.
    """

    def __init__(
        self,
        form: ClosedForm,
        system: Any,
        rhythm: Rhythm,
        clock: SampleClock,
        precision: Any,
        keeper: Keeper,
        check: Check,
        start: Checkpoint | None = None,
    ) -> None:
        self._form = form
        self._system = system
        self._clock = clock
        self._precision = precision
        self._keeper = keeper
        self._check = check
        self._place = rhythm.place()  # the start: the way to a sample leads over no other
        self._begin = clock.start
        self.progress = Progress(clock.count, 0 if start is None else start.next_sample)

    def checkpoint(self) -> Checkpoint:
        """The next sample is all that has to be known."""
        return Checkpoint(self._place, self.progress.next_sample)

    def run(self) -> Progress:
        """Go on until the last sample is recorded or something ends the run."""
        progress, count = self.progress, self._clock.count
        rows = ROWS_AT_ONCE if self._precision.narrow else _WIDE_ROWS
        while progress.next_sample < count:
            if self._keeper.due():
                self._keeper.save(self.checkpoint())
            stop = self._check(progress)
            if stop is not None:
                progress.status = stop
                return progress
            started = time.perf_counter()
            first = progress.next_sample
            times = self._clock.internal(first, min(first + rows, count))
            states = self._form.states(self._system, self._precision, times, self._begin)
            progress.integration_seconds += time.perf_counter() - started
            turns = self._place.turns[None, :].repeat(len(times), axis=0)
            self._keeper.take(first, times, states, turns, np.zeros((len(times), 0)))  # holds nothing
            progress.next_sample += len(times)
            progress.time = float(times[-1]) * 2.0**self._clock.exponent
        progress.status = Status.FINISHED
        return progress
