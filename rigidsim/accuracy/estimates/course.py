"""A run whose shadow ensemble is followed to learn how its errors grow: what carries it, the run's own
integrator or code compiled for it, how its motions are perturbed, and what was learnt.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from rigidsim.accuracy.estimates import margins
from rigidsim.model.capabilities import Ahead, having
from rigidsim.model.formulations.formulation import Rounding
from rigidsim.model.system import System
from rigidsim.scene.transitions import acts_at_moments_alone
from rigidsim.solve.compiled import TaylorEngine
from rigidsim.solve.effects.angle_wrapping import STEPS_BETWEEN
from rigidsim.solve.effects.waypoints import Waypoint, Waypoints
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import InitialValueProblem, double_twin
from rigidsim.solve.shadow.carriers import (
    TIGHT,
    BatchCarrier,
    OwnCarrier,
    StepperCarrier,
    own_until,
)
from rigidsim.solve.shadow.ensemble import EnsembleCarrier, Perturbations, ShadowEnsemble
from rigidsim.solve.shadow.measures import Measures, Spread, Starts
from rigidsim.solve.shadow.series_errors import SeriesErrors
from rigidsim.solve.shadow.through_pieces import ThroughPieces
from rigidsim.solve.taylor_stepper import TaylorStepper

UNCERTAIN = 1e-2
"""Error (rad, or relative to the rates) above which a result counts as lost."""


@dataclass(frozen=True)
class Course:
    """A run whose errors are to be followed, in internal units: the stepper, or copies of its engine, carry
    the ensemble if good enough; ``nearest`` is the smallest singular factor of its chart, 1 for charts that
    are changed; ``uneven`` its longest step over its shortest; ``go_on`` ends the following when False.
    """

    prepared: InitialValueProblem
    start: float
    end: float
    steps: int
    waypoints: Waypoints | None
    stepper: TaylorStepper | None
    nearest: float
    uneven: float
    go_on: Callable[[], bool]

    @property
    def lost(self) -> float:
        """The errors in epsilons past which nothing is learnt."""
        return math.pi / float(self.prepared.precision.epsilon)

    def passed(self, first: float, last: float) -> list[Waypoint]:
        """The run's waypoints between two counts of steps, as the ensemble passes them: where a piece of the
        equations ends, as the next one begins.
        """
        there = [] if self.waypoints is None else self.waypoints.between(first, last)
        system = self.shadowed if self.same_states else self.prepared.system
        if system.pieces is None or not (self.same_states or self.own is not None):
            return there
        through, found = ThroughPieces(system.pieces, system.states), list[Waypoint]()
        rounding = float(self.prepared.precision.epsilon)
        for waypoint in there:
            state = waypoint.state.copy()
            time = through.beginning(state, waypoint.time, rounding * abs(waypoint.time))
            found.append(replace(waypoint, time=time, state=state))
        return found

    def at(self, share: float) -> float:
        """The time at a share of the run."""
        return self.end if share >= 1 else self.start + (self.end - self.start) * share

    @property
    def carried(self) -> bool:
        """Whether the run carries an attitude."""
        return self.prepared.system.requirements.attitude

    @property
    def loose(self) -> bool:
        """Whether the tolerance allows larger step errors than rounding causes."""
        return self.prepared.effective_tolerance > 2 * float(self.prepared.precision.epsilon)

    @property
    def same_states(self) -> bool:
        """Whether the ensemble has the run's states, which it does unless a loose tolerance would run into
        singularities of these.
        """
        return self.prepared.system.formulation.variables.regular

    @cached_property
    def shadowed(self) -> System:
        """The system in double precision that code compiled for the ensemble integrates."""
        if not self.same_states:
            return double_twin(self.prepared)
        system = self.prepared.system
        as_it_is = self.prepared.precision.name == "double" and not system.in_two_parts
        return system if as_it_is else system.rounded(precision_of("double").number)

    @property
    def own(self) -> TaylorStepper | None:
        """The run's stepper if it can carry the ensemble; None otherwise."""
        single = self.prepared.system.partner is None and self.prepared.precision.name == "double"
        return self.stepper if single else None

    def leading(self, spread: Spread) -> np.ndarray:
        """Errors of the attitude, or of the rates if no attitude is carried."""
        return spread.along("attitude" if self.carried else "rates")

    def suspicious(self, spread: Spread, start: float, power: float) -> bool:
        """Whether errors grow faster than a power of time since a start, or couldn't be followed."""
        times = spread.along("time") - start
        if not (spread.whole[0] and len(times)):
            return not spread.whole[0]
        found = [self.leading(spread)]
        if spread.largest("distance")[0] > 0:
            found.append(spread.along("position"))
        return any(power_of_time(times, errors) > power for errors in found)


@dataclass(frozen=True)
class Followed:
    """Result of following an ensemble: over which share of the run's time from its start, possibly until no
    digit is left; windows beyond that, the part of the run they cover, and how much ``more`` errors grow in
    these than in as much of the beginning, root mean square, by quantity; 1 if they don't.
    """

    spread: Spread
    share: float
    windows: int = 0
    in_windows: float = 0.0
    more: dict[str, float] = field(default_factory=dict)


def power_of_time(times: np.ndarray, errors: np.ndarray) -> float:
    """Power of time with which errors grew over the last three quarters."""
    largest = np.maximum.accumulate(errors)
    early = int(np.searchsorted(times, times[-1] / 4))
    if not (0 < largest[early] < math.inf and times[early] < times[-1] and largest[-1] < math.inf):
        return math.inf if largest[-1] > 0 else 0.0
    return float(math.log(largest[-1] / largest[early]) / math.log(times[-1] / times[early]))


def exponential_growth(
    times: np.ndarray, errors: np.ndarray, exponent: int, stable: float, least: float
) -> tuple[float, float | None]:
    """Rate of exponential growth, 1/s, and when digits are gone, seconds after the start; 0 and None if
    growth isn't exponential. Times are internal, of a binary exponent; errors in rad, or relative.
    """
    largest = np.maximum.accumulate(errors)
    gone = int(np.searchsorted(largest, UNCERTAIN))
    last = min(gone, len(times) - 1)
    if last < 2 or power_of_time(times[: last + 1], largest[: last + 1]) < least:
        return 0.0, None
    early = int(np.searchsorted(times, times[last] / 4))
    if not largest[early] > 0:  # errors begin where a load does: they have not grown from anything
        return 0.0, None
    span = math.ldexp(float(times[last] - times[early]), exponent)
    ratio = min(largest[last], 1e300) / largest[early]
    rate = (math.log(ratio) - stable * math.log(times[last] / times[early])) / span
    seconds = math.ldexp(float(times[last]), exponent)
    if rate > 0 and gone >= len(times):
        seconds += math.log(UNCERTAIN / largest[last]) / rate
    return max(rate, 0.0), seconds


_OF_SERIES = 2.0
"""Rounding of the arguments over that of time, both as errors of the time: the direction of the Moon in
single precision is wrong by 1.5e-4 rad (root mean square, 1973 to 1982), where time is by half of that.
"""
_WITHIN_MONTH = 4.0
"""Steps at least in a quarter of the Moon's month, as long as the body turns no slower than it revolves."""


def ensemble_of(course: Course, part: float, first: float, tolerance: float) -> ShadowEnsemble:
    """The ensemble at the start of a run."""
    prepared, own = course.prepared, course.own
    precision, system = prepared.precision, prepared.system
    series: SeriesErrors | None = None
    stand_in = False
    follows = tolerance > TIGHT or not course.loose  # it is as loose as the run
    if own is not None and system.switches:
        carrier: EnsembleCarrier = StepperCarrier(system, course.start, course.end, course.steps, own)
    elif own is not None and follows and _by_itself(course, own.integrator, part, tolerance):
        carrier = OwnCarrier(system, own.integrator, tolerance if course.same_states else None)
        if course.loose:
            series = SeriesErrors(system, prepared.effective_tolerance, own.integrator)
    else:
        same, system = course.same_states, course.shadowed
        stand_in = not same and prepared.system.partner is None
        if system.switches:
            known = prepared.effective_tolerance if course.loose and same else None
            carrier = StepperCarrier(system, course.start, course.end, course.steps, known)
        else:
            carrier = BatchCarrier(system, course.steps * part, tolerance)
        if course.loose and not system.switches:
            turning, places = list[int](), Measures(system).places
            if prepared.scene.config.states and prepared.system.formulation.rounding is Rounding.ANGLES:
                turning = places["rates"] + places["attitude"]
            mean = abs(course.end - course.start) / max(course.steps, 1)
            # to compile long expressions once more takes as long as the run
            known = own.integrator if own is not None and same and system.pieces is not None else None
            series = SeriesErrors(system, prepared.effective_tolerance, known, turning=turning, mean=mean)
    cut_off = None
    if isinstance(carrier, StepperCarrier) and course.loose and course.same_states:
        cut_off = carrier.of_step
    measures, exponents = Measures(system), system.state_exponents
    units = [[math.ldexp(1.0, int(exponents[place]))] for place in measures.places["rates"]]
    return ShadowEnsemble(
        carrier,
        measures,
        Starts(
            np.array([[float(x)] for x in system.initial]),
            np.array([course.start]),
            np.array([course.end]),
            np.array([course.steps * first]),
            np.array(units).reshape(-1, 1),
            np.zeros((0, 1)),
        ),
        _perturbations(course, stand_in),
        float(precision.epsilon),
        rounded=np.array([precision.exact(precision.number(x)) != x for x in system.initial]),
        series=series.of_step if series is not None else cut_off,
    )


def _by_itself(course: Course, own: TaylorEngine, part: float, tolerance: float) -> bool:
    """Whether the run's own integrator carries its ensemble, at least at first."""
    if course.prepared.system.pieces is not None and course.same_states:
        return course.steps * part < own_until(course.prepared.system, own)
    if tolerance <= TIGHT or (part < 1 and not course.same_states):
        return course.steps * part < margins.MOST_OWN_STEPS
    if course.prepared.system.formulation.rounding is Rounding.MOMENTA:
        return course.steps * part <= margins.CANONICAL_STEPS
    return course.same_states or course.steps * part < own_until(course.prepared.system, own)


def plain_perturbations(system: System) -> Perturbations:
    """Errors of a step in quaternions or rates at the precision's own tolerance."""
    loads = list(having(Ahead, system.plan.loads))
    ahead = max((load.seconds_ahead for load in loads), key=abs, default=0.0)
    plain = Perturbations(ahead=math.ldexp(ahead, -system.scaling.time))
    if not any(load.of_time for load in loads):
        return plain
    return replace(plain, clock=_OF_SERIES * plain.clock, together=_WITHIN_MONTH)


def _perturbations(course: Course, stand_in: bool) -> Perturbations:
    """Errors of a step."""
    prepared = course.prepared
    plain, rounding = plain_perturbations(prepared.system), prepared.system.formulation.rounding
    if prepared.system.switches and course.loose and not course.same_states:
        plain = replace(
            plain, own=margins.CUT_OFF * prepared.effective_tolerance / float(prepared.precision.epsilon)
        )
    if prepared.system.clocked and acts_at_moments_alone(prepared.scene):
        plain = replace(plain, clock=0.0)
    if rounding is Rounding.PLAIN:
        return plain
    series = margins.ANGLE_SERIES
    if prepared.system.clocked:
        # steps are relative to the largest state, which angles are until they are brought back into one turn;
        # where the few steps through a spike decide, nothing averages that
        turned = float(prepared.system.rate_bound) * (course.end - course.start) / max(course.steps, 1)
        series *= 2 * math.pi + STEPS_BETWEEN * math.ldexp(turned, prepared.system.scaling.time)
    angles = replace(plain, own=plain.own * margins.ANGLES, series=series)
    if rounding is Rounding.ANGLES:
        return angles
    # momenta: the nearer the singularity, the more do they lose in passing it
    more = min(max(margins.NEAR / max(course.nearest, 1e-150), 1.0), margins.ANGLES)
    more *= max(1.0, min(margins.VERY_NEAR / max(course.nearest, 1e-150), 10.0))
    carried = replace(angles, own=plain.own * more)
    if not stand_in:
        return carried
    return replace(carried, shared=plain.own * _condition(course), series=margins.MOMENTUM_SERIES)


def _condition(course: Course) -> float:
    """Amplification of a rounding error by canonical momenta, root mean square over the steps.

    Rates are I^-1 K^T p: a rounded momentum is of the size of the largest moment and is divided by the
    smallest, and K has the inverse of the singular factor s in it. In passing the singularity the rates that
    remain are of the order s, and their derivatives lose as much once more: some steps that lose s^-2, among
    all others that lose little.
    """
    moments = [float(m) for m in course.prepared.scene.body.principal_moments if m != 0]
    nearest = max(course.nearest, 1e-150)
    passing = math.sqrt(1.0 + 1 / nearest**2 / nearest**2 / max(course.steps, 1))
    return max(moments) / min(moments) * min(passing, 1 / nearest)
