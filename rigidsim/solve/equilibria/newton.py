"""Newton's method in mpf with central differences, for few unknowns that may be degenerate."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rigidsim.scene.arithmetic import Matrix, Vector, norm

Function = Callable[[Vector], Vector]
_DEGENERATE = 1e-9
"""Singular value, relative to the largest, below which a direction is left alone: it leads from one of many
equilibria to the next.
"""
_HALVINGS, _ROUNDS = 8, 40


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


def shortest(context: Any, matrix: Matrix, values: Vector) -> Vector:
    """The shortest x with matrix x = -values, as far as there is one (Moore and Penrose)."""
    count = len(matrix[0])
    a = context.matrix(matrix)
    sizes, vectors = context.eigsy(a.T * a)
    right = a.T * context.matrix(values)
    largest = max(sizes[k] for k in range(count))
    found = [context.zero] * count
    for k in range(count):
        if sizes[k] > largest * context.mpf(_DEGENERATE) ** 2:
            part = sum(vectors[i, k] * right[i] for i in range(count)) / sizes[k]
            found = [x - part * vectors[i, k] for i, x in enumerate(found)]
    return found


def settled(
    context: Any, residual: Callable[[Any], Vector], moved: Callable[[Any, Vector], Any], at: Any,
    bits: int, slope: Callable[[Any], Matrix],
) -> Any:  # fmt: skip
    """Follow Newton steps from a point until they get no smaller: a zero of the residual, as far as its
    arithmetic of so many bits tells.

    Args:
        moved: the point that a step leads to.
        slope: the Jacobian at a point, or near it.

    Raises:
        NotFound: a step can't make the residual smaller while it is still large.
    """
    here = residual(at)
    size = norm(context, here)
    for _ in range(_ROUNDS):
        step = shortest(context, slope(at), here)
        for halving in range(_HALVINGS if size > context.ldexp(1, -bits // 2) else 1):
            new = moved(at, [x / 2**halving for x in step])
            there = residual(new)
            if norm(context, there) < size:
                break
        else:
            break
        before, size = size, norm(context, there)
        at, here = new, there
        if size == 0 or (size > before / 2 and size < context.ldexp(1, -bits // 2)):
            break
    if size > context.ldexp(1, -bits // 2):
        raise NotFound
    return at
