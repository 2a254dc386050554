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
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from decimal import Decimal
from functools import partial
from typing import Any

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.scene import attitude, space_axes
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, minus, negligible, plus, transpose, vector
from rigidsim.scene.bodies.body import RigidBody, inverse_inertia
from rigidsim.scene.bodies.presets import EARTH
from rigidsim.scene.earth_frames import itrf, sgp4, teme
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.registry import Setting
from rigidsim.scene.schema import Config, Initial
from rigidsim.scene.space_axes import ECLIPTIC, obliquity, to_ecliptic


@dataclass(frozen=True)
class InitialRotation:
    """Where the rotation begins.

    Attributes:
        quaternion: unit quaternion, body to space.
        angular_velocity: body axes, rad/s; None from a way that gives the attitude alone.
        euler_angles: as given, rad; None if given otherwise.
        found: how an equilibrium was found, for reports; None for a start that was given.
    """

    quaternion: Vector
    angular_velocity: Vector | None = None
    euler_angles: Vector | None = None
    found: Any = None


ATTITUDES = ("quaternion", "euler_angles", "pole", "obliquity")
RATES = ("angular_velocity", "angular_momentum", "spin_period")
"""Keys of ``[initial]``, of which one gives the attitude and one the rates."""
_BESIDE = {"node_longitude": ("obliquity",), "prime_meridian": ("pole", "obliquity")}
"""Keys that give nothing alone, and what each counts with."""
_BESIDE_FOUND = {"relative": ATTITUDES}
"""What may stand beside an equilibrium; a Cassini state takes a period."""
STARTS: dict[str, Callable[[Any], InitialRotation]] = {}
"""Starts that rooms above find, by names of equilibria and keys: from the scene so far; ConfigError."""


def refusal(key: str, text: str) -> ConfigError:
    """The error that names a key of ``[initial]``."""
    return ConfigError(Problem(f"[initial] {key}", text))


def angle_out_of_range(key: str, what: str, context: Any, angle: Any, allowed: str) -> ConfigError:
    """The error for an angle (rad) out of its range."""
    degrees = f"{what}{context.nstr(context.degrees(angle), 8)} deg"
    return refusal(key, f'given {degrees}; {allowed} is allowed, and degrees have their unit: "23.44 deg"')


def check_ways(table: Initial) -> None:
    """Refuse what contradicts itself before anything is worked out."""
    found, ways = table.equilibrium, [_given(table, ATTITUDES), _given(table, RATES)]
    for way, what in zip(ways, ("attitude", "start of the rates"), strict=True):
        for other in way[1:]:
            text = f"given with {way[0]}; only one {what} is allowed: remove one of them"
            raise refusal(other, text)
        for key in way if found is not None else ():
            text = f'given with equilibrium = "{found}", which finds it; remove one of them'
            ensure(key in _BESIDE_FOUND.get(str(found), ("spin_period",)), refusal(key, text))
    text = f"missing; exactly one of {', '.join(RATES)} and equilibrium is needed"
    ensure(found is not None or ways[1], refusal("angular_velocity", text))
    for key, takers in _BESIDE.items():
        text = f"given without {' or '.join(takers)}, with which it counts; add that"
        ensure(getattr(table, key) is None or _given(table, takers), refusal(key, text))
    known = table.obliquity is None or table.node_longitude is not None
    ensure(known, refusal("node_longitude", "missing; obliquity needs it"))


def _given(table: Initial, keys: Iterable[str]) -> list[str]:
    return [key for key in keys if getattr(table, key) is not None]


def attitude_of(scene: Setting) -> InitialRotation:
    """The attitude at the start of a scene; by default the body axes are along the space axes."""
    table = scene.config.initial
    if table.pole is not None:
        return _from_pole(scene)
    if table.obliquity is not None:
        return STARTS["obliquity"](scene)
    sequence = scene.config.integrator.euler_sequence
    given = attitude.given_attitude(scene.context, table, sequence, refusal)
    if given is None:
        return InitialRotation([scene.context.one] + [scene.context.zero] * 3)
    return InitialRotation(given[0], euler_angles=given[1])


def rotation_of(scene: Any) -> InitialRotation:
    """Attitude and rates at the start of a scene that has an attitude."""
    table = scene.config.initial
    if table.equilibrium is not None:
        key, start = "equilibrium", STARTS[table.equilibrium](scene)
    else:
        (key,), rates = _given(table, RATES), vector(scene.context, table.angular_velocity)
        if key == "angular_momentum":
            rates = from_momentum(scene)
        elif key == "spin_period":
            rates = [spin_rate(scene) * x for x in scene.figure.pole]
        start = InitialRotation(scene.quaternion, rates, scene.euler_angles)
    what = "has a spin about the axis that has no moment of inertia, where a spin means nothing; make that "
    ensure(not _along_massless(scene.body, start.angular_velocity), refusal(key, what + "component zero"))
    return start


def _along_massless(body: RigidBody, vector: Vector | None) -> bool:
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
    ensure(not _along_massless(scene.body, momentum), refusal("angular_momentum", what))
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
