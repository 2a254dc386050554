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
        default=None, description="what the axes of space are; an ephemeris has ecliptic J2000"
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
        description="the plane that obliquity and longitudes count from: space (XY), orbit (the source's "
        "own, moving plane), or a normal [x, y, z] in space axes",
    )
    figure_axis: Literal["x", "y", "z", "largest", "symmetry"] | None = Field(
        default=None,
        description="the body axis that obliquity, wobble and polar motion speak of; by default the axis of "
        "symmetry, or that of the largest moment where there is none",
    )
