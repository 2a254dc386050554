"""Gravity of a point mass that moves besides the body: its torque, and its force if the body flies.

What a ``gravity_gradient`` or ``central_gravity`` with ``orbit = {body = ..}`` becomes (MacCullagh):

    U = -G M m / r - (G M / 2 r^3) (tr I - 3 c . I c),   c = R^T r/|r| from the mass to the body,

without the first term if the body itself is one of the point masses, whose mutual gravity includes it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.gradient import gradient_terms, tidal_range
from rigidsim.model.gradient_source import GradientSource
from rigidsim.model.kinematics import Kinematics, inertia_times, quadratic_form
from rigidsim.model.load import Load, Term
from rigidsim.model.numbers import unit_vectors
from rigidsim.model.orbit_planes import OrbitPlane
from rigidsim.model.orbits.point_mass_pair import PointMassPair
from rigidsim.model.rotations import Symbolic, apply, transpose
from rigidsim.scene.arithmetic import Vector, cross, norm
from rigidsim.scene.point_masses import GRAVITATIONAL_CONSTANT, PointMasses, closest
from rigidsim.scene.scene import Scene
from rigidsim.store.summary_parts import Caution

_UNROLLED = 2


@dataclass(frozen=True)
class MovingSource(Load):
    """A point mass that attracts the body.

    Attributes:
        masses: all point masses.
        number: index of the one that attracts.
        pulls: whether the body has a position of its own and is pulled (``central_gravity``).
    """

    masses: PointMasses
    number: int
    pulls: bool
    has_source = True
    masses_beside = True

    @property
    def title(self) -> str:  # type: ignore[override]
        """The kind of load in the config."""
        return "central_gravity" if self.pulls else "gravity_gradient"

    @property
    def gradient_alone(self) -> bool:  # type: ignore[override]
        """See ``Load``."""
        return not self.pulls

    @property
    def gradient_source(self) -> GradientSource | None:  # type: ignore[override]
        """The mass as the source of a gradient alone; None for a body that flies by itself."""
        if self.masses.host is None:
            return None
        return GradientSource(self.strength, pair=PointMassPair(self.masses, self.number))

    @property
    def described(self) -> str:  # type: ignore[override]
        """See ``SceneLoad``."""
        return f"a {self.title} load"

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        """See ``Load``."""
        return frozenset({"attitude", "flight"} if self.masses.host is None else {"attitude"})

    @property
    def wide(self) -> bool:  # type: ignore[override]
        """Whether there are three or more masses: their equations take ten seconds to compile unrolled, one
        otherwise.
        """
        return len(self.masses.names) > _UNROLLED

    @property
    def strength(self) -> Any:
        """Gravitational parameter of the mass, m^3/s^2."""
        return self.masses.strengths[self.number]

    def check(self, number: int, position: Vector | None) -> None:
        """Require that force and torque fit the way the body moves."""
        where = f"[[loads]] number {number + 1} kind"
        if self.pulls and self.masses.host is not None:
            what = 'given "central_gravity", but [body] host makes the body one of [[bodies]], which attract '
            raise ConfigError(Problem(where, what + 'each other anyway; give "gravity_gradient"'))
        if not self.pulls and self.masses.host is None and self.masses.full:
            what = 'given "gravity_gradient" for a body that flies by itself under coupling = "full"; give '
            raise ConfigError(Problem(where, what + '"central_gravity", whose force the bodies feel'))

    def among(self, masses: PointMasses) -> MovingSource:
        """See ``SceneLoad``."""
        return replace(self, masses=masses)

    # --- equations ---------------------------------------------------------------------------------------

    def place(self, m: Kinematics) -> list[Symbolic]:
        """Vector from the mass to the body, space axes, units of length."""
        states = m.carried(m.point_masses)
        if self.masses.host is not None:
            return states.between(self.number, self.masses.host)
        return [x - a for x, a in zip(m.carried(m.position), states.positions[self.number], strict=True)]

    def motion(self, m: Kinematics) -> list[Symbolic]:
        """Velocity of the body as seen from the mass, space axes, units of speed."""
        states = m.carried(m.point_masses)
        host = self.masses.host
        own = m.carried(m.velocity) if host is None else states.velocities[host]
        return [x - a for x, a in zip(own, states.velocities[self.number], strict=True)]

    @property
    def plane(self) -> OrbitPlane:
        """The osculating plane of the body's motion about the mass."""
        return _OsculatingPlane(self)

    def geometry(self, m: Kinematics) -> tuple[list[Symbolic], list[Symbolic], Symbolic]:
        """Unit direction from the mass in space axes and in body axes, and 1/r (1/length)."""
        place = self.place(m)
        inverse = 1.0 / hy.sqrt(hy.sum([x * x for x in place]))
        space = [x * inverse for x in place]
        return space, apply(transpose(m.matrix), space), inverse

    def source_direction(self, m: Kinematics) -> list[Symbolic]:
        """Unit vector to the mass, body axes."""
        return [-x for x in self.geometry(m)[1]]

    def _scaled(self, m: Kinematics, length_power: int, extra: int) -> Any:
        return m.scene.context.ldexp(self.strength, extra - length_power * m.scaling.length)

    def torque(self, m: Kinematics) -> list[Term]:
        """Torque (3 G M / r^3) c x (I c)."""
        _, body, inverse = self.geometry(m)
        return gradient_terms(m, body, self._scaled(m, 3, 2 * m.scaling.time), inverse**3)

    def pull(self, m: Kinematics) -> list[Symbolic]:
        """Acceleration of the body: by its shape, and by the point attraction if the body flies by itself."""
        scaling = m.scaling
        space, body, inverse = self.geometry(m)
        shift = scaling.time - scaling.speed
        mass = m.carried(m.scene.body.mass)
        second = m.number(self._scaled(m, 4, shift + scaling.inertia) * 3 / (2 * mass)) * inverse**4
        trace = sum(m.numbers.inertia[i][i] for i in range(3))
        radial = second * (m.number(trace) - 5.0 * quadratic_form(m, body))
        if self.pulls:
            radial = m.number(self._scaled(m, 2, shift)) * inverse**2 + radial
        turned = apply(m.matrix, inertia_times(m, body))
        return [-(radial * x) - 2.0 * second * y for x, y in zip(space, turned, strict=True)]

    def force(self, m: Kinematics) -> list[Term]:
        """Acceleration of the centre of mass of a body that flies by itself."""
        if not self.pulls:
            return []
        return list(zip(unit_vectors(m.scene.context), self.pull(m), strict=True))

    def reaction(self, m: Kinematics) -> list[tuple[int, Any, list[Symbolic]]]:
        """Accelerations of the point masses by the body, as ``PointMassStates.react`` takes them."""
        if not self.masses.full:
            return []
        pull, host, context = self.pull(m), self.masses.host, m.scene.context
        if host is None:
            own = context.mpf(GRAVITATIONAL_CONSTANT) * m.carried(m.scene.body.mass)
            return [(self.number, -own / self.strength, pull)]
        ratio = self.masses.strengths[host] / self.strength
        return [(host, context.one, pull), (self.number, -ratio, pull)]

    def potential(self, m: Kinematics) -> Symbolic | None:
        """Potential energy to second degree."""
        scaling = m.scaling
        _, body, inverse = self.geometry(m)
        second = self._scaled(m, 3, scaling.inertia - scaling.energy) / 2
        trace = sum(m.numbers.inertia[i][i] for i in range(3))
        found = -(m.number(second) * inverse**3 * (m.number(trace) - 3.0 * quadratic_form(m, body)))
        if self.pulls:
            point = self._scaled(m, 1, -scaling.energy) * m.carried(m.scene.body.mass)
            found = found - m.number(point) * inverse
        return found

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool:
        """True: c x (I c) has no component along an axis of symmetry."""
        return True

    # --- estimates, from the Kepler orbit of the body and this mass alone ---------------------------------

    def encounter(self, scene: Scene) -> tuple[Any, Any]:
        """Least distance (m), and the angular rate there (rad/s)."""
        masses, own = self.masses, scene.context.zero
        if masses.host is not None:
            own = masses.strengths[masses.host]
        return closest(scene.context, *self.start(scene), self.strength + own)

    def start(self, scene: Scene) -> tuple[Vector, Vector]:
        """Position and velocity of the body as seen from the mass, m and m/s (mpf)."""
        masses, n = self.masses, self.number
        if masses.host is None:
            own = scene.position or [], scene.velocity or []
        else:
            own = masses.positions[masses.host], masses.velocities[masses.host]
        there = masses.positions[n], masses.velocities[n]
        place, moving = ([x - a for x, a in zip(*pair, strict=True)] for pair in zip(own, there, strict=True))
        return place, moving

    def amplitude(self, scene: Scene) -> Any:
        """``tidal_range`` at the least distance, J."""
        return tidal_range(scene, self.strength, self.encounter(scene)[0])

    def fastest_rate(self, scene: Scene) -> Any:
        """Angular rate at the least distance, rad/s."""
        return self.encounter(scene)[1]

    def told(self, scene: Scene) -> str:
        """See ``Load``."""
        from rigidsim.model.load_words import reach_text, source_text, value_text

        name, distance = self.masses.names[self.number], norm(scene.context, self.start(scene)[0])
        kind = "central gravity" if self.pulls else "gravity gradient"
        back = ""
        if self.masses.full:
            back = "; the bodies feel the forces of this one" if self.pulls else "; the bodies feel its shape"
        largest = value_text(self.amplitude(scene), "N m")
        return (
            f'{kind} of the moving point mass "{name}", {source_text(self.strength)}, '
            f"{reach_text(self.strength, distance)} at the start; torque up to {largest}{back}"
        )

    def cautions(self, fields: Any, where: str, scene: Scene) -> Iterator[Caution]:
        """See ``Load``."""
        from rigidsim.model.plausibility import about_start, about_strength, attracting

        place, moving = self.start(scene)
        given, distance = (
            scene.config.bodies[self.number].gravitational_parameter,
            float(norm(scene.context, place)),
        )
        yield from about_strength(given, distance, f"[[bodies]] number {self.number + 1}")
        if self.pulls:
            yield from about_start(scene, attracting(given, distance), place, moving)


@dataclass(frozen=True)
class _OsculatingPlane(OrbitPlane):
    """Osculating plane of the body's motion about a moving point mass."""

    source: MovingSource
    described = "osculating plane of the source's orbit"
    called = "normal of the osculating orbit"

    def normal(self, m: Kinematics) -> list[Symbolic]:
        """See ``OrbitPlane``."""
        found = cross(self.source.place(m), self.source.motion(m))
        size = hy.sqrt(hy.sum([c * c for c in found]))
        return [c / size for c in found]

    def at_start(self, scene: Scene) -> Vector:
        """See ``OrbitPlane``."""
        return cross(*self.source.start(scene))

    def drift(self, scene: Scene) -> None:
        """None: no bound is known."""
        return None

    def rate(self, scene: Scene) -> Any:
        """Angular rate at the least distance, rad/s."""
        return self.source.encounter(scene)[1]
