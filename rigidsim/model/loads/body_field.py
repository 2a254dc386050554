"""The torque and force of a source on the body's field of degree 3 and more: ``degree`` of a load.

With u the unit vector to the source in body axes, r its distance and f_n the body's harmonics of degree n,

    U = -(G M m / r) sum (R/r)^n f_n(u),       N = -(G M m / r) sum (R/r)^n u x grad f_n,
    a = (G M / r^2) sum (R/r)^n ((n + 1) f_n u + u x (u x grad f_n)),

G M being the source's, m the body's mass, a its acceleration in flight.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import heyoka as hy

from rigidsim.model.harmonics import Harmonics, Series, turning
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.model.load_words import length_text
from rigidsim.model.loads.attraction import Attraction, ByPlacedSource, along_axes
from rigidsim.model.placements.placement import SourcePlace
from rigidsim.model.rotations import Symbolic, apply
from rigidsim.scene.arithmetic import Vector, across, cross
from rigidsim.scene.bodies.gravity_field import LEAST, GravityField
from rigidsim.scene.effect_parts import EffectPart, degree_parts
from rigidsim.scene.registry import Setting, register_load
from rigidsim.scene.scene import Scene
from rigidsim.scene.tracing.numbers import plain

_UNROLLED = 3
"""Degree up to which the expressions of the torque alone are unrolled: beyond, and with the force, this takes
three to seven seconds to compile, ten times as long as compact code whose steps cost 1.7 times as much.
"""


@register_load(beside="degree")
@dataclass(frozen=True, kw_only=True)
class BodyField(ByPlacedSource):
    """Attraction of the body's field from degree 3 to a degree."""

    field: GravityField
    degree: int

    title = "gravity_field"
    unaveraged = (
        "the gravity field of degree 3 and more has no average, which the gradient alone has",
        "set degree = 2",
    )

    @property
    def wide(self) -> bool:  # type: ignore[override]
        return self.placement.wide or self.reacts or self.pulls or self.degree > _UNROLLED

    def acts(self) -> bool:
        return bool(self.coefficients)

    @cached_property
    def coefficients(self) -> Series:
        """Those that aren't zero, unnormalized (mpf)."""
        return self.field.to(self.degree)

    def _energy(self, m: Kinematics, place: SourcePlace, n: int) -> Any:
        """-G M m R^n over the unit of distance to the power of n + 1, internal units of energy (mpf)."""
        size = m.scene.body.mass * (self.field.radius / place.unit) ** n
        return -size * self.per_distance(m, place, 1, -m.scaling.energy)

    def _seen(self, m: Kinematics) -> tuple[Harmonics, SourcePlace]:
        """Harmonics of the direction to the source in body axes, and its place."""
        direction, place = self.source_direction(m), self.placement.seen(m)
        return Harmonics(direction, m.number, m.scene.context), place

    def _torque(self, m: Kinematics) -> list[Symbolic]:
        """Components in body axes, internal units of energy."""
        seen, place = self._seen(m)
        return seen.turned(self.coefficients, lambda n: self._energy(m, place, n), place.inverse, 1)

    def torque(self, m: Kinematics) -> list[Term]:
        terms = along_axes(m, m.scene.context.one, self._torque(m))
        return [term for term in terms if term[1] != hy.expression(0.0)]

    def potential(self, m: Kinematics) -> Symbolic | None:
        seen, place = self._seen(m)
        found: Symbolic = seen.scalar(
            self.coefficients, lambda n: self._energy(m, place, n), place.inverse, 1
        )
        return found

    def acceleration(self, m: Kinematics) -> tuple[int, list[Symbolic]]:
        context, scaling, (seen, place) = m.scene.context, m.scaling, self._seen(m)
        first = self.per_distance(m, place, 2, scaling.time - scaling.speed)
        ratio = self.field.radius / place.unit
        outward = seen.scalar(self.coefficients, lambda n: (n + 1) * first * ratio**n, place.inverse, 2)
        arm = m.carried(m.scene.body.mass) * place.unit
        lever = context.ldexp(-1 / arm, scaling.energy + scaling.time - scaling.speed)
        turned = cross(place.direction, apply(m.matrix, self._torque(m)))
        factor = m.number(lever) * place.inverse
        return 1, [outward * u + factor * x for u, x in zip(place.direction, turned, strict=True)]

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool:
        """Whether the field is symmetric about the axis, too."""
        context = m.scene.context
        return all(across(context, x, axis) for x in turning(self.coefficients, context).values())

    def amplitude(self, scene: Scene) -> Any:
        """Twice a bound of the potential energy at the closest approach: |P_nm|^2 <= (n + m)! / (n - m)!."""
        context, near, total = scene.context, self.placement.nearest(scene), scene.context.zero
        for (n, m, _), value in self.coefficients.items():
            highest = context.sqrt(context.mpf(math.factorial(n + m)) / math.factorial(n - m))
            total += abs(value) * highest * (self.field.radius / near) ** n
        return 2 * total * self.gravitational_parameter * scene.body.mass / near

    # --- from the config ------------------------------------------------------------------------------------

    @staticmethod
    def effect_parts(fields: Any) -> Iterator[EffectPart]:
        field_ = "of the body's field"
        degrees = range(LEAST, (fields.degree or 0) + 1)
        yield from degree_parts(degrees, field_, lambda n: {"degree": n - 1})
        if fields.degree is None:
            words = f"degree {LEAST} and more {field_}"
            yield EffectPart("field", words, missing="no degree is given")

    @classmethod
    def beside_of(cls, load: Any, fields: Any, around: Setting) -> Load | None:
        assert isinstance(load, Attraction)
        degree, field, placement = fields.degree, around.body.gravity, load.placement
        if degree < LEAST:
            return None
        if field is None:
            what = "[body] has no gravity_field; give it, or leave degree out (the inertia tensor "
            raise around.fault("degree", f"given {degree}, but {what}is degree 2)")
        if degree > field.degree:
            what = f"given {degree}, but [body] gravity_field ends at degree {field.degree}"
            raise around.fault("degree", what)
        if not placement.dynamic and (near := placement.nearest(around)) < field.radius:
            far, radius = (length_text(float(plain(x))) for x in (near, field.radius))
            what = (
                f"given for a source that comes to {far} from the body's centre, within the radius of [body] "
            )
            what += f"gravity_field, {radius}, where its series doesn't hold; place it outside, or "
            raise around.fault("degree", what + "leave degree out")
        return load.part(cls, field=field, degree=degree)
