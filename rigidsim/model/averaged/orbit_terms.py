"""The torque of a source averaged over its Kepler orbit, and the terms removed, to first order.

With k = 3 (G M / a^3) (excess / L) the direction s of the momentum changes as

    s' = k (a/r)^3 (s . r) (r x s) = k (Q s) x s,   Q = (a/r)^3 r r^T,

whose mean over the mean anomaly is (1 - e^2)^(-3/2) (1 - n n^T) / 2 for a normal n, so that

    s' = -(k/2) (1 - e^2)^(-3/2) (n . s) (n x s)

(Ward 1974; Laskar & Robutel 1993). What is left has the integral J over time, without a mean: with the true
anomaly f, the mean anomaly M, P and T the unit vectors to pericentre and across, since (a/r)^3 dM =
(1 - e^2)^(-3/2) (1 + e cos f) df,

    2 n J (1 - e^2)^(3/2) = (f - M + e sin f) (P P^T + T T^T) + S (P P^T - T T^T) + C (P T^T + T P^T),
    S = sin(2 f) / 2 + e sin(f) / 2 + e sin(3 f) / 6,
    C = -cos(2 f) / 2 - e cos(f) / 2 - e cos(3 f) / 6, less its mean,

with <cos k f> = (-b)^k (1 + k sqrt(1 - e^2)), b = e / (1 + sqrt(1 - e^2)). The nutation with the orbit's
period is k (J s) x s then, and s is the mean direction (the first order of Kinoshita 1977).

To second order the mean turns by <DF u> besides, with F what is left of s' and u the nutation. Both have
potentials, h = k s . (Q - <Q>) s / 2 and H = k s . J s / 2 with s' = grad h x s, so that it is grad K x s,

    K = <s . (grad h x grad H)> / 2 = (k^2 / 4) z (c0 (x^2 - y^2) + c1 (x^2 + y^2)),

x, y, z being the parts of s along P, T and n, c0 = <(a/r)^3 C> and c1 = <(a/r)^3 cos(2 f) C> over
n (1 - e^2)^(3/2): c1 = -(1/4 + e^2/6) (1 - e^2)^(-3) / n. For the Earth and the Sun it is 6e-6 of the
precession.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rigidsim.scene.arithmetic import Vector, cross, dot
from rigidsim.scene.orbits import KeplerOrbit

_POINTS = 4096


class Functions(Protocol):
    """Elementary functions of numbers or of expressions."""

    def cos(self, x: Any) -> Any:
        """Cosine."""

    def sin(self, x: Any) -> Any:
        """Sine."""

    def atan2(self, y: Any, x: Any) -> Any:
        """Angle of the point (x, y)."""


@dataclass(frozen=True)
class OrbitPlace:
    """Position on an orbit by the eccentric anomaly and the unit vectors P and T, numbers or expressions."""

    cosine: Any
    sine: Any
    pericentre: Vector
    across: Vector


@dataclass(frozen=True)
class Ellipse:
    """Shape (e, e^2, sqrt(1 - e^2), whether e is known to be 0) and mean motion; numbers (mpf) or
    expressions.
    """

    eccentricity: Any
    square: Any
    root: Any
    motion: Any
    circular: bool

    @classmethod
    def of(cls, context: Any, orbit: KeplerOrbit) -> Ellipse:
        """The ellipse of an orbit with constant elements (mpf, rad/s)."""
        e = orbit.eccentricity
        return cls(e, e * e, context.sqrt(1 - e * e), orbit.mean_motion, orbit.circular)

    @property
    def secular_factor(self) -> Any:
        """Factor (1 - e^2)^(-3/2) / 2 of the secular torque."""
        return 1 / (2 * (1 - self.square) * self.root)

    @property
    def across(self) -> Any:
        """-n c1, the second-order coefficient of the module's formula."""
        rest = 1 - self.square
        return (0.25 + self.square / 6) / (rest * rest * rest)


def second_order(eccentricity: float) -> tuple[float, float]:
    """n c0 and n c1 (see ``Ellipse.across``), by the trapezoidal rule over the eccentric anomaly."""
    e, root = eccentricity, math.sqrt(1 - eccentricity**2)
    anomaly = 2 * np.pi * np.arange(_POINTS) / _POINTS
    radius = 1 - e * np.cos(anomaly)
    c, s = (np.cos(anomaly) - e) / radius, root * np.sin(anomaly) / radius
    f = np.arctan2(s, c)
    weight = radius / _POINTS  # dM
    across = -np.cos(2 * f) / 2 - e * np.cos(f) / 2 - e * np.cos(3 * f) / 6
    across = (across - (weight * across).sum()) / root**3
    found = [(weight * radius**-3.0 * x * across).sum() for x in (np.ones_like(f), np.cos(2 * f))]
    return float(found[0]), float(found[1])


def nutation(
    functions: Functions, ellipse: Ellipse, place: OrbitPlace, size: Any, s: Vector, number: Any
) -> Vector:
    """Nutation k (J s) x s for a size k / (2 n) (1 - e^2)^(-3/2); ``number`` makes the ellipse's values
    factors.
    """
    e, root = ellipse.eccentricity, ellipse.root
    b = e / (1 + root)
    mean = -_cosines(lambda k: (-b) ** k * (1 + k * root), e)
    c, sn = place.cosine, place.sine
    # the true minus the eccentric anomaly, then the true anomaly
    ahead = 0 if ellipse.circular else 2 * functions.atan2(number(b) * sn, 1 - number(b) * c)
    inverse = 1 if ellipse.circular else 1 / (1 - number(e) * c)
    cf = c if ellipse.circular else (c - number(e)) * inverse
    sf = sn if ellipse.circular else number(root) * sn * inverse
    c2, s2 = cf * cf - sf * sf, 2 * sf * cf
    odd, even = 0.5 * s2, -(0.5 * c2) - number(mean)
    equation = None
    if not ellipse.circular:
        c3, s3 = c2 * cf - s2 * sf, s2 * cf + c2 * sf
        odd = odd + number(e / 2) * sf + number(e / 6) * s3
        even = even - number(e / 2) * cf - number(e / 6) * c3
        # f - M + e sin f
        equation = ahead + number(e) * sn + number(e) * sf
    along, beside = dot(place.pericentre, s), dot(place.across, s)
    first = odd * along + even * beside
    second = even * along - odd * beside
    if equation is not None:
        first, second = first + equation * along, second + equation * beside
    tensor = [first * p + second * t for p, t in zip(place.pericentre, place.across, strict=True)]
    return [size * x for x in cross(tensor, s)]


def _cosines(mean: Any, e: Any) -> Any:
    """cos(2 f) / 2 + e cos(f) / 2 + e cos(3 f) / 6 for means of cos(k f)."""
    return mean(2) / 2 + e * mean(1) / 2 + e * mean(3) / 6


def plane_vectors(
    tilt: tuple[Any, Any], node: tuple[Any, Any], periapsis: tuple[Any, Any]
) -> tuple[Vector, Vector]:
    """P and T of an orbit from cosine and sine of its inclination, node and periapsis."""
    ci, si = tilt
    cn, sn = node
    cw, sw = periapsis
    first = [cn, sn, 0 * cn]
    second = [-(sn * ci), cn * ci, si]
    return turned((first, second), (cw, sw))


def equinoctial_axes(q: Any, p: Any, chi: Any) -> tuple[Vector, Vector]:
    """Unit vectors in the orbit's plane, from which longitudes count and across, from the elements q and p
    (see ``rigidsim.scene.orbit_tables.pieces``) and chi = sqrt(1 - p^2 - q^2).
    """
    product = 2 * p * q
    return [1 - 2 * p * p, product, -2 * p * chi], [product, 1 - 2 * q * q, 2 * q * chi]


def turned(axes: tuple[Vector, Vector], turn: tuple[Any, Any]) -> tuple[Vector, Vector]:
    """Two unit vectors rotated within their plane by an angle given as cosine and sine."""
    (first, second), (c, s) = axes, turn
    along = [c * x + s * y for x, y in zip(first, second, strict=True)]
    return along, [c * y - s * x for x, y in zip(first, second, strict=True)]
