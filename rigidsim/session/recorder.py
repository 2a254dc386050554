"""Recording a run's samples: evaluated, watched, and written to segments together with checkpoints.

Statistics over all samples let the end of a run be judged without reading them again.
"""

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from rigidsim.errors import RunFolderError
from rigidsim.session.dataset import dates_of, drift_name, published_of, put_back_name
from rigidsim.solve.assembly import Assembly
from rigidsim.solve.checkpoint import Arrays, SavedPart, check_versions, numbers, pack_versions
from rigidsim.solve.effects.waypoints import SampleTrail
from rigidsim.solve.evaluate import Evaluator, RecordedParts
from rigidsim.solve.events import pack_events, unpack_events
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.projection import put_back_by_invariant
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.sampler import SampleReceiver
from rigidsim.solve.stepper import Mark
from rigidsim.store import netcdf
from rigidsim.store.netcdf import CHUNK_ROWS
from rigidsim.store.run import MemoryWriter
from rigidsim.store.segments import Chain, SegmentWriter

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
