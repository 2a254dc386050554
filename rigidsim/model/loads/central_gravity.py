"""Central gravity: a point that attracts a freely flying body, force and torque to second degree."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import Field, StrictStr, field_validator, model_validator

from rigidsim.model.gradient import tidal_range
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.model.loads.kernel_attractor import KernelAttractor
from rigidsim.model.loads.point_attraction import (
    MovingAttractor,
    PointAttraction,
    given_strength,
    kernel_strength,
)
from rigidsim.model.loads.source_figure import FigureFields
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import Vector, cross, norm, unit_vectors
from rigidsim.scene.bodies.gravity_field import MOST, Harmonic
from rigidsim.scene.exact import ZERO
from rigidsim.scene.fields import (
    Angle,
    BodyName,
    ConfigTable,
    Dimensionless,
    Direction,
    GravitationalParameter,
    Metre,
    Positive,
    Rate,
    Triple,
    excludes,
    one_of,
    refuse,
)
from rigidsim.scene.orbit_keys import Orbit
from rigidsim.scene.orbits import attracting_body
from rigidsim.scene.point_masses import closest
from rigidsim.scene.registry import Setting, register_load
from rigidsim.scene.scene import Scene
from rigidsim.scene.validation_messages import shown

_ROUNDED = 0.999  # of the distance for which estimates are made, and the pericentre but for rounding


_KEY = re.compile(r"(0|[1-9]\d{0,3}),(0|[1-9]\d{0,3})")
_WITHIN = 2
"""Radii within which the attracting body's mass is (see ``rigidsim.scene.bodies.gravity_field``)."""


class AttractorFieldTable(ConfigTable):
    """``gravity_field`` of ``central_gravity``: coefficients in axes that turn about the pole at a rate."""

    radius: Positive[Metre] = Field(examples=["6378.1366 km"])
    """reference radius R of C and S"""
    C: dict[StrictStr, Dimensionless] = Field(default_factory=dict, examples=[{"2,0": -1.0826e-3}])
    """unnormalized coefficients of cos m lon by "degree,order", from degree 2 on: C_20 is minus J2"""
    S: dict[StrictStr, Dimensionless] = Field(default_factory=dict, examples=[{"2,2": -9.0387e-7}])
    """likewise with sin m lon"""
    pole: Direction = Field(examples=[[0, 0, 1]])
    """direction of its axis of rotation, space axes"""
    rate: Rate = Field(ZERO, examples=["7.2921151e-5 rad/s"], json_schema_extra={"default": 0})
    """rate at which it turns about the pole"""
    prime_meridian: Angle = Field(ZERO, examples=["100 deg"], json_schema_extra={"default": 0})
    """angle of longitude 0 at time 0 from its equator's node on the plane XY (from X if they coincide)"""

    @field_validator("C", "S")
    @classmethod
    def _orders(cls, value: dict[str, Any], info: Any) -> dict[str, Any]:
        for key in value:
            _refuse_key(key, info.field_name)
        return value

    @model_validator(mode="after")
    def _some(self) -> AttractorFieldTable:
        if not self.C and not self.S:
            raise refuse('missing coefficients; give C = {"2,0" = ..} and S = {"2,2" = ..}')
        return self


def _refuse_key(key: str, table: str) -> None:
    match = _KEY.fullmatch(key)
    if match is None:
        raise refuse(f'given the key {shown(key)}; degree and order are allowed, such as "2,0"')
    n, m = int(match[1]), int(match[2])
    if n < 2:
        what = "the attracting point is its centre of mass" if n == 1 else "gravitational_parameter says it"
        raise refuse(f'given "{key}", but degree {n} isn\'t given here, since {what}; remove it')
    if n > MOST:
        raise refuse(f'given "{key}"; degrees up to {MOST} are allowed')
    if m > n:
        raise refuse(f'given "{key}", but the order is at most the degree: "{n},{n}"')
    if table == "S" and m == 0:
        raise refuse(f'given "{key}" in S, which has no order 0; zonal coefficients are in C')


def coefficients_of(table: AttractorFieldTable, around: Setting) -> dict[Harmonic, Any]:
    """Coefficients (mpf), unnormalized, without zeros; refused where no mass has them."""
    context, found = around.context, {}
    for name, given in (("C", table.C), ("S", table.S)):
        for key, value in given.items():
            n, m = map(int, key.split(","))
            ratio = context.mpf(math.factorial(n - m)) / math.factorial(n + m)
            most = 2 * _WITHIN**n * context.sqrt(ratio)
            if abs(float(value)) > most:
                what = f'given {float(value):.8g} as "{key}" (unnormalized); no mass within {_WITHIN} radii '
                what += f"has more than {context.nstr(most, 3)}: check normalization and signs of exponents"
                raise around.fault(f"gravity_field.{name}", what)
            if value.sign != 0:
                found[n, m, name == "S"] = value.at(context)
    return dict(sorted(found.items()))


class CentralGravityFields(FigureFields):
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
    gravity_field: AttractorFieldTable | None = Field(
        default=None,
        description="gravity of the attracting body beyond a point, in axes that turn with it: its force",
        examples=[{"radius": "6378.1366 km", "C": {"3,0": 2.5e-6}, "pole": [0, 0, 1]}],
    )

    def placed_by(self, *, free_flight: bool) -> frozenset[str] | None:
        return frozenset({"flight"})


@register_load
@dataclass(frozen=True)
class CentralGravity(PointAttraction):
    """A point at rest that attracts a free body."""

    gravitational_parameter: Any
    position: Vector  # space axes, m (mpf)
    Fields = CentralGravityFields
    title = "central_gravity"
    reads = frozenset({"attitude", "flight"})
    conservative = True

    @classmethod
    def resolve(cls, fields: CentralGravityFields, around: Setting) -> Load:
        if fields.orbit is not None:
            if fields.orbit.body is None:
                raise around.fault("orbit", "given without body; the name of one of [[bodies]] is allowed")
            number = attracting_body(fields.orbit, around)
            if around.carried_bodies.host is not None:
                what = 'given "central_gravity", but [body] host makes the body one of [[bodies]], which '
                raise around.fault("kind", what + 'attract each other anyway; give "gravity_gradient"')
            return MovingAttractor(around.carried_bodies, number)
        if around.position is None:
            what = 'given "central_gravity" for a body without a position; give [initial] position and '
            raise around.fault("kind", f'{what}velocity, or use "gravity_gradient" for a prescribed orbit')
        if fields.source is not None:
            strength = kernel_strength(fields.gravitational_parameter, fields.source, around)
            if fields.source != around.host:  # which is the origin of the space axes
                return KernelAttractor.of(fields.source, strength, around)
        else:
            strength = given_strength(fields.gravitational_parameter, around)
        place = [x.at(around.context) for x in fields.position]
        if around.position == place:
            raise around.fault("kind", "the body starts at the attracting point; start it elsewhere")
        return cls(strength, place)

    def pictured(self) -> dict[str, Any]:
        place = [float(x) for x in self.position]
        strength = float(self.gravitational_parameter)
        return {"what": "attractor", "gravitational_parameter": strength, "position": place}

    @property
    def attracting_point(self) -> Vector:  # type: ignore[override]
        return self.position

    @property
    def strength(self) -> Any:
        return self.gravitational_parameter

    def seen(self, m: Kinematics) -> tuple[list[Symbolic], Symbolic]:
        return m.seen_from(self.position)

    def force(self, m: Kinematics) -> list[Term]:
        """-GM r/r^3 - (3GM / 2 M r^4)[(tr I - 5 c . I c) r/|r| + 2 R I c] (physics of MacCullagh)."""
        pairs = zip(unit_vectors(m.scene.context), *self.pull(m, as_point=True), strict=True)
        return [([-x for x in axis], radial + turned) for axis, radial, turned in pairs]

    def potential(self, m: Kinematics) -> Symbolic | None:
        return -self.as_point(m) - self.second_degree(m)

    def source_at_start(self, scene: Scene) -> Vector:
        return [a - x for x, a in zip(scene.position or [], self.position, strict=True)]

    def motion(self, m: Kinematics) -> list[Symbolic]:
        return list(m.carried(m.velocity))

    def motion_at_start(self, scene: Scene) -> Vector:
        return scene.velocity or []

    # --- estimates, from the Kepler orbit through the initial state --------------------------------------

    def _start(self, scene: Scene) -> tuple[Vector, Any, Any]:
        """Position from the point (m), distance, and energy over mass (m^2/s^2) at the start."""
        assert scene.position is not None
        assert scene.velocity is not None
        context = scene.context
        offset = [x - a for x, a in zip(scene.position, self.position, strict=True)]
        distance = norm(context, offset)
        return offset, distance, norm(context, scene.velocity) ** 2 / 2 - self.strength / distance

    def nearest_approach(self, scene: Scene) -> Any:
        """Pericentre distance, m, but a thousandth of the first one at least: a scale must not vanish."""
        return closest(scene.context, self._start(scene)[0], scene.velocity or [], self.strength)[0]

    def amplitude(self, scene: Scene) -> Any:
        return tidal_range(scene, self.gravitational_parameter, self.nearest_approach(scene))

    def fastest_rate(self, scene: Scene) -> Any:
        momentum = norm(scene.context, cross(self._start(scene)[0], scene.velocity or []))
        return momentum / self.nearest_approach(scene) ** 2

    def flight_bounds(self, scene: Scene, fed: Any) -> tuple[Any, Any]:
        context, strength = scene.context, self.gravitational_parameter
        assert scene.position is not None
        horizon = scene.duration
        _, distance, energy = self._start(scene)
        swiftest = context.sqrt(2 * abs(energy + strength / self.nearest_approach(scene)))
        if energy < 0:
            farthest = strength / -energy  # twice the semi-major axis
            reach = min(farthest, distance + swiftest * horizon) + fed * horizon
            return norm(context, self.position) + reach, swiftest + fed
        return norm(context, scene.position) + (swiftest + fed) * horizon, swiftest + fed
