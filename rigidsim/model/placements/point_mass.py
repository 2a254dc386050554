"""One of ``[[bodies]]`` as a source."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.orbit_planes import OrbitPlane
from rigidsim.model.orbits.point_mass_states import PointMassPair, Pull
from rigidsim.model.placements.placement import Circuit, Placement, SourceMotion, SourcePlace
from rigidsim.model.rotations import Symbolic, unit
from rigidsim.scene.arithmetic import Vector, cross
from rigidsim.scene.point_masses import PointMasses
from rigidsim.scene.registry import Setting
from rigidsim.scene.scene import Scene

_UNROLLED = 2
_ALMOST_PARABOLIC = 0.99  # a larger eccentricity's harmonics, of which a few thousand are told, hardly differ


@dataclass(frozen=True)
class AmongMasses(Placement):
    """One of the point masses."""

    masses: PointMasses
    number: int  # its index among them
    dynamic: ClassVar[bool] = True

    @property
    def name(self) -> str:  # type: ignore[override]
        return self.masses.names[self.number]

    @property
    def wide(self) -> bool:  # type: ignore[override]
        """Whether there are three or more masses, whose equations take ten seconds to compile unrolled."""
        return len(self.masses.names) > _UNROLLED

    @property
    def plane(self) -> OrbitPlane:  # type: ignore[override]
        return OrbitPlane(
            lambda m: unit(cross(self.away(m), self.velocity(m))),
            lambda scene: cross([-x for x in self.at_start(scene)], self.velocity_at_start(scene)),
            "osculating plane of the source's orbit", "normal of the osculating orbit",
            rate=lambda scene: self.encounter(scene)[1],
        )  # fmt: skip

    def among(self, masses: PointMasses) -> Placement:
        return replace(self, masses=masses)

    def away(self, m: Kinematics) -> list[Symbolic]:
        """Vector from it to the body, space axes, units of length."""
        raise NotImplementedError

    def encounter(self, scene: Setting) -> tuple[Any, Any]:
        """Least distance (m), and the angular rate there (rad/s), of body and mass left to themselves."""
        raise NotImplementedError

    def nearest(self, scene: Setting) -> Any:
        return self.encounter(scene)[0]

    def fastest_rate(self, scene: Setting) -> Any:
        return self.encounter(scene)[1]


@dataclass(frozen=True)
class PlacedAsMass(AmongMasses):
    """A point mass seen from the one that the body is; averages judge it by its osculating orbit."""

    untracked = ""
    moves: ClassVar[bool] = True

    @property
    def pair(self) -> PointMassPair:
        """It, and the one that the body is."""
        return PointMassPair(self.masses, self.number)

    @property
    def without_elements(self) -> tuple[str, str]:  # type: ignore[override]
        against = f'the orbit of the point mass "{self.name}" is integrated, so that there is no '
        remedy = 'choose "spin_averaged", or write the elements of the orbit into a table '
        return against + "ellipse to average over", remedy + '(orbit = {table = "elements.csv"})'

    def distance(self, context: Any) -> Any:
        """Semi-major axis at the start, or the least distance of one that isn't bound."""
        ellipse = self.pair.ellipse(context)
        return self.pair.encounter(context)[0] if ellipse is None else ellipse[0]

    def encounter(self, scene: Setting) -> tuple[Any, Any]:
        return self.pair.encounter(scene.context)

    def away(self, m: Kinematics) -> list[Symbolic]:
        return m.carried(m.point_masses).between(self.number, self.pair.host)

    def seen(self, m: Kinematics) -> SourcePlace:
        states, host = m.carried(m.point_masses), self.pair.host
        inverse = states.inverse_distances[min(host, self.number), max(host, self.number)]
        context = m.scene.context
        line = [x * inverse for x in states.between(host, self.number)]
        return SourcePlace(line, inverse, context.ldexp(context.one, m.scaling.length))

    def at_start(self, scene: Setting) -> Vector:
        return self.pair.place

    def motion(self, m: Kinematics) -> SourceMotion:
        """Under the mutual gravity of all as points."""
        found, place = m.carried(m.point_masses).relative(self.pair.host, self.number), self.seen(m)
        return SourceMotion(*found, place.inverse, place.unit)

    def motion_at_start(self, scene: Scene) -> tuple[Vector, Vector, Vector]:
        return self.masses.relative(self.pair.host, self.number, scene.context)

    def velocity(self, m: Kinematics) -> list[Symbolic]:
        velocities = m.carried(m.point_masses).velocities
        return [a - b for a, b in zip(velocities[self.pair.host], velocities[self.number], strict=True)]

    def velocity_at_start(self, scene: Setting) -> Vector:
        velocities = self.masses.velocities
        return [a - b for a, b in zip(velocities[self.pair.host], velocities[self.number], strict=True)]

    def reaction(self, m: Kinematics, pull: list[Symbolic], sign: int) -> list[Pull]:
        one, ratio = (
            m.scene.context.one,
            self.masses.strengths[self.pair.host] / self.masses.strengths[self.number],
        )
        return [(self.pair.host, sign * one, pull), (self.number, -sign * ratio, pull)]

    def circuit(self, context: Any) -> Circuit:
        least, rate = self.pair.encounter(context)
        if (ellipse := self.pair.ellipse(context)) is None:
            return Circuit(passing_rate=float(rate))
        # what the others do to axis and eccentricity is of the size of their share in the acceleration
        perturbed, (axis, e, motion) = self.pair.perturbation(context), ellipse
        closer = float(least / axis) * max(1 - 2 * perturbed, 0.5)
        e = min(e + 2 * perturbed, _ALMOST_PARABOLIC)
        doubt = perturbed * motion
        return Circuit(motion, e, closer**-3, doubt, doubt, float(rate))
