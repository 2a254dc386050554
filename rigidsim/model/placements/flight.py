"""Sources that the body flies by: a point at rest, a body of a kernel, one of the point masses.

Sizes follow from the Kepler orbit through the state at the start.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.orbits.point_mass_states import Pull
from rigidsim.model.placements.kernel_body import PlacedByKernel
from rigidsim.model.placements.placement import AmongMasses, Placement, SourcePlace
from rigidsim.model.rotations import Symbolic, length
from rigidsim.scene.arithmetic import Vector, cross, norm
from rigidsim.scene.kernels.reading import RelativeEphemeris
from rigidsim.scene.point_masses import GRAVITATIONAL_CONSTANT, closest
from rigidsim.scene.registry import Setting
from rigidsim.scene.scene import Scene


class FlownBy(Placement):
    """A source that the body flies by."""

    flies: ClassVar[bool] = True
    dynamic: ClassVar[bool] = True

    def away(self, m: Kinematics) -> list[Symbolic]:
        """Vector from it to the body, space axes, units of length."""
        raise NotImplementedError

    def seen(self, m: Kinematics) -> SourcePlace:
        offset, context = self.away(m), m.scene.context
        inverse = 1.0 / length(offset)
        unit = context.ldexp(context.one, m.scaling.length)
        return SourcePlace([x * inverse for x in offset], inverse, unit, outward=True)


@dataclass(frozen=True)
class FlownAbout(FlownBy):
    """A point at rest with a gravitational parameter (mpf, m^3/s^2); None if it doesn't attract the body."""

    gravitational_parameter: Any
    point: Vector  # m (mpf)
    rests = True

    def away(self, m: Kinematics) -> list[Symbolic]:
        return m.offset_from(self.point)

    def at_start(self, scene: Setting) -> Vector:
        return [a - x for x, a in zip(scene.position or [], self.point, strict=True)]

    def velocity(self, m: Kinematics) -> list[Symbolic]:
        return list(m.carried(m.velocity))

    def velocity_at_start(self, scene: Setting) -> Vector:
        return scene.velocity or []

    def nearest(self, scene: Setting) -> Any:
        place = [-x for x in self.at_start(scene)]
        if self.gravitational_parameter is None:
            return norm(scene.context, place)
        return closest(scene.context, place, scene.velocity or [], self.gravitational_parameter)[0]

    def fastest_rate(self, scene: Setting) -> Any:
        """At the closest approach; the most that the speed allows at the start without attraction."""
        if self.gravitational_parameter is None:
            return norm(scene.context, scene.velocity or []) / self.nearest(scene)
        momentum = norm(scene.context, cross(self.at_start(scene), scene.velocity or []))
        return momentum / self.nearest(scene) ** 2

    def flight_bounds(self, scene: Scene, fed: Any) -> tuple[Any, Any]:
        context, strength, horizon = scene.context, self.gravitational_parameter, scene.duration
        distance = norm(context, self.at_start(scene))
        energy = norm(context, scene.velocity or []) ** 2 / 2 - strength / distance  # over mass
        swiftest = context.sqrt(2 * abs(energy + strength / self.nearest(scene)))
        if energy < 0:
            farthest = strength / -energy  # twice the semi-major axis
            reach = min(farthest, distance + swiftest * horizon) + fed * horizon
            return norm(context, self.point) + reach, swiftest + fed
        return norm(context, scene.position or []) + (swiftest + fed) * horizon, swiftest + fed

    def pictured(self) -> dict[str, Any]:
        return {"position": [float(x) for x in self.point]}


@dataclass(frozen=True)
class FlownByKernel(FlownBy):
    """A body of a kernel; from the origin, which it accelerates as well, it is at ``origin``."""

    origin: PlacedByKernel
    wide = True

    @property
    def axes(self) -> str:  # type: ignore[override]
        return self.origin.axes

    @property
    def sights(self) -> tuple[tuple[RelativeEphemeris, int], ...]:  # type: ignore[override]
        return ((self.origin.sight, 1),)

    @property
    def falling(self) -> Placement | None:  # type: ignore[override]
        """None without a host: nothing accelerates the solar system's barycentre."""
        return self.origin if self.origin.sight.host else None

    def away(self, m: Kinematics) -> list[Symbolic]:
        context = m.scene.context
        unit = m.number(context.ldexp(self.origin.distance(context), -m.scaling.length))
        source = m.carried(m.sky).seen(self.origin.sight)
        return [x - unit * s for x, s in zip(m.carried(m.position), source, strict=True)]

    def velocity(self, m: Kinematics) -> list[Symbolic]:
        context, scaling = m.scene.context, m.scaling
        unit = m.number(context.ldexp(self.origin.distance(context), -scaling.time - scaling.speed))
        moving = m.carried(m.sky).seen(self.origin.sight, 1)
        return [v - unit * x for v, x in zip(m.carried(m.velocity), moving, strict=True)]

    def at_start(self, scene: Setting) -> Vector:
        return [s - x for x, s in zip(scene.position or [], self.origin.at_start(scene), strict=True)]

    def velocity_at_start(self, scene: Setting) -> Vector:
        moving = self.origin.ephemeris.place(scene.context, self.origin.sight, scene.start, 1)
        return [v - x for v, x in zip(scene.velocity or [], moving, strict=True)]

    def nearest(self, scene: Setting) -> Any:
        """Its distance at the start."""
        return norm(scene.context, self.at_start(scene))

    def fastest_rate(self, scene: Setting) -> Any:
        return self.origin.fastest_rate(scene)

    def pictured(self) -> dict[str, Any]:
        return self.origin.pictured()


@dataclass(frozen=True)
class FlownByMass(FlownBy, AmongMasses):
    """One of the point masses, none of which is the body."""

    def away(self, m: Kinematics) -> list[Symbolic]:
        there = m.carried(m.point_masses).positions[self.number]
        return [x - a for x, a in zip(m.carried(m.position), there, strict=True)]

    def velocity(self, m: Kinematics) -> list[Symbolic]:
        there = m.carried(m.point_masses).velocities[self.number]
        return [x - a for x, a in zip(m.carried(m.velocity), there, strict=True)]

    def at_start(self, scene: Setting) -> Vector:
        there = self.masses.positions[self.number]
        return [a - x for x, a in zip(scene.position or [], there, strict=True)]

    def velocity_at_start(self, scene: Setting) -> Vector:
        there = self.masses.velocities[self.number]
        return [x - a for x, a in zip(scene.velocity or [], there, strict=True)]

    def encounter(self, scene: Setting) -> tuple[Any, Any]:
        place, strength = [-x for x in self.at_start(scene)], self.masses.strengths[self.number]
        return closest(scene.context, place, self.velocity_at_start(scene), strength)

    def reaction(self, m: Kinematics, pull: list[Symbolic], sign: int) -> list[Pull]:
        own = m.scene.context.mpf(GRAVITATIONAL_CONSTANT) * m.carried(m.scene.body.mass)
        return [(self.number, -sign * own / self.masses.strengths[self.number], pull)]
