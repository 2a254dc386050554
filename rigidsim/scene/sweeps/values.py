"""Values of a sweep's axis: exact numbers, each with its text in a config.

A value is the same number whatever else the axis holds, so that its values identify a member: an axis that
is prolonged keeps those that it had, random ones included, which depend on seed, key and index alone.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath

from rigidsim.scene.exact import ExactNumber, fraction_of
from rigidsim.scene.sweep_table import LARGEST_AXIS, AxisTable
from rigidsim.scene.sweeps import draws
from rigidsim.scene.sweeps.draws import DrawnValues
from rigidsim.scene.sweeps.written import Written
from rigidsim.scene.units import UnitError, to_si
from rigidsim.scene.validation_messages import shown

_PRODUCT = re.compile(r"[\d.)i]\s*\*\s*[A-Za-z]")
DIGITS = 40
"""Significant decimal digits of values that aren't rational: of logspace, and on a sphere."""


Entry = tuple[Written, ...]


@dataclass(frozen=True)
class AxisValues:
    """Values of an axis.

    Attributes:
        count: number of values.
        components: components of each value; 0 for plain numbers, and for values that aren't numbers.
        entry: function that gives the numbers of a value; None if values aren't numbers.
        word: function that gives the TOML text of a value that isn't a number; None for numbers.
        drawn: each component as numbers drawn at random, SI, of which many at once take a fraction of the
            time; None where they aren't drawn, or are multiples of pi.
    """

    count: int
    components: int
    entry: Callable[[int], Entry] | None
    word: Callable[[int], str] | None = None
    drawn: tuple[DrawnValues, ...] | None = None

    def text(self, index: int) -> str:
        """A value as written in a config, which identifies it."""
        if self.entry is None:
            assert self.word is not None
            return self.word(index)
        texts = [number.text for number in self.entry(index)]
        return f"[{', '.join(texts)}]" if self.components else texts[0]


def axis_values(table: AxisTable, key: str, seed: int, length: int, unit: str = "") -> AxisValues:
    """The values that a table of ``[sweep] axes`` asks for.

    Args:
        key: the swept key.
        seed: seed of random values.
        length: components of the vector that the key takes; 0 if it takes a number.
        unit: SI unit of what the key takes; "1" for none, as of expressions.

    Raises:
        ValueError: says what was given, and what is allowed.
    """
    given = getattr(table, table.way)
    if table.way == "values":
        return _listed(given, products=unit == "1")
    if table.way == "sphere":
        if length < 3:
            raise ValueError("sphere is for keys that take a vector, such as initial.angular_velocity")
        radius = Written.of(given)
        if radius.number.sign <= 0:
            raise ValueError(f"given {shown(given)}; a radius above zero is allowed")
        if table.grid is None:
            assert table.count is not None
            return AxisValues(_counted(table.count), length, _random_directions(radius, key, seed, length))
        if length != 3:
            raise ValueError("a grid on the sphere is for vectors of three; give count for random ones")
        polar, azimuths = table.grid
        return AxisValues(_counted(polar * azimuths), 3, _grid_of_directions(radius, polar, azimuths))
    if table.way in ("normal", "uniform"):
        assert table.count is not None
        return _random(table.way, given, _counted(table.count), key, seed, length)
    count = _counted(given[2])
    if table.way == "step":
        first, step = _alike(given[0], given[1])
        return _numbers(count, lambda i: first[0] + i * step[0], first)
    if count < 2:
        raise ValueError(f"given a count of {count}; at least 2 are needed, both ends being included")
    first, last = _alike(given[0], given[1])
    if table.way == "linspace":
        width = last[0] - first[0]
        return _numbers(count, lambda i: first[0] + width * i / (count - 1), first)
    if first[0] * last[0] <= 0:
        raise ValueError("both ends of a logspace must be above zero, or both below")
    return _numbers(count, _geometric(first[0], last[0], count), first)


Rational = tuple[Fraction, int, str]
"""A rational number with its power of pi and its unit."""


def _numbers(count: int, value: Callable[[int], Fraction], like: Rational) -> AxisValues:
    def entry(index: int) -> Entry:
        return (Written(ExactNumber(value(index), like[1]), like[2]),)

    return AxisValues(count, 0, entry)


def _alike(*given: Any) -> tuple[Rational, ...]:
    """Numbers in a common unit, times a common power of pi.

    Raises:
        ValueError: there is no such common form.
    """
    written = [Written.of(value) for value in given]
    if len({w.unit for w in written}) > 1 or len({w.number.pi_power for w in written if w.number.sign}) > 1:
        if not all(w.unit for w in written if w.number.sign):
            raise ValueError(f"given {' and '.join(map(shown, given))}; write both in one unit")
        written = [Written(w.exact) for w in written]
    turns = {w.number.pi_power for w in written if w.number.sign}
    if len(turns) > 1:
        raise ValueError(f"given {' and '.join(map(shown, given))}; write both in one unit")
    power = turns.pop() if turns else 0
    return tuple((w.number.rational, power, w.unit) for w in written)


def _counted(count: Any) -> int:
    if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= LARGEST_AXIS:
        raise ValueError(f"given a count of {shown(count)}; whole numbers from 1 to 1e7 are allowed")
    return count


def _listed(given: Sequence[Any], *, products: bool) -> AxisValues:
    """A list's values: numbers or vectors if all can be read as such, otherwise anything that a config may
    hold.

    Args:
        products: whether ``2*t`` may be twice the time, instead of two tons.
    """
    from rigidsim.scene.python_values import inline_text

    if len(given) > LARGEST_AXIS:
        raise ValueError(f"given {len(given)} values; at most 1e7 are allowed")
    try:
        if all(isinstance(value, list) for value in given) and len({len(value) for value in given}) == 1:
            vectors = [tuple(Written.of(x) for x in value) for value in given]
            _refuse_what_is_none((x for value in given for x in value), products=products)
            return AxisValues(len(given), len(vectors[0]), vectors.__getitem__)
        numbers = [(Written.of(value),) for value in given]
        _refuse_what_is_none(given, products=products)
        return AxisValues(len(given), 0, numbers.__getitem__)
    except ValueError:
        if not any(isinstance(value, bool | str | list | dict) for value in given):
            raise  # for instance nan, which no key takes
        words = [inline_text(value) for value in given]
        return AxisValues(len(given), 0, None, words.__getitem__)


def _refuse_what_is_none(given: Iterable[Any], *, products: bool) -> None:
    """Raise ValueError for texts that only begin like numbers: a date, or an expression."""
    units = set()
    for value in given:
        if isinstance(value, str):
            unit = Written.of(value).unit
            if unit and products and _PRODUCT.search(value):
                raise ValueError("an expression")
            units.add(unit)
    for unit in units - {""}:
        to_si(unit)


def _geometric(first: Fraction, last: Fraction, count: int) -> Callable[[int], Fraction]:
    context = mpmath.MPContext()
    context.dps = DIGITS + 20
    ratio = context.log(context.mpf(last.numerator) / last.denominator * first.denominator / first.numerator)

    @cache
    def value(index: int) -> Fraction:
        if index in (0, count - 1):
            return first if index == 0 else last
        power = context.exp(ratio * index / (count - 1))
        return _rounded(fraction_of(power * first.numerator / first.denominator))

    return value


def _rounded(value: Fraction) -> Fraction:
    """The nearest number of ``DIGITS`` decimal digits."""
    if not value:
        return value
    size = abs(value)
    magnitude = math.floor(math.log10(size.numerator) - math.log10(size.denominator))
    places = DIGITS - 1 - magnitude
    scale = Fraction(10) ** places
    return round(value * scale) / scale


_UNIT, _WIDE = 10**DIGITS, 10 ** (DIGITS + 5)

# --- random values ------------------------------------------------------------------------------------------


def _random(way: str, given: Sequence[Any], count: int, key: str, seed: int, length: int) -> AxisValues:
    vectors = [value for value in given if isinstance(value, list)]
    components = len(vectors[0]) if vectors else 0
    if any(len(vector) != components for vector in vectors):
        raise ValueError(f"given vectors of different lengths in {way}")
    if length and not vectors:
        raise ValueError(f"the key takes a vector of {length}; give vectors, such as {way} = {_SUCH_AS[way]}")
    pairs = [
        _alike(*(value[i] if isinstance(value, list) else value for value in given))
        for i in range(components or 1)
    ]
    if way == "uniform" and any(low[0] > high[0] for low, high in pairs):
        raise ValueError("the first end of a uniform interval must not be above the second")
    if way == "normal" and any(deviation[0] < 0 for _, deviation in pairs):
        raise ValueError("a standard deviation of zero or more is allowed")

    uniform = way == "uniform"
    drawn, parts = (draws.Uniform, 2 * draws.PLACES) if uniform else (draws.Normal, draws.DRAWN)
    lines = []
    for k, (a, b) in enumerate(pairs):
        step = (b[0] - a[0] if uniform else b[0]) / parts
        lines.append((DrawnValues.of(drawn(seed, key, k), a[0], step), a[1], a[2]))

    def entry(index: int) -> Entry:
        return tuple(Written(ExactNumber(line.value(index), power), unit) for line, power, unit in lines)

    return AxisValues(count, components, entry, drawn=_in_si(lines))


def _in_si(lines: Sequence[tuple[DrawnValues, int, str]]) -> tuple[DrawnValues, ...] | None:
    """See ``AxisValues``."""
    made = []
    for line, power, unit in lines:
        try:
            factor, turns = to_si(unit) if unit else (Fraction(1), 0)
        except UnitError:  # told when a value is asked for
            return None
        if power + turns:
            return None
        made.append(line.times(factor))
    return tuple(made)


_SUCH_AS = {"normal": "[[0, 0, 1], [0.1, 0.1, 0.1]]", "uniform": "[[0, 0, 0], [1, 1, 1]]"}


def _random_directions(radius: Written, key: str, seed: int, length: int) -> Callable[[int], Entry]:
    """Random points of uniform density on a sphere: normal draws scaled to its radius."""

    normals = [draws.Normal(seed, key, component) for component in range(length)]

    def entry(index: int) -> Entry:
        whole = [draw(index) for draw in normals]
        norm = math.isqrt(sum(n * n for n in whole) * _WIDE**2)
        unit = [Fraction((2 * n * _WIDE * _UNIT + norm) // (2 * norm), _UNIT) for n in whole]
        return _scaled(radius, unit)

    return entry


def _grid_of_directions(radius: Written, polar: int, azimuths: int) -> Callable[[int], Entry]:
    """Centres of cells of equal area on a sphere; the azimuth varies fastest."""
    context = mpmath.MPContext()
    context.dps = DIGITS + 20

    @cache
    def sine_and_cosine(j: int) -> tuple[Fraction, Fraction]:
        cosine = 1 - Fraction(2 * j + 1, polar)
        square = 1 - cosine * cosine
        return fraction_of(context.sqrt(context.mpf(square.numerator) / square.denominator)), cosine

    @cache
    def around(k: int) -> tuple[Fraction, Fraction]:
        angle = context.mpf(2 * k + 1) / azimuths
        return fraction_of(context.cospi(angle)), fraction_of(context.sinpi(angle))

    def entry(index: int) -> Entry:
        sine, cosine = sine_and_cosine(index // azimuths)
        x, y = around(index % azimuths)
        return _scaled(radius, [_rounded(sine * x), _rounded(sine * y), _rounded(cosine)])

    return entry


def _scaled(radius: Written, unit: Sequence[Fraction]) -> Entry:
    factor, power = radius.number.rational, radius.number.pi_power
    return tuple(Written(ExactNumber(factor * x, power), radius.unit) for x in unit)
