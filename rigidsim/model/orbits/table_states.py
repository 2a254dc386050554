"""Tabulated orbits carried as states, so that the engine interpolates no table.

Between two rows each element is a polynomial of u, the elapsed fraction of the interval:

    u' = 1 / L,    x' = (c_1 + 2 c_2 u + ... + 5 c_5 u^4) / L,

with coefficients that are parameters of the compiled equations. Steps end at the rows, where the parameters
of the next piece take over and the states are put on the table's own values (``Pieces``): nothing adds up.
The place on the orbit is the eccentric longitude K, carried by its cosine c and sine s, so that no angle
grows:

    K' = (l' + k' s - h' c) / (1 - k c - h s),    r = a (1 - k c - h s).

(Equinoctial elements: Broucke & Cefalu 1972, Celestial Mechanics 5, 303.) An average over the orbit takes
the elements alone, and what is added back to one the mean longitude, which enters nothing else: it is carried
from its start in a unit of which the whole table has less than one.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import heyoka as hy

from rigidsim.model.orbits.kepler_states import OrbitStates
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.state_blocks import StateBlock
from rigidsim.model.two_part import as_factor, rounded
from rigidsim.scene.arithmetic import GUARD_BITS
from rigidsim.scene.orbit_tables.pieces import AXIS, LONGITUDE, TabulatedOrbit

_POWERS = 5  # of the polynomials; as many parameters for each element
_LEAST = -5
"""Exponent, in bits of the working precision, of what is set to zero: elements are of order one, so that
anything smaller is a remnant of a zero and could underflow single precision.
"""


class Carried(Enum):
    """Which longitude along the orbit is carried: the eccentric one, the mean one, or neither."""

    ECCENTRIC = "eccentric"
    MEAN = "mean"
    NEITHER = "neither"


@dataclass(frozen=True)
class TablePlace:
    """Positions of a table's states and parameters in the system."""

    tag: str  # suffix that makes the states' names unique, such as "1"
    first: int  # index of its first parameter
    longitude: Carried = Carried.ECCENTRIC

    def elements(self, orbit: TabulatedOrbit) -> list[str]:
        """Names of the elements that change and are therefore carried."""
        neither = self.longitude is Carried.NEITHER
        return [x for x in orbit.moving if not (neither and x == LONGITUDE)]


def places_of(
    orbits: Sequence[tuple[str, TabulatedOrbit]], longitude: Carried
) -> dict[TabulatedOrbit, TablePlace]:
    """Places of the given orbits, with their tags; an orbit that occurs twice gets one place."""
    found: dict[TabulatedOrbit, TablePlace] = {}
    first = 0
    for tag, orbit in orbits:
        if orbit not in found:
            found[orbit] = TablePlace(tag, first, longitude)
            first += 1 + _POWERS * len(found[orbit].elements(orbit))
    return found


def _name(element: str, tag: str) -> str:
    return f"table_{element}{tag}"


@dataclass(frozen=True)
class ElementStates:
    """Orbital elements as expressions; the semi-major axis in units of its mean."""

    block: StateBlock
    values: Mapping[str, Symbolic]  # axis, k, h, q, p; constants as factors
    rates: Mapping[str, Symbolic]  # of changing elements, and of the longitude if a column gives it
    motion: Symbolic  # rate of the mean longitude
    pace: Symbolic  # mean motion by Kepler's third law, or by the period that was given
    mean_longitude: Symbolic | None  # rad; None if it isn't carried

    @property
    def normal(self) -> list[Symbolic]:
        """Unit normal of the orbit's plane, space axes."""
        q, p = self.values["q"], self.values["p"]
        chi = hy.sqrt(1.0 - p * p - q * q)
        return [2.0 * (p * chi), -2.0 * (q * chi), 1.0 - 2.0 * (p * p + q * q)]


def element_states(
    orbit: TabulatedOrbit, place: TablePlace, time_exponent: int, start: Any, number: Rounder
) -> ElementStates:
    """Carry the elements of an orbit from a start in s (mpf), in units of 2^time_exponent s."""
    context, tag = orbit.context, place.tag
    begin = orbit.at(start)
    past = _name("part", tag)
    u = hy.make_vars(past)
    piece, times = orbit.number_at(start), orbit.table.times
    names, derivatives = [past], [hy.par[place.first]]
    initial = [(start - times[piece]) / (times[piece + 1] - times[piece])]
    values: dict[str, Symbolic] = {}
    rates: dict[str, Symbolic] = {}
    for i, element in enumerate(place.elements(orbit)):
        first = place.first + 1 + _POWERS * i
        rate = hy.par[first + _POWERS - 1]
        for power in reversed(range(_POWERS - 1)):
            rate = hy.par[first + power] + u * rate
        rates[element] = rate
        if element == LONGITUDE:  # the place on the orbit enters through K alone
            continue
        names.append(_name(element, tag))
        values[element] = hy.make_vars(names[-1])
        derivatives.append(rate)
        initial.append(begin[element] / _unit(orbit, element))
    for element in ("k", "h", "q", "p"):
        if element not in values:
            values[element] = as_factor(rounded(number(begin[element])))
    moving_axis = AXIS in values
    if not moving_axis:
        values[AXIS] = hy.expression(1.0)
    mean = orbit.motion(orbit.semi_major_axis)
    pace = as_factor(number(context.ldexp(mean, time_exponent)))
    if moving_axis and orbit.motion(2 * orbit.semi_major_axis) != mean:
        pace = pace * (1.0 / (values[AXIS] * hy.sqrt(values[AXIS])))
    motion = rates.get(LONGITUDE, pace)
    longitude = None
    if place.longitude is Carried.MEAN:
        exponent = orbit.longitude_exponent
        names.append(_name(LONGITUDE, tag))
        derivatives.append(math.ldexp(1.0, -exponent) * motion)
        initial.append(context.zero)
        # as a fraction of a turn: whole turns before the start carry no information
        longitude = number(orbit.starting_longitude(start) % (2 * context.pi)) + math.ldexp(
            1.0, exponent
        ) * hy.make_vars(names[-1])
    return ElementStates(StateBlock(names, derivatives, initial), values, rates, motion, pace, longitude)


def table_states(
    orbit: TabulatedOrbit, place: TablePlace, time_exponent: int, start: Any, number: Rounder
) -> OrbitStates:
    """Carry an orbit including the position along it; arguments as for ``element_states``."""
    context, tag = orbit.context, place.tag
    found = element_states(orbit, place, time_exponent, start, number)
    begin = orbit.at(start)
    k, h, q, p, axis = (found.values[x] for x in ("k", "h", "q", "p", AXIS))
    c, s = hy.make_vars(f"cos_longitude{tag}", f"sin_longitude{tag}")
    radius = 1.0 - k * c - h * s
    rates = found.rates
    turning = found.motion + rates.get("k", hy.expression(0.0)) * s - rates.get("h", hy.expression(0.0)) * c
    turning = turning / radius
    eccentric = orbit.eccentric_longitude(begin, orbit.starting_longitude(start))
    inverse = 1.0 / radius
    beta = 1.0 / (1.0 + hy.sqrt(1.0 - k * k - h * h))
    x = ((1.0 - h * h * beta) * c + h * k * beta * s - k) * inverse
    y = ((1.0 - k * k * beta) * s + h * k * beta * c - h) * inverse
    chi = hy.sqrt(1.0 - p * p - q * q)
    cross = 2.0 * (p * q)
    direction = [
        (1.0 - 2.0 * (p * p)) * x + cross * y,
        cross * x + (1.0 - 2.0 * (q * q)) * y,
        2.0 * (chi * (q * y - p * x)),
    ]
    block = StateBlock(
        [*found.block.names, f"cos_longitude{tag}", f"sin_longitude{tag}"],
        [*found.block.derivatives, -(turning * s), turning * c],
        [*found.block.initial, context.cos(eccentric), context.sin(eccentric)],
        [hy.sqrt(c * c + s * s)],
    )
    return OrbitStates(block, direction, found.normal, inverse / axis)


def _unit(orbit: TabulatedOrbit, element: str) -> Any:
    """Unit in which an element is carried: the mean axis for axes, 1 for the rest."""
    return orbit.semi_major_axis if element == AXIS else orbit.context.one


class Pieces:
    """Pieces of the table that begin at ``knots`` (internal units): parameters, and states that are reset."""

    def __init__(
        self, places: Mapping[TabulatedOrbit, TablePlace], time_exponent: int, start: Any, number: Rounder
    ) -> None:
        self._places, self._exponent, self._start, self._number = places, time_exponent, start, number
        found = [
            (time, row, orbit)
            for orbit in places
            for row, time in enumerate(orbit.table.times[1:-1], start=1)
            if time > start
        ]
        self.knots: list[Any] = []
        self._rows: list[dict[TabulatedOrbit, int]] = []
        for time, row, orbit in sorted(found, key=lambda each: each[0]):
            knot = number(orbit.context.ldexp(time, -time_exponent))
            if not self.knots or knot > self.knots[-1]:  # rows of several tables may be at the same time
                self.knots.append(knot)
                self._rows.append({})
            self._rows[-1][orbit] = row
        self._known: dict[int, list[Any]] = {}
        self._longitudes: dict[TabulatedOrbit, Any] = {}

    def number_at(self, time: Any) -> int:
        """Number of the piece that begins at or contains a time (internal units, working precision)."""
        return bisect_right(self.knots, time)

    def parameters(self, number: int) -> list[Any]:
        """All parameters of a piece, working precision."""
        if number not in self._known:
            found: list[Any] = []
            for orbit in self._places:
                least = orbit.context.ldexp(1, _LEAST * (orbit.context.prec - GUARD_BITS))
                found += [
                    self._number(x if abs(x) > least else 0 * x)
                    for x in self._of(orbit, self._row(orbit, number))
                ]
            self._known = {number: found}  # the latest is asked for again and again
        return self._known[number]

    def states(self, number: int) -> dict[str, Any]:
        """Values, by name, of the states that are reset where a piece begins, working precision."""
        found: dict[str, Any] = {}
        for orbit, row in self._rows[number - 1].items() if number else ():
            place, begin = self._places[orbit], orbit.row(row)
            tag, elements = place.tag, place.elements(orbit)
            found[_name("part", tag)] = orbit.context.zero
            for element in elements:
                if element != LONGITUDE:
                    found[_name(element, tag)] = begin[element] / _unit(orbit, element)
            if LONGITUDE in elements and place.longitude is Carried.MEAN:
                since = begin[LONGITUDE] - self._start_of(orbit)
                found[_name(LONGITUDE, tag)] = orbit.context.ldexp(since, -orbit.longitude_exponent)
            elif LONGITUDE in elements:
                turned = orbit.eccentric_longitude(begin, begin[LONGITUDE])
                found[f"cos_longitude{tag}"] = orbit.context.cos(turned)
                found[f"sin_longitude{tag}"] = orbit.context.sin(turned)
        return {name: self._number(value) for name, value in found.items()}

    def _row(self, orbit: TabulatedOrbit, number: int) -> int:
        """Table row at which a piece begins or in whose interval it lies."""
        for before in range(number - 1, -1, -1):
            if orbit in self._rows[before]:
                return self._rows[before][orbit]
        return orbit.number_at(self._start)

    def _start_of(self, orbit: TabulatedOrbit) -> Any:
        """Mean longitude at the start of the run, rad (mpf)."""
        if orbit not in self._longitudes:
            self._longitudes[orbit] = orbit.starting_longitude(self._start)
        return self._longitudes[orbit]

    def _of(self, orbit: TabulatedOrbit, row: int) -> list[Any]:
        times, piece = orbit.table.times, orbit.piece(row)
        context = orbit.context
        inverse = 1 / context.ldexp(times[row + 1] - times[row], -self._exponent)
        found = [inverse]
        for element in self._places[orbit].elements(orbit):
            scale = inverse / _unit(orbit, element)
            found += [power * c * scale for power, c in enumerate(piece[element]) if power]
        return found
