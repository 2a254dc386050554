"""Conversion of binary numbers of any precision to decimal text from which the same bits can be restored."""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import ROUND_HALF_EVEN, Context, Decimal
from functools import lru_cache

import numpy as np

# Sums of doubles end at 2^-1074 and stay below 2^1025: 1,400 digits hold each exactly.
_EXACT = Context(prec=1400, Emax=10**6, Emin=-(10**6))


def digits_for(bits: int) -> int:
    """Significant digits after which reading back at ``bits`` of precision gives the same number.

    Goldberg 1991, theorem 15: 10^(N-1) > 2^bits.
    """
    return math.ceil(bits * math.log10(2)) + 1


def exact(parts: Sequence[float]) -> Decimal:
    """Exact sum of finite doubles, smallest first."""
    total = Decimal(parts[-1])
    for part in reversed(parts[:-1]):
        total = _EXACT.add(total, Decimal(part))
    return total


def texts(parts: Sequence[np.ndarray], bits: int) -> list[str]:
    """Numbers with as many digits as their precision needs; ``nan``, ``inf`` and ``-0.0`` unchanged.

    Args:
        parts: float64 arrays of the same shape (rows,), the nearest double first.
        bits: bits of the significand; up to 53, the shortest text that gives the same double is used.
    """
    if len(parts) == 1:
        return [repr(value) for value in parts[0].tolist()]
    enough = digits_for(bits)
    contexts = [_rounding(enough - 2), _rounding(enough - 1), _rounding(enough)]
    found = []
    for row in zip(*(part.tolist() for part in parts), strict=True):
        if math.isfinite(row[0]) and row[0] != 0.0:
            found.append(_shown(_short(exact(row), row[0], bits, contexts)))
        else:
            found.append(repr(row[0]))
    return found


def _rounding(digits: int) -> Context:
    return Context(prec=max(digits, 17), rounding=ROUND_HALF_EVEN, Emax=10**6, Emin=-(10**6))


def _short(value: Decimal, lead: float, bits: int, contexts: Sequence[Context]) -> Decimal:
    """The value with the fewest of these digits that still identify it: 0.3 rather than 0.2999...9996."""
    quarter = _power_of_two(math.frexp(lead)[1] - bits - 2)  # of the spacing, also just below a power of two
    for context in contexts[:-1]:
        short = context.plus(value)
        if abs(_EXACT.subtract(short, value)) < quarter:
            return short.normalize(context)
    return contexts[-1].plus(value).normalize(contexts[-1])


@lru_cache(maxsize=4096)
def _power_of_two(exponent: int) -> Decimal:
    return _EXACT.power(Decimal(2), exponent)


def _shown(value: Decimal) -> str:
    """Text of a value, without an exponent if that is short."""
    return f"{value:f}" if -7 <= value.adjusted() < 17 else f"{value:e}"


def decimals(parts: Sequence[np.ndarray], bits: int) -> list[Decimal]:
    """The numbers of ``texts`` as decimals; callers have refused values that aren't finite."""
    return [Decimal(text) for text in texts(parts, bits)]
