"""Random draws of a sweep's axes, which depend on seed, key, index and component alone.

So an axis that is prolonged keeps the values that it had, and any process can draw any of them.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from fractions import Fraction
from statistics import NormalDist
from typing import Protocol

import numpy as np

DRAWN = 10**14
"""Draws from the normal distribution are rounded to this fraction of the deviation: fewer digits than double
precision has, so that mathematical libraries that differ in the last bit give the same draws.
"""
PLACES = 10**18
"""Number of equal parts into which uniform draws divide the interval from 0 to 1."""


class Draw(Protocol):
    """Draws from a distribution, whole numbers below 2^62 in size."""

    def __call__(self, index: int) -> int:
        """The draw of a value's index."""

    def many(self, indices: np.ndarray) -> np.ndarray:
        """Draws of many indices, (indices,) int64; they take two thirds of the time."""


class Uniform:
    """Uniform draws between 0 and 1, both excluded, in units of ``1 / (2 PLACES)``."""

    def __init__(self, seed: int, key: str, component: int) -> None:
        self._begun = hashlib.blake2b(f"{seed}\n{key}\n".encode(), digest_size=8)
        self._component = component

    def _digest(self, index: int) -> bytes:
        name = self._begun.copy()
        name.update(b"%d\n%d" % (index, self._component))
        return name.digest()

    def __call__(self, index: int) -> int:
        """See ``Draw``."""
        return 2 * (int.from_bytes(self._digest(index), "big") * PLACES >> 64) + 1

    def many(self, indices: np.ndarray) -> np.ndarray:
        """See ``Draw``."""
        words = np.frombuffer(b"".join(map(self._digest, indices.tolist())), dtype=">u8")
        return 2 * _high_words(words.astype(np.uint64), PLACES).astype(np.int64) + 1


def _high_words(words: np.ndarray, factor: int) -> np.ndarray:
    """The upper 64 bits of products of 64-bit numbers, by halves, uint64."""
    half, mask = np.uint64(32), np.uint64(2**32 - 1)
    above, below = np.uint64(factor >> 32), np.uint64(factor & 2**32 - 1)
    high, low = words >> half, words & mask
    middle, other = high * below, low * above
    carried = (low * below >> half) + (middle & mask) + (other & mask)
    found: np.ndarray = high * above + (middle >> half) + (other >> half) + (carried >> half)
    return found


_quantile = NormalDist().inv_cdf  # Wichura 1988, algorithm AS 241


class Normal:
    """Normal draws of mean 0 and deviation 1, in units of ``1 / DRAWN``."""

    def __init__(self, seed: int, key: str, component: int) -> None:
        self._shares = Uniform(seed, key, component)

    def __call__(self, index: int) -> int:
        """See ``Draw``."""
        return _normal(self._shares(index))

    def many(self, indices: np.ndarray) -> np.ndarray:
        """See ``Draw``."""
        return np.array(list(map(_normal, self._shares.many(indices).tolist())), dtype=np.int64)


def _normal(share: int) -> int:
    """The normal draw below which a uniform one's share of all lies."""
    below = share < PLACES
    size = round(_quantile((share if below else 2 * PLACES - share) / (2 * PLACES)) * DRAWN)
    return size if below else -size


@dataclass(frozen=True)
class DrawnValues:
    """Values ``(first + step * draw) / below`` of whole numbers: fractions take four times as long to add."""

    draw: Draw
    first: int
    step: int
    below: int

    @classmethod
    def of(cls, draw: Draw, first: Fraction, step: Fraction) -> DrawnValues:
        """Values ``first + step * draw``."""
        below = math.lcm(first.denominator, step.denominator)
        return cls(draw, int(first * below), int(step * below), below)

    def times(self, factor: Fraction) -> DrawnValues:
        """All values times a factor."""
        up, down = factor.numerator, factor.denominator
        return DrawnValues(self.draw, self.first * up, self.step * up, self.below * down)

    def value(self, index: int) -> Fraction:
        """A value, exactly."""
        return Fraction(self.first + self.step * self.draw(index), self.below)
