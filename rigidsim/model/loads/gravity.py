"""The kinds ``gravity_gradient`` and ``central_gravity``: what their keys say of source and placement."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, StrictInt

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.loads.attraction import Attraction, SourceFieldTable, SourceFigureTable
from rigidsim.model.placements.flight import FlownAbout, FlownByKernel, FlownByMass
from rigidsim.model.placements.kernel_body import PlacedByKernel, kernel_body, refuse_series
from rigidsim.model.placements.placement import (
    PlacedAsMass,
    PlacedAtRest,
    PlacedBySeries,
    PlacedByTable,
    PlacedOnOrbit,
    Placement,
)
from rigidsim.scene.bodies.gravity_field import MOST
from rigidsim.scene.epochs import J2000
from rigidsim.scene.exact import ZERO
from rigidsim.scene.fields import (
    BodyName,
    GravitationalParameter,
    Metre,
    Positive,
    Rate,
    Triple,
    excludes,
    one_of,
)
from rigidsim.scene.kernels.series import exactly
from rigidsim.scene.orbits import (
    SIDES,
    Orbit,
    OrbitFields,
    attracting_body,
    resolve_orbit,
    resolve_tabulated_orbit,
)
from rigidsim.scene.registry import SceneLoad, Setting, SourceFields, register_load
from rigidsim.scene.space_axes import ECLIPTIC


class AttractingFields(SourceFields):
    """Keys of a load whose source attracts the body."""

    degree: StrictInt | None = Field(
        None,
        ge=2,
        le=MOST,
        description="degree of [body] gravity_field to which this source attracts the body; by default 2, "
        "which is the inertia tensor",
        examples=[4],
    )
    figure: SourceFigureTable | None = Field(
        None,
        description="oblateness of the source itself: torque on the body's figure, and force in flight",
        examples=[{"J2": 1.0826e-3, "radius": "6378.137 km", "pole": "iau1976"}],
    )


class GravityGradientFields(OrbitFields, AttractingFields):
    """Torque of a distant attracting body, to second degree (MacCullagh's formula)."""

    rules = (one_of("orbit", "satellite_orbit", "position", "ephemeris", "source", why=SIDES),)
    kind: Literal["gravity_gradient"]
    gravitational_parameter: Positive[GravitationalParameter] | None = Field(
        default=None, description="G M of the attracting body", examples=["3.986004418e14 m^3/s^2"]
    )
    position: Triple[Metre] | None = Field(
        default=None, description="position of a source at rest, space axes", examples=[["7000 km", 0, 0]]
    )
    ephemeris: Literal["sun", "moon"] | None = Field(
        default=None,
        description="geocentric position of Sun or Moon, from analytic series in the ecliptic of J2000",
    )
    source: BodyName | None = Field(
        default=None,
        description="a body of the [ephemeris] kernel, as seen from [body] host; a package gives its "
        "gravitational_parameter",
        examples=["earth"],
    )


class CentralGravityFields(AttractingFields):
    """A point that attracts a freely flying body: force and torque to second degree."""

    rules = (one_of("orbit", "source", "position", least=0), excludes("orbit", "gravitational_parameter"))
    kind: Literal["central_gravity"]
    gravitational_parameter: Positive[GravitationalParameter] | None = Field(
        default=None, description="G M of the attracting point", examples=["3.986004418e14 m^3/s^2"]
    )
    source: BodyName | None = Field(
        default=None,
        description="the attracting body of the [ephemeris] kernel, instead of position; a package gives its "
        "gravitational_parameter",
        examples=["moon"],
    )
    orbit: Orbit | None = Field(
        default=None,
        description="the attracting point mass in [[bodies]], instead of gravitational_parameter and "
        "position",
        examples=[{"body": "earth"}],
    )
    position: Triple[Metre] = Field(
        default_factory=lambda: [ZERO] * 3,
        description="position of the attracting point, space axes",
        json_schema_extra={"default": [0, 0, 0]},
    )

    atmosphere_rate: Triple[Rate] | None = Field(
        default=None,
        description="angular velocity of its atmosphere, space axes, for vrx vry vrz in expressions",
        examples=[[0, 0, "7.292115e-5 rad/s"]],
    )
    gravity_field: SourceFieldTable | None = Field(
        default=None,
        description="gravity of the attracting body beyond a point, in axes that turn with it: its force",
        examples=[{"radius": "6378.1366 km", "C": {"3,0": 2.5e-6}, "pole": [0, 0, 1]}],
    )

    def placed_by(self, *, free_flight: bool) -> frozenset[str] | None:
        return frozenset({"flight"})


@register_load
class GravityGradient(SceneLoad):
    """The torque of a distant body on an orbit, at a fixed place, by series or a kernel, or of a point mass.

    For an ephemeris the space axes are the mean ecliptic and equinox of J2000, and time counts from the
    scene's epoch, by default J2000.
    """

    Fields = GravityGradientFields

    @classmethod
    def resolve(cls, fields: GravityGradientFields, around: Setting) -> Attraction:
        if fields.orbit is not None and fields.orbit.body is not None:
            if fields.gravitational_parameter is not None:
                raise around.fault(
                    "gravitational_parameter", "given with orbit.body, which determines it; remove it"
                )
            masses, number = around.carried_bodies, attracting_body(fields.orbit, around)
            if masses.host is None and masses.full:
                raise around.fault(
                    "kind",
                    'given "gravity_gradient" for a body that flies by itself under coupling = "full"; '
                    'give "central_gravity", whose force the bodies feel',
                )
            placed = FlownByMass if masses.host is None else PlacedAsMass
            mass: Placement = placed(masses, number)
            return Attraction(gravitational_parameter=masses.strengths[number], placement=mass)
        strength = _strength(fields, around)
        return Attraction(gravitational_parameter=strength, placement=_distant(fields, strength, around))


def _distant(fields: GravityGradientFields, strength: Any, around: Setting) -> Placement:
    if fields.source is not None:
        return PlacedByKernel.of(fields.source, around)
    if fields.elements is not None and fields.elements.table is not None:
        return PlacedByTable(resolve_tabulated_orbit(fields.elements, strength, around))
    if fields.elements is not None:
        return PlacedOnOrbit(resolve_orbit(fields.elements, strength, around))
    if fields.ephemeris is not None:
        refuse_series(around)
        if around.axes not in (None, ECLIPTIC):
            raise ConfigError(
                Problem(
                    "[frame] axes",
                    f'given "{around.axes}", but the ephemeris of [[loads]] number {around.number + 1} is '
                    f'in "{ECLIPTIC}"; write that, or leave axes out',
                )
            )
        return PlacedBySeries(fields.ephemeris, around.epoch or J2000)
    position = [x.at(around.context) for x in fields.position or []]
    if all(x == 0 for x in position):
        raise around.fault("position", "given the origin, where the body is; another point is allowed")
    return PlacedAtRest(position)


@register_load
class CentralGravity(SceneLoad):
    """The force and torque of what a body flies by: a point at rest, a body of a kernel, a point mass."""

    Fields = CentralGravityFields

    @classmethod
    def resolve(cls, fields: CentralGravityFields, around: Setting) -> Attraction:
        if fields.orbit is not None:
            return _flown_by_mass(fields.orbit, around)
        if around.position is None:
            what = 'given "central_gravity" for a body without a position; give [initial] position and '
            raise around.fault("kind", f'{what}velocity, or use "gravity_gradient" for a prescribed orbit')
        strength = _strength(fields, around)
        place: Placement = FlownAbout(strength, [x.at(around.context) for x in fields.position])
        if (
            fields.source is not None and fields.source != around.host
        ):  # which is the origin of the space axes
            ephemeris = kernel_body(fields.source, around)
            place = FlownByKernel(PlacedByKernel(ephemeris, ephemeris.sight(fields.source, around.host)))
        if all(x == 0 for x in place.at_start(around)):
            raise around.fault("kind", "the body starts at the attracting point; start it elsewhere")
        return Attraction(gravitational_parameter=strength, placement=place, pulls=True)


def _flown_by_mass(orbit: Orbit, around: Setting) -> Attraction:
    if orbit.body is None:
        raise around.fault("orbit", "given without body; the name of one of [[bodies]] is allowed")
    number, masses = attracting_body(orbit, around), around.carried_bodies
    if masses.host is not None:
        raise around.fault(
            "kind",
            'given "central_gravity", but [body] host makes the body one of [[bodies]], which attract '
            'each other anyway; give "gravity_gradient"',
        )
    place = FlownByMass(masses, number)
    return Attraction(gravitational_parameter=masses.strengths[number], placement=place, pulls=True)


def _strength(fields: GravityGradientFields | CentralGravityFields, around: Setting) -> Any:
    """The gravitational parameter (mpf, m^3/s^2): as given, or of a body of the kernel its own."""
    given, found = fields.gravitational_parameter, None
    what = "missing; it is needed"
    if fields.source is not None:
        kernel = kernel_body(fields.source, around).kernel
        found, what = (
            kernel.strength(fields.source),
            f'missing; {kernel.name} has none of "{fields.source}": give it',
        )
    if given is not None:
        return given.at(around.context)
    if found is None:
        raise around.fault("gravitational_parameter", what)
    return exactly(around.context, found)
