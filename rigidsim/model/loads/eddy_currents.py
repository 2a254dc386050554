"""Eddy currents: the torque of a magnetic field on a conductor that turns in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Term
from rigidsim.model.loads.magnetic_field import InMagneticField, MagneticFieldFields, numbers
from rigidsim.scene.arithmetic import (
    Vector,
    cross,
    unit_vectors,
)
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.fields import InUnit, Metre, NotNegative, Positive, Triple, excludes, one_of, together
from rigidsim.scene.registry import Setting, register_load
from rigidsim.scene.scene import Scene

Conductivity = Annotated[ExactNumber, InUnit("S/m")]
MagneticTensor = Annotated[ExactNumber, InUnit("S m^4")]


class EddyCurrentsFields(MagneticFieldFields):
    """Torque (M (w x B)) x B of the currents that a magnetic field induces in a conductor turning in it."""

    rules = (
        *MagneticFieldFields.rules,
        one_of("conductivity", "magnetic_tensor", why="the latter for a conductor that is no sphere"),
        excludes("magnetic_tensor", "radius", "thickness"),
        together("conductivity", "radius"),
    )
    kind: Literal["eddy_currents"]
    conductivity: NotNegative[Conductivity] | None = Field(
        default=None, description="of a conducting sphere, with its radius", examples=["3.5e7 S/m"]
    )
    radius: Positive[Metre] | None = Field(
        default=None, description="of the sphere, outside", examples=["30 cm"]
    )
    thickness: Positive[Metre] | None = Field(
        default=None, description="of the wall of a hollow sphere; a solid one without it", examples=["2 mm"]
    )
    magnetic_tensor: Triple[NotNegative[MagneticTensor]] | None = Field(
        default=None,
        description="moments of M about the body axes, of another conductor, instead of conductivity and "
        "radius",
        examples=[["2.1e4 S m^4", "2.1e4 S m^4", "9.8e3 S m^4"]],
    )


@register_load
@dataclass(frozen=True, kw_only=True)
class EddyCurrents(InMagneticField):
    """Torque (M (w x B)) x B on a conductor whose currents follow the field without delay.

    A sphere's M is (2 pi / 15) s (R^5 - (R - d)^5): the induced electric field -r x B' / 2 is tangent to all
    spheres, so each layer has its own currents (Landau & Lifshitz, Electrodynamics of Continuous Media,
    section 63).
    """

    moments: Vector  # of M, body axes, S m^4 (mpf)
    Fields = EddyCurrentsFields
    title = "eddy_currents"
    unaveraged = "the torque of eddy currents has no average", "leave it out, use viscous_torque"

    @classmethod
    def resolve(cls, fields: EddyCurrentsFields, around: Setting) -> EddyCurrents:
        if fields.magnetic_tensor is not None:
            moments = numbers(fields.magnetic_tensor, around)
        else:
            moments = [_of_sphere(fields, around)] * 3
        return cls.within(fields, around, moments=moments)

    def acts(self) -> bool:
        return any(x != 0 for x in self.moments) and any(x != 0 for x in self.field.source)

    def torque(self, m: Kinematics) -> list[Term]:
        """Sum over axes k, l of the constant vectors M_k e_k x e_l times (w x b)_k b_l, b the field over its
        size.
        """
        if not self.acts():
            return []
        context, b, terms = m.scene.context, self.b(m), []
        scale, axes = context.ldexp(self.field.size(m.scene) ** 2, -m.scaling.momentum), unit_vectors(context)
        induced = cross(m.rates, b)
        for k, moment in enumerate(self.moments):
            for n, axis in enumerate(axes):
                if moment != 0 and n != k:
                    vector = cross([scale * moment * x for x in axes[k]], axis)
                    terms.append((vector, induced[k] * b[n]))
        return terms

    def direction(self, scene: Scene) -> Vector | None:
        return self.field.source if self.field.uniform else None

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool:
        """False: it damps any spin across the field."""
        return False

    def amplitude(self, scene: Scene) -> Any:
        return scene.context.zero  # it only removes energy


def _of_sphere(fields: EddyCurrentsFields, around: Setting) -> Any:
    assert fields.conductivity is not None
    assert fields.radius is not None
    context, radius = around.context, fields.radius.at(around.context)
    inside = context.zero
    if fields.thickness is not None:
        inside = radius - fields.thickness.at(context)
        if inside < 0:
            what = f"given {float(fields.thickness):g}; more than 0, up to the radius, is allowed"
            raise around.fault("thickness", what)
    return 2 * context.pi / 15 * fields.conductivity.at(context) * (radius**5 - inside**5)
