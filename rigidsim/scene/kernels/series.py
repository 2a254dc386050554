"""A Chebyshev series in blocks: the position of one body of a kernel relative to another.

In each block of one length, T_k being Chebyshev's polynomials and u the time in it, from -1 to 1,

    x = c_0 + c_1 T_1(u) + c_2 T_2(u) + ...

The coefficients are doubles, which count exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from rigidsim.scene.arithmetic import Vector


@dataclass(frozen=True, eq=False, repr=False)
class BlockSeries:
    """Position of ``target`` relative to ``center``; km and seconds of TDB, axes of the ICRF.

    Attributes:
        target, center: names for states and messages: letters, digits and underscores.
        begin: beginning of the first block, seconds since J2000.
        length: of each block, s.
        coefficients: (blocks, 3, terms).
    """

    target: str
    center: str
    begin: Fraction
    length: Fraction
    coefficients: np.ndarray

    @property
    def end(self) -> Fraction:
        """End of the last block, seconds since J2000."""
        return self.begin + self.length * len(self.coefficients)

    @cached_property
    def terms(self) -> int:
        """Number of coefficients of one component in one block."""
        return int(self.coefficients.shape[2])

    @cached_property
    def exponent(self) -> int:
        """Exponent of a power of two of km that is above all positions, but for what polynomials add."""
        return math.frexp(float(np.abs(self.coefficients[:, :, 0]).max()))[1]

    def block_at(self, time: Any) -> int:
        """Number of the block that begins at a time (mpf, seconds since J2000) or contains it."""
        found = int((time - _mpf_like(time, self.begin)) / _mpf_like(time, self.length) // 1)
        return min(max(found, 0), len(self.coefficients) - 1)

    def at(self, context: Any, time: Any, order: int = 0) -> Vector:
        """Position at a time (mpf, seconds since J2000), or a derivative of it: km/s^order (mpf)."""
        number = self.block_at(time)
        begin, length = exactly(context, self.begin + number * self.length), exactly(context, self.length)
        u = 2 * (time - begin) / length - 1
        values = chebyshev(context, u, self.terms, order)
        scale = (2 / length) ** order
        return [
            scale * sum((context.mpf(float(c)) * t for c, t in zip(row, values, strict=True)), context.zero)
            for row in self.coefficients[number]
        ]

    def sampled(self, times: np.ndarray) -> np.ndarray:
        """Positions at times (n,), seconds since J2000, in double precision: (n, 3), km."""
        since = (times - float(self.begin)) / float(self.length)
        number = np.clip(np.floor(since).astype(int), 0, len(self.coefficients) - 1)
        values = np.cos(np.arccos(np.clip(2 * (since - number) - 1, -1, 1))[:, None] * np.arange(self.terms))
        return np.einsum("nik,nk->ni", self.coefficients[number], values)


def chebyshev(context: Any, u: Any, terms: int, order: int) -> list[Any]:
    """Values (mpf) of T_0, T_1, ... at u, or of their derivatives of an order."""
    rows = [[context.one, u]]
    for k in range(2, terms):
        rows[0].append(2 * u * rows[0][k - 1] - rows[0][k - 2])
    for n in range(1, order + 1):
        lower, own = rows[-1], [context.zero, context.one if n == 1 else context.zero]
        for k in range(2, terms):
            own.append(2 * n * lower[k - 1] + 2 * u * own[k - 1] - own[k - 2])
        rows.append(own)
    return rows[-1][:terms]


def exactly(context: Any, value: Fraction) -> Any:
    """A fraction as mpf."""
    return context.mpf(value.numerator) / value.denominator


def _mpf_like(number: Any, value: Fraction) -> Any:
    return number * 0 + exactly(number.context, value)
