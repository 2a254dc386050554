"""Vector algebra and shared attributes for observables."""

from __future__ import annotations

import heyoka as hy

from rigidsim.model.frames.reference_plane import reference_plane
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic
from rigidsim.model.two_part import as_factor
from rigidsim.scene.arithmetic import Vector, cross


def in_body(m: Mechanics, direction: Vector) -> list[Symbolic]:
    """A fixed body-axes direction (mpf) as expressions."""
    return [as_factor(m.number(x)) for x in direction]


def along(a: list[Symbolic], b: list[Symbolic]) -> Symbolic:
    """Scalar product a . b."""
    return hy.sum([x * y for x, y in zip(a, b, strict=True)])


def length(vector: list[Symbolic]) -> Symbolic:
    """Euclidean length."""
    return hy.sqrt(hy.sum([x * x for x in vector]))


def unit(vector: list[Symbolic]) -> list[Symbolic]:
    """The vector divided by its length; NaN for zero."""
    size = length(vector)
    return [x / size for x in vector]


def angle_between(a: list[Symbolic], b: list[Symbolic]) -> Symbolic:
    """Angle atan2(|a x b|, a . b), 0 to pi, which loses no digits anywhere; NaN if either vector is zero."""
    aligned = along(a, b)
    across = length(cross(a, b))
    size = hy.sqrt(aligned * aligned + across * across)
    return hy.atan2(across / size, aligned / size)


def figure_told(m: Mechanics) -> dict[str, str]:
    """Attributes that tell which axis the figure axis is."""
    pole = ", ".join(m.scene.context.nstr(x, 17) for x in m.scene.figure.pole)
    return {"figure_axis": f"{m.scene.figure.described}: [{pole}] in body axes"}


def plane_told(m: Mechanics) -> dict[str, str]:
    """Attributes that tell the reference plane from which angles are measured."""
    return {"reference_plane": reference_plane(m).described}
