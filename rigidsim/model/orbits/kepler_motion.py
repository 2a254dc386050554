"""Place, velocity and acceleration on a prescribed Kepler orbit, whose node and periapsis may move.

In the plane of the orbit, in units of the semi-major axis,

    (c - e, b s),    (-s, b c) E',    -(n / r)^2 (c - e, b s) / r,

with c = cos E, s = sin E, b = sqrt(1 - e^2) and E' = n / r. Turns by angles that move uniformly follow by the
product rule. The same for expressions of the states and for numbers at the start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rigidsim.scene.arithmetic import cosine_and_sine
from rigidsim.scene.orbits import KeplerOrbit

Series = Sequence[Any]
"""A quantity and its first two derivatives; None for one that is zero for good."""


@dataclass(frozen=True)
class KeplerParts:
    """What the place on an orbit is made of.

    Attributes:
        motion: mean motion.
        anomaly: cosine and sine of the eccentric anomaly.
        inverse: semi-major axis over distance.
        periapsis, node: cosine, sine and rate of the angle; a rate of None if it rests.
        tilt: cosine and sine of the inclination.
    """

    eccentricity: Any
    root: Any  # sqrt(1 - e^2)
    motion: Any
    anomaly: tuple[Any, Any]
    inverse: Any
    periapsis: tuple[Any, Any, Any]
    node: tuple[Any, Any, Any]
    tilt: tuple[Any, Any]

    @classmethod
    def at(cls, orbit: KeplerOrbit, context: Any, time: Any) -> KeplerParts:
        """Those of a time in s; numbers are mpf, SI."""
        e, anomaly = orbit.eccentricity, orbit.eccentric_anomaly(context, time)

        def turned(angle: Any, rate: Any) -> tuple[Any, Any, Any]:
            there = angle + rate * time
            return *cosine_and_sine(context, there), None if rate == 0 else rate

        return cls(
            e,
            context.sqrt(1 - e * e),
            orbit.mean_motion,
            cosine_and_sine(context, anomaly),
            1 / (1 - e * context.cos(anomaly)),
            turned(orbit.periapsis, orbit.periapsis_rate),
            turned(orbit.ascending_node, orbit.node_rate),
            cosine_and_sine(context, orbit.inclination),
        )

    def motions(self) -> tuple[list[Any], list[Any], list[Any]]:
        """Place, velocity and acceleration, space axes, in units of the semi-major axis."""
        (c, s), pace = self.anomaly, self.motion * self.inverse
        along, across = c - self.eccentricity, self.root * s
        drawn = -(pace * pace * self.inverse)
        x: Series = [along, -(pace * s), drawn * along]
        y: Series = [across, self.root * (pace * c), drawn * across]
        x, y = _turned(x, y, *self.periapsis)
        tilted = [[None if a is None else factor * a for a in y] for factor in self.tilt]
        x, y = _turned(x, tilted[0], *self.node)
        zero = 0.0 * along
        places = [[zero if a is None else a for a in each] for each in (x, y, tilted[1])]
        return tuple(map(list, zip(*places, strict=True)))  # type: ignore[return-value]


def _turned(x: Series, y: Series, c: Any, s: Any, rate: Any) -> tuple[Series, Series]:
    """(c x - s y, s x + c y) for an angle of this rate."""
    cosine, sine = [c, None, None], [s, None, None]
    if rate is not None:
        cosine, sine = [c, -(rate * s), -(rate * rate * c)], [s, rate * c, -(rate * rate * s)]
    minus = [None if a is None else -a for a in sine]
    return _sum(_product(cosine, x), _product(minus, y)), _sum(_product(sine, x), _product(cosine, y))


def _product(a: Series, b: Series) -> Series:
    """By Leibniz' rule."""
    found = []
    for parts in (((1, 0, 0),), ((1, 1, 0), (1, 0, 1)), ((1, 2, 0), (2, 1, 1), (1, 0, 2))):
        terms = [
            a[i] * b[j] if factor == 1 else 2.0 * (a[i] * b[j])
            for factor, i, j in parts
            if a[i] is not None and b[j] is not None
        ]
        found.append(_added(terms))
    return found


def _sum(a: Series, b: Series) -> Series:
    return [_added([x for x in pair if x is not None]) for pair in zip(a, b, strict=True)]


def _added(terms: list[Any]) -> Any:
    if not terms:
        return None
    found = terms[0]
    for x in terms[1:]:
        found = found + x
    return found
