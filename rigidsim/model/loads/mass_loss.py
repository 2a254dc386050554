"""Mass that leaves the body, as through a nozzle, and takes its angular momentum along: jet damping.

Mass that leaves at a point rho from the centre of mass, at the rate mu kg/s, with a velocity relative to the
body that gives no torque by itself, takes off the angular momentum mu rho x (w x rho) that it has because the
body turns (Thomson, Introduction to Space Dynamics, 1961). About the centre of mass

    I w' = (I w) x w - I' w - mu <rho x (w x rho)> + N.

The mean is taken over the exit. For a round one of radius a, whose axis n points from the centre of mass to
its middle,

    <rho x (w x rho)> = (l^2 + a^2/4) (w - n (n . w)) + (a^2/2) n (n . w),    l = |rho|

(Eke and Wang 1995). I' is the rate of principal_moments, which say how the body's own
mass distribution changes: nothing here changes them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pydantic import Field

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.model.names import written
from rigidsim.scene.arithmetic import Matrix, Vector, norm
from rigidsim.scene.exact import ZERO
from rigidsim.scene.expressions.tree import (
    Constant,
    Expression,
    states_read,
)
from rigidsim.scene.fields import Formula, Metre, NotNegative, Triple
from rigidsim.scene.registry import LoadFields, Setting, register_load


class MassLossFields(LoadFields):
    """Mass that leaves the body and takes its angular momentum along (jet damping)."""

    kind: Literal["mass_loss"]
    rate: Formula = Field(
        description="mass that leaves per time, kg/s, at least 0: an expression of t, the state, [[states]] "
        "and [parameters], or a number",
        examples=["0.5", "2*exp(-t/10)"],
    )
    exit_point: Triple[Metre] = Field(
        description="middle of the exit, in body axes from the reference point", examples=[[0, 0, -2]]
    )
    exit_radius: NotNegative[Metre] = Field(
        default=ZERO,
        description="radius of a round exit, whose axis points from the centre of mass to its middle",
        examples=[0.3],
    )


@register_load
@dataclass(frozen=True)
class MassLoss(Load):
    """The torque -mu G w of mass that leaves at the rate mu, kg/s; G is <rho^2 - rho rho^T>, m^2 (mpf)."""

    rate: Expression
    geometry: Matrix
    arm: Vector  # from the centre of mass to the middle of the exit, body axes, m (mpf)

    Fields = MassLossFields
    title = "mass_loss"

    @classmethod
    def resolve(cls, fields: MassLossFields, around: Setting) -> MassLoss:
        context = around.context
        rate = around.expression("rate", fields.rate, "kg/s")
        if around.free_flight:
            raise around.fault(
                "mass_loss",
                "given for a body with a position or velocity, whose flight has a constant mass; leave "
                "out [initial] position and velocity",
            )
        point = [x.at(context) for x in fields.exit_point]
        arm = [x - c for x, c in zip(point, around.body.center_of_mass, strict=True)]
        radius, length = fields.exit_radius.at(context), norm(context, arm)
        if radius != 0 and length == 0:
            raise around.fault(
                "exit_point",
                "given the centre of mass, from which the axis of a round exit points to its middle; "
                "give another point, or leave out exit_radius",
            )
        geometry = []
        for i, x in enumerate(arm):
            row = [-x * y for y in arm]
            row[i] = row[i] + length**2
            if radius != 0:  # a^2/4 (1 + n n^T)
                row = [g + radius**2 / 4 * x * y / length**2 for g, y in zip(row, arm, strict=True)]
                row[i] = row[i] + radius**2 / 4
            geometry.append(row)
        return cls(rate, geometry, arm)

    def acts(self) -> bool:
        vanishes = isinstance(self.rate, Constant) and self.rate.value.sign == 0
        return not vanishes and any(x != 0 for row in self.geometry for x in row)

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return states_read(self.rate)

    def torque(self, m: Kinematics) -> list[Term]:
        """Refused with a weight, whose torque is for a constant mass."""
        context, scaling = m.scene.context, m.scaling
        if m.scene.torque_arm is not None:
            raise ConfigError(
                Problem(
                    self.rate.where,
                    "given with uniform_gravity on a body that is held off its centre of mass, whose "
                    "weight takes a constant mass; hold it at its centre of mass",
                )
            )
        (rate,), terms = written(m, [self.rate]), []
        for column, (state, unit) in enumerate(zip(m.rate_states, m.numbers.rate_units, strict=True)):
            size = context.ldexp(unit, -scaling.time - scaling.energy)
            vector = [-size * row[column] for row in self.geometry]
            if any(x != 0 for x in vector):
                terms.append((vector, rate * state))
        return terms

    def never_negative(self) -> list[Expression]:
        return [self.rate]
