"""``[body]``: the keys for one source of inertia, and for anything else that loads need."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, StrictBool, StrictStr, Tag, WithJsonSchema, create_model, model_validator

from rigidsim.scene.bodies.gravity_field import GravityFieldTable
from rigidsim.scene.bodies.outside import SurfaceTable
from rigidsim.scene.bodies.presets import PRESETS
from rigidsim.scene.bodies.shapes import DIMENSIONS, SHAPES
from rigidsim.scene.exact import ZERO
from rigidsim.scene.fields import (
    NAME_OR_VECTOR,
    Angle,
    BodyName,
    ConfigTable,
    Dimensionless,
    EachOnce,
    EulerSequence,
    Four,
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
    Second,
    Triple,
    name_or_vector,
    within,
)

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


class _Shaped(ConfigTable):
    shape: Annotated[str, OneOf(SHAPES)] | None = None
    """a homogeneous solid; needs mass and dimensions"""


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
    """One solid of a composite body, placed by its centre of mass, turned by a quaternion or Euler angles."""

    shape: Annotated[str, OneOf(SHAPES)]
    """a homogeneous solid; needs mass and dimensions"""
    mass: Positive[Kilogram]
    """mass of the part"""
    position: Triple[Metre] = Field([ZERO] * 3)
    """position of its centre of mass, in body axes"""
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
    """time by which the distortion lags behind its cause; without one nothing is dissipated"""
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
    """its moment about that axis, over the body's own, which includes it; at least 0 and below 1"""
    flattening: Annotated[Dimensionless, within("0", "0.5")] = Field(ZERO, examples=[3.8e-4])
    """(C_c - A_c) / C_c of its moments, from 0 to 0.5: by it the mantle's pressure turns it"""
    friction: NotNegative[PerSecond] = Field(ZERO, examples=["1.5e-8 day^-1"])
    """torque of the mantle on it per difference of their rates, over the body's largest moment"""
    angular_velocity: Triple[Rate] | None = Field(None, examples=[[0, 0, "13 deg/day"]])
    """its angular velocity relative to space at the start, body axes; by default the body's"""


class Body(Solid):
    """``[body]``: exactly one source of inertia, and what loads need in addition."""

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
    core: Core | None = None
    """a fluid core within the body"""
    elasticity: ElasticityTable | None = Field(None, examples=[{"love_number": 0.0216, "radius": "1738 km"}])
    """tides and spin distort the tensor of inertia"""
    mass: Positive[Kilogram] | None = Field(None, examples=[12])
    """mass of the body; required for shapes, and wherever a load or the translational motion uses it"""
    gravity_field: GravityFieldTable | None = Field(
        None, examples=[{"radius": "1738 km", "C": {"3,0": -8.4e-6, "3,1": 2.8e-5}, "S": {"3,1": 5.9e-6}}]
    )
    """the body's gravity beyond the inertia tensor, from degree 3 on, for loads that ask for it by degree"""
    surfaces: Annotated[list[SurfaceTable], Field(min_length=1)] | None = Field(
        None, examples=[[{"normal": [0, 0, 1], "area": "0.03 m^2", "specular": 0.2}]]
    )
    """its outside as light and air meet it: plates, boxes and spheres, for radiation_pressure and drag"""
    host: BodyName | None = Field(None, examples=["earth"])
    """name of the point mass in [[bodies]] that this body is"""
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
        """With what a preset says beside moments and mass."""
        preset = PRESETS.get(str(value.get("preset"))) if isinstance(value, dict) else None
        return preset.completed(value) if preset else value
