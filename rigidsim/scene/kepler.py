"""From orbital elements to a place, over any arithmetic: mpmath numbers, numpy arrays, heyoka expressions.

Classical elements give unit vectors P towards the pericentre and T across it, in the direction of motion, so
that the place is a ((cos E - e) P + sqrt(1 - e^2) sin E T) (Murray & Dermott 1999, section 2.8). Elements
without singularities are in ``rigidsim.scene.orbit_tables``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import Field

from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.exact import ZERO
from rigidsim.scene.fields import Angle, ConfigTable, Eccentricity, Metre, Positive

Pair = tuple[Any, Any]
"""Cosine and sine of an angle."""


class Ellipse(ConfigTable):
    """Keys of a Kepler orbit, whose elements are classical ones in space axes."""

    semi_major_axis: Positive[Metre] | None = Field(None, examples=["7000 km"])
    """semi-major axis of the ellipse"""
    eccentricity: Eccentricity = ZERO
    """0 to below 1"""
    inclination: Angle = Field(ZERO, examples=["51.6 deg"])
    """inclination to the XY plane of the space axes"""
    ascending_node: Angle = ZERO
    """longitude of the ascending node from X, at time 0"""
    periapsis: Angle = ZERO
    """argument of periapsis from the ascending node, at time 0"""
    mean_anomaly: Angle = ZERO
    """mean anomaly at time 0"""


def plane_vectors(tilt: Pair, node: Pair, periapsis: Pair) -> tuple[Vector, Vector]:
    """P and T of an orbit of this inclination, ascending node, and argument of periapsis."""
    ci, si = tilt
    cn, sn = node
    return turned(([cn, sn, 0 * cn], [-(sn * ci), cn * ci, si]), periapsis)


def turned(axes: tuple[Vector, Vector], turn: Pair) -> tuple[Vector, Vector]:
    """Two unit vectors rotated within their plane by an angle."""
    (first, second), (c, s) = axes, turn
    along = [c * x + s * y for x, y in zip(first, second, strict=True)]
    return along, [c * y - s * x for x, y in zip(first, second, strict=True)]


def combined(axes: tuple[Vector, Vector], x: Any, y: Any) -> Vector:
    """x P + y T."""
    return [x * p + y * t for p, t in zip(*axes, strict=True)]


def eccentric_anomalies(mean: np.ndarray, e: Any) -> np.ndarray:
    """Solutions E of Kepler's equation M = E - e sin E in double precision, for arrays; see
    ``rigidsim.scene.arithmetic.eccentric_anomaly`` for single numbers of any precision.
    """
    anomaly = mean + e * np.sin(mean)
    for _ in range(60):  # Newton's method; from E = M + e sin M it converges for any e < 1
        step = (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
        anomaly = anomaly - np.clip(step, -0.5, 0.5)
    return anomaly


def regular_place(functions: Any, elements: tuple[Any, ...], longitude: Pair, inverse: Any = 1.0) -> Vector:
    """The place, in units of the semi-major axis, times a factor, from the eccentric longitude and regular
    elements k, h, q, p.
    """
    (k, h, q, p), (c, s) = elements, longitude
    beta = 1.0 / (1.0 + functions.sqrt(1.0 - k * k - h * h))
    x = ((1.0 - h * h * beta) * c + h * k * beta * s - k) * inverse
    y = ((1.0 - k * k * beta) * s + h * k * beta * c - h) * inverse
    chi = functions.sqrt(1.0 - p * p - q * q)
    cross = 2.0 * (p * q)
    return [
        (1.0 - 2.0 * (p * p)) * x + cross * y,
        cross * x + (1.0 - 2.0 * (q * q)) * y,
        2.0 * (chi * (q * y - p * x)),
    ]
