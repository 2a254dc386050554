"""Working precisions: heyoka's scalar types, exact conversion into and out of them, and what they cost.

| name | type | bits | epsilon |
| --- | --- | --- | --- |
| single | float32 | 24 | 2^-23 |
| double | float64 | 53 | 2^-52 |
| extended | 80-bit long double | 64 | 2^-63 |
| quadruple | 128-bit | 113 | 2^-112 |
| N digits | MPFR | ceil(N log2 10) + 2 | 2^(1 - bits) |
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import heyoka as hy
import mpmath
import numpy as np
from mpmath.libmp import mpf_pos, round_nearest

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.arithmetic import working_bits

_CHUNK_BITS = 24  # exact in every type
_SMALLEST, _SMALLEST_SINGLE = -1074, -149
"""Exponents of the last bits of float64, of which numbers of all precisions are made, and of float32."""


Scalar: TypeAlias = "float | np.floating[Any] | hy.real128 | hy.real"
"""A number of a run's own precision (``Precision.scalar``)."""


class Mpf(Protocol):
    """A number of any mpmath context."""

    _mpf_: tuple[int, int, int, int]


@dataclass(frozen=True)
class Precision:
    """One working precision.

    Attributes:
        scalar: heyoka's ``fp_type`` and the arrays' dtype.
        cheap: whether a step costs about as much as a Python call (then blocks of steps are taken at
            once).
        compact: whether the integrator is compiled in compact mode (unrolled code of the widest types
            takes minutes to compile).
    """

    name: str  # as in the config ("double", or "50 digits")
    bits: int
    scalar: Any  # a constructor, numpy's dtype and heyoka's fp_type in one
    cheap: bool
    compact: bool

    @property
    def epsilon(self) -> mpmath.mpf:
        """Spacing of numbers just above 1, as mpf."""
        return mpmath.mpf(2) ** (1 - self.bits)

    @property
    def options(self) -> dict[str, Any]:
        """Keyword arguments for heyoka's integrators and compiled functions."""
        options: dict[str, Any] = {"fp_type": self.scalar}
        if self.scalar is hy.real:
            options["prec"] = self.bits
        return options

    def number(self, value: Mpf) -> Scalar:
        """The scalar nearest to an mpf (ties to even), with no double in between.

        Raises:
            OverflowError: beyond the range of the internal arithmetic, or so small that it would lose digits;
                scaling keeps scenes far from it.
        """
        sign, mantissa, exponent, count = mpf_pos(value._mpf_, self.bits, round_nearest)
        if mantissa == 0:
            if count == -1 or exponent:  # mpmath's codes of infinities and nan
                raise OverflowError(f"{value} is not finite")
            return self._scalar(0.0)
        total = self._scalar(0.0)
        mantissa, exponent = int(mantissa), int(exponent)
        single = self.scalar is np.float32
        if exponent < (_SMALLEST_SINGLE if single else _SMALLEST):
            raise OverflowError(f"{mpmath.nstr(value, 8)} is below the range of {self.name}")
        while mantissa:
            part = float(mantissa & ((1 << _CHUNK_BITS) - 1))
            with np.errstate(over="ignore", under="ignore"):
                scaled = float(np.ldexp(part, exponent))
                if np.isinf(scaled):
                    raise OverflowError(f"{mpmath.nstr(value, 8)} is beyond the internal range")
                total = total + self._scalar(scaled)
            mantissa >>= _CHUNK_BITS
            exponent += _CHUNK_BITS
        if single and np.isinf(total):
            raise OverflowError(f"{mpmath.nstr(value, 8)} is beyond the range of single precision")
        return -total if sign else total

    def of_double(self, value: float) -> Scalar:
        """The scalar of a double's value, or the nearest one in a narrower type; zero without a sign."""
        return self._scalar(value + 0.0)

    def _scalar(self, value: float) -> Scalar:
        return hy.real(value, self.bits) if self.scalar is hy.real else self.scalar(value)

    def array(self, values: Sequence[Mpf]) -> np.ndarray:
        """A list of mpf as an array of this precision."""
        return np.array([self.number(v) for v in values], dtype=self.scalar)

    def of_doubles(self, values: np.ndarray) -> np.ndarray:
        """Float64 values (n,); ``astype`` would make multi-precision numbers of 53 bits."""
        if self.scalar is not hy.real:
            return values.astype(self.scalar)
        return np.array([hy.real(float(x), self.bits) for x in values], dtype=hy.real)

    def exact(self, value: Scalar) -> mpmath.mpf:
        """A scalar of this precision as an mpf with the same value."""
        total = mpmath.mpf(0)
        with mpmath.workprec(self.bits + 64):
            for part in self.parts(np.array([value], dtype=self.scalar)):
                total += mpmath.mpf(float(part[0]))
        return total

    @property
    def part_count(self) -> int:
        """Number of float64 that hold one number of this precision exactly."""
        return max(1, -(-self.bits // 53))

    def parts(self, values: np.ndarray, lead: np.ndarray | None = None) -> list[np.ndarray]:
        """float64 arrays whose sum, smallest first, is exactly ``values``; the first is the nearest double.

        Zeros keep their sign (a residual of zero has the sign of its leading part), infinities and nan
        stand in the first part alone.

        Args:
            lead: the first part, if values halfway between two doubles are known to lie nearer to one.
        """
        if self.bits <= 53:
            return [values.astype(np.float64) if lead is None else lead]
        parts: list[np.ndarray] = []
        rest = values
        for n in range(self.part_count):
            # infinities and nan have no residual; numpy would warn of what is set right below
            with np.errstate(invalid="ignore", over="ignore"):
                part = rest.astype(np.float64) if n or lead is None else lead
                parts.append(part)
                if n + 1 < self.part_count:
                    rest = rest - part.astype(self.scalar)
        lead = parts[0]
        finite, zero = np.isfinite(lead), lead == 0.0
        if not finite.all():
            for part in parts[1:]:
                part[~finite] = 0.0
        if zero.any():
            for part in parts[1:]:
                part[zero] = np.copysign(0.0, lead[zero])
        return parts

    def zeros(self, shape: tuple[int, ...]) -> np.ndarray:
        """An array of zeros."""
        return np.zeros(shape, dtype=self.scalar)

    def indices(self, first: int, stop: int) -> np.ndarray:
        """The whole numbers first ... stop-1 in this precision (single: in double, exact to 2^53)."""
        numbers = np.arange(first, stop, dtype=np.float64)
        return numbers if self.bits <= 53 else numbers.astype(self.scalar)

    @property
    def narrow(self) -> bool:
        """True for single and double, whose times fit a double."""
        return self.bits <= 53


def precision_of(name: str | int) -> Precision:
    """The precision that a config names.

    Raises:
        ConfigError: this machine's heyoka lacks the type.
    """
    bits = working_bits(name)
    if name == "single":
        return Precision("single", bits, np.float32, cheap=True, compact=False)
    if name == "double":
        return Precision("double", bits, float, cheap=True, compact=False)
    if name == "extended":
        if np.finfo(np.longdouble).nmant != 63:
            what = (
                'given "extended", but this machine has no 80-bit numbers; allowed here: single, double, '
                "quadruple, or a number of digits"
            )
            raise ConfigError(Problem("[integrator] precision", what))
        return Precision("extended", bits, np.longdouble, cheap=True, compact=False)
    if name == "quadruple" and hasattr(hy, "real128"):
        return Precision("quadruple", bits, hy.real128, cheap=False, compact=True)
    if not hasattr(hy, "real"):
        what = f"given {name}, which this machine's heyoka lacks"
        raise ConfigError(Problem("[integrator] precision", what))
    title = name if isinstance(name, str) else f"{name} digits"
    return Precision(title, bits, hy.real, cheap=False, compact=True)
