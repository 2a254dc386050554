"""How far a run's neighbours are followed, and with which integrator, within a limited cost.

A run of some ten thousand steps is followed to its end. Of a longer one the beginning is, and windows that
are spread over the rest; where errors grow in any of them by more than time makes them, the whole run is
followed after all.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rigidsim.accuracy.estimates.course import Course, Followed
from rigidsim.accuracy.estimates.growth import power_of_time
from rigidsim.accuracy.estimates.margins import Margins
from rigidsim.solve.building import interruptible
from rigidsim.solve.neighbours.lanes import (
    NEIGHBOURS,
    OWN_FIRST,
    OWN_UNTIL,
    TIGHT,
    TOLERANCE,
    BatchLanes,
    Lanes,
    OwnLanes,
    SeriesErrors,
    StepperLanes,
    borrowed,
)
from rigidsim.solve.neighbours.pushed import Neighbours, Pushes, Spread
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import InitialValueProblem, double_twin
from rigidsim.solve.trail import Waypoint


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
    found, tight = _follow(course, part, TOLERANCE, margins, go_on)
    if found.windows and found.spread.whole and not _same_states(course.prepared) and go_on():
        # what sets in between windows, or shows in none: quaternions follow it, which lose less than momenta
        twin = _follow(course, _affordable_by_twin(course, margins), TOLERANCE, margins, go_on)
        spread = twin[0].spread
        if _suspicious(spread, course.start, course.carried, margins.most_power):
            found, tight = twin
    spread, steps = found.spread, course.steps
    far = spread.whole and not tight and steps < margins.tight_steps and bool(spread.times)
    far = far and margins.drifted < max(leading(spread, course.carried)) < margins.gone * course.lost
    if far and go_on() and _suspicious(spread, course.start, course.carried, margins.most_power):
        found, _ = _follow(course, 1.0, TIGHT, margins, go_on)
    return found


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
    if course.own is not None and not _same_states(course.prepared):
        canonical = course.prepared.system.requirements.formulation == "canonical"
        if course.steps > (margins.canonical_steps if canonical else margins.all_steps):
            # windows, which nothing else can look at
            return max(margins.own_steps, budget / (NEIGHBOURS + 1))
    return _of_double(course, budget, margins)


def _of_double(course: Course, budget: float, margins: Margins) -> float:
    """Steps of the run that may be followed in double precision by code that is compiled for it."""
    passes = "x" in course.prepared.system.states and course.uneven > margins.uneven
    least = margins.passing_steps if passes else margins.all_steps
    more = 1.0 if _same_states(course.prepared) else margins.charts
    return more * max(least, (budget - margins.unrolling) / margins.lane)


def _affordable_by_twin(course: Course, margins: Margins) -> float:
    """The part of a run in double precision that its twin in quaternions may follow."""
    return min(1.0, _of_double(course, margins.share * course.steps, margins) / course.steps)


def _follow(
    course: Course, part: float, tolerance: float, margins: Margins, go_on: Callable[[], bool]
) -> tuple[Followed, bool]:
    """Follow a part of a run, and all of it if necessary; also returns whether it was followed tightly."""
    start, steps, carried = course.start, course.steps, course.carried
    waypoints = _waypoints(course, part, margins) if part < 1 else []
    first = part * margins.beginning if waypoints else part
    neighbours = interruptible(lambda: _neighbours(course, part, first, tolerance, margins))
    # what takes long to compile only where all isn't lost soon
    soon = OWN_FIRST / steps
    if isinstance(neighbours.lanes, OwnLanes) and _same_states(course.prepared) and first * steps > OWN_UNTIL:
        spread = neighbours.follow(course.at(soon), go_on, course.lost)
        while (
            soon * steps < OWN_UNTIL / 2
            and go_on()
            and not neighbours.all_lost(course.lost)
            and _suspicious(spread, start, carried, margins.most_power)
        ):
            soon += OWN_FIRST / steps
            neighbours.follow(course.at(soon), go_on, course.lost)
        if not neighbours.all_lost(course.lost):
            _prepare(neighbours, steps * (first - soon), course.at(first))
    spread = neighbours.follow(course.at(first), go_on, course.lost)
    seen: list[Spread] = []
    if first < 1 and spread.whole:
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
                spread, first = neighbours.follow(course.at(stage), go_on, course.lost), stage
    tight = neighbours.tolerance <= TIGHT
    if first >= 1 or not seen:
        reached = (spread.times[-1] - start) / (course.end - start) if spread.times else 0.0
        return Followed(spread, min(first, reached)), tight
    length = (part - first) / len(waypoints) * (course.end - start)
    least = 1.0 if _same_states(course.prepared) else margins.between_windows
    more = _more(spread, start + length, seen, least)
    return Followed(spread, first, len(seen), part - first, more), tight


def _prepare(neighbours: Neighbours, steps: float, end: float) -> None:
    interruptible(lambda: neighbours.prepare_for(steps, end))


def _waypoints(course: Course, part: float, margins: Margins) -> list[Waypoint]:
    """Where windows begin; none if the neighbours' states differ from the run's."""
    system = course.prepared.system
    own = course.own is not None and part * course.steps < margins.most_own_steps
    if course.waypoints is None or system.stepwise or not (own or _same_states(course.prepared)):
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


# --- what carries them -----------------------------------------------------------------------------------


def _same_states(prepared: InitialValueProblem) -> bool:
    """Whether neighbours have the run's states, which they do unless a loose tolerance would run into
    singularities of these.
    """
    return prepared.system.requirements.formulation not in ("euler_angles", "canonical")


def _by_itself(course: Course, part: float, tolerance: float, margins: Margins) -> bool:
    """Whether the run's own integrator carries its neighbours, at least at first."""
    if tolerance <= TIGHT or (part < 1 and not _same_states(course.prepared)):
        return course.steps * part < margins.most_own_steps
    if course.prepared.system.requirements.formulation == "canonical":
        return course.steps * part <= margins.canonical_steps
    return _same_states(course.prepared) or course.steps * part < OWN_UNTIL


def _neighbours(course: Course, part: float, first: float, tolerance: float, margins: Margins) -> Neighbours:
    """Neighbours at the start of a run.

    Args:
        part, first: parts of the run to be followed, in all and from its start on.
    """
    steps = course.steps * part
    prepared, own = course.prepared, course.own
    precision, system = prepared.precision, prepared.system
    series: SeriesErrors | None = None
    stand_in = False
    follows = tolerance > TIGHT or not loose(prepared)  # it is as loose as the run
    if own is not None and own.careful:
        lanes: Lanes = StepperLanes(system, course.start, course.end, course.steps, own)
    elif own is not None and follows and _by_itself(course, part, tolerance, margins):
        lanes = OwnLanes(system, own.integrator, loose=_same_states(prepared))
        series = (
            SeriesErrors(system, prepared.effective_tolerance, own.integrator) if loose(prepared) else None
        )
    else:
        same = _same_states(prepared)
        system = system.rounded(precision_of("double").number) if same else double_twin(prepared)
        stand_in = not same and prepared.system.partner is None
        if system.stepwise:
            lanes = StepperLanes(system, course.start, course.end, course.steps)
        else:
            lanes = BatchLanes(system, steps, tolerance)
        if loose(prepared) and not system.stepwise:
            series = SeriesErrors(system, prepared.effective_tolerance)
    rounded = np.array([precision.exact(precision.number(x)) != x for x in system.initial])
    pushes = _pushes(course, stand_in, margins)
    return Neighbours(
        system,
        lanes,
        course.start,
        course.at(first),
        course.steps * first,
        pushes,
        float(precision.epsilon),
        rounded,
        series,
    )


def loose(prepared: InitialValueProblem) -> bool:
    """Whether the tolerance allows larger step errors than rounding causes."""
    return prepared.effective_tolerance > 2 * float(prepared.precision.epsilon)


def _pushes(course: Course, stand_in: bool, margins: Margins) -> Pushes:
    """Errors of a step.

    Args:
        stand_in: whether quaternions take the place of the run's states.
    """
    prepared = course.prepared
    plain, formulation = Pushes(), prepared.system.requirements.formulation
    if prepared.system.stepwise and loose(prepared):
        plain = replace(
            plain, own=margins.cut_off * prepared.effective_tolerance / float(prepared.precision.epsilon)
        )
    if formulation not in ("euler_angles", "canonical"):
        return plain
    angles = replace(plain, own=plain.own * margins.angles, series=margins.angle_series)
    if formulation == "euler_angles":
        return angles
    # momenta: the nearer the singularity, the more do they lose in passing it
    more = min(max(margins.near / max(course.nearest, 1e-150), 1.0), margins.angles)
    more *= max(1.0, min(margins.very_near / max(course.nearest, 1e-150), 10.0))
    carried = replace(angles, own=plain.own * more)
    if not stand_in:
        return carried
    return replace(carried, shared=plain.own * _condition(course), series=margins.momentum_series)


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
