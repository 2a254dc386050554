"""The work of one process on a run: who watches it, what it costs, what may end it, and how samples are
recorded, watched, and saved in segments together with checkpoints.
"""

import math
import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from rigidsim.errors import RunFolderError
from rigidsim.scene.cautions import Caution
from rigidsim.scene.readable import bytes_text
from rigidsim.session.dataset import dataset_variables, dates_of, drift_name, published_of, put_back_name
from rigidsim.solve.assembly import Assembly
from rigidsim.solve.checkpoint import Arrays, SavedPart, check_versions, numbers, pack_versions
from rigidsim.solve.compiled import building, give_up, take_up
from rigidsim.solve.effects.waypoints import SampleTrail
from rigidsim.solve.evaluate import Evaluator, RecordedParts
from rigidsim.solve.events import pack_events, unpack_events
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.projection import put_back_by_invariant
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.sampler import Pacing, Progress, SampleReceiver
from rigidsim.solve.status import Status
from rigidsim.solve.stepper import Mark
from rigidsim.store import netcdf
from rigidsim.store.netcdf import CHUNK_ROWS
from rigidsim.store.run import MemoryWriter
from rigidsim.store.segments import Chain, SegmentLimits, SegmentWriter
from rigidsim.store.summary import ENGINE

if TYPE_CHECKING:
    from rigidsim.session.sensitivity import Sensitivity


@dataclass(frozen=True)
class Undefined:
    """Number of NaN samples of a recorded variable, how many of them lead, and the time (s) of the first
    later one.
    """

    count: int = 0
    leading: int = 0
    since: float = math.nan


@dataclass
class SampleStatistics:
    """Statistics of the samples taken so far, in all sessions; times in s.

    From ``angles_wrapped_from`` on angles are within one turn, since turns aren't known; nan if all are.
    """

    invariants: Sequence[str] = ()
    recorded: Sequence[str] = ()
    largest: dict[str, float] = field(default_factory=dict)
    final: dict[str, float] = field(default_factory=dict)
    put_back: dict[str, float] = field(default_factory=dict)
    nearest_singularity: float = math.inf
    singularity_time: float = math.nan
    angles_wrapped_from: float = math.nan
    undefined: dict[str, Undefined] = field(default_factory=dict)
    version: ClassVar[int] = 1

    def see(self, invariant: str, drifts: np.ndarray) -> None:
        """Follow one invariant through a block of samples: relative drifts, (samples,). One that is no finite
        number counts as infinite.
        """
        sizes = np.abs(drifts.astype(np.float64))
        largest = float(np.where(np.isfinite(sizes), sizes, math.inf).max())
        self.largest[invariant] = max(self.largest.get(invariant, 0.0), largest)
        self.final[invariant] = float(drifts[-1])

    def see_undefined(self, variable: str, values: np.ndarray, first: int, times: np.ndarray) -> None:
        """Count the samples of a block, (samples, components), at which a variable is undefined."""
        if not values.size or not math.isnan(values.min()):  # the minimum is NaN if one value is
            return
        bad = np.isnan(values).any(axis=1)
        known = self.undefined.get(variable, Undefined())
        leading, since = known.leading, known.since
        start = 0
        if leading == first:  # none was defined so far
            start = int(np.argmin(bad)) if not bad.all() else len(bad)
            leading += start
        later = np.flatnonzero(bad[start:])
        if len(later) and math.isnan(since):
            since = float(times[start + later[0]])
        self.undefined[variable] = Undefined(known.count + int(bad.sum()), leading, since)

    def see_singular(self, factors: np.ndarray, times: np.ndarray) -> None:
        """Follow the distance from a formulation's singularity: factors and times (s), (samples,) each."""
        size = np.abs(factors.astype(np.float64))
        nearest = int(np.argmin(size))
        if size[nearest] < self.nearest_singularity:
            self.nearest_singularity = float(size[nearest])
            self.singularity_time = float(times[nearest])

    def pack(self) -> Arrays:
        arrays = {
            "watched": np.array([self._values(self.largest), self._values(self.final)]),
            "put_back": np.array(self._values(self.put_back)),
            "singularity": np.array([self.nearest_singularity, self.singularity_time]),
        }
        if self.undefined:
            rows = [self.undefined.get(name, Undefined()) for name in self.recorded]
            arrays["undefined"] = np.array([[row.count, row.leading, row.since] for row in rows])
        return arrays

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        largest, final = np.reshape(arrays.get("watched", ()), (2, len(self.invariants)))
        self.largest, self.final = self._by_name(largest), self._by_name(final)
        self.put_back = self._by_name(arrays.get("put_back", ()))
        self.nearest_singularity, self.singularity_time = numbers(arrays, "singularity", 2)
        table = arrays.get("undefined", np.zeros((len(self.recorded), 3)))
        if table.shape != (len(self.recorded), 3):
            raise ValueError(f"the checkpoint counts undefined samples of shape {table.shape}")
        rows = zip(self.recorded, table.tolist(), strict=True)
        self.undefined = {name: Undefined(int(n), int(some), since) for name, (n, some, since) in rows if n}

    def _values(self, found: Mapping[str, float]) -> list[float]:
        """Values in the order of the invariants; nan for missing ones."""
        return [found.get(name, math.nan) for name in self.invariants]

    def _by_name(self, values: Iterable[float]) -> dict[str, float]:
        """Values by invariant, without missing ones."""
        pairs = zip(self.invariants, map(float, values), strict=True)
        return {name: value for name, value in pairs if not math.isnan(value)}


class Checkpoints:
    """Packs and restores stepper, effects, events, and other parts that samples and counts depend on."""

    def __init__(self, parts: Assembly, **others: SavedPart) -> None:
        self._precision, self._system = parts.prepared.precision, parts.prepared.system
        self._corrected, self._log = parts.corrected, parts.log
        self._rows = parts.evaluator.angles.rows(parts.prepared.clock)
        self._parts: dict[str, SavedPart] = {"continuity": parts.evaluator, **others}
        self._versions = self._corrected.versions | {name: part.version for name, part in self._parts.items()}

    def packed(self, position: Mark) -> Arrays:
        """Everything at a position, as arrays."""
        arrays = self._corrected.pack(position)
        samples = self._rows.samples(position.next_row)
        arrays["counts"] = np.append(arrays["counts"], samples)
        arrays["rows_between"] = np.array([position.next_row - self._rows.row(samples - 1) if samples else 0])
        for part in self._parts.values():
            arrays |= part.pack()
        return arrays | pack_versions(self._versions)

    def events(self, position: Mark, first: int = 0) -> Arrays:
        """Crossings from number ``first`` on up to a position; later ones are found again."""
        return pack_events(self._log.found[first : position.events], self._precision)

    def restore(self, chain: Chain) -> Mark:
        """Put the last checkpoint back."""
        try:
            arrays = netcdf.read_group(chain.paths[-1], "checkpoint")
            check_versions(arrays, self._versions)
            boundary, samples = self._corrected.unpack(arrays), int(numbers(arrays, "counts", 3)[2])
            for part in self._parts.values():
                part.restore(arrays)
            for path in chain.paths:
                if "previous_seal" in netcdf.root_attributes(path):
                    saved = netcdf.read_group(path, "events")
                    self._log.found += unpack_events(saved, self._precision, len(self._system.states))
            if boundary.events != len(self._log.found) or samples != chain.rows:
                raise ValueError("its counts don't agree with what the segments hold")
        except (KeyError, ValueError) as error:
            raise RunFolderError(f"{chain.paths[-1]}: cannot be resumed from: {error}") from None
        between = int(arrays.get("rows_between", np.ones(1))[0])
        return replace(boundary, next_row=self._rows.row(samples - 1) + between if samples else 0)


class Recorder(SampleReceiver):
    """The receiver of a run's samples, which begins or resumes at ``start``."""

    rows_together = CHUNK_ROWS

    def __init__(
        self,
        prepared: InitialValueProblem,
        evaluator: Evaluator,
        writer: SegmentWriter | MemoryWriter,
        statistics: SampleStatistics,
        trail: SampleTrail,
        checkpoints: Checkpoints,
        start: Mark | None,
        sensitivity: "Sensitivity | None" = None,
    ) -> None:
        self.sensitivity = sensitivity
        self._prepared = prepared
        self._evaluator = evaluator
        self._writer = writer
        self._checkpoints = checkpoints
        self._dates = dates_of(prepared)
        self._published = published_of(prepared)
        self._events_saved = 0 if start is None else start.events
        guard = prepared.scene.config.limits.max_drift
        self._max_drift = None if guard is None else float(guard)
        self.statistics = statistics
        self.trail = trail
        if evaluator.angles.lost:
            self.statistics.angles_wrapped_from = prepared.clock.seconds(prepared.clock.at(1))

    def take(self, block: SampleBlock) -> None:
        """Evaluate and collect samples, up to the first past the guard ``max_drift``."""
        tangents = self.sensitivity  # first of all, because Ctrl-C may end it
        place = None if tangents is None else tangents.place
        beside = {} if tangents is None else tangents.take(block)
        before = self._evaluator.last_quaternion
        recorded = self._evaluator.evaluate(block)
        put_back = put_back_by_invariant(self._prepared.projected_scalars, block.put_back)
        wanted = self._wanted(recorded, put_back)
        if wanted <= len(block):
            self.last_wanted = block.first + wanted - 1
        if wanted < len(block):
            self._evaluator.last_quaternion = before
            block = block.rows(0, wanted)
            recorded = self._evaluator.evaluate(block)
            put_back = {name: values[:wanted] for name, values in put_back.items()}
            if tangents is not None and place is not None:
                tangents.back_to(place)
                beside = tangents.take(block)
        recorded |= beside
        if self._prepared.scene.config.output.estimate:
            self.trail.take(block)
        recorded["time"] = self._prepared.clock.parts(block.first, block.times)
        for variable in self._prepared.system.recorded:
            values = recorded[variable.name][0]
            self.statistics.see_undefined(variable.name, values, block.first, recorded["time"][0])
        if self._dates is not None:
            recorded |= self._dates.of_samples(block.first, len(block))
        if self._published is not None:
            recorded |= self._published.of_samples(recorded)
        for invariant in self._prepared.system.invariants:
            self.statistics.see(invariant.name, recorded[drift_name(invariant.name)][0][:, 0])
        for name, values in put_back.items():
            recorded[put_back_name(name)] = [values[:, None]]
            self.statistics.put_back[name] = float(values[-1])
        factors = self._evaluator.singular_factors(block.states, block.chart)
        if factors is not None:
            self.statistics.see_singular(factors, recorded["time"][0])
        self._writer.add(recorded)

    def _wanted(self, recorded: RecordedParts, put_back: Mapping[str, np.ndarray]) -> int:
        """Number of samples up to and including the first past the drift guard; more than all if none is.

        Corrections that a run puts back without being asked to count as the drift that they prevented.
        """
        if self._max_drift is None:
            return sys.maxsize
        drifts = [recorded[drift_name(i.name)][0][:, 0] for i in self._prepared.system.invariants]
        drifts += list(put_back.values()) if self._prepared.holds_late else []
        past = [np.flatnonzero(~(np.abs(drift) <= self._max_drift)) for drift in drifts]
        return min((int(found[0]) + 1 for found in past if len(found)), default=sys.maxsize)

    def due(self) -> bool:
        """Whether much is collected, or the last segment is old."""
        return self._writer.due

    def save(self, position: Mark) -> None:
        """Write a segment; on return all samples taken, and the state to continue from, are saved."""
        events = self._checkpoints.events(position, self._events_saved)
        self._writer.flush(self._checkpoints.packed(position), events)
        self._events_saved = position.events


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
    """Wall and CPU seconds (of all threads) of a run: of all sessions, and of this one by phase. A part of
    checkpoints, with what else the run has cost, once ``progress`` is given.
    """

    version: ClassVar[int] = 1

    def __init__(self) -> None:
        self.progress = Progress(0)
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

    def pack(self) -> Arrays:
        progress = self.progress
        return {
            "steps_seen": np.array([progress.smallest_step, progress.largest_step]),
            "effort": np.append(self.spent, progress.integration_seconds),
            "sessions": np.array([self.sessions, progress.redone_steps], dtype=np.int64),
        }

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        progress = self.progress
        progress.smallest_step, progress.largest_step = numbers(arrays, "steps_seen", 2)
        wall, cpu, progress.integration_seconds = numbers(arrays, "effort", 3)
        self.before = np.array([wall, cpu])
        sessions, redone = numbers(arrays, "sessions", 2)
        self.sessions, progress.redone_steps = int(sessions) + 1, int(redone)


def _now() -> np.ndarray:
    return np.array([time.perf_counter(), time.process_time()])


@dataclass
class Session:
    """The work of one process on a run: all of it, or what was left. ``mixed`` says what changed in versions
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


_SHRINK = 0.9  # compression ratio of gzip on doubles whose low bits are noise; measured 0.85 to 0.95
_TIMELINE_ROW_BYTES = 260.0  # measured; falls with repeated values


@dataclass(frozen=True)
class Storage:
    """Predicted bytes: per sample, of the segments, which the complete dataset replaces, and of the files."""

    row: float
    segments: float
    dataset: float
    timeline: float
    free: float

    @property
    def needed(self) -> float:
        """Space needed at the end, when all files exist at once."""
        return self.segments + self.dataset + self.timeline

    @property
    def problem(self) -> str | None:
        """Message if there is too little room; None if there is enough."""
        if self.needed <= self.free:
            return None
        sizes = (self.needed, self.segments, self.dataset, self.free)
        needed, segments, dataset, free = map(bytes_text, sizes)
        return (
            f"takes about {needed} of space until it is complete ({segments} of "
            f"segments, {dataset} of dataset.h5), and {free} are free there; take "
            "fewer [time] samples, record less ([output] record), choose a folder on another disk, or "
            'limit the run by [limits], such as wall_time = "1 h"'
        )


def storage(prepared: InitialValueProblem, place: Path) -> Storage:
    """Space that a run would take in a folder, which need not exist; less if a guard or an event ends the
    run.
    """
    samples, output = prepared.clock.count, prepared.scene.config.output
    row = 8.0 * sum(v.parts * math.prod(v.shape) for v in dataset_variables(prepared))
    shown = min(samples, output.timeline_rows) if output.timeline else 0
    there = next(folder for folder in [place.absolute(), *place.absolute().parents] if folder.exists())
    disk = shutil.disk_usage(there)
    replaced = sum(file.stat().st_size for file in place.glob("**/*") if file.is_file())
    return Storage(
        row=row,
        segments=samples * row,
        dataset=samples * row * _SHRINK,
        timeline=shown * _TIMELINE_ROW_BYTES,
        free=disk.free + float(replaced) if disk.total else math.inf,  # one without a size can't say
    )


def refuse_too_large(prepared: InitialValueProblem, place: Path) -> None:
    """Refuse a run that can only end at its last sample and would fill the disk."""
    limits = prepared.scene.config.limits
    guarded = (limits.wall_time, limits.max_steps, limits.max_drift) != (None, None, None)
    if guarded or any(event.stop for event in prepared.system.events):
        return
    problem = storage(prepared, place).problem
    if problem is not None:
        raise RunFolderError(f"{place}: the run {problem}")


def refuse_too_large_for_memory(prepared: InitialValueProblem) -> None:
    """Refuse a run that would take more memory than there is."""
    row = 8.0 * sum(v.parts * math.prod(v.shape) for v in dataset_variables(prepared))
    needed = 2 * row * prepared.clock.count  # the blocks, and the dataset made of them
    there = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    if needed > there:
        raise RunFolderError(
            f"{prepared.scene.name}: takes about {bytes_text(needed)} of memory, and the machine has "
            f"{bytes_text(there)}; give a folder as out, take fewer samples, or record less ([output] record)"
        )
