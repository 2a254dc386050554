"""Where a free flight begins: position and velocity as given, in a dated frame, or two-line elements.

What knows the Earth's orientation and SGP4 registers itself here, from the room of mechanics.
"""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from functools import partial
from typing import Any

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.scene.arithmetic import Vector, apply, cross, plus, vector
from rigidsim.scene.bodies.presets import EARTH
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.schema import Config
from rigidsim.scene.space_axes import ECLIPTIC, obliquity, to_ecliptic
from rigidsim.scene.starts import refusal
from rigidsim.scene.two_line_elements import TwoLineElements

Rotation = tuple[list[list[float]], list[float]]
"""Matrix from a frame to GCRF, and the frame's angular velocity in GCRF (rad/s)."""
ROTATIONS: dict[str, Callable[[Epoch], Rotation]] = {}
"""By name of a frame; the others are GCRF's axes, to 0.02 arcsec."""
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
