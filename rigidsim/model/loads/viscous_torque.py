"""Viscous torque: damping in proportion to each body rate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from pydantic import Field

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.fields import Damping, NotNegative, Triple
from rigidsim.scene.registry import LoadFields, Setting, register_load
from rigidsim.scene.scene import Scene


class ViscousTorqueFields(LoadFields):
    """A torque -c_i w_i about each body axis."""

    kind: Literal["viscous_torque"]
    coefficients: Triple[NotNegative[Damping]] = Field(
        description="c_i of the torque -c_i w_i about each body axis, zero or more",
        examples=[[0.01, 0.01, 0.02]],
    )


@register_load
@dataclass(frozen=True)
class ViscousTorque(Load):
    """Torque -c_i w_i about the body axes; ``coefficients`` in kg m^2/s (mpf)."""

    coefficients: Vector
    Fields = ViscousTorqueFields
    title = "viscous_torque"

    @classmethod
    def resolve(cls, fields: ViscousTorqueFields, around: Setting) -> ViscousTorque:
        return cls([c.at(around.context) for c in fields.coefficients])

    def acts(self) -> bool:
        return any(c != 0 for c in self.coefficients)

    def damping(self) -> Vector | None:
        return self.coefficients

    def amplitude(self, scene: Scene) -> Any:
        return scene.context.zero  # it only removes energy

    def torque(self, m: Kinematics) -> list[Term]:
        context = m.scene.context
        terms: list[Term] = []
        for i, coefficient in enumerate(self.coefficients):
            if coefficient != 0:
                scaled = context.ldexp(coefficient, -m.scaling.momentum)
                vector = [-scaled * m.numbers.rate_units[i] if i == j else context.zero for j in range(3)]
                terms.append((vector, m.rate_states[i]))
        return terms
