"""Time within expressions, to twice the digits of the working precision.

heyoka's time is a sum of two numbers, of which equations see the first alone. Where something abrupt happens
at a moment c, the second is a parameter, and slope (t - c) becomes

    slope ((time - c_high) + (low - c_low)),

whose first difference is exact near c: the closer to the moment, the smaller is the error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.numbers import Rounder
from rigidsim.model.rotations import Symbolic
from rigidsim.model.two_part import rounded
from rigidsim.scene.expressions.lines import LineInTime

_MOST_PARTS = 64  # doubles in a number of any precision that is in use


@dataclass(frozen=True)
class TwoPartTime:
    """The scene's time in two numbers.

    Attributes:
        unit: internal unit of time, s (mpf).
        low: the parameter that holds what the engine's time leaves out, internal units.
    """

    unit: Any
    low: Symbolic

    def expression(self, line: LineInTime, number: Rounder, context: Any) -> Symbolic:
        """A line as an expression of the engine's time.

        Args:
            number: rounds an mpf once to the working precision's scalar.
        """
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


def in_two_numbers(value: Any, number: Rounder, context: Any) -> tuple[Any, Any]:
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
