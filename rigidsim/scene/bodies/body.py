"""``[body]``: its keys; and worked out: mass, centre of mass, inertia tensor and principal axes about the
reference point.

The reference point is the one that the body turns about: the centre of mass, unless the config names
another. Positions in the result are body axes, metres, from the reference point. A body is given by its
tensor, or made of pieces (points, a shape, or parts placed and rotated), each with its own tensor.

Its outside, ``surfaces``, is the same for all loads. A plate is met from the side that its normal points to.
A box is six plates, a plate with ``both_sides`` two; light and air reach each of them whatever stands before
it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import (
    BaseModel,
    Field,
    StrictBool,
    StrictStr,
    Tag,
    ValidationError,
    WithJsonSchema,
    create_model,
    model_validator,
)

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import (
    Matrix,
    Vector,
    apply,
    diagonal,
    dot,
    eigen,
    minus,
    multiply,
    norm,
    plus,
    transpose,
    vector,
)
from rigidsim.scene.bodies.files import is_mesh, link_inertia, mesh_moments
from rigidsim.scene.bodies.gravity_field import GravityField, GravityFieldTable
from rigidsim.scene.bodies.presets import PRESETS, Preset
from rigidsim.scene.bodies.shapes import DIMENSIONS, SHAPES, Points
from rigidsim.scene.exact import ZERO, ExactNumber, exact_decimal, parse_number
from rigidsim.scene.fields import (
    NAME_OR_VECTOR,
    Angle,
    Beside,
    BodyName,
    ConfigTable,
    Dimensionless,
    Direction,
    EachOnce,
    EulerSequence,
    Four,
    InUnit,
    Kilogram,
    Metre,
    Moment,
    MomentOrFormula,
    NotNegative,
    OneOf,
    PerSecond,
    Positive,
    Range,
    Rate,
    Rule,
    Second,
    Triple,
    name_or_vector,
    one_of,
    only_with,
    within,
)
from rigidsim.scene.paths import numbers
from rigidsim.scene.rotations import quaternion_of
from rigidsim.scene.swept import plain
from rigidsim.scene.text_tables import text_of
from rigidsim.scene.validation_messages import shown

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


# --- the body -----------------------------------------------------------------------------------------------


_TENSORS = ("principal_moments", "inertia_tensor")
_SIZES = {
    "size": "edges along x, y (and z)",
    "semi_axes": "half the axes along x, y, z",
    "radius": "of the circle or the sphere",
    "height": "along z",
    "inner_radius": "of the hole",
    "outer_radius": "of the wall's outside",
    "length": "along z",
    "major_radius": "from the centre to the middle of the tube",
    "minor_radius": "of the tube",
}


class PointMass(ConfigTable):
    """One particle of a body of particles."""

    mass: Positive[Kilogram]
    """mass of the particle"""
    position: Triple[Metre]
    """position in body axes"""


Density = Annotated[ExactNumber, InUnit("kg/m^3")]


class _Shaped(ConfigTable):
    rules: ClassVar[tuple[Rule, ...]] = (only_with("file", "link", "density", "unit"),)
    shape: Annotated[str, OneOf(SHAPES)] | None = None
    """a homogeneous solid; needs mass and dimensions"""
    file: Annotated[StrictStr, Beside("solid")] | None = Field(None, examples=["boom.stl", "arm.urdf"])
    """a file next to the config: a mesh of uniform density (.stl, .obj, .ply, .off; with mass or density), or
    a robot's links with their inertia (.urdf, .xml of MuJoCo)
    """
    link: StrictStr | None = Field(None, examples=["upper_arm"])
    """name of the link, or MuJoCo's body, in the file; needed if it has several"""
    density: Positive[Density] | None = Field(None, examples=["2700 kg/m^3"])
    """of a mesh, instead of mass"""
    unit: StrictStr | None = Field(None, examples=["mm"])
    """of lengths in a mesh; m by default"""


def _dimension(key: str, count: int) -> Any:
    """Type and description of a key that sizes shapes."""
    taking = [name for name, shape in SHAPES.items() if key in shape.dimensions]
    description = f"{_SIZES[key]}; of {' and '.join(', '.join(taking).rsplit(', ', 1))}"
    if count == 1:
        return Positive[Metre] | None, Field(None, description=description, examples=[0.5])
    least = min(SHAPES[name].dimensions[key] for name in taking)
    sizes: dict[str, Any] = {"minItems": least, "maxItems": count}
    field = Field(None, description=description, examples=[[4, 3, 2][:count]], json_schema_extra=sizes)
    return list[Positive[Metre]] | None, field


if TYPE_CHECKING:
    Solid = _Shaped
else:
    Solid = create_model(
        "Solid",
        __base__=_Shaped,
        __doc__="A homogeneous shape with its dimensions (metres); see ``shapes.SHAPES`` for which it takes.",
        **{key: _dimension(key, count) for key, count in DIMENSIONS.items()},
    )


class Part(Solid):
    """One piece of a composite body, placed by its origin, turned by a quaternion or Euler angles."""

    rules = (*_Shaped.rules, one_of("shape", *_TENSORS, "file"))
    principal_moments: Triple[Moment] | None = None
    """principal moments along the part's own axes; needs mass"""
    inertia_tensor: Triple[Triple[Moment]] | None = None
    """inertia tensor along the part's own axes (products are -sum m x y); needs mass"""
    about: Literal["center_of_mass", "origin"] = "center_of_mass"
    """point that moments or tensor refer to; from the part's origin they are moved to the centre of mass by
    the parallel-axis theorem
    """
    center_of_mass: Triple[Metre] | None = None
    """of moments or a tensor: centre of mass, from the part's origin along its own axes; by default there"""
    mass: Positive[Kilogram] | None = None
    """mass of the part"""
    position: Triple[Metre] = Field([ZERO] * 3)
    """position of its origin in body axes: a shape's centre of mass, the origin of a file's coordinates"""
    quaternion: Four[Dimensionless] | None = None
    """attitude w, x, y, z: takes the part's own axes to the body's"""
    euler_angles: Triple[Angle] | None = None
    """attitude from the part's own axes to the body's, instead of quaternion"""
    euler_sequence: EulerSequence | None = None
    """sequence of euler_angles; by default [integrator] euler_sequence"""


_LOVE = Range(lambda x: 0 <= x <= 1.5, "0 (rigid) to 1.5 (a fluid)")
_PART = Range(lambda x: 0 <= x < 1, "a part of the body's own, from 0 to below 1,")


class ElasticityTable(ConfigTable):
    """How tides and the spin distort the body's tensor of inertia."""

    love_number: Annotated[Dimensionless, _LOVE] = Field(examples=[0.0216])
    """Love number k2 of degree 2: 0 (rigid) to 1.5 (a homogeneous fluid)"""
    radius: Positive[Metre] = Field(examples=["1738 km"])
    """radius that the Love number refers to"""
    delay: NotNegative[Second] = Field(ZERO, examples=["0.108 day"])
    """time by which the distortion lags behind its cause; without a delay nothing is dissipated"""
    mean_rate: Rate | None = Field(None, examples=["0.2299715 rad/day"])
    """spin about the figure axis whose distortion is in the body's moments already; by default the rate at
    the start
    """
    raised_by: EachOnce[StrictStr] | None = Field(None, examples=[["earth"]])
    """names of the loads whose sources raise tides; by default all gravity gradients; [] for none"""
    spin: StrictBool = True
    """whether the body's own spin distorts it, too"""


_LANDMARKS = {name for shape in SHAPES.values() for name in shape.landmarks}
Reference = Annotated[
    Annotated[
        StrictStr,
        Tag(NAME_OR_VECTOR[0]),
        WithJsonSchema({"type": "string", "enum": ["center_of_mass", *sorted(_LANDMARKS)]}),
    ]
    | Annotated[Triple[Metre], Tag(NAME_OR_VECTOR[1])],
    name_or_vector('"center_of_mass", a landmark of the shape such as "corner", or a point [x, y, z]'),
]


class Core(ConfigTable):
    """A fluid core that turns by itself: symmetric about the body's axis of largest moment."""

    moment: Annotated[Dimensionless, _PART] = Field(examples=[0.0007])
    """moment of the core about that axis, over the body's moment (core included); at least 0 and below 1"""
    flattening: Annotated[Dimensionless, within("0", "0.5")] = Field(ZERO, examples=[3.8e-4])
    """(C_c - A_c) / C_c of the core's moments, from 0 to 0.5; by it the mantle's pressure turns the core"""
    friction: NotNegative[PerSecond] = Field(ZERO, examples=["1.5e-8 day^-1"])
    """torque between mantle and core per difference of their rates, over the body's largest moment"""
    angular_velocity: Triple[Rate] | None = Field(None, examples=[[0, 0, "13 deg/day"]])
    """angular velocity of the core relative to space at the start, body axes; by default the body's"""


class Matter(Solid):
    """What a body is: exactly one source of inertia, its mass, and its gravity."""

    principal_moments: Triple[MomentOrFormula] | None = Field(
        None, examples=[[1, 2, 2.5], [1, 2, "2 + 0.1*sin(t)"]]
    )
    """principal moments of inertia about the body axes x, y, z; each may be an expression of t, [[states]]
    and [parameters] where mass moves in the body
    """
    inertia_tensor: Triple[Triple[Moment]] | None = Field(
        None, examples=[[[2, -0.1, 0], [-0.1, 3, 0], [0, 0, 4]]]
    )
    """symmetric inertia tensor in any body axes (products are -sum m x y); results are in these axes"""
    points: Annotated[list[PointMass], Field(min_length=1)] | None = Field(
        None, examples=[[{"mass": 1, "position": [0, 0, 1]}]]
    )
    """list of particles"""
    parts: Annotated[list[Part], Field(min_length=1)] | None = None
    """solids that make up the body"""
    preset: Annotated[str, OneOf(PRESETS)] | None = None
    """name of a published body"""
    mass: Positive[Kilogram] | None = Field(None, examples=[12])
    """mass of the body; required for shapes, and wherever a load or the translational motion uses it"""
    gravity_field: GravityFieldTable | None = Field(
        None, examples=[{"radius": "1738 km", "C": {"3,0": -8.4e-6, "3,1": 2.8e-5}, "S": {"3,1": 5.9e-6}}]
    )
    """the body's gravity beyond the inertia tensor, from degree 3 on, for loads that ask for it by degree"""


class Body(Matter):
    """``[body]``: exactly one source of inertia, and what loads need in addition."""

    dynamical_ellipticity: Annotated[Dimensionless, within("0", "0.5")] | None = Field(
        None, examples=["0.0032672658"]
    )
    """of a preset: H = (C - A) / C, which replaces its smaller moments by A = B"""
    core: Core | None = None
    """a fluid core within the body"""
    elasticity: ElasticityTable | None = Field(None, examples=[{"love_number": 0.0216, "radius": "1738 km"}])
    """tides and spin distort the tensor of inertia"""
    surfaces: Annotated[list[SurfaceTable], Field(min_length=1)] | None = Field(
        None, examples=[[{"normal": [0, 0, 1], "area": "0.03 m^2", "specular": 0.2}]]
    )
    """the body's outside for radiation_pressure and drag: plates, boxes and spheres"""
    host: BodyName | None = Field(None, examples=["earth"])
    """name of the point mass in [[bodies]] that is this body"""
    coupling: Literal["one_way", "full"] | None = None
    """whether [[bodies]] feel this body's shape: one_way (the default) or full"""
    center_of_mass: Triple[Metre] | None = Field(None, examples=[[0, 0, 0.5]])
    """position relative to the point that the body turns about, in body axes; with moments or a tensor"""
    reference: Reference | None = Field(None, examples=["corner", [0, 0, -0.5]])
    """the point that the body turns about: center_of_mass (the default), a landmark of the shape (corner,
    apex, end), or a point in the coordinates of the description
    """

    @model_validator(mode="before")
    @classmethod
    def _whole_preset(cls, value: Any) -> Any:
        """With a preset's tables besides moments and mass."""
        preset = PRESETS.get(str(value.get("preset"))) if isinstance(value, dict) else None
        return preset.completed(value) if preset else value


# --- worked out ---------------------------------------------------------------------------------------------

SOURCES = (*_TENSORS, "points", "shape", "file", "parts", "preset")
# A tensor that was printed by a double-precision program obeys the triangle inequality to about this.
_ROUNDING_OF_INPUT = 1e-14

_DIGITS_OF_DOUBLES = range(15, 18)
_DOUBLE = Fraction(1, 2**52)
_ROUNDINGS = 16
"""Spacings of the largest moment by which equal moments may differ. An element of R I R^T that was worked out
in the precision in which it was written is off by some three half spacings (sums of three products), a moment
by the spectral norm of these errors, at most three times the largest, and the difference of two by twice
that: nine spacings. The rest is for an R that isn't quite orthogonal.
"""


@dataclass(frozen=True)
class RigidBody:
    """The rigid body as mechanics needs it; numbers are mpf of the scene's context.

    Attributes:
        mass: kg, or None if the config gives none.
        center_of_mass: body axes, from the reference point, m.
        inertia: 3x3 tensor about the reference point, body axes, kg m^2.
        principal_moments: its eigenvalues (a diagonal tensor keeps the order of its axes).
        principal_axes: the matching unit axes as rows, body axes, right-handed.
        drawing: solids for the pictures (see ``rigidsim.look.solids``), as plain JSON values.
        source: key that the inertia came from, with the preset's reference if there is one.
        gravity: its gravity beyond the inertia tensor; None if the config gives none.
        surfaces: its outside, as light and air meet it.
        points: masses and places, body axes, with its moments to degree 5; None where these are unknown.
        reference: the reference point in the coordinates of the description; None without pieces.
    """

    mass: Any | None
    center_of_mass: Vector
    inertia: Matrix
    principal_moments: Vector
    principal_axes: Matrix
    source: str
    drawing: list[dict[str, Any]] = field(default_factory=list)
    gravity: GravityField | None = None
    surfaces: tuple[OuterSurface, ...] = ()
    points: Points | None = None
    reference: Vector | None = None


@dataclass
class _Piece:
    """Something with mass: tensor about its own centre of mass, along the body axes; its position is in the
    coordinates in which the body is described (a shape's origin is its centre of mass).
    """

    mass: Any
    position: Vector
    inertia: Matrix
    drawing: dict[str, Any]
    points: Points | None = None  # shares of its mass, from its position


def refusal(key: str, text: str) -> ConfigError:
    """The error that names a key of ``[body]``."""
    return ConfigError(Problem(f"[body] {key}".strip(), text))


def build_body(
    table: Body,
    context: Any,
    sequence: str = "zxz",
    moments: Vector | None = None,
    texts: Mapping[str, str] | None = None,
) -> RigidBody:
    """Work out the body of ``[body]``.

    Args:
        sequence: of Euler angles for parts that name none.
        moments: principal moments at the start, if some are expressions (mpf).
        texts: of files, by name.
    """
    preset = PRESETS[str(table.preset)] if table.preset is not None else None
    own = [name for name in SOURCES[:-1] if getattr(table, name) is not None]
    found = " and ".join(own) or "no source of inertia"
    beside = ", with a preset at most one of the others" if preset else ""
    what = f"given {found}; exactly one of {', '.join(SOURCES)} is needed{beside}"
    ensure(len(own) == 1 or (preset and not own), refusal("", what))
    source = own[0] if own else "preset"
    flattened = source == "preset" and preset is not None and not preset.parts
    what = "it replaces smaller moments of a preset; give principal_moments instead"
    ensure(table.dynamical_ellipticity is None or flattened, refusal("dynamical_ellipticity", what))
    if source != "shape":
        _refuse_dimensions(table, (), "which only a shape has", "")
    pieces = _Pieces(context, sequence, texts or {})
    if not own and preset and preset.parts:
        parts = [Part.model_validate(dict(part)) for part in preset.parts]
        return _from_pieces(table.model_copy(update={"parts": parts}), "parts", pieces, preset)
    if source not in ("points", "shape", "file", "parts"):
        return _from_tensor(table, source, context, preset, moments)
    free = source in ("shape", "file") or table.mass is None
    ensure(free, refusal("mass", f"it follows from {source}; remove it"))
    if preset and source == "shape" and table.mass is None and preset.mass:
        table = table.model_copy(update={"mass": parse_number(preset.mass, "kg")})
    return _from_pieces(table, source, pieces)


def _from_tensor(
    table: Body, source: str, context: Any, preset: Preset | None, moments: Vector | None
) -> RigidBody:
    what = f"only shape, points and parts take it; {source} is taken about the point that the body turns "
    ensure(table.reference is None, refusal("reference", what + "about already: remove it"))
    center = vector(context, table.center_of_mass)
    mass = None if table.mass is None else table.mass.at(context)
    if source == "preset" and preset:
        inertia = preset.inertia(context, mass)
        if table.dynamical_ellipticity is not None:
            values = [inertia[i][i] for i in range(3)]
            flat = max(values) * (1 - table.dynamical_ellipticity.at(context))
            inertia = diagonal([x if x == max(values) else flat for x in values])
    elif source == "principal_moments":
        inertia = diagonal(moments or vector(context, table.principal_moments))
    else:
        assert table.inertia_tensor is not None
        _check_symmetric(table.inertia_tensor)
        inertia = [vector(context, row) for row in table.inertia_tensor]
    drawing: list[dict[str, Any]] = []
    if preset and preset.parts:
        whole = build_body(Body.model_validate({"preset": table.preset}), context)
        mass, drawing = whole.mass if mass is None else mass, whole.drawing
    elif preset:
        mass = preset.own_mass(context) if mass is None else mass
        if preset.semi_axes:
            axes = [float(parse_number(a, "m").at(context)) for a in preset.semi_axes]
            name = preset.drawn_as or str(table.preset)
            drawing = [{**_drawn("ellipsoid", {"semi_axes": axes}, center), "name": name}]
    return _finish(context, table, source, mass, center, inertia, drawing)


def _check_symmetric(tensor: list[list[ExactNumber]], place: str = "") -> None:
    for i, j in ((1, 0), (2, 0), (2, 1)):
        what = (
            f"given {float(tensor[i][j])!r}, but [{j}][{i}] is {float(tensor[j][i])!r}; the tensor must be "
        )
        what += "symmetric: write the same number twice"
        ensure(tensor[i][j] == tensor[j][i], refusal(f"{place}inertia_tensor[{i}][{j}]", what))


def _from_pieces(table: Body, source: str, maker: _Pieces, preset: Preset | None = None) -> RigidBody:
    """The body of pieces; a preset's pieces are scaled to another mass of the same shape."""
    named, context = "preset" if preset else source, maker.context
    what = f"it follows from {named}; remove it, and say with reference what the body turns about"
    ensure(table.center_of_mass is None, refusal("center_of_mass", what))
    if source in ("shape", "file"):
        pieces = [maker.made(table, "")]
    elif source == "parts":
        pieces = [maker.placed(part, f"parts[{number}].") for number, part in enumerate(table.parts or [])]
    else:
        zero, point = diagonal([context.zero] * 3), {"solid": "point"}
        given = [(one.mass.at(context), vector(context, one.position)) for one in table.points or []]
        alone = [(context.one, [context.zero] * 3)]
        pieces = [_Piece(mass, position, zero, point, alone) for mass, position in given]
    total = sum((piece.mass for piece in pieces), context.zero)
    if preset and table.mass is not None:
        mass = table.mass.at(context)
        for piece in pieces:
            piece.mass *= mass / total
            piece.inertia = [[x * mass / total for x in row] for row in piece.inertia]
        total = sum((piece.mass for piece in pieces), context.zero)
    center = [sum((p.mass * p.position[i] for p in pieces), context.zero) / total for i in range(3)]
    reference = _reference_point(table, source, center, context)
    inertia = diagonal([context.zero] * 3)
    drawing = []
    points: Points = []
    for piece in pieces:
        arm = minus(piece.position, reference)
        points += ((piece.mass * share, plus(arm, place)) for share, place in piece.points or ())
        own = _moved(piece.inertia, piece.mass, arm)
        inertia = [[x + y for x, y in zip(*rows, strict=True)] for rows in zip(inertia, own, strict=True)]
        drawing.append({**piece.drawing, "position": [float(plain(x)) for x in arm]})
        if piece.drawing["solid"] == "point":
            drawing[-1]["dimensions"] = {"mass_fraction": float(plain(piece.mass / total))}
    body = _finish(context, table, named, total, minus(center, reference), inertia, drawing)
    known = all(piece.points is not None for piece in pieces)
    return replace(body, reference=reference, points=points if known else None)


def _moved(inertia: Matrix, mass: Any, arm: Vector) -> Matrix:
    """A tensor moved from the centre of mass by an arm (Steiner's theorem); back by a negative mass."""
    square = dot(arm, arm)
    shift = [[mass * ((square if i == j else 0) - arm[i] * arm[j]) for j in range(3)] for i in range(3)]
    return [[x + y for x, y in zip(*rows, strict=True)] for rows in zip(inertia, shift, strict=True)]


def _reference_point(table: Body, source: str, center: Vector, context: Any) -> Vector:
    """Reference point in the coordinates in which the body is described."""
    if table.reference is None or table.reference == "center_of_mass":
        return center
    if not isinstance(table.reference, str):
        return vector(context, table.reference)
    shape = SHAPES[str(table.shape)] if source == "shape" else None
    landmarks = shape.landmarks if shape else {}
    allowed = ", ".join(["center_of_mass", *landmarks])
    what = f"given {shown(table.reference)}; allowed here: {allowed}, or a point [x, y, z]"
    ensure(table.reference in landmarks, refusal("reference", what))
    assert shape is not None
    lengths = {key: vector(context, _lengths(table, key)) for key in shape.dimensions}
    return landmarks[table.reference](context, lengths)


def _lengths(table: Solid, key: str) -> list[Any]:
    value = getattr(table, key)
    return value if isinstance(value, list) else [value]


@dataclass(frozen=True)
class _Pieces:
    """Makes pieces of the tables whose keys stand at a place of ``[body]``.

    Attributes:
        sequence: of Euler angles for parts that name none.
        texts: of files, by name.
    """

    context: Any
    sequence: str
    texts: Mapping[str, str]

    def placed(self, part: Part, place: str) -> _Piece:
        """A part where it is in the body."""
        piece, context = self.made(part, place), self.context
        origin, turned = vector(context, part.position), _attitude_of(part, self.sequence, place, context)
        if turned is not None:
            turn = attitude.rotation_matrix(turned[0])
            piece.inertia = multiply(multiply(turn, piece.inertia), transpose(turn))
            piece.position = apply(turn, piece.position)
            piece.points = piece.points and [(share, apply(turn, x)) for share, x in piece.points]
            whole = attitude.product([float(plain(x)) for x in turned[0]], piece.drawing["quaternion"])
            piece.drawing["quaternion"] = whole
        piece.position = [x + p for x, p in zip(piece.position, origin, strict=True)]
        return piece

    def made(self, table: Body | Part, place: str) -> _Piece:
        """A piece along its own axes, from its own origin."""
        if table.file is not None:
            return self._of_file(table, place)
        if table.shape is None and isinstance(table, Part):
            return self._of_tensor(table, place)
        return self._of_shape(table, place)

    def _mass(self, table: Body | Part, place: str) -> Any:
        if table.mass is None:
            raise refusal(f"{place}mass", "missing; this body needs a mass, a positive number")
        return table.mass.at(self.context)

    def _of_shape(self, table: Body | Part, place: str) -> _Piece:
        context, name = self.context, str(table.shape)
        shape = SHAPES[name]
        _refuse_dimensions(table, tuple(shape.dimensions), f"that a {name} doesn't have", place)
        dimensions = {}
        for key, count in shape.dimensions.items():
            values, where = _lengths(table, key), f"{place}{key}"
            lengths = "a positive length" if count == 1 else f"{count} positive lengths"
            ensure(values != [None], refusal(where, f"missing; a {name} needs it: {lengths}"))
            ensure(len(values) == count, refusal(where, f"given {len(values)} lengths; a {name} has {count}"))
            dimensions[key] = vector(context, values)
        for small, large in [shape.at_most] if shape.at_most else []:
            given, limit = (context.nstr(dimensions[key][0], 12) for key in (small, large))
            what = f"given {given} m; at most {large} ({limit} m) is allowed"
            ensure(dimensions[small][0] <= dimensions[large][0], refusal(f"{place}{small}", what))
        mass = self._mass(table, place)
        inertia = diagonal([mass * m for m in shape.moments(context, dimensions)])
        plainly = {k: [float(plain(x)) for x in v] for k, v in dimensions.items()}
        sizes = {k: (v if shape.dimensions[k] > 1 else v[0]) for k, v in plainly.items()}
        origin = [context.zero] * 3
        points = None if shape.points is None else shape.points(context, dimensions)
        return _Piece(mass, origin, inertia, _drawn(name, sizes, origin), points)

    def _of_tensor(self, part: Part, place: str) -> _Piece:
        context, mass, center = (
            self.context,
            self._mass(part, place),
            vector(self.context, part.center_of_mass),
        )
        if part.inertia_tensor is not None:
            _check_symmetric(part.inertia_tensor, place)
            inertia, key = [vector(context, row) for row in part.inertia_tensor], "inertia_tensor"
        else:
            inertia, key = diagonal(vector(context, part.principal_moments)), "principal_moments"
        if part.about == "origin":
            inertia = _moved(inertia, -mass, center)
        return self._alike(mass, center, inertia, place + key)

    def _alike(self, mass: Any, center: Vector, inertia: Matrix, where: str) -> _Piece:
        """A piece that is drawn as the cuboid with its moments."""
        moments, axes = eigen(self.context, inertia)
        _check_moments(self.context, moments, where)
        return _Piece(mass, center, inertia, _equivalent_cuboid(self.context, mass, center, moments, axes))

    def _of_file(self, table: Body | Part, place: str) -> _Piece:
        context, name = self.context, str(table.file)

        def fault(what: str) -> ConfigError:
            return refusal(f"{place}file", f'given "{name}", {what}')

        text = text_of(self.texts, name, lambda what: refusal(f"{place}file", what))
        if not is_mesh(name):
            beside = [key for key in ("mass", "density", "unit") if getattr(table, key) is not None]
            ensure(not beside, fault(f"which has its own mass and units; remove {' and '.join(beside)}"))
            try:
                found = Part.model_validate(link_inertia(text, table.link, fault))
            except ValidationError as error:
                first = error.errors()[0]
                raise fault(f"whose <inertial> has for {first['loc'][0]}: {first['msg']}") from None
            return self.placed(found, f"{place}file ")
        ensure(table.link is None, fault("which is a mesh without links; remove link"))
        what = f"given {'both' if table.mass else 'neither'}; a mesh needs one of mass and density"
        ensure((table.mass is None) != (table.density is None), refusal(f"{place}density", what))
        read, unit = mesh_moments(text), self._unit(table, place)
        volume = context.mpf(read["volume"]) * unit**3
        density = (
            table.density.at(context) if table.density is not None else self._mass(table, place) / volume
        )
        inertia = [[density * context.mpf(x) * unit**5 for x in row] for row in read["tensor"]]
        center = [context.mpf(x) * unit for x in read["center"]]
        piece = self._alike(density * volume, center, inertia, f"{place}file")
        if drawn := read.get("drawing"):  # which texts of before have not
            drawn["step"] = float(plain(context.mpf(drawn["step"]) * unit))
            piece.drawing = _drawn("mesh", drawn, center)
        return piece

    def _unit(self, table: Body | Part, place: str) -> Any:
        """Metres of the unit of a mesh."""
        try:
            return parse_number(f"1 {table.unit or 'm'}", "m").at(self.context)
        except ValueError as error:
            raise refusal(f"{place}unit", str(error)) from None


def field_of_mesh(table: Body, texts: Mapping[str, str]) -> GravityFieldTable | None:
    """The field of degrees 3 and 4 of a body that is a mesh; None of others."""
    if table.file is None or not is_mesh(table.file) or table.reference not in (None, "center_of_mass"):
        return None
    read = mesh_moments(texts[table.file])["gravity_field"]
    if not (read["C"] or read["S"]):
        return None
    return GravityFieldTable.model_validate({**read, "radius": f"{read['radius']} {table.unit or 'm'}"})


def _attitude_of(part: Part, sequence: str, place: str, context: Any) -> Any:
    """Attitude of the part's own axes in the body's; None if it isn't rotated."""
    what = "given without euler_angles; give them, or remove it"
    alone = part.euler_sequence is not None and part.euler_angles is None
    ensure(not alone, refusal(f"{place}euler_sequence", what))
    fault = lambda key, text: refusal(f"{place}{key}", text)  # noqa: E731
    return attitude.given_attitude(context, part, part.euler_sequence or sequence, fault)


def _refuse_dimensions(table: Solid, allowed: tuple[str, ...], why: str, place: str) -> None:
    """Raise ``ConfigError`` if a dimension is given that isn't among the allowed ones."""
    suffix = f"; allowed: {', '.join(allowed)}" if allowed else ""
    for key in set(DIMENSIONS) - set(allowed):
        unknown = getattr(table, key) is not None
        ensure(not unknown, refusal(f"{place}{key}", f"given a dimension {why}{suffix}; remove it"))


def _drawn(solid: str, dimensions: dict[str, Any], position: Vector) -> dict[str, Any]:
    """A solid for pictures, not rotated, as plain JSON values (see ``rigidsim.look.solids``)."""
    place = [float(plain(x)) for x in position]
    return {"solid": solid, "dimensions": dimensions, "position": place, "quaternion": [1.0, 0.0, 0.0, 0.0]}


def _finish(
    context: Any,
    table: Body,
    source: str,
    mass: Any,
    center: Vector,
    inertia: Matrix,
    drawing: list[dict[str, Any]],
) -> RigidBody:
    """The body of a tensor, which a body can have."""
    moments, axes = eigen(context, inertia)
    if any(inertia[i][j] != 0 for i in range(3) for j in range(i)):  # axes that follow from the numbers
        inertia, moments, axes = _merged(context, inertia, moments, axes, _rounding_of(table))
    largest = max(abs(m) for m in moments)
    ensure(
        largest != 0, refusal(source, "all moments are zero; a body that turns needs inertia about some axis")
    )
    tiny = largest * context.mpf(2) ** (16 - context.prec)
    moments = [context.zero if abs(m) < tiny else m for m in moments]
    _check_moments(context, moments, source)
    drawing = drawing or [_equivalent_cuboid(context, mass, center, moments, axes)]
    described = source
    if table.preset is not None:  # with its reference, and what else stands in its place
        named = f"preset {table.preset} ({PRESETS[str(table.preset)].source})"
        scaled = f"{named}, with the mass of the config" if table.mass is not None else named
        described = scaled if source == "preset" else f"{source} with {named}"
    return RigidBody(mass, center, inertia, moments, axes, described, drawing)


def _check_moments(context: Any, moments: Vector, where: str) -> None:
    """Refuse principal moments that no mass has."""
    given = f"principal moments {', '.join(context.nstr(m, 12) for m in moments)}: "
    small, middle, large = sorted(moments)
    ensure(small >= 0, refusal(where, f"{given}a moment of inertia can't be negative: correct it"))
    ensure(
        middle != 0 or large == 0,
        refusal(where, f"{given}at most one can be zero (a rod's): give the others"),
    )
    what = f"{given}the largest is more than the sum of the other two by "
    what += f"{context.nstr(large - small - middle, 6)}, which no mass has (I1 + I2 >= I3): correct one"
    ensure(small + middle >= large - large * context.mpf(_ROUNDING_OF_INPUT), refusal(where, what))


def _equivalent_cuboid(
    context: Any, mass: Any, center: Vector, moments: Vector, axes: Matrix
) -> dict[str, Any]:
    """The homogeneous cuboid with these moments (of unit mass if no mass is known)."""
    moments, heavy = [plain(m) for m in moments], plain(mass) or context.one
    total = sum(moments) / 2
    edges = [context.sqrt(max(12 * (total - m), context.zero) / heavy) for m in moments]
    visible = [float(max(edge, max(edges) / 40)) for edge in edges]  # a plate stays visible edge on
    columns = transpose([[plain(x) for x in row] for row in axes])
    q = [float(x) for x in attitude.quaternion_from_matrix(context, columns)]
    # only its moments are known, not its shape
    return {**_drawn("cuboid", {"size": visible}, center), "quaternion": q, "equivalent": True}


def inverse_inertia(context: Any, body: RigidBody) -> Matrix:
    """Pseudo-inverse of the tensor: about an axis without inertia (a rod's) nothing is accelerated."""
    inverse = [context.zero if m == 0 else 1 / m for m in body.principal_moments]
    return multiply(multiply(transpose(body.principal_axes), diagonal(inverse)), body.principal_axes)


def _merged(
    context: Any, inertia: Matrix, moments: Vector, axes: Matrix, rounding: Fraction
) -> tuple[Matrix, Vector, Matrix]:
    """A tensor with its moments and axes (rows); moments equal to a relative ``rounding`` are made equal."""
    tiny = _ROUNDINGS * context.mpf(rounding.numerator) / rounding.denominator * max(moments)
    low, middle, high = sorted(range(3), key=lambda i: moments[i])
    if moments[high] - moments[low] <= tiny:
        mean = sum(moments, context.zero) / 3
        return diagonal([mean] * 3), [mean] * 3, diagonal([context.one] * 3)
    lower, upper = moments[middle] - moments[low], moments[high] - moments[middle]
    if min(lower, upper) > tiny or min(lower, upper) == 0:
        return inertia, moments, axes
    single, pair = (high, (low, middle)) if lower < upper else (low, (middle, high))
    mean = (moments[pair[0]] + moments[pair[1]]) / 2
    equal = [moments[i] if i == single else mean for i in range(3)]
    axis, more = axes[single], moments[single] - mean
    return (
        [[(mean if i == j else context.zero) + more * axis[i] * axis[j] for j in range(3)] for i in range(3)],
        equal,
        axes,
    )


def _rounding_of(table: BaseModel) -> Fraction:
    """Relative rounding of the coarsest number of a table that looks rounded; 0 if none does."""
    given = [x for path, found in numbers(table) for x in found if path.steps[0] != "gravity_field"]
    return max(map(_rounding, given), default=Fraction(0))


def _rounding(number: ExactNumber) -> Fraction:
    written = None if number.swept else exact_decimal(number.rational)
    digits = len(written.as_tuple().digits) if written else 0  # a fraction that is no decimal is exact
    if digits in _DIGITS_OF_DOUBLES:
        return _DOUBLE
    return Fraction(1, 10 ** (digits - 1)) if digits >= _DIGITS_OF_DOUBLES.stop else Fraction(0)
