"""Sources of averaged torques: on Kepler or tabulated orbits, at fixed positions, from an ephemeris, or point
masses beside the body.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from rigidsim.model.averaged.orbit_terms import Ellipse, OrbitPlace, place_by_elements, plane_vectors
from rigidsim.model.averaged.spectrum import orbit_harmonics
from rigidsim.model.capabilities import gradient_source_of
from rigidsim.model.gradient import GradientSource
from rigidsim.model.load import Load
from rigidsim.scene.arithmetic import Vector, eccentric_anomaly, norm
from rigidsim.scene.orbit_tables.pieces import AXIS
from rigidsim.scene.scene import Scene

_DAY = 86400.0
_ALMOST_PARABOLIC = 0.99  # a larger eccentricity's harmonics, of which a few thousand are told, hardly differ
_SERIES = {"sun": (365.25636, 0.0167), "moon": (27.32166, 0.0549)}
"""Sidereal period (days) and eccentricity, used to judge whether averages over the Earth's spin apply."""


@dataclass(frozen=True)
class Source:
    """The source of one gravity gradient; a point mass is judged by its osculating orbit of the start."""

    number: int  # position of its ``[[loads]]`` table, from 1
    of: GradientSource
    strength: Any  # 3 G M / a^3 (mpf, 1/s^2), a being ``GradientSource.distance``
    motion: float = 0.0  # mean motion, rad/s; 0 at rest, or for a point mass that isn't bound to the body
    eccentricity: float = 0.0  # of its orbit, the largest in a table
    nearest: float = 1.0  # (a/r)^3 at the closest approach
    slow_rate: float = 0.0  # bound of the rate of node and periapsis together, rad/s; for a mass an estimate
    uncertainty: float = 0.0  # of a point mass's mean motion, rad/s
    passing_rate: float | None = None  # of a point mass: angular rate at the closest approach, rad/s

    @classmethod
    def at_start(cls, context: Any, number: int, source: GradientSource) -> Self:
        """The source as it moves at the start."""
        given = number, source, 3 * source.gravitational_parameter / source.distance(context) ** 3
        if (pair := source.pair) is not None:
            least, rate = pair.encounter(context)
            if (ellipse := pair.ellipse(context)) is None:
                return cls(*given, passing_rate=float(rate))
            # what the others do to axis and eccentricity is of the size of their share in the acceleration
            perturbed, (axis, e, motion) = pair.perturbation(context), ellipse
            closer = float(least / axis) * max(1 - 2 * perturbed, 0.5)
            e = min(e + 2 * perturbed, _ALMOST_PARABOLIC)
            doubt = perturbed * motion
            return cls(*given, motion, e, closer**-3, doubt, doubt, float(rate))
        if source.ephemeris is not None:
            days, e = _SERIES[source.ephemeris]
            return cls(*given, 2 * math.pi / (days * _DAY), e, (1 - e) ** -3)
        if (table := source.table) is not None:
            slow = float(table.normal_drift + table.shape_drift)
            nearest = float(table.semi_major_axis / table.pericentre) ** 3
            return cls(*given, float(table.mean_motion), float(table.largest_eccentricity), nearest, slow)
        if (orbit := source.orbit) is None:
            return cls(*given)
        e = float(orbit.eccentricity)
        slow = abs(float(orbit.node_rate)) + abs(float(orbit.periapsis_rate))
        return cls(*given, abs(float(orbit.mean_motion)), e, (1 - e) ** -3, slow)

    @property
    def name(self) -> str:
        """What messages call it."""
        return (
            f"number {self.number}"
            if self.of.pair is None
            else f'number {self.number} ("{self.of.pair.name}")'
        )

    @property
    def has_elements(self) -> bool:
        """Whether the source has an orbit to average over."""
        return self.of.orbit is not None or self.of.table is not None

    @property
    def harmonics(self) -> np.ndarray:
        """Sizes of the harmonics of (a/r)^3 r r^T in the mean motion, the mean first."""
        return np.ones(1) if self.motion == 0 else orbit_harmonics(self.eccentricity)

    def strength_at(self, context: Any, time: Any) -> Any:
        """3 G M / a^3 (mpf, 1/s^2) at a time."""
        if self.of.table is None:
            return self.strength
        axis = self.of.table.at(time)[AXIS] / self.of.table.semi_major_axis
        return self.strength if axis == 1 else self.strength / axis**3

    def ellipse(self, context: Any, time: Any) -> Ellipse:
        """MassDistribution and mean motion of the source's orbit at a time, numbers (mpf)."""
        if self.of.table is not None:
            found = self.of.table.at(time)
            square = found["k"] ** 2 + found["h"] ** 2
            root = context.sqrt(1 - square)
            return Ellipse(context.sqrt(square), square, root, self.of.table.motion(found[AXIS]), False)
        assert self.of.orbit is not None
        return Ellipse.of(context, self.of.orbit)

    def secular_strength(self, context: Any) -> Any:
        """3 G M / (2 a^3) (1 - e^2)^(-3/2) (mpf, 1/s^2) of an orbit, the largest in a table."""
        if self.of.table is not None:
            rest = 1 - self.of.table.largest_eccentricity**2
            size = self.strength * (self.of.table.semi_major_axis / self.of.table.smallest_axis) ** 3
            return size / (2 * rest * context.sqrt(rest))
        assert self.of.orbit is not None
        return self.strength * Ellipse.of(context, self.of.orbit).secular_factor

    def normal(self, context: Any, time: Any) -> Vector:
        """Unit normal of the orbit's plane, space axes; at time zero if the node moves uniformly."""
        if self.of.table is not None:
            return self.of.table.normal(time)
        assert self.of.orbit is not None
        return self.of.orbit.normal(context)

    def place(self, context: Any, time: Any) -> OrbitPlace:
        """Position on the orbit at a time, numbers (mpf)."""
        if self.of.table is not None:
            found = self.of.table.at(time)
            ellipse, longitude = self.ellipse(context, time), self.of.table.starting_longitude(time)
            periapsis = context.atan2(found["h"], found["k"])
            anomaly = eccentric_anomaly(context, longitude - periapsis, ellipse.eccentricity)
            return place_by_elements(context, found, anomaly, periapsis)
        orbit = self.of.orbit
        assert orbit is not None
        anomaly = orbit.eccentric_anomaly(context, time)
        angles = (
            orbit.inclination,
            orbit.ascending_node + orbit.node_rate * time,
            orbit.periapsis + orbit.periapsis_rate * time,
        )
        tilt, node, periapsis = ((context.cos(x), context.sin(x)) for x in angles)
        return OrbitPlace(context.cos(anomaly), context.sin(anomaly), *plane_vectors(tilt, node, periapsis))

    def pull(self, context: Any, time: Any) -> np.ndarray | None:
        """(a/r)^3 r r^T, (3, 3), at a time (a point mass: at the start); None for an ephemeris."""
        place = self.of.position if self.of.pair is None else self.of.pair.place
        if place is not None:
            length = norm(context, place)
            direction = np.array([float(x / length) for x in place])
            return np.outer(direction, direction) * float(self.of.distance(context) / length) ** 3
        if not self.has_elements:
            return None
        e, at = float(self.ellipse(context, time).eccentricity), self.place(context, time)
        c, s = float(at.cosine), float(at.sine)
        x, y = c - e, math.sqrt(1 - e * e) * s
        radius = math.hypot(x, y)
        along, across = (np.array(vector, dtype=float) for vector in (at.pericentre, at.across))
        direction = (x * along + y * across) / radius
        scale = float(self.strength_at(context, time) / self.strength)
        return np.outer(direction, direction) * scale / radius**3


def sources_of(scene: Scene, loads: Sequence[Load]) -> list[Source]:
    """Sources of all gravity gradients of a scene, with their strengths."""
    found = [(number, gradient_source_of(load)) for number, load in enumerate(loads, start=1)]
    return [Source.at_start(scene.context, n, source) for n, source in found if source is not None]


def unit(context: Any, vector: Vector) -> Vector:
    """The vector divided by its length."""
    length = norm(context, vector)
    return [x / length for x in vector]
