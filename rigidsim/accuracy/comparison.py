"""Comparison of attitudes with every digit, at the samples that matter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise, zip_longest
from typing import TYPE_CHECKING

import mpmath
import numpy as np

from rigidsim.scene.config import Experiment
from rigidsim.scene.parts_of_values import parts_in
from rigidsim.scene.scene import build_scene

if TYPE_CHECKING:
    import xarray


def angles_between(one: Sequence[np.ndarray], other: Sequence[np.ndarray]) -> np.ndarray:
    """Rotation angles (n,) in rad between attitudes given as float64 parts (n, 4) of quaternions.

    Small angles keep their digits: parts are subtracted before anything is rounded.
    """
    opposite = np.einsum("ij,ij->i", one[0], other[0]) < 0
    sign = np.where(opposite, -1.0, 1.0)[:, None]
    chord = np.linalg.norm(_differences(one, [sign * part for part in other]), axis=1)
    return np.asarray(4 * np.arcsin(np.minimum(chord / 2, 1.0)))


def distances_between(one: Sequence[np.ndarray], other: Sequence[np.ndarray]) -> np.ndarray:
    """Distances (n,) between positions given as float64 parts (n, 3), subtracted before rounding."""
    return np.asarray(np.linalg.norm(_differences(one, other), axis=1))


def _differences(one: Sequence[np.ndarray], other: Sequence[np.ndarray]) -> np.ndarray:
    rows = np.stack([*one, *(-part for part in other)], axis=-1)
    return np.array([[math.fsum(parts) for parts in row] for row in rows]).reshape(one[0].shape)


def rotation_vectors(one: Sequence[np.ndarray], other: Sequence[np.ndarray]) -> np.ndarray:
    """Rotation vectors (n, 3), rad, from the attitudes of one motion to another's, in the body axes of
    the first; of directions the smallest rotations, in space axes, that take one to the other.

    Args:
        one, other: float64 parts (n, 4) of quaternions, or (n, 3) of directions, which are subtracted before
            anything is rounded.
    """
    first, turns, sign = one[0], 1.0, np.ones((len(one[0]), 1))
    if first.shape[1] == 4:
        turns, sign = 2.0, np.where(np.einsum("ij,ij->i", first, other[0]) < 0, -1.0, 1.0)[:, None]
    pairs = zip_longest(one, other, fillvalue=np.zeros_like(first))
    apart = np.sum([sign * b - a for a, b in pairs], axis=0)
    sine = np.cross(first[:, -3:], apart[:, -3:])
    if first.shape[1] == 4:  # vector part of conj(q) dq; conj(q) q has none
        sine = first[:, :1] * apart[:, 1:] - apart[:, :1] * first[:, 1:] - sine
    size = np.linalg.norm(sine, axis=1)
    angle = turns * np.arctan2(size, 1.0 + np.einsum("ij,ij->i", first, apart))
    return np.asarray(sine * np.where(size > 0, angle / np.where(size > 0, size, 1.0), turns)[:, None])


def spread_times(experiment: Experiment, count: int, until: float = 1.0) -> list[mpmath.mpf]:
    """Up to ``count`` times over the first part ``until`` of a run, its end included, as mpf.

    Each is a double, so that every precision from double on means the same moment by it.
    """
    scene = build_scene(experiment)
    start, last = float(scene.start), float(scene.samples.last)
    grid = start + (last - start) * until * np.arange(1, count + 1) / count
    return [mpmath.mpf(float(t)) for t in grid]


def rows_to_compare(dataset: xarray.Dataset, most: int) -> np.ndarray:
    """All samples, or the one of fastest rotation in each of ``most`` stretches, and the last."""
    count = dataset.sizes["time"]
    if count <= most:
        return np.arange(count)
    rates = np.zeros(count)
    if "angular_velocity" in dataset:
        rates = np.linalg.norm(dataset["angular_velocity"].values, axis=1)
    elif "quaternion" in dataset:
        attitudes = dataset["quaternion"].values
        turned = np.abs(np.einsum("ij,ij->i", attitudes[:-1], attitudes[1:]))
        rates[1:] = np.arccos(np.minimum(turned, 1.0)) / np.abs(np.diff(dataset["time"].values))
    edges = np.linspace(0, count, most).astype(int)
    picked = [a + int(np.argmax(rates[a:b])) for a, b in pairwise(edges)]
    return np.unique([*picked, count - 1])


def exact_times(dataset: xarray.Dataset, rows: np.ndarray) -> list[mpmath.mpf]:
    """Times of some rows, s (mpf)."""
    parts = zip(*parts_of(dataset, "time", rows), strict=True)
    with mpmath.workprec(1200):
        return [mpmath.fsum(float(part) for part in row) for row in parts]


def parts_of(dataset: xarray.Dataset, name: str, rows: np.ndarray) -> list[np.ndarray]:
    """A variable's float64 parts at some rows."""
    return [np.asarray(dataset[part].values[rows]) for part in parts_in(dataset, name)]
