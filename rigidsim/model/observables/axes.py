"""Directions of the figure, spin and momentum axes in space, and their angles against the reference plane.

With a unit axis a = (u, v, s) along the plane's X', Y' and normal n
(``rigidsim.model.frames.reference_plane``):

    obliquity = atan2(|n x a|, n . a),    node longitude = atan2(u, -v),

the latter of n x a, where the equator whose pole is a rises through the plane: luni-solar precession makes it
decrease. Neither loses digits at any angle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import heyoka as hy

from rigidsim.model.frames.reference_plane import reference_plane
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import (
    NO_UNIT,
    SPACE,
    Angle,
    Observable,
    continuous_angles,
    only_when_named,
    register_all,
    same_unit,
)
from rigidsim.model.observables.steadiness import is_planet, steady_directions
from rigidsim.model.observables.vectors import figure_told, plane_told, unit
from rigidsim.model.rotations import Symbolic
from rigidsim.model.two_part import as_factor
from rigidsim.scene.frame import ECLIPTIC, OBLIQUITY

AXIS = ("axis",)


def figure_axis(m: Mechanics) -> list[Symbolic]:
    """Unit vector along the figure axis, space axes."""
    return unit(m.figure_space)


def spin_axis(m: Mechanics) -> list[Symbolic]:
    """Unit vector w / |w| along the angular velocity, space axes."""
    return unit(m.spin_space)


def momentum_axis(m: Mechanics) -> list[Symbolic]:
    """Unit vector L / |L| along the angular momentum, space axes."""
    return unit(m.momentum_space)


def three_axes(m: Mechanics) -> list[list[Symbolic]]:
    """Unit vectors in the order of the labels of the dimension ``axis``."""
    return [figure_axis(m), spin_axis(m), momentum_axis(m)]


def obliquities(m: Mechanics) -> list[Symbolic]:
    """Obliquity of each axis, 0 to pi."""
    plane = reference_plane(m)
    found = []
    for axis in three_axes(m):
        u, v, s = plane.components(axis)
        found.append(hy.atan2(hy.sqrt(u * u + v * v), s))
    return found


def node_longitudes(m: Mechanics) -> list[Angle]:
    """Node longitude of each axis."""
    plane = reference_plane(m)
    found = []
    for axis in three_axes(m):
        u, v, _ = plane.components(axis)
        found.append(Angle(u, -v))
    return found


def equatorial(m: Mechanics, vector: list[Symbolic]) -> list[Symbolic]:
    """A vector in space axes resolved along equatorial axes; unchanged unless the space axes are the
    ecliptic's.
    """
    if m.scene.axes != ECLIPTIC:
        return vector
    context = m.scene.context
    angle = OBLIQUITY.at(context)
    c, s = (as_factor(m.number(x)) for x in (context.cos(angle), context.sin(angle)))
    x, y, z = vector
    return [x, c * y - s * z, s * y + c * z]


def _right_ascensions(m: Mechanics) -> list[Angle]:
    found = []
    for axis in three_axes(m):
        x, y, _ = equatorial(m, axis)
        found.append(Angle(y, x))
    return found


def _declinations(m: Mechanics) -> list[Symbolic]:
    found = []
    for axis in three_axes(m):
        x, y, z = equatorial(m, axis)
        found.append(hy.atan2(z, hy.sqrt(x * x + y * y)))
    return found


# --- attributes shown to readers ------------------------------------------------------------------------


def _told(
    convention: str, *, figure: bool = False, plane: bool = False
) -> Callable[[Mechanics], Mapping[str, str]]:
    """Attributes of a variable: its convention, and the figure axis and reference plane if it uses them."""

    def attributes(m: Mechanics) -> dict[str, str]:
        found = {"convention": convention}
        return found | (figure_told(m) if figure else {}) | (plane_told(m) if plane else {})

    return attributes


def _sky(convention: str) -> Callable[[Mechanics], Mapping[str, Any]]:
    def attributes(m: Mechanics) -> dict[str, str]:
        turned = m.scene.axes == ECLIPTIC
        where = "mean equator and equinox of J2000" if turned else "the space axes' XY plane and X"
        return {"convention": f"{convention}, against {where}"} | figure_told(m)

    return attributes


_AT_REST = "unit vector; NaN where the body is at rest"

register_all(
    Observable(
        "figure_axis", SPACE, "1", "direction of the figure axis", figure_axis, same_unit(NO_UNIT, 3),
        "space axes", ("attitude",), by_default=is_planet,
        attributes=_told("unit vector", figure=True),
    ),
    Observable(
        "spin_axis", SPACE, "1", "direction of the angular velocity", spin_axis, same_unit(NO_UNIT, 3),
        "space axes", ("attitude",), by_default=only_when_named, attributes=_told(_AT_REST),
    ),
    Observable(
        "momentum_axis", SPACE, "1", "direction of the angular momentum", momentum_axis,
        same_unit(NO_UNIT, 3), "space axes", ("attitude",), by_default=only_when_named,
        attributes=_told(_AT_REST),
    ),
    continuous_angles(
        "right_ascension", AXIS, "right ascension of the figure, spin and momentum axes", _right_ascensions,
        frame="space axes", needs=("attitude",), steady=steady_directions,
        attributes=_sky("longitude from X towards Y, turns counted; NaN at the poles"),
    ),
    Observable(
        "declination", AXIS, "rad", "declination of the figure, spin and momentum axes", _declinations,
        same_unit(NO_UNIT, 3), "space axes", ("attitude",), by_default=only_when_named,
        attributes=_sky("positive north of the equator"),
    ),
    Observable(
        "obliquity", AXIS, "rad", "obliquity of the figure, spin and momentum axes", obliquities,
        same_unit(NO_UNIT, 3), "space axes", ("attitude", "plane"), by_default=is_planet,
        attributes=_told("angle from the reference plane's normal, 0 to pi", figure=True, plane=True),
    ),
    continuous_angles(
        "node_longitude", AXIS,
        "longitude of the node of the equator of the figure, spin and momentum axes", node_longitudes,
        frame="space axes", needs=("attitude", "plane"), by_default=is_planet, steady=steady_directions,
        attributes=_told(
            "where the equator whose pole is the axis rises through the reference plane, from X turned by "
            "the smallest rotation that takes Z to the normal, in the direct sense; turns counted; NaN where "
            "the obliquity is 0 or pi",
            figure=True, plane=True,
        ),
    ),
)  # fmt: skip
