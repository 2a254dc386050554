"""Starts: the ways in which ``[initial]`` gives an attitude, rates, or both, one entry each; and where a free
flight begins: position and velocity as given, in a dated frame, or two-line elements.

A way has the key that chooses it, and the keys that it takes beside. One way gives the attitude (by default
the body axes are along the space axes) and one the rates; an equilibrium, which is found, gives both. Ways
that need mechanics, such as the plane of an orbit, are registered by the rooms above.

An attitude from the pole of the body's equator is R = R3(node) R1(tilt) R3(turn) F^T, with the figure's
equator and pole as columns of F: the equator rises through the plane at the node, its pole is tilted from the
plane's normal, and the turn leads along it from the node to the prime meridian. Against the equator of J2000
these are a + 90 deg, 90 deg - d and W for the pole's right ascension a and declination d (Archinal et al.
2018, Celest. Mech. Dyn. Astr. 130, 22, figure 1).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from functools import partial
from typing import Any

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.scene import attitude, space_axes
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, minus, negligible, plus, transpose, vector
from rigidsim.scene.bodies.body import RigidBody, inverse_inertia
from rigidsim.scene.bodies.presets import EARTH
from rigidsim.scene.epochs import Epoch
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
    """

    quaternion: Vector
    angular_velocity: Vector | None = None
    euler_angles: Vector | None = None
    found: Any = None


@dataclass(frozen=True)
class StartForm:
    """One way to give a part of the start.

    Attributes:
        key: the key of ``[initial]`` that chooses it.
        resolve: from the scene so far to an ``InitialRotation``, or of rates to an angular velocity; raises
            ``ConfigError``.
        needed: keys that must stand beside it.
        allowed: keys that may stand beside it.
    """

    key: str
    resolve: Callable[[Any], Any]
    needed: tuple[str, ...] = ()
    allowed: tuple[str, ...] = ()


ATTITUDES: dict[str, StartForm] = {}
RATES: dict[str, StartForm] = {}
EQUILIBRIA: dict[str, StartForm] = {}
"""By name instead of key: what may stand beside are ways to give attitude or rates."""
_BESIDE = ("prime_meridian", "node_longitude")  # which give nothing alone


def register_start(ways: dict[str, StartForm], way: StartForm, name: str = "") -> None:
    """Register a way in ``ATTITUDES``, ``RATES`` or ``EQUILIBRIA``; ``ValueError`` if the name is taken."""
    known = ways.setdefault(name or way.key, way)
    ensure(known.resolve is way.resolve, ValueError(f"a start by {name or way.key} is registered already"))


def refusal(key: str, text: str) -> ConfigError:
    """The error that names a key of ``[initial]``."""
    return ConfigError(Problem(f"[initial] {key}", text))


def angle_out_of_range(key: str, what: str, context: Any, angle: Any, allowed: str) -> ConfigError:
    """The error for an angle (rad) out of its range."""
    degrees = f"{what}{context.nstr(context.degrees(angle), 8)} deg"
    return refusal(key, f'given {degrees}; {allowed} is allowed, and degrees have their unit: "23.44 deg"')


def check_ways(table: Initial) -> None:
    """Refuse what contradicts itself before anything is worked out."""
    ways = [_chosen(table, ATTITUDES, "attitude"), _chosen(table, RATES, "start of the rates")]
    equilibrium = EQUILIBRIA[table.equilibrium] if table.equilibrium is not None else None
    for way in filter(None, ways if equilibrium else ()):
        what = f'given with equilibrium = "{table.equilibrium}", which finds it; remove one of them'
        ensure(equilibrium and way.key in equilibrium.allowed, refusal(way.key, what))
    either = ", ".join(" with ".join((way.key, *way.needed)) for way in RATES.values())
    what = f"missing; exactly one of {either} and equilibrium is needed"
    ensure(equilibrium or ways[1], refusal("angular_velocity", what))
    beside = {key for way in (ways[0], equilibrium) if way for key in (*way.needed, *way.allowed)}
    for key in _BESIDE:
        takers = [way.key for way in ATTITUDES.values() if key in (*way.needed, *way.allowed)]
        what = f"given without {' or '.join(takers)}, with which it counts; add that"
        ensure(getattr(table, key) is None or key in beside, refusal(key, what))


def _chosen(table: Initial, ways: dict[str, StartForm], what: str) -> StartForm | None:
    """The way whose keys are given; None without any."""
    given = [way for way in ways.values() if getattr(table, way.key) is not None]
    for other in given[1:]:
        text = f"given with {given[0].key}; only one {what} is allowed: remove one of them"
        raise refusal(other.key, text)
    for key in given[0].needed if given else ():
        ensure(getattr(table, key) is not None, refusal(key, f"missing; {given[0].key} needs it"))
    return given[0] if given else None


def attitude_of(scene: Setting) -> InitialRotation:
    """The attitude at the start of a scene; by default the body axes are along the space axes."""
    way = _chosen(scene.config.initial, ATTITUDES, "")
    return way.resolve(scene) if way else InitialRotation([scene.context.one] + [scene.context.zero] * 3)


def rotation_of(scene: Any) -> InitialRotation:
    """Attitude and rates at the start of a scene that has an attitude."""
    table = scene.config.initial
    if table.equilibrium is not None:
        key, start = "equilibrium", EQUILIBRIA[table.equilibrium].resolve(scene)
    else:
        rates = _chosen(table, RATES, "")
        assert rates is not None
        key, start = rates.key, InitialRotation(scene.quaternion, rates.resolve(scene), scene.euler_angles)
    what = "has a spin about the axis that has no moment of inertia, where a spin means nothing; make that "
    ensure(not _along_massless(scene.body, start.angular_velocity), refusal(key, what + "component zero"))
    return start


def _along_massless(body: RigidBody, vector: Vector) -> bool:
    """Whether a vector has a part along an axis without inertia (a rod's)."""
    axes = zip(body.principal_moments, body.principal_axes, strict=True)
    return any(
        moment == 0 and abs(dot(axis, vector)) > max(map(abs, vector)) * 1e-14 for moment, axis in axes
    )


# --- attitudes ----------------------------------------------------------------------------------------------


def _as_written(scene: Setting) -> InitialRotation:
    sequence = scene.config.integrator.euler_sequence
    given = attitude.given_attitude(scene.context, scene.config.initial, sequence, refusal)
    assert given is not None
    return InitialRotation(given[0], euler_angles=given[1])


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


def _given_rates(scene: Setting) -> Vector:
    return vector(scene.context, scene.config.initial.angular_velocity)


def _from_momentum(scene: Any) -> Vector:
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


for _way in (
    StartForm("quaternion", _as_written),
    StartForm("euler_angles", _as_written),
    StartForm("pole", _from_pole, allowed=("prime_meridian",)),
):
    register_start(ATTITUDES, _way)
for _way in (
    StartForm("angular_velocity", _given_rates),
    StartForm("angular_momentum", _from_momentum),
    StartForm("spin_period", lambda scene: [spin_rate(scene) * x for x in scene.figure.pole]),
):
    register_start(RATES, _way)


# --- flights ------------------------------------------------------------------------------------------------

Rotation = tuple[list[list[float]], list[float]]
"""Matrix from a frame to GCRF, and the frame's angular velocity in GCRF (rad/s)."""
ROTATIONS: dict[str, Callable[[Epoch], Rotation]] = {}
"""By name of a frame, entered from the room of mechanics; others are GCRF's axes, to 0.02 arcsec."""
PROPAGATORS: dict[str, Callable[[TwoLineElements, Epoch], tuple[list[float], list[float]]]] = {}
"""SGP4 by its name: to position and velocity in TEME, m and m/s. Both raise ``ValueError``."""
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
            found = PROPAGATORS["SGP4"](table.tle, date)
            position, velocity = ([context.mpf(x) for x in one] for one in found)
        if frame in ROTATIONS:
            rows, turning = ROTATIONS[frame](date)
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
