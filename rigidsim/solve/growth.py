"""How strongly a motion amplifies errors, measured on its beginning by nearby motions.

The round-off law (see ``rigidsim.summary``) holds for motions whose errors grow with time as a change of
frequency does. Near an unstable axis, or in chaos, they grow exponentially for a while, and a summary that
knew only the law would promise digits that aren't there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.precision import Precision
from rigidsim.solve.stepper import Stepper

PILOT_STEPS = 2000
_CHUNK = 4  # steps between comparisons
_LAUNCHES = 16
_WINDOW = 64  # comparisons after each launch
_OFFSET = 2.0**-30  # of the scaled states: far above rounding, far below the motion
_STABLE = 4.0
"""Stable motions show up to about this, since an offset is no pure change of frequency."""


@dataclass(frozen=True)
class Growth:
    """Result of the pilot.

    Attributes:
        factor: largest growth of an offset in rates and attitude, over the linear growth |w| t / sqrt 3 of
            a stable motion; 1 where it is no larger than a few times that.
        seconds: how much of the motion was looked at.
    """

    factor: float
    seconds: float


def measure_growth(system: System, precision: Precision, start: float, end: float) -> Growth:
    """Compare the motion with motions that leave it by a tiny offset at several times.

    Errors made far from an unstable axis grow during the next passage near it, so a comparison from the
    start alone would not do.

    Args:
        system: built for ``precision``, which should be double: stability has no precision.
        start, end: of the run, internal units.
    """
    followed = [i for i, name in enumerate(system.states) if name not in ("x", "y", "z", "vx", "vy", "vz")]
    reference = Stepper(system, precision, None, precision.scalar(start))
    marks = [reference.mark()]
    while reference.steps < PILOT_STEPS and float(reference.time) < end and reference.skip(_CHUNK):
        marks.append(reference.mark())
    times = [float(mark.time[0]) for mark in marks]
    rate = math.ldexp(float(system.rate_bound), system.scaling.time)
    generator = np.random.default_rng(0)  # the same offsets each time
    other = Stepper(system, precision, None, precision.scalar(start))
    largest = 0.0
    for launch in np.linspace(0, max(len(marks) - 2, 0), _LAUNCHES).astype(int):
        offset = np.zeros(len(system.states))
        offset[followed] = generator.standard_normal(len(followed))
        offset *= _OFFSET / np.linalg.norm(offset)
        other.back_to(marks[launch], 0)
        other.state[:] = marks[launch].state + offset
        for look in range(launch + 1, min(launch + 1 + _WINDOW, len(marks))):
            if not other.to(times[look]):
                break
            distance = float(np.linalg.norm((other.state - marks[look].state)[followed]))
            linear = max(1.0, rate * (times[look] - times[launch]) / math.sqrt(3))
            largest = max(largest, distance / _OFFSET / linear)
    seconds = math.ldexp(min(times[-1], end) - start, system.scaling.time)
    return Growth(largest if largest > _STABLE else 1.0, seconds)
