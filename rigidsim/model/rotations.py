"""Rotations as heyoka expressions: everything about Euler angles follows from elementary rotations.

No sequence is written out by hand: R = R_i(a) R_j(b) R_k(c) is a product of elementary matrices, and the
angles' rates follow from w = R_k^T R_j^T e_i a' + R_k^T e_j b' + e_k c' (body axes).
"""

from __future__ import annotations

from typing import Any

import heyoka as hy

from rigidsim.scene.attitude import AXES, parity

Expression = Any
ExpressionMatrix = list[list[Expression]]


def constant(value: float) -> Expression:
    """A small whole number or dyadic fraction, exact at every precision."""
    return hy.expression(float(value))


def elementary(axis: int, angle: Expression) -> ExpressionMatrix:
    """R_axis(angle), body to space: a right-handed turn of the body by ``angle`` about ``axis``."""
    cosine, sine = hy.cos(angle), hy.sin(angle)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    matrix = [[constant(float(r == c)) for c in range(3)] for r in range(3)]
    matrix[j][j], matrix[j][k] = cosine, -sine
    matrix[k][j], matrix[k][k] = sine, cosine
    return matrix


def multiply(a: ExpressionMatrix, b: ExpressionMatrix) -> ExpressionMatrix:
    """Matrix product; heyoka drops the terms with zeros."""
    return [[hy.sum([a[i][m] * b[m][j] for m in range(3)]) for j in range(3)] for i in range(3)]


def apply(matrix: ExpressionMatrix, vector: list[Expression]) -> list[Expression]:
    """Matrix times vector."""
    return [hy.sum([row[m] * vector[m] for m in range(3)]) for row in matrix]


def transpose(matrix: ExpressionMatrix) -> ExpressionMatrix:
    """Rows become columns."""
    return [list(column) for column in zip(*matrix, strict=True)]


def euler_matrix(sequence: str, angles: list[Expression]) -> ExpressionMatrix:
    """R of intrinsic Euler angles, body to space."""
    i, j, k = (AXES.index(axis) for axis in sequence)
    first, second, third = (elementary(n, a) for n, a in zip((i, j, k), angles, strict=True))
    return multiply(multiply(first, second), third)


def euler_rates(
    sequence: str, angles: list[Expression], rates: list[Expression]
) -> tuple[list[Expression], Expression]:
    """Time derivatives of the angles from the body rates, and the factor that vanishes when they can't be.

    With v = R_k(c) w, the relation becomes v = R_j(b)^T e_i a' + e_j b' + e_k c'. The first term has no
    part along j; its part along the axis p that is neither j nor k gives a', then b' and c' follow.

    Returns:
        (a', b', c') and the singular factor: +-sin(b) for proper sequences, +-cos(b) for the others.
    """
    i, j, k = (AXES.index(axis) for axis in sequence)
    p = 3 - j - k
    turned = apply(elementary(k, angles[2]), rates)
    axis = transpose(elementary(j, angles[1]))
    first = turned[p] / axis[p][i]
    return [first, turned[j], turned[k] - axis[k][i] * first], axis[p][i]


def euler_from_matrix(sequence: str, r: ExpressionMatrix) -> list[Expression]:
    """Intrinsic Euler angles of R: outer ones in (-pi, pi], the middle one from atan2 of the sine and
    cosine, so that no digits are lost near its ends.
    """
    i, j, k = (AXES.index(axis) for axis in sequence)
    m = 3 - i - j
    e = parity(i, j)
    if i == k:
        sine = hy.sqrt(r[i][j] * r[i][j] + r[i][m] * r[i][m])
        return [
            hy.atan2(r[j][i], -e * r[m][i]),
            hy.atan2(sine, r[i][i]),
            hy.atan2(r[i][j], e * r[i][m]),
        ]
    cosine = hy.sqrt(r[i][i] * r[i][i] + r[i][j] * r[i][j])
    return [
        hy.atan2(-e * r[j][k], r[k][k]),
        hy.atan2(e * r[i][k], cosine),
        hy.atan2(-e * r[i][j], r[i][i]),
    ]


def quaternion_matrix(q: list[Expression]) -> ExpressionMatrix:
    """R of a unit quaternion [w, x, y, z], body to space."""
    w, x, y, z = q
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    return [
        [ww + xx - yy - zz, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), ww - xx + yy - zz, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), ww - xx - yy + zz],
    ]


def quaternion_product(p: list[Expression], q: list[Expression]) -> list[Expression]:
    """Hamilton product p q."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return [
        hy.sum([pw * qw, -(px * qx), -(py * qy), -(pz * qz)]),
        hy.sum([pw * qx, px * qw, py * qz, -(pz * qy)]),
        hy.sum([pw * qy, -(px * qz), py * qw, pz * qx]),
        hy.sum([pw * qz, px * qy, -(py * qx), pz * qw]),
    ]


def quaternion_from_euler(sequence: str, angles: list[Expression]) -> list[Expression]:
    """Unit quaternion of intrinsic Euler angles; it changes sign with each full turn of an angle."""
    result: list[Expression] | None = None
    for angle, axis in zip(angles, sequence, strict=True):
        half = 0.5 * angle
        turn = [hy.cos(half)] + [constant(0.0)] * 3
        turn[1 + AXES.index(axis)] = hy.sin(half)
        result = turn if result is None else quaternion_product(result, turn)
    assert result is not None
    return result


def quaternion_from_matrix(r: ExpressionMatrix) -> list[Expression]:
    """Quaternion of R up to sign (Shepperd 1978, J. Guidance and Control 1, 223).

    The component with the largest square is found first, so that the division is never by a small number.
    """
    trace = r[0][0] + r[1][1] + r[2][2]
    squares = [1.0 + trace] + [1.0 - trace + 2.0 * r[n][n] for n in range(3)]
    pairs: dict[tuple[int, int], Expression] = {}
    for n in range(3):
        j, k = (n + 1) % 3, (n + 2) % 3
        pairs[0, n + 1] = r[k][j] - r[j][k]
        pairs[min(n, j) + 1, max(n, j) + 1] = r[n][j] + r[j][n]
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
