"""The work of one process on a run: who watches it, what it costs, and what may end it."""

import signal
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

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


class Stopwatch:
    """Wall and CPU seconds (of all threads) of a run: of all sessions, and of this one by phase."""

    def __init__(self) -> None:
        self.sessions = 1
        self.before = np.zeros(2)  # of earlier sessions
        self.phases: dict[str, np.ndarray] = {}
        self._begun = self._since = _now()

    def next(self, finished: str) -> None:
        """Close the current phase under a name; repeated names add up."""
        now = _now()
        self.phases[finished] = self.phases.get(finished, np.zeros(2)) + now - self._since
        self._since = now

    @property
    def spent(self) -> np.ndarray:
        """Wall and CPU seconds of all sessions."""
        return np.asarray(self.before + _now() - self._begun)

    def begin_again(self) -> None:
        """Another attempt begins: the time of this one counts as a single phase, but for the choice's."""
        lost = [spent for name, spent in self.phases.items() if name != "choose"]
        self.phases = {name: spent for name, spent in self.phases.items() if name == "choose"}
        self.phases[NOT_KEPT] = sum(lost, np.zeros(2))

    def as_dict(self, engine: float) -> dict[str, Any]:
        """Fields of ``Cost``; ``engine``: seconds of the engine alone in all sessions, part of the phases."""
        wall, cpu = self.spent.tolist()
        each = {name: spent.tolist() for name, spent in self.phases.items()}
        return {
            "seconds": {name: spent[0] for name, spent in each.items()} | {ENGINE: engine},
            "cpu_by_phase": {name: spent[1] for name, spent in each.items()},
            "cpu_seconds": cpu,
            "wall_seconds": wall,
            "sessions": self.sessions,
        }


def _now() -> np.ndarray:
    return np.array([time.perf_counter(), time.process_time()])


@dataclass
class RunCost:
    """What a run has cost in all of its sessions, as a part of checkpoints."""

    watch: Stopwatch
    progress: Progress
    version: ClassVar[int] = 1

    def pack(self) -> Arrays:
        watch, progress = self.watch, self.progress
        return {
            "steps_seen": np.array([progress.smallest_step, progress.largest_step]),
            "effort": np.append(watch.spent, progress.integration_seconds),
            "sessions": np.array([watch.sessions, progress.redone_steps], dtype=np.int64),
        }

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        watch, progress = self.watch, self.progress
        progress.smallest_step, progress.largest_step = numbers(arrays, "steps_seen", 2)
        wall, cpu, progress.integration_seconds = numbers(arrays, "effort", 3)
        watch.before = np.array([wall, cpu])
        sessions, redone = numbers(arrays, "sessions", 2)
        watch.sessions, progress.redone_steps = int(sessions) + 1, int(redone)


@dataclass
class Session:
    """The work of one process on a run: all of it, or what was left. ``mixed`` tells what changed in versions
    or machine since the run began.
    """

    observer: Observer
    remarks: list[Caution] = field(default_factory=list)
    mixed: str = ""
    watch: Stopwatch = field(default_factory=Stopwatch)
    tuning: Tuning = field(default_factory=Tuning)

    def another(self) -> "Session":
        """Session for the next attempt after this one missed the accuracy; its cost includes this one's."""
        self.watch.begin_again()
        return Session(self.observer, watch=self.watch, tuning=self.tuning)
