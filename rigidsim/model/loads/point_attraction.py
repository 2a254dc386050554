"""Attraction of the body by a point, to second degree (MacCullagh), and by one that moves besides the body:

U = -G M m / r - (G M / 2 r^3) (tr I - 3 c . I c),   c = R^T r/|r| from the point to the body.

A moving one is what a ``gravity_gradient`` or ``central_gravity`` with ``orbit = {body = ..}`` becomes. Where
the body itself is one of the point masses, their mutual gravity includes its attraction as a point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import heyoka as hy

from rigidsim.model.gradient import GradientSource, gradient_terms, tidal_range
from rigidsim.model.kinematics import Kinematics, inertia_times, quadratic_form
from rigidsim.model.load import Load, SourcePlace, Term
from rigidsim.model.orbit_planes import OrbitPlane
from rigidsim.model.orbits.point_mass_states import PointMassPair
from rigidsim.model.placements.kernel_body import kernel_body
from rigidsim.model.placements.point_mass import PlacedAsMass
from rigidsim.model.rotations import Symbolic, apply, length, transpose, unit
from rigidsim.scene.arithmetic import Vector, cross, unit_vectors
from rigidsim.scene.kernels.series import exactly
from rigidsim.scene.point_masses import GRAVITATIONAL_CONSTANT, PointMasses, closest
from rigidsim.scene.registry import Setting
from rigidsim.scene.scene import Scene


class PointAttraction(Load):
    """Base of loads by a point that may come near, at rest or moving."""

    has_source = True

    @property
    def strength(self) -> Any:
        """Gravitational parameter of the point, m^3/s^2 (mpf)."""
        raise NotImplementedError

    def seen(self, m: Kinematics) -> tuple[list[Symbolic], Symbolic]:
        """Unit direction from the point to the body, space axes, and 1/r (1/length)."""
        raise NotImplementedError

    def source_place(self, m: Kinematics) -> SourcePlace:
        outward, inverse = self.seen(m)
        context = m.scene.context
        return SourcePlace([-x for x in outward], inverse, context.ldexp(context.one, m.scaling.length))

    def source_direction(self, m: Kinematics) -> list[Symbolic]:
        return [-x for x in self._seen_from_body(m)[0]]

    def torque(self, m: Kinematics) -> list[Term]:
        """Torque (3 G M / r^3) c x (I c)."""
        body, inverse = self._seen_from_body(m)
        return gradient_terms(m, body, self.scaled(m, 3, 2 * m.scaling.time), inverse**3)

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool:
        """True: c x (I c) has no component along an axis of symmetry."""
        return True

    def scaled(self, m: Kinematics, length_power: int, extra: int) -> Any:
        """G M over length^power times 2^extra, internal units."""
        return m.scene.context.ldexp(self.strength, extra - length_power * m.scaling.length)

    def pull(self, m: Kinematics, *, as_point: bool) -> tuple[list[Symbolic], list[Symbolic]]:
        """Minus the body's acceleration, with or without that as a point, in parts along the direction and R
        I c:

        (G M / r^2 + (3 G M / 2 m r^4) (tr I - 5 c . I c)) R c and (3 G M / m r^4) R I c.
        """
        space, inverse = self.seen(m)
        body, scaling = apply(transpose(m.matrix), space), m.scaling
        shift = scaling.time - scaling.speed
        ratio = self.scaled(m, 4, shift + scaling.inertia) * 3 / (2 * m.carried(m.scene.body.mass))
        second = m.number(ratio) * inverse**4
        radial = second * (self.trace(m) - 5.0 * quadratic_form(m, body))
        if as_point:
            radial = m.number(self.scaled(m, 2, shift)) * inverse**2 + radial
        turned = apply(m.matrix, inertia_times(m, body))
        return [radial * x for x in space], [2.0 * second * y for y in turned]

    def second_degree(self, m: Kinematics) -> Symbolic:
        """Minus the potential energy by the body's shape."""
        body, inverse = self._seen_from_body(m)
        second = self.scaled(m, 3, m.scaling.inertia - m.scaling.energy) / 2
        return m.number(second) * inverse**3 * (self.trace(m) - 3.0 * quadratic_form(m, body))

    def as_point(self, m: Kinematics) -> Symbolic:
        """Minus the potential energy of the body as a point."""
        point = self.scaled(m, 1, -m.scaling.energy) * m.carried(m.scene.body.mass)
        return m.number(point) * self.seen(m)[1]

    def _seen_from_body(self, m: Kinematics) -> tuple[list[Symbolic], Symbolic]:
        space, inverse = self.seen(m)
        return apply(transpose(m.matrix), space), inverse

    def trace(self, m: Kinematics) -> Any:
        if m.shape is not None:
            return hy.sum([m.shape.matrix[i][i] for i in range(3)])
        return m.number(sum(m.numbers.inertia[i][i] for i in range(3)))


def given_strength(given: Any, around: Setting) -> Any:
    """A gravitational parameter, m^3/s^2 (mpf); refused if it is missing."""
    if given is None:
        raise around.fault("gravitational_parameter", "missing; it is needed")
    return given.at(around.context)


def kernel_strength(given: Any, source: str, around: Setting) -> Any:
    """The gravitational parameter (mpf, m^3/s^2) of a body of the kernel: as given, or the kernel's own."""
    ephemeris = kernel_body(source, around)
    if given is not None:
        return given_strength(given, around)
    found = ephemeris.kernel.strength(source)
    if found is None:
        what = f'missing; {ephemeris.kernel.name} has none of "{source}"'
        raise around.fault("gravitational_parameter", f"{what}: give it, in m^3/s^2 or km^3/s^2")
    return exactly(around.context, found)


_UNROLLED = 2


@dataclass(frozen=True)
class MovingSource(PointAttraction):
    """A point mass that attracts the body."""

    masses: PointMasses  # all of them
    number: int  # index of the one that attracts
    reacts = True
    as_points: ClassVar[bool] = False  # whether it attracts the body as a point, too

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return frozenset({"attitude", "flight"} if self.masses.host is None else {"attitude"})

    @property
    def wide(self) -> bool:  # type: ignore[override]
        """Whether there are three or more masses, whose equations take ten seconds to compile unrolled."""
        return len(self.masses.names) > _UNROLLED

    @property
    def strength(self) -> Any:
        return self.masses.strengths[self.number]

    @property
    def plane(self) -> OrbitPlane:  # type: ignore[override]
        return _OsculatingPlane(self)

    def among(self, masses: PointMasses) -> MovingSource:
        return replace(self, masses=masses)

    def place(self, m: Kinematics) -> list[Symbolic]:
        """Vector from the mass to the body, space axes, units of length."""
        states = m.carried(m.point_masses)
        if self.masses.host is not None:
            return states.between(self.number, self.masses.host)
        return [x - a for x, a in zip(m.carried(m.position), states.positions[self.number], strict=True)]

    def motion(self, m: Kinematics) -> list[Symbolic]:
        """Velocity of the body as seen from the mass, space axes, units of speed."""
        states, host = m.carried(m.point_masses), self.masses.host
        own = m.carried(m.velocity) if host is None else states.velocities[host]
        return [x - a for x, a in zip(own, states.velocities[self.number], strict=True)]

    def seen(self, m: Kinematics) -> tuple[list[Symbolic], Symbolic]:
        place = self.place(m)
        inverse = 1.0 / length(place)
        return [x * inverse for x in place], inverse

    def acceleration(self, m: Kinematics) -> list[Symbolic]:
        """Acceleration of the body, space axes: by its shape, and as a point if ``as_points``."""
        return [-x - y for x, y in zip(*self.pull(m, as_point=self.as_points), strict=True)]

    def reaction(self, m: Kinematics) -> list[tuple[int, Any, list[Symbolic]]]:
        return self.answered(self.acceleration(m), m) if self.masses.full else []

    def answered(self, pull: list[Symbolic], m: Kinematics) -> list[tuple[int, Any, list[Symbolic]]]:
        """What the masses feel where the body is accelerated so by this one; see ``Reacting``."""
        host, context = self.masses.host, m.scene.context
        if host is None:
            own = context.mpf(GRAVITATIONAL_CONSTANT) * m.carried(m.scene.body.mass)
            return [(self.number, -own / self.strength, pull)]
        ratio = self.masses.strengths[host] / self.strength
        return [(host, context.one, pull), (self.number, -ratio, pull)]

    def potential(self, m: Kinematics) -> Symbolic | None:
        return -self.second_degree(m)

    # --- estimates, from the Kepler orbit of the body and this mass alone ---------------------------------

    def encounter(self, scene: Scene) -> tuple[Any, Any]:
        """Least distance (m), and the angular rate there (rad/s)."""
        masses, own = self.masses, scene.context.zero
        if masses.host is not None:
            own = masses.strengths[masses.host]
        return closest(scene.context, *self.start(scene), self.strength + own)

    def start(self, scene: Scene) -> tuple[Vector, Vector]:
        """Position and velocity of the body as seen from the mass, m and m/s (mpf)."""
        masses, n, host = self.masses, self.number, self.masses.host
        own = scene.position or [], scene.velocity or []
        if host is not None:
            own = masses.positions[host], masses.velocities[host]
        there = masses.positions[n], masses.velocities[n]
        place, moving = ([x - a for x, a in zip(*pair, strict=True)] for pair in zip(own, there, strict=True))
        return place, moving

    def source_at_start(self, scene: Scene) -> Vector:
        return [-x for x in self.start(scene)[0]]

    def motion_at_start(self, scene: Scene) -> Vector:
        return self.start(scene)[1]

    def amplitude(self, scene: Scene) -> Any:
        return tidal_range(scene, self.strength, self.encounter(scene)[0])

    def fastest_rate(self, scene: Scene) -> Any:
        return self.encounter(scene)[1]


class MovingGradient(MovingSource):
    """The torque of a point mass on a body that is a point mass itself, or flies without its force."""

    title = "gravity_gradient"

    @property
    def gradient_source(self) -> GradientSource | None:
        """The mass as the source of a gradient alone; None for a body that flies by itself."""
        if self.masses.host is None:
            return None
        return GradientSource(self.strength, PlacedAsMass(PointMassPair(self.masses, self.number)))


class MovingAttractor(MovingSource):
    """The torque and force of a point mass on a body with a position of its own."""

    title = "central_gravity"
    as_points = True

    def force(self, m: Kinematics) -> list[Term]:
        return list(zip(unit_vectors(m.scene.context), self.acceleration(m), strict=True))

    def potential(self, m: Kinematics) -> Symbolic | None:
        return -self.second_degree(m) - self.as_point(m)


@dataclass(frozen=True)
class _OsculatingPlane(OrbitPlane):
    """Osculating plane of the body's motion about a moving point mass."""

    source: MovingSource
    described = "osculating plane of the source's orbit"
    called = "normal of the osculating orbit"

    def normal(self, m: Kinematics) -> list[Symbolic]:
        return unit(cross(self.source.place(m), self.source.motion(m)))

    def at_start(self, scene: Scene) -> Vector:
        return cross(*self.source.start(scene))

    def drift(self, scene: Scene) -> None:
        return None

    def rate(self, scene: Scene) -> Any:
        return self.source.encounter(scene)[1]
