"""Torques and forces that a user gives as expressions of time and the state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from pydantic import Field

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.model.names import written
from rigidsim.model.rotations import Symbolic, apply, transpose
from rigidsim.scene.arithmetic import Vector, cross, diagonal
from rigidsim.scene.expressions.tree import (
    Constant,
    Expression,
    names_used,
    states_read,
)
from rigidsim.scene.fields import Formula, Metre, Triple
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
        return not all(_vanishes(component) for component in self.components)

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


def _vanishes(component: Expression) -> bool:
    return isinstance(component, Constant) and component.value.sign == 0


@register_load
class Torque(Applied):
    """A torque given by expressions."""

    Fields = TorqueFields
    title = "torque"
    unit = "N m"

    def torque(self, m: Kinematics) -> list[Term]:
        size = m.scene.context.ldexp(m.scene.context.one, -m.scaling.energy)
        return list(zip(diagonal([size] * 3), self._in_body(m), strict=True))


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
        context = m.scene.context
        found = written(m, self.components)
        if self.frame == "body":
            found = apply(m.matrix, found)
        size = context.ldexp(1 / m.carried(m.scene.body.mass), m.scaling.time - m.scaling.speed)
        return list(zip(diagonal([size] * 3), found, strict=True))
