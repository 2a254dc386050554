"""Outlines of solids as numbers for any drawing: boxes, ellipsoids, solids of revolution.

Lengths are metres, in the solid's own axes, from its centre of mass.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

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
