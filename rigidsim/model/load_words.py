"""Words for loads in a reader's terms: bodies by name, distances and altitudes, periods, directions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rigidsim.scene.bodies.presets import known_body
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.readable import number_text, span_text
from rigidsim.scene.tracing.numbers import plain

_DIGITS = 4
_KILOMETRES = 1e4  # m, from where on km read better
ASTRONOMICAL_UNIT = 149597870700.0  # m
_FAR = 1e10  # m, from where on au do
_NEAR = 20  # radii: farther from a body's centre, the altitude above its surface tells nothing
_STRAIGHT = 1e-9  # of a direction's component: what is less is zero
_EVEN = 1e-4  # relative difference of two distances that are shown as one


def value_text(value: Any, unit: str, digits: int = _DIGITS) -> str:
    """A number with its unit."""
    return f"{number_text(float(value), digits)} {unit}"


def span_words(seconds: Any) -> str:
    """A time span in the unit that suits it."""
    return span_text(float(seconds), _DIGITS)


def length_text(*lengths: float) -> str:
    """A length, or two from the shorter to the longer, in m, km or au."""
    size, unit = next(
        (size, unit)
        for least, size, unit in ((_FAR, ASTRONOMICAL_UNIT, "au"), (_KILOMETRES, 1e3, "km"), (0.0, 1.0, "m"))
        if max(lengths) >= least
    )
    return " to ".join(number_text(length / size, _DIGITS) for length in lengths) + f" {unit}"


def source_text(strength: Any) -> str:
    """An attracting body, by name if its gravitational parameter (m^3/s^2) is known."""
    known, size = known_body(float(strength)), value_text(strength, "m^3/s^2")
    return f"a body of G M {size}" if known is None else f"{known.called} (G M {size})"


def reach_text(strength: Any, *distances: Any) -> str:
    """Distance, or least and largest distance (m), from a body's centre, and the altitude of a known one."""
    lengths = [float(x) for x in distances]
    if lengths[-1] - lengths[0] < _EVEN * lengths[-1]:
        lengths = lengths[:1]
    text, known = length_text(*lengths), known_body(float(strength))
    if known is None or lengths[0] > _NEAR * known.radius:
        return text
    heights = [length - known.radius for length in lengths]
    if heights[0] < 0:
        return f"{text}, below its surface"
    return f"{text}, {length_text(*heights)} above its surface"


def orbit_text(orbit: KeplerOrbit, strength: Any) -> str:
    """An orbit's size, altitude, periods and inclination, about a body of a G M (m^3/s^2)."""
    mean, e = float(orbit.semi_major_axis), float(orbit.eccentricity)
    shape = "circular" if orbit.circular else "eccentric"
    reach = reach_text(strength, *([mean] if orbit.circular else [mean * (1 - e), mean * (1 + e)]))
    parts = [f"on {'a' if orbit.circular else 'an'} {shape} orbit of {reach}"]
    longitude = orbit.mean_motion + orbit.periapsis_rate + orbit.node_rate
    period = f"period {span_words(2 * math.pi / abs(orbit.mean_motion))}" if orbit.mean_motion else "at rest"
    if not orbit.fixed_plane and longitude:
        kind = "draconic" if orbit.circular else "anomalistic"
        period = f"{kind} {period}, sidereal {span_words(2 * math.pi / abs(longitude))}"
    parts.append(period)
    if orbit.inclination:
        parts.append(f"inclination {value_text(math.degrees(orbit.inclination), 'deg')}")
    return ", ".join(parts)


def axis_text(axis: Sequence[Any]) -> str:
    """A unit vector in body axes: ``the body's z axis``, or its components."""
    unit = [float(plain(x)) for x in axis]
    for name, x in zip("xyz", unit, strict=True):
        if abs(x) == 1:
            return f"the body's {'-' if x < 0 else ''}{name} axis"
    return "(" + ", ".join(number_text(x, _DIGITS) for x in unit) + ") in body axes"


def direction_text(vector: Sequence[Any]) -> str:
    """Direction of gravity in space axes: ``down along -Z``, ``along +X``, or components."""
    name = _direction(vector)
    if name.startswith("("):
        return f"along {name} in space axes"
    return f"{('down ' if name[0] == '-' else 'up ') if name[1] == 'Z' else ''}along {name}"


def sides_text(source: Sequence[Any]) -> str:
    """On which side source and body see each other at the start, for the source's place (space axes)."""
    there, back = _direction(source), _direction([-x for x in source])
    return f"at the start the source is at {there} of the body, and the body at {back} of the source"


def _direction(vector: Sequence[Any]) -> str:
    """A direction in space axes: ``+X``, ``-Z`` or the components of its unit vector."""
    largest = max(abs(x) for x in vector)  # of numbers that a double need not hold
    unit = [float(plain(x / largest)) for x in vector]
    unit = [x / math.hypot(*unit) for x in unit]
    unit = [0.0 if abs(x) < _STRAIGHT else x for x in unit]
    if unit.count(0.0) < 2:
        return "(" + ", ".join(number_text(x, _DIGITS) for x in unit) + ")"
    axis = next(i for i, x in enumerate(unit) if x)
    return ("-" if unit[axis] < 0 else "+") + "XYZ"[axis]
