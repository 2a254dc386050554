"""Checks between two chunks of steps: observers, signals and the guards of ``[limits]``."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from rigidsim.session.statistics import SampleStatistics
from rigidsim.solve.compiled import building, give_up, take_up
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.sampler import Progress
from rigidsim.solve.status import Status


class Observer:
    """Receives a run's progress, for instance to draw a progress bar; the base class does nothing."""

    def started(self, prepared: InitialValueProblem, folder: Path | None) -> None:
        """The equations are compiled and integration begins, in a folder or in memory."""

    def resumed(self, progress: Progress) -> None:
        """Called after ``started`` for a resumed run, with what was done before this session."""

    def progressed(self, progress: Progress) -> None:
        """Called between chunks, at most some tens of times per second."""

    def phase(self, name: str) -> None:
        """A new phase begins: "integrate", "lyapunov", "estimate", "modelling", "dataset", "timeline" or
        "certify".
        """

    def nothing_left(self, why: str) -> None:
        """The run to be resumed had already ended for good, for the given reason; nothing was done."""

    def choosing(self, name: str) -> None:
        """Settings for the run of this name are about to be chosen by trials; its integration follows."""

    def trying(self, title: str, fraction: float) -> None:
        """Progress of a trial for the choice or the certificate; called some tens of times per second."""


class Interruption:
    """Notes SIGINT and SIGTERM while the engine works, so that a run always ends between two chunks.

    Compilation under way is no longer waited for after a signal, and none is started.
    """

    def __init__(self) -> None:
        self.requested = False
        self._dispensable = False

    @contextmanager
    def dispensable(self) -> Iterator[None]:
        """Abandon the block at the first signal, wherever it is, since its result would no longer be used."""
        with suppress(KeyboardInterrupt):
            self._dispensable = True
            try:
                yield
            finally:
                self._dispensable = False

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Handle the signals inside the block (in the main thread, the only one that receives them)."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def note(*_: object) -> None:
            given_up, self._dispensable = self._dispensable, False
            self.requested = True
            give_up()
            if given_up or building():
                raise KeyboardInterrupt

        before = {s: signal.signal(s, note) for s in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
            take_up()


@dataclass
class Guards:
    """The checks between chunks; ``wall_time`` starts anew in each session of a run.

    The loop itself enforces ``max_steps``, and the recorder checks each sample's drift; here the drifts of an
    earlier session are checked.
    """

    prepared: InitialValueProblem
    statistics: SampleStatistics
    interruption: Interruption
    observer: Observer
    started: float = field(default_factory=time.monotonic)
    reported: float = 0.0

    def __call__(self, progress: Progress) -> Status | None:
        """The status that ends the run now; None if nothing does."""
        now, limits = time.monotonic(), self.prepared.scene.config.limits
        if now - self.reported > 0.05:
            self.reported = now
            self.observer.progressed(progress)
        if self.interruption.requested:
            return Status.INTERRUPTED
        if limits.wall_time is not None and now - self.started > float(limits.wall_time):
            return Status.WALL_TIME
        drift = max(self.statistics.largest.values(), default=0.0)
        if limits.max_drift is not None and drift > float(limits.max_drift):
            return Status.MAX_DRIFT
        return None
