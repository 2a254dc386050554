"""``[body] surfaces``: the body's outside as light and air meet it, the same for all loads.

A plate is met from the side that its normal points to. A box is six plates, a plate with ``both_sides`` two;
light and air reach each of them whatever stands before it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated, Any

import numpy as np
from pydantic import Field, StrictBool

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.scene.arithmetic import Vector, norm, vector
from rigidsim.scene.exact import ZERO, ExactNumber
from rigidsim.scene.fields import (
    ConfigTable,
    Dimensionless,
    Direction,
    InUnit,
    Metre,
    NotNegative,
    Positive,
    Triple,
)
from rigidsim.scene.rotations import quaternion_of
from rigidsim.scene.swept import plain

Area = Annotated[ExactNumber, InUnit("m^2")]
_DRAG = ExactNumber(Fraction(11, 5))
_COEFFICIENTS = ("specular", "diffuse", "drag_coefficient")
_BITS = 40  # to which shares that are written as decimals add up to 1
_FORMS = {"plate": ("normal", "area", "both_sides"), "box": ("size",), "sphere": ("radius",)}


def _one_form(table: Any) -> str:
    """A rule: the keys belong to one form, and a plate needs ``normal`` and ``area``."""
    given = [form for form, keys in _FORMS.items() if table.model_fields_set & set(keys)]
    if len(given) != 1:
        what = f"given the keys of a {' and a '.join(given)}" if given else "given none of its forms"
        return f"{what}; a plate (normal, area), a box (size) or a sphere (radius) is allowed"
    lacking = [key for key in ("normal", "area") if given == ["plate"] and getattr(table, key) is None]
    return f"missing {lacking[0]}; a plate needs its normal and its area" if lacking else ""


class SurfaceTable(ConfigTable):
    """A plate (``normal`` and ``area``), a box (``size``) or a sphere (``radius``) of the body's outside."""

    rules = (_one_form,)
    normal: Direction | None = Field(None, examples=[[0, 0, 1]])
    """of a plate: direction of its front, body axes, of any length"""
    area: Positive[Area] | None = Field(None, examples=["0.03 m^2"])
    """of a plate"""
    both_sides: StrictBool = False
    """of a plate: whether its back is like its front; by default the back feels nothing"""
    size: Triple[Positive[Metre]] | None = Field(None, examples=[["10 cm", "10 cm", "34 cm"]])
    """of a box: its edges along the body axes; six plates"""
    radius: Positive[Metre] | None = Field(None, examples=["30 cm"])
    """of a sphere"""
    position: Triple[Metre] | None = Field(None, examples=[[0, 0, "2 cm"]])
    """its centre (of pressure), in body axes from the reference point; by default the centre of mass"""
    specular: NotNegative[Dimensionless] = ZERO
    """share of light that is reflected as by a mirror"""
    diffuse: NotNegative[Dimensionless] = ZERO
    """share of light that is scattered by Lambert's law; the rest is absorbed"""
    drag_coefficient: NotNegative[Dimensionless] = _DRAG
    """of drag, for the area seen against the stream"""


@dataclass(frozen=True)
class OuterSurface:
    """What plates and spheres have in common; numbers are mpf.

    Attributes:
        place: its key in ``[body]``.
        area: of a plate, or the cross-section of a sphere, m^2.
        position: from the reference point, body axes, m.
    """

    place: str
    area: Any
    position: Vector
    specular: Any
    diffuse: Any
    drag_coefficient: Any


@dataclass(frozen=True)
class Plate(OuterSurface):
    """A plate that is met from one side.

    Attributes:
        normal: as written, of any length.
        side: -1 if it is met from behind.
    """

    normal: tuple[ExactNumber, ...]
    side: int

    def unit(self, context: Any) -> Vector:
        """Unit vector to where it is met from, body axes."""
        normal = [self.side * x.at(context) for x in self.normal]
        length = norm(context, normal)
        return [x / length for x in normal]


@dataclass(frozen=True)
class Ball(OuterSurface):
    """A sphere."""


def surfaces_of(
    tables: Sequence[SurfaceTable] | None, center_of_mass: Vector, context: Any
) -> tuple[OuterSurface, ...]:
    """The surfaces of a body; ``ConfigError`` for more light than there is."""
    places = [(table, f"surfaces[{number}]") for number, table in enumerate(tables or [])]
    return tuple(one for table, place in places for one in _of(table, place, center_of_mass, context))


def _of(table: SurfaceTable, place: str, center_of_mass: Vector, context: Any) -> Iterator[OuterSurface]:
    shares = table.specular.at(context) + table.diffuse.at(context)
    what = f"given {float(table.specular):g} with diffuse = {float(table.diffuse):g}; shares of the light "
    fault = ConfigError(Problem(f"[body] {place}.specular", what + "add up to at most 1"))
    ensure(shares <= 1 + context.ldexp(context.one, -_BITS), fault)
    center = center_of_mass if table.position is None else vector(context, table.position)
    coefficients = {key: getattr(table, key).at(context) for key in _COEFFICIENTS}
    if table.radius is not None:
        radius = table.radius.at(context)
        yield Ball(place, context.pi * radius * radius, center, **coefficients)
    elif table.size is not None:
        edges = vector(context, table.size)
        # Torques about the centre add up to none: with edges a, areas A and normals n, forces along n act
        # through it, and those along u give the sum of a A (n . u) n x u / 2, where a A is the same for all.
        for i in range(3):
            normal = tuple(ExactNumber(Fraction(i == j)) for j in range(3))
            area = edges[i - 1] * edges[i - 2]
            for side in (1, -1):
                yield Plate(place, area, center, **coefficients, normal=normal, side=side)
    elif table.normal is not None and table.area is not None:
        area = table.area.at(context)
        for side in (1, -1) if table.both_sides else (1,):
            yield Plate(place, area, center, **coefficients, normal=tuple(table.normal), side=side)


def with_surfaces(
    drawing: list[dict[str, Any]], tables: Sequence[SurfaceTable] | None, found: Sequence[OuterSurface]
) -> list[dict[str, Any]]:
    """Solids for pictures of a body with these surfaces, as plain JSON values: with known solids the plates
    alone, else all surfaces in the place of a body of which only the moments are known.

    Of a plate the outline isn't known: it is drawn as a square. With ``one_sided`` its back has no part.
    """
    known = not any(solid.get("equivalent") for solid in drawing)
    first = {surface.place: surface for surface in reversed(found)}
    solids = list(drawing) if known else []
    for number, table in enumerate(tables or []):
        surface = first[f"surfaces[{number}]"]
        position = [float(plain(x)) for x in surface.position]
        placed: dict[str, Any] = {"position": position, "quaternion": [1.0, 0.0, 0.0, 0.0]}
        if isinstance(surface, Plate) and table.size is None:
            edge = float(plain(surface.area)) ** 0.5
            placed["quaternion"] = _facing([float(x) for x in surface.normal])
            placed["one_sided"] = not table.both_sides
            solids.append({"solid": "plate", "dimensions": {"size": [edge, edge]}, **placed})
        elif not known and table.size is not None:
            size = [float(x) for x in table.size]
            solids.append({"solid": "cuboid", "dimensions": {"size": size}, **placed})
        elif not known and table.radius is not None:
            solids.append({"solid": "sphere", "dimensions": {"radius": float(table.radius)}, **placed})
    return solids


def _facing(normal: Sequence[float]) -> list[float]:
    """Quaternion w x y z that turns z to a direction, and x across the body axis farthest from it."""
    n = np.array(normal) / np.linalg.norm(normal)
    first = np.eye(3)[np.abs(n).argmin()]
    first = first - (first @ n) * n
    first /= np.linalg.norm(first)
    matrix = np.stack([first, np.cross(n, first), n], axis=1)
    return [float(x) for x in quaternion_of(matrix[None])[0]]
