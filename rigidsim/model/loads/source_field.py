"""The gravity of the attracting body beyond a point: ``gravity_field`` of ``central_gravity``.

With u the unit vector from its centre to the body in its own axes, r the distance and f_n its harmonics of
degree n, the body, of mass m, has as a point

    U = -(G M m / r) sum (R/r)^n f_n(u),
    a = -(G M / r^2) sum (R/r)^n ((n + 1) f_n u + u x (u x grad f_n)).

The axes turn about the pole at a constant rate; a field without orders above 0 rests.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pydantic import Field, StrictStr

from rigidsim.model.harmonics import TurningHarmonics, frame_of
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load
from rigidsim.model.loads.attraction import Attraction, ByPlacedSource
from rigidsim.model.loads.source_figure import refuse_inside
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.bodies.gravity_field import HarmonicsTable
from rigidsim.scene.effect_parts import EffectPart, degree_parts
from rigidsim.scene.exact import ZERO
from rigidsim.scene.fields import Angle, Dimensionless, Direction, Metre, Positive, Rate
from rigidsim.scene.registry import Setting, register_load
from rigidsim.scene.scene import Scene


class SourceFieldTable(HarmonicsTable):
    """``gravity_field`` of ``central_gravity``: coefficients in axes that turn about the pole at a rate."""

    least = 2
    below = "gravitational_parameter and position"
    radius: Positive[Metre] = Field(examples=["6378.1366 km"])
    """reference radius R of C and S"""
    C: dict[StrictStr, Dimensionless] = Field(default_factory=dict, examples=[{"2,0": -1.0826e-3}])
    """unnormalized coefficients of cos m lon by "degree,order", from degree 2 on: C_20 is minus J2"""
    S: dict[StrictStr, Dimensionless] = Field(default_factory=dict, examples=[{"2,2": -9.0387e-7}])
    """likewise with sin m lon"""
    pole: Direction = Field(examples=[[0, 0, 1]])
    """direction of its axis of rotation, space axes"""
    rate: Rate = Field(ZERO, examples=["7.2921151e-5 rad/s"], json_schema_extra={"default": 0})
    """rate at which it turns about the pole"""
    prime_meridian: Angle = Field(ZERO, examples=["100 deg"], json_schema_extra={"default": 0})
    """angle of longitude 0 at time 0 from its equator's node on the plane XY (from X if they coincide)"""


@register_load(beside="gravity_field")
@dataclass(frozen=True, kw_only=True)
class SourceField(ByPlacedSource):
    """Force of the harmonics of a point at rest."""

    field: TurningHarmonics

    title = "gravity_field"
    reads = frozenset({"flight"})
    wide = True

    @property
    def conservative(self) -> bool:  # type: ignore[override]
        return self.field.rests

    def acts(self) -> bool:
        return bool(self.field.coefficients)

    def torque(self, m: Kinematics) -> list[Any]:
        return []

    def potential(self, m: Kinematics) -> Symbolic | None:
        place = self.placement.seen(m)
        strength, ratio = self.per_distance(m, place, 1, -m.scaling.energy), self.field.radius / place.unit
        strength = -strength * m.carried(m.scene.body.mass)
        return self.field.scalar(m, place, lambda n: strength * ratio**n)

    def acceleration(self, m: Kinematics) -> tuple[int, list[Symbolic]]:
        place, shift = self.placement.seen(m), m.scaling.time - m.scaling.speed
        strength, ratio = -self.per_distance(m, place, 2, shift), self.field.radius / place.unit
        return 1, self.field.vector(m, place, lambda n: strength * ratio**n)

    def amplitude(self, scene: Scene) -> Any:
        return scene.context.zero  # no torque

    def fastest_rate(self, scene: Scene) -> Any:
        return scene.context.zero if self.conservative else abs(self.field.rate)

    # --- from the config ------------------------------------------------------------------------------------

    @classmethod
    def beside_of(cls, load: Any, fields: Any, around: Setting) -> Load:
        assert isinstance(load, Attraction)
        given, context = fields.gravity_field, around.context
        if fields.figure is not None and "2,0" in given.C:
            raise around.fault("gravity_field.C", 'given "2,0" and figure, whose J2 is the same; remove one')
        found = given.coefficients(context, lambda text: around.fault("gravity_field", text))
        frame = frame_of(context, [x.at(context) for x in given.pole], given.prime_meridian.at(context))
        radius, rate = given.radius.at(context), given.rate.at(context)
        refuse_inside(load, radius, "gravity_field", around)
        field = TurningHarmonics({key: c for key, c in found.items() if c != 0}, radius, frame, rate)
        return load.part(cls, field=field)

    @staticmethod
    def effect_parts(fields: Any) -> Iterator[EffectPart]:
        table = fields.gravity_field
        given = [(name, key) for name in ("C", "S") for key in getattr(table, name, ())]
        keys = [(int(key.partition(",")[0]), f"gravity_field.{name}.{key}") for name, key in given]
        yield from degree_parts(
            sorted({n for n, _ in keys})[1:],
            "of that gravity",
            lambda n: dict.fromkeys(key for degree, key in keys if degree >= n),
            "field-degree",
            ("field",),
        )
        missing = "" if table else "no gravity_field is given"
        words = "gravity of the attracting body beyond a point"
        yield EffectPart("field", words, {"gravity_field": None}, missing=missing)
