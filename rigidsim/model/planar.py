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
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model import rotations
from rigidsim.model.capabilities import KeepsPlane, has_source
from rigidsim.model.carriers import carried_beside
from rigidsim.model.formulations import AttitudeStates
from rigidsim.model.load import Load, Term
from rigidsim.model.numbers import Rounder, ScaledNumbers
from rigidsim.model.rotations import Symbolic
from rigidsim.model.two_part import as_factor
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, negligible, norm
from rigidsim.scene.scene import Scene

ANGLE, SPIN = "angle", "spin"
ANGLE_UNIT = 20
"""The angle is carried in units of 2**20 rad, so that it never becomes the largest state (to which step
control is relative), however often the body has turned.
"""


class NotPlanar(Exception):
    """Raised with a reason if the motion leaves the plane, or can't be shown to stay in it."""


@dataclass(frozen=True)
class PlaneOfMotion:
    """The plane of a planar motion.

    Attributes:
        axis: principal axis that the body turns about, unit, body axes (mpf).
        normal: the same in space axes.
        quaternion: attitude that takes the axis to the normal, from which the angle counts; the smallest
            such rotation.
        angle: initial angle, rad (mpf).
    """

    axis: Vector
    normal: Vector
    quaternion: Vector
    angle: Any


@dataclass(frozen=True)
class PlanarStates:
    """Attitude states of a planar motion (a single angle), and the angular velocity that its spin stands for.

    Attributes:
        rates: angular velocity, body axes, in units of 1/time.
        initial_spin: spin at the start (mpf), internal units.
    """

    attitude: AttitudeStates
    rates: list[Symbolic]
    initial_spin: Any


def plane_of(scene: Scene, loads: Sequence[Load]) -> PlaneOfMotion:
    """The plane that a motion stays in.

    Raises:
        NotPlanar: the motion isn't known to stay in a plane; says why.
    """
    if scene.free_flight:
        raise NotPlanar("the body has a position and flies")
    if beside := carried_beside(loads):
        raise NotPlanar(beside)
    context = scene.context
    axis = _spin_axis(scene, loads)
    normal = apply(attitude.rotation_matrix(scene.quaternion), axis)
    for load in loads:
        if not _keeps(load, scene, axis, normal):
            raise NotPlanar(f"the torque of {load.title} may turn the body out of its plane")
    turned = _least_turn(context, axis, normal)
    # the remaining rotation is about the axis, and the scalar product gives its half angle
    w, *v = attitude.product([turned[0], *(-x for x in turned[1:])], list(scene.quaternion))
    half = context.atan2(dot(v, axis), w)
    angle = 2 * half
    if angle > context.pi:
        angle, turned = angle - 2 * context.pi, [-x for x in turned]
    elif angle <= -context.pi:
        angle, turned = angle + 2 * context.pi, [-x for x in turned]
    return PlaneOfMotion(axis, normal, turned, angle)


def gradient_plane(scene: Scene, loads: Sequence[Load]) -> PlaneOfMotion | None:
    """The plane of a motion under gravity gradients if it stays in one; None otherwise."""
    if not any(map(has_source, loads)):
        return None
    try:
        return plane_of(scene, loads)
    except NotPlanar:
        return None


def asked_plane(scene: Scene, loads: Sequence[Load]) -> PlaneOfMotion:
    """The plane of a motion for which ``formulation = "planar"`` is given.

    Raises:
        ConfigError: the motion stays in no plane.
    """
    try:
        return plane_of(scene, loads)
    except NotPlanar as why:
        raise ConfigError(
            Problem(
                "[integrator] formulation",
                f'given "planar", but {why}; it is for a body that turns about a principal axis with every '
                'torque along it, such as the normal of its orbit; choose "auto"',
            )
        ) from None


def planar_states(scene: Scene, plane: PlaneOfMotion, time_exponent: int, number: Rounder) -> PlanarStates:
    """Set up the angle and the spin.

    Args:
        time_exponent: binary exponent of the internal unit of time in seconds.
        number: from an mpf to the working precision's scalar, rounded once.
    """
    context = scene.context
    state, spin = hy.make_vars(ANGLE, SPIN)
    angle = 2.0**ANGLE_UNIT * state
    axis = [as_factor(number(x)) for x in plane.axis]
    base = [[as_factor(number(x)) for x in row] for row in attitude.rotation_matrix(plane.quaternion)]
    about = _turn_about(plane.axis, angle, number)
    half = 0.5 * angle
    c, s = hy.cos(half), hy.sin(half)
    quaternion = rotations.quaternion_product(
        [as_factor(number(x)) for x in plane.quaternion], [c, *(x * s for x in axis)]
    )
    states = AttitudeStates(
        "planar",
        [ANGLE],
        [2.0**-ANGLE_UNIT * spin],
        [context.ldexp(plane.angle, -ANGLE_UNIT)],
        rotations.multiply(base, about),
        quaternion,
        "wrapping",
        angles=(0,),
        angle_unit=ANGLE_UNIT,
    )
    rate = context.ldexp(dot(scene.angular_velocity, plane.axis), time_exponent)
    return PlanarStates(states, [x * spin for x in axis], rate)


def spin_equation(
    plane: PlaneOfMotion, numbers: ScaledNumbers, torque: list[Term], number: Rounder, context: Any
) -> Symbolic:
    """Right-hand side of I_k spin' = torque . k, solved for spin'.

    Args:
        torque: terms of all loads, body axes, internal units.
    """
    moment = dot(plane.axis, apply(numbers.inertia, plane.axis))
    tiny = negligible(context)
    terms = []
    for vector, expression in torque:
        along = dot(plane.axis, vector)
        if abs(along) > tiny * norm(context, vector):
            terms.append(number(along / moment) * expression)
    return hy.sum(terms) if terms else hy.expression(0.0)


def _keeps(load: Load, scene: Scene, axis: Vector, normal: Vector) -> bool:
    return isinstance(load, KeepsPlane) and load.keeps_plane(scene, axis, normal)


def _spin_axis(scene: Scene, loads: Sequence[Load]) -> Vector:
    """Axis that the body turns about; at rest, the principal axis that lies along an orbit's normal."""
    context, rates = scene.context, scene.angular_velocity
    tiny = negligible(context)
    size = norm(context, rates)
    if size != 0:
        axis = [w / size for w in rates]
        momentum = apply(scene.body.inertia, axis)
        if norm(context, cross(axis, momentum)) > tiny * max(scene.body.principal_moments):
            raise NotPlanar("the body doesn't turn about a principal axis")
        return axis
    matrix = attitude.rotation_matrix(scene.quaternion)
    for axis in scene.body.principal_axes[::-1]:
        if all(_keeps(load, scene, axis, apply(matrix, axis)) for load in loads):
            return list(axis)
    raise NotPlanar("the body is at rest, and none of its principal axes is one that every torque is along")


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
