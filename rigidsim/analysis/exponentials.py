"""Sums of exponentials at equidistant times, and a signal's remainder without them, to any precision.

A sample's number is split as ``block a + b``, so that exp(i w t) is a product of two short tables and a sum
of many exponentials is a product of two narrow matrices. In double precision the tables are right to rounding
at any length, since phases are reduced in integers. Beyond it numbers are integers in fixed point.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_GUARD = 40  # bits for the growth of rounding along a table
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

    def slope(self) -> Self:
        """The derivative, per sample."""
        turn = self.context.mpc(0, 2 * self.context.pi)
        return replace(
            self,
            polynomial=tuple(2 * m * c / self.count for m, c in enumerate(self.polynomial) if m),
            amplitudes=tuple(turn * f * a for f, a in zip(self.frequencies, self.amplitudes, strict=True)),
        )

    def left_of(self, parts: Sequence[tuple[Reals, Reals]], bits: int) -> Complexes:
        """A signal, real and imaginary parts (n,) summed over the list, less this sum, in double precision;
        with more bits than 53 the difference is taken in as many, and rounded once.
        """
        if bits <= 53:
            real, imaginary = parts[0]
            return np.asarray(real + 1j * imaginary - self.values())
        return _wide_difference(self, parts, bits)


def _wide_difference(total: Sum, parts: Sequence[tuple[Reals, Reals]], bits: int) -> Complexes:
    """See ``Sum.left_of``: in fixed point, with integers that lose nothing until they are rounded."""
    bits += _GUARD
    terms = [*total.amplitudes, *total.polynomial, *(np.max(np.abs(part)) for part in parts[0])]
    unit = math.frexp(max(float(abs(x)) for x in terms))[1]
    left, right = _factors(total, bits, unit)
    grid, shift = Grid(total.count), 2 * bits - unit
    result = np.empty(grid.count, dtype=np.complex128)
    for row in range(0, grid.rows, _ROWS):
        begin, end = row * grid.width, min((row + _ROWS) * grid.width, grid.count)
        for target, factor, columns in zip(
            (result.real, result.imag), left, zip(*parts, strict=True), strict=True
        ):
            fixed = sum(_fixed(column[begin:end], shift) for column in columns)
            modelled = (factor[row : row + _ROWS] @ right).ravel()[: end - begin]
            target[begin:end] = (fixed - modelled) / (1 << shift)
    return result


def _fixed(values: Reals, shift: int) -> Any:
    """Whole numbers of 2^-shift."""
    digits, exponents = np.frexp(values)
    whole = np.ldexp(digits, 53).astype(np.int64).tolist()
    moves = (exponents + (shift - 53)).tolist()
    return np.array([n << m if m >= 0 else n >> -m for n, m in zip(whole, moves, strict=True)], dtype=object)


def _factors(total: Sum, bits: int, unit: int) -> tuple[tuple[Any, Any], Any]:
    """Factors of the real and of the imaginary part, (blocks, terms), and the one that they share, (terms,
    block length), as whole numbers of 2^(unit - bits) and of 2^-bits.
    """
    context = type(total.context)()
    context.prec = bits + 20
    grid = Grid(total.count)
    real: list[list[int]] = []
    imaginary: list[list[int]] = []
    shared: list[list[int]] = []
    for frequency, amplitude in zip(total.frequencies, total.amplitudes, strict=True):
        turn = 2 * context.mpf(frequency)
        start = context.mpc(amplitude) * context.expjpi(turn * (1 - total.count) / 2)
        start = context.mpc(context.ldexp(start.real, -unit), context.ldexp(start.imag, -unit))
        c, s = _powers(context, start, turn * grid.width, grid.rows, bits)
        u, v = _powers(context, context.mpc(1), turn, grid.width, bits)
        real += [c, [-x for x in s]]
        imaginary += [s, c]
        shared += [u, v]
    # (x + y)^m, from where the block begins and where the sample is in it
    x = [(int(n) << bits) // total.count for n in grid.first]
    y = [(int(n) << bits) // total.count for n in grid.within]
    for power in range(len(total.polynomial)):
        for target, part in ((real, "real"), (imaginary, "imag")):
            column = [0] * grid.rows
            for m in range(power, len(total.polynomial)):
                number = getattr(context.mpc(total.polynomial[m]), part)
                factor = int(context.ldexp(number * math.comb(m, power), bits - unit))
                raised = _raised(x, m - power, bits)
                column = [a + (factor * b >> bits) for a, b in zip(column, raised, strict=True)]
            target.append(column)
        shared.append(_raised(y, power, bits))
    first = [np.array(columns, dtype=object).T for columns in (real, imaginary)]
    return (first[0], first[1]), np.array(shared, dtype=object)


def _raised(values: list[int], power: int, bits: int) -> list[int]:
    result = [1 << bits] * len(values)
    for _ in range(power):
        result = [a * b >> bits for a, b in zip(result, values, strict=True)]
    return result


def _powers(context: Any, start: Any, turn: Any, count: int, bits: int) -> tuple[list[int], list[int]]:
    """Real and imaginary parts of start exp(i pi turn n), as whole numbers of 2^-bits."""
    extra = bits + 16
    step = context.expjpi(turn)
    c, s, x, y = (int(context.ldexp(v, extra)) for v in (step.real, step.imag, start.real, start.imag))
    real, imaginary = [], []
    for _ in range(count):
        real.append(x >> 16)
        imaginary.append(y >> 16)
        x, y = (x * c - y * s) >> extra, (x * s + y * c) >> extra
    return real, imaginary
