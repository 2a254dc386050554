"""Attitudes in mpmath numbers: ``rigidsim.scene.rotations`` in the precision of a context.

The residue of a zero (the cosine of 90 degrees, a difference of equal products) is set to zero: single
precision can't hold it, and an unstable equilibrium must not be left because of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rigidsim.errors import ConfigError
from rigidsim.scene import rotations
from rigidsim.scene.arithmetic import GUARD_BITS, Matrix, Vector, negligible, norm
from rigidsim.scene.rotations import Rotations, shepperd


def _within(context: Any) -> Rotations:
    tiny = context.mpf(2) ** (8 - context.prec)

    def sine(angle: Any) -> Any:
        return _without_rounding(context.sin(angle), [angle])

    def cosine(angle: Any) -> Any:
        return _without_rounding(context.cos(angle), [angle])

    functions = sine, cosine, context.atan2, context.hypot
    is_tiny = lambda length: bool(length < tiny)  # noqa: E731
    return Rotations(*functions, constant=context.mpf, negligible=is_tiny, total=total)


def _without_rounding(value: Any, terms: Sequence[Any]) -> Any:
    """The value, or zero if it is the rounding of its terms; floats and arrays, without guard bits, stay."""
    context = getattr(value, "context", None)
    if context is None or context.prec < GUARD_BITS:
        return value
    size = rotations.from_left([abs(term) for term in terms])  # not compared: members of a sweep may differ
    return value * 0 if abs(value) < negligible(context) * size else value


def total(terms: Sequence[Any]) -> Any:
    """Sum of terms, or zero if it is their rounding."""
    return _without_rounding(rotations.from_left(terms), terms)


def product(p: Sequence[Any], q: Sequence[Any]) -> Vector:
    """Hamilton product p q (first q, then p, as rotations body to space)."""
    return rotations.product(p, q, total)


def rotation_matrix(q: Vector) -> Matrix:
    """Rotation matrix R, body to space axes, of a unit quaternion."""
    w, x, y, z = q
    pairs = {(0, 1): (x * y, w * z), (0, 2): (x * z, w * y), (1, 2): (y * z, w * x)}
    return [
        [_without_rounding(r, pairs[min(i, j), max(i, j)] if i != j else (1.0,)) for j, r in enumerate(row)]
        for i, row in enumerate(rotations.rotation_matrix(q))
    ]


def unit_quaternion(context: Any, q: Vector) -> Vector:
    """``q`` over its norm; ``q`` must not be zero."""
    length = norm(context, q)
    return [x / length for x in q]


def quaternion_from_euler(context: Any, angles: Vector, sequence: str) -> Vector:
    """Unit quaternion of the intrinsic Euler angles (radians)."""
    return _within(context).quaternion_from_euler(sequence, angles)


def euler_from_matrix(context: Any, r: Matrix, sequence: str) -> Vector:
    """Intrinsic Euler angles of R; see ``Rotations.euler_from_matrix``."""
    return _within(context).euler_from_matrix(sequence, r)


def quaternion_from_matrix(context: Any, r: Matrix) -> Vector:
    """Unit quaternion of R, w >= 0."""
    squares, pairs = shepperd(r)
    largest = max(range(4), key=lambda n: squares[n])
    q = [squares[n] if n == largest else pairs[min(n, largest), max(n, largest)] for n in range(4)]
    q = unit_quaternion(context, q)
    return q if q[0] >= 0 else [-x for x in q]


def given_attitude(
    context: Any, table: Any, sequence: str, refusal: Callable[[str, str], ConfigError]
) -> tuple[Vector, Vector | None] | None:
    """Unit quaternion of a table's ``quaternion`` or ``euler_angles``, and these; or None."""
    if table.euler_angles is not None:
        if table.quaternion is not None:
            what = "given with quaternion; only one attitude is allowed: remove one of them"
            raise refusal("euler_angles", what)
        angles = [x.at(context) for x in table.euler_angles]
        most = context.ldexp(context.one, context.prec // 2)
        if (largest := context.maximum([abs(x) for x in angles])) > most:  # their turns swamp the rest
            what = (
                f"given {context.nstr(largest, 3)} rad; up to {context.nstr(most, 3)} rad are allowed: leave "
            )
            raise refusal("euler_angles", f"{what}out whole turns")
        return quaternion_from_euler(context, angles, sequence), angles
    if table.quaternion is None:
        return None
    q = [x.at(context) for x in table.quaternion]
    if all(x == 0 for x in q):
        raise refusal("quaternion", "given zero; [w, x, y, z] with a norm that is not zero is allowed")
    return unit_quaternion(context, q), None
