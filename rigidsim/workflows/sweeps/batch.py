"""Running a tile's members in batches: families that share equations, and the rest one by one."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from rigidsim.accuracy.estimates.members import MemberErrors, MemberEstimates
from rigidsim.errors import ConfigError
from rigidsim.scene.cautions import WarningCode
from rigidsim.scene.sweeps.sweep import FITS, Sweep
from rigidsim.session.dataset import dataset_variables
from rigidsim.session.kept import MemberSeries, Points, kept_events, kept_of_series
from rigidsim.session.members import (
    ENDED_WELL,
    OUTCOMES,
    MemberResults,
    Outcome,
    failed,
    plain_variables,
    status_variable,
    warning_bits,
    warnings_variable,
)
from rigidsim.solve.batch.family import (
    AxisNumbers,
    Families,
    Family,
    Members,
    NotBatchable,
    Sorted,
    batchable,
)
from rigidsim.solve.batch.run import BatchBlock, BatchRun
from rigidsim.solve.problem import prepare
from rigidsim.store.sweeps.tiles import Kept
from rigidsim.store.variables import Variable

_ONE_BY_ONE = ("frequencies",)
"""Items that only single runs can provide."""
_LOOKED_AT, _COUNTED = 64, 4096  # members by which a sweep is judged, by their equations and by their kinds
_MOST_KINDS, _LEAST_MEMBERS = 64, 8
"""Up to so many kinds of members have batches however few members they have; more need so many each."""
_MOST_AHEAD = 4  # families compiled before the first tile
_MOST_HELD = 256  # families
_MOST_UNTRACED = 8
"""Members that can't be traced after which a check leaves the others to their runs: each takes as long."""


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


@dataclass(frozen=True)
class _FamilyRun:
    """What is compiled for a family, and the variables that its members record."""

    family: Family
    run: BatchRun
    variables: list[Variable]

    @cached_property
    def estimates(self) -> MemberEstimates:
        """Estimates of its members' errors."""
        return MemberEstimates(self.family, self.run.width)


class BatchTiles:
    """Families of a sweep, traced and compiled once per process."""

    def __init__(self, sweep: Sweep) -> None:
        self._sweep = sweep
        self.axes = AxisNumbers(sweep)
        self._known: list[Family] = []
        self._runs: dict[int, _FamilyRun] = {}

    @cached_property
    def alone(self) -> NotBatchable | None:
        """Why all members run one by one, if too few could share a batch; None if they don't.

        It is judged by the config alone: who runs in a batch must not depend on which members a process has
        met before, since single runs have other last bits.
        """
        kinds, looked_at = self._kinds()
        if kinds > _MOST_KINDS and kinds * _LEAST_MEMBERS > looked_at:
            return NotBatchable.FAMILIES
        _, found = self._sample
        if found.alone and not found.groups:
            return found.alone[min(found.alone)]
        many = self._sweep.count > _LOOKED_AT and 2 * len(found.groups) > _LOOKED_AT
        return NotBatchable.FAMILIES if many else None

    def _kinds(self) -> tuple[int, int]:
        """Number of kinds (see ``Members``) among some members, and the number of these."""
        sweep = self._sweep
        apart = [place for place in range(len(sweep.axes)) if not self.axes.traced(place)]
        if sweep.product or not apart:
            return math.prod(sweep.axes[place].values.count for place in apart), sweep.count
        some = np.arange(0, sweep.count, -(-sweep.count // _COUNTED))
        codes = np.stack([self.axes.codes(place, some) for place in apart])
        return len(np.unique(codes, axis=1).T), len(some)

    @cached_property
    def _sample(self) -> tuple[range, Sorted]:
        """Members from all over the sweep, sorted."""
        some = range(0, self._sweep.count, -(-self._sweep.count // _LOOKED_AT))
        return some, self._sorted(some, most_untraced=_MOST_UNTRACED)

    def _sorted(
        self, members: Sequence[int], most_refused: int | None = None, most_untraced: int | None = None
    ) -> Sorted:
        if len(self._known) > _MOST_HELD:  # whoever represents a family, it has the same numbers
            self._known.clear()
            self._runs.clear()
        families = Families(Members(self._sweep, members, self.axes), most_refused, most_untraced)
        families.known = self._known
        return families.sort()

    def compile(self) -> None:
        """Trace and compile what members from all over the sweep need."""
        if self.alone is not None:
            return
        some, found = self._sample
        for family, numbers in found.groups[:_MOST_AHEAD]:
            compiled = self._run_of(family, some[int(numbers.members[0])])
            compiled.run.compile()
            if self._estimated:
                compiled.estimates.compile()

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
        for family, numbers in found.groups:
            compiled = self._run_of(family, int(members[int(numbers.members[0])]))
            for block in compiled.run.blocks(numbers):
                before = time.process_time()
                errors = compiled.estimates.of(numbers, block) if self._estimated else None
                spent = time.process_time() - before
                done = np.array([status is not None for status in block.status], dtype=bool)
                if done.any():
                    parts.append(
                        (block.members[done], self._results(compiled, block, errors, done, keep, spent))
                    )
                if not done.all():
                    left += block.members[~done].tolist()
                    why = why or "gave_up"
        return parts, sorted(left), why

    def refused(self, members: Sequence[int], most: int | None = None) -> tuple[dict[int, ConfigError], int]:
        """Members that no run accepts, up to ``most``, why, and how many share equations and can be run."""
        if self.alone is not None:
            return {}, 0
        found = self._sorted(members, most, _MOST_UNTRACED)
        accepted = sum(len(numbers.members) for _, numbers in found.groups)
        return {int(members[place]): error for place, error in found.refused.items()}, accepted

    def _run_of(self, family: Family, member: int) -> _FamilyRun:
        if id(family) not in self._runs:
            prepared = prepare(self._sweep.worked_out(member))
            variables = [v for v in dataset_variables(prepared) if "units" in v.attributes]
            self._runs[id(family)] = _FamilyRun(family, BatchRun(family), variables)
        return self._runs[id(family)]

    @property
    def _estimated(self) -> bool:
        return self._sweep.base.config.output.estimate

    def _results(
        self, compiled: _FamilyRun, block: BatchBlock, errors: MemberErrors | None, done: np.ndarray,
        keep: Sequence[str], estimating: float,
    ) -> MemberResults:  # fmt: skip
        """Results of those members of a block that are ``done``."""
        sweep = self._sweep
        kept = _kept(block, compiled.variables, keep, sweep.table.most_events, sweep.added)
        codes = [-1 if status is None else OUTCOMES.index(status.value) for status in block.status]
        kept["status"] = status_variable(np.array(codes, dtype=np.int64))
        over = block.largest_drifts().max(axis=0) > block.drift_bound
        warned = {WarningCode.DRIFT: over, WarningCode.UNDEFINED: _lost(block)}
        if errors is not None:
            gone = WarningCode.RATES_UNCERTAIN if errors.attitude is None else WarningCode.ATTITUDE_UNCERTAIN
            warned[gone] = errors.uncertain
        bits = [np.where(found, warning_bits([code.value]), 0) for code, found in warned.items()]
        kept["warnings"] = warnings_variable(np.bitwise_or.reduce(bits))
        rows = np.maximum(block.reached - 1, 0)
        kept |= plain_variables(
            steps=block.steps,
            reached=np.where(block.reached > 0, block.times[rows], np.nan),
            bound=block.drift_bound,
            attitude_error=None if errors is None else errors.attitude,
            position_error=None if errors is None else errors.position,
        )
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


def _kept(
    block: BatchBlock,
    variables: Sequence[Variable],
    keep: Sequence[str],
    most_events: int,
    hidden: str,
) -> Kept:
    series, recorded = [], {}
    for variable in variables:
        if variable.name in block.values:
            values = np.moveaxis(block.values[variable.name], 0, 1)
            recorded[variable.name] = variable
        elif variable.name in block.drifts:
            values = block.drifts[variable.name].T[:, :, None]
        else:
            continue
        series.append(MemberSeries(variable, [values]))
    kept = kept_of_series(series, block.times, block.reached, keep, hidden)
    recorded = {name: variable for name, variable in recorded.items() if name != hidden}
    for event in block.events:
        edges = np.searchsorted(event.member, np.arange(len(block.members) + 1))
        times = [event.time[a:b] for a, b in pairwise(edges)]
        points: Points = {
            name: (recorded[name], [values[a:b] for a, b in pairwise(edges)])
            for name, values in event.values.items()
            if name in recorded
        }
        kept |= kept_events(event.name, times, most_events, points, keep)
    return kept
