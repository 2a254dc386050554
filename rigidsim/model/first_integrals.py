"""The two integrable heavy tops besides Lagrange's: Kovalevskaya's and Goryachev-Chaplygin's.

Both are symmetric bodies (moments A = B and C) whose centre of mass lies in the equatorial plane, and have
a fourth integral of the motion. In the axes e1 towards the centre of mass, e3 along the body's own axis of
symmetry and e2 = e3 x e1, with g the vertical seen from the body and k = M g l / C:

    A = 2 C: K = (w1^2 - w2^2 - k g1)^2 + (2 w1 w2 - k g2)^2          (Kovalevskaya 1889)
    A = 4 C: G = w3 (w1^2 + w2^2) - k w1 g3, on L_z = 0 alone          (Goryachev 1900, Chaplygin 1901)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, negligible, norm, transpose


@dataclass(frozen=True)
class EquatorialTop:
    """A symmetric heavy top whose centre of mass lies in its equatorial plane."""

    frame: list[Vector]  # e1, e2, e3, body axes (mpf)
    equatorial: Any  # moments A = B, SI
    axial: Any  # moment C
    strength: Any  # M g l, J


def _top(m: Mechanics, ratio: int) -> EquatorialTop | None:
    """The scene as a top with A = B = ratio C; None for any other body, or if another load turns it, too."""
    context, scene = m.scene.context, m.scene
    axis, arm = m.symmetry_direction, scene.torque_arm
    if m.vertical is None or axis is None or arm is None or scene.gravity is None or m.carriers:
        return None
    if any(load.uniform_field is None for load in m.turning):
        return None
    tiny = negligible(context)
    length = norm(context, arm)
    if abs(dot(arm, axis)) > length * tiny:
        return None
    first = [a / length for a in arm]
    second = cross(axis, first)
    equatorial, axial = (dot(e, apply(scene.body.inertia, e)) for e in (first, axis))
    if axial == 0 or abs(equatorial - ratio * axial) > equatorial * tiny:
        return None
    frame = [first, second, list(axis)]
    return EquatorialTop(frame, equatorial, axial, length * norm(context, scene.gravity))


def kovalevskaya_top(m: Mechanics) -> EquatorialTop | None:
    """The scene as Kovalevskaya's top, A = B = 2 C; None if it isn't one."""
    return _top(m, 2)


def goryachev_chaplygin_top(m: Mechanics) -> EquatorialTop | None:
    """The scene as Goryachev and Chaplygin's top, A = B = 4 C and L_z = 0; None if it isn't one."""
    top = _top(m, 4)
    if top is None:
        return None
    context, scene = m.scene.context, m.scene
    momentum = apply(scene.body.inertia, scene.angular_velocity)
    vertical = apply(transpose(attitude.rotation_matrix(scene.quaternion)), scene.gravity or [])
    size = norm(context, momentum) * norm(context, vertical)
    level = abs(dot(momentum, vertical)) <= size * negligible(context)
    return top if level else None


def _along(m: Mechanics, axis: Vector, vector: list[Symbolic]) -> Symbolic:
    tiny = negligible(m.scene.context)
    return hy.sum([m.number(e) * x for e, x in zip(axis, vector, strict=True) if abs(e) > tiny])


def _internal(m: Mechanics, top: EquatorialTop) -> tuple[list[Symbolic], list[Symbolic], Any]:
    """Rates and vertical in the top's frame, and k, in internal units."""
    rates = [_along(m, axis, m.rates) for axis in top.frame]
    vertical = [_along(m, axis, m.carried(m.vertical)) for axis in top.frame]
    return rates, vertical, m.number(m.scene.context.ldexp(top.strength / top.axial, 2 * m.scaling.time))


def kovalevskaya_constant(m: Mechanics) -> Symbolic:
    """K, internal units of rates to the fourth."""
    w, g, k = _internal(m, m.carried(kovalevskaya_top(m)))
    real, imaginary = w[0] * w[0] - w[1] * w[1] - k * g[0], 2.0 * (w[0] * w[1]) - k * g[1]
    return real * real + imaginary * imaginary


def goryachev_chaplygin_constant(m: Mechanics) -> Symbolic:
    """G, internal units of rates to the third."""
    w, g, k = _internal(m, m.carried(goryachev_chaplygin_top(m)))
    return w[2] * (w[0] * w[0] + w[1] * w[1]) - k * w[0] * g[2]


def _largest(m: Mechanics, top: EquatorialTop) -> tuple[Any, Any]:
    """Bounds of the squared equatorial rate and of the axial rate: all energy in one of them."""
    w = m.scene.angular_velocity
    twice = dot(w, apply(m.scene.body.inertia, w)) + 4 * top.strength
    return twice / top.equatorial, m.scene.context.sqrt(twice / top.axial)


def kovalevskaya_scale(m: Mechanics) -> tuple[Any, str]:
    """(largest w1^2 + w2^2, plus k)^2."""
    top = m.carried(kovalevskaya_top(m))
    equatorial, _ = _largest(m, top)
    return (equatorial + top.strength / top.axial) ** 2, "largest (w1^2 + w2^2 + M g l / C)^2 by energy"


def goryachev_chaplygin_scale(m: Mechanics) -> tuple[Any, str]:
    """Largest w3 (w1^2 + w2^2) plus k w1."""
    top = m.carried(goryachev_chaplygin_top(m))
    equatorial, axial = _largest(m, top)
    value = axial * equatorial + top.strength / top.axial * m.scene.context.sqrt(equatorial)
    return value, "largest w3 (w1^2 + w2^2) + M g l w1 / C by energy"
