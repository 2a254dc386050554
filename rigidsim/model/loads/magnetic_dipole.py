"""Magnetic dipole: a moment of the body in a uniform field, or in that of a dipole about which it moves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import heyoka as hy
from pydantic import Field

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Term
from rigidsim.model.loads.magnetic_field import InMagneticField, MagneticFieldFields, numbers
from rigidsim.model.names import written
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import Vector, cross, diagonal, norm, unit_vectors
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.tree import Constant, Expression, states_read
from rigidsim.scene.fields import NumberOrFormula, Triple
from rigidsim.scene.registry import Setting, register_load
from rigidsim.scene.scene import Scene


class MagneticDipoleFields(MagneticFieldFields):
    """Torque m x B on a dipole of the body, in a uniform ``field`` (space axes), or in the field of a centred
    dipole ``source_moment`` (space axes) around which the body moves on an orbit, or in flight as it flies.
    """

    kind: Literal["magnetic_dipole"]
    moment: Triple[Annotated[Any, NumberOrFormula("A m^2")]] = Field(
        description="magnetic moment of the body, body axes: numbers, or expressions of t, the state, "
        "bx by bz and [parameters], such as a law of magnetorquers; zero for a field alone",
        examples=[["0 A m^2", "0 A m^2", "0.5 A m^2"]],
    )


@register_load
@dataclass(frozen=True, kw_only=True)
class MagneticDipole(InMagneticField):
    """Torque m x B, potential -m . B (Jackson, Classical Electrodynamics, sections 5.6 and 5.7)."""

    moment: Vector  # m, body axes, A m^2 (mpf)
    Fields = MagneticDipoleFields
    title = "magnetic_dipole"

    @classmethod
    def resolve(cls, fields: MagneticDipoleFields, around: Setting) -> MagneticDipole:
        if any(isinstance(x, str) for x in fields.moment):
            moment, law = [around.context.zero] * 3, tuple(_law(fields.moment, around))
            return SteeredDipole.within(fields, around, moment=moment, law=law)
        return cls.within(fields, around, moment=numbers(fields.moment, around))

    def acts(self) -> bool:
        return any(x != 0 for x in self.moment) and any(x != 0 for x in self.field.source)

    @property
    def conservative(self) -> bool:  # type: ignore[override]
        """Whether the field is uniform: along a flight its torque does work without a force."""
        return self.field.uniform or not self.acts()

    def _moment(self, m: Kinematics) -> Vector:
        """m times the field's size, internal units of energy."""
        size, exponent = self.field.size(m.scene), -m.scaling.energy
        return [m.scene.context.ldexp(x * size, exponent) for x in self.moment]

    def torque(self, m: Kinematics) -> list[Term]:
        if not self.acts():
            return []
        moment, axes = self._moment(m), unit_vectors(m.scene.context)
        return [(cross(moment, axis), b) for axis, b in zip(axes, self.b(m), strict=True)]

    def potential(self, m: Kinematics) -> Symbolic | None:
        if not self.acts():
            return None
        pairs = zip(self._moment(m), self.b(m), strict=True)
        return -hy.sum([m.number(x) * b for x, b in pairs if x != 0])

    def linear_potential(self, scene: Scene) -> tuple[Vector, Vector] | None:
        return (self.moment, self.field.source) if self.field.uniform else None

    def amplitude(self, scene: Scene) -> Any:
        """Largest 2 m B."""
        return 2 * norm(scene.context, self.moment) * self.field.most(scene)


@dataclass(frozen=True, kw_only=True)
class SteeredDipole(MagneticDipole):
    """A moment given by expressions, as by a law of magnetorquers."""

    law: tuple[Expression, ...] = ()  # its components, A m^2, body axes
    conservative = False

    def acts(self) -> bool:
        return any(x != 0 for x in self.field.source)

    def read_by(self, names: frozenset[str]) -> bool:
        return False

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return super().reads | states_read(*self.law)

    def torque(self, m: Kinematics) -> list[Term]:
        size = m.scene.context.ldexp(self.field.size(m.scene), -m.scaling.energy)
        return list(zip(diagonal([size] * 3), cross(written(m, self.law), self.b(m)), strict=True))

    def potential(self, m: Kinematics) -> Symbolic | None:
        return None

    def linear_potential(self, scene: Scene) -> tuple[Vector, Vector] | None:
        return None

    def amplitude(self, scene: Scene) -> Any | None:
        return None


def _law(given: list[Any], around: Setting) -> Iterator[Expression]:
    """Components of a moment, of which some are expressions."""
    for i, x in enumerate(given):
        yield Constant(x) if isinstance(x, ExactNumber) else around.expression(f"moment[{i}]", x, "A m^2")
