"""Random draws of a sweep's axes, which depend on seed, key, index and component alone.

So an axis that is prolonged keeps the values that it had, and any process can draw any of them.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable
from fractions import Fraction
from statistics import NormalDist

from rigidsim.scene.records import dataclass

DRAWN = 10**14
"""Draws from the normal distribution are rounded to this fraction of the deviation: fewer digits than double
precision has, so that mathematical libraries that differ in the last bit give the same draws.
"""
PLACES = 10**18
"""Number of equal parts into which uniform draws divide the interval from 0 to 1."""

Draw = Callable[[int], int]
"""From a value's index to the draw."""


def uniform(seed: int, key: str, component: int) -> Draw:
    """Uniform draws between 0 and 1, both excluded, in units of ``1 / (2 PLACES)``."""
    begun = hashlib.blake2b(f"{seed}\n{key}\n".encode(), digest_size=8)

    def draw(index: int) -> int:
        name = begun.copy()
        name.update(f"{index}\n{component}".encode())
        return 2 * (int.from_bytes(name.digest(), "big") * PLACES >> 64) + 1

    return draw


_quantile = NormalDist().inv_cdf  # Wichura 1988, algorithm AS 241


def normal(seed: int, key: str, component: int) -> Draw:
    """Normal draws of mean 0 and deviation 1, in units of ``1 / DRAWN``."""
    shares = uniform(seed, key, component)

    def draw(index: int) -> int:
        share = shares(index)
        below = share < PLACES
        size = round(_quantile((share if below else 2 * PLACES - share) / (2 * PLACES)) * DRAWN)
        return size if below else -size

    return draw


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

    def numerator(self, index: int) -> int:
        """Numerator of a value."""
        return self.first + self.step * self.draw(index)

    def numerators(self, indices: Iterable[int]) -> list[int]:
        """Numerators of many values."""
        first, step, draw = self.first, self.step, self.draw
        return [first + step * draw(index) for index in indices]
