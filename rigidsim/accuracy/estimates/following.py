"""How far a run's shadow ensemble is followed, and what carries it, within a limited cost.

A run of some ten thousand steps is followed to its end. Of a longer one the beginning is, and windows that
are spread over the rest; where errors grow in any of them by more than time makes them, the whole run is
followed after all. So it is where the slow motion of the body's axis makes them grow, with an e-folding time
that is a good part of the run's length: longer than a beginning or windows can tell from growth in proportion
to time. The run's average over the rotation and the orbits carries errors alike, and takes few steps.
"""

import math
from functools import partial

import numpy as np

from rigidsim.accuracy.estimates import margins
from rigidsim.accuracy.estimates.course import Course, Followed, ensemble_of, power_of_time
from rigidsim.accuracy.models.carrying import carrying
from rigidsim.accuracy.models.side_by_side import Unmeasured
from rigidsim.errors import ConfigError
from rigidsim.model.averaged.sources import sources_of
from rigidsim.model.formulations.formulation import Rounding
from rigidsim.scene.arithmetic import apply, norm
from rigidsim.solve.compiled import interruptible
from rigidsim.solve.effects.waypoints import Waypoint
from rigidsim.solve.shadow.carriers import (
    LOOSE,
    OWN_FIRST,
    TIGHT,
    TOLERANCE,
    BatchCarrier,
    OwnCarrier,
    borrowed,
)
from rigidsim.solve.shadow.ensemble import PERTURBED, ShadowEnsemble
from rigidsim.solve.shadow.measures import Spread

_LEAST_FOLDS = 4.0
"""e-foldings within the run that make constant errors grow with a power of time of 2.5 over its last three
quarters: (e^x - 1) / (e^(x/4) - 1) = 4^2.5.
"""
_SMALL = 1e-100  # rad/s: errors that stay small however they grow


def follow(course: Course) -> Followed:
    """Follow a run's shadow ensemble."""
    with borrowed(course.stepper):
        return _follow_as_needed(course)


def _follow_as_needed(course: Course) -> Followed:
    part = min(1.0, _affordable(course) / max(course.steps, 1))
    if part < 1 and not _waypoints(course, part):
        part = max(part, min(1.0, margins.ALL_STEPS / course.steps))
    if part < 1 and _power_of_slow_motion(course) > margins.MOST_POWER:
        part = 1.0
    found, tight = _follow_loosely(course, part)
    if found.windows and found.spread.whole[0] and not course.same_states and course.go_on():
        # what sets in between windows, or shows in none: quaternions follow it, which lose less than momenta
        affordable = _of_double(course, margins.SHARE * course.steps)
        twin = _follow_loosely(course, min(1.0, affordable / course.steps))
        spread = twin[0].spread
        if course.suspicious(spread, course.start, margins.MOST_POWER):
            found, tight = twin
    if not tight and course.go_on() and _drifted(course, found.spread):
        found, *_ = _follow(course, 1.0, TIGHT)
    return found


def _drifted(course: Course, spread: Spread) -> bool:
    """Whether errors grow so much that a motion is to be followed tightly, but not so that all is lost."""
    largest = course.leading(spread).max(initial=0.0)
    if not (spread.whole[0] and course.steps < margins.TIGHT_STEPS):
        return False
    if not margins.DRIFTED < largest < margins.GONE * course.lost:
        return False
    return course.suspicious(spread, course.start, margins.MOST_POWER)


def _follow_loosely(course: Course, part: float) -> tuple[Followed, bool]:
    """As ``_follow``, as loosely as the motion bears: code of a lower order takes less time to compile and to
    run. What isn't the run's motion any more, or can't be held against it and shows growth, is followed anew.
    """
    if not _can_be_checked(course, part):
        return _follow(course, part, TOLERANCE)[:2]
    found, tight, astray = _follow(course, part, LOOSE)
    if not course.same_states:
        astray = not tight and course.suspicious(found.spread, course.start, margins.MOST_POWER)
    if astray and course.go_on():
        by_itself = course.own is not None and not course.loose and course.steps < margins.MOST_ANEW
        tightly = by_itself or _drifted(course, found.spread)
        found, tight, _ = _follow(course, part, TIGHT if tightly else TOLERANCE)
    return found, tight


def _can_be_checked(course: Course, part: float) -> bool:
    """Whether a motion that is followed loosely can be held against the run's own, or shows growth itself."""
    if course.prepared.system.switches or course.waypoints is None:
        return False
    last = part * course.steps
    return not course.same_states or bool(course.waypoints.between(last / 2, last))


def _affordable(course: Course) -> float:
    """Steps that may be followed: a fixed number whatever they cost, or a small part of the run's cost."""
    if course.prepared.system.switches:
        return max(margins.SWITCHING_STEPS, margins.SWITCHING_SHARE * course.steps)
    dearer = margins.DEARER.get(course.prepared.precision.name)
    if dearer is None:
        return course.steps
    budget = margins.SHARE * dearer * course.steps  # in steps of double precision
    if course.own is not None and not course.same_states:
        canonical = course.prepared.system.formulation.rounding is Rounding.MOMENTA
        if course.steps > (margins.CANONICAL_STEPS if canonical else margins.ALL_STEPS):
            # windows, which nothing else can look at
            return max(margins.OWN_STEPS, budget / (PERTURBED + 1))
    return _of_double(course, budget)


def _of_double(course: Course, budget: float) -> float:
    """Steps of the run that may be followed in double precision by code that is compiled for it."""
    passes = "x" in course.prepared.system.states and course.uneven > margins.UNEVEN
    least = margins.PASSING_STEPS if passes else margins.ALL_STEPS
    more = 1.0 if course.same_states else margins.CHARTS
    return more * max(least, (budget - margins.UNROLLING) / margins.LANE)


def _follow(course: Course, part: float, tolerance: float) -> tuple[Followed, bool, bool]:
    """Follow a part of a run, and all of it where that is called for; whether it was followed tightly, and
    whether it was given up since the motion, followed loosely, isn't the run's any more.
    """
    start, steps, power = course.start, course.steps, margins.MOST_POWER
    waypoints = _waypoints(course, part) if part < 1 else []
    first = part * margins.BEGINNING if waypoints else part
    ensemble = interruptible(lambda: ensemble_of(course, part, first, tolerance))
    spread = ensemble.spread

    def go_to(share: float) -> bool:
        ensemble.follow(course.at(share), course.go_on, course.lost)
        return not ensemble.all_lost(course.lost)

    # what takes long to compile only where all isn't lost soon
    soon = OWN_FIRST / steps
    own = ensemble.carrier if isinstance(ensemble.carrier, OwnCarrier) else None
    if own is not None and course.same_states and first * steps > own.until:
        going = go_to(soon)
        while (
            going
            and soon * steps < own.until / 2
            and course.go_on()
            and course.suspicious(spread, start, power)
        ):
            soon += OWN_FIRST / steps
            going = go_to(soon)
        if going:
            interruptible(partial(ensemble.prepare_for, steps * (first - soon)))
    on_course = _stay_on_course(course, ensemble, first)
    if on_course:
        go_to(first)
    seen: list[Spread] = []
    if first < 1 and spread.whole[0] and on_course:
        wary = margins.WARY_POWER if steps < margins.WARY_STEPS else power
        whole = course.suspicious(spread, start, wary)
        if not whole and waypoints:
            seen = _windows(course, ensemble, waypoints, part - first)
            beginnings = zip(seen, waypoints, strict=False)
            whole = any(course.suspicious(s, waypoint.time, power) for s, waypoint in beginnings)
        for stage in (margins.STAGE / steps, 1.0) if whole else ():
            if first < stage <= 1 and not ensemble.all_lost(course.lost):
                interruptible(partial(ensemble.prepare_for, steps * (stage - first)))
                on_course = on_course and _stay_on_course(course, ensemble, stage)
                if on_course:
                    go_to(stage)
                    first = stage
    tight = (ensemble.carrier.tolerance or 0.0) <= TIGHT
    if first >= 1 or not seen or not on_course:
        reached = (float(ensemble.time[0]) - start) / (course.end - start)
        return Followed(spread, min(first, reached)), tight, not on_course
    length = (part - first) / len(waypoints) * (course.end - start)
    least = 1.0 if course.same_states else margins.BETWEEN_WINDOWS
    more = _more(spread, start + length, seen, least)
    return Followed(spread, first, len(seen), part - first, more), tight, False


def _stay_on_course(course: Course, ensemble: ShadowEnsemble, share: float) -> bool:
    """Follow a run loosely past its waypoints until a share of it; False as soon as it is another motion."""
    loosely = isinstance(ensemble.carrier, BatchCarrier) and ensemble.carrier.tolerance == LOOSE
    if course.waypoints is None or not (loosely and course.same_states):
        return True
    there = course.passed(0, share * course.steps)
    for waypoint in reversed(there[:: -margins.LOOKS]):
        if waypoint.time <= ensemble.time[0]:
            continue
        spread = ensemble.follow(waypoint.time, course.go_on, course.lost)
        if not spread.whole[0] or ensemble.time[0] < waypoint.time:
            break  # lost, or stopped
        grown = margins.SAFETY * float(course.leading(spread).max(initial=0.0))
        own_error = float(course.prepared.precision.epsilon) * grown
        if ensemble.away_from(waypoint.state) > margins.STRAYED + own_error:
            return False
    return True


def _waypoints(course: Course, part: float) -> list[Waypoint]:
    """Where windows begin; none if the ensemble's states differ from the run's."""
    system = course.prepared.system
    own = course.own is not None and part * course.steps < margins.MOST_OWN_STEPS
    if course.waypoints is None or system.switches or not (own or course.same_states):
        return []
    there = course.passed(part * course.steps, course.steps)
    count = int(part * course.steps * (1 - margins.BEGINNING) / margins.WINDOW)
    count = min(count, margins.WINDOWS, len(there))
    return [there[(2 * n + 1) * len(there) // (2 * count)] for n in range(count)]


def _windows(
    course: Course, ensemble: ShadowEnsemble, waypoints: list[Waypoint], share: float
) -> list[Spread]:
    """Errors that begin in each window; together the windows cover a share of the run."""
    length = share * (course.end - course.start) / len(waypoints)
    steps, seen = share * course.steps / len(waypoints), []
    for waypoint in waypoints:
        until = min(waypoint.time + length, course.end)
        window = ensemble.elsewhere(waypoint.state, waypoint.time, until, steps)
        seen.append(window.follow(until, course.go_on))
        if not seen[-1].whole[0]:
            break
    return seen


def _more(beginning: Spread, until: float, windows: list[Spread], least: float) -> dict[str, float]:
    """``Followed.more``, at least ``least``; the beginning counts up to a time."""
    times = beginning.along("time")
    last = min(int(np.searchsorted(times, until)), len(times) - 1)
    found = {}
    for name in ("rates", "attitude", "position", "velocity"):
        known = float(beginning.along(name)[: last + 1].max())
        grown = [float(window.largest(name)[0]) for window in windows]
        share = np.sqrt(np.mean(np.square(grown))) / known if known > 0 else 1.0
        found[name] = max(least, float(share))
    return found


def _power_of_slow_motion(course: Course) -> float:
    """Power of time with which the run's slow motion makes errors of the axis grow over the last three
    quarters of the run, if they are made all the time; 0 where they can't grow exponentially, or there is no
    average over the orbits to tell.
    """
    if course.prepared.system.stepwise or _most_folds(course) < _LEAST_FOLDS:
        return 0.0
    try:
        found = carrying(course.prepared, None, course.go_on)
    except (ConfigError, Unmeasured):
        return 0.0
    times = found.seconds * np.arange(1, len(found.maps) + 1)
    reached = times <= _seconds(course) * (1 + 1e-9)
    errors = np.array(list(found.errors(_SMALL, _SMALL)))
    return power_of_time(times[reached], errors[reached]) if reached.sum() > 1 else 0.0


def _most_folds(course: Course) -> float:
    """Bound of the e-foldings of errors of the axis s within the run, without computing its motion.

    Each source with the normal n of its orbit makes it precess, s' = k (n . s) n x s. Of this motion's
    tangent map, k (n . ds) (n x s) is all that stretches, by k / 2 at most. About a single n at rest s just
    precesses.
    """
    scene, context = course.prepared.scene, course.prepared.scene.context
    sources = sources_of(scene, course.prepared.system.plan.loads)
    orbit = sources[0].of.orbit if len(sources) == 1 else None
    if not all(source.has_elements for source in sources) or (orbit is not None and orbit.node_rate == 0):
        return 0.0
    momentum = float(norm(context, apply(scene.body.inertia, scene.angular_velocity)))
    moments = [float(moment) for moment in scene.body.principal_moments]
    if momentum == 0:
        return 0.0
    strength = sum(float(s.strength) * (1 - s.eccentricity**2) ** -1.5 / 2 for s in sources)
    return strength * (max(moments) - min(moments)) / momentum / 2 * _seconds(course)


def _seconds(course: Course) -> float:
    return math.ldexp(course.end - course.start, course.prepared.system.scaling.time)
