"""``[body]``: the keys of which one source of inertia is made, and what loads need beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Discriminator, Field, StrictStr, Tag, create_model, field_validator

from rigidsim.scene.exact import ZERO
from rigidsim.scene.fields import (
    Angle,
    ConfigTable,
    Dimensionless,
    EulerSequence,
    Four,
    Kilogram,
    Metre,
    Moment,
    Triple,
    refuse,
)
from rigidsim.scene.shapes import DIMENSIONS, SHAPES
from rigidsim.scene.validation_messages import nearest, shown

POINT_OR_NAME = ("as a name", "as a point")
"""Names of the alternatives of ``[body] reference``."""


def _kind_of_reference(value: Any) -> str | None:
    if isinstance(value, str):
        return POINT_OR_NAME[0]
    return POINT_OR_NAME[1] if isinstance(value, list) else None


class PointMass(ConfigTable):
    """One particle of a body of particles."""

    mass: Kilogram
    position: Triple[Metre]


class _Shaped(ConfigTable):
    shape: StrictStr | None = None

    @field_validator("shape")
    @classmethod
    def _known_shape(cls, value: str | None) -> str | None:
        if value is not None and value not in SHAPES:
            raise refuse(f"given {shown(value)}{nearest(value, SHAPES)}; allowed: {', '.join(SHAPES)}")
        return value


if TYPE_CHECKING:
    Solid = _Shaped
else:
    Solid = create_model(
        "Solid",
        __base__=_Shaped,
        __doc__="A homogeneous shape with its dimensions (metres); see ``shapes.SHAPES`` for which it takes.",
        **{key: ((list[Metre] if count > 1 else Metre) | None, None) for key, count in DIMENSIONS.items()},
    )


class Part(Solid):
    """One solid of a composite body, placed by its centre of mass, turned by a quaternion or Euler angles."""

    shape: StrictStr
    mass: Kilogram
    position: Triple[Metre] = Field(default_factory=lambda: [ZERO] * 3)
    quaternion: Four[Dimensionless] | None = None
    euler_angles: Triple[Angle] | None = None
    euler_sequence: EulerSequence | None = Field(
        default=None, description="of euler_angles; that of [integrator] by default"
    )


class Body(Solid):
    """``[body]``: exactly one source of inertia, and what loads need beside it."""

    principal_moments: Triple[Moment] | None = None
    inertia_tensor: Triple[Triple[Moment]] | None = None
    points: Annotated[list[PointMass], Field(min_length=1)] | None = None
    parts: Annotated[list[Part], Field(min_length=1)] | None = None
    preset: StrictStr | None = None
    mass: Kilogram | None = None
    center_of_mass: Triple[Metre] | None = None
    reference: (
        Annotated[
            Annotated[StrictStr, Tag(POINT_OR_NAME[0])] | Annotated[Triple[Metre], Tag(POINT_OR_NAME[1])],
            Discriminator(
                _kind_of_reference,
                custom_error_type="kind_of_value",
                custom_error_message='"center_of_mass", a landmark of the shape such as "corner", or a point '
                "[x, y, z] is allowed",
            ),
        ]
        | None
    ) = None
