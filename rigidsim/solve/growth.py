"""How strongly a motion amplifies errors, measured on its beginning by nearby motions.

The round-off law (see ``rigidsim.summary``) holds for motions whose errors grow with time as a change of
frequency does. Near an unstable axis, or in chaos, they grow exponentially for a while, and a summary that
knew only the law would promise digits that aren't there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.precision import Precision
from rigidsim.solve.stepper import Mark, Stepper

PILOT_STEPS = 2000
_CHUNK = 4  # steps between comparisons
_LAUNCHES = 16
_WINDOW = 64  # comparisons after each launch
_LONG_WINDOW = 256  # where growth looks exponential
_OFFSET = 2.0**-30  # of the scaled states: far above rounding, far below the motion
_TOO_FAR = 2.0**-12
"""Distance from which an offset is brought back to its size, so that growth is measured without an end: an
offset of the size of the motion grows no more."""
_STABLE = 4.0
"""Stable motions show up to about this, since an offset is no pure change of frequency."""
_DOUBLING = math.log(
    2.0
)  # growth of a linear law from half a window to a whole one, measured as 0.69 +- 0.03
_EXPONENTIAL = _DOUBLING + 1.0
_LARGEST_EXPONENT = 600.0  # keeps products within doubles


@dataclass(frozen=True)
class Growth:
    """Result of the pilot.

    Attributes:
        factor: largest growth of an offset in rates and attitude, over the linear growth |w| t / sqrt 3 of
            a stable motion; 1 where it is no larger than a few times that.
        seconds: how much of the motion was looked at.
        rate: of exponential growth beyond each comparison's window, 1/s; zero where growth is linear.
        window: length of a comparison, seconds.
    """

    factor: float
    seconds: float
    rate: float
    window: float

    def at(self, seconds: float) -> float:
        """Amplification over a run of this length."""
        exponent = self.rate * max(0.0, seconds - self.window)
        return self.factor * math.exp(min(exponent, _LARGEST_EXPONENT))


def measure_growth(system: System, precision: Precision, start: float, end: float) -> Growth:
    """Compare the motion with motions that leave it by a tiny offset at several times.

    Errors made far from an unstable axis grow during the next passage near it, so a comparison from the
    start alone would not do.

    Args:
        system: built for ``precision``, which should be double: stability has no precision.
        start, end: of the run, internal units.
    """
    followed = [
        i for i, name in enumerate(system.states) if name not in ("x", "y", "z", "vx", "vy", "vz", "pace")
    ]
    reference = Stepper(system, precision, None, precision.scalar(start))
    marks = [reference.mark()]
    while reference.steps < PILOT_STEPS and float(reference.time) < end and reference.skip(_CHUNK):
        marks.append(reference.mark())
    times = [float(mark.time[0]) for mark in marks]
    other = Stepper(system, precision, None, precision.scalar(start))
    rate = math.ldexp(float(system.rate_bound), system.scaling.time)
    found = _compare(marks, other, followed, rate, _WINDOW)
    if found.slope > _EXPONENTIAL:  # a window no longer than one passage near an unstable axis looks so too
        longer = _compare(marks, other, followed, rate, _LONG_WINDOW)
        if longer.span > 0:
            found = replace(longer, largest=max(found.largest, longer.largest))
    unit = math.ldexp(1.0, system.scaling.time)
    exponential = found.slope > _EXPONENTIAL
    return Growth(
        factor=found.largest if found.largest > _STABLE else 1.0,
        seconds=(min(times[-1], end) - start) * unit,
        rate=(found.slope - _DOUBLING) / found.span / unit if exponential else 0.0,
        window=found.window * unit,
    )


@dataclass(frozen=True)
class _Found:
    """What nearby motions did, internal units.

    Attributes:
        largest: growth of an offset over the linear one.
        slope: median growth (logarithm) from half a window to a whole one, over ``span``; zero for none.
        window: the longest.
    """

    largest: float
    slope: float
    span: float
    window: float


def _compare(marks: list[Mark], other: Stepper, followed: list[int], rate: float, looks: int) -> _Found:
    """Launch motions next to the reference's marks and look how far they go from it."""
    times = [float(mark.time[0]) for mark in marks]
    generator = np.random.default_rng(0)  # the same offsets each time
    largest, slopes, window = 0.0, [], 0.0
    for launch in np.linspace(0, max(len(marks) - 2, 0), _LAUNCHES).astype(int):
        offset = np.zeros(len(marks[0].state))
        offset[followed] = generator.standard_normal(len(followed))
        offset *= _OFFSET / np.linalg.norm(offset)
        other.back_to(marks[launch])
        other.state[:] = marks[launch].state + offset
        grown: list[float] = []
        brought_back = 1.0
        for look in range(launch + 1, min(launch + 1 + looks, len(marks))):
            if not other.to(times[look]):
                break
            apart = other.state - marks[look].state
            near = float(np.linalg.norm(apart[followed]))
            distance = near * brought_back
            linear = max(1.0, rate * (times[look] - times[launch]) / math.sqrt(3))
            largest = max(largest, distance / _OFFSET / linear)
            grown.append(distance)
            if near > _TOO_FAR:
                other.state[:] = marks[look].state + apart * (_OFFSET / near)
                brought_back *= near / _OFFSET
        half = len(grown) // 2
        if half >= looks // 4 and min(max(grown[:half]), max(grown[half:])) > 0:
            span = times[launch + 2 * half] - times[launch + half]
            slopes.append((math.log(max(grown[half:]) / max(grown[:half])), span))
            window = max(window, times[launch + 2 * half] - times[launch])
    slope, span = sorted(slopes)[len(slopes) // 2] if slopes else (0.0, 0.0)
    return _Found(largest, slope, span, window)
