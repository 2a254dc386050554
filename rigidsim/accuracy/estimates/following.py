"""How far a run's neighbours are followed, and with which integrator, within a limited cost.

A run of some ten thousand steps is followed to its end. Of a longer one the beginning is, and windows that
are spread over the rest; where errors grow in any of them by more than time makes them, the whole run is
followed after all.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rigidsim.accuracy.estimates.carriers import loose, neighbours_of, same_states
from rigidsim.accuracy.estimates.course import Course, Followed
from rigidsim.accuracy.estimates.growth import power_of_time
from rigidsim.accuracy.estimates.margins import Margins
from rigidsim.accuracy.estimates.slow_motion import power_of_slow_motion
from rigidsim.model.formulations.formulation import Rounding
from rigidsim.solve.compiled import interruptible
from rigidsim.solve.effects.waypoints import Waypoint
from rigidsim.solve.neighbours.lanes import (
    LOOSE,
    NEIGHBOURS,
    OWN_FIRST,
    TIGHT,
    TOLERANCE,
    BatchLanes,
    OwnLanes,
    borrowed,
)
from rigidsim.solve.neighbours.pushed import Neighbours
from rigidsim.solve.neighbours.spread import Spread


def follow(course: Course, margins: Margins, go_on: Callable[[], bool]) -> Followed:
    """Follow a run's neighbours.

    Args:
        go_on: polled repeatedly; False ends it.
    """
    with borrowed(course.stepper):
        return _follow_as_needed(course, margins, go_on)


def _follow_as_needed(course: Course, margins: Margins, go_on: Callable[[], bool]) -> Followed:
    part = min(1.0, _affordable(course, margins) / max(course.steps, 1))
    if part < 1 and not _waypoints(course, part, margins):
        part = max(part, min(1.0, margins.all_steps / course.steps))
    if part < 1 and power_of_slow_motion(course, go_on) > margins.most_power:
        part = 1.0
    found, tight = _follow_loosely(course, part, margins, go_on)
    if found.windows and found.spread.whole and not same_states(course.prepared) and go_on():
        # what sets in between windows, or shows in none: quaternions follow it, which lose less than momenta
        twin = _follow_loosely(course, _affordable_by_twin(course, margins), margins, go_on)
        spread = twin[0].spread
        if _suspicious(spread, course.start, course.carried, margins.most_power):
            found, tight = twin
    if not tight and go_on() and _drifted(course, found.spread, margins):
        found, *_ = _follow(course, 1.0, TIGHT, margins, go_on)
    return found


def _drifted(course: Course, spread: Spread, margins: Margins) -> bool:
    """Whether errors grow so much that a motion is to be followed tightly, but not so that all is lost."""
    if not (spread.whole and spread.times and course.steps < margins.tight_steps):
        return False
    if not margins.drifted < max(leading(spread, course.carried)) < margins.gone * course.lost:
        return False
    return _suspicious(spread, course.start, course.carried, margins.most_power)


def _follow_loosely(
    course: Course, part: float, margins: Margins, go_on: Callable[[], bool]
) -> tuple[Followed, bool]:
    """As ``_follow``, as loosely as the motion bears: code of a lower order takes less time to compile and to
    run. What isn't the run's motion any more, or can't be held against it and shows growth, is followed anew.
    """
    if not _can_be_checked(course, part):
        return _follow(course, part, TOLERANCE, margins, go_on)[:2]
    found, tight, astray = _follow(course, part, LOOSE, margins, go_on)
    if not same_states(course.prepared):
        astray = not tight and _suspicious(found.spread, course.start, course.carried, margins.most_power)
    if astray and go_on():
        by_itself = course.own is not None and not loose(course.prepared) and course.steps < margins.most_anew
        tightly = by_itself or _drifted(course, found.spread, margins)
        found, tight, _ = _follow(course, part, TIGHT if tightly else TOLERANCE, margins, go_on)
    return found, tight


def _can_be_checked(course: Course, part: float) -> bool:
    """Whether a motion that is followed loosely can be held against the run's own, or shows growth itself."""
    if course.prepared.system.stepwise or course.waypoints is None:
        return False
    last = part * course.steps
    return not same_states(course.prepared) or bool(course.waypoints.between(last / 2, last))


def leading(spread: Spread, carried: bool) -> np.ndarray:
    """Errors of the attitude, or of the rates if no attitude is carried."""
    return np.array(spread.attitude if carried else spread.rates)


def _affordable(course: Course, margins: Margins) -> float:
    """Steps that may be followed: a fixed number whatever they cost, or a small part of the run's cost."""
    if course.prepared.system.stepwise:
        return max(margins.switching_steps, margins.switching_share * course.steps)
    dearer = dict(margins.dearer).get(course.prepared.precision.name)
    if dearer is None:
        return course.steps
    budget = margins.share * dearer * course.steps  # in steps of double precision
    if course.own is not None and not same_states(course.prepared):
        canonical = course.prepared.system.formulation.rounding is Rounding.MOMENTA
        if course.steps > (margins.canonical_steps if canonical else margins.all_steps):
            # windows, which nothing else can look at
            return max(margins.own_steps, budget / (NEIGHBOURS + 1))
    return _of_double(course, budget, margins)


def _of_double(course: Course, budget: float, margins: Margins) -> float:
    """Steps of the run that may be followed in double precision by code that is compiled for it."""
    passes = "x" in course.prepared.system.states and course.uneven > margins.uneven
    least = margins.passing_steps if passes else margins.all_steps
    more = 1.0 if same_states(course.prepared) else margins.charts
    return more * max(least, (budget - margins.unrolling) / margins.lane)


def _affordable_by_twin(course: Course, margins: Margins) -> float:
    """The part of a run in double precision that its twin in quaternions may follow."""
    return min(1.0, _of_double(course, margins.share * course.steps, margins) / course.steps)


def _follow(
    course: Course, part: float, tolerance: float, margins: Margins, go_on: Callable[[], bool]
) -> tuple[Followed, bool, bool]:
    """Follow a part of a run, and all of it where that is called for; whether it was followed tightly, and
    whether it was given up since the motion, followed loosely, isn't the run's any more.
    """
    start, steps, carried = course.start, course.steps, course.carried
    waypoints = _waypoints(course, part, margins) if part < 1 else []
    first = part * margins.beginning if waypoints else part
    neighbours = interruptible(lambda: neighbours_of(course, part, first, tolerance, margins))
    # what takes long to compile only where all isn't lost soon
    soon = OWN_FIRST / steps
    own = neighbours.lanes if isinstance(neighbours.lanes, OwnLanes) else None
    if own is not None and same_states(course.prepared) and first * steps > own.until:
        spread = neighbours.follow(course.at(soon), go_on, course.lost)
        while (
            soon * steps < own.until / 2
            and go_on()
            and not neighbours.all_lost(course.lost)
            and _suspicious(spread, start, carried, margins.most_power)
        ):
            soon += OWN_FIRST / steps
            neighbours.follow(course.at(soon), go_on, course.lost)
        if not neighbours.all_lost(course.lost):
            _prepare(neighbours, steps * (first - soon), course.at(first))
    on_course = _stay_on_course(course, neighbours, first, margins, go_on)
    spread = neighbours.follow(course.at(first), go_on, course.lost) if on_course else neighbours.spread
    seen: list[Spread] = []
    if first < 1 and spread.whole and on_course:
        power = margins.wary_power if steps < margins.wary_steps else margins.most_power
        whole = _suspicious(spread, start, carried, power)
        if not whole and waypoints:
            seen = _windows(course, neighbours, waypoints, part - first, go_on)
            beginnings = zip(seen, waypoints, strict=False)
            whole = any(
                _suspicious(s, waypoint.time, carried, margins.most_power) for s, waypoint in beginnings
            )
        for stage in (margins.stage / steps, 1.0) if whole else ():
            if first < stage <= 1 and not neighbours.all_lost(course.lost):
                _prepare(neighbours, steps * (stage - first), course.at(stage))
                on_course = on_course and _stay_on_course(course, neighbours, stage, margins, go_on)
                if on_course:
                    spread, first = neighbours.follow(course.at(stage), go_on, course.lost), stage
    tight = neighbours.tolerance <= TIGHT
    if first >= 1 or not seen or not on_course:
        reached = (spread.times[-1] - start) / (course.end - start) if spread.times else 0.0
        return Followed(spread, min(first, reached)), tight, not on_course
    length = (part - first) / len(waypoints) * (course.end - start)
    least = 1.0 if same_states(course.prepared) else margins.between_windows
    more = _more(spread, start + length, seen, least)
    return Followed(spread, first, len(seen), part - first, more), tight, False


def _stay_on_course(
    course: Course, neighbours: Neighbours, share: float, margins: Margins, go_on: Callable[[], bool]
) -> bool:
    """Follow a run loosely past its waypoints until a share of it; False as soon as it is another motion."""
    loosely = isinstance(neighbours.lanes, BatchLanes) and neighbours.tolerance == LOOSE
    if course.waypoints is None or not (loosely and same_states(course.prepared)):
        return True
    there = course.waypoints.between(0, share * course.steps)
    for waypoint in reversed(there[:: -margins.looks]):
        if waypoint.time <= neighbours.time:
            continue
        spread = neighbours.follow(waypoint.time, go_on, course.lost)
        if not spread.whole or neighbours.time < waypoint.time:
            break  # lost, or stopped
        grown = margins.safety * float(max(leading(spread, course.carried), default=0.0))
        own_error = float(course.prepared.precision.epsilon) * grown
        if neighbours.away_from(waypoint.state) > margins.strayed + own_error:
            return False
    return True


def _prepare(neighbours: Neighbours, steps: float, end: float) -> None:
    interruptible(lambda: neighbours.prepare_for(steps, end))


def _waypoints(course: Course, part: float, margins: Margins) -> list[Waypoint]:
    """Where windows begin; none if the neighbours' states differ from the run's."""
    system = course.prepared.system
    own = course.own is not None and part * course.steps < margins.most_own_steps
    if course.waypoints is None or system.stepwise or not (own or same_states(course.prepared)):
        return []
    there = course.waypoints.between(part * course.steps, course.steps)
    count = int(part * course.steps * (1 - margins.beginning) / margins.window)
    count = min(count, margins.windows, len(there))
    return [there[(2 * n + 1) * len(there) // (2 * count)] for n in range(count)]


def _windows(
    course: Course,
    neighbours: Neighbours,
    waypoints: list[Waypoint],
    share: float,
    go_on: Callable[[], bool],
) -> list[Spread]:
    """Errors that begin in each window; together the windows cover a share of the run."""
    length = share * (course.end - course.start) / len(waypoints)
    steps, seen = share * course.steps / len(waypoints), []
    for waypoint in waypoints:
        until = min(waypoint.time + length, course.end)
        window = neighbours.elsewhere(waypoint.state, waypoint.time, until, steps)
        seen.append(window.follow(until, go_on))
        if not seen[-1].whole:
            break
    return seen


def _more(beginning: Spread, until: float, windows: list[Spread], least: float) -> dict[str, float]:
    """``Followed.more``, at least ``least``; the beginning counts up to a time."""
    last = min(int(np.searchsorted(beginning.times, until)), len(beginning.times) - 1)
    found = {}
    for name in ("rates", "attitude", "position", "velocity"):
        known = max(getattr(beginning, name)[: last + 1])
        grown = [max(getattr(window, name), default=0.0) for window in windows]
        share = np.sqrt(np.mean(np.square(grown))) / known if known > 0 else 1.0
        found[name] = max(least, float(share))
    return found


def _suspicious(spread: Spread, start: float, carried: bool, power: float) -> bool:
    """Whether errors grow faster than a power of time, or the motion couldn't be followed."""
    if not (spread.whole and spread.times):
        return not spread.whole
    times, found = np.array(spread.times) - start, [leading(spread, carried)]
    if spread.extent > 0:
        found.append(np.array(spread.position))
    return any(power_of_time(times, errors) > power for errors in found)
