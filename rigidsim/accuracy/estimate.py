"""How wrong a run gets until its end, from neighbours of its motion (``rigidsim.solve.neighbours``).

The size of a step's errors is known: an epsilon's rounding of each state, and what the tolerance lets the
series be cut off by. What becomes of them is measured, over the whole run or as much of it as the cost
allows. Where the motion has a closed form, some samples are simply held against that.
"""

from __future__ import annotations

import copy
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rigidsim.accuracy.error_law import CLOSED_FORM, closed_form_if_any, round_off_law
from rigidsim.accuracy.exact_error import ExactError, exact_error
from rigidsim.accuracy.growth import exponential_growth, power_of_time
from rigidsim.model.system import System
from rigidsim.solve.building import interruptible
from rigidsim.solve.engine import Integrator
from rigidsim.solve.lanes import TIGHT, TOLERANCE, BatchLanes, Lanes, OwnLanes, SeriesErrors, SwitchingLanes
from rigidsim.solve.neighbours import Neighbours, Pushes, Spread
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import InitialValueProblem, double_twin
from rigidsim.solve.trail import Trail

_LAST_BITS = 0.5  # of a recorded value, rounded
_LABEL = 0.25  # of a sample's time, rounded: what is recorded belongs to another moment
_AS_LARGE = 4.0  # as the whole way: of a place that can't be told


@dataclass(frozen=True)
class Margins:
    """What the estimate assumes, and how far it looks.

    With the defaults the errors of the campaign's scenes are covered as ``experiments/README.md`` shows
    (``experiments/error_coverage.py``).

    Attributes:
        safety: over the root mean square of three neighbours; ``path``: of it, for position and velocity.
        drifted: growth of a step's error from which a loosely followed motion is another one; ``gone``: over
            what leaves no digit, from which that doesn't matter; ``tight_steps``: of runs that are followed
            tightly at most.
        compared: over the largest difference from a closed form at some samples.
        angles, angle_series, momentum_series: errors of a step in Euler angles over those in quaternions: of
            rounding, and of series that a tolerance cuts off; of the latter with canonical momenta.
        cut_off: of a tolerance, what a step is wrong by in motions with switching surfaces.
        own_steps: up to which the run's own integrator is good enough, and nothing is compiled.
        all_steps: that are followed to the end whatever they cost.
        part: of the steps of a longer run in double precision.
        dearer: a step in other precisions than one in double precision, roughly.
        stable: amplification up to which a motion is as stable as the law of rounding takes it to be.
        power, most_power: of time that errors grow with, at least and at most, where no more was followed.
        exponential: power of time past which growth is none.
    """

    safety: float = 3.0
    drifted: float = 1e6
    gone: float = 1e6
    tight_steps: int = 50_000
    path: float = 0.5
    compared: float = 3.0
    angles: float = 4.0
    angle_series: float = 5.0
    momentum_series: float = 20.0
    cut_off: float = 0.1
    own_steps: int = 3000
    all_steps: int = 20_000
    part: float = 0.1
    dearer: tuple[tuple[str, float], ...] = (("single", 0.3), ("double", 1.0), ("extended", 10.0))
    stable: float = 4.0
    power: float = 1.5
    most_power: float = 2.5
    exponential: float = 5.0


MARGINS = Margins()


@dataclass(frozen=True)
class Estimate:
    """Largest errors of a run until its end.

    Attributes:
        attitude: rad, at most pi; None without an attitude.
        rates: of the angular velocity, relative to its size.
        position, velocity: m and m/s; None where the body has no place.
        amplification: of the attitude's error (or the rates') over the law of rounding errors; 1 for a stable
            motion.
        growth_rate: 1/s, of exponential growth; 0 where it is none.
        predictable_seconds: after the start, from which digits are gone; None for motions whose errors don't
            grow exponentially.
        seconds: of the run that neighbours followed.
        how: in words.
    """

    attitude: float | None
    rates: float
    position: float | None
    velocity: float | None
    amplification: float = 1.0
    growth_rate: float = 0.0
    predictable_seconds: float | None = None
    seconds: float = 0.0
    how: str = ""

    @property
    def leading(self) -> float:
        """Of the attitude; without one of the rates."""
        return self.rates if self.attitude is None else self.attitude


def estimate_errors(
    prepared: InitialValueProblem,
    steps: int,
    reached: float,
    *,
    trail: Trail | None = None,
    integrator: Integrator | None = None,
    condition: float = 1.0,
    go_on: Callable[[], bool] = lambda: True,
    margins: Margins = MARGINS,
) -> Estimate | None:
    """Estimate the errors of a run.

    Args:
        steps: that it took.
        reached: the time that it got to, seconds.
        trail: some of the run's samples, to be held against a closed form.
        integrator: of the run; a copy of it is used where that is good enough.
        condition: what canonical momenta make of a rounding error.
        go_on: asked again and again; False ends it.

    Returns:
        None where ``go_on`` ended it.
    """
    scene, system = prepared.scene, prepared.system
    carried = system.requirements.formulation != "rates"
    if prepared.closed is not None:
        error = CLOSED_FORM * float(prepared.precision.epsilon)
        return _of_closed_form(prepared, error, carried)
    start = float(prepared.clock.start)
    end = start + math.ldexp(reached - float(scene.start), -system.scaling.time)
    if trail is not None and trail.samples:
        form, _ = closed_form_if_any(scene, driven=bool(prepared.python_loads))
        if form is not None:
            duration = reached - float(scene.start)
            law = round_off_law(prepared.law_tolerance, steps, float(system.rate_bound), duration)
            return _by_comparison(prepared, exact_error(prepared, form, trail), law, duration, margins)
    level = float(prepared.precision.epsilon)
    part = margins.part * dict(margins.dearer).get(prepared.precision.name, math.inf)
    part = min(1.0, max(margins.all_steps / max(steps, 1), part))
    lost = math.pi / level

    def followed(part: float, tolerance: float) -> Spread:
        neighbours = interruptible(
            lambda: _neighbours(prepared, start, end, steps, part, tolerance, integrator, condition, margins)
        )
        spread = neighbours.follow(start + (end - start) * part if part < 1 else end, go_on, lost)
        if part < 1 and spread.whole and _suspicious(spread, start, carried, margins):
            interruptible(lambda: neighbours.prepare_for(steps * (1 - part)))
            spread = neighbours.follow(end, go_on, lost)
        return spread

    spread = followed(part, TOLERANCE)
    far = spread.whole and margins.own_steps < steps < margins.tight_steps and bool(spread.times)
    far = far and margins.drifted < max(_leading(spread, carried)) < margins.gone * lost
    if far and go_on() and _suspicious(spread, start, carried, margins):
        spread = followed(1.0, TIGHT)
    if not go_on():
        return None
    return _conclusion(prepared, spread, end, steps, level, carried, margins)


def _neighbours(
    prepared: InitialValueProblem,
    start: float,
    end: float,
    steps: int,
    part: float,
    tolerance: float,
    integrator: Integrator | None,
    condition: float,
    margins: Margins,
) -> Neighbours:
    precision, system = prepared.precision, prepared.system
    series: SeriesErrors | None = None
    stand_in = False
    own = steps <= margins.own_steps and precision.name == "double" and not _loose(prepared)
    own = own and system.partner is None and not system.crossings and not system.switches
    if own and integrator is not None:
        lanes: Lanes = OwnLanes(copy.deepcopy(integrator))
    else:
        charts = system.requirements.formulation in ("euler_angles", "canonical")
        # in the run's own states, unless they have singularities that a loose tolerance would run into
        system = double_twin(prepared) if charts else system.rounded(precision_of("double").number)
        lanes = _lanes(system, start, end, steps, part, tolerance)
        stand_in = charts and prepared.system.partner is None
        if _loose(prepared) and not system.switches:
            series = SeriesErrors(system, prepared.effective_tolerance)
    rounded = np.array([precision.exact(precision.number(x)) != x for x in system.initial])
    pushes = _pushes(prepared, condition if stand_in else None, margins)
    epsilon = float(precision.epsilon)
    return Neighbours(system, lanes, start, end, steps, pushes, epsilon, rounded, series)


def _lanes(system: System, start: float, end: float, steps: int, part: float, tolerance: float) -> Lanes:
    if system.switches:
        return SwitchingLanes(system, start, end, steps)
    return BatchLanes(system, steps * part, tolerance)


def _loose(prepared: InitialValueProblem) -> bool:
    """Whether the tolerance lets steps be wrong by more than rounding does."""
    return prepared.effective_tolerance > 2 * float(prepared.precision.epsilon)


def _pushes(prepared: InitialValueProblem, condition: float | None, margins: Margins) -> Pushes:
    """Of a step.

    Args:
        condition: of canonical momenta whose place quaternions take.
    """
    plain, formulation = Pushes(), prepared.system.requirements.formulation
    if prepared.system.switches and _loose(prepared):
        plain = replace(
            plain, own=margins.cut_off * prepared.effective_tolerance / float(prepared.precision.epsilon)
        )
    if formulation not in ("euler_angles", "canonical"):
        return plain
    angles = replace(plain, own=plain.own * margins.angles, series=margins.angle_series)
    if condition is None:
        return angles
    return replace(angles, shared=plain.own * condition, series=margins.momentum_series)


def _of_closed_form(prepared: InitialValueProblem, error: float, carried: bool) -> Estimate:
    flight = prepared.scene.free_flight
    return Estimate(
        error if carried else None,
        error,
        error * _size(prepared.scene.position) if flight else None,
        error * _size(prepared.scene.velocity) if flight else None,
        how="a few roundings of the closed form",
    )


def _by_comparison(
    prepared: InitialValueProblem, found: ExactError, law: float, seconds: float, margins: Margins
) -> Estimate:
    """What was found, and some more for what lies between the samples that were compared."""
    bits, label = _LAST_BITS * float(prepared.precision.epsilon), _label(prepared, seconds)
    rate = float(prepared.system.rate_bound)
    extent, speed = _size(prepared.scene.position), _size(prepared.scene.velocity)

    def with_margin(error: float | None, size: float = 1.0, pace: float = 0.0) -> float | None:
        return None if error is None else margins.compared * error + bits * size + label * pace

    attitude, rates = with_margin(found.attitude, pace=rate), with_margin(found.rates, pace=rate) or 0.0
    amplification = (rates if attitude is None else attitude) / law if law > 0 else 1.0
    return Estimate(
        attitude=None if attitude is None else min(attitude, math.pi),
        rates=rates,
        position=with_margin(found.position, extent + speed * seconds, speed),
        velocity=with_margin(found.velocity, speed),
        amplification=amplification if amplification > margins.stable else 1.0,
        seconds=seconds,
        how="held against the closed form at some samples",
    )


def _label(prepared: InitialValueProblem, seconds: float) -> float:
    """By which times of samples are rounded, seconds."""
    late = max(abs(float(prepared.scene.start)), abs(float(prepared.scene.start) + seconds))
    return _LABEL * float(prepared.precision.epsilon) * late


def _size(vector: object) -> float:
    return math.hypot(*(float(x) for x in vector)) if vector is not None else 0.0  # type: ignore[attr-defined]


def _leading(spread: Spread, carried: bool) -> np.ndarray:
    return np.array(spread.attitude if carried else spread.rates)


def _suspicious(spread: Spread, start: float, carried: bool, margins: Margins) -> bool:
    """Whether errors grow faster than those of a stable motion."""
    return power_of_time(np.array(spread.times) - start, _leading(spread, carried)) > margins.most_power


def _conclusion(
    prepared: InitialValueProblem,
    spread: Spread,
    end: float,
    steps: int,
    level: float,
    carried: bool,
    margins: Margins,
) -> Estimate:
    system = prepared.system
    start, exponent = float(prepared.clock.start), system.scaling.time
    duration = math.ldexp(end - start, exponent)
    flight = "x" in system.states
    if not spread.times:
        unknown = math.pi if spread.whole is False else 0.0
        return Estimate(
            unknown if carried else None, unknown, None, None, how="the motion could not be followed"
        )
    times = np.array(spread.times) - start
    errors = level * margins.safety * _leading(spread, carried)
    power = min(max(power_of_time(times, errors), margins.power), margins.most_power)
    beyond = max((end - start) / times[-1], 1.0) ** power

    label = math.ldexp(_label(prepared, duration), -exponent)
    rate = math.ldexp(float(system.rate_bound), exponent)

    def at_end(values: list[float], size: float, most: float, pace: float = 0.0) -> float:
        found = float(max(values)) * level * margins.safety * beyond
        known = spread.whole and math.isfinite(found)
        return float(min(found + _LAST_BITS * level * size + label * pace, most)) if known else most

    lead = at_end(spread.attitude if carried else spread.rates, 1.0, sys.float_info.max, rate)
    law = round_off_law(level, steps, float(system.rate_bound), duration)
    amplification = lead / law if law > 0 else 1.0
    growth, horizon = exponential_growth(times, errors, exponent, margins.power, margins.exponential)
    scaling, size, speed = system.scaling, spread.extent, spread.fastest
    place = margins.path * at_end(spread.position, size, _AS_LARGE * size, speed)
    pace = margins.path * at_end(spread.velocity, speed, _AS_LARGE * speed)
    return Estimate(
        attitude=min(lead, math.pi) if carried else None,
        rates=at_end(spread.rates, 1.0, 2.0),
        position=math.ldexp(place, scaling.length) if flight else None,
        velocity=math.ldexp(pace, scaling.speed) if flight else None,
        amplification=amplification if amplification > margins.stable else 1.0,
        growth_rate=growth,
        predictable_seconds=horizon,
        seconds=math.ldexp(float(times[-1]), exponent),
        how=_words(prepared, beyond > 1),
    )


def _words(prepared: InitialValueProblem, extrapolated: bool) -> str:
    what = "neighbours of the motion, pushed at random as rounding does"
    if _loose(prepared):
        what += " and as the tolerance lets the series do"
    return what + (", over the run's beginning, whose growth goes on" if extrapolated else ", over the run")
