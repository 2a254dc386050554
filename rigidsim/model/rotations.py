"""Rotations as heyoka expressions: ``rigidsim.scene.rotations`` applied to heyoka's functions and sums."""

from __future__ import annotations

from typing import Any

import heyoka as hy

from rigidsim.scene import rotations
from rigidsim.scene.arithmetic import transpose as transpose

Symbolic = Any
SymbolicMatrix = list[list[Symbolic]]


def constant(value: float) -> Symbolic:
    """A small whole number or dyadic fraction, exact at every precision."""
    return hy.expression(float(value))


def _length(x: Symbolic, y: Symbolic) -> Symbolic:
    return hy.sqrt(x * x + y * y)


def along(a: list[Symbolic], b: list[Symbolic]) -> Symbolic:
    """Scalar product a . b."""
    return hy.sum([x * y for x, y in zip(a, b, strict=True)])


def length(vector: list[Symbolic]) -> Symbolic:
    """Euclidean length."""
    return hy.sqrt(hy.sum([x * x for x in vector]))


def unit(vector: list[Symbolic]) -> list[Symbolic]:
    """The vector divided by its length; NaN for zero."""
    size = length(vector)
    return [x / size for x in vector]


def _never(_: Symbolic) -> bool:
    return False  # an expression has no value yet: Euler angles are not defined in their singularity


# heyoka's sums drop zero terms
_HEYOKA = rotations.Rotations(hy.sin, hy.cos, hy.atan2, _length, constant, _never, hy.sum)
apply = _HEYOKA.apply
multiply = _HEYOKA.multiply
elementary = _HEYOKA.elementary
euler_matrix = _HEYOKA.euler_matrix
euler_rates = _HEYOKA.euler_rates
euler_from_matrix = _HEYOKA.euler_from_matrix
quaternion_matrix = rotations.rotation_matrix
quaternion_product = _HEYOKA.product
quaternion_from_euler = _HEYOKA.quaternion_from_euler


def quaternion_from_matrix(r: SymbolicMatrix, *, differentiable: bool = False) -> list[Symbolic]:
    """Quaternion of R up to sign; the component with the largest square is selected at evaluation.

    If ``differentiable``, other branches stay finite: heyoka's derivative multiplies them by zero.
    """
    squares, pairs = rotations.shepperd(r)
    if differentiable:  # the largest is at least 1
        squares = [hy.select(hy.gt(square, 0.5), square, 0.5) for square in squares]
    branches = []
    for largest in range(4):
        divisor = 2.0 * hy.sqrt(squares[largest])
        branches.append(
            [
                0.5 * hy.sqrt(squares[n])
                if n == largest
                else pairs[min(n, largest), max(n, largest)] / divisor
                for n in range(4)
            ]
        )
    result, best = branches[0], squares[0]
    for n in range(1, 4):
        larger = hy.gt(squares[n], best)
        result = [hy.select(larger, new, old) for new, old in zip(branches[n], result, strict=True)]
        best = hy.select(larger, squares[n], best)
    return result


def quaternion_kinematics(q: list[Symbolic], rates: list[Symbolic]) -> list[Symbolic]:
    """q (0, w) / 2 for a quaternion [w, x, y, z] and rates in body axes."""
    w, x, y, z = q
    p, r, s = rates
    return [
        0.5 * (-x * p - y * r - z * s),
        0.5 * (w * p + y * s - z * r),
        0.5 * (w * r + z * p - x * s),
        0.5 * (w * s + x * r - y * p),
    ]
