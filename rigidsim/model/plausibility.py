"""Values of loads that are allowed, but implausible: lengths meant in km, orbits below a surface, periods
that contradict Kepler's third law, spins in deg/s, and spins that just miss a resonance.

Only about the Sun, the planets and the Moon, recognised by their gravitational parameters, anything is
implausible: scenes without units are free.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any

from rigidsim.errors import Problem, required
from rigidsim.model.load import Load
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Vector, apply, dot, hansen, norm
from rigidsim.scene.bodies.presets import KNOWN, KnownBody, known_body
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.exact import ExactNumber, time_unit
from rigidsim.scene.expressions.tree import Constant, Expression, Name, Operation, operations
from rigidsim.scene.orbits import MEAN_MOTION_KEYS, Elements, KeplerOrbit
from rigidsim.scene.paths import numbers
from rigidsim.scene.point_masses import GRAVITATIONAL_CONSTANT
from rigidsim.scene.readable import ASTRONOMICAL_UNIT, length_text, span_text
from rigidsim.scene.registry import LoadFields
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.swept import plain

_CUBIC_KILOMETRE = 1e9  # m^3
_AS_PUBLISHED = 1e-3  # relative difference up to which a number is a published one in other units
_FARTHEST = 1e5  # radii of a body: its orbits and neighbours are nearer (Neptune is at 6500 of the Sun)
_HEIGHT = 1e5  # m: a length from here on may be an altitude
_DEEP = 0.01  # of the radius: what is nearer to the centre is no altitude
_SURFACE = 0.99  # of the equatorial radius: orbits may graze flattened bodies
_ROUGHLY = 0.02  # relative difference of a radius, mean or equatorial, from the published one
_SIMILAR = 10.0  # ratio of an air density's altitude to the altitude of a flight in it
_PERTURBED = 0.05
"""Relative difference of n^2 a^3 from G M that perturbations explain: the Moon's by the Sun is 0.0075, of
inner moons of Saturn by its flattening 0.025.
"""

_SLOW = 0.05  # of the circular speed: a slower body falls almost straight down
_UNBOUND = math.sqrt(2.0)  # of the circular speed
_UNITS = (("km", 1e3), ("au", ASTRONOMICAL_UNIT))
_RESONANCES = (Fraction(1), Fraction(3, 2), Fraction(1, 2), Fraction(2))
_MISSED = 0.01  # of the resonant spin; one farther off wasn't meant to be there
_FEEBLE = 1e-6  # of the mean motion: a narrower resonance holds nothing
_UPRIGHT = math.cos(0.5)  # of the angle between the spin and the orbit's normal
_STEADY = math.cos(0.1)  # of the angle between the spin and a principal axis
_NOTICED = 0.1  # of a resonance's width: a start so far off librates by 0.1 rad
_SAME = 0.05  # of the miss, by which the spin and a multiple of the mean motion may differ
_ALIKE = 2e-3  # relative difference of a spin from the orbit's rate, as far as three digits show


def about_load(load: Load, fields: LoadFields, where: str, scene: Scene) -> Iterator[Caution]:
    """Values of a load's keys by which its source, or the start near it, is implausible."""
    given: Any = getattr(fields, "gravitational_parameter", None)
    name, elements = getattr(fields, "source", None), getattr(fields, "elements", None)
    placed, number = fields.placed_by(free_flight=scene.free_flight), getattr(load.placement, "number", None)
    yield from load.cautions(fields, where, scene)
    yield from _about_radius(fields, where)
    if load.reacts and number is not None:  # one of the point masses
        given, at = scene.config.bodies[number].gravitational_parameter, f"[[bodies]] number {number + 1}"
    else:
        at = where
    if load.orbit is not None and elements is not None:
        yield from _about_orbit(elements, load.orbit, given, where, scene)
        if load.gradient_source is not None:
            yield from _about_spin(elements, load.orbit, given, where, scene)
    elif placed is not None and (name is not None or given is not None) and not load.of_time:
        place = load.source_at_start(scene)
        distance = float(norm(scene.context, place))
        if name is not None:
            yield from about_named_strength(given, name, where)
            body = _named(name)
        else:
            yield from _about_strength(given, distance, at)
            body = _meant_body(given) or (_in_kilometres(float(given), distance) if given.assumed else None)
        if load.gradient_source is not None and getattr(fields, "position", None) is not None:
            yield from _about_distance(body, distance, fields.position, f"{where} position")  # type: ignore[attr-defined]
        if load.title == "central_gravity":
            yield from _about_start(scene, body, distance, load.motion_at_start(scene))


# --- attracting bodies --------------------------------------------------------------------------------------


def _named(name: str) -> KnownBody | None:
    return next((body for body in KNOWN if body.name.lower() == name), None)


def _about_strength(given: ExactNumber, distance: float, where: str) -> Iterator[Caution]:
    """A known body's G M in km^3/s^2 without a unit, which the distance (m) makes plausible."""
    body = _in_kilometres(float(given), distance) if given.assumed else None
    if body is not None:
        known = f"{body.owner} is {body.gravitational_parameter / _CUBIC_KILOMETRE:.6g} km^3/s^2"
        yield _without_unit(f"{where} gravitational_parameter", given, "m^3/s^2", known, "km^3/s^2")


def about_named_strength(given: ExactNumber | None, name: str, where: str) -> Iterator[Caution]:
    """A G M given for a body that is named: in km^3/s^2 without a unit, or another known body's."""
    body = _named(name)
    if body is None or given is None:
        return
    meant = known_body(float(given))
    yield from _about_strength(given, body.radius, where)
    if meant is not None and meant is not body:
        yield Caution(
            WarningCode.STRENGTH_CONTRADICTS,
            f"{where} gravitational_parameter: given {_numbers([given])} m^3/s^2, which is "
            f"{meant.owner}, for "
            f'"{name}", which has {body.gravitational_parameter:.6g}; correct one of them',
        )


def _meant_body(given: ExactNumber) -> KnownBody | None:
    """The known body that a number means, as far as its digits show: 4e14 the Earth, 4.001736482e14 none."""
    digits = f"{float(given):.14e}".partition("e")[0].rstrip("0")
    last = 10.0 ** -(len(digits) - 2) / float(digits)  # the last digit, relative
    return _alike(float(given), max(_AS_PUBLISHED, last / 2))


def _in_kilometres(strength: float, distance: float) -> KnownBody | None:
    """The known body whose G M in km^3/s^2 is a number, if a distance suits it in m or in km."""
    body = _alike(strength * _CUBIC_KILOMETRE)
    if body is None:
        return None
    near = (_SURFACE * body.radius <= size * distance <= _FARTHEST * body.radius for size in (1.0, 1e3))
    return body if any(near) else None


def _alike(strength: float, within: float = _AS_PUBLISHED) -> KnownBody | None:
    body = known_body(strength)
    close = body is not None and abs(strength / body.gravitational_parameter - 1) < within
    return body if close else None


# --- places and orbits --------------------------------------------------------------------------------------


def _about_distance(
    body: KnownBody | None, distance: float, given: Sequence[ExactNumber], where: str
) -> Iterator[Caution]:
    """A distance (m), said by the given numbers, from the centre of a body that lies within it."""
    if body is None or distance >= _SURFACE * body.radius:
        return
    below = f"{length_text(distance)} from the centre of {body.called}, below its surface at "
    below += length_text(body.radius)
    height = "; to an altitude, add the radius" if distance >= _HEIGHT else ""
    meant = [unit for unit, size in _UNITS if body.radius <= distance * size <= _FARTHEST * body.radius]
    if meant and _bare(given):
        first = next(f"{float(x):.10g}" for x in given if x.sign)
        text = f"given {_numbers(given)} without a unit, which is taken as m: {below}; write "
        text += f'"{first} {meant[0]}" if that is meant{height}'
        yield Caution(WarningCode.LENGTH_WITHOUT_UNIT, f"{where}: {text}")
    elif distance >= _DEEP * body.radius:
        yield Caution(WarningCode.BELOW_SURFACE, f"{where}: given {_numbers(given)} m: {below}{height}")


def _about_radius(fields: Any, where: str) -> Iterator[Caution]:
    """Radii of a known attracting body in km without a unit: of its altitude and shadow, figure and field."""
    strength = getattr(fields, "gravitational_parameter", None)
    if strength is None or (body := _meant_body(strength)) is None:
        return
    for table in ("", "figure.", "gravity_field."):
        given = getattr(getattr(fields, table[:-1], None) if table else fields, "radius", None)
        if given is not None and given.assumed and abs(1e3 * float(given) / body.radius - 1) < _ROUGHLY:
            known = f"the radius of {body.called} is {length_text(body.radius)}"
            yield _without_unit(f"{where} {table}radius", given, "m", known, "km")


def about_altitude(given: ExactNumber, altitude: float, where: str) -> Iterator[Caution]:
    """An altitude in km without a unit, where the body starts at about as many km (``altitude``, m)."""
    if given.assumed and altitude / _SIMILAR < 1e3 * float(given) < altitude * _SIMILAR:
        known = f"the body starts {length_text(altitude)} above the surface"
        yield _without_unit(f"{where} altitude", given, "m", known, "km")


def _about_start(
    scene: Scene, body: KnownBody | None, distance: float, velocity: Vector
) -> Iterator[Caution]:
    """Distance (m) and velocity (m/s) of a body in flight at the start from the attracting body."""
    given = scene.config.initial
    if body is None or given.position is None or given.frame is not None:
        return
    speed = float(norm(scene.context, velocity))
    yield from _about_distance(body, distance, given.position, "[initial] position")
    if distance < _SURFACE * body.radius or given.velocity is None or not _bare(given.velocity):
        return
    circular = math.sqrt(body.gravitational_parameter / distance)
    if 0 < speed < _SLOW * circular and _SLOW * circular < 1e3 * speed < _UNBOUND * circular:
        known = f"a circular orbit there has {circular:.4g} m/s"
        yield _without_unit("[initial] velocity", given.velocity, "m/s", known, "km/s")


def _about_orbit(
    table: Elements, orbit: KeplerOrbit, strength: ExactNumber | None, where: str, scene: Scene
) -> Iterator[Caution]:
    """A prescribed orbit as given (``table``) and in numbers: its units, its altitude, and its period."""
    given, axis = required(table.semi_major_axis), float(orbit.semi_major_axis)
    if strength is None:
        size = float(orbit.mean_motion**2 * orbit.semi_major_axis**3)
        body = _alike(size) or (_in_kilometres(size, axis) if given.assumed else None)
    else:
        yield from _about_strength(strength, axis, where)
        body = _meant_body(strength) or (_in_kilometres(float(strength), axis) if strength.assumed else None)
    at = f"{where} {table.key}"
    low = list(_about_distance(body, float(orbit.pericentre), [given], f"{at}.semi_major_axis"))
    yield from low
    if body is None and given.assumed:
        yield from _familiar_axis(given, f"{at}.semi_major_axis")
    if strength is not None and not low and _meant_body(strength) is not None:
        yield from _about_rates(table, orbit, float(strength), at)
        yield from _about_period(table, orbit, strength, at, scene)


def _about_rates(table: Elements, orbit: KeplerOrbit, strength: float, where: str) -> Iterator[Caution]:
    """Rates of node and periapsis without a unit that exceed the orbit's own, rad/s."""
    pace = math.sqrt(strength / orbit.semi_major_axis**3)
    for key in ("node_rate", "periapsis_rate"):
        if (rate := getattr(table, key)).assumed and abs(float(rate)) > pace:
            yield _without_unit(f"{where}.{key}", rate, "rad/s", "the orbit itself is slower", "deg/yr")


def _familiar_axis(given: ExactNumber, where: str) -> Iterator[Caution]:
    """A semi-major axis without a unit that is a planet's or the Moon's in km."""
    for body in KNOWN:
        if body.distance and abs(1e3 * float(given) / body.distance - 1) < _AS_PUBLISHED:
            known = f"the orbit of {body.called} has {body.distance / 1e3:.6g} km"
            yield _without_unit(where, given, "m", known, "km")


def _about_period(
    table: Elements, orbit: KeplerOrbit, strength: ExactNumber, where: str, scene: Scene
) -> Iterator[Caution]:
    """A pace that no mass explains: the source's, and the body's as far as it is known."""
    key = next((key for key in MEAN_MOTION_KEYS if getattr(table, key) is not None), None)
    if key is None or orbit.mean_motion == 0:
        return
    needed, least = float(orbit.mean_motion**2 * orbit.semi_major_axis**3), float(strength)
    own = scene.body.mass
    most = least + (0.0 if own is None else float(GRAVITATIONAL_CONSTANT) * float(own))
    other = own is None and any(
        abs((needed - least) / body.gravitational_parameter - 1) < _PERTURBED for body in KNOWN
    )
    if least * (1 - _PERTURBED) <= needed <= most * (1 + _PERTURBED) or other:
        return
    axis = orbit.semi_major_axis
    kepler = span_text(float(2 * math.pi * math.sqrt(axis**3 / most)), 4)
    yield Caution(
        WarningCode.PERIOD_CONTRADICTS,
        f"{where}.{key}: a turn takes {span_text(float(2 * math.pi / abs(orbit.mean_motion)), 4)}, while by "
        f"Kepler's third law with this gravitational_parameter an orbit of {length_text(float(axis))} takes "
        f"{kepler}; correct one of them, or leave {key} out",
    )


# --- spins near a resonance ---------------------------------------------------------------------------------


def _about_spin(
    table: Elements, orbit: KeplerOrbit, strength: ExactNumber, where: str, scene: Scene
) -> Iterator[Caution]:
    """A spin about a principal axis along the normal of an orbit, which is given as ``table``."""
    found, motion = _spin(scene, orbit), float(orbit.mean_motion)
    if found is None or not motion > 0:
        return
    spin, known = found[0], _meant_body(strength) is not None
    given = scene.config.initial.angular_velocity
    if known and given is not None and _bare(given) and abs(spin / math.degrees(motion) - 1) < _ALIKE:
        value = f"{spin:.6g}"
        rate = f"the orbit of {where} has {math.degrees(motion):.6g} deg/s"
        yield _taken("[initial] angular_velocity", value, value, "rad/s", rate, "deg/s")
    yield from _near_resonance(found, table, orbit, where, scene, known=known)


def _near_resonance(
    found: tuple[float, float], table: Elements, orbit: KeplerOrbit, where: str, scene: Scene, *, known: bool
) -> Iterator[Caution]:
    """A spin within a per cent of 1:1, 3:2, 1:2 or 2:1 with the orbit that just misses the resonance.

    It warns outside the libration of a known attracting body, or if the spin is a
    multiple of the mean anomaly's rate while the resonance is with the mean longitude: then a sidereal period
    was given as the anomalistic one (about a known body also within the libration, which it makes large).

    The resonance p of a body that turns about its principal axis C holds rates within
    n sqrt(3 (B - A) |H| / C) of (p - 1) n + d(mean longitude)/dt, with H(p, e) of Goldreich & Peale 1966
    (Astronomical Journal 71, 425).
    """
    (spin, asymmetry), motion = found, float(orbit.mean_motion)
    longitude = motion + float(orbit.periapsis_rate) + float(orbit.node_rate)
    for p in _RESONANCES:
        expected = float(p - 1) * motion + longitude
        miss = spin - expected
        if longitude <= 0 or abs(miss) > _MISSED * abs(expected):
            continue
        size = hansen(scene.context, orbit.eccentricity, int(2 * p), 2)
        width = motion * math.sqrt(3 * asymmetry * abs(float(size)))
        confused = abs(spin - float(p) * motion) < _SAME * abs(miss)
        outside = width < abs(miss) and (known or confused)
        librating = abs(miss) > _NOTICED * width and known and confused
        if width < _FEEBLE * motion or not (outside or librating):
            continue
        text = (
            f"[initial] angular_velocity: a turn takes {_turn(spin)}, {100 * abs(miss) / expected:.2g} % "
            f"{'faster' if miss > 0 else 'slower'} than the {p.numerator}:{p.denominator} resonance with the "
            f"orbit of {where} ({_turn(expected)}), which holds {100 * width / expected:.2g} %; the mean "
            f"anomaly returns after {_turn(motion)}, the mean longitude after {_turn(longitude)}"
        )
        pace = next((key for key in MEAN_MOTION_KEYS if getattr(table, key) is not None), "")
        if pace in ("", "period"):
            given = "period" if pace else "the one of Kepler's third law"
            text += f": {given} is anomalistic; give sidereal_period if a sidereal month or year is meant"
        yield Caution(WarningCode.NEAR_RESONANCE, text)


def _spin(scene: Scene, orbit: KeplerOrbit) -> tuple[float, float] | None:
    """Rate (rad/s) of a body that turns forwards about a principal axis C along the orbit's normal, and
    (B - A)/C; None for any other motion.
    """
    context, body, rates = scene.context, scene.body, scene.angular_velocity
    size = norm(context, rates)
    if size == 0:
        return None
    axis = max(range(3), key=lambda i: abs(dot(body.principal_axes[i], rates)))
    if abs(dot(body.principal_axes[axis], rates)) < _STEADY * size or body.principal_moments[axis] == 0:
        return None
    space = apply(attitude.rotation_matrix(scene.quaternion), rates)
    if dot(space, orbit.normal(context)) < _UPRIGHT * size:
        return None
    a, b = (body.principal_moments[i] for i in range(3) if i != axis)
    return float(size), float(abs(b - a) / body.principal_moments[axis])


# --- words --------------------------------------------------------------------------------------------------


def _without_unit(
    where: str, given: ExactNumber | Sequence[ExactNumber], taken: str, known: str, meant: str
) -> Caution:
    numbers = [given] if isinstance(given, ExactNumber) else given
    first = next(f"{float(x):.10g}" for x in numbers if x.sign)
    return _taken(where, _numbers(numbers), first, taken, known, meant)


def _taken(where: str, given: str, first: str, taken: str, known: str, meant: str) -> Caution:
    angle = taken == "rad/s"
    return Caution(
        WarningCode.ANGLE_WITHOUT_UNIT if angle else WarningCode.LENGTH_WITHOUT_UNIT,
        f"{where}: given {given} without a unit, which is taken as {taken}, while {known}; write "
        f'"{first} {meant}" if that is meant, "{first} {taken}" if not',
    )


def _bare(given: Sequence[ExactNumber]) -> bool:
    """Whether no unit was written with any of the numbers that aren't zero."""
    return all(x.assumed for x in given if x.sign)


def _numbers(given: Sequence[ExactNumber]) -> str:
    return ", ".join(f"{float(x):.10g}" for x in given)


def _turn(rate: float) -> str:
    return span_text(2 * math.pi / rate, 8)


# --- values that probably mean something else ---------------------------------------------------------------

_TURN = 2 * math.pi


def suspicious_angles(config: Config) -> list[Problem]:
    """Angles beyond a full turn that were given without a unit: taken as radians, meant as degrees?

    So are whole numbers beyond pi of an angle that only goes to pi: inclination, or the middle Euler angle.
    A multiple of pi is meant in radians, and a value with a unit is unambiguous.
    """
    found = []
    for path, given in numbers(config):
        bare = [x for x in given if x.assumed == "rad" and not x.pi_power]
        key = path.steps[-1]
        half = given[1:2] if key == "euler_angles" else given if key == "inclination" else []
        beyond = [
            x
            for x in bare
            if abs(x.rational) > _TURN
            or (x.rational.denominator == 1 and abs(x.rational) > math.pi and any(x is one for one in half))
        ]
        if beyond:
            bare_text, degrees = (
                ", ".join(f"{value:.6g}" for value in values)
                for values in (map(float, beyond), (math.degrees(float(x)) for x in beyond))
            )
            first = f"{float(beyond[0]):.6g}"
            found.append(
                Problem(
                    path.where,
                    f"given {bare_text} without a unit, which is taken as radians: {degrees} deg; write "
                    f'"{first} deg" if degrees are meant, "{first} rad" if not',
                )
            )
    return found


def suspicious_expressions(scene: Scene) -> list[Problem]:
    """Sines, cosines and tangents of whole numbers beyond a full turn: of degrees?"""
    found = []
    for expression in scene.formulas():
        for name, value in _constant_arguments(expression):
            number, degrees = f"{float(value):.6g}", f"{math.degrees(float(value)):.6g}"
            found.append(
                Problem(
                    expression.where,
                    f"given {name}({number}), whose argument is taken as radians: {degrees} deg; write "
                    f"{name}({number} deg) if degrees are meant, {name}({number} rad) if not",
                )
            )
    return found


def _constant_arguments(expression: Expression) -> list[tuple[str, ExactNumber]]:
    """Trigonometric functions of whole numbers of radians beyond a full turn, as written."""
    found = []
    for node in reversed([*operations(expression)]):  # in the order of the text
        if node.operator in ("sin", "cos", "tan"):
            (argument,) = node.operands
            value = argument.value if isinstance(argument, Constant) else None
            whole = value is not None and not value.pi_power and value.rational.denominator == 1
            literal = argument.text.lstrip("+- ").replace(".", "").isdigit()
            if value is not None and whole and literal and abs(value.rational) > _TURN:
                found.append((node.operator, value))
    return found


def suspicious_end(config: Config) -> list[Problem]:
    """A bare number, in seconds, as end of a run whose times are shown in a longer unit: meant in that?"""
    end, unit = config.time.end, config.time.unit
    if end is None or unit is None or end.assumed != "s" or end.pi_power:
        return []
    size = time_unit(unit)
    if size < 60 or not 0 < end.rational < size:
        return []
    given, converted = f"{float(end):.6g}", f"{float(end.rational / size):.3g} {unit}"
    return [
        Problem(
            "[time] end",
            f"given {given} without a unit, which is taken as seconds: {converted}; write "
            f'"{given} {unit}" if that is meant, "{given} s" if not',
        )
    ]


def unreachable_events(scene: Scene) -> list[Problem]:
    """Events at times beyond the run, and those that compare the middle Euler angle with what it never is:
    meant in degrees?
    """
    found, (first, last) = [], sorted(float(plain(x)) for x in (scene.start, scene.end))
    for event in scene.events:
        root = event.expression
        if event.time is not None and not first <= float(plain(event.time)) <= last:
            span = f"{first:.6g} to {last:.6g} s"
            what = f"given for {float(plain(event.time)):.6g} s, not within the run ({span}); change one"
            found.append(Problem(root.where, what))
        parts = root.operands if isinstance(root, Operation) and root.operator == "sum" else ()
        constants = [float(part.value) for part in parts if isinstance(part, Constant)]
        names = [part.name for part in parts if isinstance(part, Name)]
        if len(parts) == 2 and names == ["theta"] and constants and abs(constants[0]) > math.pi:
            what = (
                f'given "{root.text}", which is never zero: theta is from 0 to pi rad, or from '
                f'-pi/2 to pi/2; write "{abs(constants[0]):.6g} deg" if degrees are meant'
            )
            found.append(Problem(root.where, what))
    return found
