"""Members of a sweep: what is kept of each, run in batches if possible, otherwise one by one, in tiles."""

import math
import re
import time
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.accuracy.estimates import UNCERTAIN, MemberErrors, MemberEstimates
from rigidsim.accuracy.modelling import ENERGY, SIZE, Unmeasured, measure_modelling
from rigidsim.errors import ConfigError, MemberError, Problem, RigidsimError
from rigidsim.model.tangents import GROWTH
from rigidsim.scene.cautions import WarningCode
from rigidsim.scene.config import Experiment
from rigidsim.scene.parts_of_values import part_name
from rigidsim.scene.scene import build_scene
from rigidsim.scene.schema import INDICATORS
from rigidsim.scene.sweep import FITS, Sweep
from rigidsim.session.dataset import dataset_variables, kernel_attributes
from rigidsim.solve.batch.family import (
    AxisNumbers,
    BatchBlock,
    BatchRun,
    Families,
    Members,
    NotBatchable,
    Sorted,
    batchable,
)
from rigidsim.solve.effects.waypoints import SampleTrail
from rigidsim.solve.indicators import indicators
from rigidsim.solve.lanes import LANES_OF_A_TABLE
from rigidsim.solve.problem import prepare
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.status import Status
from rigidsim.store.netcdf import joined_parts
from rigidsim.store.run import MemoryRun
from rigidsim.store.summary import Modelling, Summary, UnmeasuredCode
from rigidsim.store.sweeps.tiles import ALWAYS, Kept, KeptVariable
from rigidsim.store.variables import Variable
from rigidsim.workflows.analyse import analyse
from rigidsim.workflows.read import parse, reads_kernels, refuse_others
from rigidsim.workflows.run import run


def kept(
    values: np.ndarray,
    units: str,
    long_name: str,
    item: str = ALWAYS,
    dims: tuple[str, ...] = (),
    **more: Any,
) -> KeptVariable:
    """A kept variable with its labels."""
    return KeptVariable(dims, values, {"units": units, "long_name": long_name, **more}, item)


Parts = tuple[Variable, Sequence[np.ndarray]]
"""A variable with its parts: members' samples, (members, samples, components), where missing ones at the end
are nan; or for each member what was recorded at an event, (times, ...).
"""
Occurrences = Iterable[tuple[str, Sequence[np.ndarray], Mapping[str, Parts]]]
"""Of each event its name, each member's times, and what was recorded then, by name."""


def _shaped(variable: Variable, values: np.ndarray) -> np.ndarray:
    """Values (members, components) or (members, samples, components) in the variable's own shape."""
    return values.reshape(*values.shape[:-1], *variable.shape)


def kept_of(
    sweep: Sweep, series: Sequence[Parts], times: np.ndarray, lengths: np.ndarray, events: Occurrences,
    keep: Collection[str],
) -> Kept:  # fmt: skip
    """What is asked for of recorded variables and events; drifts are always kept. Times in s are (samples,),
    or (members, samples) if each has its own; ``lengths``: samples that each member has.
    """
    found: Kept = {}
    plain = []
    for variable, parts in series:
        if variable.name == GROWTH:
            found |= _indicators(parts[0], times, keep)
        if variable.name == sweep.added:  # recorded only for indicators
            continue
        plain.append((variable, parts))
        if "drift_of" in variable.attributes:
            found |= _drifts(variable, parts[0], lengths)
        elif "put_back_of" not in variable.attributes:
            if "final" in keep:
                found |= _final(variable, parts, lengths)
            if "extremes" in keep:
                found |= _extremes(variable, parts[0], times)
            if "means" in keep:
                found |= _means(variable, parts)
    if "series" in keep and plain:
        found |= _series(plain, times)
    for name, when, points in events:
        known = {what: values for what, values in points.items() if what != sweep.added}
        found |= kept_events(name, when, sweep.table.most_events, known, keep)
    return found


def _indicators(growth: np.ndarray, times: np.ndarray, keep: Collection[str]) -> Kept:
    """Chaos indicators from the growth of a tangent vector."""
    since = times if times.ndim == 1 else times.T
    way = -1.0 if since.size and (since[-1] < since[0]).any() else 1.0  # growth is that along the run
    chaos = indicators(way * since, growth[:, :, 0].T)
    labels = {
        "megno": ("1", "mean exponential growth of nearby orbits: 2 for regular motion", chaos.megno),
        "fli": ("1", "fast Lyapunov indicator: largest logarithm of the growth", chaos.fli),
        "lyapunov": ("s-1", "largest Lyapunov exponent, as far as the samples reach", chaos.largest_exponent),
    }
    found: Kept = {}
    for name, (units, long_name, values) in labels.items():
        if name in keep:
            found[name] = kept(values, units, long_name, name)
            until = "time up to which the growth of a tangent vector is known"
            found["growth_time"] = kept(way * chaos.until, "s", until, name)
    return found


def _last(values: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Last sample of each member from (members, samples, components), nan if it has none."""
    rows = np.maximum(lengths - 1, 0)
    last = values[np.arange(len(values)), rows]
    return np.where((lengths > 0)[:, None], last, np.nan)


def _final(variable: Variable, parts: Sequence[np.ndarray], lengths: np.ndarray) -> Kept:
    name = f"{variable.name}_final"
    found = {}
    for part, values in enumerate(parts):
        attributes = variable.part_attributes(part)
        if part:
            attributes |= {"residual_of": name}
        attributes.pop("exact_value", None)
        attributes["long_name"] = f"{attributes.get('long_name', variable.name)}, at the last sample"
        attributes.pop("coordinates", None)
        found[part_name(name, part)] = KeptVariable(
            variable.dims, _shaped(variable, _last(values, lengths)), attributes, "final"
        )
    return found


def _extremes(variable: Variable, values: np.ndarray, times: np.ndarray) -> Kept:
    found = {}
    units = variable.attributes.get("units", "1")
    for what, filled, place in (("min", np.inf, np.argmin), ("max", -np.inf, np.argmax)):
        rows = place(np.where(np.isnan(values), filled, values), axis=1)
        extreme = np.take_along_axis(values, rows[:, None, :], axis=1)[:, 0]
        when = times[rows] if times.ndim == 1 else np.take_along_axis(times, rows, axis=1)
        when = np.where(np.isnan(extreme), np.nan, when)
        words = "smallest" if what == "min" else "largest"
        long_name = f"{words} {variable.attributes.get('long_name', variable.name)} at a sample"
        common = {k: v for k, v in variable.attributes.items() if k in ("frame", "euler_sequence", "angle")}
        found[f"{variable.name}_{what}"] = kept(
            _shaped(variable, extreme), units, long_name, "extremes", variable.dims, **common
        )
        found[f"{variable.name}_{what}_time"] = kept(
            _shaped(variable, when), "s", f"time of the {long_name}", "extremes", variable.dims
        )
    return found


def _means(variable: Variable, parts: Sequence[np.ndarray]) -> Kept:
    present = ~np.isnan(parts[0])
    count = np.maximum(present.sum(axis=1), 1)
    # in the order of the samples: ``sum`` takes another order if a member is alone in its block
    total = sum(np.cumsum(np.where(present, part, 0), axis=1)[:, -1] for part in reversed(parts))
    mean = np.where(present.any(axis=1), total / count, np.nan)
    units = variable.attributes.get("units", "1")
    long_name = f"mean of the {variable.attributes.get('long_name', variable.name)} over the samples"
    return {f"{variable.name}_mean": kept(_shaped(variable, mean), units, long_name, "means", variable.dims)}


def _drifts(variable: Variable, values: np.ndarray, lengths: np.ndarray) -> Kept:
    size = np.abs(values[:, :, 0])
    largest = np.where(lengths > 0, np.fmax.reduce(size, axis=1, initial=0.0), np.nan)
    of_a_member = ("coordinates", "scale", "scale_units")
    attributes = {k: v for k, v in variable.attributes.items() if k not in of_a_member}
    named = variable.attributes.get("long_name", variable.name)
    return {
        f"{variable.name}_largest": KeptVariable(
            (), largest, {**attributes, "long_name": f"largest {named} at a sample, without its sign"}
        ),
        f"{variable.name}_final": KeptVariable(
            (), _last(values, lengths)[:, 0], {**attributes, "long_name": f"{named} at the last sample"}
        ),
    }


def _series(series: Sequence[Parts], times: np.ndarray) -> Kept:
    found: Kept = {}
    for variable, parts in series:
        for part, values in enumerate(parts):
            attributes = {k: v for k, v in variable.part_attributes(part).items() if k != "coordinates"}
            found[part_name(variable.name, part)] = KeptVariable(
                ("sample", *variable.dims), _shaped(variable, values), attributes, "series"
            )
    rows = np.broadcast_to(times, (len(next(iter(found.values())).values), times.shape[-1]))
    found["time"] = kept(np.array(rows), "s", "time of the scene", "series", ("sample",))
    return found


def kept_events(
    name: str, times: Sequence[np.ndarray], most: int, points: Mapping[str, Parts], keep: Collection[str]
) -> Kept:
    """How often an event happened and when (s); only the first times that fit are kept."""
    count = len(times)
    found: Kept = {}
    along, first_times = (f"{name}_occurrence",), f"times of {name}, the first {most}"
    table = _padded(times, most, ())
    if "events" in keep:
        counts = np.array([len(t) for t in times], dtype=np.int64)
        found[f"{name}_count"] = kept(counts, "1", f"how often {name} happened", "events")
        found[f"{name}_times"] = kept(table, "s", first_times, "events", along)
        first = table[:, 0] if most else np.full(count, np.nan)
        found[f"{name}_first"] = kept(first, "s", f"first time of {name}", "events")
    if "section" in keep:
        for what, (variable, values) in points.items():
            labels = {k: v for k, v in variable.attributes.items() if k in ("units", "frame", "angle")}
            labels["long_name"] = f"{variable.attributes.get('long_name', what)} at {name}"
            padded = _padded(values, most, variable.shape)
            found[f"{name}_{what}"] = KeptVariable((*along, *variable.dims), padded, labels, "section")
        found[f"{name}_time"] = kept(table, "s", first_times, "section", along)
    return found


def _padded(rows: Sequence[np.ndarray], most: int, shape: tuple[int, ...]) -> np.ndarray:
    table = np.full((len(rows), most, *shape), np.nan)
    for row, values in zip(table, rows, strict=True):
        taken = values[:most]
        row[: len(taken)] = np.reshape(taken, (-1, *shape))
    return table


def assembled(parts: Sequence[tuple[np.ndarray, Kept]], count: int) -> Kept:
    """Groups of members, each at its places, as one; nan (0 for counts) where a group lacks a variable."""
    found: Kept = {}
    for name in dict.fromkeys(name for _, part in parts for name in part):
        held = [(places, part[name]) for places, part in parts if name in part]
        like = held[0][1]
        shape = np.max([one.values.shape[1:] for _, one in held], axis=0).astype(int)
        lacking = 0 if like.values.dtype.kind == "i" else np.nan
        table = np.full((count, *shape), lacking, dtype=like.values.dtype)
        for places, one in held:
            there: tuple[Any, ...] = (places, *(slice(0, size) for size in one.values.shape[1:]))
            table[there] = one.values
        found[name] = replace(like, values=table)
    return found


class Outcome(Enum):
    """How a member ended that has no status of a run."""

    REFUSED = "refused"
    FAILED = "failed"


ENDED_WELL = (Status.FINISHED.value, Status.EVENT.value)
OUTCOMES = (
    *(s.value for s in (Status.FINISHED, Status.EVENT, Status.WALL_TIME, Status.MAX_STEPS, Status.MAX_DRIFT)),
    *(s.value for s in (Status.NON_FINITE, Status.COLLAPSED, Status.UNRESOLVED, *Outcome, Status.IMPOSSIBLE)),
    Status.OUT_OF_RANGE.value,
    Status.CONTACT.value,
)
"""All outcomes of members; a dataset stores the index in this list, which may only grow."""
WARNINGS = tuple(code.value for code in WarningCode)
_DATES = ("year", "julian_date", "date")
_ESTIMATING = ("estimate", "modelling")
"""Phases of a run that find its errors."""


@dataclass(frozen=True)
class MemberResults:
    """Results of some members: kept variables, (members, ...) each; members by engine; the code of the reason
    why some were run one by one, empty if none was; and CPU seconds spent on error estimates.
    """

    kept: Kept
    reasons: Mapping[int, str]
    engines: Mapping[str, int] = field(default_factory=dict)
    why_alone: str = ""
    estimating: float = 0.0

    @classmethod
    def together(cls, parts: "Sequence[tuple[np.ndarray, MemberResults]]", why: str = "") -> "MemberResults":
        """Groups of members as one, each with the places of its members."""
        reasons = {int(places[row]): text for places, one in parts for row, text in one.reasons.items()}
        engines: Counter[str] = Counter()
        for _, one in parts:
            engines.update(one.engines)
        kept = assembled([(places, one.kept) for places, one in parts], sum(len(p) for p, _ in parts))
        return cls(kept, reasons, engines, why, sum(one.estimating for _, one in parts))


def status_variable(codes: np.ndarray) -> KeptVariable:
    """Outcomes of members as indices in ``OUTCOMES``, with their meanings."""
    meanings = " ".join(re.sub(r"\W+", "_", outcome) for outcome in OUTCOMES)
    flags = {"flag_values": list(range(len(OUTCOMES))), "flag_meanings": meanings}
    return KeptVariable((), codes, {"long_name": "how the member ended", **flags})


def warning_bits(codes: Iterable[str]) -> int:
    """Warnings of one member as a mask, one bit for each kind."""
    return sum(1 << WARNINGS.index(code) for code in set(codes))


def plain_variables(
    *, status: Any, warnings: Any, steps: Any, reached: Any, bound: Any, attitude_error: Any = None,
    position_error: Any = None,
) -> Kept:  # fmt: skip
    """Variables that every member has, of (members,) each: indices in ``OUTCOMES``, masks as in
    ``warning_bits``, and numbers; None for errors that aren't estimated, and for the position of a body
    without one.
    """
    codes = np.array(status, dtype=np.int64)
    labels = {
        "long_name": "warnings of the member, a bit each",
        "flag_masks": [1 << bit for bit in range(len(WARNINGS))],
        "flag_meanings": " ".join(WARNINGS),
    }
    error = np.full(len(codes), np.nan) if attitude_error is None else np.array(attitude_error, dtype=float)
    text = "estimated error of the attitude at the last sample; nan where none is estimated"
    found = {
        "status": status_variable(codes),
        "warnings": KeptVariable((), np.array(warnings, dtype=np.int64), labels),
        "steps": kept(np.array(steps, dtype=np.int64), "1", "steps taken"),
        "time_reached": kept(np.array(reached), "s", "time of the last sample"),
        "drift_bound": kept(np.array(bound), "1", "relative drift that rounding alone explains"),
        "attitude_error": kept(error, "rad", text),
    }
    if position_error is not None:
        text = "estimated error of the position at the last sample"
        found["position_error"] = kept(np.array(position_error), "m", text)
    return found


def _modelling_errors(found: Sequence[Modelling | None]) -> Kept:
    """Errors of members' averaged models; None where none was measured."""
    errors = {
        "modelling_error": ("worst", "directions", "rad"),
        "modelling_error_norm": (SIZE, "angular_momentum_norm, relative", "1"),
        "modelling_error_energy": (ENERGY, "energy of rotation, relative", "1"),
    }
    until, every = "largest error of the averaged model's {} until the end", Kept()
    for name, (attribute, what, units) in errors.items():
        column = np.array([getattr(one, attribute, None) for one in found], dtype=float)
        if name == "modelling_error" or not np.isnan(column).all():
            every[name] = kept(column, units, until.format(what))
    return every


@contextmanager
def naming_member(member: int) -> Iterator[None]:
    """Add a member's number to the traceback of an error of the code."""
    try:
        yield
    except Exception as error:
        error.add_note(f"in member {member} of the sweep")
        raise


def run_alone(sweep: Sweep, member: int, keep: Sequence[str]) -> MemberResults:
    """Run one member by itself; a refusal or failure is recorded, and errors of the code are raised."""
    try:
        result = run(sweep.experiment_of(member), out=None)
    except ConfigError as error:
        return failed(Outcome.REFUSED, "; ".join(str(problem) for problem in error.problems))
    except RigidsimError as error:
        return failed(Outcome.FAILED, str(error))
    summary = result.outcome
    assert isinstance(summary, Summary)
    if summary.status == Status.INTERRUPTED.value:
        raise KeyboardInterrupt
    placed = summary.accuracy.estimated_position_error
    results = _kept_of_run(sweep, result, keep) | plain_variables(
        status=[OUTCOMES.index(summary.status)],
        warnings=[warning_bits(summary.warning_codes)],
        steps=[summary.cost.steps],
        reached=[summary.time_reached],
        bound=[max((row.bound for row in summary.invariants.values()), default=np.nan)],
        attitude_error=[result.attitude_error],
        position_error=None if placed is None else [placed],
    )
    if summary.modelling is not None:
        results |= _modelling_errors([summary.modelling])
    if "frequencies" in keep and result.blocks:
        results |= frequencies_of(result)
    reasons = {} if summary.status in ENDED_WELL else {0: summary.message}
    spent = sum(summary.cost.cpu_by_phase.get(phase, 0.0) for phase in _ESTIMATING)
    return MemberResults(results, reasons, {"alone": 1}, estimating=spent)


def failed(outcome: Outcome, reason: str) -> MemberResults:
    """Results of a member that gave no samples."""
    code, nothing = OUTCOMES.index(outcome.value), [np.nan]
    found = plain_variables(status=[code], warnings=[0], steps=[0], reached=nothing, bound=nothing)
    return MemberResults(found, {0: reason}, {"alone": 1})


def _kept_of_run(sweep: Sweep, result: MemoryRun, keep: Sequence[str]) -> Kept:
    named = {variable.name: variable for variable in result.variables}
    shown = [v for v in named.values() if "units" in v.attributes and v.name not in ("time", *_DATES)]
    series, times = list[Parts](), np.zeros(0)
    if result.blocks:
        times = joined_parts(result.blocks, named["time"])[0].reshape(-1)
        for variable in shown:
            parts = joined_parts(result.blocks, variable)
            series.append((variable, [part.reshape(1, len(times), -1) for part in parts]))
    extras = {extra.name: extra.values for extra in result.extras}

    def occurrences() -> Occurrences:
        for event in sweep.base.config.events:
            points = {
                v.name: (v, [at]) for v in shown if (at := extras.get(f"{event.name}_{v.name}")) is not None
            }
            yield event.name, [extras[f"{event.name}_time"]], points

    return kept_of(sweep, series, times, np.array([len(times)]), occurrences(), keep)


_ONE_BY_ONE = ("frequencies",)
"""Items that only single runs can provide."""
_LOOKED_AT, _COUNTED = 64, 4096  # members by which a sweep is judged, by their equations and by their kinds
_MOST_KINDS, _LEAST_MEMBERS = 64, 8
"""Up to so many kinds of members have batches however few members they have; more need so many each."""
_MOST_AHEAD = 4  # families compiled before the first tile


Part = tuple[np.ndarray, MemberResults]
"""Results of some of a tile's members, with their places among them."""


def why_alone(sweep: Sweep, keep: Sequence[str]) -> str:
    """Code of the reason why no member of a sweep can run in a batch; empty if some may."""
    if sweep.fits:
        return FITS
    for item in _ONE_BY_ONE:
        if item in keep:
            return item
    if not sweep.table.batch:
        return "asked"
    timed = sweep.base.config.limits.wall_time is not None
    if timed or any(axis.key == "limits.wall_time" for axis in sweep.axes):
        return "wall_time"
    reason = batchable(sweep.base, [])
    return "" if reason is None else reason.name.lower()


class BatchTiles:
    """Members of a sweep in batches; what is compiled for a family is kept by the process."""

    def __init__(self, sweep: Sweep) -> None:
        self._sweep = sweep
        self.axes = AxisNumbers(sweep)

    @cached_property
    def alone(self) -> NotBatchable | None:
        """Why all members run one by one, if too few could share a batch; None if they don't.

        It is judged by the config alone: who runs in a batch must not depend on which members a process has
        met before, since single runs have other last bits.
        """
        kinds, looked_at = self._kinds()
        if kinds > _MOST_KINDS and kinds * _LEAST_MEMBERS > looked_at:
            return NotBatchable.FAMILIES
        found = self._sample
        if found.alone and not found.groups:
            return found.alone[min(found.alone)]
        many = self._sweep.count > _LOOKED_AT and 2 * len(found.groups) > _LOOKED_AT
        return NotBatchable.FAMILIES if many else None

    @cached_property
    def lanes_of_a_table(self) -> int:
        """How many members pass the rows of a table together; 0 without one, or if they run one by one."""
        groups = [] if self.alone is not None else self._sample.groups
        return LANES_OF_A_TABLE if any(family.knots is not None for family in groups) else 0

    def _kinds(self) -> tuple[int, int]:
        """Number of kinds (see ``Members``) among some members, and the number of these."""
        sweep = self._sweep
        apart = [place for place in range(len(sweep.axes)) if not self.axes.swept(place)]
        if sweep.product or not apart:
            return math.prod(sweep.axes[place].count for place in apart), sweep.count
        some = np.arange(0, sweep.count, -(-sweep.count // _COUNTED))
        codes = np.stack([self.axes.codes(place, some) for place in apart])
        return len(np.unique(codes, axis=1).T), len(some)

    @cached_property
    def _sample(self) -> Sorted:
        """Members from all over the sweep, sorted."""
        return self._sorted(range(0, self._sweep.count, -(-self._sweep.count // _LOOKED_AT)))

    def _sorted(self, members: Sequence[int], most_refused: int | None = None) -> Sorted:
        return Families(Members(self._sweep, members, self.axes), most_refused).sort()

    def compile(self) -> None:
        """Compile what members from all over the sweep need."""
        for family in self._sample.groups[:_MOST_AHEAD] if self.alone is None else ():
            run = BatchRun(family)
            run.compile()
            if self._estimated:
                MemberEstimates(family, run.width)

    def run(
        self, members: Sequence[int], keep: Sequence[str], alone: bool | None = None
    ) -> tuple[list[Part], list[int], str]:
        """Run all members that can be run together; none if they were found to run ``alone`` before.

        Returns:
            Results of these, and of members that no run accepts; places of those still to be run one by one;
            and the code of the reason why the first of them is left.
        """
        if alone or (alone is None and self.alone is not None):
            return [], list(range(len(members))), (self.alone or NotBatchable.FAMILIES).name.lower()
        found = self._sorted(members)
        left = sorted(found.alone)
        why = found.alone[left[0]].name.lower() if left else ""
        parts: list[Part] = []
        for place, error in found.refused.items():
            reason = "; ".join(str(problem) for problem in error.problems)
            parts.append((np.array([place]), failed(Outcome.REFUSED, reason)))
        for family in found.groups:
            batch = BatchRun(family)
            estimates = MemberEstimates(family, batch.width) if self._estimated else None
            variables = [v for v in dataset_variables(family.prepared) if "units" in v.attributes]
            averaged = family.prepared.system.formulation.average is not None
            for block in batch.blocks():
                before = time.process_time()
                errors = estimates.of(block) if estimates is not None else None
                models = self._models(block, [members[k] for k in block.members]) if averaged else []
                spent = time.process_time() - before
                done = np.array([status is not None for status in block.status], dtype=bool)
                if done.any():
                    results = self._results(variables, block, errors, models, done, keep, spent)
                    parts.append((block.members[done], results))
                if not done.all():
                    left += block.members[~done].tolist()
                    why = why or "gave_up"
        return parts, sorted(left), why

    def refused(self, members: Sequence[int], most: int | None = None) -> tuple[dict[int, ConfigError], int]:
        """Members that no run accepts, up to ``most``, why, and how many share equations and can be run."""
        if self.alone is not None:
            return {}, 0
        found = self._sorted(members, most)
        accepted = sum(len(family.members) for family in found.groups)
        return {int(members[place]): error for place, error in found.refused.items()}, accepted

    @property
    def _estimated(self) -> bool:
        return self._sweep.base.config.output.estimate

    def _models(self, block: BatchBlock, members: Sequence[int]) -> list[Modelling | Unmeasured | None]:
        """Errors of members' averaged models, measured from their samples as in single runs; None where they
        aren't asked for, or a member didn't finish.
        """
        found = list[Modelling | Unmeasured | None]()
        for place, (member, status) in enumerate(zip(members, block.status, strict=True)):
            if not self._estimated or status is not Status.FINISHED:
                found.append(None)
                continue
            prepared = prepare(self._sweep.worked_out(member))
            trail = SampleTrail(prepared.precision)
            trail.take(SampleBlock.of(0, block.moments[:, place], block.states[:, :, place]))
            try:
                found.append(measure_modelling(prepared, trail).modelling)
            except Unmeasured as why:
                if why.code is UnmeasuredCode.INTERRUPTED:
                    raise KeyboardInterrupt from None
                found.append(why)
        return found

    def _results(
        self, variables: Sequence[Variable], block: BatchBlock, errors: MemberErrors | None,
        models: Sequence[Modelling | Unmeasured | None], done: np.ndarray, keep: Sequence[str],
        estimating: float,
    ) -> MemberResults:  # fmt: skip
        """Results of those members of a block that are ``done``."""
        sweep = self._sweep
        kept = _kept_of_block(sweep, block, variables, keep)
        over = block.largest_drifts().max(axis=0) > block.drift_bound
        warned = {WarningCode.DRIFT: over, WarningCode.UNDEFINED: _lost(block)}
        if errors is not None:
            gone = WarningCode.RATES_UNCERTAIN if errors.attitude is None else WarningCode.ATTITUDE_UNCERTAIN
            warned[gone] = errors.uncertain
        known = [one if isinstance(one, Modelling) else None for one in models]
        if models:
            sizes = [(one.worst, one.angular_momentum_norm, one.energy) if one else () for one in known]
            wrong = [max((x or 0.0 for x in size), default=0.0) > UNCERTAIN for size in sizes]
            warned[WarningCode.MODEL_UNCERTAIN] = np.array(wrong)
            warned[WarningCode.MODEL_UNMEASURED] = np.array([isinstance(x, Unmeasured) for x in models])
        bits = [np.where(found, warning_bits([code.value]), 0) for code, found in warned.items()]
        rows = np.maximum(block.reached - 1, 0)
        kept |= plain_variables(
            status=[-1 if status is None else OUTCOMES.index(status.value) for status in block.status],
            warnings=np.bitwise_or.reduce(bits),
            steps=block.steps,
            reached=np.where(block.reached > 0, block.times[rows], np.nan),
            bound=block.drift_bound,
            attitude_error=None if errors is None else errors.attitude,
            position_error=None if errors is None else errors.position,
        )
        if models:
            kept |= _modelling_errors(known)
        kept = {name: replace(v, values=v.values[done]) for name, v in kept.items()}
        statuses = [status for status in block.status if status is not None]
        reasons = {i: one.message for i, one in enumerate(statuses) if one.value not in ENDED_WELL}
        engines = {f"batch of {block.width}": len(statuses)}
        return MemberResults(kept, reasons, engines, estimating=estimating)


def _lost(block: BatchBlock) -> np.ndarray:
    """Members in which a recorded variable becomes undefined after having been defined, (members,)."""
    found = np.zeros(len(block.members), dtype=bool)
    for values in block.values.values():
        if np.isfinite(values.sum()):
            continue
        bad = np.asarray(np.isnan(values).reshape(*values.shape[:2], -1).any(axis=2))
        if bad.any():
            taken = np.arange(len(bad))[:, None] < block.reached
            known = np.logical_or.accumulate(~bad & taken, axis=0)
            found |= (bad & taken & known).any(axis=0)
    return found


def _kept_of_block(
    sweep: Sweep, block: BatchBlock, variables: Sequence[Variable], keep: Sequence[str]
) -> Kept:
    named = {variable.name: variable for variable in variables}
    values = {name: np.moveaxis(x, 0, 1) for name, x in block.values.items()}
    values |= {name: x.T[:, :, None] for name, x in block.drifts.items()}
    series = [(variable, [values[name]]) for name, variable in named.items() if name in values]

    def occurrences() -> Occurrences:
        for event in block.events:
            edges = [*pairwise(np.searchsorted(event.member, np.arange(len(block.members) + 1)))]
            points = {
                name: (named[name], [x[a:b] for a, b in edges])
                for name, x in event.values.items()
                if name in named and name in block.values
            }
            yield event.name, [event.time[a:b] for a, b in edges], points

    return kept_of(sweep, series, block.times, block.reached, occurrences(), keep)


_MOST_TRIED = 1000  # members among which there has to be one that can be run
_LINES = 5  # of each signal's spectrum


@lru_cache(maxsize=4)
def sweep_of(config: str, source: str = "the sweep's config") -> Sweep:
    """The sweep of a config's text, worked out once per process; ``source``: where its kernels are found."""
    return recording(Sweep.of(parse(config, source=source)))


@lru_cache(maxsize=4)
def kernel_of_members(config: str, source: str) -> dict[str, Any]:
    """Identifies the kernels of a config's members; empty without one."""
    sweep = sweep_of(config, source)
    if not reads_kernels(sweep.base):
        return {}
    return kernel_attributes(build_scene(sweep.worked_out(first_possible(sweep))))


def refuse_other_kernel(sweep: Sweep, begun: Mapping[str, Any], place: Path) -> None:
    """Refuse to go on with members that were begun with another kernel than the one that is found now.

    Raises:
        RunFolderError: its bytes differ.
    """
    refuse_others(begun, kernel_of_members(sweep.experiment.text, sweep.experiment.source), place)


def first_possible(sweep: Sweep) -> int:
    """The first member that can be run: the first of all, unless ``impossible = "mark"``."""
    marking = sweep.table.impossible == "mark"
    refused: ConfigError | None = None
    for member in range(min(sweep.count, _MOST_TRIED) if marking else 1):
        try:
            prepare(sweep.worked_out(member))
        except ConfigError as error:
            refused = refused or sweep.with_member_named(member, error)
        else:
            return member
    assert refused is not None
    raise refused if marking else MemberError(markable(refused.problems), refused.source)


def markable(problems: Sequence[Problem]) -> list[Problem]:
    """Problems of members, the last with how the others can be run all the same."""
    *others, last = problems
    hint = '[sweep] impossible = "mark" marks such members, with the reason, and runs the others'
    return [*others, Problem(last.where, f"{last.what}; {hint}")]


def recording(sweep: Sweep) -> Sweep:
    """The sweep with its members recording everything that is to be kept."""
    output = sweep.base.config.output
    if not set(sweep.table.keep) & set(INDICATORS) or GROWTH in (output.record or ()):
        return sweep
    recorded = output.record
    if not recorded:
        recorded = [v.name for v in prepare(sweep.worked_out(first_possible(sweep))).system.recorded]
    names = ", ".join(f'"{name}"' for name in [*recorded, GROWTH])
    return replace(sweep, base=sweep.base.with_overrides([f"output.record=[{names}]"]), added=GROWTH)


def run_members(
    sweep: Sweep, members: Sequence[int], keep: Sequence[str], alone: bool | None = None
) -> MemberResults:
    """Run some members of a sweep and keep the items asked for; ``alone``: see ``Begun``."""
    parts: list[Part] = []
    left, why = list(range(len(members))), why_alone(sweep, keep)
    if not why:
        parts, left, why = batches_of(sweep.experiment.text, sweep.experiment.source).run(
            members, keep, alone
        )
    for place in left:
        with naming_member(members[place]):
            parts.append((np.array([place]), run_alone(sweep, members[place], keep)))
    return MemberResults.together(parts, why)


@lru_cache(maxsize=4)
def batches_of(config: str, source: str) -> BatchTiles:
    """The batches of a config's sweep, looked at once per process."""
    sweep = sweep_of(config, source)
    return BatchTiles(sweep)


def get_ready(config: str, source: str) -> None:
    """Compile in this process what most members of a config's sweep need; nothing is integrated."""
    sweep = sweep_of(config, source)
    if not why_alone(sweep, sweep.table.keep):
        batches_of(config, source).compile()


def single_member(experiment: Experiment, member: int) -> Experiment:
    """A member of a config's ``[sweep]`` as a separate run, named after the sweep and its number."""
    sweep = Sweep.of(experiment)
    if not 0 <= member < sweep.count:
        what = f"given {member}; its members are 0 to {sweep.count - 1}, the last axis runs fastest"
        raise ConfigError(Problem("--member", what), experiment.source)
    name = f"{experiment.config.name}_{member}"
    return sweep.experiment_of(member).with_overrides([f'name="{name}"'])


def frequencies_of(result: MemoryRun) -> Kept:
    """The strongest lines of each signal, and its secular rate; empty if it can't be analysed."""
    try:
        found = analyse(result, lines=_LINES)
    except RigidsimError:
        return {}
    kept: Kept = {}
    for signal in found.signals:
        name = re.sub(r"\W+", "_", signal.name).strip("_")
        for what, units in (("frequency", "rad/s"), ("amplitude", signal.units)):
            table = np.full((1, _LINES), np.nan)
            values = [float(getattr(line, what)) for line in signal.lines[:_LINES]]
            table[0, : len(values)] = values
            labels: dict[str, Any] = {"units": units, "long_name": f"{what} of the lines of {signal.name}"}
            kept[f"{name}_{what}"] = KeptVariable(("line",), table, labels, "frequencies")
        rate = np.array([np.nan if signal.rate is None else float(signal.rate)])
        labels = {"units": f"{signal.units}/s", "long_name": f"secular rate of {signal.name}"}
        kept[f"{name}_rate"] = KeptVariable((), rate, labels, "frequencies")
    return kept
