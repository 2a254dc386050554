"""Principal moments that are equal to the rounding of the numbers that a body was given by.

A symmetric body's tensor in axes that aren't its own is written with rounded elements: worked out from them,
its two equal moments differ by a rounding, and their axes are made of it. A program's output has 15 to 17
digits, and was rounded several times on its way; numbers of fewer digits are taken as they stand, as are
moments along the body axes, whose axes nothing has to tell. More digits are as good as they say.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Any

from pydantic import BaseModel

from rigidsim.scene.arithmetic import Matrix, Vector, diagonal
from rigidsim.scene.exact import ExactNumber

_DIGITS_OF_DOUBLES = range(15, 18)
_DOUBLE = Fraction(1, 2**52)
_ROUNDINGS = 16
"""Spacings of the largest moment by which equal moments may differ. An element of R I R^T that was worked out
in the precision in which it was written is off by some three half spacings (sums of three products), a moment
by the spectral norm of these errors, at most three times the largest, and the difference of two by twice
that: nine spacings. The rest is for an R that isn't quite orthogonal.
"""


def rounding_of(table: BaseModel) -> Fraction:
    """Relative rounding of the coarsest number of a table that looks rounded; 0 if none does."""
    return max((_rounding(number) for number in _numbers(table)), default=Fraction(0))


def merged(
    context: Any, inertia: Matrix, moments: Vector, axes: Matrix, rounding: Fraction
) -> tuple[Matrix, Vector, Matrix]:
    """A tensor, its principal moments and axes (rows), with moments made equal that differ by the relative
    ``rounding`` of the numbers that they are made of.
    """
    tiny = _ROUNDINGS * context.mpf(rounding.numerator) / rounding.denominator * max(moments)
    low, middle, high = sorted(range(3), key=lambda i: moments[i])
    if moments[high] - moments[low] <= tiny:
        mean = sum(moments, context.zero) / 3
        one = context.one
        return diagonal([mean] * 3), [mean] * 3, diagonal([one] * 3)
    lower, upper = moments[middle] - moments[low], moments[high] - moments[middle]
    if min(lower, upper) > tiny or min(lower, upper) == 0:
        return inertia, moments, axes
    single, pair = (high, (low, middle)) if lower < upper else (low, (middle, high))
    mean = (moments[pair[0]] + moments[pair[1]]) / 2
    equal = [moments[i] if i == single else mean for i in range(3)]
    axis, more = axes[single], moments[single] - mean
    return (
        [[(mean if i == j else context.zero) + more * axis[i] * axis[j] for j in range(3)] for i in range(3)],
        equal,
        axes,
    )


def _numbers(part: Any) -> Iterator[ExactNumber]:
    if isinstance(part, ExactNumber):
        yield part
    elif isinstance(part, BaseModel):
        for _, value in part:
            yield from _numbers(value)
    elif isinstance(part, list | tuple):
        for value in part:
            yield from _numbers(value)


def _rounding(number: ExactNumber) -> Fraction:
    digits = 0 if number.swept else _digits(number.rational)
    if digits in _DIGITS_OF_DOUBLES:
        return _DOUBLE
    return Fraction(1, 10 ** (digits - 1)) if digits >= _DIGITS_OF_DOUBLES.stop else Fraction(0)


def _digits(value: Fraction) -> int:
    """Significant digits of a decimal; 0 for a fraction that isn't one, which is exact."""
    twos = fives = 0
    rest = value.denominator
    while rest % 2 == 0:
        rest, twos = rest // 2, twos + 1
    while rest % 5 == 0:
        rest, fives = rest // 5, fives + 1
    if rest != 1 or value == 0:
        return 0
    places = max(twos, fives)
    whole = abs(value.numerator) * 2 ** (places - twos) * 5 ** (places - fives)
    return len(str(whole).rstrip("0"))
