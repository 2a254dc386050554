"""Drag of the air on the body's surfaces.

A plate of area A with unit normal n moves through the air with velocity v, and is met by it if n . v > 0:
the force is -rho C A (n . v) v / 2, that of the area seen against the stream; a sphere's is
-rho C pi R^2 |v| v / 2 (Montenbruck & Gill, Satellite Orbits, 2000, section 3.5).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field

from rigidsim.model.air_density import AIR_DENSITY, INDICES, LEAST, NRLMSISE, height
from rigidsim.model.flight_names import RELATIVE_NAMES, flown_about
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, loads_of
from rigidsim.model.loads.applied import Applied
from rigidsim.model.loads.attraction import Attraction
from rigidsim.model.loads.surface_load import Pushes, SurfaceLoad
from rigidsim.model.names import written
from rigidsim.model.plausibility import about_altitude
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.bodies.outside import Plate
from rigidsim.scene.bodies.presets import known_body
from rigidsim.scene.cautions import Caution
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.tree import Expression, evaluate, names_used
from rigidsim.scene.fields import Dimensionless, Metre, NumberOrFormula, Positive, together, within
from rigidsim.scene.initial_values import start_values
from rigidsim.scene.point_masses import kepler_reach
from rigidsim.scene.registry import LoadFields, Setting, register_load
from rigidsim.scene.scene import Scene
from rigidsim.scene.transitions import WIDE, narrow_parts, root_parts

_FALLING = 2.0**-10  # ratio of the least to the largest distance of an orbit that all but meets the centre
_PLACES = 16  # along an orbit, between which what reads the altitude is smooth

Density = Annotated[Any, NumberOrFormula("kg/m^3")]


class DragFields(LoadFields):
    """Drag on the body's surfaces of the air about the body that it flies about."""

    rules = (together("altitude", "scale_height"), together("f107", "f107a", "ap"))
    kind: Literal["drag"]
    density: Density = Field(
        description="of the air: a number, an expression of altitude, t, the state and [parameters], or "
        '"nrlmsise00", the Earth\'s by that model',
        examples=["4e-12 kg/m^3", "nrlmsise00"],
    )
    f107: Annotated[Dimensionless, within("60", "400")] | None = Field(
        default=None,
        description="of nrlmsise00: solar flux at 10.7 cm of the day before, 1e-22 W/m^2/Hz",
        examples=[150],
    )
    f107a: Annotated[Dimensionless, within("60", "400")] | None = Field(
        default=None, description="of nrlmsise00: its mean of 81 days", examples=[150]
    )
    ap: Annotated[Dimensionless, within("0", "400")] | None = Field(
        default=None, description="of nrlmsise00: the day's geomagnetic index Ap", examples=[7]
    )
    scale_height: Positive[Metre] | None = Field(
        default=None,
        description="height over which the density falls to 1/e; by default density holds everywhere",
        examples=["60 km"],
    )
    altitude: Metre | None = Field(
        default=None, description="where the air has this density; with scale_height", examples=["400 km"]
    )


@register_load
@dataclass(frozen=True)
class Drag(SurfaceLoad):
    """Drag on plates and spheres; ``law`` is the density, where an expression gives it."""

    law: Expression | None = None
    Fields = DragFields
    title = "drag"

    @classmethod
    def resolve(cls, fields: DragFields, around: Setting) -> Drag:
        if not around.free_flight or RELATIVE_NAMES[0] not in around.names:
            what = "given without a velocity relative to the air; it takes [initial] position and velocity, "
            raise around.fault("", what + "and a central_gravity (atmosphere_rate there turns the air)")
        pushes = Pushes(around, cls.title, RELATIVE_NAMES)
        half, factors, law = around.context.one / 2, [], None
        if (fields.density == NRLMSISE) != (fields.ap is not None):
            given = "missing" if fields.ap is None else f"given with another density than {NRLMSISE}"
            raise around.fault("ap", f'{given}; density = "{NRLMSISE}" takes {", ".join(INDICES)}')
        if fields.density == NRLMSISE:
            factors.append(pushes.parsed(AIR_DENSITY))
        elif isinstance(fields.density, ExactNumber):
            if fields.density.sign < 0:
                what = f"given {float(fields.density):g}; zero or more is allowed"
                raise around.fault("density", what)
            half = half * fields.density.at(around.context)
        else:
            law = around.expression("density", fields.density, "kg/m^3")
            factors.append(law)
        factors += _falling(fields, around)
        for number, surface in pushes.surfaces():
            size = -half * surface.drag_coefficient * surface.area
            if isinstance(surface, Plate):
                pushes.on_plate(surface, number, size)
            else:
                pushes.on_sphere(surface, size, speed=True)
        kind = DragInThermosphere if fields.density == NRLMSISE else cls
        return kind(pushes.acting(), pushes.stream, tuple(factors), around.free_flight, law)

    def narrow(self, m: Kinematics) -> list[Symbolic]:
        """What is narrow in it, but for what reads the altitude alone and changes by less than a transition
        along the orbit at the start: no step is longer than that orbit.
        """
        parts, reach = narrow_parts(*self.formulas()), _altitudes(m.scene)
        return written(m, [part for part in parts if reach is None or _range(part, reach, m.scene) > WIDE])

    def roots(self, m: Kinematics) -> list[Symbolic]:
        """Of the density alone in an orbit, where the speed of the air vanishes by coincidence only."""
        if _altitudes(m.scene) is None:
            return super().roots(m)
        return written(m, root_parts(*self.never_negative()))

    def never_negative(self) -> list[Expression]:
        return [] if self.law is None else [self.law]

    def cautions(self, fields: DragFields, where: str, scene: Scene) -> Iterator[Caution]:
        attractors = (x for x in scene.config.loads if getattr(x, "kind", "") == "central_gravity")
        strengths = (getattr(x, "gravitational_parameter", None) for x in attractors)
        known = any(x is not None and known_body(float(x)) is not None for x in strengths)
        if known and fields.altitude is not None:
            start = start_values(scene)["altitude"]
            yield from about_altitude(fields.altitude, float(start), where)


class DragInThermosphere(Drag):
    """Drag in NRLMSISE-00, which ends where the network of it does."""

    def range_ends(self, m: Kinematics) -> list[tuple[str, Symbolic]]:
        why = f"the altitude fell below {LEAST:g} km, from which NRLMSISE-00 is known here"
        return [(why, (height(m) - LEAST) / LEAST + 2.0**-20)]  # 14 cm: a run may start at the limit


def _altitudes(scene: Scene) -> tuple[Any, Any] | None:
    """Least and largest altitude (m, mpf) of the Kepler orbit at the start; None if it falls to the centre or
    leaves, or where a thrust or another body may change it.
    """
    source, context = flown_about(scene.config), scene.context
    load = None if source is None else source.of(scene)
    others = [x for x in loads_of(scene) if x is not load]
    if source is None or load is None or load.attracting_point is None or any(map(_steers, others)):
        return None
    place = [-x for x in load.source_at_start(scene)]
    least, largest = kepler_reach(context, place, load.motion_at_start(scene), load.gravitational_parameter)
    if largest is None or least < largest * _FALLING:
        return None
    surface = source.radius(context) if source.extended else context.zero
    return least - surface, largest - surface


def _steers(load: Load) -> bool:
    """Whether a load may change an orbit by much: a thrust, a body, or what Python gives."""
    if isinstance(load, Applied):
        return load.pushes
    return (isinstance(load, Attraction) and load.pulls) or not type(load).__module__.startswith("rigidsim.")


def _range(part: Expression, reach: tuple[Any, Any], scene: Scene) -> float:
    """Change of a part along a range of altitudes; infinite if it reads anything else."""
    context, (low, high) = scene.context, reach
    if names_used(part) != {"altitude"}:
        return math.inf
    places = [low + (high - low) * n / _PLACES for n in range(_PLACES + 1)]
    found = [evaluate(part, {"altitude": place}, context) for place in places]
    return float(context.maximum(found) - context.minimum(found))


def _falling(fields: DragFields, around: Setting) -> list[Expression]:
    """The factor by which the density falls with the altitude, if it does."""
    if fields.scale_height is None or fields.altitude is None:
        return []
    if not isinstance(fields.density, ExactNumber):
        what = "given with an expression for density, which determines its fall; remove it and altitude"
        raise around.fault("scale_height", what)
    if "altitude" not in around.names:
        what = "given without a surface to count from; give the central_gravity a radius"
        raise around.fault("altitude", what)
    given = {"base": fields.altitude.alone, "scale_height": fields.scale_height.alone}
    return [around.expression("drag", "exp((base - altitude)/scale_height)", parameters=given)]
