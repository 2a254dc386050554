"""Values that a table of ``[sweep] axes`` asks for, or an axis given with a command."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from functools import cache
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import ExactNumber, fraction_of
from rigidsim.scene.python_values import inline_text
from rigidsim.scene.sweep_table import LARGEST_AXIS, AxisTable
from rigidsim.scene.sweeps.draws import grid_of_directions, random_directions, random_values
from rigidsim.scene.sweeps.written import AxisValues, Entry, Rational, Written, alike, long_context, rounded
from rigidsim.scene.units import to_si
from rigidsim.scene.validation_messages import shown

_PRODUCT = re.compile(r"[\d.)i]\s*\*\s*[A-Za-z]")
_CALL = re.compile(r"(linspace|logspace|step|uniform|normal|sphere)\s*\((.*)\)")
_SPECS = (
    "[1, 2, 4], linspace(from, to, count), logspace(from, to, count), step(from, step, count), "
    "uniform(from, to, count), normal(mean, deviation, count), sphere(radius, count), or a table such as "
    '{values = [1, 2], name = "a"}'
)


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
            return AxisValues(_counted(table.count), length, random_directions(radius, key, seed, length))
        if length != 3:
            raise ValueError("a grid on the sphere is for vectors of three; give count for random ones")
        polar, azimuths = table.grid
        return AxisValues(_counted(polar * azimuths), 3, grid_of_directions(radius, polar, azimuths))
    if table.way in ("normal", "uniform"):
        assert table.count is not None
        return random_values(table.way, given, _counted(table.count), key, seed, length)
    count = _counted(given[2])
    if table.way == "step":
        first, step = alike(given[0], given[1])
        return _numbers(count, lambda i: first[0] + i * step[0], first)
    if count < 2:
        raise ValueError(f"given a count of {count}; at least 2 are needed, both ends being included")
    first, last = alike(given[0], given[1])
    if table.way == "linspace":
        width = last[0] - first[0]
        return _numbers(count, lambda i: first[0] + width * i / (count - 1), first)
    if first[0] * last[0] <= 0:
        raise ValueError("both ends of a logspace must be above zero, or both below")
    return _numbers(count, _geometric(first[0], last[0], count), first)


def _numbers(count: int, value: Callable[[int], Fraction], like: Rational) -> AxisValues:
    def entry(index: int) -> Entry:
        return (Written(ExactNumber(value(index), like[1]), like[2]),)

    return AxisValues(count, 0, entry)


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
    context = long_context()
    ratio = context.log(context.mpf(last.numerator) / last.denominator * first.denominator / first.numerator)

    @cache
    def value(index: int) -> Fraction:
        if index in (0, count - 1):
            return first if index == 0 else last
        power = context.exp(ratio * index / (count - 1))
        return rounded(fraction_of(power * first.numerator / first.denominator))

    return value


def scanned(experiment: Experiment, scan: Sequence[str]) -> Experiment:
    """An experiment with additional sweep axes.

    Args:
        scan: ``KEY=SPEC`` texts: a TOML array of values, a call such as ``linspace(from, to, count)`` (see
            the error's text), or a TOML table as ``[sweep] axes`` has it.

    Raises:
        ConfigError: a text can't be read.
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
