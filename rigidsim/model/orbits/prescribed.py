"""Prescribed orbits carried as states: Kepler orbits, so that no angle grows with time, and tabulated ones,
so that the engine interpolates no table.

cos(n t) of a growing time loses digits (engine-notes: 1e-5 rad after 1e5 radians). A Kepler orbit's eccentric
anomaly E enters through c = cos E and s = sin E, which are states:

    E' = n / (1 - e c),   c' = -E' s,   s' = E' c,   r = a (1 - e c),

and so do a moving node and periapsis, each as a pair that turns uniformly. (Kepler; Danby 1988, ch. 6.) In
the plane of the orbit, in units of the semi-major axis, place, velocity and acceleration are, with b = sqrt(1
- e^2),

    (c - e, b s),    (-s, b c) E',    -(n / r)^2 (c - e, b s) / r.

Turns by angles that move uniformly follow by the product rule, the same for expressions and for numbers.

Between two rows of a table each element is a polynomial of u, the elapsed fraction of the interval:

    u' = 1 / L,    x' = (c_1 + 2 c_2 u + ... + 5 c_5 u^4) / L,

with coefficients that are parameters of the compiled equations. Steps end at the rows, where the parameters
of the next piece take over and the states are put on the values of the table (``TablePieces``): nothing adds
up. The place on the orbit is the eccentric longitude K, carried by its cosine c and sine s as well:

    K' = (l' + k' s - h' c) / (1 - k c - h s),    r = a (1 - k c - h s).

(Equinoctial elements: Broucke & Cefalu 1972, Celestial Mechanics 5, 303.) An average over the orbit takes the
elements alone, and what is added back to one the mean longitude, which enters nothing else: it is carried
from its start in a unit of which the whole table has less than one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder, Scaling
from rigidsim.model.state_blocks import StateBlock
from rigidsim.model.two_part import as_factor, rounded
from rigidsim.scene.arithmetic import bits_in_use, cosine_and_sine
from rigidsim.scene.kepler import regular_place
from rigidsim.scene.orbit_tables.pieces import AXIS, LONGITUDE, TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit

Series = Sequence[Any]
"""A quantity and its first two derivatives; None for one that is zero for good."""


@dataclass(frozen=True)
class KeplerParts:
    """What the place on an orbit is made of.

    Attributes:
        motion: mean motion.
        anomaly: cosine and sine of the eccentric anomaly.
        inverse: semi-major axis over distance.
        periapsis, node: cosine, sine and rate of the angle; a rate of None if it rests.
        tilt: cosine and sine of the inclination.
    """

    eccentricity: Any
    root: Any  # sqrt(1 - e^2)
    motion: Any
    anomaly: tuple[Any, Any]
    inverse: Any
    periapsis: tuple[Any, Any, Any]
    node: tuple[Any, Any, Any]
    tilt: tuple[Any, Any]

    @classmethod
    def at(cls, orbit: KeplerOrbit, context: Any, time: Any) -> KeplerParts:
        """Parts at a time in s; numbers are mpf, SI."""
        e, anomaly = orbit.eccentricity, orbit.eccentric_anomaly(context, time)

        def turned(angle: Any, rate: Any) -> tuple[Any, Any, Any]:
            there = angle + rate * time
            return *cosine_and_sine(context, there), None if rate == 0 else rate

        return cls(
            e,
            context.sqrt(1 - e * e),
            orbit.mean_motion,
            cosine_and_sine(context, anomaly),
            1 / (1 - e * context.cos(anomaly)),
            turned(orbit.periapsis, orbit.periapsis_rate),
            turned(orbit.ascending_node, orbit.node_rate),
            cosine_and_sine(context, orbit.inclination),
        )

    def motions(self) -> tuple[list[Any], list[Any], list[Any]]:
        """Place, velocity and acceleration, space axes, in units of the semi-major axis."""
        (c, s), pace = self.anomaly, self.motion * self.inverse
        along, across = c - self.eccentricity, self.root * s
        drawn = -(pace * pace * self.inverse)
        x: Series = [along, -(pace * s), drawn * along]
        y: Series = [across, self.root * (pace * c), drawn * across]
        x, y = _turned(x, y, *self.periapsis)
        tilted = [[None if a is None else factor * a for a in y] for factor in self.tilt]
        x, y = _turned(x, tilted[0], *self.node)
        zero = 0.0 * along
        places = [[zero if a is None else a for a in each] for each in (x, y, tilted[1])]
        return tuple(map(list, zip(*places, strict=True)))  # type: ignore[return-value]


def _turned(x: Series, y: Series, c: Any, s: Any, rate: Any) -> tuple[Series, Series]:
    """(c x - s y, s x + c y) for an angle of this rate."""
    cosine, sine = [c, None, None], [s, None, None]
    if rate is not None:
        cosine, sine = [c, -(rate * s), -(rate * rate * c)], [s, rate * c, -(rate * rate * s)]
    minus = [None if a is None else -a for a in sine]
    return _sum(_product(cosine, x), _product(minus, y)), _sum(_product(sine, x), _product(cosine, y))


def _product(a: Series, b: Series) -> Series:
    """By Leibniz' rule."""
    found = []
    for parts in (((1, 0, 0),), ((1, 1, 0), (1, 0, 1)), ((1, 2, 0), (2, 1, 1), (1, 0, 2))):
        terms = [
            a[i] * b[j] if factor == 1 else 2.0 * (a[i] * b[j])
            for factor, i, j in parts
            if a[i] is not None and b[j] is not None
        ]
        found.append(_added(terms))
    return found


def _sum(a: Series, b: Series) -> Series:
    return [_added([x for x in pair if x is not None]) for pair in zip(a, b, strict=True)]


def _added(terms: list[Any]) -> Any:
    if not terms:
        return None
    found = terms[0]
    for x in terms[1:]:
        found = found + x
    return found


_POWERS = 5  # of the polynomials; as many parameters for each element
_LEAST = -5
"""Exponent, in bits of the working precision, of what is set to zero: elements are of order one, so that
anything smaller is a remnant of a zero and could underflow single precision.
"""


@dataclass(frozen=True)
class OrbitStates:
    """The part of a system of equations that carries an orbit; vectors in space axes."""

    block: StateBlock  # its norms stay 1, since each pair of states is a cosine and a sine
    direction: list[Symbolic]  # unit vector towards the attracting body
    normal: list[Symbolic]  # of the plane; the attracting body moves about it directly
    inverse_distance: Symbolic  # semi-major axis over distance, 1 for a circle
    parts: KeplerParts | None = None  # of a Kepler orbit, from which its motion follows
    eccentric: tuple[Symbolic, Symbolic] | None = (
        None  # e cos and e sin of the longitude of periapsis as given
    )


def orbit_states(
    orbit: KeplerOrbit, tag: str, time_unit: Any, start: Any, context: Any, number: Rounder
) -> OrbitStates:
    """Carry a Kepler orbit as states, whose names end with a tag; start and unit of time in s (mpf)."""
    names: list[str] = []
    derivatives: list[Symbolic] = []
    initial: list[Any] = []
    norms: list[Symbolic] = []

    def constant(value: Any) -> Symbolic:
        return as_factor(number(value))  # exact 0 and 1 vanish from products

    def pair(name: str, angle: Any, rate: Symbolic | None) -> tuple[Symbolic, Symbolic]:
        """Cosine and sine of an angle: constants if it is fixed, two states if it moves."""
        cosine, sine = cosine_and_sine(context, angle)
        if rate is None:
            return constant(cosine), constant(sine)
        c, s = hy.make_vars(f"cos_{name}{tag}", f"sin_{name}{tag}")
        names.extend((str(c), str(s)))
        derivatives.extend((-(rate * s), rate * c))
        initial.extend((cosine, sine))
        norms.append(hy.sqrt(c * c + s * s))
        return c, s

    def uniform(rate: Any) -> Symbolic | None:
        return None if rate == 0 else constant(rate * time_unit)

    e = orbit.eccentricity
    anomaly = orbit.eccentric_anomaly(context, start)
    motion = constant(orbit.mean_motion * time_unit)
    if orbit.circular:
        c, s = pair("anomaly", anomaly, motion)
        inverse = hy.expression(1.0)
        along, across = c, s
    else:
        c = hy.make_vars(f"cos_anomaly{tag}")
        inverse = 1.0 / (1.0 - number(e) * c)
        c, s = pair("anomaly", anomaly, motion * inverse)
        along = (c - number(e)) * inverse
        across = number(context.sqrt(1 - e * e)) * s * inverse
    w_c, w_s = pair(
        "periapsis", orbit.periapsis + orbit.periapsis_rate * start, uniform(orbit.periapsis_rate)
    )
    n_c, n_s = pair("node", orbit.ascending_node + orbit.node_rate * start, uniform(orbit.node_rate))
    i_c, i_s = map(constant, cosine_and_sine(context, orbit.inclination))
    # R3(node) R1(inclination) R3(periapsis) (cos, sin, 0) of the true anomaly
    x = w_c * along - w_s * across
    y = w_s * along + w_c * across
    direction = [n_c * x - n_s * (i_c * y), n_s * x + n_c * (i_c * y), i_s * y]
    normal = [n_s * i_s, -(n_c * i_s), i_c]
    eccentricity, root = rounded(number(e)), rounded(number(context.sqrt(1 - e * e)))
    turns = [(w_c, w_s, uniform(orbit.periapsis_rate)), (n_c, n_s, uniform(orbit.node_rate))]
    parts = KeplerParts(eccentricity, root, motion, (c, s), inverse, turns[0], turns[1], (i_c, i_s))
    block = StateBlock(names, derivatives, initial, norms)
    eccentric = eccentricity * (n_c * w_c - n_s * w_s), eccentricity * (n_s * w_c + n_c * w_s)
    return OrbitStates(block, direction, normal, inverse, parts, eccentric)


# --- tables -------------------------------------------------------------------------------------------------


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

    def parameters(self, orbit: TabulatedOrbit) -> int:
        """Number of its parameters."""
        return 1 + _POWERS * len(self.elements(orbit))


def places_of(
    orbits: Sequence[tuple[str, TabulatedOrbit]], longitude: Carried, first: int
) -> dict[TabulatedOrbit, TablePlace]:
    """Places of the given orbits, with their tags; an orbit that occurs twice gets one place. ``first`` is
    the index of the first parameter.
    """
    found: dict[TabulatedOrbit, TablePlace] = {}
    for tag, orbit in orbits:
        if orbit not in found:
            found[orbit] = TablePlace(tag, first, longitude)
            first += found[orbit].parameters(orbit)
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
    side: float  # -1 for elements that are the body's own, whose periapsis is half a turn away

    @property
    def eccentric(self) -> tuple[Symbolic, Symbolic]:
        """e cos and e sin of the longitude of periapsis as the table gives it."""
        return self.side * rounded(self.values["k"]), self.side * rounded(self.values["h"])

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
    block, side = StateBlock(names, derivatives, initial), -1.0 if orbit.opposite else 1.0
    return ElementStates(block, values, rates, motion, pace, longitude, side)


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
    direction = regular_place(hy, (k, h, q, p), (c, s), inverse)
    block = StateBlock(
        [*found.block.names, f"cos_longitude{tag}", f"sin_longitude{tag}"],
        [*found.block.derivatives, -(turning * s), turning * c],
        [*found.block.initial, context.cos(eccentric), context.sin(eccentric)],
        [hy.sqrt(c * c + s * s)],
    )
    return OrbitStates(block, direction, found.normal, inverse / axis, eccentric=found.eccentric)


def _unit(orbit: TabulatedOrbit, element: str) -> Any:
    """Unit in which an element is carried: the mean axis for axes, 1 for the rest."""
    return orbit.semi_major_axis if element == AXIS else orbit.context.one


class TablePieces:
    """Pieces of one table, which begin at its rows (see ``rigidsim.model.orbits.pieces.PieceSeries``)."""

    def __init__(
        self, orbit: TabulatedOrbit, place: TablePlace, scaling: Scaling, start: Any, number: Rounder
    ) -> None:
        self._orbit, self._place, self._exponent = orbit, place, scaling.time
        self._start, self._number, self._back = start, number, int(scaling.direction < 0)
        self.knots: list[Any] = []
        self._pieces = [orbit.number_at(start)]
        inner = list(enumerate(orbit.table.times))[1:-1]
        for row, time in reversed(inner) if self._back else inner:
            if time <= start if self._back else time > start:
                knot = number(scaling.internal(time, orbit.context))
                if self.knots and knot == self.knots[-1]:  # rows that the precision can't distinguish
                    self._pieces[-1] = row - self._back
                else:
                    self.knots.append(knot)
                    self._pieces.append(row - self._back)

    @cached_property
    def states(self) -> list[str]:
        """See ``PieceSeries``."""
        return list(self._begin(self._pieces[0]))

    def numbers(self, first: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """See ``PieceSeries``."""
        pieces, context = self._pieces[first:stop], self._orbit.context
        if LONGITUDE not in self._orbit.moving and isinstance(self._number(context.one), float | np.float32):
            return self._narrow(np.array(pieces))
        least = context.ldexp(1, _LEAST * bits_in_use(context))
        parameters = [[self._number(x if abs(x) > least else 0 * x) for x in self._of(one)] for one in pieces]
        states = [[self._number(x) for x in self._begin(one).values()] for one in pieces]
        kind = type(parameters[0][0])
        return np.array(parameters, dtype=kind), np.array(states, dtype=kind)

    def _narrow(self, pieces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same in double or single precision, by arrays of 80 bits: mpf take a hundred times as long."""
        orbit, kind = self._orbit, type(self._number(self._orbit.context.one))
        lengths, found = orbit.narrow_pieces(pieces)
        inverse = np.longdouble(2) ** self._exponent / lengths
        parameters, states = [inverse], [np.full(len(pieces), self._back)]
        for element in self._place.elements(orbit):
            scale, c = 1 / np.longdouble(float(_unit(orbit, element))), found[element]
            parameters += [power * c[:, power] * inverse * scale for power in range(1, _POWERS + 1)]
            states.append((c.sum(axis=1) if self._back else c[:, 0]) * scale)
        rows = np.array(parameters).T
        rows[np.abs(rows) <= np.longdouble(2) ** (_LEAST * bits_in_use(orbit.context))] = 0
        return rows.astype(kind), np.array(states).T.astype(kind)

    def _begin(self, piece: int) -> dict[str, Any]:
        """Values of states by name at the row where a piece is entered: its end in a run that goes back."""
        found: dict[str, Any] = {}
        orbit, place = self._orbit, self._place
        begin, tag, elements = orbit.row(piece + self._back), place.tag, place.elements(orbit)
        found[_name("part", tag)] = orbit.context.mpf(self._back)
        for element in elements:
            if element != LONGITUDE:
                found[_name(element, tag)] = begin[element] / _unit(orbit, element)
        if LONGITUDE in elements and place.longitude is Carried.MEAN:
            since = begin[LONGITUDE] - orbit.starting_longitude(self._start)
            found[_name(LONGITUDE, tag)] = orbit.context.ldexp(since, -orbit.longitude_exponent)
        elif LONGITUDE in elements:
            turned = orbit.eccentric_longitude(begin, begin[LONGITUDE])
            found[f"cos_longitude{tag}"] = orbit.context.cos(turned)
            found[f"sin_longitude{tag}"] = orbit.context.sin(turned)
        return found

    def _of(self, row: int) -> list[Any]:
        orbit = self._orbit
        times, piece = orbit.table.times, orbit.piece(row)
        inverse = 1 / orbit.context.ldexp(times[row + 1] - times[row], -self._exponent)
        found = [inverse]
        for element in self._place.elements(orbit):
            scale = inverse / _unit(orbit, element)
            found += [power * c * scale for power, c in enumerate(piece[element]) if power]
        return found
