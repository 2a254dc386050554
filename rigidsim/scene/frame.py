"""``[frame]``: names of the space axes, the body's figure axis, and the plane from which angles count."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Tag

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.scene.arithmetic import Vector, cross, dot, negligible, norm, vector
from rigidsim.scene.bodies.body import RigidBody
from rigidsim.scene.fields import NAME_OR_VECTOR, ConfigTable, Dimensionless, Triple, name_or_vector
from rigidsim.scene.space_axes import SpaceAxes

ORBIT = "orbit"
SPACE = "space"


class Frame(ConfigTable):
    """``[frame]``: names of the scene's axes, and references of angles."""

    axes: SpaceAxes | None = None
    """name of the space axes; with an ephemeris they are ecliptic J2000"""
    reference: Annotated[
        Annotated[Literal["space", "orbit"], Tag(NAME_OR_VECTOR[0])]
        | Annotated[Triple[Dimensionless], Tag(NAME_OR_VECTOR[1])],
        name_or_vector(
            '"space" (the plane XY), "orbit" (the source\'s own, moving plane) or a normal [x, y, z] in '
            "space axes"
        ),
    ] = "space"
    """reference plane of obliquity and longitudes: space (XY), orbit (the moving plane of the source's
    orbit), or a normal [x, y, z] in space axes
    """
    figure_axis: Literal["x", "y", "z", "largest", "symmetry"] | None = None
    """the body axis to which obliquity, wobble and polar motion refer; by default the axis of symmetry,
    or else the axis of largest moment
    """


@dataclass(frozen=True)
class Figure:
    """Figure axis and two axes of its equator, the first of which angles count from; body axes (mpf)."""

    first: Vector
    second: Vector
    pole: Vector
    described: str


def figure_of(table: Frame, body: RigidBody, context: Any) -> Figure:
    """The figure axis that ``[frame] figure_axis`` chooses: by default the symmetry axis of a symmetric body,
    and the principal axis of largest moment of any other.

    The axis of symmetry of a body with its centre of mass on it points there; other principal axes have a
    positive largest component. The prime meridian is the body axis that follows (x after z, y after x, z
    after y) the one nearest to the figure axis, projected onto the equator: it is the body axis itself where
    the figure axis is one.
    """
    asked = table.figure_axis
    one, zero = context.one, context.zero
    if asked is not None and asked in "xyz":
        pole = [one if name == asked else zero for name in "xyz"]
        return _with_equator(context, pole, f"body axis {asked}")
    found = _symmetry(body, context)
    what = 'given "symmetry", but no two principal moments alone are equal; "x", "y", "z" or "largest" is '
    ensure(asked != "symmetry" or found is not None, _fault("figure_axis", what + "allowed here"))
    if asked != "largest" and found is not None:
        return _with_equator(context, found, "axis of symmetry")
    axis = unique_axis(body, context, largest=True)
    if axis is not None:
        return _with_equator(context, axis, "axis of largest moment")
    what = 'given "largest", but the two largest principal moments are equal; "x", "y" or "z"'
    more = ' or "symmetry"' if found else ""
    ensure(asked != "largest", _fault("figure_axis", f"{what}{more} is allowed here"))
    return _with_equator(context, [zero, zero, one], "body axis z, as good as any of a sphere")


def unique_axis(body: RigidBody, context: Any, *, largest: bool) -> Vector | None:
    """Unit principal axis of the largest or smallest moment, largest component positive; None if many are."""
    moments = body.principal_moments
    low, middle, high = sorted(range(3), key=lambda i: moments[i])
    apart = moments[high] - moments[middle] if largest else moments[middle] - moments[low]
    if apart <= moments[high] * negligible(context):
        return None
    return _upright(body.principal_axes[high if largest else low])


def reference_normal(table: Frame, context: Any) -> Vector | None:
    """Unit normal (mpf, space axes) of the plane named by ``[frame] reference``; None for a moving plane."""
    asked = table.reference
    if asked == ORBIT:
        return None
    if isinstance(asked, str):
        return [context.zero, context.zero, context.one]
    given = vector(context, asked)
    length = norm(context, given)
    what = "given the zero vector; a normal [x, y, z] of any other length is allowed"
    ensure(length != 0, _fault("reference", what))
    return [x / length for x in given]


def _fault(key: str, text: str) -> ConfigError:
    return ConfigError(Problem(f"[frame] {key}", text))


def _symmetry(body: RigidBody, context: Any) -> Vector | None:
    """Unit symmetry axis of a body with two equal moments and a different third; None for others."""
    moments = body.principal_moments
    tiny = context.maximum(moments) * negligible(context)
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
