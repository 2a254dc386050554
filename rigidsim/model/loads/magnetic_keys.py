"""Keys of ``magnetic_dipole``, and contradictions among them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.fields import GravitationalParameter, InUnit, Metre, NumberOrFormula, Triple
from rigidsim.scene.orbits import Orbit
from rigidsim.scene.registry import LoadFields, Surroundings

MagneticMoment = Annotated[ExactNumber, InUnit("A m^2")]
MomentOrLaw = Annotated[Any, NumberOrFormula("A m^2")]
FluxDensity = Annotated[ExactNumber, InUnit("T")]


class MagneticDipoleFields(LoadFields):
    """Torque m x B on a dipole of the body, in a uniform ``field`` (space axes), or in the field of a centred
    dipole ``source_moment`` (space axes) around which the body moves on ``orbit``, or in flight as it flies.
    """

    kind: Literal["magnetic_dipole"]
    moment: Triple[MomentOrLaw] = Field(
        description="magnetic moment of the body, body axes: numbers, or expressions of t, the state, "
        "bx by bz and [parameters], such as a law of magnetorquers; zero for a field alone",
        examples=[["0 A m^2", "0 A m^2", "0.5 A m^2"]],
    )
    field: Triple[FluxDensity] | None = Field(
        default=None, description="uniform flux density, space axes", examples=[["30 uT", 0, 0]]
    )
    orbit: Orbit | None = Field(
        default=None,
        description="orbit of the source as seen from the body, instead of field; needs source_moment; not "
        "for a body with a position of its own, where which the field is taken",
    )
    source_moment: Triple[MagneticMoment] | None = Field(
        default=None, description="magnetic moment of the source, space axes", examples=[[0, 0, -7.7e22]]
    )
    position: Triple[Metre] | None = Field(
        default=None,
        description="place of the source, space axes, for a body with a position of its own; by default the "
        "point of its central_gravity",
        examples=[[0, 0, 0]],
    )
    gravitational_parameter: GravitationalParameter | None = Field(
        default=None, description="G M of the source, from which the orbit's period follows"
    )

    def placed_by(self, *, free_flight: bool) -> frozenset[str] | None:
        if self.orbit is not None:
            return frozenset()
        return frozenset({"flight"}) if free_flight and self.source_moment is not None else None


def numbers(values: list[ExactNumber], around: Surroundings) -> Vector:
    """Values of a key as mpf."""
    return [x.at(around.context) for x in values]


def refuse_contradictions(fields: MagneticDipoleFields, around: Surroundings) -> None:
    """Require one field: uniform, of a dipole along an orbit, or in flight of a dipole where the body is."""
    host = around.bodies is not None and around.bodies.host is not None
    if fields.orbit is not None and (around.free_flight or host):
        why = "is one of [[bodies]]; a uniform field is allowed"
        if around.free_flight:
            why = "has a position of its own, where the field is taken: remove orbit and "
            why += "gravitational_parameter, and keep source_moment"
        raise around.fault("orbit", f"given for a body that {why}")
    other = fields.source_moment if around.free_flight else fields.orbit
    if (fields.field is None) == (other is None):
        given = "neither field nor" if fields.field is None else "both field and"
        name, why = ("source_moment", " for a body with a position") if around.free_flight else ("orbit", "")
        raise around.fault("field", f"given {given} {name}; exactly one of them is needed{why}")
    if not around.free_flight and (fields.source_moment is None) != (fields.orbit is None):
        what = "missing; it is needed with orbit" if fields.orbit else "given without orbit; remove it"
        raise around.fault("source_moment", what)
    if fields.position is not None and not (around.free_flight and fields.source_moment is not None):
        what = "given; allowed with source_moment, for a body with [initial] position and velocity"
        raise around.fault("position", what)
