"""``[[bodies]]``: point masses under mutual gravity, as keys and with every number worked out."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from pydantic import Field, StrictBool, StrictStr

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.scene.arithmetic import Vector, cross, eccentric_anomaly, minus, norm, plus, vector
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.fields import (
    ConfigTable,
    GravitationalParameter,
    Metre,
    Positive,
    Rule,
    Speed,
    Triple,
    VariableName,
    excludes,
)
from rigidsim.scene.kepler import Ellipse, combined, plane_vectors
from rigidsim.scene.kernels.reading import Ephemeris
from rigidsim.scene.validation_messages import nearest, shown

GRAVITATIONAL_CONSTANT = "6.67430e-11"
"""m^3/(kg s^2), CODATA 2018 and 2022: for masses in kg where only gravitational parameters are known."""
_SAME_MASS = 0.01
"""Relative difference up to which a mass and a gravitational parameter mean the same body: G is uncertain by
2e-5, and published masses of asteroids by per cents.
"""
_CLOSEST = 1000
"""A scale of distance is at least this part of the initial one: it must not vanish for a plunging orbit."""


class StartingOrbit(Ellipse):
    """Osculating elements at the start, about another of the bodies."""

    about: StrictStr = Field(examples=["sun"])
    """name of the point mass to which the elements are relative"""
    semi_major_axis: Positive[Metre] = Field(examples=["1 au"])
    """semi-major axis of the ellipse"""


class PointMassBody(ConfigTable):
    """A point mass under the gravity of all others."""

    rules: ClassVar[tuple[Rule, ...]] = (
        excludes("orbit", "position", "velocity"),
        lambda table: (
            excludes("ephemeris", "position", "velocity", "orbit")(table) if table.ephemeris else ""
        ),
    )

    name: VariableName = Field(examples=["sun"])
    """letters, digits and underscores, beginning with a letter"""
    gravitational_parameter: Positive[GravitationalParameter] | None = Field(
        None, examples=["1.32712440018e20 m^3/s^2"]
    )
    """G M; with ephemeris = true a package's own by default"""
    ephemeris: StrictBool = False
    """start where the [ephemeris] kernel has a body of this name, from the solar system's barycentre"""
    position: Triple[Metre] | None = None
    """position at the start, space axes"""
    velocity: Triple[Speed] | None = None
    """velocity at the start, space axes"""
    orbit: StartingOrbit | None = Field(
        None, examples=[{"about": "sun", "semi_major_axis": "1 au", "eccentricity": 0.0167}]
    )
    """osculating elements at the start, instead of position and velocity"""


@dataclass(frozen=True)
class PointMasses:
    """Point masses at the start of a run; numbers are mpf, SI, space axes."""

    names: tuple[str, ...]
    strengths: Vector  # gravitational parameters, m^3/s^2
    positions: tuple[Vector, ...]
    velocities: tuple[Vector, ...]
    host: int | None  # index of the one that the rigid body is; None if it is none of them
    full: bool  # whether they feel the reaction to the body's torques and the forces of its shape

    def constant(self, context: Any, mass: Any | None) -> Any:
        """G for masses in kg: by the host's own mass (kg), if that is known and reacts."""
        if self.full and self.host is not None and mass is not None:
            return self.strengths[self.host] / mass
        return context.mpf(GRAVITATIONAL_CONSTANT)

    def relative(self, i: int, j: int, context: Any) -> tuple[Vector, Vector, Vector]:
        """Place, velocity and acceleration of mass j as seen from mass i, under mutual gravity."""
        moving = minus(self.velocities[j], self.velocities[i])
        accelerations = [self.pulled(n, context) for n in (j, i)]
        return minus(self.positions[j], self.positions[i]), moving, minus(*accelerations)

    def pulled(self, n: int, context: Any) -> Vector:
        """Acceleration of mass n by the others."""
        found = [context.zero] * 3
        for other, strength in enumerate(self.strengths):
            if other != n:
                towards = minus(self.positions[other], self.positions[n])
                size = strength / norm(context, towards) ** 3
                found = plus(found, [size * y for y in towards])
        return found

    def encounter(self, context: Any, one: int, other: int) -> tuple[Any, Any]:
        """See ``closest``, for two of the masses."""
        place, moving = (minus(x[one], x[other]) for x in (self.positions, self.velocities))
        return closest(context, place, moving, self.strengths[one] + self.strengths[other])


def kepler_reach(context: Any, place: Vector, moving: Vector, strength: Any) -> tuple[Any, Any | None]:
    """Least and largest distance (m) on the Kepler orbit through a place and velocity; None if unbound."""
    distance, speed = norm(context, place), norm(context, moving)
    momentum = norm(context, cross(place, moving))
    energy = speed**2 / 2 - strength / distance
    squared = 1 + 2 * energy * momentum**2 / strength**2
    e = context.sqrt(squared) if squared > 0 else context.zero
    least = min(momentum**2 / strength / (1 + e), distance)
    return least, max(-strength / energy - least, distance) if energy < 0 else None


def closest(context: Any, place: Vector, moving: Vector, strength: Any) -> tuple[Any, Any]:
    """Least distance (m) of two masses left to themselves, and their angular rate there (rad/s), from
    relative place and velocity and the sum of their gravitational parameters.
    """
    distance, speed = norm(context, place), norm(context, moving)
    nearest_, _ = kepler_reach(context, place, moving, strength)
    if nearest_ < distance / _CLOSEST:
        nearest_ = distance / _CLOSEST
    return nearest_, context.sqrt(2 * strength / nearest_ + speed**2) / nearest_


def _fault(number: int, key: str, text: str) -> ConfigError:
    return ConfigError(Problem(f"[[bodies]] number {number + 1} {key}", text))


def _of_body(key: str, text: str) -> ConfigError:
    return ConfigError(Problem(f"[body] {key}", text))


def resolve_point_masses(
    tables: Sequence[PointMassBody],
    host: str | None,
    coupling: str | None,
    mass: Any | None,
    context: Any,
    *,
    free_flight: bool,
    ephemeris: Ephemeris | None = None,
) -> PointMasses | None:
    """Initial states of ``[[bodies]]``; None without any. ``mass`` (kg) is the rigid body's."""
    if not tables:
        what = f'given "{host}", but there are neither [[bodies]] nor an [ephemeris]; add them, or remove it'
        ensure(host is None, _of_body("host", what))
        what = f'given "{coupling}", but there are no [[bodies]]; add them, or remove it'
        ensure(coupling is None, _of_body("coupling", what))
        return None
    names = [table.name for table in tables]
    at_host = _host(host, names, free_flight)
    full = coupling == "full"
    strengths = [_strength(number, table, context, ephemeris) for number, table in enumerate(tables)]
    what = 'missing; coupling = "full" needs it, since the bodies feel the forces of this one'
    ensure(mass is not None or not full, _of_body("mass", what))
    if full and at_host is not None:
        expected = strengths[at_host] / context.mpf(GRAVITATIONAL_CONSTANT)
        what = f"given {context.nstr(mass, 6)} kg, but the gravitational parameter of its host "
        what += f'"{names[at_host]}" makes it {context.nstr(expected, 6)} kg; correct one of them'
        ensure(abs(mass - expected) <= _SAME_MASS * expected, _of_body("mass", what))
    placed = {table.name for table in tables if table.ephemeris}
    if "earth_moon_barycenter" in placed and placed & {"earth", "moon"}:
        what = 'given "earth_moon_barycenter", whose mass contains "earth" and "moon"; remove one of them'
        raise _fault(names.index("earth_moon_barycenter"), "name", what)
    places = {
        number: _kernel(number, ephemeris).start_of(table.name, context)
        for number, table in enumerate(tables)
        if table.ephemeris
    }
    for number in range(len(tables)):
        _place(number, tables, names, strengths, context, places, ())
    positions, velocities = ([places[n][k] for n in range(len(tables))] for k in (0, 1))
    if all(table.position is None and table.velocity is None and not table.ephemeris for table in tables):
        positions, velocities = (_about_barycentre(x, strengths) for x in (positions, velocities))
    for i, position in enumerate(positions):
        same = next((names[j] for j in range(i) if positions[j] == position), None)
        ensure(same is None, _fault(i, "position", f'the same position as "{same}"; start it elsewhere'))
    return PointMasses(tuple(names), strengths, tuple(positions), tuple(velocities), at_host, full)


def _kernel(number: int, ephemeris: Ephemeris | None) -> Ephemeris:
    if ephemeris is None:
        raise _fault(number, "ephemeris", "given true, but there is no [ephemeris]; add one with a kernel")
    return ephemeris


def _strength(number: int, table: PointMassBody, context: Any, ephemeris: Ephemeris | None) -> Any:
    given = table.gravitational_parameter
    if table.ephemeris:
        there = _kernel(number, ephemeris)
        there.check_body(table.name, lambda what: _fault(number, "name", what))
        known = there.kernel.strength(table.name)
        given = ExactNumber(known) if given is None and known else given
    if given is None:
        raise _fault(number, "gravitational_parameter", "missing; it is needed")
    return given.at(context)


def _host(host: str | None, names: Sequence[str], free_flight: bool) -> int | None:
    what = "missing; name the one of [[bodies]] that this body is, or give it an [initial] position and "
    ensure(host is not None or free_flight, _of_body("host", what + "velocity"))
    if host is None:
        return None
    what = f"given {shown(host)}{nearest(host, names)}; allowed: {', '.join(names)}"
    ensure(host in names, _of_body("host", what))
    what = f'given "{host}" with [initial] position or velocity; remove one of them'
    ensure(not free_flight, _of_body("host", what))
    return names.index(host)


def _place(
    number: int,
    tables: Sequence[PointMassBody],
    names: Sequence[str],
    strengths: Vector,
    context: Any,
    places: dict[int, tuple[Vector, Vector]],
    asking: tuple[int, ...],
) -> tuple[Vector, Vector]:
    """Position and velocity of one mass, and of those about which it orbits."""
    if number in places:
        return places[number]
    table = tables[number]
    if table.orbit is None:
        nowhere = [n for n, x in enumerate(tables) if x.orbit is x.position is x.velocity is None]
        what = "missing; only one body may be left where all others start from"
        ensure(number not in nowhere or len(nowhere) == 1, _fault(number, "position", what))
        places[number] = vector(context, table.position), vector(context, table.velocity)
        return places[number]
    about = table.orbit.about
    others = [name for name in names if name != table.name]
    what = f"given {shown(about)}{nearest(about, others)}; allowed: {', '.join(others) or 'none'}"
    ensure(about in others, _fault(number, "orbit.about", what))
    centre = names.index(about)
    what = f'given "{about}", which goes about this body itself'
    ensure(centre not in asking, _fault(number, "orbit.about", what))
    around = _place(centre, tables, names, strengths, context, places, (*asking, number))
    own = start_of_elements(table.orbit, strengths[centre] + strengths[number], context)
    places[number] = plus(around[0], own[0]), plus(around[1], own[1])
    return places[number]


def start_of_elements(orbit: Ellipse, strength: Any, context: Any) -> tuple[Vector, Vector]:
    """Relative position and velocity, from a sum of gravitational parameters."""
    assert orbit.semi_major_axis is not None
    a, e = orbit.semi_major_axis.at(context), orbit.eccentricity.at(context)
    anomaly = eccentric_anomaly(context, orbit.mean_anomaly.at(context), e)
    c, s, root = context.cos(anomaly), context.sin(anomaly), context.sqrt(1 - e * e)
    angles = (x.at(context) for x in (orbit.inclination, orbit.ascending_node, orbit.periapsis))
    axes = plane_vectors(*((context.cos(x), context.sin(x)) for x in angles))
    speed = context.sqrt(strength / a) / (1 - e * c)
    return combined(axes, a * (c - e), a * root * s), combined(axes, -(speed * s), speed * root * c)


def _about_barycentre(vectors: Sequence[Vector], strengths: Vector) -> list[Vector]:
    whole = sum(strengths)
    mean = [sum(s * v[i] for s, v in zip(strengths, vectors, strict=True)) / whole for i in range(3)]
    return [minus(v, mean) for v in vectors]
