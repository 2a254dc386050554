"""Interpolation errors of tabulated elements, measured by leaving out and interpolating every other row.

Names of the elements without singularities, see ``rigidsim.scene.orbit_tables.pieces``.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigidsim.scene.orbit_tables.elements import TableError
from rigidsim.scene.orbit_tables.interpolation import ORDER, left_out

AXIS, LONGITUDE = "axis", "longitude"
EXCENTRIC, TILTED = ("k", "h"), ("q", "p")
_LARGEST_ERROR = 0.1  # rad, of the direction when every other row is left out


@dataclass(frozen=True)
class InterpolationError:
    """Interpolation errors when every other row is left out and interpolated from the others.

    Attributes:
        direction: largest error of the source's direction, rad.
        distance: largest relative error of the distance.
        expected: factor by which both shrink with all rows present, if the rows follow smooth functions.
    """

    direction: float
    distance: float
    expected: float = 2.0**-ORDER


def interpolation_error(
    times: Sequence[Any], elements: Mapping[str, Sequence[Any]], moving: Collection[str]
) -> InterpolationError:
    """Measure the interpolation errors of a table.

    Args:
        times: mpf, s.
        elements: elements of each row (mpf, SI); with the mean longitude if it is one that changes.
        moving: names of those that change.

    Raises:
        TableError: rows so far apart that the table means little between them.
    """
    begin = times[0]
    seconds = np.array([float(t - begin) for t in times])
    exact = {n: np.array([float(x) for x in rows]) for n, rows in elements.items() if n != LONGITUDE}
    timed = LONGITUDE in moving
    if timed:
        values = elements[LONGITUDE]
        linear = (values[-1] - values[0]) / (times[-1] - begin)
        pairs = zip(values, times, strict=True)
        exact[LONGITUDE] = np.array([float(x - values[0] - linear * (t - begin)) for x, t in pairs])
    rows, found = left_out(seconds, np.array([exact[name] for name in moving]).T)
    guessed = {name: values[rows] for name, values in exact.items()}
    tabulated = dict(guessed)
    for i, name in enumerate(moving):
        guessed[name] = found[:, i]
    direction = distance = 0.0
    # if the anomaly isn't tabulated, the worst of several places on the orbit counts
    phases = [0.0] if timed else [i * math.pi / 4 for i in range(8)]
    base = np.zeros(len(rows))
    if timed:
        turn = 2 * begin.context.pi
        base = np.array([float(elements[LONGITUDE][r] % turn) for r in rows])
    for phase in phases:
        shift = guessed.get(LONGITUDE, 0.0) - tabulated.get(LONGITUDE, 0.0)
        one, r_one = _places(tabulated, base + phase)
        two, r_two = _places(guessed, base + phase + shift)
        direction = max(direction, float(np.linalg.norm(one - two, axis=0).max()))
        distance = max(distance, float(np.abs(r_two / r_one - 1).max()))
    if not direction <= _LARGEST_ERROR:
        raise TableError(
            f"its rows are too far apart: with every other row left out, interpolation misses the "
            f"direction by {direction:.2g} rad; {_LARGEST_ERROR} or less is allowed: give more rows"
        )
    return InterpolationError(direction, distance)


def _places(elements: Mapping[str, np.ndarray], longitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors (3, n) and distances (n,) of regular elements, in double precision."""
    k, h, q, p = (elements[name] for name in (*EXCENTRIC, *TILTED))
    eccentric = longitude + k * np.sin(longitude) - h * np.cos(longitude)
    for _ in range(60):  # Newton; from e < 1 it converges within a few dozen steps
        c, s = np.cos(eccentric), np.sin(eccentric)
        step = (eccentric - k * s + h * c - longitude) / (1 - k * c - h * s)
        eccentric = eccentric - np.clip(step, -1.0, 1.0)
    c, s = np.cos(eccentric), np.sin(eccentric)
    beta = 1 / (1 + np.sqrt(1 - k * k - h * h))
    r = 1 - k * c - h * s
    x = ((1 - h * h * beta) * c + h * k * beta * s - k) / r
    y = ((1 - k * k * beta) * s + h * k * beta * c - h) / r
    chi = np.sqrt(1 - p * p - q * q)
    place = [
        (1 - 2 * p * p) * x + 2 * p * q * y,
        2 * p * q * x + (1 - 2 * q * q) * y,
        2 * chi * (q * y - p * x),
    ]
    return np.array(place), r * elements[AXIS]
