"""Points of work against precision, the curves through them, and what an error costs on them."""

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import mpmath

STEPWISE = ("rigidsim, accuracy asked for",)
"""Ways whose settings change the method or the precision: nothing lies between two of their points."""


@dataclass
class Point:
    """One setting of one peer on one scene.

    Attributes:
        seconds: CPU of the integration, one per process.
        error: angle to the reference at the end, rad.
    """

    peer: str
    title: str
    scene: str
    end: float
    knob: float
    error: float
    seconds: list[float] = field(default_factory=list)

    @property
    def cost(self) -> float:
        """Median CPU seconds of the integration."""
        return statistics.median(self.seconds)


def angle(quaternion: Sequence[float], reference: Sequence[Any]) -> float:
    """Rotation between two attitudes, rad; neither need be normalised."""
    with mpmath.workdps(50):
        a = [mpmath.mpf(q) for q in quaternion]
        b = [mpmath.mpf(q) for q in reference]
        scalar = mpmath.fsum(x * y for x, y in zip(a, b, strict=True))
        products = [a[i] * b[j] - a[j] * b[i] for i in range(4) for j in range(i)]
        return float(2 * mpmath.atan2(mpmath.sqrt(mpmath.fsum(p * p for p in products)), abs(scalar)))


def cost_at(points: Sequence[Point], error: float) -> float | None:
    """CPU seconds for an error, by the cheapest of the settings that reach it.

    On each curve (points of one title, by error) the logarithm of the cost is interpolated between the two
    settings around the error, but for ``STEPWISE`` ways; past its end no curve is extended, neither to fewer
    digits nor to more. None if no setting reaches the error.
    """
    found = []
    for title in {p.title for p in points}:
        curve = frontier([p for p in points if p.title == title])
        if not curve or curve[-1].error > error:
            continue
        after = next(n for n, p in enumerate(curve) if p.error <= error)
        second = curve[after]
        if after == 0 or second.error == 0 or title in STEPWISE:
            found.append(second.cost)
            continue
        first = curve[after - 1]
        part = math.log(error / first.error) / math.log(second.error / first.error)
        found.append(first.cost * (second.cost / first.cost) ** part)
    return min(found, default=None)


def frontier(points: Sequence[Point]) -> list[Point]:
    """Those that none beats in both cost and error, from cheap to accurate."""
    kept: list[Point] = []
    for point in sorted(points, key=lambda p: (p.cost, p.error)):
        if math.isfinite(point.error) and (not kept or point.error < kept[-1].error):
            kept.append(point)
    return kept
