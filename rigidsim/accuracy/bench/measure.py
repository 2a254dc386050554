"""Measuring the speed and accuracy of a scene's settings.

Every setting integrates the scene's own motion, attitude included, and is held against a reference whose own
error is known: the closed form to 50 digits where there is one, else the best that a higher precision can do.
Speeds are taken over several fresh processes, in turn. A time budget bounds it all: long motions are measured
over their beginning, quadruple precision over less of it, and what doesn't fit is listed as left out. Nothing
is extrapolated.
"""

import math
import random
import statistics
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from rigidsim.accuracy.bench.plan import (
    DEFAULT,
    Plan,
    ReferenceSolution,
    Solutions,
    attitude_task,
    best_reference,
    every_setting,
    make_plan,
    reference_tasks,
)
from rigidsim.accuracy.bench.worker import Task, ask
from rigidsim.accuracy.comparison import angles_between
from rigidsim.accuracy.setting import Setting
from rigidsim.accuracy.trial import Trial
from rigidsim.errors import RigidsimError
from rigidsim.scene.config import Experiment

_LEAST_BUDGET = 5.0
_GRACE = 120.0  # extra seconds for what a measurement can't do without, on a busy machine
_EXPLORING, _SINGLE = 0.65, 0.4  # parts of the budget, for all attitudes and for those of one setting
_PASSES = 0.03  # CPU seconds of passes per setting and process: their median is then known to a few per cent


class RowStatus(StrEnum):
    """Outcome of measuring a setting; the values stand in datasets."""

    MEASURED = "measured"
    SHORT = "measured over less"
    LEFT_OUT = "left out"
    FAILED = "refused"


@dataclass
class Row:
    """Results for one setting, over a part of the horizon: its trial, the problem if there is none, and for
    each process the CPU seconds per step (closed form: per sample), its own and the default setting's.
    """

    setting: Setting
    part: float = 1.0
    status: RowStatus = RowStatus.LEFT_OUT
    problem: str = ""
    trial: Trial | None = None
    unit_seconds: list[float] = field(default_factory=list)
    default_seconds: list[float] = field(default_factory=list)

    @property
    def attitudes(self) -> list[np.ndarray]:
        """Float64 parts (samples, 4)."""
        return [] if self.trial is None else self.trial.attitudes

    @property
    def steps(self) -> int:
        """Natural steps taken."""
        return 0 if self.trial is None else self.trial.steps

    @property
    def measured(self) -> bool:
        """Whether its attitudes were computed to the end of its part."""
        return self.status in (RowStatus.MEASURED, RowStatus.SHORT)


@dataclass(frozen=True)
class Measurement:
    """Results for all settings; see ``rigidsim.workflows.tradeoff`` for the dataset."""

    experiment: Experiment
    plan: Plan
    rows: list[Row]
    reference: ReferenceSolution
    wide_reference: ReferenceSolution | None
    processes: int
    seconds: float

    def errors(self, row: Row) -> tuple[np.ndarray, np.ndarray]:
        """Attitude errors (samples,) of a measured setting, and the reference's own, rad."""
        reference = self.reference
        if row.setting.precision == "quadruple" and self.wide_reference is not None:
            reference = self.wide_reference
        count = min(len(row.attitudes[0]), len(reference.attitudes[0]))
        mine = [part[:count] for part in row.attitudes]
        theirs = [part[:count] for part in reference.attitudes]
        return angles_between(mine, theirs), reference.error[:count]

    def cost(self, row: Row) -> tuple[float, float, float]:
        """CPU time per simulated second relative to the default's: median, least and largest over the
        processes; nan if speed was not measured.
        """
        default = next(r for r in self.rows if r.setting == DEFAULT)
        scale = (self._units(row) / row.part) / (default.steps / default.part)
        ratios = [scale * a / b for a, b in zip(row.unit_seconds, row.default_seconds, strict=True)]
        if not ratios:
            return (math.nan,) * 3
        return statistics.median(ratios), min(ratios), max(ratios)

    def cpu_seconds(self, row: Row) -> float:
        """CPU seconds of the setting over its part: steps (or samples) times a step's median cost."""
        if not row.unit_seconds:
            return math.nan
        return self._units(row) * statistics.median(row.unit_seconds)

    def _units(self, row: Row) -> float:
        """Number of units that cost time: steps, or samples of a closed form."""
        return row.steps if row.setting.has_steps else self.plan.samples * row.part


def measure(
    experiment: Experiment,
    *,
    budget: float = 90.0,
    repeats: int = 3,
    plan: Plan | None = None,
    reference: str = "best",
    full: bool = False,
    settings: Sequence[Setting] | None = None,
    told: Callable[[str], None] = lambda _: None,
) -> Measurement:
    """Measure the settings of a scene, against the best reference, or an "extended" one if nothing better is
    possible in time. Raises ``ConfigError``, and ``RigidsimError`` if the budget is too small for anything.
    """
    if not budget >= _LEAST_BUDGET:
        raise RigidsimError(
            f"tradeoff: --budget {budget:g} s is too short; {_LEAST_BUDGET:g} s or more is needed"
        )
    if repeats < 1:
        raise RigidsimError(f"tradeoff: --repeats {repeats} is not possible; at least 1 process is needed")
    begun = time.monotonic()
    plan = plan or make_plan(experiment, budget)
    if settings is None:
        settings = every_setting(plan.exact, full=full)
    rows = [Row(s) for s in dict.fromkeys([DEFAULT, *settings])]
    explored = begun + _EXPLORING * budget
    integrated = _references(experiment, reference_tasks(plan, wanted=reference == "best"), explored)
    told(f"attitudes of {len(rows)} settings")
    _explore(experiment, plan, rows, budget, explored)
    told("the reference")
    measured = {row.setting: row.attitudes for row in rows if row.measured}
    found, wide = best_reference(plan, integrated.result(), measured)
    told("speeds")
    done = _time(experiment, plan, rows, repeats, begun + 1.1 * budget, told)
    return Measurement(experiment, plan, rows, found, wide, done, time.monotonic() - begun)


def _references(experiment: Experiment, tasks: Sequence[Task], deadline: float) -> Future[Solutions]:
    """Integrate references while the settings are tried."""
    found: Future[Solutions] = Future()

    def integrate() -> None:
        try:
            answers = ask(experiment, tasks, deadline=deadline, first_by=time.monotonic() + _GRACE)
            trials = {tasks[a.index].setting: a.trial for a in answers if a.problem is None}
            found.set_result({s: trial.attitudes for s, trial in trials.items() if trial is not None})
        except BaseException as error:  # raised in the main thread
            found.set_exception(error)

    threading.Thread(target=integrate, daemon=True).start()
    return found


def _explore(experiment: Experiment, plan: Plan, rows: list[Row], budget: float, deadline: float) -> None:
    """Fill in attitudes, drifts and counts."""
    tasks = []
    for row in rows:
        wide = row.setting.precision == "quadruple" and row.setting.has_steps
        row.part = plan.short if wide else plan.part
        tasks.append(attitude_task(plan, row.setting, _SINGLE * budget, wide=wide))
        row.problem = f"left out: the budget of {budget:g} s was used up before its turn"
    # without the default there is no comparison: on a busy machine it may be late
    first_by = time.monotonic() + _GRACE
    for answer in ask(experiment, tasks, deadline=deadline, first_by=first_by):
        row = rows[answer.index]
        row.status = RowStatus.MEASURED if row.part >= plan.part else RowStatus.SHORT
        row.problem = answer.problem or ""
        if row.problem:
            row.status = RowStatus.FAILED
        row.trial = answer.trial
    if not rows[0].measured:
        raise RigidsimError(
            f"tradeoff: the default setting ({DEFAULT.title}), which costs are relative to, could not be "
            f"measured: {rows[0].problem}"
        )


def _time(
    experiment: Experiment,
    plan: Plan,
    rows: list[Row],
    repeats: int,
    deadline: float,
    told: Callable[[str], None],
) -> int:
    """Measure speeds in fresh processes, in a different order in each; returns how many completed."""
    measured = [row for row in rows if row.measured]
    done = 0
    for repeat in range(repeats):
        told(f"speeds, process {repeat + 1} of {repeats}")
        order = [row for row in measured if row.setting != DEFAULT]
        random.Random(repeat).shuffle(order)
        middle = len(order) // 2
        turns = [rows[0], *order[:middle], rows[0], *order[middle:], rows[0]]
        tasks = [Task(row.setting, "speed", plan.times, _PASSES, max(1, row.steps)) for row in turns]
        seconds: dict[int, float] = {}
        limit = deadline if repeat else max(deadline, time.monotonic() + 30.0)
        first_by = 0.0 if repeat else time.monotonic() + _GRACE
        for answer in ask(experiment, tasks, deadline=limit, first_by=first_by):
            if answer.problem is None:
                seconds[answer.index] = answer.seconds
        defaults = [seconds[n] for n, row in enumerate(turns) if row is rows[0] and n in seconds]
        if not defaults:
            break
        base = statistics.median(defaults)
        for n, row in enumerate(turns):
            if row is not rows[0] and n in seconds:
                row.unit_seconds.append(seconds[n])
                row.default_seconds.append(base)
        rows[0].unit_seconds.append(base)
        rows[0].default_seconds.append(base)
        done += len(seconds) == len(turns)
        if time.monotonic() > deadline:
            break
    return done
