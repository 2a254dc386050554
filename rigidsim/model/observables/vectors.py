"""Vectors and angles that several observables are made of, and what readers are told of them."""

from __future__ import annotations

import heyoka as hy

from rigidsim.model.frames.reference_plane import reference_plane
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic
from rigidsim.model.two_part import as_factor
from rigidsim.scene.arithmetic import Vector, cross


def in_body(m: Mechanics, direction: Vector) -> list[Symbolic]:
    """A fixed direction (mpf, body axes) as expressions."""
    return [as_factor(m.number(x)) for x in direction]


def along(a: list[Symbolic], b: list[Symbolic]) -> Symbolic:
    """a . b."""
    return hy.sum([x * y for x, y in zip(a, b, strict=True)])


def length(vector: list[Symbolic]) -> Symbolic:
    """Euclidean."""
    return hy.sqrt(hy.sum([x * x for x in vector]))


def unit(vector: list[Symbolic]) -> list[Symbolic]:
    """Divided by its length; NaN for zero."""
    size = length(vector)
    return [x / size for x in vector]


def angle_between(a: list[Symbolic], b: list[Symbolic]) -> Symbolic:
    """atan2(|a x b|, a . b), 0 to pi: no digits are lost at any angle; NaN where one is zero."""
    aligned = along(a, b)
    across = length(cross(a, b))
    size = hy.sqrt(aligned * aligned + across * across)
    return hy.atan2(across / size, aligned / size)


def figure_told(m: Mechanics) -> dict[str, str]:
    """Which axis the figure axis is."""
    pole = ", ".join(m.scene.context.nstr(x, 17) for x in m.scene.figure.pole)
    return {"figure_axis": f"{m.scene.figure.described}: [{pole}] in body axes"}


def plane_told(m: Mechanics) -> dict[str, str]:
    """Which plane angles count from."""
    return {"reference_plane": reference_plane(m).described}
