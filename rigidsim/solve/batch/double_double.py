"""Arithmetic on arrays of numbers in two parts (some 31 digits), each with a bound of its error.

Two parts and their error-free sums and products: Dekker 1971, Numer. Math. 18, 224; Hida, Li & Bailey 2001,
Proc. 15th IEEE Symp. Computer Arithmetic, 155. Their operations are wrong by a few 2^-104 of the result;
bounds here take 2^-100, and are zero where nothing was rounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Array = Any  # float64: an array, or a number for all members

_OWN = 2.0**-100
_UNDERFLOW = 2.0**-960
"""Size below which products lose their second parts; such a small result is never trusted."""
_SPLITTER = 2.0**27 + 1
_SPARE = 1 + 2.0**-40  # for the roundings of the bounds themselves


@dataclass(frozen=True)
class Doubled:
    """``high + low``, wrong by ``error`` at most; ``high`` is the double nearest to the sum of both."""

    high: Array
    low: Array
    error: Array

    def at(self, index: np.ndarray) -> Doubled:
        """Some of the numbers, in the order given; a number for all stays as it is."""
        if np.ndim(self.high) == 0:
            return self
        low, error = (np.broadcast_to(part, self.high.shape)[index] for part in (self.low, self.error))
        return Doubled(self.high[index], low, error)


def _two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    total = a + b
    of_b = total - a
    return total, (a - (total - of_b)) + (b - of_b)


def _quick_two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    total = a + b
    return total, b - (total - a)


def _two_product(a: Array, b: Array) -> tuple[Array, Array]:
    product = a * b
    a_split, b_split = _SPLITTER * a, _SPLITTER * b
    a_high, b_high = a_split - (a_split - a), b_split - (b_split - b)
    a_low, b_low = a - a_high, b - b_high
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def add(x: Doubled, y: Doubled) -> Doubled:
    """Sum."""
    s, e = _two_sum(x.high, y.high)
    t, f = _two_sum(x.low, y.low)
    s, e = _quick_two_sum(s, e + t)
    s, e = _quick_two_sum(s, e + f)
    whole = (x.low == 0) & (y.low == 0)
    return Doubled(s, e, (x.error + y.error) * _SPARE + np.where(whole, 0.0, _OWN * np.abs(s)))


def negative(x: Doubled) -> Doubled:
    """Negative, exactly."""
    return Doubled(-x.high, -x.low, x.error)


def subtract(x: Doubled, y: Doubled) -> Doubled:
    """Difference."""
    return add(x, negative(y))


def multiply(x: Doubled, y: Doubled) -> Doubled:
    """Product."""
    p, e = _two_product(x.high, y.high)
    p, e = _quick_two_sum(p, e + (x.high * y.low + x.low * y.high))
    size = np.abs(p)
    whole = (x.low == 0) & (y.low == 0)
    own = np.where(
        whole & ((size > _UNDERFLOW) | (x.high == 0) | (y.high == 0)), 0.0, _OWN * size + _UNDERFLOW
    )
    carried = np.abs(x.high) * y.error + np.abs(y.high) * x.error + 2 * x.error * y.error
    return Doubled(p, e, carried * _SPARE + own)


def scale(x: Doubled, factor: Array) -> Doubled:
    """Product with a power of two, exactly."""
    tiny = np.where(np.abs(x.high * factor) > _UNDERFLOW, 0.0, _UNDERFLOW)
    return Doubled(x.high * factor, x.low * factor, x.error * factor + np.where(x.high == 0, 0.0, tiny))


def divide(x: Doubled, y: Doubled) -> Doubled:
    """Quotient, by three digits of a long division."""
    q = x.high / y.high
    rest = subtract(x, _times(y, q))
    q1 = rest.high / y.high
    rest = subtract(rest, _times(y, q1))
    high, low = _quick_two_sum(q, q1)
    found = add(Doubled(high, low, 0.0), Doubled(rest.high / y.high, 0.0, 0.0))
    size = np.abs(found.high)
    room = np.abs(y.high) - 2 * y.error
    carried = (x.error + size * y.error) / np.where(room > 0, room, 0.0) * _SPARE
    return Doubled(found.high, found.low, 2 * carried + _OWN * size + _UNDERFLOW)


def _times(x: Doubled, factor: Array) -> Doubled:
    p, e = _two_product(x.high, factor)
    p, e = _quick_two_sum(p, e + x.low * factor)
    return Doubled(p, e, 0.0)


def root(x: Doubled) -> Doubled:
    """Square root, by one step of Newton's method from that of the first part."""
    near = np.sqrt(x.high)
    p, e = _two_product(near, near)
    rest = subtract(x, Doubled(p, e, 0.0))
    zero = x.high == 0
    step = np.where(zero, 0.0, rest.high / np.where(zero, 1.0, 2 * near))
    high, low = _quick_two_sum(near, step)
    # Newton's own error is step^2 / (2 near), far below the last bit of the second part
    carried = np.where(x.error == 0, 0.0, x.error / np.where(zero, 0.0, near))
    return Doubled(high, low, np.where(zero & (x.error == 0), 0.0, carried * _SPARE + _OWN * np.abs(high)))


def absolute(x: Doubled) -> Doubled:
    """Absolute value."""
    sign = np.where(x.high < 0, -1.0, 1.0)
    return Doubled(x.high * sign, x.low * sign, x.error)


def extreme(x: Doubled, y: Doubled, *, largest: bool) -> Doubled:
    """The larger or smaller of two; if they can't be told apart, either may stand for both."""
    difference = subtract(x, y)
    first = difference.high > 0 if largest else difference.high < 0
    own = np.where(first, x.error, y.error)
    unsure = np.abs(difference.high) <= 2 * difference.error
    error = np.where(unsure, np.maximum(x.error, y.error) + 2 * np.abs(difference.high), own)
    return Doubled(np.where(first, x.high, y.high), np.where(first, x.low, y.low), error)


def sign_of(x: Doubled) -> tuple[Array, Array]:
    """Sign (-1, 0 or 1), and whether it is certain."""
    certain = (np.abs(x.high) > 2 * x.error) | ((x.error == 0) & np.isfinite(x.high))
    return np.sign(x.high), certain & np.isfinite(x.error)


def nearest_double(x: Doubled) -> tuple[Array, Array]:
    """The double nearest to the exact number, and whether that is certain."""
    gap = np.spacing(np.nextafter(np.abs(x.high), 0.0)) / 2
    certain = ((x.error == 0) & (x.low == 0)) | (np.abs(x.low) + 2 * x.error < gap)
    return x.high, certain & np.isfinite(x.high) & np.isfinite(x.error)
