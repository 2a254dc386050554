"""The body's figure axis, and the plane from which obliquity and longitudes count."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene import schema
from rigidsim.scene.arithmetic import Vector, cross, dot, negligible, norm
from rigidsim.scene.bodies.body import RigidBody
from rigidsim.scene.tracing.numbers import largest_of

ORBIT = "orbit"
SPACE = "space"


@dataclass(frozen=True)
class Figure:
    """Figure axis of a body and two axes of its equator; right-handed unit vectors, body axes (mpf).

    Attributes:
        first: direction from which angles within the equator count (the prime meridian).
        pole: the figure axis.
        described: description of the axis, for readers.
    """

    first: Vector
    second: Vector
    pole: Vector
    described: str


def figure_of(config: schema.Config, body: RigidBody, context: Any) -> Figure:
    """The figure axis that ``[frame] figure_axis`` chooses: by default the symmetry axis of a symmetric body,
    and the principal axis of largest moment of any other.

    The axis of symmetry of a body with its centre of mass on it points there; other principal axes have a
    positive largest component. The prime meridian is the body axis that follows (x after z, y after x, z
    after y) the one nearest to the figure axis, projected onto the equator: it is the body axis itself where
    the figure axis is one.

    Raises:
        ConfigError: the body has no unique axis of symmetry, or of largest moment, as requested.
    """
    asked = config.frame.figure_axis
    one, zero = context.one, context.zero
    if asked is not None and asked in "xyz":
        pole = [one if name == asked else zero for name in "xyz"]
        return _with_equator(context, pole, f"body axis {asked}")
    found = _symmetry(body, context)
    if asked == "symmetry" and found is None:
        what = (
            'given "symmetry", but no two principal moments alone are equal; "x", "y", "z" or "largest" is '
        )
        raise _fault("figure_axis", what + "allowed here")
    if asked != "largest" and found is not None:
        return _with_equator(context, found, "axis of symmetry")
    moments = body.principal_moments
    order = sorted(range(3), key=lambda i: moments[i])
    if moments[order[2]] - moments[order[1]] <= moments[order[2]] * negligible(context):
        if asked == "largest":
            what = 'given "largest", but the two largest principal moments are equal; "x", "y" or "z"'
            more = ' or "symmetry"' if found else ""
            raise _fault("figure_axis", f"{what}{more} is allowed here")
        return _with_equator(context, [zero, zero, one], "body axis z, as good as any of a sphere")
    return _with_equator(context, _upright(body.principal_axes[order[2]]), "axis of largest moment")


def largest_axis(body: RigidBody, context: Any) -> Vector | None:
    """Unit principal axis of largest moment, body axes (mpf), its largest component positive; None if it
    isn't unique.
    """
    moments = body.principal_moments
    order = sorted(range(3), key=lambda i: moments[i])
    if moments[order[2]] - moments[order[1]] <= moments[order[2]] * negligible(context):
        return None
    return _upright(body.principal_axes[order[2]])


def smallest_axis(body: RigidBody, context: Any) -> Vector | None:
    """The same for the smallest moment: the long axis."""
    moments = body.principal_moments
    order = sorted(range(3), key=lambda i: moments[i])
    if moments[order[1]] - moments[order[0]] <= moments[order[2]] * negligible(context):
        return None
    return _upright(body.principal_axes[order[0]])


def reference_normal(config: schema.Config, context: Any) -> Vector | None:
    """Unit normal (mpf, space axes) of the plane named by ``[frame] reference``; None for a moving plane.

    Raises:
        ConfigError: the given normal is the zero vector.
    """
    asked = config.frame.reference
    if asked == ORBIT:
        return None
    if isinstance(asked, str):
        return [context.zero, context.zero, context.one]
    given = [x.at(context) for x in asked]
    length = norm(context, given)
    if length == 0:
        raise _fault("reference", "given the zero vector; a normal [x, y, z] of any other length is allowed")
    return [x / length for x in given]


def _fault(key: str, text: str) -> ConfigError:
    return ConfigError(Problem(f"[frame] {key}", text))


def _symmetry(body: RigidBody, context: Any) -> Vector | None:
    """Unit symmetry axis of a body with two equal moments and a different third; None for others."""
    moments = body.principal_moments
    tiny = largest_of(moments) * negligible(context)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        if abs(moments[j] - moments[k]) <= tiny < abs(moments[i] - moments[j]):
            axis = _upright(body.principal_axes[i])
            along = dot(axis, body.center_of_mass)
            return [-x for x in axis] if along < 0 else axis
    return None


def _upright(axis: Vector) -> Vector:
    """The axis or its opposite, so that the largest component is positive."""
    return axis if max(axis, key=abs) > 0 else [-x for x in axis]


def _with_equator(context: Any, pole: Vector, described: str) -> Figure:
    nearest = max(range(3), key=lambda i: abs(pole[i]))
    along = (nearest + 1) % 3
    raw = [(context.one if i == along else context.zero) - pole[along] * x for i, x in enumerate(pole)]
    length = norm(context, raw)
    first = [x / length for x in raw]
    return Figure(first, cross(pole, first), pole, described)
