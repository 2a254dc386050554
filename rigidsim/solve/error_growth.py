"""Amplification of errors by a motion, measured on its beginning with nearby motions.

The round-off law (see ``rigidsim.accuracy.error_law``) holds for motions whose errors grow with time as a
change of frequency does. Near an unstable axis, or in chaos, they grow exponentially for a while, and a
summary that knew only the law would promise digits that aren't there.
"""

import math
from dataclasses import dataclass

import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.precision import Precision
from rigidsim.solve.switching.stepper import stepper_of

PILOT_STEPS = 2000
_CHUNK = 4  # steps between comparisons
_LAUNCHES = 16
_WINDOW = 64  # comparisons after each launch
_OFFSET = 2.0**-30  # of the scaled states: far above rounding, far below the motion
_SEEN = 2.0**-24  # distances between which an offset that saturates shows how fast it grew
_SATURATED = 2.0**-7
"""Distance, relative to the motion's size, past which an offset grows no more, so that the growth is a lower
bound.
"""
_STABLE = 4.0
"""Factor up to which stable motions appear to grow, since an offset is no pure change of frequency."""
_DOUBLING = math.log(
    2.0
)  # growth of a linear law from half a window to a whole one, measured as 0.69 +- 0.03
_EXPONENTIAL = _DOUBLING + 1.0
_LARGEST_EXPONENT = 600.0  # keeps products within doubles


@dataclass(frozen=True)
class Growth:
    """Measured growth of errors.

    Attributes:
        factor: largest growth of an offset in rates and attitude, over the linear growth |w| t / sqrt 3
            of a stable motion; 1 where it is no larger than a few times that.
    """

    factor: float
    seconds: float
    rate: float  # rate of exponential growth beyond each comparison's window, 1/s; zero for linear growth
    window: float
    saturated: bool = False  # ``factor`` is a lower bound: an offset became as large as the motion
    passing_rate: float = 0.0

    def at(self, seconds: float) -> float:
        """Amplification over a run of ``seconds``."""
        exponent = self.rate * max(0.0, seconds - self.window)
        return self.factor * math.exp(min(exponent, _LARGEST_EXPONENT))


def measure_growth(system: System, precision: Precision, start: float, end: float) -> Growth:
    """Compare the motion with motions that leave it by a tiny offset at several times: errors made far from
    an unstable axis grow during the next passage near it. The precision should be double: stability has none.
    """
    apart = ("x", "y", "z", "vx", "vy", "vz", "pace")
    followed = [i for i, name in enumerate(system.states) if name not in apart]
    reference = stepper_of(system, precision, None, precision.scalar(start))
    marks = [reference.mark()]
    while reference.steps < PILOT_STEPS and float(reference.time) < end and reference.skip(_CHUNK):
        marks.append(reference.mark())
    times = [float(mark.time[0]) for mark in marks]
    rate = math.ldexp(float(system.rate_bound), system.scaling.time)
    generator = np.random.default_rng(0)  # the same offsets each time
    other = stepper_of(system, precision, None, precision.scalar(start))
    largest, slopes, window = 0.0, [], 0.0
    passing: list[float] = []
    for launch in np.linspace(0, max(len(marks) - 2, 0), _LAUNCHES).astype(int):
        offset = np.zeros(len(system.states))
        offset[followed] = generator.standard_normal(len(followed))
        offset *= _OFFSET / np.linalg.norm(offset)
        other.back_to(marks[launch])
        other.state[:] = marks[launch].state + offset
        other.settle()
        grown: list[float] = []
        for look in range(launch + 1, min(launch + 1 + _WINDOW, len(marks))):
            if not other.to(times[look]):
                break
            distance = float(np.linalg.norm((other.state - marks[look].state)[followed]))
            linear = max(1.0, rate * (times[look] - times[launch]) / math.sqrt(3))
            largest = max(largest, distance / _OFFSET / linear)
            grown.append(distance)
        passing += _passing_rate(times[launch + 1 : launch + 1 + len(grown)], grown)
        half = len(grown) // 2
        if half >= _WINDOW // 4 and min(max(grown[:half]), max(grown[half:])) > 0:
            span = times[launch + 2 * half] - times[launch + half]
            slopes.append((math.log(max(grown[half:]) / max(grown[:half])), span))
            window = max(window, times[launch + 2 * half] - times[launch])
    unit = math.ldexp(1.0, system.scaling.time)
    slope, span = sorted(slopes)[len(slopes) // 2] if slopes else (0.0, 1.0)
    exponential = slope > _EXPONENTIAL
    return Growth(
        factor=largest if largest > _STABLE else 1.0,
        seconds=(min(times[-1], end) - start) * unit,
        rate=(slope - _DOUBLING) / span / unit if exponential else 0.0,
        window=window * unit,
        saturated=bool(passing),
        passing_rate=sorted(passing)[len(passing) // 2] / unit if passing else 0.0,
    )


def _passing_rate(times: list[float], grown: list[float]) -> list[float]:
    """Growth rate of an offset that saturated, in a list; empty for others."""
    if not grown or max(grown) < _SATURATED:
        return []
    late = next(i for i, distance in enumerate(grown) if distance >= _SATURATED)
    early = next(i for i, distance in enumerate(grown) if distance >= _SEEN)
    if late == early:
        return [0.0]
    return [math.log(grown[late] / grown[early]) / (times[late] - times[early])]
