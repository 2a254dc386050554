"""Attitudes as numbers of mpmath: ``rigidsim.scene.rotations`` in the precision of a context."""

from __future__ import annotations

from typing import Any

from rigidsim.scene.arithmetic import Matrix, Vector, norm
from rigidsim.scene.rotations import AXES, Rotations, parity, product, rotation_matrix, shepperd

__all__ = [
    "AXES",
    "euler_from_matrix",
    "parity",
    "product",
    "quaternion_from_euler",
    "quaternion_from_matrix",
    "rotation_matrix",
    "unit_quaternion",
]


def _within(context: Any) -> Rotations:
    tiny = context.mpf(2) ** (8 - context.prec)
    functions = context.sin, context.cos, context.atan2, context.hypot
    return Rotations(*functions, constant=context.mpf, negligible=lambda length: bool(length < tiny))


def unit_quaternion(context: Any, q: Vector) -> Vector:
    """``q`` over its norm; ``q`` must not be zero."""
    length = norm(context, q)
    return [x / length for x in q]


def quaternion_from_euler(context: Any, angles: Vector, sequence: str) -> Vector:
    """Unit quaternion of the intrinsic Euler angles (radians)."""
    return _within(context).quaternion_from_euler(sequence, angles)


def euler_from_matrix(context: Any, r: Matrix, sequence: str) -> Vector:
    """Intrinsic Euler angles of R; the middle one in [0, pi] (proper) or [-pi/2, pi/2].

    In the singularity, where only a sum or difference of the outer angles is defined, the last is zero.
    """
    return _within(context).euler_from_matrix(sequence, r)


def quaternion_from_matrix(context: Any, r: Matrix) -> Vector:
    """Unit quaternion of R, w >= 0."""
    squares, pairs = shepperd(r)
    largest = max(range(4), key=lambda n: squares[n])
    q = [squares[n] if n == largest else pairs[min(n, largest), max(n, largest)] for n in range(4)]
    q = unit_quaternion(context, q)
    return q if q[0] >= 0 else [-x for x in q]
