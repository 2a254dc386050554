"""Running members of a sweep: what is kept of each, how each ended, and why if it failed."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from rigidsim.errors import ConfigError, RigidsimError
from rigidsim.scene.cautions import WarningCode
from rigidsim.session.kept import MemberSeries, assembled, kept, kept_events, kept_of_series
from rigidsim.solve.status import Status
from rigidsim.store.netcdf import joined_parts
from rigidsim.store.run import MemoryRun
from rigidsim.store.summary import Summary
from rigidsim.store.summary_parts import Modelling
from rigidsim.store.sweeps.tiles import Kept, KeptVariable


class Outcome(Enum):
    """How a member ended that has no status of a run."""

    REFUSED = "refused"
    FAILED = "failed"


ENDED_WELL = (Status.FINISHED.value, Status.EVENT.value)
OUTCOMES = (
    *(s.value for s in (Status.FINISHED, Status.EVENT, Status.WALL_TIME, Status.MAX_STEPS, Status.MAX_DRIFT)),
    *(s.value for s in (Status.NON_FINITE, Status.COLLAPSED, Status.UNRESOLVED, *Outcome, Status.IMPOSSIBLE)),
    Status.OUT_OF_RANGE.value,
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


def warnings_variable(bits: np.ndarray) -> KeptVariable:
    """Warnings of members, each a mask as in ``warning_bits``."""
    attributes = {
        "long_name": "warnings of the member, a bit each",
        "flag_masks": [1 << bit for bit in range(len(WARNINGS))],
        "flag_meanings": " ".join(WARNINGS),
    }
    return KeptVariable((), bits, attributes)


def plain_variables(
    *,
    steps: np.ndarray,
    reached: np.ndarray,
    bound: np.ndarray,
    attitude_error: np.ndarray | None,
    position_error: np.ndarray | None = None,
    modelling: Modelling | None = None,
) -> Kept:
    """Variables that every member has besides its status, (members,) each; None for errors that aren't
    estimated, and for the position of a body without one.
    """
    unknown = np.full(len(steps), np.nan)
    found = {
        "steps": kept(steps.astype(np.int64), "1", "steps taken"),
        "time_reached": kept(reached, "s", "time of the last sample"),
        "drift_bound": kept(bound, "1", "relative drift that rounding alone explains"),
        "attitude_error": kept(
            unknown if attitude_error is None else attitude_error,
            "rad",
            "estimated error of the attitude at the last sample; nan where none is estimated",
        ),
    }
    if position_error is not None:
        told = "estimated error of the position at the last sample"
        found["position_error"] = kept(position_error, "m", told)
    if modelling is not None:
        errors = {
            "modelling_error": (modelling.worst, "directions", "rad"),
            "modelling_error_norm": (modelling.angular_momentum_norm, "angular_momentum_norm, relative", "1"),
            "modelling_error_energy": (modelling.energy, "energy of rotation, relative", "1"),
        }
        for name, (error, what, units) in errors.items():
            if error is not None or name == "modelling_error":
                value = np.array([np.nan if error is None else error])
                told = f"largest error of the averaged model's {what} until the end"
                found[name] = kept(value, units, told)
    return found


@contextmanager
def naming_member(member: int) -> Iterator[None]:
    """Add a member's number to the traceback of an error of the code."""
    try:
        yield
    except Exception as error:
        error.add_note(f"in member {member} of the sweep")
        raise


def run_alone(
    run: Callable[[], MemoryRun],
    keep: Sequence[str],
    most_events: int,
    events: Sequence[str],
    more: Callable[[MemoryRun], Kept] | None = None,
    hidden: str = "",
) -> MemberResults:
    """Run one member by itself; a refusal or failure is recorded, and errors of the code are raised."""
    try:
        result = run()
    except ConfigError as error:
        return failed(Outcome.REFUSED, "; ".join(str(problem) for problem in error.problems))
    except RigidsimError as error:
        return failed(Outcome.FAILED, str(error))
    summary = result.outcome
    assert isinstance(summary, Summary)
    if summary.status == Status.INTERRUPTED.value:
        raise KeyboardInterrupt
    results = _kept_of_run(result, keep, hidden) | _events_of_run(result, keep, most_events, events)
    bounds = [row.bound for row in summary.invariants.values()]
    error_at_end = summary.accuracy.estimated_attitude_error
    if summary.accuracy.certified is not None:
        error_at_end = summary.accuracy.certified
    results |= _ended(summary.status, summary.warning_codes)
    placed = summary.accuracy.estimated_position_error
    results |= plain_variables(
        steps=np.array([summary.cost.steps]),
        reached=np.array([summary.time_reached]),
        bound=np.array([max(bounds, default=np.nan)]),
        attitude_error=None if error_at_end is None else np.array([error_at_end]),
        position_error=None if placed is None else np.array([placed]),
        modelling=summary.modelling,
    )
    if more is not None and result.blocks:
        results |= more(result)
    reasons = {} if summary.status in ENDED_WELL else {0: summary.message}
    spent = sum(summary.cost.cpu_by_phase.get(phase, 0.0) for phase in _ESTIMATING)
    return MemberResults(results, reasons, {"alone": 1}, estimating=spent)


def _ended(status: str, warnings: Iterable[str]) -> Kept:
    """Status and warnings of a single member."""
    return {
        "status": status_variable(np.array([OUTCOMES.index(status)], dtype=np.int64)),
        "warnings": warnings_variable(np.array([warning_bits(warnings)], dtype=np.int64)),
    }


def failed(outcome: Outcome, reason: str) -> MemberResults:
    """Results of a member that gave no samples."""
    nothing = np.array([np.nan])
    found = _ended(outcome.value, [])
    found |= plain_variables(steps=np.array([0]), reached=nothing, bound=nothing, attitude_error=nothing)
    return MemberResults(found, {0: reason}, {"alone": 1})


def _kept_of_run(result: MemoryRun, keep: Sequence[str], hidden: str) -> Kept:
    if not result.blocks:
        return {}
    series, times = [], np.zeros(0)
    for variable in result.variables:
        if variable.name == "time":
            times = np.reshape(joined_parts(result.blocks, variable)[0], -1)
        if variable.name == "time" or "units" not in variable.attributes or variable.name in _DATES:
            continue
        parts = [
            part.reshape(1, -1, max(1, int(np.prod(variable.shape))))
            for part in joined_parts(result.blocks, variable)
        ]
        series.append(MemberSeries(variable, parts))
    return kept_of_series(series, times, np.array([len(times)]), keep, hidden)


def _events_of_run(result: MemoryRun, keep: Sequence[str], most_events: int, events: Sequence[str]) -> Kept:
    found: Kept = {}
    recorded = {v.name: v for v in result.variables if "drift_of" not in v.attributes and v.name != "time"}
    for name in events:
        extras = {extra.name: extra for extra in result.extras}
        times = extras[f"{name}_time"].values
        points = {
            what: (variable, [extras[f"{name}_{what}"].values])
            for what, variable in recorded.items()
            if f"{name}_{what}" in extras and variable.name not in _DATES
        }
        found |= kept_events(name, [times], most_events, points, keep)
    return found
