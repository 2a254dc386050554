"""Values that a table of ``[sweep] axes`` asks for, or an axis given with a command.

Random values depend on seed, key, index and component alone: an axis that is prolonged keeps the values that
it had, and any process can draw any of them.
"""

import hashlib
import math
import re
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from statistics import NormalDist
from typing import Any

import mpmath

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import ExactNumber, fraction_of, parse_number
from rigidsim.scene.python_values import inline
from rigidsim.scene.sweep_table import LARGEST_AXIS, AxisTable
from rigidsim.scene.validation_messages import shown

_PRODUCT = re.compile(r"[\d.)i]\s*\*\s*[A-Za-z]")
_CALL = re.compile(r"(linspace|logspace|step|uniform|normal|sphere)\s*\((.*)\)")
_SPECS = (
    "[1, 2, 4], linspace(from, to, count), logspace(from, to, count), step(from, step, count), "
    "uniform(from, to, count), normal(mean, deviation, count), sphere(radius, count), or a table such as "
    '{values = [1, 2], name = "a"}'
)

Entry = tuple[ExactNumber, ...]


@dataclass(frozen=True)
class AxisValues:
    """Values of an axis: by their index, either the numbers of each, or the TOML text of what is none. A
    value is the same number whatever else the axis holds, so that its values identify a member.
    """

    count: int
    components: int  # of each value; 0 for plain numbers, and for values that aren't numbers
    entry: Callable[[int], Entry] | None
    word: Callable[[int], str] | None = None

    def text(self, index: int) -> str:
        """A value as written in a config, which identifies it."""
        if self.entry is None:
            assert self.word is not None
            return self.word(index)
        texts = [number.text for number in self.entry(index)]
        return f"[{', '.join(texts)}]" if self.components else texts[0]


def axis_values(table: AxisTable, key: str, seed: int, length: int, unit: str = "") -> AxisValues:
    """The values that a table of ``[sweep] axes`` asks for; ValueError says what is allowed.

    The key takes a vector of so many components (0: a number) in an SI unit ("1": none, as expressions do).
    """
    given = getattr(table, table.way)
    if table.way == "values":
        return _listed(given, products=unit == "1")
    if table.way == "sphere":
        if length < 3:
            raise ValueError("sphere is for keys that take a vector, such as initial.angular_velocity")
        radius = parse_number(given)
        if radius.sign <= 0:
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
        return _random_values(table.way, given, _counted(table.count), key, seed, length)
    count = _counted(given[2])
    if table.way == "step":
        first, step = _alike(given[0], given[1])
        return _numbers(count, lambda i: first.rational + i * step.rational, first)
    if count < 2:
        raise ValueError(f"given a count of {count}; at least 2 are needed, both ends being included")
    first, last = _alike(given[0], given[1])
    if table.way == "linspace":
        width = last.rational - first.rational
        return _numbers(count, lambda i: first.rational + width * i / (count - 1), first)
    if first.sign * last.sign <= 0:
        raise ValueError("both ends of a logspace must be above zero, or both below")
    return _numbers(count, _geometric(first, last, count), first)


def _numbers(count: int, value: Callable[[int], Fraction], like: ExactNumber) -> AxisValues:
    return AxisValues(count, 0, lambda index: (_other(value(index), like),))


def _other(rational: Fraction, like: ExactNumber) -> ExactNumber:
    """Another number in the unit of one."""
    return ExactNumber(rational, like.pi_power, like.unit)


def _alike(*given: Any) -> list[ExactNumber]:
    """Numbers in a common unit, with a common power of pi; ValueError if there is none."""
    numbers = [parse_number(value) for value in given]
    some = [x for x in numbers if x.sign]
    turns, written = {x.pi_power for x in some or numbers[:1]}, {x.unit for x in numbers}
    if len(turns) > 1 or (len(written) > 1 and not all(x.unit for x in some)):
        raise ValueError(f"given {' and '.join(map(shown, given))}; write both in one unit")
    unit, power = written.pop() if len(written) == 1 else "", turns.pop()
    return [ExactNumber(x.rational, power, unit) for x in numbers]


def _counted(count: Any) -> int:
    if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= LARGEST_AXIS:
        raise ValueError(f"given a count of {shown(count)}; whole numbers from 1 to 1e7 are allowed")
    return count


def _listed(given: Sequence[Any], *, products: bool) -> AxisValues:
    """A list's numbers or vectors, otherwise words; ``products``: whether ``2*t`` may be twice the time."""
    if len(given) > LARGEST_AXIS:
        raise ValueError(f"given {len(given)} values; at most 1e7 are allowed")
    try:
        if all(isinstance(value, list) for value in given) and len({len(value) for value in given}) == 1:
            vectors = [tuple(_number(x, products=products) for x in value) for value in given]
            return AxisValues(len(given), len(vectors[0]), vectors.__getitem__)
        numbers = [(_number(value, products=products),) for value in given]
        return AxisValues(len(given), 0, numbers.__getitem__)
    except ValueError:
        if not any(isinstance(value, bool | str | list | dict) for value in given):
            raise  # for instance nan, which no key takes
        words = [inline(value) for value in given]
        return AxisValues(len(given), 0, None, words.__getitem__)


def _number(value: Any, *, products: bool) -> ExactNumber:
    """A number; ValueError for a text that only begins like one: a date, or an expression."""
    number = parse_number(value)
    if number.unit and products and _PRODUCT.search(value):
        raise ValueError("an expression")
    return number


DIGITS = 40
"""Significant decimal digits of values that aren't rational: of logspace, and on a sphere."""


def _context() -> Any:
    """A context in which values that aren't rational are worked out, before they are ``_rounded``."""
    context = mpmath.MPContext()
    context.dps = DIGITS + 20
    return context


def _rounded(value: Fraction) -> Fraction:
    """The nearest number of ``DIGITS`` decimal digits."""
    if not value:
        return value
    size = abs(value)
    magnitude = math.floor(math.log10(size.numerator) - math.log10(size.denominator))
    scale = Fraction(10) ** (DIGITS - 1 - magnitude)
    return round(value * scale) / scale


def _geometric(begin: ExactNumber, end: ExactNumber, count: int) -> Callable[[int], Fraction]:
    """Values between two of one unit, in SI; they are rounded in that unit."""
    context = _context()
    first, last = begin.in_its_unit.rational, end.in_its_unit.rational
    ratio = context.log(context.mpf(last.numerator) / last.denominator * first.denominator / first.numerator)

    @cache
    def value(index: int) -> Fraction:
        if index in (0, count - 1):
            return begin.rational if index == 0 else end.rational
        power = context.exp(ratio * index / (count - 1))
        found = _rounded(fraction_of(power * first.numerator / first.denominator))
        return found * begin.rational / first

    return value


# --- random values, and directions on a sphere --------------------------------------------------------------

_DEVIATION = 10**14
"""Draws from the normal distribution are rounded to this fraction of the deviation: fewer digits than double
precision has, so that mathematical libraries that differ in the last bit give the same draws.
"""
_PLACES = 10**18
"""Number of equal parts into which uniform draws divide the interval from 0 to 1."""
_UNIT, _WIDE = 10**DIGITS, 10 ** (DIGITS + 5)  # of points on a sphere
_SUCH_AS = {"normal": "[[0, 0, 1], [0.1, 0.1, 0.1]]", "uniform": "[[0, 0, 0], [1, 1, 1]]"}

_Draw = Callable[[int], int]
_quantile = NormalDist().inv_cdf  # Wichura 1988, algorithm AS 241


def _uniform(seed: int, key: str, component: int) -> _Draw:
    """Uniform draws between 0 and 1, both excluded, by index, in units of ``1 / (2 _PLACES)``."""
    begun = hashlib.blake2b(f"{seed}\n{key}\n".encode(), digest_size=8)

    def draw(index: int) -> int:
        name = begun.copy()
        name.update(b"%d\n%d" % (index, component))
        return 2 * (int.from_bytes(name.digest(), "big") * _PLACES >> 64) + 1

    return draw


def _normal(seed: int, key: str, component: int) -> _Draw:
    """Normal draws of mean 0 and deviation 1, by index, in units of ``1 / _DEVIATION``."""
    shares = _uniform(seed, key, component)

    def draw(index: int) -> int:
        share = shares(index)
        below = share < _PLACES
        size = round(_quantile((share if below else 2 * _PLACES - share) / (2 * _PLACES)) * _DEVIATION)
        return size if below else -size

    return draw


def _random_values(
    way: str, given: Sequence[Any], count: int, key: str, seed: int, length: int
) -> AxisValues:
    """Values drawn at random; ``way`` is "uniform" or "normal". Raises ValueError for what can't be."""
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
    if way == "uniform" and any(low.rational > high.rational for low, high in pairs):
        raise ValueError("the first end of a uniform interval must not be above the second")
    if way == "normal" and any(deviation.sign < 0 for _, deviation in pairs):
        raise ValueError("a standard deviation of zero or more is allowed")

    lines = []
    for k, (first, second) in enumerate(pairs):
        if way == "uniform":
            draw, step = _uniform(seed, key, k), (second.rational - first.rational) / (2 * _PLACES)
        else:
            draw, step = _normal(seed, key, k), second.rational / _DEVIATION
        below = math.lcm(first.rational.denominator, step.denominator)  # fractions take four times as long
        lines.append((draw, int(first.rational * below), int(step * below), below, first))

    def entry(index: int) -> Entry:
        return tuple(
            _other(Fraction(first + step * draw(index), below), like)
            for draw, first, step, below, like in lines
        )

    return AxisValues(count, components, entry)


def _random_directions(radius: ExactNumber, key: str, seed: int, length: int) -> Callable[[int], Entry]:
    """Random points of uniform density on a sphere: normal draws scaled to its radius."""
    normals = [_normal(seed, key, component) for component in range(length)]

    def entry(index: int) -> Entry:
        whole = [draw(index) for draw in normals]
        norm = math.isqrt(sum(n * n for n in whole) * _WIDE**2)
        unit = [Fraction((2 * n * _WIDE * _UNIT + norm) // (2 * norm), _UNIT) for n in whole]
        return _scaled(radius, unit)

    return entry


def _grid_of_directions(radius: ExactNumber, polar: int, azimuths: int) -> Callable[[int], Entry]:
    """Centres of cells of equal area on a sphere; the azimuth varies fastest."""
    context = _context()

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


def _scaled(radius: ExactNumber, unit: Sequence[Fraction]) -> Entry:
    return tuple(_other(radius.rational * x, radius) for x in unit)


# --- axes given with a command ------------------------------------------------------------------------------


def scanned(experiment: Experiment, scan: Sequence[str]) -> Experiment:
    """An experiment with additional sweep axes, by ``KEY=SPEC`` texts: a TOML array of values, a call such as
    ``linspace(from, to, count)``, or a TOML table as ``[sweep] axes`` has it.
    """
    settings = []
    for text in scan:
        key, equals, spec = (part.strip() for part in text.partition("="))
        if not equals or not key or not spec:
            what = "write KEY=SPEC, such as time.end=[1, 2, 4] or body.mass=linspace(0, 1, 11)"
            raise ConfigError(Problem(f"--sweep {text[:60]}", what))
        table = _table_text(spec)
        try:
            understood = isinstance(tomllib.loads(f"table = {table}")["table"], dict)
        except (ValueError, RecursionError):
            understood = False
        if not understood:
            raise ConfigError(Problem(f"--sweep {text[:60]}", f"given {shown(spec)}; allowed: {_SPECS}"))
        settings.append(f'sweep.axes."{key}"={table}')
    return experiment.having(settings)


def _table_text(spec: str) -> str:
    """The axis's table in TOML, if the text is understood."""
    call = _CALL.fullmatch(spec)
    if call is None:
        return f"{{values = {spec}}}" if spec.startswith("[") else spec
    way, inside = call[1], call[2]
    if way in ("uniform", "normal", "sphere"):
        ends, _, count = inside.rpartition(",")
        return f"{{{way} = {ends if way == 'sphere' else f'[{ends}]'}, count = {count}}}"
    return f"{{{way} = [{inside}]}}"
