"""Attraction of the body by a source that is placed somehow: a point, to second degree (MacCullagh).

With r the distance of the source and c the unit vector to it in body axes, torque and potential energy are

    N = (3 G M / r^3) c x (I c),      U = -G M m / r - (G M / 2 r^3) (tr I - 3 c . I c).

The force on a body in flight follows from U. Where the origin of the space axes is a body that the source
accelerates as well, what is felt there is the difference, the tidal or third-body acceleration (Montenbruck &
Gill 2000, Satellite Orbits, ch. 3): of a source at s, G M (s - x) / |s - x|^3 - G M s / |s|^3.

``body_field``, ``source_figure`` and ``source_field`` add what body and source are beyond that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self, TypeVar

import heyoka as hy

from rigidsim.model.kinematics import Kinematics, inertia_times, quadratic_form
from rigidsim.model.load import Term
from rigidsim.model.loads.placed import Placed
from rigidsim.model.orbits.point_mass_states import Pull
from rigidsim.model.placements.placement import SourcePlace
from rigidsim.model.placements.point_mass import AmongMasses
from rigidsim.model.rotations import Symbolic, apply, transpose
from rigidsim.model.two_part import as_factor
from rigidsim.scene.arithmetic import Vector, cross, dot, norm, unit_vectors
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.point_masses import PointMasses
from rigidsim.scene.registry import SceneLoad
from rigidsim.scene.scene import Scene

PartT = TypeVar("PartT", bound="ByPlacedSource")


@dataclass(frozen=True, kw_only=True)
class ByPlacedSource(Placed):
    """Base of what a source of gravity does.

    Attributes:
        gravitational_parameter: G M of the source, m^3/s^2 (mpf).
        pulls: whether its force accelerates the body.
        beside: the attraction to second degree by the same source; None of that one.
    """

    gravitational_parameter: Any
    pulls: bool = False
    beside: Attraction | None = None

    @property
    def conservative(self) -> bool:  # type: ignore[override]
        return self.placement.rests

    @property
    def reacts(self) -> bool:  # type: ignore[override]
        return isinstance(self.placement, AmongMasses)

    @property
    def attracting_point(self) -> Vector | None:  # type: ignore[override]
        return self.placement.point

    @property
    def corotating_orbit(self) -> KeplerOrbit | None:  # type: ignore[override]
        orbit = self.placement.orbit
        return orbit if orbit is not None and orbit.circular and orbit.fixed_plane else None

    def among(self, masses: PointMasses) -> SceneLoad:
        return replace(self, placement=self.placement.among(masses))

    # --- what it does ---------------------------------------------------------------------------------------

    def per_distance(self, m: Kinematics, place: SourcePlace, power: int, exponent: int) -> Any:
        """G M over the unit of distance to a power, times 2^exponent (mpf)."""
        return m.scene.context.ldexp(self.gravitational_parameter / place.unit**power, exponent)

    def acceleration(self, m: Kinematics) -> tuple[int, list[Symbolic]]:
        """A sign, and the components of the centre of mass's acceleration times it, space axes."""
        raise NotImplementedError

    def force(self, m: Kinematics) -> list[Term]:
        if not self.pulls:
            return []
        sign, parts = self.acceleration(m)
        return [([sign * x for x in e], y) for e, y in zip(unit_vectors(m.scene.context), parts, strict=True)]

    def reaction(self, m: Kinematics) -> list[Pull]:
        if not (self.reacts and isinstance(self.placement, AmongMasses) and self.placement.masses.full):
            return []
        sign, parts = self.acceleration(m)
        return self.placement.reaction(m, parts, sign)

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool:
        """True: a symmetric tensor has no torque about its axis."""
        return True


@dataclass(frozen=True, kw_only=True)
class Attraction(ByPlacedSource):
    """Attraction to second degree, which is the gravity gradient of a distant source."""

    has_source = True

    @property
    def title(self) -> str:  # type: ignore[override]
        return "central_gravity" if self.pulls else "gravity_gradient"

    @property
    def gradient_source(self) -> Self | None:
        return None if self.placement.flies else self

    def part(self, kind: type[PartT], **more: Any) -> PartT:
        """What the source does beyond this attraction."""
        return kind(
            gravitational_parameter=self.gravitational_parameter, placement=self.placement, pulls=self.pulls,
            beside=self, **more,
        )  # fmt: skip

    @property
    def remark(self) -> str:  # type: ignore[override]
        return "" if self.table is None else self.table.described

    def pictured(self) -> dict[str, Any] | None:
        what = "source" if self.attracting_point is None else "attractor"
        told = {"what": what, "gravitational_parameter": float(self.gravitational_parameter)}
        return None if self.reacts else told | self.placement.pictured()

    def fixed_source(self, scene: Scene) -> tuple[Any, Vector] | None:
        if self.placement.flies or not self.placement.rests:
            return None
        place = self.placement.at_start(scene)
        distance = norm(scene.context, place)
        return 3 * self.gravitational_parameter / distance**3, [x / distance for x in place]

    # --- what it does ---------------------------------------------------------------------------------------

    def torque(self, m: Kinematics) -> list[Term]:
        line, place = self.seen(m)
        strength, factor = 3 * self.per_distance(m, place, 3, 2 * m.scaling.time), place.inverse**3
        if m.shape is not None:
            turned = cross(line, inertia_times(m, line))
            return along_axes(m, strength, [factor * x for x in turned])
        return tensor_terms(m, strength, lambda a, j: factor * (line[a] * line[j]))

    def potential(self, m: Kinematics) -> Symbolic | None:
        """Without the part that depends on nothing but time; with the inertial force of a falling origin."""
        (line, place), scaling = self.seen(m), m.scaling
        second = self.per_distance(m, place, 3, scaling.inertia - scaling.energy) / 2
        if not self.placement.dynamic:
            return as_factor(m.number(3 * second)) * (place.inverse**3 * quadratic_form(m, line))
        energy = -(m.number(second) * place.inverse**3 * (trace(m) - 3.0 * quadratic_form(m, line)))
        if self.pulls:
            mass = m.carried(m.scene.body.mass)
            energy = energy - m.number(mass * self.per_distance(m, place, 1, -scaling.energy)) * place.inverse
            if falling := self._falling(m, scaling.length - scaling.energy):
                energy = energy + m.number(mass) * dot(falling, m.carried(m.position))
        return energy

    def acceleration(self, m: Kinematics) -> tuple[int, list[Symbolic]]:
        """(G M / r^2 + (3 G M / 2 m r^4) (tr I - 5 c . I c)) R c + (3 G M / m r^4) R I c; the first term only
        if it pulls: point masses attract each other as points anyway.
        """
        (line, place), scaling = self.seen(m), m.scaling
        shift = scaling.time - scaling.speed
        ratio = (
            self.per_distance(m, place, 4, shift + scaling.inertia) * 3 / (2 * m.carried(m.scene.body.mass))
        )
        second = m.number(ratio) * place.inverse**4
        radial = second * (trace(m) - 5.0 * quadratic_form(m, line))
        if self.pulls:
            radial = m.number(self.per_distance(m, place, 2, shift)) * place.inverse**2 + radial
        turned = apply(m.matrix, inertia_times(m, line))
        parts = [radial * x + 2.0 * second * y for x, y in zip(place.line, turned, strict=True)]
        return -1 if place.outward else 1, parts

    def force(self, m: Kinematics) -> list[Term]:
        falling = self._falling(m, m.scaling.time - m.scaling.speed) if self.pulls else []
        less = [[-x for x in e] for e in unit_vectors(m.scene.context)] if falling else []
        return [*super().force(m), *zip(less, falling, strict=True)]

    def _falling(self, m: Kinematics, exponent: int) -> list[Symbolic]:
        """Acceleration of the origin times 2^exponent, internal units; empty for one that doesn't fall."""
        if self.placement.falling is None:
            return []
        place = self.placement.falling.seen(m)
        factor = m.number(self.per_distance(m, place, 2, exponent)) * place.inverse**2
        return [factor * x for x in place.line]

    # --- sizes ----------------------------------------------------------------------------------------------

    def amplitude(self, scene: Scene) -> Any:
        """(3/2) (G M / r^3) (I_max - I_min) at the closest approach: range of the potential energy."""
        strength = 3 * self.gravitational_parameter / self.placement.nearest(scene) ** 3
        return strength * moments_range(scene) / 2

    def flight_bounds(self, scene: Scene, fed: Any) -> tuple[Any, Any] | None:
        return self.placement.flight_bounds(scene, fed)


# --- torques of tensors -------------------------------------------------------------------------------------


def tensor_terms(m: Kinematics, strength: Any, element: Callable[[int, int], Symbolic]) -> list[Term]:
    """Torque sum of strength S_aj e_a x (I e_j) of a symmetric tensor S in body axes, I being the constant
    tensor of inertia: the constant strength (mpf) becomes one coefficient with the moments.

    Args:
        element: S_aj, asked for where it has a torque.
    """
    units, columns = unit_vectors(m.scene.context), transpose(m.numbers.inertia)
    terms: list[Term] = []
    for a in range(3):
        for j in range(a, 3):
            vector = cross(units[a], columns[j])
            if j != a:
                vector = [x + y for x, y in zip(vector, cross(units[j], columns[a]), strict=True)]
            if any(x != 0 for x in vector):
                terms.append(([strength * x for x in vector], element(a, j)))
    return terms


def along_axes(m: Kinematics, strength: Any, parts: list[Symbolic]) -> list[Term]:
    """A vector's components as terms, times a constant (mpf)."""
    return [([strength * x for x in e], y) for e, y in zip(unit_vectors(m.scene.context), parts, strict=True)]


def trace(m: Kinematics) -> Any:
    """tr I, internal units of inertia."""
    if m.shape is not None:
        return hy.sum([m.shape.matrix[i][i] for i in range(3)])
    return m.number(sum(m.numbers.inertia[i][i] for i in range(3)))


def moments_range(scene: Scene) -> Any:
    """I_max - I_min (mpf), kg m^2."""
    moments = scene.body.principal_moments
    return scene.context.maximum(moments) - scene.context.minimum(moments)
