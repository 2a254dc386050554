"""Sources of averaged torques: on Kepler or tabulated orbits, at fixed positions, from an ephemeris, or point
masses beside the body.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from rigidsim.model.averaged.orbit_terms import Ellipse, OrbitPlace, place_by_elements
from rigidsim.model.load import Load
from rigidsim.model.loads.attraction import Attraction
from rigidsim.scene.arithmetic import Vector, eccentric_anomaly, norm
from rigidsim.scene.kepler import eccentric_anomalies, plane_vectors
from rigidsim.scene.orbit_tables.pieces import AXIS
from rigidsim.scene.scene import Scene


@dataclass(frozen=True)
class Source:
    """The source of one gravity gradient; a point mass is judged by its osculating orbit of the start."""

    number: int  # position of its ``[[loads]]`` table, from 1
    of: Attraction
    strength: Any  # 3 G M / a^3 (mpf, 1/s^2), a being ``Placement.distance``
    # as in ``Circuit``:
    motion: float = 0.0
    eccentricity: float = 0.0
    nearest: float = 1.0
    slow_rate: float = 0.0
    uncertainty: float = 0.0
    passing_rate: float | None = None

    @classmethod
    def at_start(cls, context: Any, number: int, source: Attraction) -> Self:
        """The source as it moves at the start."""
        size = 3 * source.gravitational_parameter / source.placement.distance(context) ** 3
        return cls(number, source, size, **vars(source.placement.circuit(context)))

    @property
    def name(self) -> str:
        """What messages call it."""
        name = self.of.placement.name
        return f'number {self.number} ("{name}")' if name else f"number {self.number}"

    @property
    def has_elements(self) -> bool:
        """Whether the source has an orbit to average over."""
        return self.of.orbit is not None or self.of.table is not None

    @property
    def harmonics(self) -> np.ndarray:
        """Sizes (Frobenius norms) of the harmonics k >= 0 of (a/r)^3 r r^T in the mean motion."""
        if self.motion == 0:
            return np.ones(1)
        e, points = self.eccentricity, 512 if self.eccentricity < 0.6 else 4096
        anomaly = eccentric_anomalies(2 * np.pi * np.arange(points) / points, e)
        x, y = np.cos(anomaly) - e, math.sqrt(1 - e * e) * np.sin(anomaly)
        place = np.array([x, y])
        parts = np.fft.fft(place[:, None] * place[None, :] * (x * x + y * y) ** -2.5) / points
        return np.asarray(np.linalg.norm(parts, axis=(0, 1))[: points // 2])

    def strength_at(self, context: Any, time: Any) -> Any:
        """3 G M / a^3 (mpf, 1/s^2) at a time."""
        if self.of.table is None:
            return self.strength
        axis = self.of.table.at(time)[AXIS] / self.of.table.semi_major_axis
        return self.strength if axis == 1 else self.strength / axis**3

    def ellipse(self, context: Any, time: Any) -> Ellipse:
        """Shape and mean motion of the source's orbit at a time, numbers (mpf)."""
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

    def pull_at_start(self, scene: Scene) -> np.ndarray | None:
        """(a/r)^3 r r^T, (3, 3), where the run begins; None for a series of time."""
        placement, context, time = self.of.placement, scene.context, scene.start
        if placement.of_time:
            return None
        if not self.has_elements:
            place = placement.at_start(scene)
            length = norm(context, place)
            direction = np.array([float(x / length) for x in place])
            return np.outer(direction, direction) * float(placement.distance(context) / length) ** 3
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
    found = [(number, load.gradient_source) for number, load in enumerate(loads, start=1)]
    return [Source.at_start(scene.context, n, source) for n, source in found if source is not None]


def unit(context: Any, vector: Vector) -> Vector:
    """The vector divided by its length."""
    length = norm(context, vector)
    return [x / length for x in vector]
