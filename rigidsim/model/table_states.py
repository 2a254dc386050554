"""An orbit by a table, carried as states: the engine looks nothing up.

Between two rows each element is a polynomial of u, the part of their distance that is past:

    u' = 1 / L,    x' = (c_1 + 2 c_2 u + ... + 5 c_5 u^4) / L,

with coefficients that are parameters of the compiled equations. Steps end at the rows, where the parameters
of the next piece take over and the states are put on the table's own values (``Pieces``): nothing adds up.
The place on the orbit is the eccentric longitude K, carried by its cosine c and sine s, so that no angle
grows:

    K' = (l' + k' s - h' c) / (1 - k c - h s),    r = a (1 - k c - h s).

(Equinoctial elements: Broucke & Cefalu 1972, Celestial Mechanics 5, 303.)
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from typing import Any

import heyoka as hy

from rigidsim.model.numbers import Rounder
from rigidsim.model.orbit_states import OrbitStates
from rigidsim.model.rotations import Symbolic
from rigidsim.model.state_blocks import StateBlock
from rigidsim.model.two_part import as_factor, rounded
from rigidsim.scene.arithmetic import GUARD_BITS
from rigidsim.scene.records import dataclass
from rigidsim.scene.tabulated_orbit import AXIS, LONGITUDE, TabulatedOrbit

_POWERS = 5  # of the polynomials; as many parameters for each element
_LEAST = -5
"""Binary exponent, in bits of the working precision, below which parameters are zero: elements are of order
one, and what is smaller is left of a zero, and can be beyond single precision's range."""


@dataclass(frozen=True)
class TablePlace:
    """Where a table's states and parameters are.

    Attributes:
        tag: makes the states' names unique, such as "1".
        first: number of its first parameter.
    """

    tag: str
    first: int


def parameter_count(orbit: TabulatedOrbit) -> int:
    """How many parameters an orbit has."""
    return 1 + _POWERS * len(orbit.moving)


def places_of(orbits: Sequence[tuple[str, TabulatedOrbit]]) -> dict[TabulatedOrbit, TablePlace]:
    """Of the orbits with their tags, each counted once."""
    found: dict[TabulatedOrbit, TablePlace] = {}
    first = 0
    for tag, orbit in orbits:
        if orbit not in found:
            found[orbit] = TablePlace(tag, first)
            first += parameter_count(orbit)
    return found


def _name(element: str, tag: str) -> str:
    return f"table_{element}{tag}"


def table_states(
    orbit: TabulatedOrbit, place: TablePlace, time_exponent: int, start: Any, number: Rounder
) -> OrbitStates:
    """Carry an orbit.

    Args:
        time_exponent: binary, of the internal unit of time in seconds.
        start: of the run, seconds (mpf).
    """
    context, tag = orbit.context, place.tag
    begin = orbit.at(start)
    past = _name("part", tag)
    u = hy.make_vars(past)
    piece, times = orbit.number_at(start), orbit.table.times
    names, derivatives = [past], [hy.par[place.first]]
    initial = [(start - times[piece]) / (times[piece + 1] - times[piece])]
    values: dict[str, Symbolic] = {}
    rates: dict[str, Symbolic] = {}
    for i, element in enumerate(orbit.moving):
        first = place.first + 1 + _POWERS * i
        rate = hy.par[first + _POWERS - 1]
        for power in reversed(range(_POWERS - 1)):
            rate = hy.par[first + power] + u * rate
        rates[element] = rate
        if element == LONGITUDE:  # enters through K alone
            continue
        names.append(_name(element, tag))
        values[element] = hy.make_vars(names[-1])
        derivatives.append(rate)
        initial.append(begin[element] / _unit(orbit, element))
    constants = {x: begin[x] for x in ("k", "h", "q", "p") if x not in values}

    def carried(name: str) -> Symbolic:
        return values[name] if name in values else as_factor(rounded(number(constants[name])))

    k, h, q, p = (carried(x) for x in ("k", "h", "q", "p"))
    axis = values.get(AXIS, hy.expression(1.0))
    c, s = hy.make_vars(f"cos_longitude{tag}", f"sin_longitude{tag}")
    radius = 1.0 - k * c - h * s
    if LONGITUDE in rates:
        motion = rates[LONGITUDE]
    else:
        mean = orbit.motion(orbit.semi_major_axis)
        motion = as_factor(number(context.ldexp(mean, time_exponent)))
        if AXIS in values and orbit.motion(2 * orbit.semi_major_axis) != mean:
            motion = motion * (1.0 / (axis * hy.sqrt(axis)))
    turning = motion + rates.get("k", hy.expression(0.0)) * s - rates.get("h", hy.expression(0.0)) * c
    turning = turning / radius
    eccentric = orbit.eccentric_longitude(begin, orbit.starting_longitude(start))
    names += [f"cos_longitude{tag}", f"sin_longitude{tag}"]
    derivatives += [-(turning * s), turning * c]
    initial += [context.cos(eccentric), context.sin(eccentric)]
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
    normal = [2.0 * (p * chi), -2.0 * (q * chi), 1.0 - 2.0 * (p * p + q * q)]
    block = StateBlock(names, derivatives, initial, [hy.sqrt(c * c + s * s)])
    return OrbitStates(block, direction, normal, inverse / axis)


def _unit(orbit: TabulatedOrbit, element: str) -> Any:
    """What an element is carried in: axes in their mean."""
    return orbit.semi_major_axis if element == AXIS else orbit.context.one


class Pieces:
    """What changes in the equations at given times: parameters, and states that are set.

    Attributes:
        knots: times (internal units, working precision) at which it does, ascending, after the start.
    """

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

    def number_at(self, time: Any) -> int:
        """Of the piece from a time on (internal units, working precision)."""
        return bisect_right(self.knots, time)

    def parameters(self, number: int) -> list[Any]:
        """All of them in a piece, working precision."""
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
        """Those that are set where a piece begins, by name, working precision."""
        found: dict[str, Any] = {}
        for orbit, row in self._rows[number - 1].items() if number else ():
            tag, begin = self._places[orbit].tag, orbit.row(row)
            found[_name("part", tag)] = orbit.context.zero
            for element in orbit.moving:
                if element != LONGITUDE:
                    found[_name(element, tag)] = begin[element] / _unit(orbit, element)
            if LONGITUDE in orbit.moving:
                turned = orbit.eccentric_longitude(begin, begin[LONGITUDE])
                found[f"cos_longitude{tag}"] = orbit.context.cos(turned)
                found[f"sin_longitude{tag}"] = orbit.context.sin(turned)
        return {name: self._number(value) for name, value in found.items()}

    def _row(self, orbit: TabulatedOrbit, number: int) -> int:
        """Of a table, with which a piece begins or in whose span it lies."""
        for before in range(number - 1, -1, -1):
            if orbit in self._rows[before]:
                return self._rows[before][orbit]
        return orbit.number_at(self._start)

    def _of(self, orbit: TabulatedOrbit, row: int) -> list[Any]:
        times, piece = orbit.table.times, orbit.piece(row)
        context = orbit.context
        inverse = 1 / context.ldexp(times[row + 1] - times[row], -self._exponent)
        found = [inverse]
        for element in orbit.moving:
            scale = inverse / _unit(orbit, element)
            found += [power * c * scale for power, c in enumerate(piece[element]) if power]
        return found
