"""Measuring the speed and accuracy of a scene's settings, within a time budget.

Every setting integrates the scene's own motion, attitude included, and is held against a reference whose own
error is known: the closed form to 50 digits where there is one, else the best that a higher precision can do.
References are integrated in a separate process, next to the settings, cheap ones first; speeds are then
taken over several fresh processes, in turn. Long motions are measured over their beginning, quadruple
precision over less of it, and what doesn't fit is listed as left out. Nothing is extrapolated.
"""

import math
import random
import statistics
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from enum import StrEnum
from itertools import chain

import numpy as np

from rigidsim.accuracy.bench.worker import Answer, Task, Worker
from rigidsim.accuracy.comparison import angles_between
from rigidsim.accuracy.error_law import closed_form_if_any
from rigidsim.accuracy.motion import run_pilot
from rigidsim.accuracy.reference import LEAST_DIGITS
from rigidsim.accuracy.setting import Setting, cost, epsilon
from rigidsim.accuracy.trial import Trial, trial_scene
from rigidsim.errors import RigidsimError
from rigidsim.scene.choices import FORMULATIONS
from rigidsim.scene.config import Experiment
from rigidsim.scene.scene import build_scene
from rigidsim.solve.assembly import assemble
from rigidsim.solve.problem import prepare_scene

DEFAULT = Setting()
"""Setting that every cost is relative to."""
_TOLERANCES: dict[str, tuple[float, ...]] = {
    "double": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14),
    "extended": (1e-12, 1e-16),
    "single": (1e-3, 1e-5),
    "quadruple": (1e-24,),
}
_FEW_TOLERANCES = (1e-6, 1e-10)  # of the other formulations in double precision

_LEAST_BUDGET = 5.0
_GRACE = 120.0  # extra seconds for what a measurement can't do without, on a busy machine
_EXPLORING, _SINGLE = 0.65, 0.4  # parts of the budget, for all attitudes and for those of one setting
_PASSES = 0.03  # CPU seconds of passes per setting and process: their median is then known to a few per cent
_PILOT_STEPS, _WARMING = 4000, 32  # of the default setting; the latter aren't measured
_ALL, _REFERENCE, _QUADRUPLE, _DIGITS = (0.3, 350.0), (0.3, 1300.0), (0.1, 2600.0), (0.2, 12000.0)
"""Shares of the budget, and costs in steps of the default setting, measured and rounded up: of all settings
together, of their reference in quadruple precision, of all quadruple settings, and of the reference of these.
"""
_SECOND: dict[str | int, float] = {"quadruple": 1e-30, LEAST_DIGITS: 1e-44}
"""Tolerances of the second best of a precision: a thousand epsilons or more, so that it is another solution;
in extended and double precision "auto" without projected invariants is.
"""
_SAME_VARIABLES = 10.0
"""Ratio of the common error of solutions in the same variables to their distance."""
_SAMPLES, _SHORT_SAMPLES = 32, 6  # attitudes compared, over the whole part and over the short one


class RowStatus(StrEnum):
    """Outcome of measuring a setting; the values stand in datasets."""

    MEASURED = "measured"
    SHORT = "measured over less"
    LEFT_OUT = "left out"
    FAILED = "refused"


@dataclass(frozen=True)
class Plan:
    """How much of the motion is measured: ascending times (s), of which the first ``short_count`` reach to
    the end of ``short``; and the method that gives the motion without steps, or why there is none.
    """

    start: float
    end: float
    steps: float
    part: float
    short: float
    times: tuple[float, ...]
    short_count: int
    exact: str
    why: str
    samples: int

    def task(self, setting: Setting, patience: float = math.inf, *, wide: bool) -> Task:
        """Task that computes a setting's attitudes over all times, the short part of them if ``wide``."""
        return Task(setting, self.times[: self.short_count] if wide else self.times, patience)

    @property
    def references(self) -> list[Task]:
        """What to integrate as references: the closed form if there is one."""
        if self.exact:
            return [self.task(Setting(LEAST_DIGITS, method=self.exact), wide=False)]
        return [
            self.task(setting, wide=precision == LEAST_DIGITS)
            for precision in ("quadruple", LEAST_DIGITS)
            for setting in _best_and_second(precision)
        ]


def make_plan(experiment: Experiment, budget: float) -> Plan:
    """Make a plan from a short pilot of the default setting. Raises ``ConfigError``."""
    scene = build_scene(experiment)
    start, end = float(scene.start), float(scene.samples.last)
    prepared = prepare_scene(experiment, trial_scene(experiment, DEFAULT))
    corrected = assemble(prepared).steps()
    pilot = run_pilot(corrected.stepper, prepared.clock, corrected.skip, steps=_PILOT_STEPS, warming=_WARMING)
    whole = pilot.whole * pilot.seconds_per_step
    form, why = closed_form_if_any(scene)
    exact = form.method if form else ""
    part, reference, quadruple, digits = (
        share * budget / (whole * cost) for share, cost in (_ALL, _REFERENCE, _QUADRUPLE, _DIGITS)
    )
    part = min(1.0, part if exact else min(part, reference))
    short = min(part, quadruple if exact else min(quadruple, digits))
    short_times = grid(start, end, short, _SHORT_SAMPLES) if short < part else ()
    # the start is a sample, so that the motion begins there
    times = tuple(sorted({start, *short_times, *grid(start, end, part, _SAMPLES)}))
    limit = short_times[-1] if short_times else times[-1]
    return Plan(
        start=start,
        end=end,
        steps=pilot.whole,
        part=part,
        short=short,
        times=times,
        short_count=sum(t <= limit for t in times),
        exact=exact,
        why=why,
        samples=scene.samples.count,
    )


def grid(start: float, end: float, part: float, count: int) -> tuple[float, ...]:
    """Times over the first part of a motion that are exact in single precision too."""
    exact = start + (end - start) * part * np.arange(1, count + 1) / count
    rounded = exact.astype(np.float32)
    late = rounded.astype(np.float64) > exact
    rounded[late] = np.nextafter(rounded[late], np.float32(-np.inf))
    return tuple(sorted({float(t) for t in rounded if float(t) > start})) or (float(exact[-1]),)


def every_setting(plan: Plan, *, full: bool = False) -> list[Setting]:
    """All settings, the cheapest first since a budget cuts at the end: the default one, those in quaternions
    and closed forms, and other formulations.
    """
    general = [name for name, variables in FORMULATIONS.items() if variables.general]
    others = [name for name in general if name != DEFAULT.formulation]
    plain = [Setting(p, tolerance) for p, some in _TOLERANCES.items() for tolerance in (None, *some)]
    few = [s for s in plain if s.precision != "quadruple" and (full or s.tolerance is None)]
    few += [Setting("double", tolerance) for tolerance in _FEW_TOLERANCES]
    plain += [replace(s, formulation=f) for s in few for f in others]
    found = [replace(s, hold_invariants=held) for s in plain for held in (False, True)]
    if plan.exact:
        found += [Setting(p, method=plan.exact) for p in ("double", "extended", "quadruple")]

    def order(setting: Setting) -> tuple[bool, bool, float]:
        other = setting.formulation != DEFAULT.formulation
        return setting != DEFAULT, other, cost(setting, plan.steps * plan.part, len(plan.times))

    return sorted(dict.fromkeys(found), key=order)


# --- references ---------------------------------------------------------------------------------------------

Solutions = Mapping[Setting, list[np.ndarray]]
"""Attitudes by setting, float64 parts (samples, 4)."""


@dataclass(frozen=True)
class ReferenceSolution:
    """Attitudes, float64 parts (samples, 4), against which others are held, and their own error (samples,),
    rad.
    """

    attitudes: list[np.ndarray]
    error: np.ndarray
    how: str


def best_reference(
    plan: Plan, found: Mapping[Task, Answer]
) -> tuple[ReferenceSolution, ReferenceSolution | None]:
    """The reference, and a separate one for quadruple precision if needed; of what was measured over the same
    times the best serves if there is nothing better. Raises ``RigidsimError`` if there is none.
    """

    def over(times: tuple[float, ...]) -> Solutions:
        whole = {task.setting: a.trial for task, a in found.items() if task.times == times and not a.problem}
        return {setting: trial.attitudes for setting, trial in whole.items() if trial is not None}

    solutions = over(plan.times)
    exact = Setting(LEAST_DIGITS, method=plan.exact) if plan.exact else None
    if exact is not None and exact in solutions:
        own = np.full(len(plan.times), 10.0 ** (2 - LEAST_DIGITS))  # two digits are left to rounding
        return ReferenceSolution(solutions[exact], own, f"closed form to {LEAST_DIGITS} digits"), None
    for precision in ("quadruple", "extended", "double"):
        best = _best_of(precision, solutions)
        if best is not None:
            return best, _best_of(LEAST_DIGITS, over(plan.times[: plan.short_count]))
    raise RigidsimError(
        "tradeoff: no reference could be integrated within the budget; give a larger --budget"
    )


def _best_of(precision: str | int, solutions: Solutions) -> ReferenceSolution | None:
    """The best solution of a precision, if there are others as good, or nearly so, from which its error is
    known: in extended and double precision also those with rotation-matrix states, which round other initial
    values and coefficients.
    """
    best, second = _best_and_second(precision)
    peers = () if precision in _SECOND else (FORMULATIONS[best.formulation].checked_by,)
    equals = [
        other
        for other in solutions
        if other != best
        and (other.precision, other.method, other.tolerance) == (precision, best.method, second.tolerance)
        and other.formulation in (best.formulation, *peers)
    ]
    if best not in solutions or not equals:
        return None
    error = _errors_of_best(best, {s: angles_between(solutions[best], solutions[s]) for s in equals})
    how = f"{best.title}; its error is its distance from {' and '.join(s.title for s in equals[:3])}"
    return ReferenceSolution(solutions[best], error, how)


def _best_and_second(precision: str | int) -> tuple[Setting, Setting]:
    """The best setting of a precision, and the second best, from which the error of the best is known."""
    return Setting(precision, hold_invariants=True), Setting(precision, _SECOND.get(precision))


def _errors_of_best(best: Setting, distances: Mapping[Setting, np.ndarray]) -> np.ndarray:
    """Errors (samples,), rad, of the best solution of a precision: its largest distance so far from equally
    good ones.

    Those in the same variables have begun with the same rounded values, and take the same steps until
    invariants are first projected: such a distance alone was up to six times (13 once) too small.

    Distances aren't scaled by the errors per step, as certificates do: a series keeps its
    tolerance by orders of magnitude, so that rounding can dominate in both (near a separatrix, in quadruple
    precision and at 1e-30, scaled errors were 70 times too small, held against 70 digits).
    """
    independent = best.precision in _SECOND or any(s.formulation != best.formulation for s in distances)
    largest = np.max(list(distances.values()), axis=0) * (1.0 if independent else _SAME_VARIABLES)
    return np.maximum(np.maximum.accumulate(largest), epsilon(best.precision))


# --- measuring ----------------------------------------------------------------------------------------------


@dataclass
class Row:
    """Results for one setting, over a part of the horizon: its trial, the problem if there is none, and for
    each process the CPU seconds per step (closed form: per sample), its own and the default setting's.
    """

    setting: Setting
    part: float
    status: RowStatus = RowStatus.LEFT_OUT
    problem: str = ""
    trial: Trial | None = None
    seconds: list[tuple[float, float]] = field(default_factory=list)

    @property
    def measured(self) -> bool:
        """Whether its attitudes were computed to the end of its part."""
        return self.status in (RowStatus.MEASURED, RowStatus.SHORT)


@dataclass(frozen=True)
class Measurement:
    """Results for all settings, the default one first; see ``dataset_of`` for them as data."""

    experiment: Experiment
    plan: Plan
    rows: list[Row]
    reference: ReferenceSolution
    wide_reference: ReferenceSolution | None
    processes: int
    seconds: float

    def errors(self, row: Row) -> tuple[np.ndarray, np.ndarray]:
        """Attitude errors (samples,) of a measured setting, and the reference's own, rad."""
        assert row.trial is not None
        reference = self.reference
        if row.setting.precision == "quadruple" and self.wide_reference is not None:
            reference = self.wide_reference
        count = min(len(row.trial.attitudes[0]), len(reference.attitudes[0]))
        mine, theirs = ([p[:count] for p in parts] for parts in (row.trial.attitudes, reference.attitudes))
        return angles_between(mine, theirs), reference.error[:count]

    def cost(self, row: Row) -> tuple[float, float, float]:
        """CPU time per simulated second relative to the default's: median, least and largest over the
        processes; nan if speed was not measured.
        """
        default = self.rows[0]
        scale = (self._units(row) / row.part) / (self._units(default) / default.part)
        ratios = [scale * own / base for own, base in row.seconds] or [math.nan]
        return statistics.median(ratios), min(ratios), max(ratios)

    def cpu_seconds(self, row: Row) -> float:
        """CPU seconds of the setting over its part: steps (or samples) times a step's median cost."""
        return self._units(row) * statistics.median([own for own, _ in row.seconds] or [math.nan])

    def _units(self, row: Row) -> float:
        """Number of units that cost time: steps, or samples of a closed form."""
        if not row.setting.has_steps:
            return self.plan.samples * row.part
        return math.nan if row.trial is None else row.trial.steps


def measure(
    experiment: Experiment,
    *,
    budget: float = 90.0,
    repeats: int = 3,
    full: bool = False,
    told: Callable[[str], None] = lambda _: None,
) -> Measurement:
    """Measure the settings of a scene. Raises ``ConfigError``, and ``RigidsimError`` if the budget is too
    small for anything.
    """
    if not budget >= _LEAST_BUDGET:
        raise RigidsimError(
            f"tradeoff: --budget {budget:g} s is too short; {_LEAST_BUDGET:g} s or more is needed"
        )
    if repeats < 1:
        raise RigidsimError(f"tradeoff: --repeats {repeats} is not possible; at least 1 process is needed")
    begun = time.monotonic()
    plan = make_plan(experiment, budget)
    settings = every_setting(plan, full=full)
    wide = {setting: setting.precision == "quadruple" and setting.has_steps for setting in settings}
    tasks = {setting: plan.task(setting, _SINGLE * budget, wide=wide[setting]) for setting in settings}
    told(f"attitudes of {len(settings)} settings")
    done = 0
    with Worker(experiment) as worker:
        found = _explored(experiment, worker, plan, list(tasks.values()), begun + _EXPLORING * budget)
        rows = [_row(plan, tasks[setting], found, budget) for setting in settings]
        if not rows[0].measured:
            raise RigidsimError(
                f"tradeoff: the default setting ({DEFAULT.title}), which costs are relative to, could not be "
                f"measured: {rows[0].problem}"
            )
        told("the reference")
        reference, wide_reference = best_reference(plan, found)
        for repeat in range(repeats):
            until = begun + 1.1 * budget
            if repeat and time.monotonic() > until:
                break
            told(f"speeds, process {repeat + 1} of {repeats}")
            if repeat == 0:
                done += _timed(worker, plan, rows, repeat, max(until, time.monotonic() + 30.0))
                continue
            with Worker(experiment) as fresh:
                done += _timed(fresh, plan, rows, repeat, until)
    return Measurement(experiment, plan, rows, reference, wide_reference, done, time.monotonic() - begun)


def _explored(
    experiment: Experiment, worker: Worker, plan: Plan, tasks: list[Task], deadline: float
) -> dict[Task, Answer]:
    """Attitudes of settings and references, by two processes: what one can't do without comes first."""
    found: dict[Task, Answer] = {}
    references = plan.references
    left = iter([task for task in tasks[1:] if task not in references])

    def explore(worker: Worker, own: list[Task]) -> None:
        for number, task in enumerate(chain(own, left)):
            answer = worker.answer(task, deadline if number else max(deadline, time.monotonic() + _GRACE))
            if answer is None:
                return
            found[task] = answer

    with ThreadPoolExecutor(1) as pool, Worker(experiment) as other:
        beside = pool.submit(explore, other, references)
        explore(worker, tasks[:1])
        beside.result()
    return found


def _row(plan: Plan, task: Task, found: Mapping[Task, Answer], budget: float) -> Row:
    """The row of a setting whose attitudes were computed, or were not."""
    part = plan.part if task.times == plan.times else plan.short
    answer = found.get(task)
    if answer is None:
        problem = f"left out: the budget of {budget:g} s was used up before its turn"
        return Row(task.setting, part, problem=problem)
    status = RowStatus.MEASURED if part >= plan.part else RowStatus.SHORT
    status = RowStatus.FAILED if answer.problem else status
    return Row(task.setting, part, status, answer.problem, answer.trial)


def _timed(worker: Worker, plan: Plan, rows: list[Row], repeat: int, until: float) -> bool:
    """Measure speeds in one process, in an order of its own; the default setting's at the beginning, in the
    middle and at the end. Returns whether all were measured.
    """
    default, *others = [row for row in rows if row.measured]
    random.Random(repeat).shuffle(others)
    middle = len(others) // 2
    turns = [default, *others[:middle], default, *others[middle:], default]
    found: list[tuple[Row, float]] = []
    for row in turns:
        steps = 1 if row.trial is None else max(1, row.trial.steps)
        answer = worker.answer(Task(row.setting, plan.times, _PASSES, steps), until)
        if answer is None:
            break
        found += [(row, answer.seconds)] * (not answer.problem)
    bases = [seconds for row, seconds in found if row is default]
    if bases:
        base = statistics.median(bases)
        default.seconds.append((base, base))
        for row, seconds in found:
            if row is not default:
                row.seconds.append((seconds, base))
    return len(found) == len(turns)
