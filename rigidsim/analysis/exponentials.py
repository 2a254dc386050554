"""Sums of exponentials at equidistant times, and a signal's remainder without them, to any precision.

A sample's number is split as ``block a + b``, so that exp(i w t) is a product of two short tables and a sum
of many exponentials is a product of two narrow matrices. In double precision the tables are right to rounding
at any length, since phases are reduced in integers. Beyond it numbers are integers in fixed point.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_GUARD = 40  # bits for the growth of rounding along a table


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


def _width(count: int) -> int:
    """Number of samples in a block: about the square root of all."""
    return 1 << max(math.ceil(math.log2(max(count, 2)) / 2), 1)


def tables(frequencies: Sequence[Any], count: int) -> tuple[Complexes, Complexes]:
    """exp(2 pi i f n) of the blocks' first samples, counted from the middle of so many, and within blocks;
    frequencies in turns per sample.
    """
    width = _width(count)
    first = 2 * width * np.arange(-(-count // width)) - (count - 1)
    return exponentials(frequencies, first), exponentials(frequencies, 2 * np.arange(width))


def products(values: Any, frequencies: Sequence[Any]) -> Complexes:
    """Sums (frequencies,) of samples (n,) times conj(exp(2 pi i f n))."""
    first, within = tables(frequencies, len(values))
    blocks = np.pad(values, (0, len(first) * len(within) - len(values))).reshape(len(first), -1)
    return np.asarray(np.sum(np.conj(first) * (blocks @ np.conj(within)), axis=0))


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

    @property
    def lines(self) -> list[tuple[Any, Any]]:
        """Frequencies and amplitudes."""
        return list(zip(self.frequencies, self.amplitudes, strict=True))

    def with_lines(self, lines: Iterable[tuple[Any, Any]]) -> Self:
        """The sum with other lines."""
        frequencies, amplitudes = tuple(zip(*lines, strict=True)) or ((), ())
        return replace(self, frequencies=frequencies, amplitudes=amplitudes)

    def values(self) -> Complexes:
        """All samples, in double precision."""
        first, within = tables(self.frequencies, self.count)
        total = (first * np.array([complex(a) for a in self.amplitudes])) @ within.T
        flat = total.ravel()[: self.count]
        if self.polynomial:
            x = (2.0 * np.arange(self.count) - (self.count - 1)) / self.count
            flat = flat + np.polynomial.polynomial.polyval(x, [complex(c) for c in self.polynomial])
        return np.asarray(flat)

    def slope(self) -> Self:
        """The derivative, per sample."""
        turn = self.context.mpc(0, 2 * self.context.pi)
        polynomial = tuple(2 * m * c / self.count for m, c in enumerate(self.polynomial) if m)
        return replace(self, polynomial=polynomial).with_lines((f, turn * f * a) for f, a in self.lines)


@dataclass(frozen=True)
class SignalSamples:
    """Equidistant samples of a signal: real and imaginary parts (n,), summed over the list.

    The mpmath context has more than the precision's bits. By so much of a spacing samples are late, (n,):
    times are rounded, in a pattern that would show up as lines.
    """

    parts: tuple[tuple[Reals, Reals], ...]
    real: bool
    bits: int
    context: Any
    late: Reals | None = None

    @property
    def count(self) -> int:
        """Number of samples."""
        return len(self.parts[0][0])

    def remainder(self, total: Sum) -> Complexes:
        """The remainder without a sum, in double precision; beyond it the difference is rounded once."""
        whole = mirrored(total, self.real)
        if self.bits > 53:
            left = _wide_difference(whole, self.parts, self.bits + _GUARD)
        else:
            left = self.parts[0][0] + 1j * self.parts[0][1] - whole.values()
            if self.late is not None and (whole.frequencies or whole.polynomial):
                left = left - self.late * whole.slope().values()
        return np.asarray(left.real + 0j if self.real else left, dtype=np.complex128)


def mirrored(total: Sum, real: bool) -> Sum:
    """The sum together with the mirror images of a real signal's lines."""
    images = [(-f, total.context.conj(a)) for f, a in total.lines] if real else []
    return total.with_lines([*total.lines, *images])


def _wide_difference(total: Sum, parts: Sequence[tuple[Reals, Reals]], bits: int) -> Complexes:
    """A signal, real and imaginary parts (n,) summed over the list, less a sum, in integers that lose nothing
    until they are rounded: numbers are whole ones of 2^(unit - bits), turned ones and positions of 2^-bits.
    """
    context, count = total.context, total.count
    terms = [*total.amplitudes, *total.polynomial, *(np.max(np.abs(part)) for part in parts[0])]
    shift = bits - math.frexp(max(float(abs(x)) for x in terms))[1]
    width, result = _width(count), np.empty(count, dtype=np.complex128)
    lines = [
        (
            _powers(context, a * context.expjpi(f * (1 - count)), 2 * f * width, -(-count // width), shift),
            np.array(_powers(context, context.mpc(1), 2 * f, width, bits), dtype=object),
        )
        for f, a in total.lines
    ]
    factors = [[int(context.ldexp(x, shift)) for x in (c.real, c.imag)] for c in total.polynomial]
    for row, begin in enumerate(range(0, count, width)):
        here = slice(begin, min(begin + width, count))
        x = np.array([(2 * n - (count - 1) << bits) // count for n in range(count)[here]], dtype=object)
        model = np.zeros((2, len(x)), dtype=object)
        for factor in reversed(factors):
            model = (model * x >> bits) + np.array(factor, dtype=object)[:, None]
        for (real, imaginary), within in lines:
            u, v = within[:, : len(x)]
            c, s = real[row], imaginary[row]
            model = model + np.array([c * u - s * v >> bits, c * v + s * u >> bits])
        for target, modelled, columns in zip(
            (result.real, result.imag), model, zip(*parts, strict=True), strict=True
        ):
            left = sum(_fixed(column[here], shift) for column in columns) - modelled
            target[here] = np.ldexp(left.astype(np.float64), -shift)
    return result


def _fixed(values: Reals, shift: int) -> Any:
    """Whole numbers of 2^-shift."""
    digits, exponents = np.frexp(values)
    whole = np.ldexp(digits, 53).astype(np.int64).tolist()
    moves = (exponents + (shift - 53)).tolist()
    return np.array([n << m if m >= 0 else n >> -m for n, m in zip(whole, moves, strict=True)], dtype=object)


def _powers(context: Any, start: Any, turn: Any, count: int, shift: int) -> tuple[list[int], list[int]]:
    """Real and imaginary parts of start exp(i pi turn n), as whole numbers of 2^-shift."""
    step, scale = context.expjpi(turn), context.prec
    c, s = (int(context.ldexp(v, scale)) for v in (step.real, step.imag))
    x, y = (int(context.ldexp(v, shift + 16)) for v in (start.real, start.imag))
    real, imaginary = [], []
    for _ in range(count):
        real.append(x >> 16)
        imaginary.append(y >> 16)
        x, y = (x * c - y * s) >> scale, (x * s + y * c) >> scale
    return real, imaginary
