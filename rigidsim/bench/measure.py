"""Speed and accuracy of one scene, measured over every kind of setting.

Every setting integrates the scene's own motion, attitude included, and is held against a reference whose own
error is known: the closed form to 50 digits where there is one, else an integration one precision higher with
its invariants held, whose error is its distance from the second best. Speeds are taken over several fresh
processes, in turn (``rigidsim.bench.child``).

A budget of time bounds it all: long motions are measured over their beginning, quadruple precision over less
of it, and what doesn't fit is listed as left out. Nothing is extrapolated.
"""

from __future__ import annotations

import math
import random
import statistics
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rigidsim.bench.child import Task, ask
from rigidsim.bench.plan import DEFAULT, DIGITS, Plan, every_setting, make_plan
from rigidsim.errors import RigidsimError
from rigidsim.scene.context import working_bits
from rigidsim.scene.reading import Experiment
from rigidsim.trial import Setting, angles_between

_LEAST_BUDGET = 5.0
_SECOND = {"quadruple": 1e-30, DIGITS: 1e-44}  # tolerances of what tells the references' errors
_GRACE = 120.0  # seconds for what a measurement can't do without
_EXPLORING = 0.65  # of the budget, until attitudes must be there
_TIMED = 0.03  # CPU seconds of passes for each setting in each process


@dataclass
class Row:
    """What is known of one setting.

    Attributes:
        part: of the horizon that it was measured over.
        problem: why it was not, or not over all of it; empty where all went well.
        attitudes: float64 parts (samples, 4).
        unit_seconds: CPU seconds per step (closed form: per sample), one for each process.
        default_seconds: the default's, in the same processes.
    """

    setting: Setting
    part: float = 1.0
    problem: str = ""
    attitudes: list[np.ndarray] = field(default_factory=list)
    drifts: dict[str, float] = field(default_factory=dict)
    steps: int = 0
    order: int = 0
    work: float = 0.0
    unit_seconds: list[float] = field(default_factory=list)
    default_seconds: list[float] = field(default_factory=list)

    @property
    def measured(self) -> bool:
        """Whether its attitudes are there, to the end of its part."""
        return bool(self.attitudes) and not self.problem


@dataclass(frozen=True)
class Reference:
    """Attitudes to hold others against.

    Attributes:
        error: (samples,) estimate of their own error, rad.
        how: in words.
    """

    setting: Setting
    attitudes: list[np.ndarray]
    error: np.ndarray
    how: str


@dataclass(frozen=True)
class Measurement:
    """All that was measured; see ``rigidsim.tradeoff`` for the dataset."""

    experiment: Experiment
    plan: Plan
    rows: list[Row]
    reference: Reference
    wide_reference: Reference | None
    processes: int
    seconds: float

    def reference_of(self, row: Row) -> Reference:
        """What a setting is held against."""
        if row.setting.precision == "quadruple" and self.wide_reference is not None:
            return self.wide_reference
        return self.reference

    def errors(self, row: Row) -> tuple[np.ndarray, np.ndarray]:
        """Attitude errors (samples,) of a measured setting, and the reference's own, rad."""
        reference = self.reference_of(row)
        count = min(len(row.attitudes[0]), len(reference.attitudes[0]))
        mine = [part[:count] for part in row.attitudes]
        theirs = [part[:count] for part in reference.attitudes]
        return angles_between(mine, theirs), reference.error[:count]

    def cost(self, row: Row) -> tuple[float, float, float]:
        """CPU time per simulated second relative to the default's: median, least and largest of the
        processes; nan where its speed was not measured.
        """
        default = next(r for r in self.rows if r.setting == DEFAULT)
        units = self.plan.samples * row.part if row.setting.method == "closed_form" else row.steps
        scale = (units / row.part) / (default.steps / default.part)
        ratios = [scale * a / b for a, b in zip(row.unit_seconds, row.default_seconds, strict=True)]
        if not ratios:
            return (math.nan,) * 3
        return statistics.median(ratios), min(ratios), max(ratios)

    def cpu_seconds(self, row: Row) -> float:
        """Of the setting over its part: steps (or samples) times the median of a step's cost."""
        if not row.unit_seconds:
            return math.nan
        units = self.plan.samples * row.part if row.setting.method == "closed_form" else row.steps
        return units * statistics.median(row.unit_seconds)


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
    """Measure the settings of a scene.

    Args:
        budget: seconds that it may take, roughly.
        repeats: fresh processes in which speeds are taken.
        plan: what to measure over; None for as much as the budget allows.
        reference: "best", or "extended" to use that setting where nothing better can be had in time.
        full: every tolerance in every formulation and precision.
        settings: to compare, beside the default; None for every kind.
        told: called with what is being done.

    Raises:
        ConfigError: the config can't be run.
        RigidsimError: the budget is too small for anything.
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
        settings = every_setting(plan.closed, full=full)
    rows = [Row(s) for s in dict.fromkeys([DEFAULT, *settings])]
    references = _References(experiment, plan, begun + _EXPLORING * budget, wanted=reference == "best")
    references.start()
    told(f"attitudes of {len(rows)} settings")
    _explore(experiment, plan, rows, budget, begun + _EXPLORING * budget)
    told("the reference")
    references.join()
    found, wide = references.found(rows)
    told("speeds")
    done = _time(experiment, plan, rows, repeats, begun + 1.1 * budget, told)
    return Measurement(experiment, plan, rows, found, wide, done, time.monotonic() - begun)


# --- attitudes -------------------------------------------------------------------------------------------


def _task(plan: Plan, setting: Setting, patience: float, *, wide: bool) -> Task:
    times = plan.times[: plan.short_count] if wide else plan.times
    return Task(setting, "attitudes", times, patience)


def _explore(experiment: Experiment, plan: Plan, rows: list[Row], budget: float, deadline: float) -> None:
    """Fill in attitudes, drifts and counts."""
    tasks = []
    for row in rows:
        wide = row.setting.precision == "quadruple" and row.setting.method == "taylor"
        row.part = plan.short if wide else plan.part
        tasks.append(_task(plan, row.setting, 0.4 * budget, wide=wide))
        row.problem = f"left out: the budget of {budget:g} s was used up before its turn"
    # without the default there is nothing to compare with: on a busy machine it may be late
    first_by = time.monotonic() + _GRACE
    for answer in ask(experiment, tasks, deadline=deadline, first_by=first_by):
        row = rows[answer.index]
        row.problem = answer.problem
        if answer.values:
            row.attitudes = [np.array(part) for part in answer.values["attitudes"]]
            row.drifts = answer.values["drifts"]
            row.steps, row.order = answer.values["steps"], answer.values["order"]
            row.work = answer.values["work"]
    if not rows[0].measured:
        raise RigidsimError(
            f"tradeoff: the default setting ({DEFAULT.title}), which costs are relative to, could not be "
            f"measured: {rows[0].problem}"
        )


class _References(threading.Thread):
    """Integrates the references while the settings are tried (in a process of its own)."""

    def __init__(self, experiment: Experiment, plan: Plan, deadline: float, *, wanted: bool) -> None:
        super().__init__(daemon=True)
        self._experiment, self._plan, self._deadline = experiment, plan, deadline
        patience = 1e6
        self._settings: list[Setting] = []
        self._tasks: list[Task] = []
        if plan.closed:
            self._settings = [Setting(DIGITS, method="closed_form")]
            self._tasks = [_task(plan, self._settings[0], patience, wide=False)]
        elif wanted:
            digits = [Setting(DIGITS, hold_invariants=True), Setting(DIGITS, _SECOND[DIGITS])]
            main = [Setting("quadruple", hold_invariants=True), Setting("quadruple", _SECOND["quadruple"])]
            self._settings = [*main, *digits]
            self._tasks = [_task(plan, s, patience, wide=s in digits) for s in self._settings]
        self._found: dict[Setting, list[np.ndarray]] = {}
        self._failure: BaseException | None = None

    def run(self) -> None:
        """See ``Thread``."""
        try:
            first_by = time.monotonic() + _GRACE
            for answer in ask(self._experiment, self._tasks, deadline=self._deadline, first_by=first_by):
                if answer.values and not answer.problem:
                    parts = [np.array(part) for part in answer.values["attitudes"]]
                    self._found[self._settings[answer.index]] = parts
        except BaseException as error:  # told in the main thread
            self._failure = error

    def found(self, rows: list[Row]) -> tuple[Reference, Reference | None]:
        """The reference, and the one for quadruple precision where it needs another.

        Raises:
            RigidsimError: there is none.
        """
        if self._failure is not None:
            raise self._failure
        if self._plan.closed and self._settings[0] in self._found:
            exact = self._found[self._settings[0]]
            own = np.full(len(exact[0]), 10.0 ** (2 - DIGITS))
            return Reference(self._settings[0], exact, own, f"closed form to {DIGITS} digits"), None
        wide = None
        if not self._plan.closed and self._settings:
            wide = self._pair(self._settings[2], self._settings[3])
            main = self._pair(self._settings[0], self._settings[1])
            if main is not None:
                return main, wide
        held = {r.setting: r.attitudes for r in rows if r.measured}
        for precision in ("extended", "double"):
            best, second = Setting(precision, hold_invariants=True), Setting(precision)
            if best in held and second in held:
                return _compared(best, held[best], second, held[second]), wide
        raise RigidsimError(
            "tradeoff: no reference could be integrated within the budget; give a larger --budget"
        )

    def _pair(self, best: Setting, second: Setting) -> Reference | None:
        if best not in self._found or second not in self._found:
            return None
        return _compared(best, self._found[best], second, self._found[second])


def _compared(
    best: Setting, attitudes: list[np.ndarray], second: Setting, other: list[np.ndarray]
) -> Reference:
    """A reference whose error is its largest distance so far from the second best."""
    error = np.maximum.accumulate(angles_between(attitudes, other))
    floor = 2.0 ** (1 - working_bits(best.precision))
    how = f"{best.title}; its error is its distance from {second.title}"
    return Reference(best, attitudes, np.maximum(error, floor), how)


# --- speeds ----------------------------------------------------------------------------------------------


def _time(
    experiment: Experiment,
    plan: Plan,
    rows: list[Row],
    repeats: int,
    deadline: float,
    told: Callable[[str], None],
) -> int:
    """Take speeds in fresh processes, in a different order in each; returns how many got through."""
    measured = [row for row in rows if row.measured]
    done = 0
    for repeat in range(repeats):
        told(f"speeds, process {repeat + 1} of {repeats}")
        order = [row for row in measured if row.setting != DEFAULT]
        random.Random(repeat).shuffle(order)
        middle = len(order) // 2
        turns = [rows[0], *order[:middle], rows[0], *order[middle:], rows[0]]
        tasks = [Task(row.setting, "speed", plan.times, _TIMED, max(1, row.steps)) for row in turns]
        seconds: dict[int, float] = {}
        limit = deadline if repeat else max(deadline, time.monotonic() + 30.0)
        first_by = 0.0 if repeat else time.monotonic() + _GRACE
        for answer in ask(experiment, tasks, deadline=limit, first_by=first_by):
            if answer.values and not answer.problem:
                seconds[answer.index] = answer.values["seconds"]
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
