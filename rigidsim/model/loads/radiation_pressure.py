"""Radiation pressure: light that the body's surfaces absorb, reflect and scatter.

A plate of area A with unit normal n, met by light from direction u with c = n . u > 0, is pushed by

    F = -P A c ((1 - s) u + 2 (s c + d/3) n)

with the shares s reflected and d scattered by Lambert's law (Montenbruck & Gill, Satellite Orbits, 2000,
section 3.4; Wertz, Spacecraft Attitude Determination and Control, 1978, section 17.2.2); the integral over a
sphere is -P pi R^2 (1 + 4 d/9) u. P is the irradiance over the speed of light, which falls with the square of
the distance.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated, Any, Literal

from pydantic import Field, StrictBool

from rigidsim.model.loads.surface_load import Pushes, SurfaceLoad
from rigidsim.scene.bodies.outside import OuterSurface, Plate
from rigidsim.scene.effect_parts import EffectPart
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.fields import InUnit, NotNegative, VariableName
from rigidsim.scene.registry import LoadFields, Setting, register_load

SPEED_OF_LIGHT = 299792458  # m/s, exact
_AU = 149597870700  # m, exact (IAU 2012)
_SUN = ExactNumber(Fraction(1361))
"""Irradiance at 1 au, W/m^2: 1360.8 +- 0.5 (Kopp & Lean, Geophysical Research Letters 38, L01706, 2011)."""
Irradiance = Annotated[ExactNumber, InUnit("W/m^2")]


class RadiationPressureFields(LoadFields):
    """Light of a named source on the body's surfaces: absorbed, reflected and scattered."""

    kind: Literal["radiation_pressure"]
    light: VariableName = Field(
        description="name of the load whose source shines, as the Sun's gravity_gradient with name = "
        '"sun"; its shadow_NAME counts where the scene has one',
        examples=["sun"],
    )
    irradiance: NotNegative[Irradiance] = Field(
        default=_SUN,
        description="at 1 au; the Sun's by default",
        examples=["1361 W/m^2"],
        json_schema_extra={"default": 1361},
    )
    shadow: StrictBool = Field(default=True, description="whether shadow_NAME counts where the scene has it")


@register_load
@dataclass(frozen=True)
class RadiationPressure(SurfaceLoad):
    """Light of a named source on plates and spheres."""

    light: str
    Fields = RadiationPressureFields
    title = "radiation_pressure"

    @staticmethod
    def effect_parts(fields: RadiationPressureFields) -> Iterator[EffectPart]:
        missing = "" if fields.shadow else "it is left out by shadow = false"
        yield EffectPart("shadow", "shadow on that light", {"shadow": False}, missing=missing)

    @classmethod
    def resolve(cls, fields: RadiationPressureFields, around: Setting) -> RadiationPressure:
        name = fields.light
        if f"r_{name}" not in around.names:
            known = [x.removeprefix("r_") for x in around.names if x.startswith("r_")]
            have = f"sources of this scene: {', '.join(known)}" if known else "this scene has no named source"
            what = (
                f'given "{name}", which is no source; {have}. A load such as a gravity_gradient on an orbit '
            )
            raise around.fault("light", f'{what}with name = "{name}" says where it is')
        pushes = Pushes(around, cls.title, [f"u{axis}_{name}" for axis in "xyz"])
        pressure = fields.irradiance.at(around.context) / SPEED_OF_LIGHT
        for number, surface in pushes.surfaces():
            _push(pushes, number, surface, pressure)
        factors = [pushes.parsed(f"({_AU}/r_{name})^2")]
        if fields.shadow and f"shadow_{name}" in around.names:
            factors.append(pushes.parsed(f"shadow_{name}"))
        return cls(pushes.acting(), pushes.stream, tuple(factors), around.free_flight, name)


def _push(pushes: Pushes, number: int, surface: OuterSurface, pressure: Any) -> None:
    size = pressure * surface.area
    if not isinstance(surface, Plate):
        pushes.on_sphere(surface, -size * (1 + 4 * surface.diffuse / 9))
        return
    normal = surface.unit(pushes.around.context)
    pushes.on_plate(surface, number, -size * (1 - surface.specular))
    pushes.on_plate(surface, number, -2 * size * surface.specular, normal, power=2)
    pushes.on_plate(surface, number, -2 * size * surface.diffuse / 3, normal)
