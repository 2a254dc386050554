"""Growth of errors by the slow motion of a body's axis, whose e-folding time is a good part of the run's
length: longer than the beginning of a run, or windows, can tell from growth in proportion to time.

The run's average over the rotation and the orbits carries them alike, and takes few steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rigidsim.accuracy.estimates.course import Course
from rigidsim.accuracy.estimates.growth import power_of_time
from rigidsim.accuracy.models.carrying import carrying
from rigidsim.accuracy.models.side_by_side import Unmeasured
from rigidsim.errors import ConfigError
from rigidsim.model.averaged.sources import sources_of
from rigidsim.scene.arithmetic import apply, norm

_LEAST_FOLDS = 4.0
"""e-foldings within the run that make constant errors grow with a power of time of 2.5 over its last three
quarters: (e^x - 1) / (e^(x/4) - 1) = 4^2.5.
"""
_SMALL = 1e-100  # rad/s: errors that stay small however they grow


def power_of_slow_motion(course: Course, go_on: Callable[[], bool]) -> float:
    """Power of time with which the run's slow motion makes errors of the axis grow over the last three
    quarters of the run, if they are made all the time; 0 where they can't grow exponentially, or there is no
    average over the orbits to tell.
    """
    if course.prepared.system.stepwise or _most_folds(course) < _LEAST_FOLDS:
        return 0.0
    try:
        found = carrying(course.prepared, None, go_on)
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
    orbit = sources[0].orbit if len(sources) == 1 else None
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
