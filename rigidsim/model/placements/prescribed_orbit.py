"""Sources at rest, on Kepler orbits, and on tabulated ones."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.orbits.kepler_motion import KeplerParts
from rigidsim.model.placements.placement import Circuit, Placement, SourceMotion, SourcePlace
from rigidsim.scene.arithmetic import Vector, norm
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.registry import Setting
from rigidsim.scene.scene import Scene


@dataclass(frozen=True)
class PlacedAtRest(Placement):
    """A source that never moves."""

    position: Vector  # m (mpf)
    rests = True
    untracked = ""

    def distance(self, context: Any) -> Any:
        return norm(context, self.position)

    def _direction(self, context: Any) -> Vector:
        length = norm(context, self.position)
        return [x / length for x in self.position]

    def seen(self, m: Kinematics) -> SourcePlace:
        context = m.scene.context
        return SourcePlace(m.fixed(self._direction(context)), hy.expression(1.0), self.distance(context))

    def at_start(self, scene: Setting) -> Vector:
        return self.position

    def motion(self, m: Kinematics) -> SourceMotion:
        place, zero = self.seen(m), [hy.expression(0.0)] * 3
        return SourceMotion(place.line, zero, zero, place.inverse, place.unit)

    def motion_at_start(self, scene: Scene) -> tuple[Vector, Vector, Vector]:
        return self.position, [scene.context.zero] * 3, [scene.context.zero] * 3

    def circuit(self, context: Any) -> Circuit:
        return Circuit()

    def pictured(self) -> dict[str, Any]:
        return {"position": [float(x) for x in self.position]}


@dataclass(frozen=True)
class PlacedOnOrbit(Placement):
    """A source on a prescribed Kepler orbit."""

    orbit: KeplerOrbit
    untracked = ""

    def distance(self, context: Any) -> Any:
        return self.orbit.semi_major_axis

    def nearest(self, scene: Setting) -> Any:
        return self.orbit.pericentre

    def seen(self, m: Kinematics) -> SourcePlace:
        place = m.orbit(self.orbit)
        inverse = hy.expression(1.0) if self.orbit.circular else place.inverse_distance
        return SourcePlace(place.direction, inverse, self.orbit.semi_major_axis)

    def at_start(self, scene: Setting) -> Vector:
        return self.orbit.place(scene.context, scene.start)

    def motion(self, m: Kinematics) -> SourceMotion:
        states = m.orbit(self.orbit)
        assert states.parts is not None
        return SourceMotion(*states.parts.motions(), states.inverse_distance, self.orbit.semi_major_axis)

    def motion_at_start(self, scene: Scene) -> tuple[Vector, Vector, Vector]:
        axis, found = self.orbit.semi_major_axis, KeplerParts.at(self.orbit, scene.context, scene.start)
        place, velocity, acceleration = ([axis * x for x in vector] for vector in found.motions())
        return place, velocity, acceleration

    def circuit(self, context: Any) -> Circuit:
        orbit, e = self.orbit, float(self.orbit.eccentricity)
        slow = abs(float(orbit.node_rate)) + abs(float(orbit.periapsis_rate))
        return Circuit(abs(float(orbit.mean_motion)), e, (1 - e) ** -3, slow)

    def fastest_rate(self, scene: Setting) -> Any:
        return self.orbit.fastest_rate(scene.context)

    def pictured(self) -> dict[str, Any]:
        names = [field.name for field in dataclasses.fields(self.orbit)]
        return {"orbit": {name: float(getattr(self.orbit, name)) for name in names}}


@dataclass(frozen=True)
class PlacedByTable(Placement):
    """A source on a tabulated orbit."""

    table: TabulatedOrbit
    untracked = "its orbit goes by a table, of whose elements no rates are carried"

    def distance(self, context: Any) -> Any:
        return self.table.semi_major_axis

    def nearest(self, scene: Setting) -> Any:
        return self.table.pericentre

    def seen(self, m: Kinematics) -> SourcePlace:
        place = m.table(self.table)
        return SourcePlace(place.direction, place.inverse_distance, self.table.semi_major_axis)

    def at_start(self, scene: Setting) -> Vector:
        return self.table.place(scene.start)

    def circuit(self, context: Any) -> Circuit:
        table = self.table
        slow = float(table.normal_drift + table.shape_drift)
        nearest = float(table.semi_major_axis / table.pericentre) ** 3
        return Circuit(float(table.mean_motion), float(table.largest_eccentricity), nearest, slow)

    def fastest_rate(self, scene: Setting) -> Any:
        return self.table.fastest_rate()
