"""Spherical harmonics of a unit vector as polynomials of its components, regular everywhere; fields of them.

With (x, y, z) the unit vector, A_m + i B_m = (x + i y)^m and P_nm without the Condon-Shortley phase,

    P_nm(sin lat) cos m lon = k_nm v_nm(z) A_m,     k_nm = (2n - 1)!! / (n - m)!,
    v_nm = z v_n-1,m - b_nm v_n-2,m,                b_nm = ((n - 1)^2 - m^2) / (4 (n - 1)^2 - 1),

(Pines 1973, with the leading coefficients taken out), one product for each. A torque of degree n is made of
harmonics of the same degree, since u x grad is a rotation: with the raising and lowering of angular momentum
(Edmonds, Angular Momentum in Quantum Mechanics, 1957, section 2.3) its vectors follow from the coefficients.

With u the unit vector from a body's centre, r the distance and f_n harmonics of degree n, the potential
sum c_n r^-(n+1) f_n(u) has the gradient

    - sum c_n r^-(n+2) ((n + 1) f_n u + u x (u x grad f_n)).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.placements import SourcePlace
from rigidsim.model.rotations import Symbolic, along
from rigidsim.model.scaling import Rounder
from rigidsim.scene.arithmetic import (
    Matrix,
    Vector,
    apply,
    cross,
    norm,
    parallel,
    transpose,
    unit_vectors,
)
from rigidsim.scene.bodies.gravity_field import Harmonic

Series = Mapping[Harmonic, Any]
"""Unnormalized coefficients (mpf) of harmonics, C and S."""
Sizes = Callable[[int], Any]
"""A constant (mpf) of each degree."""


def leading(n: int, m: int) -> Fraction:
    """k_nm, by which the polynomials here are smaller than the harmonics."""
    return Fraction(math.prod(range(1, 2 * n, 2)), math.factorial(n - m))


class Harmonics:
    """The polynomials v_nm A_m and v_nm B_m, n >= 1, of a unit vector, each once; sums over them times
    constants of each degree and the inverse distance to the power of the degree + ``above``.

    Args:
        direction: expressions, or mpf if ``exact``.
    """

    def __init__(self, direction: list[Any], number: Rounder, context: Any, *, exact: bool = False) -> None:
        self._u, self._number, self._context = direction, number, context
        self._zero = context.zero if exact else hy.expression(0.0)
        self._add = sum if exact else hy.sum
        self._known: dict[Harmonic, Any] = {(1, 1, False): direction[0], (1, 1, True): direction[1]}

    def __getitem__(self, which: Harmonic) -> Any:
        if which not in self._known:
            self._known[which] = self._made(*which)
        return self._known[which]

    def _made(self, n: int, m: int, sine: bool) -> Any:
        if n == m:
            return self._sectoral(m, sine=sine)
        above = self._u[2] if n == 1 else self._u[2] * self[n - 1, m, sine]
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
        return self._u[0] * b + self._u[1] * a if sine else self._u[0] * a - self._u[1] * b

    def _summed(self, coefficients: Series) -> Any:
        return self._add([self._number(c) * self[which] for which, c in coefficients.items() if c != 0])

    def _by_powers(self, parts: Sequence[tuple[int, Series]], inverse: Any, above: int) -> Any:
        """Sum of polynomials of each degree."""
        found = [(n, self._summed(part)) for n, part in parts if any(c != 0 for c in part.values())]
        if not found:
            return self._zero
        (last, total), *others = reversed(found)
        for n, part in others:
            total = part + inverse ** (last - n) * total
            last = n
        return inverse ** (last + above) * total

    def scalar(self, series: Series, sizes: Sizes, inverse: Any, above: int) -> Any:
        """Sum of f_n."""
        parts = []
        for n, part in by_degree(series):
            size = sizes(n)
            parts.append((n, {key: size * c * _factor(*key[:2], self._context) for key, c in part.items()}))
        return self._by_powers(parts, inverse, above)

    def turned(self, series: Series, sizes: Sizes, inverse: Any, above: int) -> list[Any]:
        """Sum of u x grad f_n."""
        rows: list[list[tuple[int, Series]]] = [[], [], []]
        for n, part in by_degree(series):
            size, vectors = sizes(n), turning(part, self._context)
            for axis, row in enumerate(rows):
                row.append((n, {key: size * vector[axis] for key, vector in vectors.items()}))
        return [self._by_powers(row, inverse, above) for row in rows]

    def falling(self, series: Series, sizes: Sizes, inverse: Any) -> list[Any]:
        """Sum of (n + 1) f_n u + u x (u x grad f_n), to the power of n + 2."""
        outwards = self.scalar(series, lambda n: (n + 1) * sizes(n), inverse, 2)
        lever = cross(self._u, self.turned(series, sizes, inverse, 2))
        return [outwards * a + b for a, b in zip(self._u, lever, strict=True)]


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


def _factor(n: int, m: int, context: Any) -> Any:
    exact = leading(n, m)
    return context.mpf(exact.numerator) / exact.denominator


# --- in axes that turn --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class TurningHarmonics:
    """Harmonics in axes that turn about a pole at a constant rate.

    Attributes:
        coefficients: of unnormalized harmonics (mpf).
        radius: to which they refer, m (mpf).
        frame: its x (towards longitude 0 at time 0), y and z (its pole), unit vectors of space axes (mpf).
        rate: about the pole, rad/s (mpf).
    """

    coefficients: dict[Harmonic, Any]
    radius: Any
    frame: Matrix
    rate: Any

    @property
    def degree(self) -> int:
        """The highest degree; 0 without any."""
        return max((n for n, _, _ in self.coefficients), default=0)

    @property
    def rests(self) -> bool:
        """Whether it doesn't depend on time: it is symmetric about its pole, or doesn't turn."""
        return all(m == 0 for _, m, _ in self.coefficients) or bool(self.rate == 0)

    def _turn(self, m: Kinematics) -> tuple[Symbolic, Symbolic] | None:
        """Cosine and sine of the angle by which its axes have turned; None where that doesn't matter."""
        if self.rests:
            return None
        angle = m.scaled(self.rate, m.scaling.time) * hy.time
        return hy.cos(angle), hy.sin(angle)

    def _inside(self, m: Kinematics, place: SourcePlace) -> Harmonics:
        """Harmonics of the direction from a centre to the body, in its own axes."""
        x, y, z = (along(m.fixed(axis), place.outwards) for axis in self.frame)
        if (turn := self._turn(m)) is not None:
            c, s = turn
            x, y = c * x + s * y, c * y - s * x
        return Harmonics([x, y, z], m.number, m.scene.context)

    def scalar(self, m: Kinematics, place: SourcePlace, sizes: Sizes) -> Symbolic:
        """Sum of f_n times a constant of each degree and the inverse distance to the power of n + 1."""
        return self._inside(m, place).scalar(self.coefficients, sizes, place.inverse, 1)

    def vector(self, m: Kinematics, place: SourcePlace, sizes: Sizes) -> list[Symbolic]:
        """Sum of (n + 1) f_n u + u x (u x grad f_n) likewise, to the power of n + 2; space axes."""
        x, y, z = self._inside(m, place).falling(self.coefficients, sizes, place.inverse)
        if (turn := self._turn(m)) is not None:
            c, s = turn
            x, y = c * x - s * y, s * x + c * y
        return [along(m.fixed(row), [x, y, z]) for row in transpose(self.frame)]

    def at(self, context: Any, place: Vector, time: Any) -> Vector:
        """Sum of (R/r)^(n+2) ((n + 1) f_n u + u x (u x grad f_n)) at a place seen from the centre (mpf, m,
        space axes) and a time, s.
        """
        c, s = context.cos(self.rate * time), context.sin(self.rate * time)
        x, y, pole = self.frame
        first = [c * a + s * b for a, b in zip(x, y, strict=True)]
        turned = [first, cross(pole, first), pole]
        far = norm(context, place)
        u = [x / far for x in apply(turned, place)]
        seen = Harmonics(u, lambda x: x, context, exact=True)
        found = seen.falling(self.coefficients, lambda n: self.radius ** (n + 2), 1 / far)
        return apply(transpose(turned), found)


def frame_of(context: Any, pole: Vector, meridian: Any) -> Matrix:
    """Unit vectors of x, y and z of a body with a pole (of any length), whose longitude 0 is at an angle from
    the ascending node of its equator on the plane XY, or from X if the two coincide.
    """
    pole = [x / norm(context, pole) for x in pole]
    first, _, up = unit_vectors(context)
    node = first if parallel(context, pole, up) else cross(up, pole)
    node = [x / norm(context, node) for x in node]
    c, s = context.cos(meridian), context.sin(meridian)
    first = [c * a + s * b for a, b in zip(node, cross(pole, node), strict=True)]
    return [first, cross(pole, first), pole]
