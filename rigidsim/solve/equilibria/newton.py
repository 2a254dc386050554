"""Newton's method in mpf with central differences, for few unknowns that may be degenerate, and exponents by
which motions near a zero go on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rigidsim.scene.arithmetic import Matrix, Vector, norm

Function = Callable[[Vector], Vector]
_HALVINGS, _ROUNDS = 8, 40
_STILL = 1e-9
_PATIENCE = 4  # rounds without gain
_CLOSE = 1e-6
"""Residual up to which a whole step may make it larger: where some directions count far less than others, it
leads on all the same.
"""
_POOR = 0.1
"""Part of a residual that a step with a good Jacobian doesn't leave."""


class NotFound(Exception):
    """No zero was reached."""


def jacobian(context: Any, function: Function, count: int, bits: int) -> Matrix:
    """Jacobian (rows of outputs) at zero of a function known to so many bits, to two thirds of them."""
    step = context.ldexp(1, -(bits // 3))
    columns = []
    for i in range(count):
        ahead, behind = (
            function([sign * step if j == i else context.zero for j in range(count)]) for sign in (1, -1)
        )
        columns.append([(a - b) / (2 * step) for a, b in zip(ahead, behind, strict=True)])
    return [list(row) for row in zip(*columns, strict=True)]


def shortest(context: Any, matrix: Matrix, values: Vector, bits: int) -> Vector:
    """The shortest x with matrix x = -values, as far as there is one (Moore and Penrose).

    Directions whose singular value, relative to the largest, is below half of so many bits are left alone:
    they lead from one of many equilibria to the next.
    """
    count = len(matrix[0])
    a = context.matrix(matrix)
    sizes, vectors = context.eigsy(a.T * a)
    right = a.T * context.matrix(values)
    least = max(sizes[k] for k in range(count)) * context.ldexp(1, -bits)
    found = [context.zero] * count
    for k in range(count):
        if sizes[k] > least:
            part = sum(vectors[i, k] * right[i] for i in range(count)) / sizes[k]
            found = [x - part * vectors[i, k] for i, x in enumerate(found)]
    return found


@dataclass(frozen=True)
class Newton:
    """Newton's method for a residual of so many bits, which keeps its Jacobian while steps gain by it.

    Attributes:
        residual: of a point.
        moved: the point that a step leads to.
        unknowns: their number.
    """

    context: Any
    bits: int
    residual: Callable[[Any], Vector]
    moved: Callable[[Any, Vector], Any]
    unknowns: int

    @property
    def uncertainty(self) -> Any:
        """Of eigenvalues of a Jacobian whose elements are about 1, at a point that is nearly the zero."""
        return max(self.context.ldexp(16, -(2 * self.bits // 3)), self.context.mpf(_STILL))

    def slope(self, at: Any) -> Matrix:
        """Jacobian at a point."""
        return jacobian(
            self.context, lambda step: self.residual(self.moved(at, step)), self.unknowns, self.bits
        )

    def settled(self, at: Any, known: Matrix | None = None) -> Any:
        """Follow steps from a point until they gain no more: a zero, as far as the residual's bits tell.

        Args:
            known: the Jacobian near the point, if it is known.

        Raises:
            NotFound: no step makes the residual smaller while it is still large.
        """
        context, fresh = self.context, known is None
        near, noise = context.ldexp(1, -self.bits // 2), context.ldexp(1, 16 - self.bits)
        slope = self.slope(at) if known is None else known
        here = self.residual(at)
        size = norm(context, here)
        best, worse = (size, at), 0
        for _ in range(_ROUNDS):
            step = shortest(context, slope, here, self.bits)
            for halving in range(_HALVINGS):
                new = self.moved(at, [x / 2**halving for x in step])
                there = self.residual(new)
                if norm(context, there) < max(size, _CLOSE):
                    break
            else:
                break
            gained = norm(context, there) / size
            at, here, size = new, there, norm(context, there)
            worse = 0 if size < best[0] else worse + 1
            best = min(best, (size, at), key=lambda pair: pair[0])
            if size <= noise or worse >= _PATIENCE or (worse and fresh and best[0] < near):
                break
            fresh = bool(gained > _POOR)
            if fresh:
                slope = self.slope(at)
        if best[0] > near:
            raise NotFound
        return best[1]


# --- what becomes of small displacements ------------------------------------------------------------------


def exponents_of(
    context: Any, matrix: Matrix, still: Any, period: Any | None = None, nutation: Any | None = None
) -> tuple[tuple[tuple[float, float], ...], bool]:
    """Exponents (1/s) of a linear system's matrix, or of its map over a period (s), as of ``FoundStart``, and
    whether none grows.

    Args:
        still: uncertainty of the exponents, 1/s, below which a part of one is zero.
        nutation: angle (rad) of a fast nutation over the period, many turns of it, which is left out.
    """
    values, _ = context.eig(context.matrix(matrix))
    values = list(values)
    for angle in () if nutation is None else (nutation, -nutation):
        turned = context.expj(angle)
        values.remove(min(values, key=lambda value: abs(value - turned)))
    if period is not None:
        values = [context.log(value) / period for value in values]
    found = []
    for value in values:
        real, imaginary = (context.zero if abs(x) <= still else x for x in (value.real, value.imag))
        if imaginary >= 0:
            found.append((float(real), float(imaginary)))
    found.sort(key=lambda pair: (pair[1], pair[0]))
    return tuple(found), all(real <= 0 for real, _ in found)
