"""Which settings are measured, over how much of the motion, within a time budget; and against which
references, integrated in a process of their own while the settings are tried.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rigidsim.accuracy.bench.worker import Task
from rigidsim.accuracy.comparison import angles_between
from rigidsim.accuracy.error_law import exact_method
from rigidsim.accuracy.motion import run_pilot
from rigidsim.accuracy.reference import LEAST_DIGITS, exact_to
from rigidsim.accuracy.setting import Setting, epsilon
from rigidsim.accuracy.trial import trial_scene
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
_WARMING = 32  # steps whose cost isn't measured
_FEW_TOLERANCES = (1e-6, 1e-10)  # of the other formulations in double precision


_PILOT_STEPS = 4000  # measure the pace of the default setting
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


def every_setting(exact: str = "", *, full: bool = False) -> list[Setting]:
    """All settings, since a budget cuts at the end: first those that compile and run fast, then what more
    digits cost, then other formulations.
    """

    def both(settings: list[Setting]) -> list[Setting]:
        return [replace(s, hold_invariants=held) for s in settings for held in (False, True)]

    general = [name for name, variables in FORMULATIONS.items() if variables.general]
    further = [name for name in general if name != DEFAULT.formulation]
    peer = FORMULATIONS[DEFAULT.formulation].checked_by

    def best(precision: str) -> list[Setting]:
        # without a closed form the peer is needed to know the error of a reference, if nothing better is
        # possible
        other = [Setting(precision, method=exact)] if exact else [Setting(precision, formulation=peer)]
        return both([Setting(precision)]) + (other if exact or precision != "quadruple" else [])

    loose = both([Setting(p, tolerance) for p, some in _TOLERANCES.items() for tolerance in some])
    fast = both([Setting("double"), Setting("single")])
    fast += [s for s in loose if s.precision in ("single", "double")]
    fast.sort(key=lambda s: (s.hold_invariants, -(s.tolerance or 0.0)))
    tight = [
        replace(s, formulation=f)
        for p in ("double", "single", "extended")
        for s in both([Setting(p)])
        for f in further
    ]
    few = both([Setting("double", t, f) for t in _FEW_TOLERANCES for f in further])
    rest = [replace(s, formulation=f) for s in loose if s.precision != "quadruple" for f in further]
    listed = [
        DEFAULT,
        *best("double")[2 if exact else 0 :],
        *fast,
        *best("extended"),
        *best("quadruple"),
        *loose,
        *tight[: 4 * len(further)],
        *few,
        *tight[4 * len(further) :],
        *(rest if full else []),
    ]
    return list(dict.fromkeys(listed))


def make_plan(experiment: Experiment, budget: float) -> Plan:
    """Make a plan from a short pilot of the default setting. Raises ``ConfigError``."""
    scene = build_scene(experiment)
    start, end = float(scene.start), float(scene.samples.last)
    prepared = prepare_scene(experiment, trial_scene(experiment, DEFAULT))
    corrected = assemble(prepared).steps()
    pilot = run_pilot(corrected.stepper, prepared.clock, corrected.skip, steps=_PILOT_STEPS, warming=_WARMING)
    whole = pilot.whole * pilot.seconds_per_step
    exact, why = exact_method(scene)
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


_WITHOUT_END = 1e6  # seconds: a reference is stopped only by the deadline

Solutions = Mapping[Setting, list[np.ndarray]]
"""Attitudes by setting, float64 parts (samples, 4)."""


@dataclass(frozen=True)
class ReferenceSolution:
    """Attitudes, float64 parts (samples, 4), against which others are held, and their own error (samples,),
    rad.
    """

    setting: Setting
    attitudes: list[np.ndarray]
    error: np.ndarray
    how: str


def attitude_task(plan: Plan, setting: Setting, patience: float, *, wide: bool) -> Task:
    """Task that computes a setting's attitudes over the plan's times, the short part of them if ``wide``."""
    times = plan.times[: plan.short_count] if wide else plan.times
    return Task(setting, "attitudes", times, patience)


def reference_tasks(plan: Plan, *, wanted: bool) -> list[Task]:
    """What to integrate as references, beside what is measured: the closed form if there is one."""
    if plan.exact:
        return [attitude_task(plan, exact_to(LEAST_DIGITS, plan.exact).setting, _WITHOUT_END, wide=False)]
    return [
        attitude_task(plan, setting, _WITHOUT_END, wide=precision == LEAST_DIGITS)
        for precision in (("quadruple", LEAST_DIGITS) if wanted else ())
        for setting in _best_and_second(precision)
    ]


def best_reference(
    plan: Plan, integrated: Solutions, measured: Solutions
) -> tuple[ReferenceSolution, ReferenceSolution | None]:
    """The reference, and a separate one for quadruple precision if needed; of what was measured over the same
    times the best serves if there is nothing better. Raises ``RigidsimError`` if there is none.
    """
    exact = exact_to(LEAST_DIGITS, plan.exact or DEFAULT.method).setting
    if plan.exact and exact in integrated:
        attitudes = integrated[exact]
        own = np.full(len(attitudes[0]), 10.0 ** (2 - LEAST_DIGITS))  # two digits are left to rounding
        return ReferenceSolution(exact, attitudes, own, f"closed form to {LEAST_DIGITS} digits"), None
    for precision in ("quadruple", "extended", "double"):
        best = _best_of(precision, integrated if precision == "quadruple" else measured)
        if best is not None:
            return best, _best_of(LEAST_DIGITS, integrated)
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
    return ReferenceSolution(best, solutions[best], error, how)


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
