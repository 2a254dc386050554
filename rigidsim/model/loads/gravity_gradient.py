"""Gravity gradient: the torque of a distant body on an orbit, at a fixed place, or from an ephemeris."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import heyoka as hy
from pydantic import Field

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.gradient import GradientSource, gradient_terms, tidal_range
from rigidsim.model.kinematics import Kinematics, quadratic_form
from rigidsim.model.load import Load, SourcePlace, Term
from rigidsim.model.loads.point_attraction import MovingGradient, given_strength, kernel_strength
from rigidsim.model.loads.source_figure import FigureFields
from rigidsim.model.orbit_planes import OrbitPlane
from rigidsim.model.placements.kernel_body import PlacedByKernel, refuse_series
from rigidsim.model.placements.prescribed_orbit import PlacedAtRest, PlacedByTable, PlacedOnOrbit
from rigidsim.model.placements.series import PlacedBySeries
from rigidsim.model.rotations import Symbolic
from rigidsim.model.two_part import as_factor
from rigidsim.scene.arithmetic import Vector, norm
from rigidsim.scene.epochs import J2000, Epoch
from rigidsim.scene.fields import BodyName, GravitationalParameter, Metre, Positive, Triple, one_of
from rigidsim.scene.kernels.reading import Sight
from rigidsim.scene.orbit_keys import SIDES, OrbitFields
from rigidsim.scene.orbits import KeplerOrbit, attracting_body, resolve_orbit, resolve_tabulated_orbit
from rigidsim.scene.registry import Setting, register_load
from rigidsim.scene.scene import Scene
from rigidsim.scene.space_axes import ECLIPTIC

_PLACES = ("orbit", "satellite_orbit", "position", "ephemeris", "source")
"""Keys that tell how a source is placed."""


class GravityGradientFields(OrbitFields, FigureFields):
    """Torque of a distant attracting body, to second degree (MacCullagh's formula)."""

    rules = (one_of(*_PLACES, why=SIDES),)
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


@register_load
@dataclass(frozen=True)
class GravityGradient(GradientSource, Load):  # type: ignore[override]
    """Torque (3 G M / R^3) c x (I c) of a distant body in direction c (MacCullagh), which is its own source.

    For an ephemeris the space axes are the mean ecliptic and equinox of J2000, and time counts from the
    scene's epoch, by default J2000.
    """

    Fields = GravityGradientFields
    title = "gravity_gradient"
    reads = frozenset({"attitude"})
    has_source = True

    @classmethod
    def resolve(cls, fields: GravityGradientFields, around: Setting) -> Load:
        if fields.orbit is not None and fields.orbit.body is not None:
            if fields.gravitational_parameter is not None:
                what = "given with orbit.body, which determines it; remove it"
                raise around.fault("gravitational_parameter", what)
            made = MovingGradient(around.carried_bodies, attracting_body(fields.orbit, around))
            if made.masses.host is None and made.masses.full:
                what = 'given "gravity_gradient" for a body that flies by itself under coupling = "full"; '
                raise around.fault("kind", what + 'give "central_gravity", whose force the bodies feel')
            return made
        if fields.source is not None:
            placement = PlacedByKernel.of(fields.source, around)
            return cls(kernel_strength(fields.gravitational_parameter, fields.source, around), placement)
        strength, context = given_strength(fields.gravitational_parameter, around), around.context
        if fields.elements is not None and fields.elements.table is not None:
            return cls(strength, PlacedByTable(resolve_tabulated_orbit(fields.elements, strength, around)))
        if fields.elements is not None:
            return cls(strength, PlacedOnOrbit(resolve_orbit(fields.elements, strength, around)))
        if fields.ephemeris is not None:
            refuse_series(around)
            if around.axes not in (None, ECLIPTIC):
                what = f'given "{around.axes}", but the ephemeris of [[loads]] number {around.number + 1} '
                what += f'is in "{ECLIPTIC}"; write that, or leave axes out'
                raise ConfigError(Problem("[frame] axes", what))
            return cls(strength, PlacedBySeries(fields.ephemeris, around.epoch or J2000))
        position = [x.at(context) for x in fields.position or []]
        if all(x == 0 for x in position):
            raise around.fault("position", "given the origin, where the body is; another point is allowed")
        return cls(strength, PlacedAtRest(position))

    def pictured(self) -> dict[str, Any]:
        strength = float(self.gravitational_parameter)
        return {"what": "source", "gravitational_parameter": strength, **self.placement.pictured()}

    @property
    def gradient_source(self) -> GradientSource:
        return self

    @property
    def axes(self) -> str | None:  # type: ignore[override]
        return self.placement.axes

    @property
    def epoch(self) -> Epoch | None:  # type: ignore[override]
        return self.placement.epoch

    @property
    def sights(self) -> tuple[tuple[Sight, int], ...]:  # type: ignore[override]
        return self.placement.sights

    @property
    def conservative(self) -> bool:  # type: ignore[override]
        return self.placement.rests() is not None

    @property
    def wide(self) -> bool:  # type: ignore[override]
        return self.placement.wide

    @property
    def corotating_orbit(self) -> KeplerOrbit | None:  # type: ignore[override]
        orbit = self.orbit
        return orbit if orbit is not None and orbit.circular and orbit.fixed_plane else None

    @property
    def remark(self) -> str:  # type: ignore[override]
        return "" if self.table is None else self.table.described

    @property
    def plane(self) -> OrbitPlane | None:  # type: ignore[override]
        return self.placement.plane

    @property
    def without_plane(self) -> str:  # type: ignore[override]
        return self.placement.without_plane

    @property
    def seconds_ahead(self) -> float:  # type: ignore[override]
        return self.placement.seconds_ahead

    @property
    def of_time(self) -> bool:  # type: ignore[override]
        return self.placement.of_time

    def source_direction(self, m: Kinematics) -> list[Symbolic]:
        if m.attitude is not None and m.attitude.orbital is not None:
            return m.attitude.orbital.direction
        return m.seen(self.placement.seen(m)[0])

    def source_place(self, m: Kinematics) -> SourcePlace:
        direction, inverse = self.placement.seen(m)
        inverse = hy.expression(1.0) if inverse is None else inverse
        return SourcePlace(direction, inverse, self.placement.distance(m.scene.context))

    def source_at_start(self, scene: Scene) -> Vector:
        return self.placement.at_start(scene)

    def strength(self, m: Kinematics) -> tuple[Any, Symbolic | None]:
        """G M / R^3 in internal units: at a constant distance (mpf), and the factor by which it varies."""
        context, (_, inverse) = m.scene.context, self.placement.seen(m)
        distance = self.placement.distance(context)
        value = context.ldexp(self.gravitational_parameter / distance**3, 2 * m.scaling.time)
        return value, None if inverse is None else inverse**3

    def torque(self, m: Kinematics) -> list[Term]:
        return gradient_terms(m, self.source_direction(m), *self.strength(m))

    def potential(self, m: Kinematics) -> Symbolic | None:
        """Potential energy (3 G M / 2 R^3) c . I c, without the part that doesn't depend on the attitude."""
        strength, factor = self.strength(m)
        potential = as_factor(m.number(3 * strength / 2)) * quadratic_form(m, self.source_direction(m))
        return potential if factor is None else factor * potential

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool:
        """True: c x (I c) has no component along an axis of symmetry."""
        return True

    def fixed_source(self, scene: Scene) -> tuple[Any, Vector] | None:
        """See ``Load``: the source, if it is at rest."""
        position = self.placement.rests()
        if position is None:
            return None
        distance = norm(scene.context, position)
        return 3 * self.gravitational_parameter / distance**3, [x / distance for x in position]

    def amplitude(self, scene: Scene) -> Any:
        return tidal_range(scene, self.gravitational_parameter, self.placement.nearest(scene.context))

    def fastest_rate(self, scene: Scene) -> Any:
        return self.placement.fastest_rate(scene.context)
