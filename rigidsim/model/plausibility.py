"""Values of loads that are allowed, but implausible: lengths meant in km, orbits below a surface, and periods
that contradict Kepler's third law.

Only about the Sun, the planets and the Moon, recognised by their gravitational parameters, anything is
implausible: scenes without units are free.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rigidsim.model.load_words import ASTRONOMICAL_UNIT, length_text, span_words
from rigidsim.scene.arithmetic import Vector, norm
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.known_bodies import KNOWN, KnownBody, known_body
from rigidsim.scene.orbits import PACES, KeplerOrbit, Orbit
from rigidsim.scene.point_masses import GRAVITATIONAL_CONSTANT
from rigidsim.scene.scene import Scene
from rigidsim.store.summary_parts import Caution, WarningCode

_CUBIC_KILOMETRE = 1e9  # m^3
_AS_PUBLISHED = 1e-3  # relative difference up to which a number is a published one in other units
_FARTHEST = 1e5  # radii of a body: its orbits and neighbours are nearer (Neptune is at 6500 of the Sun)
_HEIGHT = 1e5  # m: a length from here on may be an altitude
_DEEP = 0.01  # of the radius: what is nearer to the centre is no altitude, but on a scale of its own
_SURFACE = 0.99  # of the equatorial radius: orbits may graze flattened bodies
_PERTURBED = 0.05
"""Relative difference of n^2 a^3 from G M that perturbations explain: the Moon's by the Sun is 0.0075, of
inner moons of Saturn by its flattening 0.025.
"""
_SLOW = 0.05  # of the circular speed: a slower body falls almost straight down
_UNBOUND = math.sqrt(2.0)  # of the circular speed
_UNITS = (("km", 1e3), ("au", ASTRONOMICAL_UNIT))


def implied_strength(orbit: KeplerOrbit) -> float:
    """G M of Kepler's third law for an orbit's size and mean motion, m^3/s^2."""
    return float(orbit.mean_motion**2 * orbit.semi_major_axis**3)


def about_strength(given: ExactNumber, distance: float, where: str) -> Iterator[Caution]:
    """A gravitational parameter without a unit that is a known body's in km^3/s^2.

    Args:
        distance: of the body, m, by which a known one is told from one of a scene without units.
    """
    body = _in_kilometres(float(given), distance) if given.assumed else None
    if body is not None:
        value = _number(given)
        yield Caution(
            WarningCode.LENGTH_WITHOUT_UNIT,
            f"{where} gravitational_parameter: given {value} without a unit, which is taken as m^3/s^2, "
            f"while {body.owner} is {body.gravitational_parameter / _CUBIC_KILOMETRE:.6g} km^3/s^2; write "
            f'"{value} km^3/s^2" if that is meant, "{value} m^3/s^2" if not',
        )


def meant_body(given: ExactNumber) -> KnownBody | None:
    """The known body whose gravitational parameter is given, as far as the number's own digits tell: ``4e14``
    is the Earth's, 4.001736482e14 isn't.
    """
    value = float(given)
    body = known_body(value)
    if body is None:
        return None
    digits = f"{value:.14e}".partition("e")[0].rstrip("0")
    last = 10.0 ** -(len(digits) - 2) / float(digits)  # the last digit, relative
    close = abs(value / body.gravitational_parameter - 1) < max(_AS_PUBLISHED, last / 2)
    return body if close else None


def attracting(given: ExactNumber, distance: float) -> KnownBody | None:
    """The known body that a gravitational parameter means, possibly by a number in km^3/s^2."""
    return meant_body(given) or (_in_kilometres(float(given), distance) if given.assumed else None)


def about_distance(
    body: KnownBody | None, distance: float, given: Sequence[ExactNumber], where: str
) -> Iterator[Caution]:
    """A distance (m) from the centre of a body that lies within it.

    Args:
        given: the numbers that say it.
    """
    if body is None or distance >= _SURFACE * body.radius:
        return
    below = f"{length_text(distance)} from the centre of {body.called}, below its surface at {_radius(body)}"
    height = "; to an altitude, add the radius" if distance >= _HEIGHT else ""
    meant = [unit for unit, size in _UNITS if body.radius <= distance * size <= _FARTHEST * body.radius]
    if meant and _bare(given):
        first = next(_number(x) for x in given if x.sign)
        text = f"given {_numbers(given)} without a unit, which is taken as m: {below}; write "
        text += f'"{first} {meant[0]}" if that is meant{height}'
        yield Caution(WarningCode.LENGTH_WITHOUT_UNIT, f"{where}: {text}")
    elif distance >= _DEEP * body.radius:
        text = f"given {_numbers(given)} m: {below}"
        yield Caution(WarningCode.BELOW_SURFACE, f"{where}: {text}{height}")


def about_start(scene: Scene, body: KnownBody | None, place: Vector, velocity: Vector) -> Iterator[Caution]:
    """Place and velocity of a body in flight at the start, relative to the attracting body (m, m/s)."""
    given = scene.config.initial
    if body is None or given.position is None:
        return
    distance, speed = float(norm(scene.context, place)), float(norm(scene.context, velocity))
    yield from about_distance(body, distance, given.position, "[initial] position")
    if distance < _SURFACE * body.radius or given.velocity is None or not _bare(given.velocity):
        return
    circular = math.sqrt(body.gravitational_parameter / distance)
    if 0 < speed < _SLOW * circular and _SLOW * circular < 1e3 * speed < _UNBOUND * circular:
        first = next(_number(x) for x in given.velocity if x.sign)
        yield Caution(
            WarningCode.LENGTH_WITHOUT_UNIT,
            f"[initial] velocity: given {_numbers(given.velocity)} without a unit, which is taken as m/s, "
            f'while a circular orbit there has {circular:.4g} m/s; write "{first} km/s" if that is meant, '
            f'"{first} m/s" if not',
        )


def about_orbit(
    table: Orbit, orbit: KeplerOrbit, strength: ExactNumber | None, where: str, scene: Scene
) -> Iterator[Caution]:
    """A prescribed orbit: its units, its altitude, and its period.

    Args:
        table, strength: the orbit and G M as given; what isn't given follows from Kepler's third law.
    """
    given, axis = table.semi_major_axis, float(orbit.semi_major_axis)
    assert given is not None
    if strength is None:
        size = implied_strength(orbit)
        body = _alike(size) or (_in_kilometres(size, axis) if given.assumed else None)
    else:
        yield from about_strength(strength, axis, where)
        body = attracting(strength, axis)
    at = f"{where} orbit.semi_major_axis"
    low = list(about_distance(body, float(orbit.pericentre), [given], at))
    yield from low
    if body is None and given.assumed:
        yield from _familiar_axis(given, at)
    if strength is not None and not low and meant_body(strength) is not None:
        yield from _about_rates(table, orbit, float(strength), where)
        yield from _about_period(table, orbit, strength, where, scene)


def _about_rates(table: Orbit, orbit: KeplerOrbit, strength: float, where: str) -> Iterator[Caution]:
    """Rates of node and periapsis without a unit that exceed the orbit's own, rad/s."""
    squared = float(strength / orbit.semi_major_axis**3)
    for key in ("node_rate", "periapsis_rate"):
        rate = getattr(table, key)
        if rate.assumed and abs(float(rate)) > math.sqrt(squared):
            value = _number(rate)
            yield Caution(
                WarningCode.ANGLE_WITHOUT_UNIT,
                f"{where} orbit.{key}: given {value} without a unit, which is taken as rad/s, faster than "
                f'the orbit itself; write its unit, such as "{value} deg/yr", or "{value} rad/s" if that is '
                "meant",
            )


def _familiar_axis(given: ExactNumber, where: str) -> Iterator[Caution]:
    """A semi-major axis without a unit that is a planet's or the Moon's in km."""
    for body in KNOWN:
        if body.distance and abs(1e3 * float(given) / body.distance - 1) < _AS_PUBLISHED:
            value = _number(given)
            yield Caution(
                WarningCode.LENGTH_WITHOUT_UNIT,
                f"{where}: given {value} without a unit, which is taken as m; the orbit of {body.called} has "
                f'{body.distance / 1e3:.6g} km: write "{value} km" if that is meant, "{value} m" if not',
            )


def _about_period(
    table: Orbit, orbit: KeplerOrbit, strength: ExactNumber, where: str, scene: Scene
) -> Iterator[Caution]:
    """A pace that no mass explains: that of the source, and the body's as far as it is known."""
    pace = next(((key, getattr(table, key)) for key in PACES if getattr(table, key) is not None), None)
    if pace is None or orbit.mean_motion == 0:
        return
    needed, least = implied_strength(orbit), float(strength)
    own = scene.body.mass
    most = least + (0.0 if own is None else float(GRAVITATIONAL_CONSTANT) * float(own))
    other = own is None and any(
        abs((needed - least) / body.gravitational_parameter - 1) < _PERTURBED for body in KNOWN
    )
    if least * (1 - _PERTURBED) <= needed <= most * (1 + _PERTURBED) or other:
        return
    axis, key = orbit.semi_major_axis, pace[0]
    kepler = span_words(2 * math.pi * math.sqrt(axis**3 / most))
    yield Caution(
        WarningCode.PERIOD_CONTRADICTS,
        f"{where} orbit.{key}: a turn takes {span_words(2 * math.pi / abs(orbit.mean_motion))}, while by "
        f"Kepler's third law with this gravitational_parameter an orbit of {length_text(float(axis))} takes "
        f"{kepler}; correct one of them, or leave {key} out",
    )


def _in_kilometres(strength: float, distance: float) -> KnownBody | None:
    """The known body whose G M in km^3/s^2 is a number, if a distance suits it in m or in km."""
    body = _alike(strength * _CUBIC_KILOMETRE)
    if body is None:
        return None
    near = (_SURFACE * body.radius <= size * distance <= _FARTHEST * body.radius for size in (1.0, 1e3))
    return body if any(near) else None


def _alike(strength: float) -> KnownBody | None:
    body = known_body(strength)
    close = body is not None and abs(strength / body.gravitational_parameter - 1) < _AS_PUBLISHED
    return body if close else None


def _bare(given: Sequence[ExactNumber]) -> bool:
    """Whether no unit was written with any of the numbers that aren't zero."""
    return all(x.assumed for x in given if x.sign)


def _radius(body: KnownBody) -> str:
    return length_text(body.radius)


def _number(value: ExactNumber) -> str:
    return f"{float(value):.10g}"


def _numbers(given: Sequence[ExactNumber]) -> str:
    return ", ".join(map(_number, given))
