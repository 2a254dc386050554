"""Measuring the speed and accuracy of a scene's settings, within a time budget.

Every setting integrates the scene's own motion, attitude included, and is held against a reference whose own
error is known: the closed form to 50 digits where there is one, else the best that a higher precision can do.
References are integrated in a separate process, next to the settings, cheap ones first; speeds are then
taken over several fresh processes, in turn. Long motions are measured over their beginning, quadruple
precision over less of it, and what doesn't fit is listed as left out. Nothing is extrapolated.

Each setting is measured in a separate process, to which speed, crashes and endless compilations are confined.
Two integrators that are built alike can differ in speed for their whole life, by a factor of up to 2.6, so
that speeds have to be compared over fresh processes. Speed is measured per natural step (of a closed form:
per sample), in passes over the motion's beginning that are repeated until they stand out from noise.
Recording costs the same in every setting and isn't counted.

The measurement is labelled data, with its Pareto front and the advice that follows from it.
"""

from __future__ import annotations

import math
import random
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum
from itertools import chain
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, NamedTuple

import mpmath
import numpy as np

from rigidsim.accuracy.choice import LEAST_DIGITS, run_pilot
from rigidsim.accuracy.comparison import Trial, angles_between, trial_scene, try_setting
from rigidsim.accuracy.estimates import closed_form_if_any
from rigidsim.accuracy.setting import Setting, cost, epsilon, precision_title, precision_titled
from rigidsim.errors import ConfigError, RigidsimError
from rigidsim.scene.choices import FORMULATIONS, METHODS
from rigidsim.scene.config import Experiment, parse
from rigidsim.scene.scene import build_scene
from rigidsim.solve.assembly import assemble
from rigidsim.solve.closed_form import closed_form_of
from rigidsim.solve.compiled import quieten_engine
from rigidsim.solve.problem import prepare_scene
from rigidsim.solve.status import Status

if TYPE_CHECKING:
    import xarray
    from numpy.typing import ArrayLike

# --- processes ----------------------------------------------------------------------------------------------

_SHORTEST_PASS = 4e-3  # CPU seconds: the clock's own resolution is a microsecond, a call's cost ten
_LONGEST_WARMING = 2000  # steps
_CLOSED_ROWS = {True: 2000, False: 4}  # of a pass in double, and in mpmath

Answer = tuple[Trial | None, float, str]
"""A task's trial or its seconds per unit, and why not, or not to the end, if so."""


@dataclass(frozen=True)
class Task:
    """A setting to be integrated over some times (s), within ``patience`` CPU seconds; with ``speed_steps``
    its speed to be measured instead, for so long and over no more than so many steps.
    """

    setting: Setting
    times: tuple[float, ...]
    patience: float = field(default=math.inf, compare=False)
    speed_steps: int | None = None


def _tried(experiment: Experiment, task: Task, times: list[mpmath.mpf]) -> Answer:
    until = time.process_time() + task.patience
    go_on = lambda _: Status.WALL_TIME if time.process_time() > until else None  # noqa: E731
    trial = try_setting(experiment, task.setting, times, go_on=go_on)
    problem = "" if trial.status is Status.FINISHED else trial.status.message
    if trial.status is Status.WALL_TIME:
        problem = f"took longer than {task.patience:.3g} s, its part of the budget"
    return trial, math.nan, problem


def _speed(experiment: Experiment, task: Task, times: list[mpmath.mpf]) -> Answer:
    """CPU seconds per natural step, or per sample of a closed form: the median of several passes, which are
    lengthened until they can be measured.
    """
    most = task.speed_steps or 1
    scene = trial_scene(experiment, task.setting, times)
    prepared = prepare_scene(experiment, scene, tolerance=task.setting.tolerance)
    if prepared.has_steps:
        corrected = assemble(prepared).steps()
        start = corrected.boundary()

        def one_pass(steps: int) -> None:
            corrected.back_to(start)
            corrected.skip(steps)

        one_pass(min(most, _LONGEST_WARMING))  # charts are compiled when first needed
        count = min(32, most)
    else:
        closed, clock, precision = closed_form_of(scene), prepared.clock, prepared.precision
        rows = np.resize(clock.internal(0, clock.count), _CLOSED_ROWS[precision.narrow])

        def one_pass(steps: int) -> None:
            closed.states(prepared.system, precision, rows, clock.start)

        count = most = len(rows)
    begun, passes = time.process_time(), list[float]()
    while not passes or time.process_time() - begun <= task.patience:
        started = time.process_time()
        one_pass(count)
        spent = time.process_time() - started
        if spent < _SHORTEST_PASS and count < most and time.process_time() - begun < task.patience:
            count = min(2 * count, most)
        else:
            passes.append(spent / count)
    return None, statistics.median(passes), ""


def work(descriptor: int) -> None:
    """Do the tasks that come over a connection, answering each."""
    quieten_engine()
    tasks = Connection(descriptor)
    text, source = tasks.recv()
    experiment = parse(text, source=source)
    while True:
        try:
            task: Task = tasks.recv()
        except EOFError:
            return
        try:
            do = _tried if task.speed_steps is None else _speed
            found = do(experiment, task, [mpmath.mpf(t) for t in task.times])
        except ConfigError as error:
            found = None, math.nan, "; ".join(map(str, error.problems))
        except (RigidsimError, OverflowError, ZeroDivisionError, ValueError) as error:
            name = "" if isinstance(error, RigidsimError) else f"{type(error).__name__}: "
            found = None, math.nan, f"{name}{error}"
        tasks.send(found)


class Worker:
    """A fresh process that does one task after the other; a new one follows where it dies."""

    def __init__(self, experiment: Experiment) -> None:
        self._experiment, self._stopped = experiment, False
        self._child: tuple[subprocess.Popen[bytes], Connection] | None = None

    def close(self) -> None:
        """Stop; what another thread waits for then has no answer."""
        self._stopped = True
        if self._child is not None:
            self._child[0].kill()

    def answer(self, task: Task, until: float) -> Answer | None:
        """Its answer; None if that isn't there by a time (of ``time.monotonic``), or the worker was stopped.
        A task on which the process dies is answered with that.
        """
        child, tasks = self._child = self._child or self._begun()
        late = False
        with suppress(EOFError, OSError):  # it ended, perhaps within an answer
            tasks.send(task)
            late = not tasks.poll(max(0.0, until - time.monotonic()))
            if not late:
                found: Answer = tasks.recv()
                return found
        self._child = None
        if late:
            child.kill()
        tasks.close()
        code = child.wait()
        if late or self._stopped:
            return None
        return None, math.nan, f"the process that measured it ended with code {code}"

    def _begun(self) -> tuple[subprocess.Popen[bytes], Connection]:
        ours, theirs = Pipe()
        call = f"from rigidsim.accuracy import bench; bench.work({theirs.fileno()})"
        child = subprocess.Popen([sys.executable, "-c", call], pass_fds=[theirs.fileno()])
        theirs.close()
        ours.send((self._experiment.text, self._experiment.source))
        return child, ours


# --- the plan -----------------------------------------------------------------------------------------------

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
_EXPLORING, _SINGLE = 0.65, 0.4  # parts of the budget, for all attitudes and for one setting's
_PASSES = 0.03  # CPU seconds of passes per setting and process: their median is then known to a few per cent
_PILOT_STEPS, _WARMING = 4000, 32  # of the default setting; the latter aren't measured
_ALL, _REFERENCE, _QUADRUPLE, _DIGITS = (0.3, 350.0), (0.3, 1300.0), (0.1, 2600.0), (0.2, 12000.0)
"""Shares of the budget, and costs in steps of the default setting, measured and rounded up: of all settings
together, of their reference in quadruple precision, of all quadruple settings, and of the reference of these.
"""
_SECOND: dict[str | int, float] = {"quadruple": 1e-30, LEAST_DIGITS: 1e-44}
"""Tolerances of the second best of a precision, from which the error of the best is known: a thousand
epsilons or more, so that it is another solution; in extended and double precision "auto" without projected
invariants is.
"""
_SAME_STEPS = 10.0
"""Ratio of the error of the best to that distance, where both take the same steps until invariants are first
projected: it was up to six times too small (13 once).
"""
_FINEST = -61  # power of ten below which no setting is advised
_SAMPLES, _SHORT_SAMPLES = 32, 6  # attitudes compared, over the whole part and over the short one


class RowStatus(StrEnum):
    """Outcome of measuring a setting; the values stand in datasets."""

    MEASURED = "measured"
    SHORT = "measured over less"
    LEFT_OUT = "left out"
    FAILED = "refused"


@dataclass(frozen=True)
class Plan:
    """How much of the motion is measured: times (s, ascending) over a ``part`` of it, and over a shorter one;
    the steps and samples of the whole; and the method that gives it without steps, or why there is none.
    """

    span: float
    steps: float
    samples: int
    part: float
    short: float
    times: tuple[float, ...]
    short_times: tuple[float, ...]
    exact: str
    why: str

    def references(self) -> list[Task]:
        """What to integrate as references, with the second best of each."""
        if self.exact:
            return [Task(Setting(LEAST_DIGITS, method=self.exact), self.times)]
        wide = [Task(s, self.times) for s in _best_and_second("quadruple")]
        return wide + [Task(s, self.short_times) for s in _best_and_second(LEAST_DIGITS)]


def _plan(experiment: Experiment, budget: float) -> Plan:
    """Make a plan from a short pilot of the default setting. Raises ``ConfigError``."""
    scene = build_scene(experiment)
    start, end = float(scene.start), float(scene.samples.last)
    prepared = prepare_scene(experiment, trial_scene(experiment, DEFAULT))
    corrected = assemble(prepared).steps()
    corrected.skip(_WARMING)
    pilot = run_pilot(prepared, corrected, steps=_PILOT_STEPS)
    whole = pilot.whole * pilot.seconds_per_step
    form, why = closed_form_if_any(scene)
    part, reference, quadruple, digits = (
        share * budget / (whole * cost) for share, cost in (_ALL, _REFERENCE, _QUADRUPLE, _DIGITS)
    )
    part = min(1.0, part if form else min(part, reference))
    short = min(part, quadruple if form else min(quadruple, digits))
    early = _grid(start, end, short, _SHORT_SAMPLES) if short < part else ()
    # the start is a sample, so that the motion begins there
    since = sorted({start, *early, *_grid(start, end, part, _SAMPLES)}, key=lambda time: abs(time - start))
    times = tuple(since)
    less = times[: times.index((early or times)[-1]) + 1]
    exact = form.method if form else ""
    return Plan(abs(end - start), pilot.whole, scene.samples.count, part, short, times, less, exact, why)


def _grid(start: float, end: float, part: float, count: int) -> tuple[float, ...]:
    """Times over the first part of a motion that are exact in single precision too."""
    if end < start:
        return tuple(-time for time in _grid(-start, -end, part, count))
    exact = start + (end - start) * part * np.arange(1, count + 1) / count
    rounded = exact.astype(np.float32)
    rounded = np.where(rounded > exact, np.nextafter(rounded, np.float32(-np.inf)), rounded)
    return tuple(sorted({float(t) for t in rounded if float(t) > start})) or (float(exact[-1]),)


def _settings(plan: Plan, *, full: bool) -> list[Setting]:
    """All settings, the cheapest first since a budget cuts at the end: the default one, those in quaternions
    and closed forms, and other formulations.
    """
    others = [n for n, variables in FORMULATIONS.items() if variables.general and n != DEFAULT.formulation]
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


class ReferenceSolution(NamedTuple):
    """Attitudes, float64 parts (samples, 4), against which others are held, and their own error (samples,),
    rad.
    """

    attitudes: list[np.ndarray]
    error: np.ndarray
    how: str


def _references(plan: Plan, found: Mapping[Task, Answer]) -> tuple[ReferenceSolution, ReferenceSolution]:
    """The reference, and the reference of quadruple precision. Raises ``RigidsimError`` if there is none."""
    if plan.exact and (exact := _attitudes(found, plan.references()[0])) is not None:
        own = np.full(len(plan.times), 10.0 ** (2 - LEAST_DIGITS))  # two digits are left to rounding
        best = ReferenceSolution(exact, own, f"closed form to {LEAST_DIGITS} digits")
        return best, best
    of_all = _reference(found, plan.times, ("quadruple", "extended", "double"))
    if of_all is None:
        what = "no reference could be integrated within the budget; give a larger --budget"
        raise RigidsimError(f"tradeoff: {what}")
    return of_all, _reference(found, plan.short_times, (LEAST_DIGITS,)) or of_all


def _reference(
    found: Mapping[Task, Answer], times: tuple[float, ...], precisions: Sequence[str | int]
) -> ReferenceSolution | None:
    """The best solution of the first precision in which the second best is known, too: its error is the
    largest distance between them so far. This isn't scaled by the errors per step, as certificates do: a
    series keeps its tolerance by orders of magnitude, so that rounding can dominate in both (near a
    separatrix, in quadruple precision and at 1e-30, scaled errors were 70 times too small).
    """
    for precision in precisions:
        best, second = _best_and_second(precision)
        one, other = (_attitudes(found, Task(setting, times)) for setting in (best, second))
        if one is not None and other is not None:
            apart = angles_between(one, other) * (1.0 if precision in _SECOND else _SAME_STEPS)
            error = np.maximum(np.maximum.accumulate(apart), epsilon(precision))
            how = f"{best.title}; its error is its distance from {second.title}"
            return ReferenceSolution(one, error, how)
    return None


def _attitudes(found: Mapping[Task, Answer], task: Task) -> list[np.ndarray] | None:
    trial, _, problem = found.get(task, (None, math.nan, ""))
    return None if trial is None or problem else trial.attitudes


def _best_and_second(precision: str | int) -> tuple[Setting, Setting]:
    return Setting(precision, hold_invariants=True), Setting(precision, _SECOND.get(precision))


# --- measuring ----------------------------------------------------------------------------------------------


@dataclass
class _Row:
    """Results for one setting, over a part of the motion: its trial, the problem if there is none, and for
    each process the CPU seconds per step (closed form: per sample), its own and the default setting's.
    """

    setting: Setting
    part: float
    reference: ReferenceSolution
    status: RowStatus
    problem: str
    trial: Trial | None
    units: float  # that cost time: steps, or samples of a closed form
    seconds: list[tuple[float, float]] = field(default_factory=list)

    def measured(self, default: _Row, span: float) -> tuple[np.ndarray, list[float]]:
        """Attitude errors (samples,) of what was computed to the end of its part, rad, and ``_NUMBERS``."""
        assert self.trial is not None
        count = min(len(self.trial.attitudes[0]), len(self.reference.error))
        mine, theirs = ([p[:count] for p in x.attitudes] for x in (self.trial, self.reference))
        errors, own = angles_between(mine, theirs), self.reference.error[:count]
        scale = (self.units / self.part) / (default.units / default.part)
        ratios = [scale * one / base for one, base in self.seconds] or [math.nan]
        spent = self.units * statistics.median([one for one, _ in self.seconds] or [math.nan])
        relative = [statistics.median(ratios), min(ratios), max(ratios), spent]
        counts = [self.trial.steps, self.trial.order, self.trial.work]
        return errors, [errors[-1], errors.max(), own[-1], *relative, *counts, self.part * span]


def measure(
    experiment: Experiment,
    *,
    budget: float = 90.0,
    repeats: int = 3,
    full: bool = False,
    report: Callable[[str], None] = lambda _: None,
) -> xarray.Dataset:
    """Measure the settings of a scene: xarray data of the dimensions ``setting``, ``time``, ``invariant``.

    Errors are in rad, costs relative to the default setting (double precision, quaternions). Where a setting
    was not measured, its numbers are nan and ``reason`` says why. Raises ``ConfigError``, and
    ``RigidsimError`` if the budget is too small for anything.
    """
    if not budget >= _LEAST_BUDGET:
        raise RigidsimError(
            f"tradeoff: --budget {budget:g} s is too short; {_LEAST_BUDGET:g} s or more is needed"
        )
    if repeats < 1:
        raise RigidsimError(f"tradeoff: --repeats {repeats} is not possible; at least 1 process is needed")
    begun = time.monotonic()
    plan = _plan(experiment, budget)
    settings = _settings(plan, full=full)
    wide = {s: s.precision == "quadruple" and s.has_steps for s in settings}
    tasks = [Task(s, plan.short_times if wide[s] else plan.times, _SINGLE * budget) for s in settings]
    report(f"attitudes of {len(settings)} settings")
    done, left_out = 0, (None, math.nan, f"left out: the budget of {budget:g} s was used up before its turn")
    with closing(Worker(experiment)) as worker:
        found = _explored(experiment, worker, plan.references(), tasks, begun + _EXPLORING * budget)
        if problem := found.get(tasks[0], left_out)[2]:
            raise RigidsimError(
                f"tradeoff: the default setting ({DEFAULT.title}), which costs are relative to, could not be "
                f"measured: {problem}"
            )
        report("the reference")
        references = _references(plan, found)
        rows = []
        for task in tasks:
            trial, _, problem = found.get(task, left_out)
            part = plan.short if wide[task.setting] else plan.part
            status = RowStatus.MEASURED if part >= plan.part else RowStatus.SHORT
            if problem:
                status = RowStatus.FAILED if task in found else RowStatus.LEFT_OUT
            units = math.nan if trial is None else trial.steps
            units = units if task.setting.has_steps else plan.samples * part
            against = references[wide[task.setting]]
            rows.append(_Row(task.setting, part, against, status, problem, trial, units))
        until = begun + 1.1 * budget
        report(f"speeds, process 1 of {repeats}")
        done += _timed(worker, plan, rows, 0, max(until, time.monotonic() + 30.0))
        for repeat in range(1, repeats):
            if time.monotonic() < until:
                report(f"speeds, process {repeat + 1} of {repeats}")
                with closing(Worker(experiment)) as fresh:
                    done += _timed(fresh, plan, rows, repeat, until)
    return _dataset_of(experiment, plan, rows, references, done, time.monotonic() - begun)


def _explored(
    experiment: Experiment, worker: Worker, references: list[Task], tasks: list[Task], deadline: float
) -> dict[Task, Answer]:
    """Attitudes of settings and references, by two processes: what one can't do without comes first."""
    found: dict[Task, Answer] = {}
    left = iter([task for task in tasks[1:] if task not in references])

    def explore(worker: Worker, own: list[Task]) -> None:
        for number, task in enumerate(chain(own, left)):
            answer = worker.answer(task, deadline if number else max(deadline, time.monotonic() + _GRACE))
            if answer is None:
                return
            found[task] = answer

    with ThreadPoolExecutor(1) as pool, closing(Worker(experiment)) as other:
        beside = pool.submit(explore, other, references)
        explore(worker, tasks[:1])
        beside.result()
    return found


def _timed(worker: Worker, plan: Plan, rows: list[_Row], repeat: int, until: float) -> bool:
    """Measure speeds in one process, in a separate order; the default setting's at the beginning, in the
    middle and at the end. Returns whether all were measured.
    """
    default, *others = [row for row in rows if row.status in (RowStatus.MEASURED, RowStatus.SHORT)]
    random.Random(repeat).shuffle(others)
    middle = len(others) // 2
    turns = [default, *others[:middle], default, *others[middle:], default]
    found: list[tuple[_Row, float]] = []
    for row in turns:
        steps = 1 if row.trial is None else max(1, row.trial.steps)
        answer = worker.answer(Task(row.setting, plan.times, _PASSES, steps), until)
        if answer is None:
            break
        found += [(row, answer[1])] * (not answer[2])
    base = statistics.median([seconds for row, seconds in found if row is default] or [math.nan])
    default.seconds += [(base, base)] * (not math.isnan(base))
    for row, seconds in found:
        if row is not default:
            row.seconds.append((seconds, base))
    return len(found) == len(turns)


# --- labelled data ------------------------------------------------------------------------------------------

ATTRIBUTES = (
    "compared",
    "reference",
    "horizon_seconds",
    "measured_seconds",
    "closed_form",
    "processes",
    "seconds",
)
"""Attributes of a measurement that its JSON repeats."""


_RELATIVE = "relative to the default setting, per simulated second"
_NUMBERS = {
    "attitude_error_final": ("rad", "attitude error at the end of what was measured"),
    "attitude_error_largest": ("rad", "largest attitude error"),
    "reference_error": ("rad", "error of the reference itself, estimated, at the end"),
    "cpu_ratio": ("1", f"CPU time, median of the processes, {_RELATIVE}"),
    "cpu_ratio_least": ("1", f"CPU time, least of the processes, {_RELATIVE}"),
    "cpu_ratio_largest": ("1", f"CPU time, largest of the processes, {_RELATIVE}"),
    "cpu_seconds": ("s", "CPU time of the measured part"),
    "steps": ("1", "natural Taylor steps"),
    "taylor_order": ("1", "order of the Taylor series"),
    "work": ("1", "steps x order^2 x states"),
    "measured_time": ("s", "how much of the motion was measured"),
}
"""Numbers of a setting, nan where it wasn't measured: units and what they are."""


def _dataset_of(
    experiment: Experiment,
    plan: Plan,
    rows: Sequence[_Row],
    references: Sequence[ReferenceSolution],
    processes: int,
    seconds: float,
) -> xarray.Dataset:
    import xarray

    from rigidsim.store.provenance import versions

    drifts = [{} if row.trial is None else row.trial.drifts for row in rows]
    names = sorted({name for one in drifts for name in one})
    error = np.full((len(rows), len(plan.times)), np.nan)
    numbers = np.full((len(_NUMBERS), len(rows)), np.nan)
    for n, row in enumerate(rows):
        if row.status in (RowStatus.MEASURED, RowStatus.SHORT):
            errors, numbers[:, n] = row.measured(rows[0], plan.span)
            error[n, : len(errors)] = errors

    def words(values: Iterable[object]) -> np.ndarray:
        return np.array([str(value) for value in values], dtype=object)

    def variable(
        values: ArrayLike, units: str, long_name: str, dims: Sequence[str] = ("setting",)
    ) -> tuple[Sequence[str], ArrayLike, dict[str, str]]:
        return (dims, values, {"units": units, "long_name": long_name})

    settings = [row.setting for row in rows]
    drift = np.array([one.get(name, np.nan) for one in drifts for name in names]).reshape(len(rows), -1)
    tolerances = [s.step_tolerance if s.has_steps else math.nan for s in settings]
    precisions = words(precision_title(s.precision) for s in settings)
    held = np.array([s.hold_invariants for s in settings], dtype=np.int8)
    across = ("setting", "invariant")
    data = xarray.Dataset(
        {
            "status": variable(words(r.status.value for r in rows), "1", "what became of the setting"),
            "reason": variable(words(r.problem for r in rows), "1", "why it was not measured"),
            "attitude_error": variable(error, "rad", "attitude error", ("setting", "time")),
            **{name: variable(numbers[k], *said) for k, (name, said) in enumerate(_NUMBERS.items())},
            "drift": variable(drift, "1", "largest relative drift of the invariant", across),
        },
        coords={
            "setting": ("setting", words(s.title for s in settings), {"long_name": "setting"}),
            "precision": variable(precisions, "1", "arithmetic"),
            "tolerance": variable(tolerances, "1", "of the step control"),
            "formulation": variable(words(s.formulation for s in settings), "1", "of the attitude"),
            "held": variable(held, "1", "invariants projected"),
            "method": variable(words(s.method for s in settings), "1", " or ".join(METHODS)),
            "time": ("time", np.array(plan.times), {"units": "s", "long_name": "since start of the scene"}),
            "invariant": ("invariant", words(names), {"long_name": "invariant"}),
        },
        attrs={
            "title": experiment.config.name,
            "config": experiment.text,
            "config_sha256": experiment.sha256,
            "compared": "attitudes, carried in every setting, whatever the config records",
            "reference": references[0].how,
            "reference_of_quadruple": references[1].how,
            "default_setting": DEFAULT.title,
            "horizon_seconds": plan.span,
            "measured_seconds": plan.part * plan.span,
            "closed_form": "yes" if plan.exact else f"none: {plan.why}",
            "processes": processes,
            "seconds": seconds,
            **versions(),
        },
    )
    front = on_front(data).astype(np.int8)
    data["on_front"] = variable(front, "1", "no other setting is both cheaper and more accurate")
    return data


def trusted_error(dataset: xarray.Dataset) -> np.ndarray:
    """Largest attitude errors, but at least what the reference can resolve."""
    largest, own = dataset["attitude_error_largest"].values, dataset["reference_error"].values
    return np.asarray(np.maximum(largest, own))


def on_front(dataset: xarray.Dataset) -> np.ndarray:
    """Whether no setting is both cheaper and at least as accurate; only for settings measured over the full
    length, since errors over less of a motion don't compare.
    """
    error, cost = trusted_error(dataset), dataset["cpu_ratio"].values
    fit = (dataset["status"].values == RowStatus.MEASURED.value) & np.isfinite(error) & np.isfinite(cost)
    order, result = np.lexsort((error, cost)), np.zeros(len(error), dtype=bool)
    order = order[fit[order]]
    best = np.minimum.accumulate(np.append(math.inf, error[order]))[:-1]
    result[order[error[order] < best]] = True
    return result


@dataclass(frozen=True)
class BestSetting:
    """For an attitude error of at most ``at_most`` and more than ``more_than``: the cheapest setting, its
    largest error (rad), its cost relative to the default setting's and in CPU seconds of the part measured,
    and whether it was measured over less than the others, so that costs don't compare.
    """

    at_most: float
    more_than: float
    title: str
    error: float
    cost: float
    seconds: float
    cpu_seconds: float
    less: bool
    keys: tuple[str, ...]


def advice(dataset: xarray.Dataset) -> list[BestSetting]:
    """For each decade of accuracy from 1 rad on, the cheapest setting that reaches it.

    A setting that was measured over less of the motion is named only if no other reaches the accuracy.
    """
    error, cost = trusted_error(dataset), dataset["cpu_ratio"].values
    known, result = np.isfinite(error) & np.isfinite(cost), list[BestSetting]()
    for exponent in range(0, _FINEST, -1):
        fit = known & (error <= 10.0**exponent)
        if not fit.any():
            break
        whole = fit & (dataset["status"].values == RowStatus.MEASURED.value)
        n = int(np.where(whole if whole.any() else fit, cost, math.inf).argmin())
        one, more_than = dataset.isel(setting=n), 10.0 ** (exponent - 1)
        title = str(one["setting"].item())
        if result and result[-1].title == title:
            result[-1] = replace(result[-1], more_than=more_than)
            continue
        result.append(
            BestSetting(
                at_most=10.0**exponent,
                more_than=more_than,
                title=title,
                error=float(error[n]),
                cost=float(one["cpu_ratio"]),
                seconds=float(one["measured_time"]),
                cpu_seconds=float(one["cpu_seconds"]),
                less=not whole.any(),
                keys=_keys(one),
            )
        )
    return result


def _keys(one: xarray.Dataset) -> tuple[str, ...]:
    """The setting as lines for ``[integrator]``, those apart from the precision that aren't defaults."""
    default = Setting(precision_titled(str(one["precision"].item())))
    tolerance = float(one["tolerance"])
    loose = math.isfinite(tolerance) and tolerance != default.step_tolerance
    setting = replace(
        default,
        tolerance=tolerance if loose else None,
        formulation=str(one["formulation"].item()),
        hold_invariants=bool(one["held"].item()),
        method=str(one["method"].item()),
    )
    usual = default.keys()
    return tuple(f"{k} = {v}" for k, v in setting.keys().items() if k == "precision" or v != usual[k])
