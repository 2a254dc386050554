"""Rotations over any arithmetic: mpmath numbers, numpy arrays, heyoka expressions.

Conventions: quaternions [w, x, y, z] and matrices R (lists of rows) rotate body axes to space axes; intrinsic
Euler angles (a, b, c) of the sequence ijk mean R = R_i(a) R_j(b) R_k(c). No sequence is written out
by hand. Every sum is taken in the order in which it stands here: results depend on it in their last bit.
Rotations of many rows at once are quaternions (rows, 4) in float64.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any, TypeAlias

import numpy as np

from rigidsim.scene.arithmetic import Matrix, Vector, transpose

AXES = "xyz"
Scalar: TypeAlias = Any  # whatever has +, -, * and /
Pair: TypeAlias = tuple[Scalar, Scalar]
Sum = Callable[[Sequence[Scalar]], Scalar]


def from_left(terms: Sequence[Scalar]) -> Scalar:
    """Sum of the terms in order."""
    return reduce(add, terms)


def is_proper(sequence: str) -> bool:
    """Whether a sequence of axes is proper, that is, whether its outer axes are the same."""
    return sequence[0] == sequence[2]


def parity(i: int, j: int) -> int:
    """+1 where axis j follows axis i cyclically (xy, yz, zx), else -1."""
    return 1 if (j - i) % 3 == 1 else -1


def product(p: Sequence[Scalar], q: Sequence[Scalar], total: Sum = from_left) -> Vector:
    """Hamilton product p q (first q, then p, as rotations body to space)."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return [
        total([pw * qw, -(px * qx), -(py * qy), -(pz * qz)]),
        total([pw * qx, px * qw, py * qz, -(pz * qy)]),
        total([pw * qy, -(px * qz), py * qw, pz * qx]),
        total([pw * qz, px * qy, -(py * qx), pz * qw]),
    ]


def rotation_matrix(q: Sequence[Scalar]) -> Matrix:
    """Rotation matrix R, body to space axes, of a unit quaternion."""
    w, x, y, z = q
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    return [
        [ww + xx - yy - zz, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), ww - xx + yy - zz, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), ww - xx - yy + zz],
    ]


def shepperd(r: Matrix) -> tuple[Vector, dict[tuple[int, int], Scalar]]:
    """4 q_n^2 and, for m < n, 4 q_m q_n of R's quaternion (Shepperd 1978, J. Guidance and Control 1, 223)."""
    trace = r[0][0] + r[1][1] + r[2][2]
    squares = [1.0 + trace] + [1.0 - trace + 2.0 * r[n][n] for n in range(3)]
    pairs: dict[tuple[int, int], Scalar] = {}
    for n in range(3):
        j, k = (n + 1) % 3, (n + 2) % 3
        pairs[0, n + 1] = r[k][j] - r[j][k]
        pairs[min(n, j) + 1, max(n, j) + 1] = r[n][j] + r[j][n]
    return squares, pairs


def quaternion_of(matrices: np.ndarray) -> np.ndarray:
    """Quaternions (rows, 4) w x y z of rotation matrices (rows, 3, 3), continuous in sign (Shepperd 1978)."""
    m, rest = matrices, 1 - np.trace(matrices, axis1=1, axis2=2)
    products = np.empty((len(m), 4, 4))  # four times the products of the quaternion's components
    products[:, 1:, 1:] = m + m.transpose(0, 2, 1)
    products[:, [1, 2, 3], [1, 2, 3]] += rest[:, None]
    products[:, 0, 0] = 2 - rest
    halves = np.stack([m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]], axis=1)
    products[:, 0, 1:] = products[:, 1:, 0] = halves
    largest = np.einsum("tii->ti", products).argmax(axis=1)
    found = products[np.arange(len(m)), largest]
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    flips = np.where(np.einsum("ij,ij->i", found[1:], found[:-1]) < 0, -1.0, 1.0)
    return np.asarray(found * np.cumprod(np.append(1.0, flips))[:, None])


def outer_angles(sequence: str, r: Matrix) -> tuple[Pair, Pair]:
    """Sine and cosine of first and last Euler angle of R, times the factor that vanishes where singular."""
    i, j, k = map(AXES.index, sequence)
    m, e = 3 - i - j, parity(i, j)
    if i == k:
        return (r[j][i], -e * r[m][i]), (r[i][j], e * r[i][m])
    return (-e * r[j][k], r[k][k]), (-e * r[i][j], r[i][i])


def shared_turn(sequence: str, r: Matrix, side: Scalar) -> Pair:
    """Sine and cosine of a + side c, times 1 + abs(cosine) (proper sequences) or 1 + abs(sine) of the middle
    angle, for the outer Euler angles a and c of R, and the sign ``side`` of ``pole_side``: what is left of
    them in the singularity.
    """
    i, j, k = map(AXES.index, sequence)
    m, e = 3 - i - j, parity(i, j)
    if i == k:
        return e * (r[m][j] - side * r[j][m]), r[j][j] + side * r[m][m]
    return e * (r[k][j] + side * r[j][i]), r[j][j] - side * r[k][i]


def pole_side(sequence: str, r: Matrix) -> Scalar:
    """Element of R: +1 where only the sum of the outer angles is defined, -1 where their difference is."""
    i, _, k = map(AXES.index, sequence)
    return r[i][k]


@dataclass(frozen=True)
class Rotations:
    """Rotations in one arithmetic, which is given by its functions.

    Attributes:
        hypot: length of a vector of two components.
        constant: makes a small whole number.
        negligible: whether a ``hypot`` of components of unit vectors is pure rounding.
        total: sums terms.
    """

    sin: Callable[[Scalar], Scalar]
    cos: Callable[[Scalar], Scalar]
    atan2: Callable[[Scalar, Scalar], Scalar]
    hypot: Callable[[Scalar, Scalar], Scalar]
    constant: Callable[[float], Scalar]
    negligible: Callable[[Scalar], bool]
    total: Sum = from_left

    def multiply(self, a: Matrix, b: Matrix) -> Matrix:
        """Matrix product."""
        return [[self.total([a[i][m] * b[m][j] for m in range(3)]) for j in range(3)] for i in range(3)]

    def apply(self, matrix: Matrix, vector: Vector) -> Vector:
        """Matrix times vector."""
        return [self.total([row[m] * vector[m] for m in range(3)]) for row in matrix]

    def product(self, p: Vector, q: Vector) -> Vector:
        """Hamilton product p q."""
        return product(p, q, self.total)

    def elementary(self, axis: int, angle: Scalar) -> Matrix:
        """R_axis(angle), body to space: a right-handed turn of the body by ``angle`` about ``axis``."""
        cosine, sine = self.cos(angle), self.sin(angle)
        j, k = (axis + 1) % 3, (axis + 2) % 3
        matrix = [[self.constant(float(r == c)) for c in range(3)] for r in range(3)]
        matrix[j][j], matrix[j][k] = cosine, -sine
        matrix[k][j], matrix[k][k] = sine, cosine
        return matrix

    def euler_matrix(self, sequence: str, angles: Vector) -> Matrix:
        """Rotation matrix R of intrinsic Euler angles (radians), body to space."""
        axes = map(AXES.index, sequence)
        return reduce(self.multiply, [self.elementary(*turn) for turn in zip(axes, angles, strict=True)])

    def euler_rates(self, sequence: str, angles: Vector, rates: Vector) -> tuple[Vector, Scalar]:
        """Time derivatives of Euler angles from body rates, and the factor that vanishes when they can't be.

        With v = R_k(c) w, the rates w = R_k^T R_j^T e_i a' + R_k^T e_j b' + e_k c' become
        v = R_j(b)^T e_i a' + e_j b' + e_k c'. The first term has no part along j; its part along the axis p
        that is neither j nor k gives a', then b' and c' follow.

        Returns:
            (a', b', c') and the singular factor: +-sin(b) for proper sequences, +-cos(b) for the others.
        """
        i, j, k = map(AXES.index, sequence)
        p = 3 - j - k
        turned = self.apply(self.elementary(k, angles[2]), rates)
        axis = transpose(self.elementary(j, angles[1]))
        first = turned[p] / axis[p][i]
        return [first, turned[j], turned[k] - axis[k][i] * first], axis[p][i]

    def euler_from_matrix(self, sequence: str, r: Matrix) -> Vector:
        """Intrinsic Euler angles of R: outer ones in (-pi, pi], the middle one in [0, pi] (proper) or
        [-pi/2, pi/2], from its sine and cosine, so that no digits are lost near its ends.

        In the singularity, where only a sum or difference of the outer angles is defined, the last is zero.
        """
        i, j, k = map(AXES.index, sequence)
        m, e = 3 - i - j, parity(i, j)
        atan2, hypot = self.atan2, self.hypot
        if i == k:
            factor = hypot(r[i][j], r[i][m])
            middle, beside = atan2(factor, r[i][i]), r[m][j]
        else:
            factor = hypot(r[i][i], r[i][j])
            middle, beside = atan2(e * r[i][k], factor), r[k][j]
        if self.negligible(factor):
            return [atan2(e * beside, r[j][j]), middle, self.constant(0.0)]
        first, last = outer_angles(sequence, r)
        return [atan2(*first), middle, atan2(*last)]

    def quaternion_from_euler(self, sequence: str, angles: Vector) -> Vector:
        """Unit quaternion of intrinsic Euler angles; it changes sign with each full turn of an angle."""
        turns = []
        for angle, axis in zip(angles, sequence, strict=True):
            half = 0.5 * angle
            turn = [self.cos(half)] + [self.constant(0.0)] * 3
            turn[1 + AXES.index(axis)] = self.sin(half)
            turns.append(turn)
        return reduce(self.product, turns)


# --- many rows at once --------------------------------------------------------------------------------------


TURNS = Rotations(np.sin, np.cos, np.arctan2, np.hypot, float, lambda size: bool(np.all(size == 0)))
SEQUENCES = ("zxz", "zyz", "xyx", "xzx", "yxy", "yzy", "zyx", "xyz", "xzy", "yxz", "yzx", "zxy")


def multiplied(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Hamilton products of quaternions (..., 4), of which one may have fewer axes."""
    parts = product(list(np.moveaxis(one, -1, 0)), list(np.moveaxis(other, -1, 0)))
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def conjugated(quaternions: np.ndarray) -> np.ndarray:
    """The inverse rotations of unit quaternions."""
    return np.asarray(quaternions * np.array([1.0, -1.0, -1.0, -1.0]))


def normalised(quaternions: np.ndarray) -> np.ndarray:
    """Rows of norm one."""
    return np.asarray(quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True))


def angles_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angles (rows,), rad, between attitudes; right to the last digits of small ones."""
    signs = np.where(np.einsum("...i,...i->...", one, other) < 0, -1.0, 1.0)[..., None]
    return np.asarray(
        4
        * np.arctan2(
            np.linalg.norm(one - signs * other, axis=-1), np.linalg.norm(one + signs * other, axis=-1)
        )
    )


def vector_of(quaternions: np.ndarray) -> np.ndarray:
    """Rotation vectors (rows, 3), rad, of at most half a turn."""
    upright = np.where(quaternions[..., :1] < 0, -quaternions, quaternions)
    size = np.linalg.norm(upright[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(size, upright[..., :1])
    factor = np.where(size > 0, angle / np.where(size > 0, size, 1.0), 2.0)
    return np.asarray(upright[..., 1:] * factor)


def of_vector(vectors: np.ndarray) -> np.ndarray:
    """Unit quaternions of rotation vectors (rows, 3), rad."""
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * vectors], axis=-1)


def turned(quaternions: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors (rows, 3) in body axes along space axes."""
    w, v = quaternions[..., :1], quaternions[..., 1:]
    twice = 2 * np.cross(v, vectors)
    return np.asarray(vectors + w * twice + np.cross(v, twice))


def of_euler(sequence: str, angles: np.ndarray) -> np.ndarray:
    """Unit quaternions of intrinsic Euler angles (rows, 3), rad."""
    parts = TURNS.quaternion_from_euler(sequence, list(angles.T))
    return np.stack(np.broadcast_arrays(*parts), axis=-1)
