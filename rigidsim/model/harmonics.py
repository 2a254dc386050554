"""Spherical harmonics of a unit vector as polynomials of its components, regular everywhere.

With (x, y, z) the unit vector, A_m + i B_m = (x + i y)^m and P_nm without the Condon-Shortley phase,

    P_nm(sin lat) cos m lon = k_nm v_nm(z) A_m,     k_nm = (2n - 1)!! / (n - m)!,
    v_nm = z v_n-1,m - b_nm v_n-2,m,                b_nm = ((n - 1)^2 - m^2) / (4 (n - 1)^2 - 1),

(Pines 1973, with the leading coefficients taken out), one product for each. A torque of degree n is made of
harmonics of the same degree, since u x grad is a rotation: with the raising and lowering of angular momentum
(Edmonds, Angular Momentum in Quantum Mechanics, 1957, section 2.3) its vectors follow from the coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import heyoka as hy

from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.bodies.gravity_field import Harmonic

Series = Mapping[Harmonic, Any]
"""Unnormalized coefficients (mpf) of harmonics, C and S."""


def leading(n: int, m: int) -> Fraction:
    """k_nm, by which the polynomials here are smaller than the harmonics."""
    return Fraction(math.prod(range(1, 2 * n, 2)), math.factorial(n - m))


class Harmonics:
    """The polynomials v_nm A_m and v_nm B_m, n >= 1, of a unit vector (expressions or mpf); each once."""

    def __init__(self, direction: list[Any], number: Rounder, context: Any) -> None:
        self._x, self._y, self._z = direction
        self._number, self._context = number, context
        self._known: dict[Harmonic, Any] = {(1, 1, False): self._x, (1, 1, True): self._y}

    def __getitem__(self, which: Harmonic) -> Any:
        if which not in self._known:
            self._known[which] = self._made(*which)
        return self._known[which]

    def _made(self, n: int, m: int, sine: bool) -> Any:
        if n == m:
            return self._sectoral(m, sine=sine)
        above = self._z if n == 1 else self._z * self[n - 1, m, sine]
        share = Fraction((n - 1) ** 2 - m**2, 4 * (n - 1) ** 2 - 1)
        if n - 2 < m or not share:
            return above
        constant = self._number(self._context.mpf(share.numerator) / share.denominator)
        return above - (constant if n == 2 else constant * self[n - 2, m, sine])

    def _sectoral(self, m: int, *, sine: bool) -> Any:
        half = m // 2
        if m % 2 == 0:
            a, b = self[half, half, False], self[half, half, True]
            return 2 * (a * b) if sine else (a - b) * (a + b)
        a, b = self[m - 1, m - 1, False], self[m - 1, m - 1, True]
        return self._x * b + self._y * a if sine else self._x * a - self._y * b

    def summed(self, coefficients: Series) -> Symbolic:
        """A sum of these polynomials."""
        terms = [self._number(c) * self[which] for which, c in coefficients.items() if c != 0]
        return hy.sum(terms) if terms else hy.expression(0.0)


def polynomial(series: Series, context: Any) -> dict[Harmonic, Any]:
    """A sum of harmonics as one of polynomials."""
    return {(n, m, sine): c * _factor(n, m, context) for (n, m, sine), c in series.items()}


def turning(series: Series, context: Any) -> dict[Harmonic, Vector]:
    """u x grad of a sum of harmonics, as vectors (mpf) times polynomials."""
    found: dict[Harmonic, Vector] = {}

    def add(n: int, m: int, axis: int, cosine: Any, sine: Any) -> None:
        for is_sine, value in ((False, cosine), (True, sine)):
            if value == 0 or (is_sine and m == 0):
                continue
            vector = found.setdefault((n, m, is_sine), [context.zero] * 3)
            vector[axis] += value * _factor(n, m, context)

    for n, m in sorted({(n, m) for n, m, _ in series}):
        c, s = (series.get((n, m, sine), context.zero) for sine in (False, True))
        if m == 0:
            add(n, 1, 0, context.zero, c)
            add(n, 1, 1, -c, context.zero)
            continue
        add(n, m, 2, m * s, -m * c)
        if m < n:
            add(n, m + 1, 0, -s / 2, c / 2)
            add(n, m + 1, 1, -c / 2, -s / 2)
        lowered = context.mpf((n + m) * (n - m + 1)) / 2
        add(n, m - 1, 0, -lowered * s, lowered * c)
        add(n, m - 1, 1, lowered * c, lowered * s)
    return found


def by_degree(coefficients: Series) -> list[tuple[int, Series]]:
    """Coefficients of each degree."""
    found: dict[int, dict[Harmonic, Any]] = {}
    for key, value in coefficients.items():
        found.setdefault(key[0], {})[key] = value
    return sorted(found.items())


def by_powers(parts: list[tuple[int, Symbolic]], inverse: Symbolic, above: int) -> Symbolic:
    """Sum of expressions, each times ``inverse`` to the power of its degree + ``above``."""
    if not parts:
        return hy.expression(0.0)
    constant = inverse == hy.expression(1.0)
    (last, total), *others = reversed(parts)
    for n, part in others:
        total = part + (total if constant else inverse ** (last - n) * total)
        last = n
    return total if constant else inverse ** (last + above) * total


def _factor(n: int, m: int, context: Any) -> Any:
    exact = leading(n, m)
    return context.mpf(exact.numerator) / exact.denominator
