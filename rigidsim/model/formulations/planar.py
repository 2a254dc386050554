"""Planar motion: a body that turns about a principal axis along which all torques point, carried in two
states.

A spin about a principal axis along an orbit's normal stays there: neither the gyroscopic term I w x w nor the
torque of a gravity gradient has a part across it. Then the angle about that axis and its rate are the whole
motion (Goldreich & Peale 1966, Astron. J. 71, 425, eq. 1),

    angle' = spin,   I_k spin' = torque . k,

and the stability of a body that is pushed out of the plane isn't examined.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import heyoka as hy

from rigidsim.model import rotations
from rigidsim.model.carriers import carried_beside
from rigidsim.model.formulations.formulation import Formulation, ModelPlan, Unsuited, formulates
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.probing import turned_out
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.state_blocks import AttitudeStates, StateBlock
from rigidsim.model.two_part import as_factor
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, negligible, norm
from rigidsim.scene.choices import FORMULATIONS
from rigidsim.scene.scene import Scene

ANGLE, SPIN = "angle", "spin"
ANGLE_UNIT = 20
"""The angle is carried in units of 2**20 rad, so that it never becomes the largest state (to which step
control is relative), however often the body has turned.
"""


@formulates(FORMULATIONS["planar"])
class Planar(Formulation):
    """The angle (initially ``angle``, mpf) about a principal axis (unit, body axes), and its rate.

    It counts from ``origin``, the smallest rotation that takes the axis to its direction in space.
    """

    carries_rates = False
    twin = "planar"

    def __init__(self, axis: Vector, origin: Vector, angle: Any, why: str) -> None:
        self._axis, self._origin, self._angle, self.why = axis, origin, angle, why

    @classmethod
    def of(cls, scene: Scene, loads: Sequence[Load], why: str = "") -> Planar:
        try:
            return cls(*_plane_of(scene, loads), why)
        except Unsuited as against:
            for_what = "it is for a body that turns about a principal axis with every torque along it"
            raise Unsuited(f'{against}; {for_what}, such as the normal of its orbit; choose "auto"') from None

    @classmethod
    def by_gradients(cls, scene: Scene, loads: Sequence[Load]) -> Planar | None:
        """The formulation for a motion that gravity gradients keep in a plane; None for any other."""
        why = "the body turns about a principal axis, along which every torque points and stays "
        why += '(formulation = "quaternion" carries the full motion)'
        try:
            return cls.of(scene, loads, why) if any(load.has_source for load in loads) else None
        except Unsuited:
            return None

    def rotation(self, plan: ModelPlan, number: Rounder) -> tuple[list[Symbolic], AttitudeStates]:
        state, spin = hy.make_vars(ANGLE, SPIN)
        angle = 2.0**ANGLE_UNIT * state
        axis = [as_factor(number(x)) for x in self._axis]
        base = [[as_factor(number(x)) for x in row] for row in attitude.rotation_matrix(self._origin)]
        about = _turn_about(self._axis, angle, number)
        half = 0.5 * angle
        c, s = hy.cos(half), hy.sin(half)
        quaternion = rotations.quaternion_product(
            [as_factor(number(x)) for x in self._origin], [c, *(x * s for x in axis)]
        )
        states = AttitudeStates(
            [ANGLE],
            [2.0**-ANGLE_UNIT * spin],
            [plan.scene.context.ldexp(self._angle, -ANGLE_UNIT)],
            rotations.multiply(base, about),
            quaternion,
            "wrapping",
            angles=(0,),
            angle_unit=ANGLE_UNIT,
            chord=2.0**ANGLE_UNIT,
            momenta=(SPIN,),
        )
        return [x * spin for x in axis], states

    def blocks(self, m: Mechanics, plan: ModelPlan) -> list[StateBlock]:
        states, axis, why = m.carried(m.attitude), self._axis, plan.requirements.why["attitude"]
        spin = m.scene.context.ldexp(dot(m.scene.angular_velocity, axis), m.scaling.time)
        block = StateBlock(
            [*states.names, SPIN],
            [*states.derivatives, self._spin_equation(m)],
            [*states.initial, spin],
            exponents=[ANGLE_UNIT, -m.scaling.time],
            why=why + (f"; {self.why}" if self.why else ""),
        )
        return [block]

    def _spin_equation(self, m: Mechanics) -> Symbolic:
        """Right-hand side of I_k spin' = torque . k, solved for spin'."""
        axis, context = self._axis, m.scene.context
        moment = dot(axis, apply(m.numbers.inertia, axis))
        terms = []
        for vector, expression in m.torque:
            along = dot(axis, vector)
            if abs(along) > negligible(context) * norm(context, vector):
                terms.append(m.number(along / moment) * expression)
        return hy.sum(terms)


def _plane_of(scene: Scene, loads: Sequence[Load]) -> tuple[Vector, Vector, Any]:
    """Axis, origin and angle of a motion that stays in a plane; ``Unsuited`` where that isn't known."""
    if scene.free_flight:
        raise Unsuited("the body has a position and flies")
    if beside := carried_beside(loads):
        raise Unsuited(beside)
    context = scene.context
    axis = _spin_axis(scene, loads)
    normal = apply(attitude.rotation_matrix(scene.quaternion), axis)
    if (load := turned_out(scene, loads, axis)) is not None:
        raise Unsuited(f"the torque of {load.title} may turn the body out of its plane")
    turned = _least_turn(context, axis, normal)
    # the remaining rotation is about the axis, and the scalar product gives its half angle
    w, *v = attitude.product([turned[0], *(-x for x in turned[1:])], list(scene.quaternion))
    half = context.atan2(dot(v, axis), w)
    angle = 2 * half
    if angle > context.pi:
        angle, turned = angle - 2 * context.pi, [-x for x in turned]
    elif angle <= -context.pi:
        angle, turned = angle + 2 * context.pi, [-x for x in turned]
    return axis, turned, angle


def _spin_axis(scene: Scene, loads: Sequence[Load]) -> Vector:
    """Axis that the body turns about; at rest, the principal axis that lies along an orbit's normal."""
    context, rates = scene.context, scene.angular_velocity
    tiny = negligible(context)
    size = norm(context, rates)
    if size != 0:
        axis = [w / size for w in rates]
        momentum = apply(scene.body.inertia, axis)
        if norm(context, cross(axis, momentum)) > tiny * max(scene.body.principal_moments):
            raise Unsuited("the body doesn't turn about a principal axis")
        return axis
    for axis in scene.body.principal_axes[::-1]:
        if turned_out(scene, loads, axis) is None:
            return list(axis)
    raise Unsuited("the body is at rest, and none of its principal axes is one that every torque is along")


def _least_turn(context: Any, axis: Vector, normal: Vector) -> Vector:
    """Quaternion of the smallest rotation that takes one unit vector to another; exact if they coincide."""
    tiny = negligible(context)
    across, along = cross(axis, normal), dot(axis, normal)
    if norm(context, across) <= tiny:
        if along > 0:
            return [context.one] + [context.zero] * 3
        least = min(range(3), key=lambda i: abs(axis[i]))  # half a turn about an axis across it
        other = [context.one if i == least else context.zero for i in range(3)]
        found = cross(axis, other)
        length = norm(context, found)
        return [context.zero, *(x / length for x in found)]
    return attitude.unit_quaternion(context, [1 + along, *across])


def _turn_about(axis: Vector, angle: Symbolic, number: Rounder) -> rotations.SymbolicMatrix:
    """Rotation matrix about a unit axis k (Rodrigues): k k^T + cos (1 - k k^T) + sin [k]x."""
    c, s = hy.cos(angle), hy.sin(angle)
    x, y, z = axis
    skew = [[0 * x, -z, y], [z, 0 * x, -x], [-y, x, 0 * x]]

    def entry(a: int, b: int) -> Symbolic:
        along = axis[a] * axis[b]
        constants = along, (1 if a == b else 0) - along, skew[a][b]
        factors = zip(constants, (rotations.constant(1.0), c, s), strict=True)
        return hy.sum([as_factor(number(k)) * factor for k, factor in factors if k != 0])

    return [[entry(a, b) for b in range(3)] for a in range(3)]
