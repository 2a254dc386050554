"""The work of one process on a run: who watches it, what it costs, and what may end it."""

import signal
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

from rigidsim.scene.cautions import Caution
from rigidsim.session.recorder import SampleStatistics
from rigidsim.solve.checkpoint import Arrays, numbers
from rigidsim.solve.compiled import building, give_up, take_up
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.sampler import Pacing, Progress
from rigidsim.solve.status import Status
from rigidsim.store.segments import SegmentLimits
from rigidsim.store.summary_parts import ENGINE


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


@dataclass(frozen=True)
class AdviceLimits:
    """From how many steps on a run that resolved every rotation is compared with averaged models, and up to
    which distance of axes, rad, one is advised.
    """

    steps: int = 1_000_000  # the windows in which both are followed have 2e4 to 2e5 of them
    apart: float = 1e-5  # two seconds of arc


@dataclass(frozen=True)
class Tuning:
    """Intervals and limits of a run; the defaults were measured, see each part. Tests and studies of damage
    save far more often.
    """

    pacing: Pacing = field(default_factory=Pacing)
    segments: SegmentLimits = field(default_factory=SegmentLimits)
    advice: AdviceLimits = AdviceLimits()


NOT_KEPT = "attempts_not_kept"


@dataclass
class Effort:
    """Cost of a run over all its sessions; what is given counts those before this one."""

    sessions: int = 1
    wall_seconds: float = 0.0
    cpu_seconds: float = 0.0
    started: float = field(default_factory=time.perf_counter)
    cpu_started: float = field(default_factory=time.process_time)

    @property
    def wall(self) -> float:
        """Wall seconds of all sessions."""
        return self.wall_seconds + time.perf_counter() - self.started

    @property
    def cpu(self) -> float:
        """CPU seconds of all sessions."""
        return self.cpu_seconds + time.process_time() - self.cpu_started


@dataclass
class RunCost:
    """What a run has cost in all of its sessions, as a part of checkpoints."""

    effort: Effort
    progress: Progress
    version: ClassVar[int] = 1

    def pack(self) -> Arrays:
        effort, progress = self.effort, self.progress
        return {
            "steps_seen": np.array([progress.smallest_step, progress.largest_step]),
            "effort": np.array([effort.wall, effort.cpu, progress.integration_seconds]),
            "sessions": np.array([effort.sessions, progress.redone_steps], dtype=np.int64),
        }

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        effort, progress = self.effort, self.progress
        progress.smallest_step, progress.largest_step = numbers(arrays, "steps_seen", 2)
        effort.wall_seconds, effort.cpu_seconds, progress.integration_seconds = numbers(arrays, "effort", 3)
        sessions, redone = numbers(arrays, "sessions", 2)
        effort.sessions, progress.redone_steps = int(sessions) + 1, int(redone)


class Phases:
    """Wall and CPU seconds (of all threads) by phase of one session, in the order in which they ended."""

    def __init__(self) -> None:
        self.wall: dict[str, float] = {}
        self.cpu: dict[str, float] = {}
        self._since = time.perf_counter(), time.process_time()

    def next(self, finished: str) -> None:
        """Close the current phase under a name; repeated names add up."""
        now = time.perf_counter(), time.process_time()
        for seconds, begin, end in zip((self.wall, self.cpu), self._since, now, strict=True):
            seconds[finished] = seconds.get(finished, 0.0) + end - begin
        self._since = now

    def engine(self, seconds: float) -> None:
        """Note the time of the engine alone in all sessions; it is part of other phases."""
        self.wall[ENGINE] = seconds

    def begin_again(self) -> "Phases":
        """Phases for another attempt: this one's time counts as a single phase, but for the choice's."""
        again = Phases()
        for old, new in ((self.wall, again.wall), (self.cpu, again.cpu)):
            new |= {name: seconds for name, seconds in old.items() if name == "choose"}
            new[NOT_KEPT] = sum(v for name, v in old.items() if name not in ("choose", ENGINE))
        again._since = self._since
        return again


@dataclass
class Session:
    """The work of one process on a run: all of it, or what was left. ``mixed`` tells what changed in versions
    or machine since the run began.
    """

    observer: Observer
    remarks: list[Caution] = field(default_factory=list)
    mixed: str = ""
    effort: Effort = field(default_factory=Effort)
    phases: Phases = field(default_factory=Phases)
    tuning: Tuning = field(default_factory=Tuning)

    def another(self) -> "Session":
        """Session for the next attempt after this one missed the accuracy; its cost includes this one's."""
        return Session(
            self.observer, effort=self.effort, phases=self.phases.begin_again(), tuning=self.tuning
        )
