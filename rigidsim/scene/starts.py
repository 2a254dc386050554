"""Starts: the ways in which ``[initial]`` gives an attitude, rates, or both; and where a free flight begins:
position and velocity as given, in a dated frame, or two-line elements.

One key gives the attitude (by default the body axes are along the space axes) and one the rates; an
equilibrium, which is found, gives both. Ways that need mechanics, such as the plane of an orbit, are entered
by the rooms above.

An attitude from the pole of the body's equator is R = R3(node) R1(tilt) R3(turn) F^T, with the figure's
equator and pole as columns of F: the equator rises through the plane at the node, its pole is tilted from the
plane's normal, and the turn leads along it from the node to the prime meridian. Against the equator of J2000
these are a + 90 deg, 90 deg - d and W for the pole's right ascension a and declination d (Archinal et al.
2018, Celest. Mech. Dyn. Astr. 130, 22, figure 1).

GCRF to ITRF follows the IERS Conventions 2010 (ch. 5): precession and nutation IAU 2006/2000A with the
measured offsets of the pole, Earth rotation angle, polar motion, by ERFA. UT1, the pole and its offsets are
the IERS's (finals2000A), as heyoka brings them. TEME is Vallado et al.'s (AIAA 2006-6753): the Earth-fixed
axes without polar motion, turned back by the sidereal time GMST of 1982; its axes are taken at rest.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import date
from decimal import Decimal
from fractions import Fraction
from functools import cache, partial
from typing import Any

import numpy as np

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.scene import attitude, space_axes
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, minus, negligible, plus, transpose, vector
from rigidsim.scene.bodies.body import RigidBody, inverse_inertia
from rigidsim.scene.bodies.presets import EARTH
from rigidsim.scene.epochs import Epoch, leap_seconds, tdb_minus_tt
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.registry import Setting
from rigidsim.scene.schema import Config, Initial
from rigidsim.scene.space_axes import ECLIPTIC, obliquity, to_ecliptic
from rigidsim.scene.two_line_elements import TwoLineElements


@dataclass(frozen=True)
class InitialRotation:
    """Where the rotation begins.

    Attributes:
        quaternion: unit quaternion, body to space.
        angular_velocity: body axes, rad/s; None from a way that gives the attitude alone.
        euler_angles: as given, rad; None if given otherwise.
        found: how an equilibrium was found, for reports; None for a start that was given.
        partner: position, velocity, quaternion and rates of the second body, if they are found; or None.
    """

    quaternion: Vector
    angular_velocity: Vector | None = None
    euler_angles: Vector | None = None
    found: Any = None
    partner: Any = None


DOUBLY = "doubly_synchronous"
"""The equilibrium of a second body by which ``[body]`` starts, too."""
ATTITUDES = ("quaternion", "euler_angles", "pole", "obliquity", "apm")
RATES = ("angular_velocity", "angular_momentum", "spin_period")
"""Keys of ``[initial]``, of which one gives the attitude and one the rates."""
_BESIDE = {"node_longitude": ("obliquity",), "prime_meridian": ("pole", "obliquity")}
"""Keys that give nothing alone, and what each counts with."""
_BESIDE_FOUND = dict.fromkeys(("relative", DOUBLY), ATTITUDES[:-1])
"""What may be given with an equilibrium; a Cassini state takes a period."""
_IN_SPACE = ("pole", "obliquity", "angular_momentum", "equilibrium")
"""Keys that count in space, whatever turns."""
STARTS: dict[str, Callable[[Any], InitialRotation]] = {}
"""Starts that rooms above find, by names of equilibria and keys: from the scene so far; ConfigError."""


def refusal(key: str, text: str) -> ConfigError:
    """The error that names a key of ``[initial]``."""
    return ConfigError(Problem(f"[initial] {key}", text))


def angle_out_of_range(key: str, what: str, context: Any, angle: Any, allowed: str) -> ConfigError:
    """The error for an angle (rad) out of its range."""
    degrees = f"{what}{context.nstr(context.degrees(angle), 8)} deg"
    return refusal(key, f'given {degrees}; {allowed} is allowed, and degrees have their unit: "23.44 deg"')


def pair_equilibrium(config: Config) -> str | None:
    """The equilibrium that a second body starts in; None without one."""
    return next((body.equilibrium for body in config.rigid_bodies), None)


def check_ways(config: Config) -> None:
    """Refuse what contradicts itself before anything is worked out."""
    table, pair = config.initial, pair_equilibrium(config)
    found = pair if pair == DOUBLY and table.equilibrium is None else table.equilibrium
    ways = [_given(table, ATTITUDES), _given(table, RATES)]
    for way, what in zip(ways, ("attitude", "start of the rates"), strict=True):
        for other in way[1:]:
            raise refusal(other, f"given with {way[0]}; only one {what} is allowed: remove one of them")
        for key in way if found is not None else ():
            text = f'given with equilibrium = "{found}", which finds it; remove one of them'
            ensure(key in _BESIDE_FOUND.get(str(found), ("spin_period",)), refusal(key, text))
    text = f"missing; exactly one of {', '.join(RATES)} and equilibrium is needed"
    ensure(found is not None or ways[1] or table.apm is not None, refusal("angular_velocity", text))
    for key, takers in _BESIDE.items():
        text = f"given without {' or '.join(takers)}, with which it counts; add that"
        ensure(getattr(table, key) is None or _given(table, takers), refusal(key, text))
    for key in _given(table, _IN_SPACE) if table.relative_to is not None else ():
        text = f'given with relative_to = "{table.relative_to}", but counts in space; remove one of them, or '
        raise refusal(key, text + "give quaternion or euler_angles, with angular_velocity or spin_period")
    known = table.obliquity is None or table.node_longitude is not None
    ensure(known, refusal("node_longitude", "missing; obliquity needs it"))


def _given(table: Initial, keys: Iterable[str]) -> list[str]:
    return [key for key in keys if getattr(table, key) is not None]


def attitude_of(scene: Any) -> InitialRotation:
    """The attitude at the start of a scene, in space."""
    given = given_attitude(scene)
    if scene.config.initial.relative_to is None:
        return given
    return STARTS["relative attitude"](scene.started(given))


def given_attitude(scene: Setting) -> InitialRotation:
    """The attitude as given, in space or in a local frame; by default the body axes are along its axes."""
    table = scene.config.initial
    if table.pole is not None:
        return _from_pole(scene)
    if table.obliquity is not None:
        return STARTS["obliquity"](scene)
    if table.apm is not None:
        return STARTS["apm"](scene)
    sequence = scene.config.integrator.euler_sequence
    given = attitude.given_attitude(scene.context, table, sequence, refusal)
    if given is None:
        return InitialRotation([scene.context.one] + [scene.context.zero] * 3)
    return InitialRotation(given[0], euler_angles=given[1])


def rotation_of(scene: Any) -> InitialRotation:
    """Attitude and rates at the start of a scene that has an attitude."""
    table, pair = scene.config.initial, pair_equilibrium(scene.config)
    if table.equilibrium is not None:
        key, start = "equilibrium", STARTS[table.equilibrium](scene)
    elif pair == DOUBLY:
        key, start = "equilibrium", InitialRotation(scene.quaternion, scene.angular_velocity)
    else:
        key = next(iter(_given(table, RATES)), "apm")
        own = key == "apm"
        rates = (
            given_attitude(scene).angular_velocity if own else vector(scene.context, table.angular_velocity)
        )
        if key == "angular_momentum":
            rates = from_momentum(scene)
        elif key == "spin_period":
            rates = [spin_rate(scene) * x for x in scene.figure.pole]
        start = InitialRotation(scene.quaternion, rates, scene.euler_angles)
        if table.relative_to is not None:
            start = STARTS["relative rates"](scene.started(start))
    if pair is not None:
        start = STARTS[pair](scene.started(start))
    what = "has a spin about the axis that has no moment of inertia, where a spin means nothing; make that "
    ensure(not along_massless(scene.body, start.angular_velocity), refusal(key, what + "component zero"))
    return start


def along_massless(body: RigidBody, vector: Vector | None) -> bool:
    """Whether a vector has a part along an axis without inertia (a rod's)."""
    assert vector is not None
    axes = zip(body.principal_moments, body.principal_axes, strict=True)
    return any(
        moment == 0 and abs(dot(axis, vector)) > max(map(abs, vector)) * 1e-14 for moment, axis in axes
    )


# --- attitudes ----------------------------------------------------------------------------------------------


def attitude_from_pole(scene: Setting, node: Any, tilt: Any, turn: Any) -> Vector:
    """Quaternion of R3(node) R1(tilt) R3(turn) F^T, body axes to the plane's axes (radians)."""
    context, figure = scene.context, scene.figure
    turned = attitude.quaternion_from_euler(context, [node, tilt, turn], "zxz")
    columns = transpose([figure.first, figure.second, figure.pole])
    w, x, y, z = attitude.quaternion_from_matrix(context, columns)
    return attitude.unit_quaternion(context, attitude.product(turned, [w, -x, -y, -z]))


def from_equator(scene: Setting, key: str) -> Vector:
    """Quaternion that takes axes of the equator and equinox of J2000 to the scene's space axes; refused,
    naming a key, where these are unknown.
    """
    what = "counts from the equator of J2000, but what the space axes are isn't known; set [frame] axes to "
    what += '"EME2000" or "ecliptic J2000", or give the attitude otherwise'
    ensure(scene.axes is not None, refusal(key, what))
    return space_axes.from_equator(scene.axes, scene.context)


def _from_pole(scene: Setting) -> InitialRotation:
    table, context = scene.config.initial, scene.context
    assert table.pole is not None
    to_space = from_equator(scene, "pole")
    ascension, declination = (x.at(context) for x in table.pole)
    quarter = context.pi / 2
    fault = angle_out_of_range("pole", "a declination of ", context, declination, "-90 to 90 deg")
    ensure(abs(declination) <= quarter * (1 + negligible(context)), fault)
    plain = attitude_from_pole(scene, ascension + quarter, quarter - declination, meridian(scene))
    return InitialRotation(attitude.product(to_space, plain))


def meridian(scene: Setting) -> Any:
    """The angle ``prime_meridian``, by default 0."""
    given: ExactNumber | None = scene.config.initial.prime_meridian
    return scene.context.zero if given is None else given.at(scene.context)


# --- rates --------------------------------------------------------------------------------------------------


def from_momentum(scene: Any) -> Vector:
    """The rates (mpf, body axes) of a momentum in space."""
    to_body = transpose(attitude.rotation_matrix(scene.quaternion))
    momentum = apply(to_body, vector(scene.context, scene.config.initial.angular_momentum))
    what = "has a part along the axis that has no moment of inertia; make that part zero"
    ensure(not along_massless(scene.body, momentum), refusal("angular_momentum", what))
    for load in scene.loads:
        if load.inner_momentum is not None:
            momentum = minus(momentum, load.inner_momentum)
    return apply(inverse_inertia(scene.context, scene.body), momentum)


def spin_rate(scene: Setting) -> Any:
    """Rate (mpf, rad/s) about the figure axis that ``spin_period`` means."""
    return 2 * scene.context.pi / scene.config.initial.spin_period.at(scene.context)


# --- flights ------------------------------------------------------------------------------------------------

_STRENGTH = f"{EARTH.gravitational_parameter:g} m^3/s^2"


def flight_start(config: Config, context: Any) -> tuple[Vector, Vector]:
    """Position and velocity (mpf, space axes, m and m/s) at ``time.start`` of a body that flies freely.

    Raises:
        ConfigError: keys contradict each other, or the start can't be found.
    """
    table, date = config.initial, config.time.epoch
    position, velocity = vector(context, table.position), vector(context, table.velocity)
    if table.tle is None and table.frame is None:
        return position, velocity
    key, frame = ("tle", "TEME") if table.tle is not None else ("frame", str(table.frame))
    _check_geocentric(config, partial(refusal, key), key)
    if date is None:
        what = f'missing; frame = "{frame}" needs the date of time 0, such as "2026-03-01T12:00:00 UTC"'
        raise ConfigError(Problem("[time] epoch", what))
    try:
        date = date.after(Decimal(repr(float(config.time.start))))
        if table.tle is not None:
            found = sgp4(table.tle, date)
            position, velocity = ([context.mpf(x) for x in one] for one in found)
        if frame in ("ITRF", "TEME"):  # others are GCRF's axes, to 0.02 arcsec
            rows, turning = itrf(date) if frame == "ITRF" else teme(date)
            matrix = [[context.mpf(x) for x in row] for row in rows]
            position, velocity = apply(matrix, position), apply(matrix, velocity)
            velocity = plus(velocity, cross([context.mpf(x) for x in turning], position))
    except ValueError as error:
        raise refusal(key, str(error)) from None
    if config.frame.axes == ECLIPTIC:
        position, velocity = (to_ecliptic(one, obliquity(context)) for one in (position, velocity))
    return position, velocity


def _check_geocentric(config: Config, fault: Callable[[str], ConfigError], key: str) -> None:
    """Refuse scenes whose origin isn't known to be the Earth's centre."""
    what = "given with [ephemeris], whose kernel has its own origin and axes; give position and velocity in "
    ensure(config.ephemeris is None, fault(f"{what}those, without {key}"))
    loads: list[Any] = [load for load in config.loads if getattr(load, "kind", "") == "central_gravity"]
    what = "is about the Earth, but nothing attracts the body; add a load of kind central_gravity with "
    ensure(loads, fault(f'{what}gravitational_parameter = "{_STRENGTH}"'))
    strength, place = loads[0].gravitational_parameter, loads[0].position
    what = ""
    if strength is None:  # of one of [[bodies]]
        what = "counts from the centre of the Earth, but the central_gravity belongs to one of [[bodies]]"
    elif not EARTH.attracts_by(float(strength)):
        what = f"is about the Earth, but the central_gravity has {float(strength):.6g} m^3/s^2"
    elif any(x.sign for x in place):
        what = "counts from the centre of the Earth, but the central_gravity has another position"
    ensure(not what, fault(f"{what}; a gravitational_parameter of {_STRENGTH} at the origin is allowed"))


# --- frames about the Earth, and SGP4 -----------------------------------------------------------------------

Rotation = tuple[list[list[float]], list[float]]
"""Matrix from a frame to GCRF, and the frame's angular velocity in GCRF (rad/s)."""
LONGEST = 30
"""Days from the date of two-line elements: errors of SGP4 grow by 1 to 3 km a day (Vallado et al. 2006)."""
_WATCHED = 5.0  # minutes between moments at which SGP4 is asked whether there is an orbit, 18 in the lowest
_EXTRA = "pip install 'rigidsim[tle]'"
_ARCSECOND = math.pi / 648000
_TT_MINUS_TAI = 32.184
_J2000 = 2451545.0
_MJD_OF_DAY_0 = 678576  # ordinal of 1858-11-17
_TURNING = 2 * math.pi * 1.00273781191135448 / 86400  # rad per second of UT1 (IERS 2010, eq. 5.15)


def package(name: str) -> Any:
    """A package of the extra ``tle``; ``ValueError`` where it isn't installed."""
    try:
        return importlib.import_module(name)
    except ImportError:
        top = {"erfa": "pyerfa"}.get(name, name.split(".")[0])
        raise ValueError(f"needs the package {top}, which isn't installed: {_EXTRA}") from None


@cache
def _orientation() -> np.ndarray:
    """Columns: seconds of TAI since MJD 0, UT1 - TAI (s), pole (rad, two), its offsets (rad, two)."""
    from heyoka import eop_data  # which few scenes need

    table = np.array([tuple(row) for row in eop_data().table], dtype=float)
    days, offsets, _ = leap_seconds()
    found = np.searchsorted(np.array(days) - _MJD_OF_DAY_0, table[:, 0], side="right") - 1
    tai = np.array(offsets, dtype=float)[found]
    return np.column_stack(
        [
            table[:, 0] * 86400 + tai,
            table[:, 1] - tai,
            table[:, 2:4] * _ARCSECOND,
            table[:, 4:6] * _ARCSECOND / 1e3,
        ]
    )


def _terrestrial(epoch: Epoch) -> Fraction:
    """Seconds of TT since J2000."""
    uniform = epoch.uniform()
    elapsed = (uniform.julian_date() - int(_J2000)) * 86400
    if uniform.scale == "TDB":
        elapsed -= Fraction(tdb_minus_tt(float(elapsed)))
    return elapsed


def _orientation_at(epoch: Epoch, known: bool) -> tuple[np.ndarray, float]:
    """UT1 - TT (s), pole and offsets (rad), and seconds of UT1 in one of TAI; outside the table its ends, or
    ``ValueError`` where they must be ``known``.
    """
    table = _orientation()
    tai = float(_terrestrial(epoch)) - _TT_MINUS_TAI + 51544.5 * 86400
    if known and not table[0, 0] <= tai <= table[-1, 0]:
        ends = (int(row[0] // 86400) for row in (table[0], table[-1]))
        first, last = (date.fromordinal(_MJD_OF_DAY_0 + day) for day in ends)
        newer = "; a newer heyoka knows later ones" if tai > table[-1, 0] else ""
        raise ValueError(
            f"the date {epoch} is outside the IERS's table of the Earth's rotation, {first} to {last} (in "
            f"heyoka{newer}); give the state in TEME or GCRF, which need no table"
        )
    after = int(np.clip(np.searchsorted(table[:, 0], tai), 1, len(table) - 1))
    low, high = table[after - 1], table[after]
    share = min(max((tai - low[0]) / (high[0] - low[0]), 0.0), 1.0)
    values = low[1:] + share * (high[1:] - low[1:])
    values[0] -= _TT_MINUS_TAI
    return values, 1 + (high[1] - low[1]) / (high[0] - low[0])


def _intermediate(
    epoch: Epoch, known: bool
) -> tuple[Any, tuple[float, float], np.ndarray, np.ndarray, float]:
    """ERFA, the Julian date of UT1 in two parts, matrix from GCRF to the Earth-fixed axes without polar
    motion, the values of ``_orientation_at``, and the pace of UT1.
    """
    erfa = package("erfa")
    values, pace = _orientation_at(epoch, known)
    elapsed = _terrestrial(epoch)
    day, seconds = divmod(elapsed, 86400)
    tt = _J2000 + float(day), float(seconds) / 86400
    ut1 = tt[0], float(seconds + Fraction(float(values[0]))) / 86400
    x, y, s = erfa.xys06a(*tt)
    celestial = erfa.c2ixys(x + values[3], y + values[4], s)
    return erfa, ut1, erfa.rz(erfa.era00(*ut1), celestial), values, pace


def itrf(epoch: Epoch) -> Rotation:
    """ITRF at a date; ``ValueError`` beyond the table of the Earth's rotation."""
    erfa, ut1, fixed, values, pace = _intermediate(epoch, known=True)
    moved = erfa.pom00(values[1], values[2], erfa.sp00(*ut1))
    turning = fixed.T @ np.array([0.0, 0.0, _TURNING * pace])
    return (moved @ fixed).T.tolist(), turning.tolist()


def teme(epoch: Epoch) -> Rotation:
    """TEME at a date. UT1 cancels but for precession: 1 s of it is worth 0.1 mm in low orbits."""
    erfa, ut1, fixed, *_ = _intermediate(epoch, known=False)
    plain = erfa.rz(-erfa.gmst82(*ut1), fixed)
    return plain.T.tolist(), [0.0, 0.0, 0.0]


def sgp4(elements: TwoLineElements, epoch: Epoch) -> tuple[list[float], list[float]]:
    """Position and velocity in TEME (m, m/s) at a date.

    Raises:
        ValueError: the date is far from the elements' date, or SGP4 has no orbit then.
    """
    api = package("sgp4.api")
    minutes = float(_terrestrial(epoch) - _terrestrial(elements.epoch)) / 60
    one, two = elements.lines
    if abs(minutes) > LONGEST * 1440:
        raise ValueError(
            f"its date {elements.epoch} is {abs(minutes) / 1440:.1f} days from the start, {epoch}; up to "
            f"{LONGEST} days are allowed, as SGP4's errors grow by 1 to 3 km a day: take newer lines, or "
            f'remove [time] epoch; given "{one}" and "{two}"'
        )
    satellite = api.Satrec.twoline2rv(one, two)
    # on the way, too: SGP4 reports only once that a satellite has come down, and goes on
    for moment in np.linspace(0.0, minutes, math.ceil(abs(minutes) / _WATCHED) + 1)[::-1]:
        code, found, moving = satellite.sgp4_tsince(float(moment))
        if code:
            why = str(api.SGP4_ERRORS.get(code, f"error {code}"))
            raise ValueError(
                f"SGP4 finds no orbit {moment:.0f} minutes after {elements.epoch}: {why}; take other lines; "
                f'given "{one}" and "{two}"'
            )
        if moment == minutes:
            place, speed = found, moving
    return [1e3 * x for x in place], [1e3 * v for v in speed]
