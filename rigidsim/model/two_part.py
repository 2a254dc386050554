"""Coefficients and times in two parts, which keep the digits that the working precision can't hold.

A coefficient rounded once has a fixed error, and so have the motion's frequencies: its phase errs by eps t.
Where invariants are projected nothing else grows as fast, so there each product c x becomes hi x + lo x.

``hi`` has half the digits, not all: next to a product rounded to the last bit a part below half of that bit
would always be rounded away again. With half the digits lo x reaches well into the sum, hi + lo is c to half
as many digits again as the working precision has, and what is rounded is the product alone, to either side.

heyoka's time is a sum of two numbers, of which equations see the first alone. Where something abrupt happens
at a moment c, the second is a parameter, and slope (t - c) becomes

    slope ((time - c_high) + (low - c_low)),

whose first difference is exact near c: the closer to the moment, the smaller is the error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.scene.arithmetic import negligible
from rigidsim.scene.expressions.tree import LineInTime

_MOST_PARTS = 64  # doubles in a number of any precision that is in use


@dataclass(frozen=True)
class TwoPart:
    """A constant that is split into two parts wherever it multiplies an expression."""

    high: Any
    low: Any
    single: Any  # the nearest scalar, for sums, whose own rounding varies from time to time anyway

    def __mul__(self, other: Any) -> Any:
        if not isinstance(other, hy.expression):
            return TwoPart(self.high * other, self.low * other, self.single * other)
        return hy.sum([self.high * other, self.low * other])

    __rmul__ = __mul__

    def __neg__(self) -> TwoPart:
        return TwoPart(-self.high, -self.low, -self.single)

    def __add__(self, other: Any) -> Any:
        return self.single + other

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self.single - other

    def __rsub__(self, other: Any) -> Any:
        return other - self.single


def as_factor(constant: Any) -> Any:
    """A constant only used as a factor: in two parts, or an expression (0 and 1 vanish from products)."""
    return constant if isinstance(constant, TwoPart) else hy.expression(constant)


def rounded(constant: Any) -> Any:
    """A constant for any use, as one scalar."""
    return constant.single if isinstance(constant, TwoPart) else constant


def in_two_parts(
    number: Callable[[Any], Any], exact: Callable[[Any], Any], bits: int, context: Any
) -> Callable[[Any], Any]:
    """``number`` extended to two-part coefficients; a constant that it holds exactly stays a plain scalar.

    ``exact`` is from a scalar to its mpf; the context has more than twice the digits of ``bits``.
    """

    def split(value: Any) -> Any:
        single = number(value)
        if abs(value - context.mpf(exact(single))) <= abs(value) * negligible(context):
            return single  # exact, up to the scene's own rounding
        mantissa, exponent = context.frexp(value)
        high = context.ldexp(context.nint(context.ldexp(mantissa, bits // 2)), exponent - bits // 2)
        return TwoPart(number(high), number(value - high), single)

    return split


# --- time ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class TwoPartTime:
    """The scene's time in two numbers."""

    unit: Any  # internal unit of time, s (mpf)
    low: Any  # the parameter that holds what the engine's time leaves out, internal units

    def expression(self, line: LineInTime, number: Callable[[Any], Any], context: Any) -> Any:
        """A line as an expression of the engine's time."""
        slope = rounded(number(line.slope * self.unit))
        if line.offset == 0:
            return slope * hy.time
        zero = line.zero / self.unit
        high, low = in_two_numbers(zero, number, context)
        # heyoka adds constants within a sum up: a product keeps the two sums apart
        if isinstance(slope, hy.expression) or slope != 1:
            return hy.sum([slope * (hy.time - high), slope * (self.low - low)])
        half = rounded(number(context.one / 2))
        return hy.sum([2.0 * (half * hy.time - half * high), 2.0 * (half * self.low - half * low)])


def in_two_numbers(value: Any, number: Callable[[Any], Any], context: Any) -> tuple[Any, Any]:
    """The nearest scalar to an mpf and the one nearest to the rest; a swept number has no rest."""
    high = rounded(number(value))
    if isinstance(high, hy.expression):
        return high, hy.expression(0.0)
    return high, rounded(number(value - exactly(high, context)))


def exactly(scalar: Any, context: Any) -> Any:
    """A scalar of any precision as an mpf, in doubles from the largest on."""
    total, rest = context.zero, scalar
    for _ in range(_MOST_PARTS):
        part = float(rest)
        if part == 0:
            break
        total, rest = total + context.mpf(part), rest - part
    return total
