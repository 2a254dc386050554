"""Rotations of many rows at once: quaternions (rows, 4) w x y z, body to space axes, in float64."""

from __future__ import annotations

import numpy as np

from rigidsim.scene.rotations import Rotations, product

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
