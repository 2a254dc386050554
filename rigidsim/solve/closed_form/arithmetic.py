"""Closed-form rotations, and the arithmetics that evaluate them: float64 arrays, and mpmath at any precision.

Formulas are written once, for either. What differs is how a phase is reduced: in double, rate
and time are pairs hi + lo, so that turns are counted to some 30 digits and nothing is lost at 1e8 radians.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from rigidsim.scene.arithmetic import Matrix, cross, dot

Pair = tuple[Any, Any]
"""Real and imaginary part, or high and low part, of a number."""


class Digits:
    """Arithmetic in mpmath, in a separate context; times are mpf."""

    def __init__(self, context: Any) -> None:
        self._context = context
        self.bits = context.prec
        self.exp, self.cos, self.sin = context.exp, context.cos, context.sin
        self.sqrt, self.floor = context.sqrt, context.floor

    def number(self, value: Any) -> Any:
        return self._context.mpf(value)

    def sinh_scaled(self, k: int, z: Any, grown: Any, shrunk: Any) -> Any:
        """c sinh(k z) exp(-abs(z)) from grown, shrunk = c exp(+-k abs(z) - abs(z)), accurate near zero."""
        context = self._context
        size = abs(k * z)
        if size >= 1 or size == 0:
            return context.sign(z) * (grown - shrunk) / 2
        return context.sinh(k * z) / context.cosh(k * z) * (grown + shrunk) / 2

    def elapsed(self, time: Any) -> Any:
        """A time as a plain number."""
        return time

    def reduced(self, time: Any, rate: Any, offset: Any) -> Pair:
        """Whole number nearest to ``rate * time + offset`` (constants in mpf), and the remainder."""
        whole = self.number(rate) * time + self.number(offset)
        count = self._context.nint(whole)
        return count, whole - count

    def angle(self, time: Any, rate: Any, count: Any, step: Any, offset: Any) -> Any:
        """``rate * time + step * count + offset`` in radians, up to whole turns; constants in mpf, rad."""
        return self.number(rate) * time + self.number(step) * count + self.number(offset)


class Doubles:
    """Arithmetic in arrays of float64; times are pairs hi + lo of arrays (Dekker 1971 for their products)."""

    bits = 53
    exp, cos, sin, sqrt, floor = np.exp, np.cos, np.sin, np.sqrt, np.floor

    def number(self, value: Any) -> float:
        return float(value)

    def sinh_scaled(self, k: int, z: Any, grown: Any, shrunk: Any) -> Any:
        """See ``Digits``; tanh is accurate near zero."""
        return np.tanh(k * z) * (grown + shrunk) / 2

    def elapsed(self, time: Pair) -> Any:
        return time[0]

    def reduced(self, time: Pair, rate: Any, offset: Any) -> Pair:
        high, low = sum_of(product_of(_pair(rate), time), _pair(offset))
        count = np.rint(high)
        high, low = two_sum(high - count, low)  # the difference is exact
        more = np.rint(high)
        return count + more, (high - more) + low

    def angle(self, time: Pair, rate: Any, count: Any, step: Any, offset: Any) -> Any:
        """See ``Digits``; computed in turns until the end, so that whole ones are dropped exactly."""
        turn = 2 * rate.context.pi
        turns = sum_of(product_of(_pair(rate / turn), time), _pair(offset / turn))
        turns = sum_of(turns, product_of(_pair(step / turn), (count, np.zeros_like(count))))
        high, low = two_sum(turns[0] - np.rint(turns[0]), turns[1])
        return 2 * np.pi * ((high - np.rint(high)) + low)


Arithmetic = Digits | Doubles


def two_sum(a: Any, b: Any) -> Pair:
    """a + b exactly, as the nearest double and its error (Knuth)."""
    high = a + b
    back = high - a
    return high, (a - (high - back)) + (b - back)


def sum_of(a: Pair, b: Pair) -> Pair:
    """Sum of two pairs, to about 2^-104 of the larger."""
    high, low = two_sum(a[0], b[0])
    return two_sum(high, low + (a[1] + b[1]))


def product_of(a: Pair, b: Pair) -> Pair:
    """Product of two pairs, to about 2^-102 (Dekker 1971)."""
    high = a[0] * b[0]
    (x, y), (z, w) = _split(a[0]), _split(b[0])
    low = ((x * z - high) + x * w + y * z) + y * w
    return two_sum(high, low + (a[0] * b[1] + a[1] * b[0]))


def _split(a: Any) -> Pair:
    """Split into two halves of 26 bits."""
    big = 134217729.0 * a  # 2^27 + 1
    high = big - (big - a)
    return high, a - high


def _pair(value: Any) -> Pair:
    high = float(value)
    return high, float(value - high)


class NoClosedForm(ValueError):
    """Raised if a scene has no closed form here; the message says why, as the rest of a sentence."""


@dataclass(frozen=True)
class Motion:
    """A rotation in closed form, in the units of time and inertia of the numbers that it was made from."""

    axes: Matrix  # rows are the axes of the frame in which the motion is written (right-handed, body axes)
    title: ClassVar[str] = "rotation"  # name of the motion, for plans and summaries

    def at(self, arithmetic: Arithmetic, time: Any) -> tuple[list[Any], list[Any]]:
        """Rates along ``axes``, and a quaternion from ``axes`` to a frame fixed in space, after the start."""
        raise NotImplementedError


def right_handed(axes: Matrix, flip: int = 1) -> Matrix:
    """The axes, with number ``flip`` reversed if they are left-handed."""
    if dot(cross(axes[0], axes[1]), axes[2]) > 0:
        return axes
    return [[-x for x in axis] if i == flip else axis for i, axis in enumerate(axes)]
