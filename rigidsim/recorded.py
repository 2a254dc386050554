"""What a run recorded, with every digit, at the samples that are worth comparing."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import mpmath
import numpy as np


def rows_to_compare(dataset: Any, most: int) -> np.ndarray:
    """All samples, or of each of ``most`` stretches the one where the body turns fastest, and the last."""
    count = dataset.sizes["time"]
    if count <= most:
        return np.arange(count)
    rates = np.zeros(count)
    if "angular_velocity" in dataset:
        rates = np.linalg.norm(dataset["angular_velocity"].values, axis=1)
    elif "quaternion" in dataset:
        turned = np.abs(np.einsum("ij,ij->i", *_neighbours(dataset["quaternion"].values)))
        rates[1:] = np.arccos(np.minimum(turned, 1.0)) / np.diff(dataset["time"].values)
    edges = np.linspace(0, count, most).astype(int)
    picked = [a + int(np.argmax(rates[a:b])) for a, b in pairwise(edges)]
    return np.unique([*picked, count - 1])


def _neighbours(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return values[:-1], values[1:]


def exact_times(dataset: Any, rows: np.ndarray) -> list[Any]:
    """Of some rows, mpf seconds."""
    parts = zip(*parts_of(dataset, "time", rows), strict=True)
    with mpmath.workprec(1200):
        return [mpmath.fsum(float(part) for part in row) for row in parts]


def parts_of(dataset: Any, name: str, rows: np.ndarray) -> list[np.ndarray]:
    """A variable's float64 parts at some rows."""
    names = [name, *(n for n in (f"{name}_lo", *(f"{name}_lo{i}" for i in range(2, 20))) if n in dataset)]
    return [np.asarray(dataset[n].values[rows]) for n in names]
