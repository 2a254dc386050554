"""Torques and forces that a user gives: as expressions of time and the state, as damping in proportion to
each body rate, and by mass that leaves the body, as through a nozzle, and takes its angular momentum along.

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
from typing import Any, ClassVar, Literal

from pydantic import Field

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.model.kinematics import Kinematics, along_axes
from rigidsim.model.load import Load, Term
from rigidsim.model.names import written
from rigidsim.model.rotations import Symbolic, apply, transpose
from rigidsim.scene.arithmetic import Matrix, Vector, cross, diagonal, norm
from rigidsim.scene.exact import ZERO
from rigidsim.scene.expressions.tree import Constant, Expression, names_used, states_read
from rigidsim.scene.fields import Damping, Formula, Metre, NotNegative, Triple
from rigidsim.scene.registry import LoadFields, Setting, register_load
from rigidsim.scene.scene import Scene

_LONGEST = 60  # characters of an expression that are shown


def _axes(default: str) -> Any:
    return Field(default=default, description="axes of the components: body or space")


class TorqueFields(LoadFields):
    """A torque as expressions of t, the state and [parameters], N m."""

    kind: Literal["torque"]
    components: Triple[Formula] = Field(
        description="in N m: expressions of t, the state and [parameters], or numbers",
        examples=[["0", "0", "k*sin(t)^2"]],
    )
    frame: Literal["body", "space"] = _axes("body")


class ForceFields(LoadFields):
    """A force as expressions, N, at a point of the body (from the reference point; default the centre of
    mass).
    """

    kind: Literal["force"]
    components: Triple[Formula] = Field(
        description="in N: expressions of t, the state and [parameters], or numbers",
        examples=[["0", "0", "-c*vz"]],
    )
    frame: Literal["body", "space"] = _axes("space")
    point: Triple[Metre] | None = Field(
        default=None,
        description="point of application, in body axes from the reference point; by default the centre "
        "of mass",
        examples=[[0, 0, 0.2]],
    )


@dataclass(frozen=True)
class Applied(Load):
    """A torque or a force given by expressions; its work is integrated, since it need have no potential."""

    unit: ClassVar[str]  # of the components, SI
    components: tuple[Expression, Expression, Expression]
    frame: str  # axes of the components, "body" or "space"
    arm: Vector  # from the reference point to the force's point, body axes, m (mpf)
    pushes: bool  # whether it accelerates the centre of mass

    @classmethod
    def resolve(cls, fields: Any, around: Setting) -> Applied:
        texts = enumerate(fields.components)
        first, second, third = (around.expression(f"components[{i}]", text, cls.unit) for i, text in texts)
        point = getattr(fields, "point", None)
        arm = around.body.center_of_mass if point is None else [x.at(around.context) for x in point]
        pushes = cls.title == "force" and around.free_flight
        return cls((first, second, third), fields.frame, arm, pushes)

    def acts(self) -> bool:
        return any(not isinstance(x, Constant) or x.value.sign for x in self.components)

    @property
    def names(self) -> frozenset[str]:
        """Names that the expressions use."""
        return names_used(*self.components)

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        turns = self.title == "torque" or any(x != 0 for x in self.arm)
        crosses = (turns and self.frame == "space") or (self.pushes and self.frame == "body")
        found = states_read(*self.components)
        return found | ({"attitude"} if crosses else set()) | ({"flight"} if self.pushes else set())

    def _in_body(self, m: Kinematics) -> list[Symbolic]:
        found = written(m, self.components)
        return apply(transpose(m.matrix), found) if self.frame == "space" else found

    def linear_potential(self, scene: Scene) -> tuple[Vector, Vector] | None:
        """Arm and force, if the force is constant in space; None otherwise."""
        found = [x.value for x in self.components if isinstance(x, Constant)]
        if self.title != "force" or self.frame != "space" or len(found) < 3:
            return None
        return self.arm, [value.at(scene.context) for value in found]


@register_load
class Torque(Applied):
    """A torque given by expressions."""

    Fields = TorqueFields
    title = "torque"
    unit = "N m"

    def torque(self, m: Kinematics) -> list[Term]:
        return along_axes(m, 1, -m.scaling.energy, self._in_body(m))


@register_load
class Force(Applied):
    """A force given by expressions."""

    Fields = ForceFields
    title = "force"
    unit = "N"

    def torque(self, m: Kinematics) -> list[Term]:
        """Torque arm x force."""
        if all(x == 0 for x in self.arm):
            return []
        size = m.scene.context.ldexp(m.scene.context.one, -m.scaling.energy)
        arms = [cross(self.arm, axis) for axis in diagonal([size] * 3)]
        return list(zip(arms, self._in_body(m), strict=True))

    def force(self, m: Kinematics) -> list[Term]:
        """Acceleration of a freely flying body: the force over its mass."""
        if m.velocity is None:
            return []
        found = written(m, self.components)
        if self.frame == "body":
            found = apply(m.matrix, found)
        return along_axes(m, 1 / m.carried(m.scene.body.mass), m.scaling.time - m.scaling.speed, found)


# --- damping and mass that leaves ---------------------------------------------------------------------------


def _against_rates(m: Kinematics, damping: Matrix, factor: Symbolic | None = None) -> list[Term]:
    """Torque -D w of a constant matrix (mpf, kg m^2/s), perhaps times a factor."""
    terms: list[Term] = []
    for column, (state, unit) in enumerate(zip(m.rate_states, m.numbers.rate_units, strict=True)):
        size = m.scene.context.ldexp(unit, -m.scaling.momentum)
        vector = [-size * row[column] for row in damping]
        if any(x != 0 for x in vector):
            terms.append((vector, state if factor is None else factor * state))
    return terms


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
        return _against_rates(m, diagonal(self.coefficients))


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
        ensure(
            not around.free_flight,
            around.fault(
                "mass_loss",
                "given for a body with a position or velocity, whose flight has a constant mass; leave "
                "out [initial] position and velocity",
            ),
        )
        point = [x.at(context) for x in fields.exit_point]
        arm = [x - c for x, c in zip(point, around.body.center_of_mass, strict=True)]
        radius, length = fields.exit_radius.at(context), norm(context, arm)
        ensure(
            radius == 0 or length != 0,
            around.fault(
                "exit_point",
                "given the centre of mass, from which the axis of a round exit points to its middle; "
                "give another point, or leave out exit_radius",
            ),
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
        ensure(
            m.scene.torque_arm is None,
            ConfigError(
                Problem(
                    self.rate.where,
                    "given with uniform_gravity on a body that turns about another point than its centre "
                    "of mass: the weight needs a constant mass; use the centre of mass",
                )
            ),
        )
        (rate,) = written(m, [self.rate])
        return _against_rates(m, self.geometry, rate)

    def never_negative(self) -> list[Expression]:
        return [self.rate]
