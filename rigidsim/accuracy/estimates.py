"""Estimates of errors until the end, of a run and of a sweep's members; and the laws of good integrations.

Samples are held against a better solution where there is one at little cost: the closed form; where tolerance
or precision are coarse enough, the same motion at a tighter tolerance in double precision; where the states
are singular somewhere, the same motion in quaternions, which round far less. Else the growth of rounding
errors is measured by tangents, kicked as each step's rounding does (``rigidsim.solve.error_tangents``).

A run of some ten thousand steps is followed to its end, of a longer one the beginning; the whole where errors
grow faster there than a law could predict, or where ``accuracy`` was asked for.

With the assumptions below the errors of the campaign's scenes are covered as ``experiments/README.md`` shows
(``experiments/error_coverage.py``).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property

import heyoka as hy
import numpy as np

from rigidsim.model.system import System, projected_invariants
from rigidsim.scene.scene import Scene
from rigidsim.scene.surfaces import acts_at_moments_alone
from rigidsim.solve.batch.family import BatchBlock, Family
from rigidsim.solve.closed_form import ClosedForm, NoClosedForm, closed_form_of
from rigidsim.solve.compiled import compiled_function, interruptible
from rigidsim.solve.corrected_stepper import CorrectedStepper
from rigidsim.solve.effects.waypoints import SampleTrail, Waypoint, Waypoints
from rigidsim.solve.error_tangents import (
    ErrorTangents,
    Held,
    LaneCarrier,
    Measures,
    Perturbations,
    Spread,
    Starts,
    SteppedCarrier,
    timed,
)
from rigidsim.solve.lanes import BatchEngine
from rigidsim.solve.precision import Precision, Scalar, precision_of
from rigidsim.solve.problem import InitialValueProblem, double_twin
from rigidsim.solve.projection import LATE, steps_between
from rigidsim.solve.stepper import OwnErrors
from rigidsim.solve.switching.stepper import stepper_of
from rigidsim.solve.tangents import jacobian_rows
from rigidsim.solve.taylor_stepper import TaylorStepper

# --- laws ---------------------------------------------------------------------------------------------------

CLOSED_FORM = 50.0
"""In eps: error of a sample from a closed form, thirty operations and sines right to 4 ulp, at any time."""


def round_off_law(tolerance: float, steps: int, rate: float, duration: float) -> float:
    """Attitude error (rad) of a good integration: (eps / 2) sqrt(steps) |w| t / sqrt 3.

    Rounding lets the frequencies wander as a random walk, and the phase integrates the walk (Brouwer 1937).
    Motions near an unstable axis amplify errors further: see ``rigidsim.accuracy.choice``.
    """
    return tolerance / 2 * math.sqrt(max(steps, 1)) * rate * duration / math.sqrt(3)


def stable_law(tolerance: float, steps: int, rate: float, duration: float) -> float:
    """Attitude error (rad) of a motion that amplifies none: the round-off law and the attitude's own walk.

    The law is one of phases that many radians have gathered. A motion of less than some radians, as a slow
    precession often is, shows what each step does to the attitude itself: four components of a unit
    quaternion, each off by eps / 2 of itself, turn it by eps at most, which add up as a random walk.
    """
    walk = tolerance * math.sqrt(max(steps, 1))
    return math.hypot(walk, round_off_law(tolerance, steps, rate, duration))


def held_error(
    prepared: InitialValueProblem, steps: int, rate: float, seconds: float, amplification: float
) -> float:
    """The law of stable motions times the motion's amplification, rad, where invariants are projected on the
    way, of a motion whose frequencies depend on them alone (one with a closed form); never above the plain
    run's.

    Corrections k steps apart leave the frequencies off by the wander in between, eps sqrt(k), whose part over
    the ends is taken back: eps k sqrt(n / 12) after n steps. Where they begin late, what rounding did to the
    phase until then comes on top.
    """
    level = prepared.law_tolerance
    plain = stable_law(level, steps, rate, seconds) * amplification
    late = prepared.holds_late
    if not prepared.holds_invariants or steps <= (LATE if late else 0):
        return plain
    between = steps_between(prepared.precision, late=late)
    begun = round_off_law(level, LATE, rate, seconds * LATE / steps) if late else 0.0
    return min(plain, (begun + level * between * math.sqrt(steps / 12)) * amplification)


def closed_form_if_any(scene: Scene, *, driven: bool = False) -> tuple[ClosedForm | None, str]:
    """The closed form of a scene's motion, or None and the reason why there is none."""
    try:
        return closed_form_of(scene, driven=driven), ""
    except NoClosedForm as none:
        return None, str(none)


# --- a single run -------------------------------------------------------------------------------------------

DOUBLE = float(np.finfo(float).eps)
_LARGEST_EXPONENT = 600.0  # keeps products within doubles

LAST_BITS = 0.5  # epsilons by which a recorded value is wrong at most because it is rounded
LABEL = 0.25  # the same for a sample's time: what is recorded belongs to another moment
AS_LARGE = 4.0  # bound for the error of a position that can't be predicted, over the whole way's size
UNCERTAIN = 1e-2  # error (rad, or relative to the rates) above which a result counts as lost

SAFETY = 2.75  # factor on the root mean square of three tangents
PATH = 0.5  # further factor for position and velocity
COMPARED = 3.0  # factor on the largest difference from a better solution at some samples
_STABLE = 4.0  # amplification up to which a motion is as stable as the round-off law assumes
_POWER, _MOST_POWER = 1.5, 2.5  # least and largest power of time by which errors are extrapolated
_EXPONENTIAL = 5.0  # power of time past which growth counts as exponential

_ANGLES = 4.0  # rounding in Euler angles and their momenta over that in quaternions
_COARSE = 8.0  # tolerance in epsilons from which a better solution in the next precision shows the error
_BETTER = 2.0**-10  # factor on the tolerance of that solution

_WHOLE = 100_000  # steps of a run that is followed to its end: some 0.3 s; of a longer one
_BEGINNING = 0.25  # that many, or this part
_SWITCHING = 1000, 0.1  # the same with switching surfaces, where each tangent costs as much as the run
_TOLERANCE = 1e-8  # of steps with tangents, whose motion begins anew at 16 to 32 places of the run
_BY_ITSELF, _UNROLLED, _OPTIMISED = 1_000, 3_000, 20_000
"""Steps up to which single steps cost less than code compiled for all motions; from which code pays that
takes longer to compile, of a low order and of a high one.
"""


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


Samples = list[tuple[int, Scalar, np.ndarray, int]]
"""Index, time, state and chart."""


@dataclass(frozen=True)
class _Run:
    """A run whose errors are to be followed, in internal units; ``go_on`` ends that when False."""

    prepared: InitialValueProblem
    start: float
    end: float
    steps: int
    corrected: CorrectedStepper | None
    go_on: Callable[[], bool]

    @cached_property
    def stepper(self) -> TaylorStepper | None:
        """What took its steps, if nothing else changes states in between as its equations can't."""
        corrected = self.corrected
        if corrected is None or any(effect.registered and effect.rewrites for effect in corrected.effects):
            return None
        return corrected.stepper if isinstance(corrected.stepper, TaylorStepper) else None

    @cached_property
    def waypoints(self) -> list[Waypoint]:
        """Boundaries of steps that it remembers."""
        kept = None if self.corrected is None else self.corrected.effect(Waypoints)
        return [] if kept is None else kept.between(1, self.steps)

    @property
    def carried(self) -> bool:
        """Whether the run carries an attitude."""
        return self.prepared.system.requirements.attitude

    @property
    def regular(self) -> bool:
        """Whether its states are singular nowhere."""
        return self.prepared.system.formulation.variables.regular

    @property
    def seconds(self) -> float:
        """Its length, s."""
        return math.ldexp(self.end - self.start, self.prepared.system.scaling.time)

    @property
    def turned(self) -> float:
        """Radians by which the body turns, at most."""
        return float(self.prepared.system.rate_bound) * self.seconds

    @property
    def part(self) -> float:
        """The part of the run that is followed at least."""
        if self.prepared.scene.config.integrator.accuracy is not None:
            return 1.0
        most, share = _SWITCHING if self.prepared.system.switches else (_WHOLE, _BEGINNING)
        return min(1.0, max(most / max(self.steps, 1), share))

    @cached_property
    def system(self) -> System:
        """What is followed, in double precision: the run's own states, or quaternions in place of Euler
        angles and their momenta.
        """
        system = self.prepared.system
        if not self.regular:
            return double_twin(self.prepared)
        as_it_is = self.prepared.precision.name == "double" and not system.in_two_parts
        return system if as_it_is else system.rounded(precision_of("double").number)

    @property
    def shift(self) -> int:
        """Binary exponent from the run's internal time to the time of ``system``."""
        return int(self.prepared.system.scaling.time - self.system.scaling.time)

    def with_waypoints(self, samples: Samples) -> Samples:
        """Samples, and the boundaries of steps that the run remembers, in time."""
        there = [one for one in self.waypoints if one.time < self.end]
        places: Samples = [(0, one.time, one.state, one.chart) for one in there]
        return sorted([*samples, *places], key=lambda place: float(place[1]))


def estimate_errors(
    prepared: InitialValueProblem,
    steps: int,
    reached: float,
    *,
    trail: SampleTrail | None = None,
    corrected: CorrectedStepper | None = None,
    go_on: Callable[[], bool] = lambda: True,
) -> Estimate | None:
    """Estimate the errors of a run; None if ``go_on`` ended it. ``corrected`` is what took its steps, which
    is used in between and put back.
    """
    scene, epsilon = prepared.scene, float(prepared.precision.epsilon)
    if not prepared.has_steps:
        return _everywhere(prepared, CLOSED_FORM * epsilon, "a few roundings of the closed form")
    start = float(prepared.clock.start)
    end = start + math.ldexp(abs(reached - float(scene.start)), -prepared.system.scaling.time)
    if steps == 0 or end <= start:
        how = "the rounding of the start, which the run didn't leave"
        return _everywhere(prepared, LAST_BITS * epsilon, how)
    run = _Run(prepared, start, end, steps, corrected, go_on)
    samples = [] if trail is None else trail.samples
    form = closed_form_if_any(scene, driven=bool(prepared.python_loads))[0] if samples else None
    if form is not None:
        seen = _by_closed_form(run, form, samples)
    elif len(samples) > 1 and prepared.law_tolerance >= _COARSE * DOUBLE:
        seen = _by_better_solution(run, run.with_waypoints(samples), precision_of("double"))
    elif len(samples) > 1 and (prepared.law_tolerance >= _COARSE * epsilon or not run.regular):
        seen = _by_better_solution(run, samples, prepared.precision)
    else:
        seen = _by_tangents(run)
    return _conclusion(run, seen) if go_on() else None


@dataclass(frozen=True)
class _Seen:
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
    how: str = ""
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
    words = f", over the first {100 * share:.2g} % of the run; their growth is extrapolated, "
    return words + "and growth that sets in elsewhere is missed"


def _everywhere(prepared: InitialValueProblem, error: float, how: str) -> Estimate:
    """Estimate of a relative error that is the same for all states."""
    attitude = error if prepared.system.requirements.attitude else None
    if prepared.system.flown is None:
        return Estimate(attitude, error, how)
    far, fast = _at_start(prepared.system)
    return Estimate(attitude, error, how, error * far, error * fast)


# --- by a better solution ---------------------------------------------------------------------------------


def _by_closed_form(run: _Run, form: ClosedForm, samples: Samples) -> _Seen:
    """Held against the closed form, which rounds only a few times at any time."""
    prepared, system = run.prepared, double_twin(run.prepared)
    precision = precision_of("double") if prepared.precision.narrow else prepared.precision
    times = np.array([time for _, time, _, _ in samples], dtype=precision.scalar)
    there = form.states(system, precision, times, precision.scalar(prepared.clock.start))
    found = _apart(run, system, samples, np.asarray(there))
    law = stable_law(prepared.law_tolerance, run.steps, run.turned, 1.0)
    law = math.hypot(law, CLOSED_FORM * float(prepared.precision.epsilon))  # of what it is held against
    how, extent = "held against the closed form at some samples", found.extent + found.speed * run.seconds
    return replace(found, extent=extent, law=law, how=how, closed_form=True)


def _by_better_solution(run: _Run, samples: Samples, precision: Precision) -> _Seen:
    """Held against a solution at a tighter tolerance, or in other states, over the part of the run that is
    followed; over all of it where errors grow faster than any power of time that would be extrapolated.
    """
    prepared, system = run.prepared, run.system.rounded(precision.number)
    tolerance = max(prepared.law_tolerance * _BETTER, float(precision.epsilon))
    better = replace(precision, compact=precision.compact or run.steps * run.part < _OPTIMISED)
    unit = precision.scalar(2.0**run.shift)
    start = precision.scalar(prepared.clock.start) * unit
    stepper = interruptible(lambda: stepper_of(system, better, precision.scalar(tolerance), start))
    # errors of the tolerance may add up one by one, and what they do to the rates with them: n^2 / 2 of phase
    law = prepared.law_tolerance * run.steps * math.hypot(1.0, run.turned / 2)
    there: list[np.ndarray] = []
    for part in (run.part, 1.0):
        last = run.start + part * (run.end - run.start)
        for _, time, _, _ in samples[len(there) :]:
            at = precision.scalar(time) * unit
            if float(time) > last and part < 1:
                break
            if not run.go_on() or (at > stepper.time and not stepper.to(at)):
                lost = _apart(run, system, samples, np.array(there))
                return replace(lost, law=law, whole=False, how="the motion could not be followed")
            there.append(np.array(stepper.state))
        found = _apart(run, system, samples, np.array(there))
        if len(found.times) > 1 and _power_of_time(found.times, found.leading) <= _MOST_POWER:
            break
    share = 1.0 if len(there) == len(samples) else float(found.times[-1]) / run.seconds
    than = "at a tighter tolerance"
    if tolerance >= prepared.law_tolerance:  # it errs, too, as a stable motion in good states does
        than, law = "in quaternions", stable_law(tolerance, run.steps, run.turned, 1.0)
        floor = law * found.times / run.seconds
        found.errors.update(
            {name: np.maximum(x, floor) for name, x in found.errors.items() if name == "attitude"}
        )
    how = f"held against a solution {than} at some samples{_over(share)}"
    return replace(found, law=law, share=share, how=how)


def _apart(run: _Run, system: System, samples: Samples, there: np.ndarray) -> _Seen:
    """How far samples of a run are from states (n, states) of a better solution in another system."""
    prepared, samples = run.prepared, samples[: len(there)]
    precision = precision_of("double") if prepared.precision.narrow else prepared.precision
    begin, exponent = run.start, prepared.system.scaling.time
    times = np.array([math.ldexp(float(time) - begin, exponent) for _, time, _, _ in samples])
    errors: dict[str, np.ndarray] = {}
    if len(samples):
        charts = [chart for chart in (prepared.system, prepared.system.partner) if chart is not None]
        states = np.array([state.astype(precision.scalar) for _, _, state, _ in samples])
        of_charts = [_quantities(chart, precision, states) for chart in charts]
        better = _quantities(system, precision, there.astype(precision.scalar))
        for name in of_charts[0].keys() & better.keys():
            own = np.array([of_charts[chart][name][n] for n, (_, _, _, chart) in enumerate(samples)])
            errors[name] = COMPARED * _distances(name, own, better[name])
    if "partner" in errors:
        errors["attitude"] = np.maximum(errors["attitude"], errors.pop("partner"))
    return _Seen(times, errors, *_at_start(prepared.system))


def _quantities(system: System, precision: Precision, states: np.ndarray) -> dict[str, np.ndarray]:
    """The quaternion (n, 4), or a direction (n, 3), and vectors (n, 3) in SI, of states (n, states); of a
    frame that turns with time all at one time, which changes no distance.
    """
    measures, found = Measures(system), {}
    for name, places in measures.places.items():
        if not places or name == "attitude":
            continue
        sizes = [precision.of_double(math.ldexp(1.0, int(system.state_exponents[i]))) for i in places]
        found[name] = states[:, places] * np.array(sizes)
    if measures.carried:
        found["attitude"] = measures.attitudes(states, **precision.options).T
    return found


def _distances(name: str, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Distances (n,) in SI, of rates relative to their size, of attitudes angles, subtracted in the numbers'
    own precision.
    """
    apart, size = one - other, other.astype(float)
    if name not in ("attitude", "partner"):
        whole = np.linalg.norm(size, axis=1) if name == "rates" else np.ones(len(size))
        return np.asarray(np.linalg.norm(apart.astype(float), axis=1) / np.where(whole > 0, whole, 1.0))
    if one.shape[1] == 3:
        return 2 * np.arcsin(np.minimum(np.linalg.norm(apart.astype(float), axis=1) / 2, 1.0))
    opposite = (one.astype(float) * size).sum(axis=1) < 0
    apart[opposite] = one[opposite] + other[opposite]
    return 4 * np.arcsin(np.minimum(np.linalg.norm(apart.astype(float), axis=1) / 2, 1.0))


def label_rounding(prepared: InitialValueProblem, seconds: float) -> float:
    """Rounding error of sample times, s."""
    start = float(prepared.scene.start)
    late = max(abs(start), abs(start + prepared.scene.samples.direction * seconds))
    return LABEL * float(prepared.precision.epsilon) * late


def _at_start(system: System) -> tuple[float, float]:
    """Distance (m) and speed (m/s) at the start of what flies; zeros without."""
    if (flown := system.flown) is None:
        return 0.0, 0.0
    at = [[system.states.index(name) for name in names] for names in (flown.position, flown.velocity)]
    sizes = [[math.ldexp(float(system.initial[k]), int(system.state_exponents[k])) for k in of] for of in at]
    return math.hypot(*sizes[0]), math.hypot(*sizes[1])


# --- by tangents ------------------------------------------------------------------------------------------


def _by_tangents(run: _Run) -> _Seen:
    """Errors that the rounding of each step makes grow, by tangents that are kicked as it does."""
    prepared, system, scaling = run.prepared, run.system, run.system.scaling
    epsilon = float(prepared.precision.epsilon)
    start, end = (math.ldexp(time, run.shift) for time in (run.start, run.end))
    with ExitStack() as put_back:  # the stepper is used without leaving a trace
        if (stepper := run.stepper) is not None:
            log = stepper.log
            put_back.callback(stepper.back_to, stepper.mark())
            put_back.callback(log.found.__setitem__, slice(None), list(log.found))
            put_back.callback(setattr, log, "muted", log.muted)
            log.muted = True
        tangents = interruptible(lambda: _tangents_of(run, start, end))
        spread = tangents.follow(start + run.part * (end - start), run.go_on, math.pi / epsilon)
        followed = ["attitude" if run.carried else "rates"] + ["position"] * bool(
            spread.largest("distance")[0] > 0
        )
        if run.part < 1 and spread.whole[0]:
            since = spread.along("time") - start
            if any(_power_of_time(since, spread.along(name)) > _MOST_POWER for name in followed):
                tangents.follow(end, run.go_on, math.pi / epsilon)
    share = (float(tangents.time[0]) - start) / (end - start)
    # a looser tolerance may take more steps than the run does
    taken = float(spread.largest("steps")[0])
    fewer = min(max(run.steps * share / max(taken, 1.0), 0.25), 1.0)
    level = epsilon * SAFETY * math.sqrt(fewer)
    length, speed = (0, 0) if system.flown is None else system.flown_units()
    units = {} if system.flown is None else {"position": length, "velocity": speed}
    sizes = {"rates": level, **{name: level * math.ldexp(PATH, unit) for name, unit in units.items()}}
    if run.carried:
        sizes["attitude"] = level
    # of short motions above all they may take more, and they are kicked at the start
    steps = max(run.steps, round(taken / max(share, 1e-300)) + 1)
    found = _Seen(
        np.ldexp(spread.along("time") - start, scaling.time),
        {name: size * spread.along(name) for name, size in sizes.items()},
        math.ldexp(float(spread.largest("distance")[0]), length),
        math.ldexp(float(spread.largest("speed")[0]), speed),
        stable_law(prepared.law_tolerance, steps, run.turned, 1.0),
        whole=bool(spread.whole[0]),
        share=share,
    )
    lost = not found.whole or found.leading.max(initial=0.0) >= math.pi
    over = f", over the first {100 * share:.2g} % of the run, after which no digit is left"
    how = "motions near this one, perturbed at random as rounding does"
    return replace(found, how=how + (over if lost and share < 1 else _over(share)))


def _tangents_of(run: _Run, start: float, end: float) -> ErrorTangents:
    prepared, system, precision = run.prepared, run.system, run.prepared.precision
    measures = Measures(system)
    known: tuple[np.ndarray, np.ndarray] | None = None
    carrier: LaneCarrier | SteppedCarrier
    if (
        system.switches or system.kicks or run.steps < _BY_ITSELF
    ):  # code for all motions isn't known, or would cost more
        carrier = _stepped(run, start, end)
    else:
        carrier = LaneCarrier.of(system, _TOLERANCE, compact=run.steps * run.part < _UNROLLED)
        if run.regular and run.waypoints:
            states = np.array([one.state for one in run.waypoints])[:, :, None]
            known = np.ldexp([[one.time] for one in run.waypoints], run.shift), states
    units = [[math.ldexp(1.0, int(system.state_exponents[place]))] for place in measures.places["rates"]]
    starts = Starts(
        np.array([[float(x)] for x in system.initial]),
        np.array([start]),
        np.array([end]),
        np.array([float(run.steps)]),
        np.array(units).reshape(-1, 1),
        np.zeros((0, 1)),
    )
    errors = plain_perturbations(system, prepared.law_tolerance / float(precision.epsilon))
    if prepared.system.clocked and acts_at_moments_alone(prepared.scene):
        errors = replace(errors, clock=0.0)
    if not run.regular:
        errors = replace(errors, own=errors.own * _ANGLES)
    return ErrorTangents(
        carrier,
        measures,
        starts,
        errors,
        float(precision.epsilon),
        rounded=np.array([precision.exact(precision.number(x)) != x for x in system.initial]),
        known=known,
        held=_held(run),
    )


def _stepped(run: _Run, start: float, end: float) -> SteppedCarrier:
    """What follows the motion by separate steps."""
    prepared, system = run.prepared, run.system
    double = replace(precision_of("double"), compact=True)
    near = run.stepper if system is prepared.system else None
    near = own = near or stepper_of(system, double, None, double.scalar(start))
    if run.regular and prepared.precision.bits > double.bits:
        precise = replace(prepared.precision, compact=True)
        own = run.stepper or stepper_of(prepared.system, precise, prepared.tolerance, prepared.clock.start)
    return SteppedCarrier(own, near, start, end, run.steps)


def _held(run: _Run) -> Held | None:
    """What the run projects of its invariants."""
    prepared, system = run.prepared, run.system
    projected = projected_invariants(system)[0] if prepared.holds_invariants else []
    if not projected:
        return None
    late = prepared.holds_late
    rows = jacobian_rows([one.expression for one in projected], system.variables)
    every = [row.get(i, hy.expression(0.0)) for row in rows for i in range(len(system.states))]
    function = compiled_function(every, system.variables, compact_mode=True, fp_type=float)
    # what is between corrections is off by k / sqrt 12 steps, of which the part over the ends is taken back
    between = round(steps_between(prepared.precision, late=late) / math.sqrt(12))

    def gradients(state: np.ndarray) -> np.ndarray:
        return np.asarray(function(np.ascontiguousarray(state))).reshape(len(rows), -1)

    part = min(LATE / run.steps, 1.0) if late else 0.0
    return Held(gradients, math.ldexp(run.start + part * (run.end - run.start), run.shift), between)


_OF_SERIES = 2.0
"""Rounding of the arguments over rounding of time, both as errors of the time: the direction of the Moon in
single precision is wrong by 1.5e-4 rad (root mean square, 1973 to 1982), where time is by half of that.
"""
_WITHIN_MONTH = 4.0
"""Steps at least in a quarter of the Moon's month, as long as the body turns no slower than it revolves."""


def plain_perturbations(system: System, loose: float) -> Perturbations:
    """Errors of a step in quaternions or rates, at a tolerance in epsilons."""
    loads = system.plan.loads
    ahead = max((load.seconds_ahead for load in loads), key=abs, default=0.0)
    plain = Perturbations(ahead=math.ldexp(ahead, -system.scaling.time))
    plain = replace(plain, own=plain.own * loose)
    if not any(load.of_time for load in loads):
        return plain
    return replace(plain, clock=_OF_SERIES * plain.clock, together=_WITHIN_MONTH)


# --- conclusion -------------------------------------------------------------------------------------------


def _power_of_time(times: np.ndarray, errors: np.ndarray) -> float:
    """Power of time with which errors grew over the last three quarters."""
    largest = np.maximum.accumulate(errors)
    early = int(np.searchsorted(times, times[-1] / 4))
    if not (0 < largest[early] < math.inf and times[early] < times[-1] and largest[-1] < math.inf):
        return math.inf if largest[-1] > 0 else 0.0
    return float(math.log(largest[-1] / largest[early]) / math.log(times[-1] / times[early]))


def _conclusion(run: _Run, seen: _Seen) -> Estimate:
    """Errors at the end from those along the beginning, with the rounding of samples and of their times."""
    prepared, times, carried = run.prepared, seen.times, run.carried
    flight = "position" in seen.errors
    rate, label = float(prepared.system.rate_bound), label_rounding(prepared, run.seconds)
    bits = LAST_BITS * float(prepared.precision.epsilon)
    if not len(times):
        unknown = 0.0 if seen.whole else math.pi
        return Estimate(unknown if carried else None, unknown, "the motion could not be followed")
    longer = 1 / min(max(seen.share, 1e-300), 1.0)

    def beyond(name: str) -> float:
        power = _power_of_time(times, seen.errors[name]) if longer > 1 else 0.0
        return float(longer ** min(max(power, _POWER), _MOST_POWER))

    lead = "attitude" if carried else "rates"
    turned = beyond(lead)
    moved = max(turned, beyond("position")) if flight else turned

    def at_end(name: str, size: float, most: float, pace: float = 0.0) -> float:
        found = float(seen.errors[name].max()) * (moved if name in ("position", "velocity") else turned)
        known = seen.whole and math.isfinite(found)
        return float(min(found + bits * size + label * pace, most)) if known else most

    leading = at_end(lead, 1.0, sys.float_info.max, rate)
    amplification = leading / seen.law if seen.law > 0 else 1.0
    growth, horizon = (0.0, None) if seen.closed_form else _exponential_growth(times, seen.errors[lead])
    extent, speed = seen.extent, seen.speed
    return Estimate(
        attitude=min(leading, math.pi) if carried else None,
        rates=at_end("rates", 1.0, 2.0, rate) if "rates" in seen.errors else 0.0,
        position=at_end("position", extent, AS_LARGE * extent, speed) if flight else None,
        velocity=at_end("velocity", speed, AS_LARGE * speed) if flight else None,
        amplification=amplification if amplification > _STABLE else 1.0,
        growth_rate=growth,
        predictable_seconds=horizon,
        seconds=float(times[-1]),
        share=seen.share,
        how=seen.how,
        closed_form=seen.closed_form,
    )


def _exponential_growth(times: np.ndarray, errors: np.ndarray) -> tuple[float, float | None]:
    """Rate of exponential growth, 1/s, and when digits are gone, seconds after the start; 0 and None if
    growth isn't exponential. Times in s since the start, errors in rad, or relative.
    """
    largest = np.maximum.accumulate(errors)
    gone = int(np.searchsorted(largest, UNCERTAIN))
    last = min(gone, len(times) - 1)
    if last < 2 or _power_of_time(times[: last + 1], largest[: last + 1]) < _EXPONENTIAL:
        return 0.0, None
    early = int(np.searchsorted(times, times[last] / 4))
    if not largest[early] > 0:  # errors begin where a load does: they have not grown from anything
        return 0.0, None
    span, ratio = float(times[last] - times[early]), min(largest[last], 1e300) / largest[early]
    rate = (math.log(ratio) - _POWER * math.log(times[last] / times[early])) / span
    seconds = float(times[last])
    if rate > 0 and gone >= len(times):
        seconds += math.log(UNCERTAIN / largest[last]) / rate
    return max(rate, 0.0), seconds


# --- members of a sweep -------------------------------------------------------------------------------------

_BEGUN_ANEW = 16  # times at most
_STRETCHES = 6
_LANES = 8
"""Least number of lanes: a step of eight in vectors of four costs 1.6 of one of four."""
_BY_CHANCE = 8.0
"""Tolerance in epsilons up to which a step's error is mostly random rounding."""
_MORE_STEPS = 4


@dataclass(frozen=True)
class MemberErrors:
    """Largest errors of members until their last samples, (members,), in the units of ``Estimate``; nan for
    those that have none.
    """

    attitude: np.ndarray | None
    rates: np.ndarray
    position: np.ndarray | None
    velocity: np.ndarray | None

    @property
    def uncertain(self) -> np.ndarray:
        """Mask of the members whose digits are gone."""
        return (self.rates if self.attitude is None else self.attitude) > UNCERTAIN


class MemberEstimates:
    """Estimates for a family's members, from tangents of their motions, with the perturbations and margins of
    single runs; what they need is compiled beforehand.

    Each member is followed over all of its motion, which begins anew at some of its samples. Where the
    tolerance lets steps be wrong by more than rounding does, members are run again at a tighter one and
    compared at their samples, which costs no more than tangents would, and is no question of chance.
    """

    def __init__(self, family: Family, width: int) -> None:
        self._family = family
        self._system, self._prepared = family.system, family.prepared
        self._epsilon = float(self._prepared.precision.epsilon)
        self._measures = Measures(self._system, family.moving, family.variables)
        loose = float(self._prepared.effective_tolerance)
        self._by_chance = loose <= _BY_CHANCE * self._epsilon  # whether errors come mainly from rounding
        rights = family.as_parameters([right for _, right in family.system.equations[: family.moving]])
        knots = family.knots
        first = len(family.in_equations) + (0 if knots is None else knots.parameters)
        self._engine = BatchEngine(
            list(zip(family.system.variables, timed(rights, first), strict=False)),
            max(width, _LANES),
            tolerance=_TOLERANCE if self._by_chance else loose * _BETTER,
            compact=family.system.wide,
            knots=None if self._by_chance else knots,
        )

    def of(self, block: BatchBlock) -> MemberErrors:
        """Errors of a block's members."""
        ran = np.array([status is not None for status in block.status]) & (block.reached > 0)
        some = np.flatnonzero(ran)
        found = np.full((4, len(ran)), np.nan)
        if len(some):
            found[:, some] = self._errors(block, some)
        attitude, rates, position, velocity = found
        flies = self._system.flown is not None
        carried = self._measures.carried
        return MemberErrors(
            attitude if carried else None, rates, position if flies else None, velocity if flies else None
        )

    def _errors(self, block: BatchBlock, some: np.ndarray) -> np.ndarray:
        family, system = self._family, self._system
        places, scaling = block.places[some], system.scaling
        units = family.whole_numbers(scaling.time)[places]
        seconds = block.times[block.reached[some] - 1]
        begin_seconds = float(self._prepared.scene.start)
        way = self._prepared.scene.samples.direction
        begin, duration = way * np.ldexp(begin_seconds, -units), way * (seconds - begin_seconds)
        exponents = [
            family.whole_numbers(system.state_exponents[place])[places]
            for place in self._measures.places["rates"]
        ]
        starts = Starts(
            family.initial[: family.moving, places],
            begin,
            begin + np.ldexp(duration, -units),
            block.steps[some],
            np.ldexp(1.0, np.array(exponents, dtype=np.int64).reshape(-1, len(places))),
            family.parameters[:, places],
        )
        by_chance = self._by_chance
        spread = self._followed(block, some, starts) if by_chance else self._compared(block, some, starts)
        label = LABEL * self._epsilon * np.maximum(abs(begin_seconds), np.abs(seconds))
        pace = family.doubles(system.rate_bound)[places]
        level = SAFETY * self._epsilon if by_chance else COMPARED
        last, path = LAST_BITS * self._epsilon, PATH if by_chance else 1.0
        with np.errstate(over="ignore"):

            def at_end(name: str, size: np.ndarray | float, most: np.ndarray | float) -> np.ndarray:
                found = spread.largest(name)
                known = spread.whole & np.isfinite(found)
                return np.where(known, np.minimum(level * found + size, most), most)

            attitude = at_end("attitude", last + label * pace, math.pi)
            rates = at_end("rates", last, 2.0)
            extent, fastest = spread.largest("distance"), spread.largest("speed")
            moved = last * extent + np.ldexp(label, -units) * fastest
            position = path * at_end("position", moved, AS_LARGE * extent)
            velocity = path * at_end("velocity", last * fastest, AS_LARGE * fastest)
        flown = (0, 0) if system.flown is None else system.flown_units()
        length, speed = (family.whole_numbers(e)[places] for e in flown)
        return np.array([attitude, rates, np.ldexp(position, length), np.ldexp(velocity, speed)])

    def _compared(self, block: BatchBlock, some: np.ndarray, starts: Starts) -> Spread:
        """Distance of members from runs at a tighter tolerance."""
        read = starts.parameters[self._family.in_equations]
        most = _MORE_STEPS * int(starts.steps.max()) + 1000
        moments = block.moments[:, some]
        read = np.concatenate([read, np.zeros((1, len(some)))])
        there = self._engine.run(starts.states, read, starts.begin, moments, most).states
        spread = Spread(len(some))
        for row, (state, apart) in enumerate(zip(there, block.states[:, :, some] - there, strict=True)):
            known = np.flatnonzero(block.reached[some] > row)
            away = apart[:, known, None]
            spread.note(known, **self._measures.differences(state[:, known], away, starts, known))
        return spread

    def _followed(self, block: BatchBlock, some: np.ndarray, starts: Starts) -> Spread:
        epsilon, read, knots = self._epsilon, starts.parameters[self._family.in_equations], self._family.knots
        read = np.concatenate([np.zeros((0 if knots is None else knots.parameters, len(some))), read])
        carrier = LaneCarrier(self._engine, read, starts, knots)
        loose = max(self._prepared.effective_tolerance / epsilon, 1.0)
        errors = plain_perturbations(self._prepared.system, loose)
        rows = np.unique(np.linspace(0, len(block.moments) - 1, _BEGUN_ANEW + 2).astype(int)[1:-1])
        times, states = (
            block.moments[np.ix_(rows, some)],
            block.states[:, : self._family.moving][rows][:, :, some],
        )
        unknown = ~np.isfinite(states).all(axis=1) | (rows[:, None] >= block.reached[some])
        known = np.where(unknown, np.nan, times), states
        tangents = ErrorTangents(
            carrier, self._measures, starts, errors, epsilon, known=known, stretches=_STRETCHES
        )
        return tangents.follow(lost=math.pi / epsilon)
