"""The arithmetic in which a scene is worked out: mpmath, with far more digits than the run's own precision.

Everything derived from the config (principal axes, normalised quaternions, pi, coefficients) is computed
here and rounded once, to the working precision, where it enters the equations.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import mpmath

from rigidsim.scene.swept import called

WORKING_BITS = {"single": 24, "double": 53, "extended": 64, "quadruple": 113}
# Enough that cancellation in a derived constant (a difference of moments of 1e-15) still leaves every bit.
GUARD_BITS = 128

_LOST_BITS = 24
"""Bits of the scene's precision that a derived constant may have lost on its way: whatever is smaller
relative to its own terms is the rounding of a zero. Far fewer than the guard bits, so that nothing real is
lost.
"""

Vector = list[Any]
Matrix = list[list[Any]]


def working_bits(precision: str | int) -> int:
    """Bits of the significand of a precision's name, or of a number of decimal digits."""
    if isinstance(precision, str):
        return WORKING_BITS[precision]
    return math.ceil(precision * math.log2(10)) + 2


class _Context(mpmath.MPContext):
    """An mpmath context that inherits its special functions, which each plain one would wrap again."""

    guard_bits: int = GUARD_BITS  # that it has beyond the working precision

    @classmethod
    def _wrap_specfun(cls, *_: Any) -> None:
        """Wrap the special functions once; contexts inherit them as wrapped for ``mpmath.mp``."""

    @staticmethod
    def maximum(values: Iterable[Any]) -> Any:
        """The largest number; unlike ``max`` an operation, which decides nothing for members of a sweep."""
        return max(values)

    @staticmethod
    def minimum(values: Iterable[Any]) -> Any:
        """The smallest number; see ``maximum``."""
        return min(values)


def context_for(precision: str | int, more: int = 0) -> Any:
    """A separate mpmath context (never the global one) with guard bits, and so many more of them."""
    context = _Context()
    context.guard_bits = GUARD_BITS + more
    context.prec = working_bits(precision) + context.guard_bits
    return context


def working_epsilon(context: Any) -> Any:
    """Spacing of the working precision's numbers just above 1, for a scene's context."""
    return context.mpf(2) ** (1 - bits_in_use(context))


def bits_in_use(context: Any) -> int:
    """Bits of the working precision, for a scene's context."""
    return int(context.prec - getattr(context, "guard_bits", GUARD_BITS))


def negligible(context: Any) -> Any:
    """Relative size below which a difference of a quantity is just rounding."""
    return context.mpf(2) ** (_LOST_BITS - context.prec)


def cosine_and_sine(context: Any, angle: Any) -> tuple[Any, Any]:
    """Cosine and sine of an angle; zero where they are the rounding of pi, at whole quarters of a turn."""
    least, pair = negligible(context), (context.cos(angle), context.sin(angle))
    c, s = (x if abs(x) > least else context.zero for x in pair)
    return c, s


def dot(a: Vector, b: Vector) -> Any:
    """Scalar product."""
    return sum((x * y for x, y in zip(a, b, strict=True)), a[0] * 0)


def norm(context: Any, a: Vector) -> Any:
    """Euclidean norm."""
    return context.sqrt(dot(a, a))


def vector(context: Any, given: Sequence[Any] | None) -> Vector:
    """Exact numbers of a config as mpf; zero for none."""
    return [x.at(context) for x in given] if given else [context.zero] * 3


def plus(a: Vector, b: Vector) -> Vector:
    """Sum of vectors."""
    return [x + y for x, y in zip(a, b, strict=True)]


def minus(a: Vector, b: Vector) -> Vector:
    """Difference of vectors."""
    return [x - y for x, y in zip(a, b, strict=True)]


def unit_vectors(context: Any) -> Matrix:
    """The three unit vectors along the axes."""
    return [[context.one if i == j else context.zero for j in range(3)] for i in range(3)]


def cross(a: Vector, b: Vector) -> Vector:
    """Cross product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def across(context: Any, a: Vector, axis: Vector) -> bool:
    """Whether a vector is perpendicular to a unit axis, up to rounding; zero is."""
    return bool(abs(dot(a, axis)) <= negligible(context) * norm(context, a))


def parallel(context: Any, a: Vector, b: Vector) -> bool:
    """Whether two vectors lie on one line, up to rounding."""
    return bool(norm(context, cross(a, b)) <= norm(context, a) * norm(context, b) * negligible(context))


def apply(matrix: Matrix, a: Vector) -> Vector:
    """Matrix times vector."""
    return [dot(row, a) for row in matrix]


def transpose(matrix: Matrix) -> Matrix:
    """Transposed matrix."""
    return [list(column) for column in zip(*matrix, strict=True)]


def multiply(a: Matrix, b: Matrix) -> Matrix:
    """Matrix product."""
    columns = transpose(b)
    return [[dot(row, column) for column in columns] for row in a]


def diagonal(entries: Vector) -> Matrix:
    """Diagonal 3x3 matrix with these entries."""
    zero = entries[0] * 0
    return [[entries[i] if i == j else zero for j in range(3)] for i in range(3)]


def eigen(context: Any, matrix: Matrix) -> tuple[Vector, Matrix]:
    """Principal values and (as rows) right-handed unit axes of a symmetric 3x3 matrix. A diagonal one keeps
    its order and axes; otherwise values ascend, and the first two axes have a positive largest component.
    """
    if all(matrix[i][j] == 0 for i in range(3) for j in range(3) if i != j):
        one = context.one
        return [matrix[i][i] for i in range(3)], diagonal([one, one, one])
    scale = max(abs(x) for row in matrix for x in row)
    values, vectors = context.eigsy(context.matrix(matrix) / scale)
    axes = []
    for k in range(2):
        axis = [vectors[i, k] for i in range(3)]
        largest = max(axis, key=abs)
        length = norm(context, axis)
        axes.append([x / length if largest > 0 else -x / length for x in axis])
    axes.append(cross(axes[0], axes[1]))
    return [values[k] * scale for k in range(3)], axes


def eccentric_anomaly(context: Any, mean: Any, eccentricity: Any) -> Any:
    """Solution of Kepler's equation M = E - e sin E, to the context's precision."""
    return called(_kepler, context, mean, eccentricity)


def _kepler(context: Any, mean: Any, e: Any) -> Any:
    anomaly = mean + e * context.sin(mean)
    # Newton converges quadratically; the count covers any precision from a start that is good to e^2
    for _ in range(12 + int(context.prec).bit_length()):
        step = (anomaly - e * context.sin(anomaly) - mean) / (1 - e * context.cos(anomaly))
        anomaly -= step
        if abs(step) <= context.ldexp(1, -context.prec // 2 - 2):
            break
    return anomaly


_FIRST, _MOST = 32, 1 << 16  # points of Hansen's integrals


def hansen(context: Any, eccentricity: Any, multiple: int, order: int) -> Any:
    """Hansen coefficient X_k^{-3,m} (mpf), to the context's precision: a harmonic in the mean anomaly M of
    the tide along a Kepler orbit,

        <(a/r)^3 exp i (m f - k M)> = (1/2 pi) integral of cos(m f - k M) / (1 - e cos E)^2 dE

    over a turn of the eccentric anomaly E (Hansen 1855; Plummer 1918, section 44); X_{2p}^{-3,2} is H(p, e)
    of Goldreich & Peale 1966. The integrand is periodic and analytic: the trapezoidal rule converges
    geometrically. The ``eccentricity`` is from 0 to below 1, ``multiple`` is k, ``order`` is m.
    """
    if eccentricity == 0:
        return context.one if multiple == order else context.zero
    points = _FIRST
    before = _sum(context, eccentricity, multiple, order, points, 0)
    while points < _MOST:
        found = (before + _sum(context, eccentricity, multiple, order, points, 1)) / 2
        points *= 2
        if abs(found - before) <= context.ldexp(1, 8 - context.prec):
            return found
        before = found
    return before


def _sum(context: Any, e: Any, multiple: int, order: int, points: int, half: int) -> Any:
    """Mean over equally spaced points, or over the midpoints between them."""
    root, total = context.sqrt(1 - e * e), context.zero
    for i in range(points):
        anomaly = 2 * context.pi * (2 * i + half) / (2 * points)
        c, s = context.cos(anomaly), context.sin(anomaly)
        radius = 1 - e * c
        true = context.atan2(root * s, c - e)
        total += context.cos(order * true - multiple * (anomaly - e * s)) / radius**2
    return total / points
