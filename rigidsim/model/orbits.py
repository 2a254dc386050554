"""Orbits of sources carried as states: by Kepler's elements, by a table, under mutual gravity, by a kernel.

So no angle grows with time, and the engine interpolates no table. Rows of a table of elements and blocks of
an ephemeris are times at which parameters and states are set, where steps have to end. Each ``PieceSeries``
numbers its own pieces, the one that contains the start being 0; ``Pieces`` joins several, and their
parameters.

**Kepler orbits.** cos(n t) of a growing time loses digits (engine-notes: 1e-5 rad after 1e5 radians). A
Kepler orbit's eccentric anomaly E enters through c = cos E and s = sin E, which are states:

    E' = n / (1 - e c),   c' = -E' s,   s' = E' c,   r = a (1 - e c),

and so do a moving node and periapsis, each as a pair that turns uniformly. (Kepler; Danby 1988, ch. 6.) In
the plane of the orbit, in units of the semi-major axis, place, velocity and acceleration are, with b = sqrt(1
- e^2),

    (c - e, b s),    (-s, b c) E',    -(n / r)^2 (c - e, b s) / r.

Turns by angles that move uniformly follow by the product rule, the same for expressions and for numbers.

**Tables.** Between two rows of a table each element is a polynomial of u, the elapsed fraction of the
interval:

    u' = 1 / L,    x' = (c_1 + 2 c_2 u + ... + 5 c_5 u^4) / L,

with coefficients that are parameters of the compiled equations. Steps end at the rows, where the parameters
of the next piece take over and the states are put on the values of the table (``TablePieces``): nothing adds
up. The place on the orbit is the eccentric longitude K, carried by its cosine c and sine s as well:

    K' = (l' + k' s - h' c) / (1 - k c - h s),    r = a (1 - k c - h s).

(Equinoctial elements: Broucke & Cefalu 1972, Celestial Mechanics 5, 303.) An average over the orbit takes the
elements alone, and what is added back to one the mean longitude, which enters nothing else: it is carried
from its start in a unit of which the whole table has less than one.

**Point masses** move under mutual gravity,

    x_i' = v_i,    v_i' = sum over j of G M_j (x_j - x_i) / |x_j - x_i|^3,

in the units of length and speed of the scene's flight. Where the coupling is full they feel the body's shape
as well: what a load makes of the body's velocity is taken off theirs in proportion to the masses.

**Bodies of a kernel.** In each block of a series, of length L, with u from -1 to 1,

    u' = 2 / L,    x' = sum over k of c_k (2 / L) T_k'(u),

whose coefficients are parameters: the kernel's own doubles, times a power of two. Where a block ends a step
ends as well; u and x are then put on the next block's values, so that nothing adds up. Series of one block
length share u and the polynomials. Where a load asks for derivatives of a place, they are states, too:

    x' = v,    v' = a,    a' = sum over k of c_k (2 / L)^3 T_k'''(u).

The derivatives of T_k are Gegenbauer's polynomials: T_k^(n) = 2^(n-1) (n-1)! k C_(k-n)^(n) (Abramowitz &
Stegun 1964, 22.5.34 and 22.7.3).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import groupby
from typing import Any, Protocol

import heyoka as hy
import numpy as np

from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder, Scaling
from rigidsim.model.state_blocks import StateBlock
from rigidsim.model.two_part import as_factor, rounded
from rigidsim.scene.arithmetic import bits_in_use, cosine_and_sine
from rigidsim.scene.kepler import regular_place
from rigidsim.scene.kernels.reading import BlockSeries, Ephemeris, RelativeEphemeris, chebyshev, exactly
from rigidsim.scene.orbit_tables import AXIS, LONGITUDE, TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.point_masses import PointMasses
from rigidsim.scene.scene import Scene
from rigidsim.scene.space_axes import ECLIPTIC, obliquity, to_ecliptic

_KEPT = (
    8  # groups of pieces of each series: motions that are followed at the same time may be in different ones
)


class PieceSeries(Protocol):
    """Pieces of one kind.

    Attributes:
        knots: times (ascending, internal units, working precision) at which pieces 1, 2, ... begin.
        at_once: how many pieces' numbers are worked out together.
    """

    knots: list[Any]
    at_once: int = 32

    @property
    def states(self) -> list[str]:
        """Names of the states that are set where a piece begins."""

    def numbers(self, first: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """Of pieces first ... stop-1, in working precision: their parameters, (pieces, parameters), and the
        values on which states are set where they begin, (pieces, states).
        """


class Pieces:
    """Pieces of several series together: one begins wherever one of a series does.

    Attributes:
        series: which they join.
        knots: as in ``PieceSeries``.
    """

    def __init__(self, parts: Sequence[PieceSeries]) -> None:
        self.series = parts
        self.knots: list[Any] = list(parts[0].knots)
        if len(parts) > 1:  # they may have knots at the same time
            self.knots = [knot for knot, _ in groupby(sorted(knot for part in parts for knot in part.knots))]
        self._known: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}

    def number_at(self, time: Any) -> int:
        """Number of the piece that begins at or contains a time (internal units, working precision)."""
        return bisect_right(self.knots, time)

    def parameters(self, number: int) -> np.ndarray:
        """All parameters of a piece, working precision."""
        if len(self.series) == 1:
            return self._of(0, number)[0]
        parts = enumerate(self.series)
        knot = self.knots[number - 1] if number else None
        own = ((place, 0 if knot is None else bisect_right(part.knots, knot)) for place, part in parts)
        return np.concatenate([self._of(*which)[0] for which in own])

    def states(self, number: int) -> dict[str, Any]:
        """Values, by name, of the states that are set where a piece begins, working precision."""
        pairs = ((self.series[place].states, values) for place, values in self.changes(number))
        return {name: value for names, values in pairs for name, value in zip(names, values, strict=True)}

    def following(self, number: int) -> Iterator[tuple[Any, np.ndarray, list[tuple[int, np.ndarray]]]]:
        """Of a piece and all that come after it: where it begins, its parameters, and the changes there; at
        last a knot that nothing reaches.
        """
        while number <= len(self.knots):
            if len(self.series) > 1:
                yield self.knots[number - 1], self.parameters(number), self.changes(number)
                number += 1
            else:
                parameters, states, row = self._group(0, number)
                knots = self.knots[number - 1 : number - 1 + len(parameters) - row]
                for knot, values, changed in zip(knots, parameters[row:], states[row:], strict=True):
                    yield knot, values, [(0, changed)]
                number += len(knots)
        yield math.inf, np.zeros(0), []

    def changes(self, number: int) -> list[tuple[int, np.ndarray]]:
        """The same as arrays, with the number of the series in ``series`` that each belongs to."""
        if number and len(self.series) == 1:
            return [(0, self._of(0, number)[1])]
        found = []
        for place, part in enumerate(self.series) if number else ():
            own = bisect_right(part.knots, self.knots[number - 1])
            if own and part.knots[own - 1] == self.knots[number - 1]:
                found.append((place, self._of(place, own)[1]))
        return found

    def _of(self, place: int, own: int) -> tuple[np.ndarray, np.ndarray]:
        """Parameters, and values of states, of one part's own piece."""
        parameters, states, row = self._group(place, own)
        return parameters[row], states[row]

    def _group(self, place: int, own: int) -> tuple[np.ndarray, np.ndarray, int]:
        """Parameters and values of states of pieces worked out together with one, and its row among them."""
        at_once = self.series[place].at_once
        group, row = divmod(own, at_once)
        if (place, group) not in self._known:
            if len(self._known) >= _KEPT * len(self.series):
                del self._known[next(iter(self._known))]
            part, first = self.series[place], group * at_once
            stop = min(first + at_once, len(part.knots) + 1)
            self._known[place, group] = part.numbers(first, stop)
        return *self._known[place, group], row


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
    piece = orbit.number_at(start)
    begins, ends = orbit.time(piece), orbit.time(piece + 1)
    names, derivatives, initial = [past], [hy.par[place.first]], [(start - begins) / (ends - begins)]
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


class TablePieces(PieceSeries):
    """Pieces of one table, which begin at its rows (see ``rigidsim.model.orbits.PieceSeries``)."""

    at_once = 1024

    def __init__(
        self, orbit: TabulatedOrbit, place: TablePlace, scaling: Scaling, start: Any, number: Rounder
    ) -> None:
        self._orbit, self._place, self._exponent = orbit, place, scaling.time
        self._start, self._number, self._back = start, number, int(scaling.direction < 0)
        first, times = orbit.number_at(start), orbit.table.times
        self._narrow = times.dtype != object and isinstance(number(orbit.context.one), float | np.float32)
        rows = np.arange(1, len(times) - 1)
        rows = rows[rows <= (first - (orbit.time(first) > start))][::-1] if self._back else rows[rows > first]
        if self._narrow:
            knots = np.ldexp(scaling.direction * times[rows], -scaling.time).astype(
                type(number(orbit.context.one))
            )
        else:
            knots = np.array([number(scaling.internal(orbit.time(int(row)), orbit.context)) for row in rows])
        # of rows that the precision can't distinguish the last one counts
        last = np.append(knots[1:] != knots[:-1], np.ones(len(knots[:1]), dtype=bool)).astype(bool)
        self.knots = list(knots[last])
        self._pieces = np.concatenate([[first], rows[last] - self._back])

    @cached_property
    def states(self) -> list[str]:
        """See ``PieceSeries``."""
        return list(self._begin(self._pieces[0]))

    def numbers(self, first: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """See ``PieceSeries``."""
        pieces, context = self._pieces[first:stop].tolist(), self._orbit.context
        if self._narrow:
            return self._in_80_bits(self._pieces[first:stop])
        least = context.ldexp(1, _LEAST * bits_in_use(context))
        parameters = [[self._number(x if abs(x) > least else 0 * x) for x in self._of(one)] for one in pieces]
        states = [[self._number(x) for x in self._begin(one).values()] for one in pieces]
        kind = type(parameters[0][0])
        return np.array(parameters, dtype=kind), np.array(states, dtype=kind)

    def _in_80_bits(self, pieces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same in double or single precision, by arrays of 80 bits: mpf take a hundred times as long."""
        orbit, kind = self._orbit, type(self._number(self._orbit.context.one))
        lengths, found = orbit.narrow_pieces(pieces)
        inverse = np.longdouble(2) ** self._exponent / lengths
        parameters, states = [inverse], list[Any]([np.full(len(pieces), self._back)])
        for element in self._place.elements(orbit):
            scale, c = 1 / np.longdouble(float(_unit(orbit, element))), found[element]
            steps = [power * c[power] * inverse for power in range(1, _POWERS + 1)]
            parameters += steps if scale == 1 else [step * scale for step in steps]
            states.append((sum(c) if self._back else c[0]) * scale)
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
        piece, length = orbit.piece(row), orbit.time(row + 1) - orbit.time(row)
        inverse = 1 / orbit.context.ldexp(length, -self._exponent)
        found = [inverse]
        for element in self._place.elements(orbit):
            scale = inverse / _unit(orbit, element)
            found += [power * c * scale for power, c in enumerate(piece[element]) if power]
        return found


_AXES = "xyz"
Pull = tuple[int, Any, list[Symbolic]]
"""Acceleration of a mass (by index), speed over time: a number (mpf) times expressions."""


class PointMassStates:
    """Point masses' states as expressions."""

    def __init__(self, masses: PointMasses, scaling: Scaling, context: Any, number: Rounder) -> None:
        self.masses, self._scaling, self._context, self._number = masses, scaling, context, number

    @cached_property
    def positions(self) -> list[list[Symbolic]]:
        """Position of each mass, space axes, internal units of length."""
        return [list(hy.make_vars(*(f"{name}_{x}" for x in _AXES))) for name in self.masses.names]

    @cached_property
    def velocities(self) -> list[list[Symbolic]]:
        """Velocity of each mass, space axes, internal units of speed."""
        return [list(hy.make_vars(*(f"{name}_v{x}" for x in _AXES))) for name in self.masses.names]

    @cached_property
    def inverse_distances(self) -> dict[tuple[int, int], Symbolic]:
        """Inverse distance of each pair (i, j), i < j, internal units."""
        found, count = {}, len(self.masses.names)
        for i in range(count):
            for j in range(i + 1, count):
                place = self.between(i, j)
                found[i, j] = 1.0 / hy.sqrt(hy.sum([x * x for x in place]))
        return found

    def between(self, i: int, j: int) -> list[Symbolic]:
        """Vector from mass i to mass j, internal units of length."""
        return [b - a for a, b in zip(self.positions[i], self.positions[j], strict=True)]

    def _accelerations(self, pulls: Sequence[Pull]) -> list[list[Symbolic]]:
        scaling, strengths = self._scaling, self.masses.strengths
        shift = scaling.time - scaling.speed - 2 * scaling.length
        terms: list[list[list[Symbolic]]] = [[[], [], []] for _ in self.masses.names]
        for (i, j), inverse in self.inverse_distances.items():
            place, cubed = self.between(i, j), inverse * inverse * inverse
            own, others = (self._number(self._context.ldexp(strengths[n], shift)) for n in (i, j))
            for a, x in enumerate(place):
                terms[i][a].append(others * (x * cubed))
                terms[j][a].append(-own * (x * cubed))
        for n, factor, pull in pulls:
            for a, x in enumerate(pull):
                terms[n][a].append(x if factor == 1 else self._number(factor) * x)
        return [list(map(hy.sum, three)) for three in terms]

    def relative(self, i: int, j: int) -> tuple[list[Symbolic], list[Symbolic], list[Symbolic]]:
        """Place, velocity and acceleration of mass j as seen from mass i under the mutual gravity of points,
        internal units of length and time.
        """
        scaling = self._scaling
        exponent = scaling.speed + scaling.time - scaling.length
        ratio = self._number(self._context.ldexp(self._context.one, exponent))
        pulled = self._accelerations(())
        pairs = (self.velocities[i], self.velocities[j]), (pulled[i], pulled[j])
        moving = [[ratio * (b - a) for a, b in zip(*pair, strict=True)] for pair in pairs]
        return self.between(i, j), moving[0], moving[1]

    def block(self, pulls: Sequence[Pull] = ()) -> StateBlock:
        """One block with the states of all masses, which feel these pulls of the body's shape."""
        context, scaling, masses = self._context, self._scaling, self.masses
        ratio = self._number(context.ldexp(context.one, scaling.speed + scaling.time - scaling.length))
        names: list[str] = []
        derivatives: list[Symbolic] = []
        initial: list[Any] = []
        accelerations = self._accelerations(pulls)
        for n, name in enumerate(masses.names):
            names += [f"{name}_{x}" for x in _AXES] + [f"{name}_v{x}" for x in _AXES]
            derivatives += [ratio * v for v in self.velocities[n]] + accelerations[n]
            initial += [context.ldexp(x, -scaling.length) for x in masses.positions[n]]
            initial += [context.ldexp(v, -scaling.speed) for v in masses.velocities[n]]
        exponents = ([scaling.length] * 3 + [scaling.speed] * 3) * len(masses.names)
        why = "[[bodies]]: point masses under mutual gravity"
        if pulls:
            why += ", and gravity of the body's shape"
        return StateBlock(names, derivatives, initial, exponents=exponents, why=why)


_RATES = ("", "v", "a", "j")
_BEYOND = 100  # blocks after the end of a run, whose own steps go past its last sample


@dataclass
class _Blocks:
    """Series of one block length."""

    tag: str
    first: int  # index of the first parameter
    begin: Fraction  # of the first block, seconds since J2000
    length: Fraction
    series: list[tuple[BlockSeries, int]] = field(default_factory=list)  # and the highest derivative carried
    _polynomials: dict[int, list[Symbolic]] = field(default_factory=dict)

    @property
    def past(self) -> str:
        """Name of the state u."""
        return f"kernel_part{self.tag}"

    @property
    def parameters(self) -> int:
        """Number of parameters."""
        return sum(3 * (one.terms - order - 1) for one, order in self.series)


class KernelStates:
    """States of the series that a scene's loads see, as expressions; parameters follow from ``first`` on."""

    def __init__(
        self,
        ephemeris: Ephemeris,
        given: Sequence[tuple[RelativeEphemeris, int]],
        scaling: Scaling,
        start: Any,
        context: Any,
        number: Rounder,
        first: int,
    ) -> None:
        self.ephemeris, self._exponent, self._start = ephemeris, scaling.time, start
        self._scaling = scaling
        self._context, self._number = context, number
        self.sights = list(dict.fromkeys(sight for sight, _ in given))
        orders: dict[int, int] = {}
        found: dict[int, BlockSeries] = {}
        for sight, order in given:
            for _, series in sight.links:
                found[id(series)] = series
                orders[id(series)] = max(orders.get(id(series), 0), order)
        self._groups: list[_Blocks] = []
        self._group_of: dict[int, tuple[_Blocks, int, int]] = {}  # and first parameter, and order
        for one in sorted(found.values(), key=lambda x: (x.length, x.begin % x.length)):
            group = self._groups[-1] if self._groups else None
            if group is None or one.length != group.length or (one.begin - group.begin) % one.length:
                past = first if group is None else group.first + group.parameters
                group = _Blocks(str(len(self._groups) + 1), past, one.begin, one.length)
                self._groups.append(group)
            self._group_of[id(one)] = group, group.first + group.parameters, orders[id(one)]
            group.series.append((one, orders[id(one)]))

    # --- expressions --------------------------------------------------------------------------------------

    def seen(self, sight: RelativeEphemeris, order: int = 0) -> list[Symbolic]:
        """Vector of a sight in space axes, in units of 2^``sight.exponent`` km, or a derivative of it per
        internal unit of time.

        Derivatives beyond those that a load asks for (``SceneLoad.sights``) are no functions of the states:
        equations may use them, what is recorded may not.
        """
        rows: list[list[Symbolic]] = [[], [], []]
        for factor, series in sight.links:
            size = self._rounded(exactly(self._context, factor), series.exponent - sight.exponent)
            for row, axis in zip(rows, range(3), strict=True):
                row.append(size * self._component(series, axis, order))
        found = [row[0] if len(row) == 1 else hy.sum(row) for row in rows]
        if self.ephemeris.axes != ECLIPTIC:
            return found
        c, s = (self._rounded(value) for value in obliquity(self._context))
        return to_ecliptic(found, (c, s))

    def _rounded(self, value: Any, exponent: int = 0) -> Symbolic:
        return as_factor(rounded(self._number(self._context.ldexp(value, exponent))))

    def _component(self, series: BlockSeries, axis: int, order: int) -> Symbolic:
        group, first, carried = self._group_of[id(series)]
        if order <= carried:
            return hy.make_vars(_kernel_name(series, axis, order))
        values = self._polynomials(group, order)
        at = first + axis * (series.terms - carried - 1) - carried - 1
        return hy.sum([hy.par[at + k] * values[k] for k in range(order, series.terms)])

    def _polynomials(self, group: _Blocks, order: int) -> list[Symbolic]:
        """(2 / L)^n T_k^(n)(u) of a group's largest number of terms; zeros up to k = n - 1."""
        known = group._polynomials
        if order not in known:
            n, u = order, hy.make_vars(group.past)
            terms = max(series.terms for series, _ in group.series)
            own = [hy.expression(1.0), 2.0 * n * u]
            for j in range(2, terms - n):
                one, two = (self._ratio(x, j) for x in (2 * (j + n - 1), j + 2 * n - 2))
                own.append(one * (u * own[j - 1]) - two * own[j - 2])
            power = exactly(self._context, self._rate(group) ** n * 2 ** (n - 1) * math.factorial(n - 1))
            known[order] = [hy.expression(0.0)] * n + [
                self._rounded(power * (k + n)) * value for k, value in enumerate(own[: terms - n])
            ]
        return known[order]

    def _ratio(self, numerator: int, denominator: int) -> Symbolic:
        return self._rounded(exactly(self._context, Fraction(numerator, denominator)))

    def _rate(self, group: _Blocks) -> Fraction:
        """u', per internal unit of time."""
        return Fraction(2) ** (self._exponent + 1) / group.length

    # --- states -------------------------------------------------------------------------------------------

    @property
    def names(self) -> str:
        """What the series that are carried place, for reasons."""
        targets = [series.target for group in self._groups for series, _ in group.series]
        words = {"earth_moon": "Earth-Moon barycentre", "earth_moon_barycenter": "Earth-Moon barycentre"}
        return ", ".join(words.get(target, target.replace("_", " ").capitalize()) for target in targets)

    def block(self) -> StateBlock:
        """All states, with their equations and values at the start."""
        names: list[str] = []
        derivatives: list[Symbolic] = []
        initial: list[Any] = []
        context, now = self._context, self._start + exactly(self._context, self.ephemeris.ahead)
        for group in self._groups:
            number = group.series[0][0].block_at(now)
            begin = exactly(context, group.series[0][0].begin + number * group.length)
            names.append(group.past)
            derivatives.append(self._rounded(exactly(context, self._rate(group))))
            initial.append(2 * (now - begin) / exactly(context, group.length) - 1)
            for series, carried in group.series:
                for order in range(carried + 1):
                    shift = order * self._exponent - series.exponent
                    names += [_kernel_name(series, axis, order) for axis in range(3)]
                    derivatives += [self._component(series, axis, order + 1) for axis in range(3)]
                    initial += [context.ldexp(x, shift) for x in series.at(context, now, order)]
        return StateBlock(
            names,
            [hy.expression(x) for x in derivatives],
            initial,
            why=f"positions of {self.names} by {self.ephemeris.kernel.name}, and the time within their "
            "blocks",
        )

    def pieces(self) -> list[PieceSeries]:
        """What is set at the edges of blocks."""
        return [self._pieces(group) for group in self._groups]

    def _pieces(self, group: _Blocks) -> BlockPieces:
        context, ahead = self._context, self.ephemeris.ahead
        now, one = self._start + exactly(context, ahead), group.series[0][0]
        begun, back = one.block_at(now), self._scaling.direction < 0
        end = one.block_at(self.ephemeris.run[1] + exactly(context, ahead))
        if back:
            first = max(math.ceil((series.begin - one.begin) / one.length) for series, _ in group.series)
            edges = range(begun, max(first, end - _BEYOND), -1)
        else:
            last = min(math.ceil((series.end - one.begin) / one.length) for series, _ in group.series)
            edges = range(begun + 1, min(last, end + _BEYOND))
        times = (exactly(context, one.begin + edge * group.length - ahead) for edge in edges)
        knots = [self._number(self._scaling.internal(time, context)) for time in times]
        return BlockPieces(group, begun, knots, self._scaling, context, self._number)


class BlockPieces(PieceSeries):
    """Blocks of series of one length (see ``rigidsim.model.orbits.PieceSeries``)."""

    def __init__(
        self, group: _Blocks, begun: int, knots: list[Any], scaling: Scaling, context: Any, number: Rounder
    ) -> None:
        self.knots, self._group, self._context, self._number = knots, group, context, number
        self._step = scaling.direction
        self._series = []
        for series, carried in group.series:
            behind = round((group.series[0][0].begin - series.begin) / group.length)
            self._series.append((series, carried, begun + behind))
        rate = exactly(context, Fraction(2) ** (scaling.time + 1) / group.length)
        entered = -scaling.direction * context.one  # u where blocks are entered
        self._ends = {
            (series.terms, order): [rate**order * x for x in chebyshev(context, entered, series.terms, order)]
            for series, carried, _ in self._series
            for order in range(carried + 1)
        }
        self._rounded_ends = {key: np.array(list(map(float, x))) for key, x in self._ends.items()}
        self._rows = [np.asarray(series.coefficients) for series, _ in group.series]  # a memmap is slow
        self._kind: Any = type(number(context.one))

    @cached_property
    def states(self) -> list[str]:
        """See ``PieceSeries``."""
        names = [self._group.past]
        for series, carried, _ in self._series:
            names += [_kernel_name(series, axis, order) for order in range(carried + 1) for axis in range(3)]
        return names

    def numbers(self, first: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """See ``PieceSeries``: u is -1 where a block begins and 1 where it ends, and its parameters are the
        coefficients, each of which is a double times a power of two.
        """
        parameters, states = [], [self._exact(np.full((stop - first, 1), -float(self._step)))]
        for (series, carried, begun), rows in zip(self._series, self._rows, strict=True):
            blocks = rows[begun + self._step * np.arange(first, stop)]
            scaled = np.ldexp(blocks[:, :, carried + 1 :], -series.exponent)
            parameters.append(self._exact(scaled.reshape(len(blocks), -1)))
            states += [self._at_edges(series, blocks, order) for order in range(carried + 1)]
        return np.concatenate(parameters, axis=1), np.concatenate(states, axis=1)

    def _exact(self, values: np.ndarray) -> np.ndarray:
        if issubclass(self._kind, float | np.floating):
            return values.astype(self._kind)
        numbers = [self._number(self._context.mpf(float(x))) for x in values.flat]
        return np.array(numbers, dtype=self._kind).reshape(values.shape)

    def _at_edges(self, series: BlockSeries, blocks: np.ndarray, order: int) -> np.ndarray:
        """Values of three states where blocks are entered, rounded once; derivatives in double precision
        are sums of rounded products, since mpf take longer than all steps of a run.
        """
        rows, shape = blocks.reshape(-1, series.terms), blocks.shape[:2]
        if self._kind in (float, np.float64):
            sums = [math.fsum(row) for row in (rows * self._rounded_ends[series.terms, order]).tolist()]
            return np.ldexp(sums, -series.exponent).reshape(shape)
        weights, context = self._ends[series.terms, order], self._context
        found = []
        for row in rows:
            total = sum((context.mpf(float(c)) * w for c, w in zip(row, weights, strict=True)), context.zero)
            found.append(self._number(context.ldexp(total, -series.exponent)))
        return np.array(found, dtype=self._kind).reshape(shape)


@lru_cache(maxsize=512)
def _kernel_name(series: BlockSeries, axis: int, order: int) -> str:
    return f"kernel_{series.target}_{_RATES[order]}{_AXES[axis]}"


def sights_of(scene: Scene) -> list[RelativeEphemeris]:
    """The bodies of a kernel that a scene's loads see."""
    return list(dict.fromkeys(sight for load in scene.loads for sight, _ in load.sights))
