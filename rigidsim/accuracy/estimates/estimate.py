"""Estimate of a run's errors until its end.

Samples are held against a better solution where there is one at little cost: the closed form, or, where
tolerance or precision are coarse enough, the same motion at a tighter tolerance in double precision. Else
the growth of rounding errors is measured by tangents (``rigidsim.accuracy.estimates.following``). Either goes
over the whole run, or as much of it as the cost allows.
"""

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import heyoka as hy
import numpy as np

from rigidsim.accuracy.error_law import CLOSED_FORM, closed_form_if_any, stable_law
from rigidsim.accuracy.estimates import margins
from rigidsim.accuracy.estimates.following import Course, Samples, follow, power_of_time
from rigidsim.model.system import System
from rigidsim.solve.closed_form import ClosedForm
from rigidsim.solve.compiled import interruptible
from rigidsim.solve.effects.waypoints import SampleTrail, Waypoints
from rigidsim.solve.precision import Precision, precision_of
from rigidsim.solve.problem import InitialValueProblem, double_twin
from rigidsim.solve.stepper import OwnErrors
from rigidsim.solve.switching.stepper import stepper_of
from rigidsim.solve.taylor_stepper import TaylorStepper

DOUBLE = float(np.finfo(float).eps)
_LARGEST_EXPONENT = 600.0  # keeps products within doubles
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

    def amplified(self, seconds: float) -> float:
        """The amplification after so many seconds, if errors go on growing as they were seen to."""
        exponent = self.growth_rate * max(0.0, seconds - self.seconds)
        return self.amplification * math.exp(min(exponent, _LARGEST_EXPONENT))


def estimate_errors(
    prepared: InitialValueProblem,
    steps: int,
    reached: float,
    *,
    trail: SampleTrail | None = None,
    waypoints: Waypoints | None = None,
    stepper: TaylorStepper | None = None,
    nearest: float = 1.0,
    go_on: Callable[[], bool] = lambda: True,
) -> Estimate | None:
    """Estimate the errors of a run; None if ``go_on`` ended it."""
    scene, system, epsilon = prepared.scene, prepared.system, float(prepared.precision.epsilon)
    if not prepared.has_steps:
        return _everywhere(prepared, CLOSED_FORM * epsilon, "a few roundings of the closed form")
    start, seconds = float(prepared.clock.start), reached - float(scene.start)
    end = start + math.ldexp(seconds, -system.scaling.time)
    if steps == 0 or end <= start:
        how = "the rounding of the start, which the run didn't leave"
        return _everywhere(prepared, margins.LAST_BITS * epsilon, how)
    course = Course(prepared, start, end, steps, waypoints, stepper, nearest, go_on)
    samples = [] if trail is None else trail.samples
    form = closed_form_if_any(scene, driven=bool(prepared.python_loads))[0] if samples else None
    if form is not None:
        seen = _by_closed_form(course, form, samples, seconds)
    elif len(samples) > 1 and prepared.law_tolerance >= margins.COARSE * DOUBLE:
        seen = _by_better_solution(course, course.with_waypoints(samples), precision_of("double"), seconds)
    elif len(samples) > 1 and prepared.law_tolerance >= margins.COARSE * epsilon:
        seen = _by_better_solution(course, samples, prepared.precision, seconds)
    else:
        seen = _by_tangents(course, seconds)
    return _conclusion(course, seen, seconds) if go_on() else None


@dataclass(frozen=True)
class Seen:
    """What was seen of a run's errors.

    Attributes:
        times: since the start, ascending, s, (n,).
        errors: of each quantity, with the margins for what wasn't seen, (n,): rad, relative or SI.
        extent, speed: largest distance from the origin, m, and speed, m/s.
        law: the leading error of a stable motion, rad.
        whole: whether the motion could be followed over its share.
    """

    times: np.ndarray
    errors: dict[str, np.ndarray]
    extent: float
    speed: float
    law: float = 0.0
    how: str = "the motion could not be followed"
    whole: bool = True
    share: float = 1.0
    closed_form: bool = False

    @property
    def leading(self) -> np.ndarray:
        """Errors of the attitude, or of the rates if no attitude is carried."""
        return self.errors.get("attitude", self.errors.get("rates", np.zeros(len(self.times))))


def _over(share: float) -> str:
    if share >= 1:
        return ", over the run"
    words = f", over the first {100 * share:.2g} % of the run; errors are taken to go on growing so, "
    return words + "and growth that sets in elsewhere isn't seen"


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


# --- by a better solution ---------------------------------------------------------------------------------


def _by_closed_form(course: Course, form: ClosedForm, samples: Samples, seconds: float) -> Seen:
    """Held against the closed form, which rounds only a few times at any time."""
    prepared, system = course.prepared, double_twin(course.prepared)
    precision = precision_of("double") if prepared.precision.narrow else prepared.precision
    times = np.array([time for _, time, _, _ in samples], dtype=precision.scalar)
    there = form.states(system, precision, times, precision.scalar(prepared.clock.start))
    law = stable_law(prepared.law_tolerance, course.steps, float(prepared.system.rate_bound), seconds)
    law = math.hypot(law, CLOSED_FORM * float(prepared.precision.epsilon))  # of what it is held against
    found = _apart_at(prepared, system, samples, there)
    how = "held against the closed form at some samples"
    return replace(found, extent=found.extent + found.speed * seconds, law=law, how=how, closed_form=True)


def _by_better_solution(course: Course, samples: Samples, precision: Precision, seconds: float) -> Seen:
    """Held against a solution at a tighter tolerance, over the part of the run that is followed; over all of
    it where errors grow faster than any power of time that would be extrapolated.
    """
    prepared, system = course.prepared, course.system.rounded(precision.number)
    tolerance = max(prepared.law_tolerance * margins.BETTER, float(precision.epsilon))
    better = replace(precision, compact=precision.compact or course.steps * course.part < margins.OPTIMISED)
    unit = precision.scalar(2.0**course.shift)
    start = precision.scalar(prepared.clock.start) * unit
    stepper = interruptible(lambda: stepper_of(system, better, precision.scalar(tolerance), start))
    turned = float(prepared.system.rate_bound) * seconds
    # errors of the tolerance may add up one by one, and what they do to the rates with them: n^2 / 2 of phase
    law = prepared.law_tolerance * course.steps * math.hypot(1.0, turned / 2)
    there: list[np.ndarray] = []
    for part in (course.part, 1.0):
        last = course.start + part * (course.end - course.start)
        for _, time, _, _ in samples[len(there) :]:
            at = precision.scalar(time) * unit
            if float(time) > last and part < 1:
                break
            if not course.go_on() or (at > stepper.time and not stepper.to(at)):
                return replace(_apart_at(prepared, system, samples, there), law=law, whole=False)
            there.append(np.array(stepper.state))
        found = replace(_apart_at(prepared, system, samples, there), law=law)
        if len(found.times) > 1 and power_of_time(found.times, found.leading) <= margins.MOST_POWER:
            break
    share = 1.0 if len(there) == len(samples) else float(found.times[-1]) / seconds
    how = "held against a solution at a tighter tolerance at some samples" + _over(share)
    return replace(found, share=share, how=how)


def _apart_at(
    prepared: InitialValueProblem, system: System, samples: Samples, there: Sequence[np.ndarray] | np.ndarray
) -> Seen:
    """How far samples of a run are from states of a better solution in another system, in time."""
    precision = precision_of("double") if prepared.precision.narrow else prepared.precision
    here = [_Reader(s, precision) for s in (prepared.system, prepared.system.partner) if s is not None]
    reference = _Reader(system, precision)
    found: dict[str, list[float]] = {}
    for (_, _, state, chart), better in zip(samples, there, strict=False):
        own, other = (x.astype(precision.scalar) for x in (state, better))
        for name, error in _apart(here[chart].read(own), reference.read(other)).items():
            found.setdefault(name, []).append(margins.COMPARED * error)
    exponent, begin = prepared.system.scaling.time, float(prepared.clock.start)
    times = [math.ldexp(float(time) - begin, exponent) for _, time, _, _ in samples[: len(there)]]
    return Seen(
        np.array(times),
        {name: np.array(errors) for name, errors in found.items()},
        _size(prepared.scene.position),
        _size(prepared.scene.velocity),
    )


class _Reader:
    """Quantities that the states of a system stand for, compiled once."""

    def __init__(self, system: System, precision: Precision) -> None:
        self._system, attitude = system, system.mechanics.attitude
        self._function = None
        self._places: list[int] = []
        read = [] if attitude is None else attitude.quaternion or attitude.variables  # else a direction
        if all(x in system.variables for x in read):
            self._places = [system.variables.index(x) for x in read]
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
    """Angle between attitudes given as quaternions, up to their sign, or between directions, rad."""
    if len(one) == 3:
        return 2 * math.asin(
            min(math.hypot(*(float(a - b) for a, b in zip(one, other, strict=True))) / 2, 1.0)
        )
    opposite = sum(float(a) * float(b) for a, b in zip(one, other, strict=True)) < 0
    apart = [float(a + b) if opposite else float(a - b) for a, b in zip(one, other, strict=True)]
    return 4 * math.asin(min(math.hypot(*apart) / 2, 1.0))


def label_rounding(prepared: InitialValueProblem, seconds: float) -> float:
    """Rounding error of sample times, s."""
    late = max(abs(float(prepared.scene.start)), abs(float(prepared.scene.start) + seconds))
    return margins.LABEL * float(prepared.precision.epsilon) * late


def _size(vector: object) -> float:
    return math.hypot(*(float(x) for x in vector)) if vector is not None else 0.0  # type: ignore[attr-defined]


# --- by tangents ------------------------------------------------------------------------------------------


def _by_tangents(course: Course, seconds: float) -> Seen:
    """Errors that the rounding of each step makes grow, by tangents that are kicked as it does."""
    prepared, system = course.prepared, course.system
    followed = follow(course)
    spread, scaling = followed.spread, system.scaling
    # a looser tolerance may take more steps than the run does
    taken = max(float(spread.largest("steps")[0]), 1.0)
    fewer = min(max(course.steps * followed.share / taken, 0.25), 1.0)
    level = float(prepared.precision.epsilon) * margins.SAFETY * math.sqrt(fewer)
    begin = math.ldexp(course.start, course.shift)
    units = {"position": scaling.length, "velocity": scaling.speed}
    errors = {}
    for name in ("attitude", "rates", "position", "velocity"):
        if name in units and "x" not in system.states:
            continue
        size = level * (math.ldexp(margins.PATH, units[name]) if name in units else 1.0)
        errors[name] = size * spread.along(name)
    if not course.carried:
        del errors["attitude"]
    turned = float(prepared.system.rate_bound) * seconds
    longer = 1 / max(followed.share, 1e-300)
    # the tangents may take more steps than the run, of short motions above all, and are kicked at the start
    steps = max(course.steps, round(float(spread.largest("steps")[0]) * longer) + 1)
    found = Seen(
        np.ldexp(spread.along("time") - begin, scaling.time),
        errors,
        math.ldexp(float(spread.largest("distance")[0]), scaling.length),
        math.ldexp(float(spread.largest("speed")[0]), scaling.speed),
        stable_law(prepared.law_tolerance, steps, turned, 1.0),
        whole=bool(spread.whole[0]),
        share=followed.share,
    )
    lost = not found.whole or found.leading.max(initial=0.0) >= math.pi
    over = f", over the first {100 * found.share:.2g} % of the run, after which no digit is left"
    how = "motions near this one, perturbed at random as rounding does"
    return replace(found, how=how + (over if lost and found.share < 1 else _over(found.share)))


# --- conclusion -------------------------------------------------------------------------------------------


def _conclusion(course: Course, seen: Seen, seconds: float) -> Estimate:
    """Errors at the end from those along the beginning, with the rounding of samples and of their times."""
    prepared, times = course.prepared, seen.times
    carried, flight = course.carried, "position" in seen.errors
    rate, label = float(prepared.system.rate_bound), label_rounding(prepared, seconds)
    bits = margins.LAST_BITS * float(prepared.precision.epsilon)
    if not len(times):
        unknown = 0.0 if seen.whole else math.pi
        return Estimate(unknown if carried else None, unknown, "the motion could not be followed")
    longer = 1 / min(max(seen.share, 1e-300), 1.0)

    def beyond(name: str) -> float:
        power = power_of_time(times, seen.errors[name]) if longer > 1 else 0.0
        return float(longer ** min(max(power, margins.POWER), margins.MOST_POWER))

    lead = "attitude" if carried else "rates"
    turned = beyond(lead)
    moved = max(turned, beyond("position")) if flight else turned

    def at_end(name: str, size: float, most: float, pace: float = 0.0) -> float:
        found = float(seen.errors[name].max()) * (moved if name in ("position", "velocity") else turned)
        known = seen.whole and math.isfinite(found)
        return float(min(found + bits * size + label * pace, most)) if known else most

    leading = at_end(lead, 1.0, sys.float_info.max, rate)
    amplification = leading / seen.law if seen.law > 0 else 1.0
    growth, horizon = 0.0, None
    if not seen.closed_form:
        growth, horizon = exponential_growth(times, seen.errors[lead])
    extent, speed = seen.extent, seen.speed
    place = at_end("position", extent, margins.AS_LARGE * extent, speed) if flight else None
    return Estimate(
        attitude=min(leading, math.pi) if carried else None,
        rates=at_end("rates", 1.0, 2.0, rate) if "rates" in seen.errors else 0.0,
        position=place,
        velocity=at_end("velocity", speed, margins.AS_LARGE * speed) if flight else None,
        amplification=amplification if amplification > margins.STABLE else 1.0,
        growth_rate=growth,
        predictable_seconds=horizon,
        seconds=float(times[-1]),
        share=seen.share,
        how=seen.how,
        closed_form=seen.closed_form,
    )


def exponential_growth(times: np.ndarray, errors: np.ndarray) -> tuple[float, float | None]:
    """Rate of exponential growth, 1/s, and when digits are gone, seconds after the start; 0 and None if
    growth isn't exponential. Times in s since the start, errors in rad, or relative.
    """
    largest = np.maximum.accumulate(errors)
    gone = int(np.searchsorted(largest, margins.UNCERTAIN))
    last = min(gone, len(times) - 1)
    if last < 2 or power_of_time(times[: last + 1], largest[: last + 1]) < margins.EXPONENTIAL:
        return 0.0, None
    early = int(np.searchsorted(times, times[last] / 4))
    if not largest[early] > 0:  # errors begin where a load does: they have not grown from anything
        return 0.0, None
    span, ratio = float(times[last] - times[early]), min(largest[last], 1e300) / largest[early]
    rate = (math.log(ratio) - margins.POWER * math.log(times[last] / times[early])) / span
    seconds = float(times[last])
    if rate > 0 and gone >= len(times):
        seconds += math.log(margins.UNCERTAIN / largest[last]) / rate
    return max(rate, 0.0), seconds
