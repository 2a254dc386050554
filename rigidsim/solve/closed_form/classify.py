"""Selection of a scene's closed form, in internal units, or the reason why it has none."""

from __future__ import annotations

import mpmath

from rigidsim.model.scaling import Scaling
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Matrix, Vector, cross, dot, negligible, norm
from rigidsim.scene.scene import Scene
from rigidsim.solve.closed_form.free import free_motion, spinning
from rigidsim.solve.closed_form.heavy import heavy_motion, perpendicular_axes
from rigidsim.solve.closed_form.motion import Motion, NoClosedForm, WhyNot


def choose_motion(context: mpmath.MPContext, scene: Scene, scaling: Scaling) -> Motion:
    """Closed-form rotation of a scene without loads, or with uniform gravity alone.

    Args:
        context: mpmath context to work in, with at least twice the scene's digits.
        scaling: units of time and inertia that the motion is given in.

    Raises:
        NoClosedForm: no closed form is known for the motion.
    """

    def wide(vector: Vector, exponent: int = 0) -> Vector:
        return [context.ldexp(context.mpf(x), exponent) for x in vector]

    body = scene.body
    moments = wide(body.principal_moments, -scaling.inertia)
    axes = [wide(axis) for axis in body.principal_axes]
    rates = wide(scene.angular_velocity, scaling.time)
    # residue of a zero after the scene's own rounding
    tiny = context.mpf(negligible(scene.context))
    if scene.torque_arm is None:
        return free_motion(context, moments, axes, rates, tiny)
    assert scene.gravity is not None
    arm, gravity = wide(scene.torque_arm), wide(scene.gravity)
    strength = norm(context, gravity)
    pull = context.ldexp(norm(context, arm) * strength, -scaling.energy)
    frame = _top_frame(context, moments, axes, arm, tiny)
    if frame is None:
        raise NoClosedForm(
            WhyNot.TOP,
            "a heavy top without two equal moments, or with its centre of mass off its symmetry axis, has no "
            "closed form here",
        )
    frame_axes, across, along = frame
    matrix = attitude.rotation_matrix(attitude.unit_quaternion(context, wide(scene.quaternion)))
    vertical = [-dot([row[i] for row in matrix], gravity) / strength for i in range(3)]
    components = [dot(axis, rates) for axis in frame_axes]
    level = [dot(axis, vertical) for axis in frame_axes[:2]]
    fastest = max(context.sqrt(pull / across), norm(context, rates))
    if norm(context, level) <= tiny and norm(context, components[:2]) <= tiny * fastest:
        return spinning(context, frame_axes, components[2])
    return heavy_motion(context, frame_axes, (across, along), pull, rates, vertical)


def _top_frame(
    context: mpmath.MPContext, moments: Vector, axes: Matrix, arm: Vector, tiny: mpmath.mpf
) -> tuple[Matrix, mpmath.mpf, mpmath.mpf] | None:
    """Axes with the third along the arm, and the moments across and along it; None if the body isn't
    symmetric about the arm.
    """
    length = norm(context, arm)
    third = [x / length for x in arm]
    largest = max(moments)
    alike = [abs(moments[(i + 1) % 3] - moments[(i + 2) % 3]) <= tiny * largest for i in range(3)]
    along = [i for i in range(3) if alike[i] and norm(context, cross(third, axes[i])) <= tiny]
    if along:
        k = along[0]
        i, j = (k + 1) % 3, (k + 2) % 3
        across = (moments[i] + moments[j]) / 2
        if dot(axes[k], third) > 0:
            return [axes[i], axes[j], axes[k]], across, moments[k]
        return [axes[j], axes[i], [-x for x in axes[k]]], across, moments[k]
    if all(alike):
        return perpendicular_axes(context, third), moments[0], moments[0]
    return None
