"""Euler angles of a rotation matrix R that mean R at the poles of their sequence, too.

With f the sine (proper sequences) or cosine (the others) of the middle angle, R contains sine and cosine of
the outer angles a and c times f. Rounding errors e leave each of them uncertain by e / f, and where f
vanishes neither is defined. What R gives to rounding there is the turn about the axis that both share,

    a + s c,   s = sign(R_ii) for a proper sequence iji, sign(R_ik) for ijk.

So near a pole the last angle is what the first one leaves of this turn, and the error of the first moves R by
no more than e. In the pole itself the first has the value of the start here; what is recorded keeps the one
of the sample before (``rigidsim.solve.turns``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.rotations import Symbolic, constant
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import working_epsilon
from rigidsim.scene.rotations import AXES, is_proper, outer_angles, parity, pole_side, shared_turn
from rigidsim.scene.scene import Scene

UNDEFINED = 16.0
"""Rounding errors of an angle's sine and cosine below which both are pure rounding."""

NEAR = 2.0**-6
"""Singular factor below which the outer angles are taken from the turn that they share. Above it each is
taken by itself, with an error of some 64 roundings.
"""


@dataclass(frozen=True)
class Poles:
    """Where the outer Euler angles of a sequence are undefined: the square of a factor vanishes there."""

    sequence: str
    squared_factor: Symbolic


def angles_of_matrix(m: Kinematics, *, differentiable: bool = False) -> list[Symbolic]:
    """Euler angles of the scene's sequence within one turn, rad; where branches that aren't selected must
    have finite derivatives, the middle one, which has a kink in the pole, is constant there.
    """
    sequence, r, context = m.scene.config.integrator.euler_sequence, m.matrix, m.scene.context
    half, whole = (hy.expression(m.number(x)) for x in (context.pi, 2 * context.pi))
    square = squared_factor(m)
    lost, near = hy.lt(square, m.number(_undefined(context))), hy.lt(square, NEAR**2)
    (y, x), (v, u) = outer_angles(sequence, r)
    if differentiable:
        y, x = hy.select(lost, constant(0.0), y), hy.select(lost, constant(1.0), x)
        v, u = hy.select(near, constant(0.0), v), hy.select(near, constant(1.0), u)
        square = hy.select(lost, constant(0.25), square)
    along = pole_side(sequence, r)
    side = hy.select(hy.gt(along, 0.0), constant(1.0), constant(-1.0))
    factor = hy.sqrt(square)
    if is_proper(sequence):
        middle, end = hy.atan2(factor, along), hy.select(hy.gt(along, 0.0), constant(0.0), half)
    else:
        sign = parity(*map(AXES.index, sequence[:2]))
        middle, end = hy.atan2(sign * along, factor), 0.5 * (sign * (side * half))
    if differentiable:
        middle = hy.select(lost, end, middle)
    first = hy.select(lost, hy.expression(m.number(first_at_start(m.scene))), hy.atan2(y, x))
    last = side * (hy.atan2(*shared_turn(sequence, r, side)) - first)
    last = hy.select(hy.gt(last, half), last - whole, hy.select(hy.lt(last, -half), last + whole, last))
    return [first, middle, hy.select(near, last, hy.atan2(v, u))]


def squared_factor(m: Kinematics) -> Symbolic:
    """Square of the factor that vanishes in the poles."""
    y, x = components_of_factor(m)
    return y * y + x * x


def components_of_factor(m: Kinematics) -> list[Symbolic]:
    """Two elements of R that vanish in the poles, and nowhere else together."""
    return list(outer_angles(m.scene.config.integrator.euler_sequence, m.matrix)[1])


def first_at_start(scene: Scene) -> Any:
    """The first angle (mpf) of the start within one turn; in a pole the one given, or all of the turn."""
    context, sequence = scene.context, scene.config.integrator.euler_sequence
    if scene.euler_angles is not None:
        first = scene.euler_angles[0]
        return context.atan2(context.sin(first), context.cos(first))
    return attitude.euler_from_matrix(context, attitude.rotation_matrix(scene.quaternion), sequence)[0]


def starts_near_pole(scene: Scene) -> bool:
    """Whether the motion starts where the outer angles are taken from the turn that they share."""
    return bool(_factor_at_start(scene) < NEAR**2)


def starts_in_pole(scene: Scene) -> bool:
    """Whether the motion starts where the outer angles are undefined."""
    return bool(_factor_at_start(scene) < _undefined(scene.context))


def _factor_at_start(scene: Scene) -> Any:
    """Square of the factor that vanishes in the poles."""
    sequence = scene.config.integrator.euler_sequence
    y, x = outer_angles(sequence, attitude.rotation_matrix(scene.quaternion))[1]
    return y * y + x * x


def _undefined(context: Any) -> Any:
    return (UNDEFINED * working_epsilon(context)) ** 2
