"""Smooth interpolation of tables by polynomials of fifth degree between neighbouring rows.

Each has the rows' values and, at both ends, the first and second derivatives of the polynomial through the
seven nearest rows (as many as there are, in shorter tables), so that the whole is twice differentiable. It is
local: a piece depends on eight rows around it. Where the rows follow a smooth function, errors fall with the
sixth power of their distance. (Differentiation matrices: Welfert 1997, SIAM J. Numer. Anal. 34, 1640.)

Errors are measured by leaving out and interpolating every other row; for the elements' names see
``rigidsim.scene.orbit_tables.pieces``.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigidsim.scene.kepler import eccentric_anomalies, regular_place
from rigidsim.scene.text_tables import TableError

AXIS, LONGITUDE = "axis", "longitude"
EXCENTRIC, TILTED = ("k", "h"), ("q", "p")
_LARGEST_ERROR = 0.1  # rad, of the direction when every other row is left out
NEAREST = 7
_MOST_ROWS = 4096


class Interpolation:
    """Interpolation between rows of ``values`` (rows, columns), which are ``lengths`` (rows - 1,) apart: of
    floats, or of mpf in arrays of objects.
    """

    def __init__(self, lengths: np.ndarray, values: np.ndarray) -> None:
        self.lengths, self.values = lengths, values
        self._even = bool((lengths == lengths[:1]).all())

    def narrowed(self) -> Interpolation:
        """The same in the platform's longest floating point, of at least double precision."""
        return Interpolation(in_80_bits(self.lengths), in_80_bits(self.values))

    def pieces(self, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of pieces (n,) lengths (n,), and coefficients (n, 6, columns) of the powers of
        (t - t_i) / (t_{i+1} - t_i). Floats must not grow beyond order one.
        """
        lengths, values, count = self.lengths, self.values, min(NEAREST, len(self.values))
        rows, ends = np.unique(np.stack([numbers, numbers + 1]), return_inverse=True)
        first = np.clip(rows - count // 2, 0, len(values) - count)
        near, here = first[:, None] + np.arange(count), rows - first
        # rows at equal distances have equal weights, but near the table's ends
        alike, same = np.unique(here, return_index=True, return_inverse=True)[1:]
        if not self._even:
            alike, same = np.arange(len(rows)), np.arange(len(rows))
        steps = np.cumsum(lengths[near[alike, :-1]], axis=1)  # from the first of the rows around
        offsets = np.concatenate([np.zeros((len(alike), 1), lengths.dtype), steps], axis=1)
        place = here[alike, None]
        offsets = offsets - np.take_along_axis(offsets, place, axis=1)
        around = values[near]
        d, s = (np.einsum("ni,nic->nc", w[same], around)[ends] for w in _weights(offsets, place))
        length = lengths[numbers]
        y0, y1, step = values[numbers], values[numbers + 1], length[:, None]
        a, b = d[0] * step, s[0] * step * step / 2
        # remainder at the far end for the powers 3 to 5: value, derivative, and half the second derivative
        u, v, w = y1 - (y0 + a + b), d[1] * step - (a + b * 2), s[1] * step * step / 2 - b
        powers = [y0, a, b, u * 10 - v * 4 + w, v * 7 - u * 15 - w * 2, u * 6 - v * 3 + w]
        return length, np.stack(powers, axis=1)


def in_80_bits(exact: np.ndarray) -> np.ndarray:
    """Numbers (mpf, in an array of objects) in the platform's longest floating point."""
    if exact.dtype != object:
        return exact
    high = exact.astype(np.float64)
    return high.astype(np.longdouble) + (exact - high).astype(np.float64)


def _weights(offsets: np.ndarray, here: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights of values at offsets (..., n) in the first and second derivative where one of them, of index
    ``here``, is zero.
    """
    apart = offsets[..., :, None] - offsets[..., None, :]
    apart[..., np.arange(offsets.shape[-1]), np.arange(offsets.shape[-1])] = 1
    products = apart.prod(axis=-1)
    inner = -offsets  # from the others to the row itself
    np.put_along_axis(inner, here, 1, axis=-1)
    one = np.take_along_axis(products, here, axis=-1) / (products * inner)
    np.put_along_axis(one, here, 0, axis=-1)
    centre = -one.sum(axis=-1, keepdims=True)
    two = 2 * one * (centre - 1 / inner)
    np.put_along_axis(one, here, centre, axis=-1)
    np.put_along_axis(two, here, 0, axis=-1)
    np.put_along_axis(two, here, -two.sum(axis=-1, keepdims=True), axis=-1)
    return one, two


def left_out(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every other row's number, and values (rows, columns) interpolated there from the others, in float64."""
    kept = Interpolation(np.diff(times[::2]), values[::2])
    rows = np.arange(1, 2 * len(kept.values) - 2, 2)
    lengths, parts = kept.pieces(rows // 2)
    x = ((times[rows] - times[rows - 1]) / lengths)[:, None]
    c = np.moveaxis(parts, 1, 0)
    return rows, ((((c[5] * x + c[4]) * x + c[3]) * x + c[2]) * x + c[1]) * x + c[0]


@dataclass(frozen=True)
class InterpolationError:
    """Largest errors of the source's direction (rad) and, relative, of its distance when every other row is
    left out; with all rows both shrink by a factor, ``expected`` where they follow smooth functions.
    """

    direction: float
    distance: float
    expected: float = 2.0**-6  # an error of the sixth order


def interpolation_error(
    times: np.ndarray, elements: Mapping[str, Any], moving: Collection[str]
) -> InterpolationError:
    """Measure errors of a table with ``elements``: arrays (rows,) if ``moving``, else numbers.

    Raises:
        TableError: rows are so far apart that the table means little between them.
    """
    seconds = (times - times[0]).astype(np.float64)
    exact = {name: np.broadcast_to(np.asarray(x, dtype=np.float64), seconds.shape)
             for name, x in elements.items() if name != LONGITUDE}  # fmt: skip
    timed = LONGITUDE in moving
    if timed:
        values = elements[LONGITUDE] - elements[LONGITUDE][0]
        linear = values[-1] / (times[-1] - times[0])
        exact[LONGITUDE] = (values - linear * (times - times[0])).astype(np.float64)
    rows, found = left_out(seconds, np.array([exact[name] for name in moving]).T)
    if len(rows) > _MOST_ROWS:  # of many those where elements are most in error
        given = np.array([exact[name][rows] for name in moving]).T
        sizes = np.abs((found - given) / np.maximum(np.abs(given).max(axis=0), 1e-300)).max(axis=1)
        worst = np.sort(np.argpartition(sizes, -_MOST_ROWS)[-_MOST_ROWS:])
        rows, found = rows[worst], found[worst]
    guessed = {name: values[rows] for name, values in exact.items()}
    tabulated = dict(guessed)
    for i, name in enumerate(moving):
        guessed[name] = found[:, i]
    direction = distance = 0.0
    # if the anomaly isn't tabulated, the worst of several places on the orbit counts
    phases = [0.0] if timed else [i * math.pi / 4 for i in range(8)]
    base = np.zeros(len(rows))
    if timed:
        turn = 2 * times[0].context.pi
        base = (elements[LONGITUDE][rows] % turn).astype(np.float64)
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
    regular = tuple(elements[name] for name in (*EXCENTRIC, *TILTED))
    k, h = regular[:2]
    periapsis = np.arctan2(h, k)
    eccentric = eccentric_anomalies(longitude - periapsis, np.hypot(k, h)) + periapsis
    turn = np.cos(eccentric), np.sin(eccentric)
    r = 1 - k * turn[0] - h * turn[1]
    return np.array(regular_place(np, regular, turn, 1 / r)), r * elements[AXIS]
