"""Sums of exponentials at equidistant times, and a signal's remainder without them, to any precision.

A sample's number is split as ``block a + b``, so that exp(i w t) is a product of two short tables and a sum
of many exponentials is a product of two narrow matrices. In double precision the tables are right to rounding
at any length, since phases are reduced in integers. Beyond it numbers are cut into digits of 16 bits whose
products and sums double precision holds exactly (Ozaki, Ogita, Oishi & Rump 2012, Numer. Algorithms 59, 95).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_LIMB = 16  # bits of a digit
_GUARD = 40  # bits for the growth of rounding along a table, and for sums
_ROWS = 64  # of blocks that are worked on at once, in a precision beyond double


def exponentials(frequencies: Sequence[Any], numbers: NDArray[np.int64]) -> Complexes:
    """exp(i pi f n), (numbers, frequencies), right to rounding for any numbers below 2^40; f are mpf."""
    result = np.empty((len(numbers), len(frequencies)), dtype=np.complex128)
    for k, frequency in enumerate(frequencies):
        # in units of 2^-64 turns, as unsigned integers that wrap around by themselves
        fixed = int(frequency * (1 << 127))
        high = np.uint64((fixed >> 64) & (2**64 - 1))
        low = float(fixed & (2**64 - 1)) * 2.0**-128
        turns = (high * numbers.astype(np.uint64)).astype(np.int64).astype(np.float64) * 2.0**-64
        angle = 2 * np.pi * (turns + low * numbers)
        result[:, k] = np.cos(angle) + 1j * np.sin(angle)
    return result


@dataclass(frozen=True)
class Grid:
    """Numbers of samples counted from the middle of a series, in blocks."""

    count: int

    @property
    def width(self) -> int:
        """Number of samples in a block: about the square root of the total."""
        return 1 << max(math.ceil(math.log2(max(self.count, 2)) / 2), 1)

    @property
    def rows(self) -> int:
        """Number of blocks that hold all samples."""
        return -(-self.count // self.width)

    def blocks(self, values: Any) -> Any:
        """Samples (n,) as (blocks, block length), padded with zeros."""
        return np.pad(values, (0, self.rows * self.width - self.count)).reshape(self.rows, self.width)

    @property
    def first(self) -> NDArray[np.int64]:
        """Twice the number of each block's first sample."""
        return 2 * self.width * np.arange(self.rows) - (self.count - 1)

    @property
    def within(self) -> NDArray[np.int64]:
        """Twice the number of each sample from its block's first."""
        return 2 * np.arange(self.width)

    def tables(self, frequencies: Sequence[Any]) -> tuple[Complexes, Complexes]:
        """exp(2 pi i f n) of the blocks' first samples and within blocks; frequencies in turns per sample."""
        return exponentials(frequencies, self.first), exponentials(frequencies, self.within)


@dataclass(frozen=True)
class Sum:
    """A polynomial (coefficients, mpc, of powers of 2 n / count, n counted from the middle of so many
    samples), and exponentials of frequencies (mpf, turns per sample) with amplitudes (mpc) at the middle.
    """

    context: Any
    count: int
    polynomial: tuple[Any, ...]
    frequencies: tuple[Any, ...]
    amplitudes: tuple[Any, ...]

    def values(self) -> Complexes:
        """All samples, in double precision."""
        grid = Grid(self.count)
        first, within = grid.tables(self.frequencies)
        total = (first * np.array([complex(a) for a in self.amplitudes])) @ within.T
        flat = total.ravel()[: self.count]
        if self.polynomial:
            x = (2.0 * np.arange(self.count) - (self.count - 1)) / self.count
            flat = flat + np.polynomial.polynomial.polyval(x, [complex(c) for c in self.polynomial])
        return np.asarray(flat)

    def slope(self) -> Sum:
        """The derivative, per sample."""
        context = self.context
        turn = context.mpc(0, 2 * context.pi)
        return Sum(
            context,
            self.count,
            tuple(2 * m * c / self.count for m, c in enumerate(self.polynomial) if m),
            self.frequencies,
            tuple(turn * f * a for f, a in zip(self.frequencies, self.amplitudes, strict=True)),
        )

    def left_of(self, parts: Sequence[tuple[Reals, Reals]], bits: int) -> Complexes:
        """A signal, real and imaginary parts (n,) summed over the list, less this sum, in double precision;
        with more bits than 53 the difference is taken in as many, and rounded once.
        """
        if bits <= 53:
            real, imaginary = parts[0]
            return np.asarray(real + 1j * imaginary - self.values())
        return _Wide(self, parts, bits).difference()


class _Wide:
    """The difference beyond double precision, in fixed point with a common unit."""

    def __init__(self, total: Sum, parts: Sequence[tuple[Reals, Reals]], bits: int) -> None:
        self.total, self.parts = total, parts
        largest = max(float(np.max(np.abs(part))) for part in parts[0])
        terms = [abs(x) for x in (*total.amplitudes, *total.polynomial)]
        largest = max([largest, *map(float, terms)])
        self.unit = math.frexp(largest)[1]
        self.limbs = -(-(bits + _GUARD) // _LIMB)
        self.bits = _LIMB * self.limbs - 8  # room for a sign and sums

    def difference(self) -> Complexes:
        """See ``Sum.left_of``."""
        left, right = self._factors()
        grid = Grid(self.total.count)
        result = np.empty(grid.count, dtype=np.complex128)
        for row in range(0, grid.rows, _ROWS):
            begin, end = row * grid.width, min((row + _ROWS) * grid.width, grid.count)
            for which, factor in enumerate(left):
                values = self._chunk(factor[:, row : row + _ROWS], right, begin, end, which)
                target = result.real if which == 0 else result.imag
                target[begin:end] = values
        return result

    def _chunk(self, left: Reals, right: Reals, begin: int, end: int, which: int) -> Reals:
        """Real (0) or imaginary part (1) of the difference for samples begin to end."""
        weights: dict[int, Reals] = {}
        for i in range(self.limbs):
            for j in range(max(self.limbs - 2 - i, 0), self.limbs):
                product = left[i] @ right[j]
                weights[i + j] = weights[i + j] + product if i + j in weights else product
        terms = [part[which][begin:end] for part in self.parts]
        for weight in sorted(weights, reverse=True):
            exponent = _LIMB * weight - 2 * self.bits + self.unit
            terms.append(np.ldexp(-weights[weight].ravel()[: end - begin], exponent))
        return _exact_sum(terms)

    def _factors(self) -> tuple[tuple[Reals, Reals], Reals]:
        """Digits of the factors of the real and of the imaginary part, (limbs, blocks, terms), and of the one
        that they share, (limbs, terms, block length).
        """
        total = self.total
        context = type(total.context)()
        context.prec = self.bits + 20
        grid, one = Grid(total.count), 1 << self.bits
        real: list[list[int]] = []
        imaginary: list[list[int]] = []
        shared: list[list[int]] = []
        for frequency, amplitude in zip(total.frequencies, total.amplitudes, strict=True):
            turn = 2 * context.mpf(frequency)
            start = context.mpc(amplitude) * context.expjpi(turn * (1 - total.count) / 2)
            start = context.ldexp(start.real, -self.unit), context.ldexp(start.imag, -self.unit)
            c, s = self._powers(context, start, turn * grid.width, grid.rows)
            u, v = self._powers(context, (context.one, context.zero), turn, grid.width)
            real += [c, [-x for x in s]]
            imaginary += [s, c]
            shared += [u, v]
        if total.polynomial:
            # (x + y)^m, from where the block begins and where the sample is in it
            x = [(int(n) << self.bits) // total.count for n in grid.first]
            y = [(int(n) << self.bits) // total.count for n in grid.within]
            for power in range(len(total.polynomial)):
                for target, part in ((real, "real"), (imaginary, "imag")):
                    column = [0] * grid.rows
                    for m in range(power, len(total.polynomial)):
                        number = getattr(context.mpc(total.polynomial[m]), part)
                        factor = int(context.ldexp(number * math.comb(m, power), self.bits - self.unit))
                        raised = self._raised(x, m - power)
                        column = [a + (factor * b >> self.bits) for a, b in zip(column, raised, strict=True)]
                    target.append(column)
                shared.append(self._raised(y, power))
        assert all(abs(v) < 64 * one for column in (*real, *imaginary, *shared) for v in column)
        digits = [np.stack([self._digits(c) for c in columns], axis=-1) for columns in (real, imaginary)]
        return (digits[0], digits[1]), np.stack([self._digits(c) for c in shared], axis=1)

    def _raised(self, values: list[int], power: int) -> list[int]:
        result = [1 << self.bits] * len(values)
        for _ in range(power):
            result = [a * b >> self.bits for a, b in zip(result, values, strict=True)]
        return result

    def _powers(
        self, context: Any, start: tuple[Any, Any], turn: Any, count: int
    ) -> tuple[list[int], list[int]]:
        """Real and imaginary parts of start exp(i pi turn n) in fixed point."""
        extra = self.bits + 16
        step = context.expjpi(turn)
        c, s = (int(context.ldexp(x, extra)) for x in (step.real, step.imag))
        x, y = (int(context.ldexp(v, extra)) for v in start)
        real, imaginary = [], []
        for _ in range(count):
            real.append(x >> 16)
            imaginary.append(y >> 16)
            x, y = (x * c - y * s) >> extra, (x * s + y * c) >> extra
        return real, imaginary

    def _digits(self, values: list[int]) -> Reals:
        """Digits of 16 bits, (limbs, n), the lowest first; the highest is signed."""
        size = 2 * self.limbs
        raw = b"".join(v.to_bytes(size, "little", signed=True) for v in values)
        digits = np.frombuffer(raw, dtype="<u2").reshape(len(values), self.limbs).astype(np.float64)
        digits[:, -1] -= 65536.0 * (digits[:, -1] >= 32768)
        return np.ascontiguousarray(digits.T)


def _exact_sum(terms: Sequence[Reals]) -> Reals:
    """Sum of nearly cancelling numbers, as if with three times their precision (Ogita, Rump & Oishi 2005,
    SIAM J. Sci. Comput. 26, 1955, algorithm 4.8 with K = 3).
    """
    first, second, third = (np.zeros_like(terms[0]) for _ in range(3))
    for term in terms:
        first, error = _two_sum(first, term)
        second, error = _two_sum(second, error)
        third += error
    total, error = _two_sum(first, second)
    return total + (error + third)


def _two_sum(a: Reals, b: Reals) -> tuple[Reals, Reals]:
    total = a + b
    other = total - a
    return total, (a - (total - other)) + (b - other)
