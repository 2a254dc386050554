"""Estimate of a run's errors until its end, from a shadow ensemble of its motion
(``rigidsim.solve.shadow.ensemble``).

The size of a step's errors is known: an epsilon's rounding of each state, and the truncation error of the
series that the tolerance allows. Their growth is measured over the whole run or as much of it as the cost
allows. If the motion has a closed form, some samples are simply compared with that.
"""

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass

import heyoka as hy
import numpy as np

from rigidsim.accuracy.error_law import CLOSED_FORM, closed_form_if_any, stable_law
from rigidsim.accuracy.estimates import margins
from rigidsim.accuracy.estimates.course import Course, Followed, exponential_growth, power_of_time
from rigidsim.accuracy.estimates.following import follow
from rigidsim.model.system import System
from rigidsim.solve.closed_form import ClosedForm
from rigidsim.solve.effects.waypoints import SampleTrail, Waypoints
from rigidsim.solve.precision import Precision, precision_of
from rigidsim.solve.problem import InitialValueProblem, double_twin
from rigidsim.solve.shadow.measures import Spread
from rigidsim.solve.stepper import OwnErrors
from rigidsim.solve.taylor_stepper import TaylorStepper

_VECTORS = {"rates": ("wx", "wy", "wz"), "position": ("x", "y", "z"), "velocity": ("vx", "vy", "vz")}


@dataclass(frozen=True)
class Estimate(OwnErrors):
    """Largest errors of a run until its end; of the attitude at most pi.

    Attributes:
        amplification: ratio of the leading error to the law of stable motions; 1 for these.
        growth_rate: rate of exponential growth, 1/s; 0 if there is none.
        predictable_seconds: time after the start at which digits are gone; None if growth isn't exponential.
        seconds, share: how far the ensemble was followed from the start, in s and as a part of the run.
        closed_form: whether the scene has one, against which the run was held.
    """

    amplification: float = 1.0
    growth_rate: float = 0.0
    predictable_seconds: float | None = None
    seconds: float = 0.0
    share: float = 1.0
    closed_form: bool = False

    @property
    def leading(self) -> float:
        """Error of the attitude, or of the rates if no attitude is carried."""
        return self.rates if self.attitude is None else self.attitude


def estimate_errors(
    prepared: InitialValueProblem,
    steps: int,
    reached: float,
    *,
    trail: SampleTrail | None = None,
    waypoints: Waypoints | None = None,
    stepper: TaylorStepper | None = None,
    nearest: float = 1.0,
    uneven: float = math.inf,
    go_on: Callable[[], bool] = lambda: True,
) -> Estimate | None:
    """Estimate the errors of a run, whose growth is examined at waypoints besides the beginning; None if
    ``go_on`` ended it.
    """
    scene, system, epsilon = prepared.scene, prepared.system, float(prepared.precision.epsilon)
    if not prepared.has_steps:
        return _everywhere(prepared, CLOSED_FORM * epsilon, "a few roundings of the closed form")
    start = float(prepared.clock.start)
    end = start + math.ldexp(reached - float(scene.start), -system.scaling.time)
    if steps == 0 or end <= start:
        how = "the rounding of the start, which the run didn't leave"
        return _everywhere(prepared, margins.LAST_BITS * epsilon, how)
    if trail is not None and trail.samples:
        form, _ = closed_form_if_any(scene, driven=bool(prepared.python_loads))
        if form is not None:
            duration = reached - float(scene.start)
            law = stable_law(prepared.law_tolerance, steps, float(system.rate_bound), duration)
            law = math.hypot(law, CLOSED_FORM * epsilon)  # of what it is held against
            return _by_comparison(prepared, form, trail, law, duration)
    course = Course(prepared, start, end, steps, waypoints, stepper, nearest, uneven, go_on)
    found = follow(course)
    if not go_on():
        return None
    return _conclusion(course, found)


def _everywhere(prepared: InitialValueProblem, error: float, how: str) -> Estimate:
    """Estimate of a relative error that is the same for all states."""
    flight = prepared.scene.free_flight
    return Estimate(
        error if prepared.system.requirements.attitude else None,
        error,
        how,
        error * _size(prepared.scene.position) if flight else None,
        error * _size(prepared.scene.velocity) if flight else None,
    )


def _by_comparison(
    prepared: InitialValueProblem, form: ClosedForm, trail: SampleTrail, law: float, seconds: float
) -> Estimate:
    """Estimate from the errors of some samples, the last among them, with a margin for the times between; the
    closed form, in the run's precision or better, rounds only a few times at any time.
    """
    precision = precision_of("double") if prepared.precision.narrow else prepared.precision
    there_system = double_twin(prepared)
    times = np.array([time for _, time, _, _ in trail.samples], dtype=precision.scalar)
    there = form.states(there_system, precision, times, precision.scalar(prepared.clock.start))
    here = [_Reader(s, precision) for s in (prepared.system, prepared.system.partner) if s is not None]
    reference = _Reader(there_system, precision)
    found: dict[str, float] = {}
    for row, (_, _, state, chart) in enumerate(trail.samples):
        apart = _apart(here[chart].read(state.astype(precision.scalar)), reference.read(there[row]))
        found = {name: max(error, found.get(name, 0.0)) for name, error in apart.items()}
    bits, label = margins.LAST_BITS * float(prepared.precision.epsilon), label_rounding(prepared, seconds)
    rate = float(prepared.system.rate_bound)
    extent, speed = _size(prepared.scene.position), _size(prepared.scene.velocity)

    def with_margin(name: str, size: float = 1.0, pace: float = 0.0) -> float | None:
        return margins.COMPARED * found[name] + bits * size + label * pace if name in found else None

    attitude, rates = with_margin("attitude", pace=rate), with_margin("rates", pace=rate) or 0.0
    amplification = (rates if attitude is None else attitude) / law if law > 0 else 1.0
    return Estimate(
        attitude=None if attitude is None else min(attitude, math.pi),
        rates=rates,
        position=with_margin("position", extent + speed * seconds, speed),
        velocity=with_margin("velocity", speed),
        amplification=amplification if amplification > margins.STABLE else 1.0,
        seconds=seconds,
        how="held against the closed form at some samples",
        closed_form=True,
    )


class _Reader:
    """Quantities that the states of a system stand for, compiled once."""

    def __init__(self, system: System, precision: Precision) -> None:
        self._system, attitude = system, system.mechanics.attitude
        self._function = None
        self._places: list[int] = []
        if attitude is not None and all(x in system.variables for x in attitude.quaternion):
            self._places = [system.variables.index(x) for x in attitude.quaternion]
        elif attitude is not None:
            options = precision.options
            self._function = hy.cfunc(attitude.quaternion, system.variables, compact_mode=True, **options)

    def read(self, state: np.ndarray) -> dict[str, np.ndarray]:
        """The quaternion (4,), and vectors in SI as the nearest doubles and their residuals, (2, 3)."""
        found: dict[str, np.ndarray] = {}
        if self._function is not None:
            found["attitude"] = np.array(self._function(state))
        elif self._places:
            found["attitude"] = state[self._places]
        for name, of in _VECTORS.items():
            if all(state_name in self._system.states for state_name in of):
                found[name] = _vector(self._system, state, of)
        return found


def _apart(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> dict[str, float]:
    """Distances in SI; for rates, relative to their size."""
    found: dict[str, float] = {}
    for name in one.keys() & other.keys():
        a, b = one[name], other[name]
        if name == "attitude":
            found[name] = _angle(a, b)
        else:
            size = float(np.linalg.norm(b[0])) if name == "rates" else 1.0
            found[name] = float(np.linalg.norm(a[0] - b[0] + (a[1] - b[1]))) / (size or 1.0)
    return found


def _vector(system: System, values: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """Three states in SI as the nearest doubles and their residuals, (2, 3)."""
    places = [system.states.index(name) for name in names]
    exponents = np.array([system.state_exponents[i] for i in places], dtype=np.int32)
    high = np.array([float(values[i]) for i in places])
    low = np.array([float(values[i] - type(values[i])(h)) for i, h in zip(places, high, strict=True)])
    return np.ldexp(np.array([high, low]), exponents)


def _angle(one: np.ndarray, other: np.ndarray) -> float:
    """Angle between attitudes given as quaternions, up to their sign, rad."""
    opposite = sum(float(a) * float(b) for a, b in zip(one, other, strict=True)) < 0
    apart = [float(a + b) if opposite else float(a - b) for a, b in zip(one, other, strict=True)]
    return 4 * math.asin(min(math.hypot(*apart) / 2, 1.0))


def label_rounding(prepared: InitialValueProblem, seconds: float) -> float:
    """Rounding error of sample times, s."""
    late = max(abs(float(prepared.scene.start)), abs(float(prepared.scene.start) + seconds))
    return margins.LABEL * float(prepared.precision.epsilon) * late


def _size(vector: object) -> float:
    return math.hypot(*(float(x) for x in vector)) if vector is not None else 0.0  # type: ignore[attr-defined]


def _conclusion(course: Course, followed: Followed) -> Estimate:
    prepared, spread, end = course.prepared, followed.spread, course.end
    system, start, exponent = prepared.system, course.start, prepared.system.scaling.time
    level, carried = float(prepared.precision.epsilon), course.carried
    duration = math.ldexp(end - start, exponent)
    flight = "x" in system.states
    times = spread.along("time") - start
    if not len(times):
        unknown = 0.0 if spread.whole[0] else math.pi
        return Estimate(unknown if carried else None, unknown, "the motion could not be followed")
    errors = level * margins.SAFETY * course.leading(spread)
    longer = max((end - start) / times[-1], 1.0)

    def beyond(errors: np.ndarray) -> float:
        return float(longer ** min(max(power_of_time(times, errors), margins.POWER), margins.MOST_POWER))

    turned = beyond(errors)
    moved = max(turned, beyond(spread.along("position"))) if flight else turned

    label = math.ldexp(label_rounding(prepared, duration), -exponent)
    rate = math.ldexp(float(system.rate_bound), exponent)

    def at_end(name: str, size: float, most: float, pace: float = 0.0) -> float:
        further = (moved if name in ("position", "velocity") else turned) * followed.more.get(name, 1.0)
        found = float(spread.largest(name)[0]) * level * margins.SAFETY * further
        known = bool(spread.whole[0]) and math.isfinite(found)
        return float(min(found + margins.LAST_BITS * level * size + label * pace, most)) if known else most

    lead = at_end("attitude" if carried else "rates", 1.0, sys.float_info.max, rate)
    law = _stable(course, spread, longer, float(system.rate_bound) * duration)
    amplification = lead / law if law > 0 else 1.0
    growth, horizon = exponential_growth(times, errors, exponent, margins.POWER, margins.EXPONENTIAL)
    scaling, size, speed = system.scaling, *(float(spread.largest(x)[0]) for x in ("distance", "speed"))
    place = margins.PATH * at_end("position", size, margins.AS_LARGE * size, speed)
    pace = margins.PATH * at_end("velocity", speed, margins.AS_LARGE * speed)
    return Estimate(
        attitude=min(lead, math.pi) if carried else None,
        rates=at_end("rates", 1.0, 2.0),
        position=math.ldexp(place, scaling.length) if flight else None,
        velocity=math.ldexp(pace, scaling.speed) if flight else None,
        amplification=amplification if amplification > margins.STABLE else 1.0,
        growth_rate=growth,
        predictable_seconds=horizon,
        seconds=math.ldexp(float(times[-1]), exponent),
        share=followed.share,
        how=_words(course, followed),
    )


def _stable(course: Course, spread: Spread, longer: float, turned: float) -> float:
    """Error at the end (rad) if the motion amplifies none of what its ensemble is perturbed by."""
    prepared, epsilon = course.prepared, float(course.prepared.precision.epsilon)
    # where steps end on surfaces, the tolerance itself is the size of perturbations
    level = prepared.law_tolerance if prepared.system.switches else epsilon
    # the ensemble may take more steps than the run, of short motions above all, and is perturbed at the start
    steps = max(course.steps, round(float(spread.largest("steps")[0]) * longer) + 1)
    # truncation errors may add up one by one, and what they do to the rates with them: n^2 / 2 of phase
    cut = epsilon * float(spread.largest("cut")[0]) * longer * math.hypot(1.0, turned / 2)
    return math.hypot(stable_law(level, steps, turned, 1.0), cut)


def _words(course: Course, followed: Followed) -> str:
    what = "motions beside this one, perturbed at random as rounding does"
    if course.loose:
        what += " and as the tolerance lets the series do"
    if followed.share >= 1:
        return what + ", over the run"
    what += f", over the first {100 * followed.share:.2g} % of the run"
    spread = followed.spread
    if not spread.whole[0] or course.leading(spread).max() >= course.lost:
        return what + ", after which no digit is left"
    if followed.windows:
        what += f" and in {followed.windows} windows beyond ({100 * followed.in_windows:.2g} %)"
    return what + "; errors are taken to go on growing so, and growth that sets in elsewhere isn't seen"
