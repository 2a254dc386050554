"""Sources of averaged torques: on Kepler or tabulated orbits, at fixed positions, from an ephemeris, or point
masses beside the body.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigidsim.model.averaged.orbit_terms import (
    Ellipse,
    OrbitPlace,
    equinoctial_axes,
    plane_vectors,
    turned,
)
from rigidsim.model.averaged.spectrum import orbit_harmonics
from rigidsim.model.capabilities import gradient_source_of
from rigidsim.model.gradient import GradientSource
from rigidsim.model.load import Load
from rigidsim.model.orbits.point_mass_states import PointMassPair
from rigidsim.scene.arithmetic import Vector, eccentric_anomaly, norm
from rigidsim.scene.orbit_tables.pieces import AXIS, TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene

_DAY = 86400.0
_ALMOST_PARABOLIC = 0.99  # a larger eccentricity's harmonics, of which a few thousand are told, hardly differ
_SERIES = {"sun": (365.25636, 0.0167), "moon": (27.32166, 0.0549)}
"""Sidereal period (days) and eccentricity, used to judge whether averages over the Earth's spin apply."""


@dataclass(frozen=True)
class Osculating:
    """Motion of a point mass as seen from the body, from the osculating orbit of the start."""

    motion: float  # mean motion, rad/s; 0 if it isn't bound to the body
    eccentricity: float  # 0 if it isn't
    perturbed: float  # accelerations of the relative motion by the other masses over the mutual one
    nearest: float  # (a/r)^3 at the closest approach
    passing_rate: float  # angular rate there, rad/s

    @classmethod
    def of(cls, context: Any, pair: PointMassPair) -> Osculating:
        """That of a pair at the start."""
        least, rate = pair.encounter(context)
        perturbed = pair.perturbation(context)
        if (axis := pair.semi_major_axis(context)) is None:
            return cls(0.0, 0.0, perturbed, 1.0, float(rate))
        # what the others do to axis and eccentricity is of the size of their share in the acceleration
        closer = float(least / axis) * max(1 - 2 * perturbed, 0.5)
        e = min(pair.eccentricity(context) + 2 * perturbed, _ALMOST_PARABOLIC)
        return cls(pair.mean_motion(context), e, perturbed, closer**-3, float(rate))


@dataclass(frozen=True)
class Source:
    """The source of one gravity gradient."""

    number: int  # position of its ``[[loads]]`` table, from 1
    of: GradientSource
    strength: Any  # 3 G M / a^3 (mpf, 1/s^2), a being ``GradientSource.distance``
    osculating: Osculating | None = None

    @property
    def orbit(self) -> KeplerOrbit | None:
        """Kepler orbit on which the source moves, or None."""
        return self.of.orbit

    @property
    def table(self) -> TabulatedOrbit | None:
        """Table that gives the source's orbit, or None."""
        return self.of.table

    @property
    def pair(self) -> PointMassPair | None:
        """Point mass that the source is, and the one that the body is, or None."""
        return self.of.pair

    @property
    def name(self) -> str:
        """What messages call it."""
        return f"number {self.number}" if self.pair is None else f'number {self.number} ("{self.pair.name}")'

    @property
    def has_elements(self) -> bool:
        """Whether the source has an orbit to average over."""
        return self.orbit is not None or self.table is not None

    @property
    def motion(self) -> float:
        """Mean motion, rad/s; 0 for a source at rest, or a point mass that passes by."""
        if self.osculating is not None:
            return self.osculating.motion
        if self.of.ephemeris is not None:
            return 2 * math.pi / (_SERIES[self.of.ephemeris][0] * _DAY)
        if self.table is not None:
            return float(self.table.mean_motion)
        return 0.0 if self.orbit is None else abs(float(self.orbit.mean_motion))

    @property
    def eccentricity(self) -> float:
        """Eccentricity of the source's orbit, the largest in a table; 0 for a source at rest."""
        if self.osculating is not None:
            return self.osculating.eccentricity
        if self.of.ephemeris is not None:
            return _SERIES[self.of.ephemeris][1]
        if self.table is not None:
            return float(self.table.largest_eccentricity)
        return 0.0 if self.orbit is None else float(self.orbit.eccentricity)

    @property
    def slow_rate(self) -> float:
        """Bound of the rate of node and periapsis together, rad/s; an estimate for a point mass."""
        if self.osculating is not None:
            return self.uncertainty
        if self.table is not None:
            return float(self.table.normal_drift + self.table.shape_drift)
        if self.orbit is None:
            return 0.0
        return abs(float(self.orbit.node_rate)) + abs(float(self.orbit.periapsis_rate))

    @property
    def uncertainty(self) -> float:
        """Error (rad/s) of the mean motion of a point mass, which is taken from its osculating orbit."""
        return 0.0 if self.osculating is None else self.osculating.perturbed * self.osculating.motion

    @property
    def harmonics(self) -> np.ndarray:
        """Sizes of the harmonics of (a/r)^3 r r^T in the mean motion, the mean first."""
        return np.ones(1) if self.motion == 0 else orbit_harmonics(self.eccentricity)

    @property
    def nearest(self) -> float:
        """(a/r)^3 at the closest approach."""
        if self.osculating is not None:
            return self.osculating.nearest
        if self.table is not None:
            return float(self.table.semi_major_axis / self.table.pericentre) ** 3
        return float((1 - self.eccentricity) ** -3)

    def strength_at(self, context: Any, time: Any) -> Any:
        """3 G M / a^3 (mpf, 1/s^2) at a time."""
        if self.table is None:
            return self.strength
        axis = self.table.at(time)[AXIS] / self.table.semi_major_axis
        return self.strength if axis == 1 else self.strength / axis**3

    def ellipse(self, context: Any, time: Any) -> Ellipse:
        """Shape and mean motion of the source's orbit at a time, numbers (mpf)."""
        if self.table is not None:
            found = self.table.at(time)
            square = found["k"] ** 2 + found["h"] ** 2
            root = context.sqrt(1 - square)
            return Ellipse(context.sqrt(square), square, root, self.table.motion(found[AXIS]), False)
        assert self.orbit is not None
        return Ellipse.of(context, self.orbit)

    def secular_strength(self, context: Any) -> Any:
        """3 G M / (2 a^3) (1 - e^2)^(-3/2) (mpf, 1/s^2) of an orbit, the largest in a table."""
        if self.table is not None:
            rest = 1 - self.table.largest_eccentricity**2
            size = self.strength * (self.table.semi_major_axis / self.table.smallest_axis) ** 3
            return size / (2 * rest * context.sqrt(rest))
        assert self.orbit is not None
        return self.strength * Ellipse.of(context, self.orbit).secular_factor

    def normal(self, context: Any, time: Any) -> Vector:
        """Unit normal of the orbit's plane, space axes; at time zero if the node moves uniformly."""
        if self.table is not None:
            return self.table.normal(time)
        assert self.orbit is not None
        return self.orbit.normal(context)

    def place(self, context: Any, time: Any) -> OrbitPlace:
        """Position on the orbit at a time, numbers (mpf)."""
        if self.table is not None:
            return self._place_by_table(context, self.table, time)
        orbit = self.orbit
        assert orbit is not None
        anomaly = orbit.eccentric_anomaly(context, time)
        angles = (
            orbit.inclination,
            orbit.ascending_node + orbit.node_rate * time,
            orbit.periapsis + orbit.periapsis_rate * time,
        )
        tilt, node, periapsis = ((context.cos(x), context.sin(x)) for x in angles)
        return OrbitPlace(context.cos(anomaly), context.sin(anomaly), *plane_vectors(tilt, node, periapsis))

    @staticmethod
    def _place_by_table(context: Any, table: TabulatedOrbit, time: Any) -> OrbitPlace:
        found = table.at(time)
        k, h = found["k"], found["h"]
        e, periapsis = context.sqrt(k * k + h * h), context.atan2(h, k)
        anomaly = eccentric_anomaly(context, table.starting_longitude(time) - periapsis, e)
        axes = equinoctial_axes(found["q"], found["p"], context.sqrt(1 - found["q"] ** 2 - found["p"] ** 2))
        turn = context.cos(periapsis), context.sin(periapsis)
        return OrbitPlace(context.cos(anomaly), context.sin(anomaly), *turned(axes, turn))

    def pull(self, context: Any, time: Any) -> np.ndarray | None:
        """(a/r)^3 r r^T, (3, 3), at a time (a point mass: at the start); None for an ephemeris."""
        if self.pair is not None:
            length = norm(context, self.pair.place)
            direction = np.array([float(x / length) for x in self.pair.place])
            return np.outer(direction, direction) * float(self.of.distance(context) / length) ** 3
        if self.of.position is not None:
            length = norm(context, self.of.position)
            direction = np.array([float(x / length) for x in self.of.position])
            return np.outer(direction, direction)
        if not self.has_elements:
            return None
        e, at = float(self.ellipse(context, time).eccentricity), self.place(context, time)
        c, s = float(at.cosine), float(at.sine)
        x, y = c - e, math.sqrt(1 - e * e) * s
        radius = math.hypot(x, y)
        along, across = (np.array([float(v) for v in vector]) for vector in (at.pericentre, at.across))
        direction = (x * along + y * across) / radius
        scale = float(self.strength_at(context, time) / self.strength)
        return np.outer(direction, direction) * scale / radius**3


def sources_of(scene: Scene, loads: Sequence[Load]) -> list[Source]:
    """Sources of all gravity gradients of a scene, with their strengths."""
    context, found = scene.context, []
    for number, load in enumerate(loads, start=1):
        source = gradient_source_of(load)
        if source is not None:
            strength = 3 * source.gravitational_parameter / source.distance(context) ** 3
            seen = None if source.pair is None else Osculating.of(context, source.pair)
            found.append(Source(number, source, strength, seen))
    return found


def unit(context: Any, vector: Vector) -> Vector:
    """The vector divided by its length."""
    length = norm(context, vector)
    return [x / length for x in vector]
