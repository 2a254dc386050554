"""The torque and force of a source on the body's field of degree 3 and more: ``degree`` of a load.

It acts beside the load that has the key, which is to second degree, on the same source. With u the unit
vector to the source in body axes, r its distance and f_n the body's harmonics of degree n,

    U = -(G M m / r) sum (R/r)^n f_n(u),       N = -(G M m / r) sum (R/r)^n u x grad f_n,
    a = (G M / r^2) sum (R/r)^n ((n + 1) f_n u + u x (u x grad f_n)),

G M being the source's, m the body's mass, a its acceleration in flight.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import heyoka as hy
from pydantic import Field, StrictInt

from rigidsim.model.gradient import GradientSource
from rigidsim.model.harmonics import Harmonics, Series, polynomial, turning
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.model.load_words import length_text
from rigidsim.model.rotations import Symbolic, apply
from rigidsim.model.turning_harmonics import by_powers
from rigidsim.scene.arithmetic import Vector, across, cross, unit_vectors
from rigidsim.scene.bodies.gravity_field import LEAST, MOST, GravityField, Harmonic
from rigidsim.scene.effect_parts import EffectPart, degree_parts
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.point_masses import PointMasses
from rigidsim.scene.registry import SceneLoad, Setting, SourceFields, register_load
from rigidsim.scene.scene import Scene
from rigidsim.scene.tracing.numbers import plain

_UNROLLED = 3
"""Degree up to which the expressions of the torque alone are unrolled: beyond, and with the force, this takes
three to seven seconds to compile, ten times as long as compact code whose steps cost 1.7 times as much.
"""


class AttractingFields(SourceFields):
    """Keys of a load whose source attracts the body."""

    degree: StrictInt | None = Field(
        None,
        ge=2,
        le=MOST,
        description="degree of [body] gravity_field to which this source attracts the body; by default 2, "
        "which is the inertia tensor",
        examples=[4],
    )


@dataclass(frozen=True, kw_only=True)
class FieldAttraction(Load):
    """Attraction of the field from degree 3 on.

    Attributes:
        beside: the load of degree 2 on the same source.
        field: of the body.
        strength: G M of the source, m^3/s^2 (mpf).
        number: of the load in the config, from 1.
    """

    beside: Any
    field: GravityField
    degree: int
    strength: Any
    number: int

    title = "gravity_field"
    unaveraged = (
        "the gravity field of degree 3 and more has no average, which the gradient alone has",
        "set degree = 2",
    )

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return frozenset(self.beside.reads)

    @property
    def conservative(self) -> bool:  # type: ignore[override]
        return bool(self.beside.conservative)

    @property
    def orbit(self) -> KeplerOrbit | None:  # type: ignore[override]
        return self.beside.orbit

    @property
    def table(self) -> TabulatedOrbit | None:  # type: ignore[override]
        return self.beside.table

    @property
    def corotating_orbit(self) -> KeplerOrbit | None:  # type: ignore[override]
        return self.beside.corotating_orbit

    @property
    def wide(self) -> bool:  # type: ignore[override]
        return self.beside.wide or self.degree > _UNROLLED

    def acts(self) -> bool:
        return bool(self.coefficients)

    def among(self, masses: PointMasses) -> SceneLoad:
        return replace(self, beside=self.beside.among(masses))

    # --- the harmonics --------------------------------------------------------------------------------------

    @cached_property
    def coefficients(self) -> dict[Harmonic, Any]:
        """Those that aren't zero, unnormalized (mpf)."""
        return self.field.to(self.degree)

    def _by_degree(self) -> list[tuple[int, Series]]:
        found: dict[int, dict[Harmonic, Any]] = {}
        for key, value in self.coefficients.items():
            found.setdefault(key[0], {})[key] = value
        return list(found.items())

    def _seen(self, m: Kinematics) -> tuple[Harmonics, Symbolic, Any]:
        """Polynomials of the direction to the source in body axes, unit over distance, and that unit, m."""
        place = self.beside.source_place(m)
        direction = m.carried(self.beside.source_direction(m))
        return Harmonics(direction, m.number, m.scene.context), place.inverse, place.unit

    def _energy(self, m: Kinematics, unit: Any, n: int) -> Any:
        """G M m R^n over unit^(n + 1), internal units of energy (mpf)."""
        size = self.strength * m.scene.body.mass / unit * (self.field.radius / unit) ** n
        return m.scene.context.ldexp(size, -m.scaling.energy)

    def _torque(self, m: Kinematics) -> list[Symbolic]:
        """Components in body axes, internal units of energy."""
        harmonics, inverse, unit = self._seen(m)
        parts: list[list[tuple[int, Symbolic]]] = [[], [], []]
        for n, series in self._by_degree():
            size = -self._energy(m, unit, n)
            vectors = turning(series, m.scene.context)
            for axis, part in enumerate(parts):
                along = {key: size * vector[axis] for key, vector in vectors.items()}
                if any(c != 0 for c in along.values()):
                    part.append((n, harmonics.summed(along)))
        return [by_powers(part, inverse, 1) for part in parts]

    def _scalar(self, m: Kinematics, sizes: Any, above: int) -> Symbolic:
        """Sum of f_n times a constant (mpf) of each degree and ``inverse`` to the power of n + ``above``."""
        harmonics, inverse, unit = self._seen(m)
        parts = []
        for n, series in self._by_degree():
            size = sizes(unit, n)
            scaled = {key: size * c for key, c in polynomial(series, m.scene.context).items()}
            parts.append((n, harmonics.summed(scaled)))
        return by_powers(parts, inverse, above)

    # --- what it does ---------------------------------------------------------------------------------------

    def torque(self, m: Kinematics) -> list[Term]:
        pairs = zip(unit_vectors(m.scene.context), self._torque(m), strict=True)
        return [(axis, part) for axis, part in pairs if part != hy.expression(0.0)]

    def potential(self, m: Kinematics) -> Symbolic | None:
        return self._scalar(m, lambda unit, n: -self._energy(m, unit, n), 1)

    def acceleration(self, m: Kinematics) -> list[Symbolic]:
        """Of the centre of mass, space axes, internal units of speed over time."""
        context, scaling = m.scene.context, m.scaling
        place = self.beside.source_place(m)

        def radial(unit: Any, n: int) -> Any:
            size = (n + 1) * self.strength / unit**2 * (self.field.radius / unit) ** n
            return context.ldexp(size, scaling.time - scaling.speed)

        outward = self._scalar(m, radial, 2)
        arm = m.carried(m.scene.body.mass) * place.unit
        lever = context.ldexp(-1 / arm, scaling.energy + scaling.time - scaling.speed)
        turned = cross(place.direction, apply(m.matrix, self._torque(m)))
        factor = m.number(lever) * place.inverse
        return [outward * u + factor * x for u, x in zip(place.direction, turned, strict=True)]

    # --- what it conserves ----------------------------------------------------------------------------------

    def _vectors(self, context: Any) -> dict[int, dict[Harmonic, Vector]]:
        return {n: turning(series, context) for n, series in self._by_degree()}

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool:
        """Whether the field is symmetric about the axis, too."""
        context = m.scene.context
        found = self._vectors(context).values()
        return all(across(context, vector, axis) for vectors in found for vector in vectors.values())

    # --- sizes, and what readers are told -------------------------------------------------------------------

    def _size(self, scene: Scene) -> Any:
        """Bound of the potential energy at the closest approach, J: |P_nm|^2 <= (n + m)! / (n - m)!."""
        context, near, total = scene.context, least_distance(self.beside, scene), scene.context.zero
        for (n, m, _), value in self.coefficients.items():
            highest = context.sqrt(context.mpf(math.factorial(n + m)) / math.factorial(n - m))
            total += abs(value) * highest * (self.field.radius / near) ** n
        return total * self.strength * scene.body.mass / near

    def amplitude(self, scene: Scene) -> Any:
        return 2 * self._size(scene)

    @staticmethod
    def effect_parts(fields: AttractingFields) -> Iterator[EffectPart]:
        return degree_parts(fields.degree, LEAST)

    @classmethod
    def beside_of(cls, load: Any, fields: AttractingFields, around: Setting) -> Load | None:
        """See ``SceneLoad``."""
        degree = fields.degree
        assert degree is not None
        field = around.body.gravity
        if degree < LEAST:
            return None
        given = f"given {degree}, but "
        if field is None:
            what = "[body] has no gravity_field; give it, or leave degree out (the inertia tensor "
            raise around.fault("degree", f"{given}{what}is degree 2)")
        if degree > field.degree:
            raise around.fault("degree", f"{given}[body] gravity_field ends at degree {field.degree}")
        if isinstance(load, GradientSource):
            _refuse_within(load, field, around)
        kind = _Flown if load.attracting_point else _Moving if load.reacts else cls
        strength = getattr(load, "gravitational_parameter", None) or load.strength
        numbers = {"degree": degree, "strength": strength, "number": around.number + 1}
        return kind(beside=load, field=field, **numbers)


register_load(FieldAttraction, beside="degree")


class _Flown(FieldAttraction):
    """Of a point at rest, about which the body flies."""

    wide = True

    @property
    def attracting_point(self) -> Vector:  # type: ignore[override]
        point: Vector = self.beside.attracting_point
        return point

    def force(self, m: Kinematics) -> list[Term]:
        return list(zip(unit_vectors(m.scene.context), self.acceleration(m), strict=True))


class _Moving(FieldAttraction):
    """Of a point mass that moves besides the body."""

    wide = True
    reacts = True

    def force(self, m: Kinematics) -> list[Term]:
        if not self.beside.as_points:
            return []
        return list(zip(unit_vectors(m.scene.context), self.acceleration(m), strict=True))

    def reaction(self, m: Kinematics) -> list[tuple[int, Any, list[Symbolic]]]:
        return self.beside.answered(self.acceleration(m), m) if self.beside.masses.full else []


def _refuse_within(load: GradientSource, field: GravityField, around: Setting) -> None:
    near = load.placement.nearest(around.context)
    if near < field.radius:
        far, radius = (length_text(float(plain(x))) for x in (near, field.radius))
        what = f"given for a source that comes to {far} from the body's centre, within the radius of [body] "
        what += (
            f"gravity_field, {radius}, where its series doesn't hold; place it outside, or leave degree out"
        )
        raise around.fault("degree", what)


def least_distance(load: Any, scene: Scene) -> Any:
    """Least distance of a load's source, m (mpf)."""
    if hasattr(load, "nearest_approach"):
        return load.nearest_approach(scene)
    if hasattr(load, "encounter"):
        return load.encounter(scene)[0]
    return load.placement.nearest(scene.context)
