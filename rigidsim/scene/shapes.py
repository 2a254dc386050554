"""Homogeneous solids: principal moments about the centre of mass in the shape's own axes, and landmarks.

Formulas: Landau & Lifshitz, Mechanics, section 32, and standard tables; checked in the tests against
numerical integration over the volume. All are evaluated in mpmath at the caller's precision.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

Dimensions = Mapping[str, list[Any]]
Vector = list[Any]


@dataclass(frozen=True)
class Shape:
    """A solid of uniform density.

    Attributes:
        dimensions: names of the keys that size it, each with how many numbers it takes.
        moments: (context, dimensions) -> principal moments per unit mass about the centre of mass, m^2.
        landmarks: named points that a body can turn about, from the centre of mass, metres.
        meaning: how it lies in its own axes, for readers of the table.
    """

    dimensions: Mapping[str, int]
    moments: Callable[[Any, Dimensions], Vector]
    meaning: str
    landmarks: Mapping[str, Callable[[Any, Dimensions], Vector]] = field(default_factory=dict)


def _cuboid(_: Any, d: Dimensions) -> Vector:
    a, b, c = (x**2 / 12 for x in d["size"])
    return [b + c, a + c, a + b]


def _plate(_: Any, d: Dimensions) -> Vector:
    a, b = (x**2 / 12 for x in d["size"])
    return [b, a, a + b]


def _ellipsoid(_: Any, d: Dimensions) -> Vector:
    a, b, c = (x**2 / 5 for x in d["semi_axes"])
    return [b + c, a + c, a + b]


def _sphere(_: Any, d: Dimensions) -> Vector:
    return [2 * d["radius"][0] ** 2 / 5] * 3


def _spherical_shell(_: Any, d: Dimensions) -> Vector:
    return [2 * d["radius"][0] ** 2 / 3] * 3


def _cylinder(_: Any, d: Dimensions) -> Vector:
    r2, h2 = d["radius"][0] ** 2, d["height"][0] ** 2
    return [(3 * r2 + h2) / 12] * 2 + [r2 / 2]


def _tube(_: Any, d: Dimensions) -> Vector:
    r2, h2 = d["inner_radius"][0] ** 2 + d["outer_radius"][0] ** 2, d["height"][0] ** 2
    return [(3 * r2 + h2) / 12] * 2 + [r2 / 2]


def _cone(_: Any, d: Dimensions) -> Vector:
    r2, h2 = d["radius"][0] ** 2, d["height"][0] ** 2
    return [3 * (4 * r2 + h2) / 80] * 2 + [3 * r2 / 10]


def _rod(context: Any, d: Dimensions) -> Vector:
    return [d["length"][0] ** 2 / 12] * 2 + [context.zero]


def _disk(_: Any, d: Dimensions) -> Vector:
    r2 = d["radius"][0] ** 2
    return [r2 / 4, r2 / 4, r2 / 2]


def _ring(_: Any, d: Dimensions) -> Vector:
    r2 = d["radius"][0] ** 2
    return [r2 / 2, r2 / 2, r2]


def _torus(_: Any, d: Dimensions) -> Vector:
    major, minor = d["major_radius"][0] ** 2, d["minor_radius"][0] ** 2
    return [(4 * major + 5 * minor) / 8] * 2 + [major + 3 * minor / 4]


SHAPES: dict[str, Shape] = {
    "cuboid": Shape(
        {"size": 3},
        _cuboid,
        "edges along x, y, z",
        {"corner": lambda _, d: [-x / 2 for x in d["size"]]},
    ),
    "plate": Shape(
        {"size": 2},
        _plate,
        "thin rectangle with edges along x and y",
        {"corner": lambda c, d: [-x / 2 for x in d["size"]] + [c.zero]},
    ),
    "ellipsoid": Shape({"semi_axes": 3}, _ellipsoid, "semi-axes along x, y, z"),
    "sphere": Shape({"radius": 1}, _sphere, "solid ball"),
    "spherical_shell": Shape({"radius": 1}, _spherical_shell, "thin hollow ball"),
    "cylinder": Shape({"radius": 1, "height": 1}, _cylinder, "axis along z"),
    "tube": Shape(
        {"inner_radius": 1, "outer_radius": 1, "height": 1}, _tube, "hollow cylinder, axis along z"
    ),
    "cone": Shape(
        {"radius": 1, "height": 1},
        _cone,
        "axis along z, apex towards -z",
        {"apex": lambda c, d: [c.zero, c.zero, -3 * d["height"][0] / 4]},
    ),
    "rod": Shape(
        {"length": 1},
        _rod,
        "thin, along z",
        {"end": lambda c, d: [c.zero, c.zero, -d["length"][0] / 2]},
    ),
    "disk": Shape({"radius": 1}, _disk, "thin, normal along z"),
    "ring": Shape({"radius": 1}, _ring, "thin hoop, normal along z"),
    "torus": Shape({"major_radius": 1, "minor_radius": 1}, _torus, "axis along z"),
}
"""The shapes that ``[body] shape`` and ``[[body.parts]] shape`` take."""

DIMENSION_KEYS = tuple(dict.fromkeys(key for shape in SHAPES.values() for key in shape.dimensions))
