"""How the errors of a run's rounding grow: its tangents, kicked as each step's rounding does
(``rigidsim.solve.error_tangents``).

A run of some ten thousand steps is followed to its end, of a longer one the beginning; the whole where errors
grow faster there than a law could tell, or where ``accuracy`` was asked for.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property

import heyoka as hy
import numpy as np

from rigidsim.accuracy.estimates import margins
from rigidsim.model.formulations.formulation import Rounding
from rigidsim.model.projected_invariants import projected_invariants
from rigidsim.model.system import System
from rigidsim.scene.transitions import acts_at_moments_alone
from rigidsim.solve.compiled import compiled_function, interruptible
from rigidsim.solve.effects.waypoints import Waypoints
from rigidsim.solve.error_tangents import (
    Carrier,
    ErrorTangents,
    Held,
    Known,
    LaneCarrier,
    Measures,
    Perturbations,
    Spread,
    Starts,
    SteppedCarrier,
)
from rigidsim.solve.precision import Scalar, precision_of
from rigidsim.solve.problem import InitialValueProblem, double_twin
from rigidsim.solve.projection import LATE, steps_between
from rigidsim.solve.settled import SettledStates
from rigidsim.solve.switching.stepper import stepper_of
from rigidsim.solve.tangents import jacobian_rows
from rigidsim.solve.taylor_stepper import TaylorStepper

Samples = list[tuple[int, Scalar, np.ndarray, int]]
"""Index, time, state and chart."""


@dataclass(frozen=True)
class Course:
    """A run whose errors are to be followed, in internal units: ``nearest`` is the smallest singular factor
    of its chart, 1 for charts that are changed; ``go_on`` ends the following when False.
    """

    prepared: InitialValueProblem
    start: float
    end: float
    steps: int
    waypoints: Waypoints | None
    stepper: TaylorStepper | None
    nearest: float
    go_on: Callable[[], bool]

    @property
    def carried(self) -> bool:
        """Whether the run carries an attitude."""
        return self.prepared.system.requirements.attitude

    @property
    def part(self) -> float:
        """The part of the run that is followed at least."""
        if self.prepared.scene.config.integrator.accuracy is not None:
            return 1.0
        most, share = (margins.WHOLE, margins.BEGINNING)
        if self.prepared.system.switches:
            most, share = margins.SWITCHING
        return min(1.0, max(most / max(self.steps, 1), share))

    @cached_property
    def system(self) -> System:
        """What is followed, in double precision: the run's own states, or quaternions in place of Euler
        angles and their momenta.
        """
        system = self.prepared.system
        if not system.formulation.variables.regular:
            return double_twin(self.prepared)
        as_it_is = self.prepared.precision.name == "double" and not system.in_two_parts
        return system if as_it_is else system.rounded(precision_of("double").number)

    def with_waypoints(self, samples: Samples) -> Samples:
        """Samples, and the boundaries of steps that the run remembers, in time."""
        there = [] if self.waypoints is None else self.waypoints.between(1, self.steps)
        places: Samples = [(0, one.time, one.state, one.chart) for one in there if one.time < self.end]
        return sorted([*samples, *places], key=lambda place: float(place[1]))

    @property
    def shift(self) -> int:
        """Binary exponent from the run's internal time to the time of ``system``."""
        return int(self.prepared.system.scaling.time - self.system.scaling.time)

    def suspicious(self, spread: Spread) -> bool:
        """Whether errors grow faster than any power of time that would be extrapolated."""
        found = [spread.along("attitude" if self.carried else "rates")]
        if spread.largest("distance")[0] > 0:
            found.append(spread.along("position"))
        times = spread.along("time") - math.ldexp(self.start, self.shift)
        return any(power_of_time(times, errors) > margins.MOST_POWER for errors in found)


@dataclass(frozen=True)
class Followed:
    """What was seen of errors of one epsilon a step, and over which share of the run from its start."""

    spread: Spread
    share: float


def power_of_time(times: np.ndarray, errors: np.ndarray) -> float:
    """Power of time with which errors grew over the last three quarters."""
    largest = np.maximum.accumulate(errors)
    early = int(np.searchsorted(times, times[-1] / 4))
    if not (0 < largest[early] < math.inf and times[early] < times[-1] and largest[-1] < math.inf):
        return math.inf if largest[-1] > 0 else 0.0
    return float(math.log(largest[-1] / largest[early]) / math.log(times[-1] / times[early]))


def follow(course: Course) -> Followed:
    """Follow a run's errors as far as the cost allows."""
    start, end = (math.ldexp(time, course.shift) for time in (course.start, course.end))
    lost = math.pi / float(course.prepared.precision.epsilon)
    with _borrowed(course.stepper):
        tangents = interruptible(lambda: _tangents_of(course, start, end))
        spread = tangents.follow(start + course.part * (end - start), course.go_on, lost)
        if course.part < 1 and spread.whole[0] and course.suspicious(spread):
            tangents.follow(end, course.go_on, lost)
    return Followed(spread, (float(tangents.time[0]) - start) / (end - start))


@contextmanager
def _borrowed(stepper: TaylorStepper | None) -> Iterator[None]:
    """Use a run's stepper inside the block without leaving a trace."""
    if stepper is None:
        yield
        return
    log = stepper.log
    mark, found, muted = stepper.mark(), list(log.found), log.muted
    log.muted = True
    try:
        yield
    finally:
        log.muted, log.found[:] = muted, found
        stepper.back_to(mark)


def _tangents_of(course: Course, start: float, end: float) -> ErrorTangents:
    prepared, system = course.prepared, course.system
    precision, measures, known = prepared.precision, Measures(system), None
    own = course.stepper if system is prepared.system else None
    if system.switches or course.steps < margins.BY_ITSELF:
        double = replace(precision_of("double"), compact=True)
        stepper = own or stepper_of(system, double, None, double.scalar(start))
        carrier: Carrier = SteppedCarrier(stepper, start, end, course.steps)
    else:
        compact = course.steps * course.part < margins.UNROLLED
        carrier = LaneCarrier(system, margins.TOLERANCE, compact=compact)
        known = _known(course)
    exponents = system.state_exponents
    units = [[math.ldexp(1.0, int(exponents[place]))] for place in measures.places["rates"]]
    starts = Starts(
        np.array([[float(x)] for x in system.initial]),
        np.array([start]),
        np.array([end]),
        np.array([float(course.steps)]),
        np.array(units).reshape(-1, 1),
        np.zeros((0, 1)),
    )
    return ErrorTangents(
        carrier,
        measures,
        starts,
        _perturbations(course),
        float(precision.epsilon),
        rounded=np.array([precision.exact(precision.number(x)) != x for x in system.initial]),
        known=known,
        held=_held(course),
    )


def _known(course: Course) -> Known | None:
    """Waypoints of the run in the states that are followed; None if these don't follow from its own."""
    own, system, waypoints = course.prepared.system, course.system, course.waypoints
    there = [] if waypoints is None else waypoints.between(1, course.steps)
    if not there:
        return None
    states = [waypoint.state for waypoint in there]
    if not own.formulation.variables.regular:
        settled = SettledStates.of(own, system, precision_of("double"))
        if settled is None:
            return None
        states = [settled.from_state(one.state, one.time, one.chart) for one in there]
    times = np.ldexp([[one.time] for one in there], course.shift)
    return Known(times, np.array(states)[:, :, None])


def _held(course: Course) -> Held | None:
    """What the run projects of its invariants."""
    prepared, system = course.prepared, course.system
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

    part = min(LATE / course.steps, 1.0) if late else 0.0
    since = course.start + part * (course.end - course.start)
    return Held(gradients, math.ldexp(since, course.shift), between)


# --- errors of a step -------------------------------------------------------------------------------------

_OF_SERIES = 2.0
"""Rounding of the arguments over that of time, both as errors of the time: the direction of the Moon in
single precision is wrong by 1.5e-4 rad (root mean square, 1973 to 1982), where time is by half of that.
"""
_WITHIN_MONTH = 4.0
"""Steps at least in a quarter of the Moon's month, as long as the body turns no slower than it revolves."""


def plain_perturbations(system: System) -> Perturbations:
    """Errors of a step in quaternions or rates at the precision's own tolerance."""
    loads = system.plan.loads
    ahead = max((load.seconds_ahead for load in loads), key=abs, default=0.0)
    plain = Perturbations(ahead=math.ldexp(ahead, -system.scaling.time))
    if not any(load.of_time for load in loads):
        return plain
    return replace(plain, clock=_OF_SERIES * plain.clock, together=_WITHIN_MONTH)


def _perturbations(course: Course) -> Perturbations:
    """Errors of a step."""
    prepared = course.prepared
    plain, rounding = plain_perturbations(course.system), prepared.system.formulation.rounding
    loose = prepared.law_tolerance / float(prepared.precision.epsilon)
    plain = replace(plain, own=plain.own * loose)
    if prepared.system.clocked and acts_at_moments_alone(prepared.scene):
        plain = replace(plain, clock=0.0)
    if rounding is Rounding.PLAIN:
        return plain
    angles = replace(plain, own=plain.own * margins.ANGLES)
    if rounding is Rounding.ANGLES:
        return angles
    # momenta: the nearer the singularity, the more do they lose in passing it
    more = min(max(margins.NEAR / max(course.nearest, 1e-150), 1.0), margins.ANGLES)
    more *= max(1.0, min(margins.VERY_NEAR / max(course.nearest, 1e-150), 10.0))
    carried = replace(angles, own=plain.own * more)
    if prepared.system.partner is not None:
        return carried
    return replace(carried, shared=plain.own * _condition(course))


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
