"""Attitudes as numbers in mpmath: quaternions, elementary rotations, Euler angles of any sequence.

Conventions (the interface's): quaternions are [w, x, y, z] and rotate body axes to space axes; Euler
angles (a, b, c) of the intrinsic sequence ijk mean R = R_i(a) R_j(b) R_k(c), body to space.
"""

from __future__ import annotations

from typing import Any

from rigidsim.scene.context import Matrix, Vector, norm

AXES = "xyz"


def unit_quaternion(context: Any, q: Vector) -> Vector:
    """``q`` over its norm; ``q`` must not be zero."""
    length = norm(context, q)
    return [x / length for x in q]


def product(p: Vector, q: Vector) -> Vector:
    """Hamilton product p q (first q, then p, as rotations body to space)."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return [
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    ]


def rotation_matrix(q: Vector) -> Matrix:
    """R (body to space) of a unit quaternion, as rows."""
    w, x, y, z = q
    return [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]


def quaternion_from_euler(context: Any, angles: Vector, sequence: str) -> Vector:
    """Unit quaternion of the intrinsic Euler angles (radians)."""
    result = [context.one, context.zero, context.zero, context.zero]
    for angle, axis in zip(angles, sequence, strict=True):
        turn = [context.cos(angle / 2)] + [context.zero] * 3
        turn[1 + AXES.index(axis)] = context.sin(angle / 2)
        result = product(result, turn)
    return result


def euler_from_matrix(context: Any, r: Matrix, sequence: str) -> Vector:
    """Intrinsic Euler angles of R; the middle one in [0, pi] (proper) or [-pi/2, pi/2].

    In the singularity, where only a sum or difference of the outer angles is defined, the last is zero.
    """
    i, j, k = (AXES.index(axis) for axis in sequence)
    m = 3 - i - j
    e = parity(i, j)
    tiny = context.mpf(2) ** (8 - context.prec)
    if i == k:
        sine = context.hypot(r[i][j], r[i][m])
        middle = context.atan2(sine, r[i][i])
        if sine < tiny:
            return [context.atan2(e * r[m][j], r[j][j]), middle, context.zero]
        return [context.atan2(r[j][i], -e * r[m][i]), middle, context.atan2(r[i][j], e * r[i][m])]
    cosine = context.hypot(r[i][i], r[i][j])
    middle = context.atan2(e * r[i][k], cosine)
    if cosine < tiny:
        return [context.atan2(e * r[k][j], r[j][j]), middle, context.zero]
    return [context.atan2(-e * r[j][k], r[k][k]), middle, context.atan2(-e * r[i][j], r[i][i])]


def parity(i: int, j: int) -> int:
    """+1 where axis j follows axis i cyclically (xy, yz, zx), else -1."""
    return 1 if (j - i) % 3 == 1 else -1


def quaternion_from_matrix(context: Any, r: Matrix) -> Vector:
    """Unit quaternion of R, w >= 0 (Shepperd 1978: the largest of the four goes first)."""
    trace = r[0][0] + r[1][1] + r[2][2]
    squares = [1 + trace] + [1 - trace + 2 * r[i][i] for i in range(3)]
    largest = max(range(4), key=lambda n: squares[n])
    pairs = {(0, n + 1): r[(n + 2) % 3][(n + 1) % 3] - r[(n + 1) % 3][(n + 2) % 3] for n in range(3)}
    pairs |= {(a + 1, b + 1): r[a][b] + r[b][a] for a, b in ((0, 1), (0, 2), (1, 2))}
    q = [squares[n] if n == largest else pairs[(min(n, largest), max(n, largest))] for n in range(4)]
    q = unit_quaternion(context, q)
    return q if q[0] >= 0 else [-x for x in q]
