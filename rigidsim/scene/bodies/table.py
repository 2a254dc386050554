"""``[body]``: the keys for one source of inertia, and for anything else that loads need."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Discriminator, Field, StrictStr, Tag, WithJsonSchema, create_model, field_validator

from rigidsim.scene.bodies.presets import PRESETS
from rigidsim.scene.bodies.shapes import DIMENSIONS, SHAPES
from rigidsim.scene.exact import ZERO
from rigidsim.scene.fields import (
    Angle,
    ConfigTable,
    Dimensionless,
    EulerSequence,
    Four,
    Kilogram,
    Later,
    Metre,
    Moment,
    Triple,
    refuse,
)
from rigidsim.scene.validation_messages import nearest, shown

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
_ORIGIN: dict[str, Any] = {"default": [0, 0, 0]}
POINT_OR_NAME = ("as a name", "as a point")
"""Names of the alternatives of ``[body] reference``."""


def _kind_of_reference(value: Any) -> str | None:
    if isinstance(value, str):
        return POINT_OR_NAME[0]
    return POINT_OR_NAME[1] if isinstance(value, list) else None


class PointMass(ConfigTable):
    """One particle of a body of particles."""

    mass: Kilogram = Field(description="mass of the particle")
    position: Triple[Metre] = Field(description="position in body axes")


def _named(names: Iterable[str]) -> dict[str, Any]:
    return {"enum": list(names)}


class _Shaped(ConfigTable):
    shape: StrictStr | None = Field(
        default=None,
        description="a homogeneous solid; needs mass and dimensions",
        json_schema_extra=_named(SHAPES),
    )

    @field_validator("shape")
    @classmethod
    def _known_shape(cls, value: str | None) -> str | None:
        if value is not None and value not in SHAPES:
            raise refuse(f"given {shown(value)}{nearest(value, SHAPES)}; allowed: {', '.join(SHAPES)}")
        return value


def _dimension(key: str, count: int) -> Any:
    """Type and description of a key that sizes shapes."""
    taking = [name for name, shape in SHAPES.items() if key in shape.dimensions]
    told = f"{_SIZES[key]}; of {' and '.join(', '.join(taking).rsplit(', ', 1))}"
    if count == 1:
        return Metre | None, Field(default=None, description=told, examples=[0.5])
    most: dict[str, Any] = {
        "minItems": min(SHAPES[name].dimensions[key] for name in taking),
        "maxItems": count,
    }
    field = Field(default=None, description=told, examples=[[4, 3, 2][:count]], json_schema_extra=most)
    return list[Metre] | None, field


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

    shape: StrictStr = Field(
        description="a homogeneous solid; needs mass and dimensions", json_schema_extra=_named(SHAPES)
    )
    mass: Kilogram = Field(description="mass of the part")
    position: Triple[Metre] = Field(
        default_factory=lambda: [ZERO] * 3,
        description="position of its centre of mass, in body axes",
        json_schema_extra=_ORIGIN,
    )
    quaternion: Four[Dimensionless] | None = Field(
        default=None, description="attitude w, x, y, z: takes the part's own axes to the body's"
    )
    euler_angles: Triple[Angle] | None = Field(
        default=None, description="attitude from the part's own axes to the body's, instead of quaternion"
    )
    euler_sequence: EulerSequence | None = Field(
        default=None, description="sequence of euler_angles; by default that of [integrator]"
    )


_LANDMARK = WithJsonSchema(
    {
        "type": "string",
        "enum": ["center_of_mass", *sorted({name for shape in SHAPES.values() for name in shape.landmarks})],
    }
)


class Body(Solid):
    """``[body]``: exactly one source of inertia, and what loads need beside it."""

    principal_moments: Triple[Moment] | None = Field(
        default=None,
        description="principal moments of inertia about the body axes x, y, z",
        examples=[[1, 2, 2.5]],
    )
    inertia_tensor: Triple[Triple[Moment]] | None = Field(
        default=None,
        description="symmetric inertia tensor in any body axes (products are -sum m x y); results are in "
        "these axes",
        examples=[[[2, -0.1, 0], [-0.1, 3, 0], [0, 0, 4]]],
    )
    points: Annotated[list[Later[PointMass]], Field(min_length=1)] | None = Field(
        default=None, description="list of particles", examples=[[{"mass": 1, "position": [0, 0, 1]}]]
    )
    parts: Annotated[list[Later[Part]], Field(min_length=1)] | None = Field(
        default=None, description="solids that make up the body"
    )
    preset: StrictStr | None = Field(
        default=None, description="name of a published body", json_schema_extra=_named(PRESETS)
    )
    mass: Kilogram | None = Field(
        default=None,
        description="mass of the body; required for shapes, and wherever a load or the translational "
        "motion uses it",
        examples=[12],
    )
    host: StrictStr | None = Field(
        default=None, description="name of the point mass in [[bodies]] that this body is", examples=["earth"]
    )
    coupling: Literal["one_way", "full"] | None = Field(
        default=None,
        description="whether [[bodies]] feel this body's shape: one_way (the default) or full",
    )
    center_of_mass: Triple[Metre] | None = Field(
        default=None,
        description="position relative to the point that the body turns about, in body axes; with "
        "moments or a tensor",
        examples=[[0, 0, 0.5]],
    )
    reference: (
        Annotated[
            Annotated[StrictStr, Tag(POINT_OR_NAME[0]), _LANDMARK]
            | Annotated[Triple[Metre], Tag(POINT_OR_NAME[1])],
            Discriminator(
                _kind_of_reference,
                custom_error_type="kind_of_value",
                custom_error_message='"center_of_mass", a landmark of the shape such as "corner", or a point '
                "[x, y, z] is allowed",
            ),
        ]
        | None
    ) = Field(
        default=None,
        description="the point that the body turns about: center_of_mass (the default), a landmark of the "
        "shape (corner, apex, end), or a point in the coordinates of the description",
        examples=["corner", [0, 0, -0.5]],
    )
