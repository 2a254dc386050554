"""Random values of a sweep's axes, and directions on a sphere.

Random values depend on seed, key, index and component alone: an axis that is prolonged keeps the values that
it had, and any process can draw any of them.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cache
from statistics import NormalDist
from typing import Any

from rigidsim.scene.exact import ExactNumber, fraction_of
from rigidsim.scene.sweeps.written import DIGITS, AxisValues, Entry, Written, alike, long_context, rounded

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


def random_values(way: str, given: Sequence[Any], count: int, key: str, seed: int, length: int) -> AxisValues:
    """Values drawn at random; ``way`` is "uniform" or "normal". Raises ValueError for what can't be."""
    vectors = [value for value in given if isinstance(value, list)]
    components = len(vectors[0]) if vectors else 0
    if any(len(vector) != components for vector in vectors):
        raise ValueError(f"given vectors of different lengths in {way}")
    if length and not vectors:
        raise ValueError(f"the key takes a vector of {length}; give vectors, such as {way} = {_SUCH_AS[way]}")
    pairs = [
        alike(*(value[i] if isinstance(value, list) else value for value in given))
        for i in range(components or 1)
    ]
    if way == "uniform" and any(low[0] > high[0] for low, high in pairs):
        raise ValueError("the first end of a uniform interval must not be above the second")
    if way == "normal" and any(deviation[0] < 0 for _, deviation in pairs):
        raise ValueError("a standard deviation of zero or more is allowed")

    lines = []
    for k, ((first, power, unit), (second, *_)) in enumerate(pairs):
        if way == "uniform":
            draw, step = _uniform(seed, key, k), (second - first) / (2 * _PLACES)
        else:
            draw, step = _normal(seed, key, k), second / _DEVIATION
        below = math.lcm(first.denominator, step.denominator)  # sums of fractions take four times as long
        lines.append((draw, int(first * below), int(step * below), below, power, unit))

    def entry(index: int) -> Entry:
        return tuple(
            Written(ExactNumber(Fraction(first + step * draw(index), below), power), unit)
            for draw, first, step, below, power, unit in lines
        )

    return AxisValues(count, components, entry)


def random_directions(radius: Written, key: str, seed: int, length: int) -> Callable[[int], Entry]:
    """Random points of uniform density on a sphere: normal draws scaled to its radius."""
    normals = [_normal(seed, key, component) for component in range(length)]

    def entry(index: int) -> Entry:
        whole = [draw(index) for draw in normals]
        norm = math.isqrt(sum(n * n for n in whole) * _WIDE**2)
        unit = [Fraction((2 * n * _WIDE * _UNIT + norm) // (2 * norm), _UNIT) for n in whole]
        return _scaled(radius, unit)

    return entry


def grid_of_directions(radius: Written, polar: int, azimuths: int) -> Callable[[int], Entry]:
    """Centres of cells of equal area on a sphere; the azimuth varies fastest."""
    context = long_context()

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
        return _scaled(radius, [rounded(sine * x), rounded(sine * y), rounded(cosine)])

    return entry


def _scaled(radius: Written, unit: Sequence[Fraction]) -> Entry:
    factor, power = radius.number.rational, radius.number.pi_power
    return tuple(Written(ExactNumber(factor * x, power), radius.unit) for x in unit)
