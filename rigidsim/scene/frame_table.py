"""``[frame]``: the keys that define the axes and planes from which a scene's angles count."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from rigidsim.scene.fields import ConfigTable, Dimensionless, Triple
from rigidsim.scene.space_axes import SpaceAxes

PLANE_OR_NORMAL = ("as a name", "as a normal")
"""Names of the alternatives of ``[frame] reference``."""


def _kind_of_plane(value: Any) -> str | None:
    if isinstance(value, str):
        return PLANE_OR_NORMAL[0]
    return PLANE_OR_NORMAL[1] if isinstance(value, list) else None


class Frame(ConfigTable):
    """``[frame]``: what the scene's axes are, beside its own equations, and what angles are counted from."""

    axes: SpaceAxes | None = Field(
        default=None, description="name of the space axes; with an ephemeris they are ecliptic J2000"
    )
    reference: Annotated[
        Annotated[Literal["space", "orbit"], Tag(PLANE_OR_NORMAL[0])]
        | Annotated[Triple[Dimensionless], Tag(PLANE_OR_NORMAL[1])],
        Discriminator(
            _kind_of_plane,
            custom_error_type="kind_of_value",
            custom_error_message='"space" (the plane XY), "orbit" (the source\'s own, moving plane) or a '
            "normal [x, y, z] in space axes is allowed",
        ),
    ] = Field(
        default="space",
        description="reference plane of obliquity and longitudes: space (XY), orbit (the moving plane of "
        "the source's orbit), or a normal [x, y, z] in space axes",
    )
    figure_axis: Literal["x", "y", "z", "largest", "symmetry"] | None = Field(
        default=None,
        description="the body axis to which obliquity, wobble and polar motion refer; by default the "
        "axis of symmetry, or that of the largest moment if there is none",
    )
