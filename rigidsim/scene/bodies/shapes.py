"""Homogeneous solids in their own axes: dimensions, principal moments, landmarks and outlines.

Formulas: Landau & Lifshitz, Mechanics, section 32, and standard tables; checked in the tests against
numerical integration over the volume. All are evaluated in mpmath at the caller's precision.

Moments of higher degree come from a few points with the same integrals of all polynomials to degree 5:
Gauss's three on a line, his two in the square of the radius times a hexagon on a disk, and in a ball its
centre and the corners of an icosahedron at the radius sqrt(5/7) (Stroud, Approximate Calculation of Multiple
Integrals, 1971).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, TypeAlias

THINNESS = 0.02
"""Thickness with which an ideally thin solid is drawn, relative to its largest dimension."""


@dataclass(frozen=True)
class Box:
    """A cuboid with these edges along x, y, z."""

    x: float
    y: float
    z: float


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid with these semi-axes along x, y, z."""

    x: float
    y: float
    z: float


@dataclass(frozen=True)
class StraightPiece:
    """A straight piece of an outline, from one (radius, z) to another."""

    start: tuple[float, float]
    stop: tuple[float, float]


@dataclass(frozen=True)
class Arc:
    """A piece of a circle about ``center`` (radius, z), from one angle to another (rad, 0 is radial)."""

    center: tuple[float, float]
    radius: float
    start: float
    stop: float


@dataclass(frozen=True)
class Revolved:
    """A solid of revolution about z: its outline, piece by piece, runs with the outside on its right."""

    pieces: tuple[StraightPiece | Arc, ...]


Outline: TypeAlias = Box | Ellipsoid | Revolved


def polygon(*corners: tuple[float, float]) -> Revolved:
    """The solid of revolution whose outline joins these (radius, z) by straight lines."""
    return Revolved(tuple(StraightPiece(a, b) for a, b in pairwise(corners)))


Dimensions = Mapping[str, list[Any]]
Vector = list[Any]
Points = list[tuple[Any, Vector]]
"""Shares of the mass, and their places."""


@dataclass(frozen=True)
class Shape:
    """A solid of uniform density.

    Attributes:
        dimensions: names of the keys that size it, with the count of numbers that each takes.
        meaning: its orientation in its own axes, for readers of the table.
        moments: (context, dimensions) -> principal moments per unit mass about the centre of mass, m^2.
        outline: dimensions as float -> outline.
        landmarks: named points that a body can turn about, from the centre of mass, metres.
        at_most: two dimensions, the first of which is at most the second.
        points: (context, dimensions) -> points of the same moments to degree 5; None if unknown.
    """

    dimensions: Mapping[str, int]
    meaning: str
    moments: Callable[[Any, Dimensions], Vector]
    outline: Callable[[Dimensions], Outline]
    landmarks: Mapping[str, Callable[[Any, Dimensions], Vector]] = field(default_factory=dict)
    at_most: tuple[str, str] | None = None
    points: Callable[[Any, Dimensions], Points] | None = None


def _crossed(*factors: Points) -> Points:
    """Points whose coordinates are the factors' in order."""
    found: Points = [(1, [])]
    for factor in factors:
        found = [(w * v, [*x, *y]) for w, x in found for v, y in factor]
    return found


def _line(c: Any, length: Any) -> Points:
    end = c.sqrt(c.mpf(3) / 5) * length / 2
    return [(c.mpf(5) / 18, [-end]), (c.mpf(4) / 9, [c.zero]), (c.mpf(5) / 18, [end])]


def _hexagons(c: Any, squares: Vector) -> Points:
    corners = [(c.cos(k * c.pi / 3), c.sin(k * c.pi / 3)) for k in range(6)]
    share = c.one / (6 * len(squares))
    return [(share, [c.sqrt(s) * x, c.sqrt(s) * y]) for s in squares for x, y in corners]


def _annulus(c: Any, inner: Any, outer: Any) -> Points:
    middle, half = (inner**2 + outer**2) / 2, (outer**2 - inner**2) / 2
    return _hexagons(c, [middle - half / c.sqrt(3), middle + half / c.sqrt(3)])


def _icosahedron(c: Any, axes: Vector) -> Points:
    golden, found = (1 + c.sqrt(5)) / 2, []
    size = c.sqrt(1 + golden**2)
    for k in range(3):
        for x in (1, -1):
            for y in (golden, -golden):
                corner = [c.zero, x / size, y / size]
                found.append((c.one / 12, [a * corner[(i + k) % 3] for i, a in enumerate(axes)]))
    return found


def _ball(c: Any, axes: Vector) -> Points:
    radius = c.sqrt(c.mpf(5) / 7)
    outer = [(w * 21 / 25, x) for w, x in _icosahedron(c, [radius * a for a in axes])]
    return [(c.mpf(4) / 25, [c.zero] * 3), *outer]


_FLAT: Points = [(1, [0])]


def _boxed(d: Dimensions, key: str, part: int) -> Vector:
    a, b, c = (x**2 / part for x in d[key])
    return [b + c, a + c, a + b]


def _plate(d: Dimensions) -> Vector:
    a, b = (x**2 / 12 for x in d["size"])
    return [b, a, a + b]


def _round(square: Any, height: Any) -> Vector:
    """A cylinder or tube, from the square of its radius or the sum of two."""
    return [(3 * square + height**2) / 12] * 2 + [square / 2]


def _cone(d: Dimensions) -> Vector:
    r2, h2 = d["radius"][0] ** 2, d["height"][0] ** 2
    return [3 * (4 * r2 + h2) / 80] * 2 + [3 * r2 / 10]


def _flat(square: Any, part: int) -> Vector:
    """A disk (part 2) or a ring (part 1), from the square of its radius."""
    return [square / (2 * part)] * 2 + [square / part]


def _torus(d: Dimensions) -> Vector:
    major, minor = d["major_radius"][0] ** 2, d["minor_radius"][0] ** 2
    return [(4 * major + 5 * minor) / 8] * 2 + [major + 3 * minor / 4]


def _upright(radius: float, height: float) -> Revolved:
    h = height / 2
    return polygon((0, -h), (radius, -h), (radius, h), (0, h))


def _drawn_tube(d: Dimensions) -> Revolved:
    outer, h = d["outer_radius"][0], d["height"][0] / 2
    inner = min(d["inner_radius"][0], (1 - THINNESS) * outer)  # a wall without thickness is drawn with some
    return polygon((inner, -h), (outer, -h), (outer, h), (inner, h), (inner, -h))


def _drawn_cone(d: Dimensions) -> Revolved:
    apex, base = -3 * d["height"][0] / 4, d["height"][0] / 4
    return polygon((0, apex), (d["radius"][0], base), (0, base))


def _drawn_torus(major: float, minor: float) -> Revolved:
    return Revolved((Arc((major, 0.0), minor, -math.pi, math.pi),))


SHAPES: dict[str, Shape] = {
    "cuboid": Shape(
        {"size": 3},
        "edges along x, y, z",
        lambda _, d: _boxed(d, "size", 12),
        lambda d: Box(*d["size"]),
        {"corner": lambda _, d: [-x / 2 for x in d["size"]]},
        points=lambda c, d: _crossed(*(_line(c, x) for x in d["size"])),
    ),
    "plate": Shape(
        {"size": 2},
        "thin rectangle with edges along x and y",
        lambda _, d: _plate(d),
        lambda d: Box(d["size"][0], d["size"][1], THINNESS * max(d["size"])),
        {"corner": lambda c, d: [-x / 2 for x in d["size"]] + [c.zero]},
        points=lambda c, d: _crossed(*(_line(c, x) for x in d["size"]), _FLAT),
    ),
    "ellipsoid": Shape(
        {"semi_axes": 3},
        "semi-axes along x, y, z",
        lambda _, d: _boxed(d, "semi_axes", 5),
        lambda d: Ellipsoid(*d["semi_axes"]),
        points=lambda c, d: _ball(c, d["semi_axes"]),
    ),
    "sphere": Shape(
        {"radius": 1},
        "solid ball",
        lambda _, d: [2 * d["radius"][0] ** 2 / 5] * 3,
        lambda d: Ellipsoid(*d["radius"] * 3),
        points=lambda c, d: _ball(c, d["radius"] * 3),
    ),
    "spherical_shell": Shape(
        {"radius": 1},
        "thin hollow ball",
        lambda _, d: [2 * d["radius"][0] ** 2 / 3] * 3,
        lambda d: Ellipsoid(*d["radius"] * 3),
        points=lambda c, d: _icosahedron(c, d["radius"] * 3),
    ),
    "cylinder": Shape(
        {"radius": 1, "height": 1},
        "axis along z",
        lambda _, d: _round(d["radius"][0] ** 2, d["height"][0]),
        lambda d: _upright(*d["radius"], *d["height"]),
        points=lambda c, d: _crossed(_annulus(c, c.zero, d["radius"][0]), _line(c, d["height"][0])),
    ),
    "tube": Shape(
        {"inner_radius": 1, "outer_radius": 1, "height": 1},
        "hollow cylinder, axis along z",
        lambda _, d: _round(d["inner_radius"][0] ** 2 + d["outer_radius"][0] ** 2, d["height"][0]),
        _drawn_tube,
        at_most=("inner_radius", "outer_radius"),
        points=lambda c, d: _crossed(
            _annulus(c, d["inner_radius"][0], d["outer_radius"][0]), _line(c, d["height"][0])
        ),
    ),
    "cone": Shape(
        {"radius": 1, "height": 1},
        "axis along z, apex towards -z",
        lambda _, d: _cone(d),
        _drawn_cone,
        {"apex": lambda c, d: [c.zero, c.zero, -3 * d["height"][0] / 4]},
    ),
    "rod": Shape(
        {"length": 1},
        "thin, along z",
        lambda c, d: [d["length"][0] ** 2 / 12] * 2 + [c.zero],
        lambda d: _upright(THINNESS * d["length"][0], d["length"][0]),
        {"end": lambda c, d: [c.zero, c.zero, -d["length"][0] / 2]},
        points=lambda c, d: _crossed(_FLAT, _FLAT, _line(c, d["length"][0])),
    ),
    "disk": Shape(
        {"radius": 1},
        "thin, normal along z",
        lambda _, d: _flat(d["radius"][0] ** 2, 2),
        lambda d: _upright(d["radius"][0], 2 * THINNESS * d["radius"][0]),
        points=lambda c, d: _crossed(_annulus(c, c.zero, d["radius"][0]), _FLAT),
    ),
    "ring": Shape(
        {"radius": 1},
        "thin hoop, normal along z",
        lambda _, d: _flat(d["radius"][0] ** 2, 1),
        lambda d: _drawn_torus(d["radius"][0], 2 * THINNESS * d["radius"][0]),
        points=lambda c, d: _crossed(_hexagons(c, [d["radius"][0] ** 2]), _FLAT),
    ),
    "torus": Shape(
        {"major_radius": 1, "minor_radius": 1},
        "axis along z",
        lambda _, d: _torus(d),
        lambda d: _drawn_torus(*d["major_radius"], *d["minor_radius"]),
        at_most=("minor_radius", "major_radius"),
    ),
}
"""Shapes for ``[body] shape`` and ``[[body.parts]] shape``; a new one needs only an entry here."""

DIMENSIONS = {
    key: max(other.dimensions.get(key, 0) for other in SHAPES.values())
    for shape in SHAPES.values()
    for key in shape.dimensions
}
"""Every key that sizes some shape, with the largest count of numbers that it takes."""
