"""Uniform gravity: a torque about a fixed point, or free fall of a body that moves."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import heyoka as hy
from pydantic import Field

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import potential_amplitude
from rigidsim.scene.arithmetic import Vector, cross, unit_vectors
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.exact import ExactNumber, parse_number
from rigidsim.scene.fields import Acceleration, Triple
from rigidsim.scene.registry import LoadFields, Setting, register_load
from rigidsim.scene.scene import Scene

STANDARD_GRAVITY = 9.80665  # m/s^2
_ON_EARTH = (
    0.01  # relative range of gravity on the ground of the Earth, 9.76 to 9.83 m/s^2, and of its rounding
)
_UPRIGHT = 0.9  # of its size: a pull along Z


def _standard_gravity() -> list[ExactNumber]:
    return [parse_number(a, "m/s^2") for a in ("0", "0", "-9.80665")]


class UniformGravityFields(LoadFields):
    """A uniform field: a torque about the fixed point, or free fall in a scene with a position."""

    kind: Literal["uniform_gravity"]
    acceleration: Triple[Acceleration] = Field(
        default_factory=_standard_gravity,
        description="acceleration of free fall, space axes",
        examples=[[0, 0, -3.72]],
        json_schema_extra={"default": [0, 0, -9.80665]},
    )


@register_load
@dataclass(frozen=True)
class UniformGravity(Load):
    """The sum of all uniform fields: a torque com x M R^T g about a fixed point, or free fall."""

    acceleration: Vector  # space axes, m/s^2 (mpf)
    pivoted: bool = False  # whether it turns the body about a fixed point
    Fields = UniformGravityFields
    title = "uniform_gravity"
    conservative = True

    @classmethod
    def resolve(cls, fields: UniformGravityFields, around: Setting) -> UniformGravity:
        return cls([a.at(around.context) for a in fields.acceleration])

    @classmethod
    def of(cls, scene: Scene) -> list[UniformGravity]:
        """All uniform fields of a scene combined into one load; an empty list if the scene has none."""
        return [] if scene.gravity is None else [cls(scene.gravity, scene.torque_arm is not None)]

    @property
    def uniform_field(self) -> Vector:  # type: ignore[override]
        return self.acceleration

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return frozenset({"vertical"} if self.pivoted else ())

    def amplitude(self, scene: Scene) -> Any:
        """M g l, half the range of the potential energy about a fixed point; zero in free fall."""
        return potential_amplitude(scene)

    def torque(self, m: Kinematics) -> list[Term]:
        """Torque of the weight about the fixed point, vertical x arm."""
        if m.vertical is None or m.numbers.arm is None:
            return []
        units = unit_vectors(m.scene.context)
        return [(cross(units[a], m.numbers.arm), m.vertical[a]) for a in range(3)]

    def force(self, m: Kinematics) -> list[Term]:
        """Free-fall acceleration of the centre of mass."""
        if m.velocity is None or m.scene.gravity is None:
            return []
        context, scaling = m.scene.context, m.scaling
        pull = [context.ldexp(g, scaling.time - scaling.speed) for g in m.scene.gravity]
        return [(pull, hy.expression(1.0))]

    def potential(self, m: Kinematics) -> Symbolic | None:
        """Potential energy: M g times the height above the fixed point, or -M g . x in free flight."""
        context, scene, scaling = m.scene.context, m.scene, m.scaling
        if m.vertical is not None and m.numbers.arm is not None:
            return hy.sum([m.number(a) * v for a, v in zip(m.numbers.arm, m.vertical, strict=True) if a])
        mass = scene.body.mass
        if m.position is None or scene.gravity is None or mass is None:
            return None
        weights = [context.ldexp(-mass * g, scaling.length - scaling.energy) for g in scene.gravity]
        terms = [m.number(k) * x for k, x in zip(weights, m.position, strict=True) if k]
        return hy.sum(terms) if terms else None

    def linear_potential(self, scene: Scene) -> tuple[Vector, Vector] | None:
        """M com (body axes) and g (space axes) about a fixed point; None in free fall."""
        return None if scene.torque_arm is None else (scene.torque_arm, self.acceleration)

    def cautions(self, fields: UniformGravityFields, where: str, scene: Scene) -> Iterator[Caution]:
        pull = [float(x) for x in fields.acceleration]
        size = math.hypot(*pull)
        standard = abs(size / STANDARD_GRAVITY - 1) < _ON_EARTH or size == 10
        if standard and pull[2] > _UPRIGHT * size:
            given = ", ".join(f"{x:.6g}" for x in pull)
            falling = ", ".join(f"{-x + 0.0:.6g}" for x in pull)
            what = f"given [{given}], which points up along Z; write [{falling}] for a fall down along -Z"
            yield Caution(WarningCode.GRAVITY_UPWARDS, f"{where} acceleration: {what}")
