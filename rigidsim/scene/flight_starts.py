"""Where a free flight begins: position and velocity as given, in a dated frame, or two-line elements.

What knows the Earth's orientation and SGP4 registers itself here, from the room of mechanics.
"""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.arithmetic import Vector, apply, cross
from rigidsim.scene.bodies.presets import EARTH
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.schema import Config
from rigidsim.scene.space_axes import ECLIPTIC, obliquity, to_ecliptic
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
    table = config.initial
    if table.tle is None and table.frame is None:
        return _given(config, context)
    key = "tle" if table.tle is not None else "frame"
    for other in ("position", "velocity", "frame") if key == "tle" else ():
        if getattr(table, other) is not None:
            raise _fault(other, "given with tle, which determines it; remove one of them")
    _check_geocentric(config, key)
    date = config.time.epoch
    if date is None:
        raise ConfigError(
            Problem(
                "[time] epoch",
                f'missing; frame = "{table.frame}" needs the date of time 0, such as '
                '"2026-03-01T12:00:00 UTC"',
            )
        )
    try:
        date = date.after(Decimal(repr(float(config.time.start))))
        if table.tle is not None:
            place, speed = PROPAGATORS["SGP4"](table.tle, date)
            position, velocity = ([context.mpf(x) for x in vector] for vector in (place, speed))
            frame = "TEME"
        else:
            position, velocity = _given(config, context)
            frame = str(table.frame)
        if frame in ROTATIONS:
            rows, turning = ROTATIONS[frame](date)
            matrix = [[context.mpf(x) for x in row] for row in rows]
            position, velocity = apply(matrix, position), apply(matrix, velocity)
            carried = cross([context.mpf(x) for x in turning], position)
            velocity = [x + y for x, y in zip(velocity, carried, strict=True)]
    except ValueError as error:
        raise _fault(key, str(error)) from None
    if config.frame.axes == ECLIPTIC:
        position, velocity = (to_ecliptic(vector, obliquity(context)) for vector in (position, velocity))
    return position, velocity


def _given(config: Config, context: Any) -> tuple[Vector, Vector]:
    table, zero = config.initial, [context.zero] * 3
    position = [x.at(context) for x in table.position] if table.position else zero
    return position, [x.at(context) for x in table.velocity] if table.velocity else list(zero)


def _check_geocentric(config: Config, key: str) -> None:
    """Refuse scenes whose origin isn't known to be the Earth's centre."""
    if config.ephemeris is not None:
        what = "given with [ephemeris], whose kernel has its own origin and axes; give position and velocity "
        raise _fault(key, f"{what}in those, without {key}")
    for load in config.loads:
        if getattr(load, "kind", "") != "central_gravity":
            continue
        strength, place = load.gravitational_parameter, load.position  # type: ignore[attr-defined]
        if strength is None:  # of one of [[bodies]]
            what = "counts from the centre of the Earth, but the central_gravity belongs to one of [[bodies]]"
        elif not EARTH.attracts_by(float(strength)):
            what = f"is about the Earth, but the central_gravity has {float(strength):.6g} m^3/s^2"
        elif any(x.sign for x in place):
            what = "counts from the centre of the Earth, but the central_gravity has another position"
        else:
            return
        raise _fault(key, f"{what}; a gravitational_parameter of {_STRENGTH} at the origin is allowed")
    what = "is about the Earth, but nothing attracts the body; add a load of kind central_gravity with "
    raise _fault(key, f'{what}gravitational_parameter = "{_STRENGTH}"')


def _fault(key: str, text: str) -> ConfigError:
    return ConfigError(Problem(f"[initial] {key}", text))
