"""Names that users' expressions may read, as expressions of the states in SI units."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import heyoka as hy

from rigidsim.model.euler_poles import angles_of_matrix, starts_near_pole
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.rotations import Symbolic, euler_from_matrix, quaternion_from_matrix
from rigidsim.model.two_part_time import TwoPartTime
from rigidsim.scene.expressions.tree import ATTITUDE_NAMES, FLIGHT_NAMES, RATE_NAMES

TANGENT = "tangent_"
"""Prefix of the names of a tangent vector's states."""


def plain_angles(m: Kinematics) -> list[Symbolic]:
    """Euler angles of the scene's sequence within one turn, rad."""
    sequence = m.scene.config.integrator.euler_sequence
    if m.attitude is not None and m.attitude.sequence == sequence:
        return m.attitude.variables
    if starts_near_pole(m.scene):
        return angles_of_matrix(m, differentiable=True)
    return euler_from_matrix(sequence, m.matrix)


def carries_sign(m: Kinematics) -> bool:
    """Whether the quaternion's sign is a parameter: it matters, and the formulation loses it."""
    return m.surfaces.signed and m.attitude is not None and m.attitude.quaternion_sign != "state"


def state_names(m: Kinematics, names: Collection[str], *, clocked: bool = True) -> dict[str, Any]:
    """Expressions in SI units for the names that a user's expression reads; a ``TwoPartTime`` where the time
    takes two numbers.

    Parameters ``par[..]`` stand for what the state alone doesn't tell: after the sides of the surfaces, the
    full turns of angles, then the sign of the quaternion, then the second number of the time.

    Args:
        clocked: False to have the time as one number in any case.

    Raises:
        KeyError: a name that the scene doesn't carry.
    """
    context, scaling = m.scene.context, m.scaling

    def si(expression: Symbolic, exponent: int) -> Symbolic:
        return expression if exponent == 0 else m.number(context.ldexp(context.one, exponent)) * expression

    found: dict[str, Any] = {"t": si(hy.time, scaling.time)}
    if clocked and m.clocked:
        place = len(m.surfaces.found) + len(m.surfaces.turning) + carries_sign(m)
        found["t"] = TwoPartTime(context.ldexp(context.one, scaling.time), hy.par[place])
    for name, state, e in zip(RATE_NAMES, m.rate_states, scaling.rates, strict=True):
        found[name] = si(state, e - scaling.time)
    if m.attitude is not None and set(names) & set(ATTITUDE_NAMES):
        quaternion = m.attitude.quaternion
        if m.attitude.quaternion_sign == "nearest" and m.surfaces.found:
            quaternion = quaternion_from_matrix(m.matrix, differentiable=True)
        if carries_sign(m):
            sign = hy.par[len(m.surfaces.found) + len(m.surfaces.turning)]
            quaternion = [sign * x for x in quaternion]
        found |= zip(ATTITUDE_NAMES[:4], quaternion, strict=True)
        found |= zip(ATTITUDE_NAMES[4:], plain_angles(m), strict=True)
        turn = m.number(2 * context.pi)
        for number, name in enumerate(m.surfaces.turning, start=len(m.surfaces.found)):
            found[name] = found[name] + turn * hy.par[number]
    if m.position is not None and m.velocity is not None:
        found |= {n: si(x, scaling.length) for n, x in zip(FLIGHT_NAMES[:3], m.position, strict=True)}
        found |= {n: si(v, scaling.speed) for n, v in zip(FLIGHT_NAMES[3:], m.velocity, strict=True)}
    return {name: found[name] for name in names}
