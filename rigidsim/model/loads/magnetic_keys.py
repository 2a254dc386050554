"""Keys of loads by a magnetic field, and contradictions among them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field, StrictInt, Tag

from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.effect_parts import EffectPart
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.fields import (
    NAME_OR_VECTOR,
    GravitationalParameter,
    InUnit,
    Metre,
    NumberOrFormula,
    Triple,
    name_or_vector,
)
from rigidsim.scene.geomagnetic_field import MOST
from rigidsim.scene.orbit_keys import OrbitFields
from rigidsim.scene.registry import Setting

MagneticMoment = Annotated[ExactNumber, InUnit("A m^2")]
MomentOrLaw = Annotated[Any, NumberOrFormula("A m^2")]
FluxDensity = Annotated[ExactNumber, InUnit("T")]
IGRF = "igrf"


class MagneticFieldFields(OrbitFields):
    """Keys of a magnetic field: uniform, or of a dipole about which the body moves, or the Earth's."""

    kind: str
    field: (
        Annotated[
            Annotated[Literal["igrf"], Tag(NAME_OR_VECTOR[0])]
            | Annotated[Triple[FluxDensity], Tag(NAME_OR_VECTOR[1])],
            name_or_vector('"igrf" (the Earth\'s) or a vector in space axes'),
        ]
        | None
    ) = Field(
        default=None,
        description='uniform flux density, space axes; or "igrf", the Earth\'s field, which turns with it, '
        "for a body in flight",
        examples=[["30 uT", 0, 0], "igrf"],
    )
    field_degree: StrictInt | None = Field(
        default=None,
        ge=1,
        le=MOST,
        description=f"degree of the igrf: 1 is a tilted dipole; by default {MOST}, all of it",
        examples=[6],
    )
    source_moment: Triple[MagneticMoment] | None = Field(
        default=None,
        description="magnetic moment of the source, space axes, with orbit, satellite_orbit or in flight",
        examples=[[0, 0, -7.7e22]],
    )
    position: Triple[Metre] | None = Field(
        default=None,
        description="place of the source, space axes, for a body with a position; by default the "
        "point of its central_gravity",
        examples=[[0, 0, 0]],
    )
    gravitational_parameter: GravitationalParameter | None = Field(
        default=None, description="G M of the source, from which the orbit's period follows"
    )

    def placed_by(self, *, free_flight: bool) -> frozenset[str] | None:
        if self.elements is not None:
            return frozenset()
        return frozenset({"flight"}) if free_flight and self.of_place else None

    @property
    def of_place(self) -> bool:
        """Whether the field of a body in flight is that where it is."""
        return self.source_moment is not None or self.field == IGRF


class MagneticDipoleFields(MagneticFieldFields):
    """Torque m x B on a dipole of the body, in a uniform ``field`` (space axes), or in the field of a centred
    dipole ``source_moment`` (space axes) around which the body moves on an orbit, or in flight as it flies.
    """

    kind: Literal["magnetic_dipole"]
    moment: Triple[MomentOrLaw] = Field(
        description="magnetic moment of the body, body axes: numbers, or expressions of t, the state, "
        "bx by bz and [parameters], such as a law of magnetorquers; zero for a field alone",
        examples=[["0 A m^2", "0 A m^2", "0.5 A m^2"]],
    )


def numbers(values: list[ExactNumber], around: Setting) -> Vector:
    """Values of a key as mpf."""
    return [x.at(around.context) for x in values]


def refuse_contradictions(fields: MagneticFieldFields, around: Setting) -> None:
    """Require one field: uniform, of a dipole along an orbit, or in flight of a dipole where the body is."""
    host = around.bodies is not None and around.bodies.host is not None
    if fields.elements is not None and (around.free_flight or host):
        why = "is one of [[bodies]]; a uniform field is allowed"
        if around.free_flight:
            why = "has a position, where the field is taken: remove it and "
            why += "gravitational_parameter, and keep source_moment"
        raise around.fault(fields.elements.key, f"given for a body that {why}")
    if fields.field_degree is not None and fields.field != IGRF:
        raise around.fault("field_degree", f'given without field = "{IGRF}", whose degree it is; remove it')
    if fields.field == IGRF and not around.free_flight:
        what = (
            f'given "{IGRF}", the field where a body in flight is; give [initial] position and velocity and '
        )
        raise around.fault("field", what + "a central_gravity, or a vector, or source_moment with an orbit")
    other = fields.source_moment if around.free_flight else fields.elements
    if (fields.field is None) == (other is None):
        given = "neither field nor" if fields.field is None else "both field and"
        name, why = ("source_moment", " for a body with a position") if around.free_flight else ("orbit", "")
        raise around.fault("field", f"given {given} {name}; exactly one of them is needed{why}")
    if not around.free_flight and (fields.source_moment is None) != (fields.elements is None):
        what = (
            "given without an orbit; remove it" if fields.elements is None else "missing; an orbit needs it"
        )
        raise around.fault("source_moment", what)
    if fields.position is not None and not (around.free_flight and fields.of_place):
        what = (
            f'given; allowed with source_moment or "{IGRF}", for a body with [initial] position and velocity'
        )
        raise around.fault("position", what)


def field_parts(fields: MagneticFieldFields) -> Iterator[EffectPart]:
    """Each degree of the Earth's field above the first, with those above it."""
    if fields.field != IGRF:
        yield EffectPart("igrf", "the Earth's magnetic field", missing=f'field isn\'t "{IGRF}"')
        return
    most = fields.field_degree or MOST
    for n in range(most, 1, -1):
        words = f"degrees {n} to {most}" if n < most else f"degree {n}"
        wider = tuple(f"field-degree-{d}" for d in range(2, n))
        yield EffectPart(
            f"field-degree-{n}", f"{words} of the Earth's magnetic field", {"field_degree": n - 1}, wider
        )
