"""Smooth interpolation of tables by polynomials of fifth degree between neighbouring rows.

Each has the rows' values and, at both ends, the first and second derivatives of the polynomial through the
seven nearest rows (as many as there are, in shorter tables), so that the whole is twice differentiable. It is
local: a piece depends on eight rows around it. Where the rows follow a smooth function, errors fall with the
sixth power of their distance. (Differentiation matrices: Welfert 1997, SIAM J. Numer. Anal. 34, 1640.)

Errors are measured by leaving out and interpolating every other row; for the elements' names see
``rigidsim.scene.orbit_tables.pieces``.
"""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from rigidsim.scene.kepler import eccentric_anomalies, regular_place
from rigidsim.scene.text_tables import TableError

AXIS, LONGITUDE = "axis", "longitude"
EXCENTRIC, TILTED = ("k", "h"), ("q", "p")
_LARGEST_ERROR = 0.1  # rad, of the direction when every other row is left out
NEAREST = 7


class Interpolation:
    """Interpolation between rows (times, columns) of floats, or of mpf in an array of objects."""

    def __init__(self, times: Sequence[Any], values: np.ndarray) -> None:
        self.times = times
        self.values = values
        self._count = min(NEAREST, len(times))
        self._derivatives: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._weights: dict[tuple[Any, ...], tuple[np.ndarray, np.ndarray]] = {}

    def piece(self, number: int) -> np.ndarray:
        """Coefficients (6, columns) of the powers of (t - t_i) / (t_{i+1} - t_i)."""
        length = self.times[number + 1] - self.times[number]
        y0, y1 = self.values[number], self.values[number + 1]
        (d0, s0), (d1, s1) = self._at(number), self._at(number + 1)
        square = length * length / 2
        a, b = d0 * length, s0 * square  # arrays first: mpmath would print one that it doesn't know
        # remainder at the far end for the powers 3 to 5: value, derivative, and half the second derivative
        u = y1 - (y0 + a + b)
        v = d1 * length - (a + b * 2)
        w = s1 * square - b
        return np.array([y0, a, b, u * 10 - v * 4 + w, v * 7 - u * 15 - w * 2, u * 6 - v * 3 + w])

    def narrow_pieces(self, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same of many pieces (n,) in 80 bits, which become doubles: lengths (n,) in units of
        time, and coefficients (n, 6, columns). Columns must not grow beyond order one.
        """
        lengths, values = self._narrow
        both = np.stack([numbers, numbers + 1])
        first = np.clip(both - self._count // 2, 0, len(self.times) - self._count)
        near = first[..., None] + np.arange(self._count)
        ends = np.cumsum(lengths[near[..., :-1]], axis=-1)  # from the first of the rows around
        offsets = np.concatenate([np.zeros((*both.shape, 1), np.longdouble), ends], axis=-1)
        here = (both - first)[..., None]
        offsets = offsets - np.take_along_axis(offsets, here, axis=-1)
        d, s = (np.einsum("ani,anic->anc", w, values[near]) for w in _weights(offsets, here))
        length = lengths[numbers]
        y0, y1, step = values[numbers], values[numbers + 1], length[:, None]
        a, b = d[0] * step, s[0] * step * step / 2
        u, v, w = y1 - (y0 + a + b), d[1] * step - (a + 2 * b), s[1] * step * step / 2 - b
        powers = [y0, a, b, 10 * u - 4 * v + w, 7 * v - 15 * u - 2 * w, 6 * u - 3 * v + w]
        return length, np.stack(powers, axis=1)

    @cached_property
    def _narrow(self) -> tuple[np.ndarray, np.ndarray]:
        """Lengths between rows, and values, in 80 bits."""
        lengths = [b - a for a, b in pairwise(self.times)]
        return _in_80_bits(lengths), _in_80_bits(self.values.ravel()).reshape(self.values.shape)

    def _at(self, row: int) -> tuple[np.ndarray, np.ndarray]:
        """First and second derivatives (columns,) at a row, by finite differences."""
        if row not in self._derivatives:
            first = min(max(row - self._count // 2, 0), len(self.times) - self._count)
            near = range(first, first + self._count)
            one, two = self._differentiation(tuple(self.times[j] - self.times[row] for j in near))
            rows = self.values[first : first + self._count]
            self._derivatives[row] = one @ rows, two @ rows
        return self._derivatives[row]

    def _differentiation(self, offsets: tuple[Any, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Weights of the values at offsets from a row in its first and second derivative."""
        if offsets not in self._weights:
            here = next(i for i, x in enumerate(offsets) if x == 0)
            products = [math.prod([x - y for y in offsets if y != x]) for x in offsets]
            one = [
                products[here] / (p * (offsets[here] - x)) if i != here else x
                for i, (x, p) in enumerate(zip(offsets, products, strict=True))
            ]
            one[here] = -sum(w for i, w in enumerate(one) if i != here)
            two = [
                2 * w * (one[here] - 1 / (offsets[here] - x)) if i != here else x
                for i, (w, x) in enumerate(zip(one, offsets, strict=True))
            ]
            two[here] = -sum(w for i, w in enumerate(two) if i != here)
            self._weights[offsets] = np.array(one), np.array(two)
        return self._weights[offsets]


def _in_80_bits(numbers: Iterable[Any]) -> np.ndarray:
    """Numbers (mpf) as the platform's longest floating point, of at least double precision."""
    exact = list(numbers)
    high = np.array([float(x) for x in exact])
    low = np.array([float(x - one) for x, one in zip(exact, high.tolist(), strict=True)])
    return high.astype(np.longdouble) + low


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
    kept = Interpolation(list(times[::2]), values[::2])
    rows = np.arange(1, 2 * len(kept.times) - 2, 2)
    found = []
    for row in rows:
        part = kept.piece(int(row) // 2)
        x = (times[row] - times[row - 1]) / (times[row + 1] - times[row - 1])
        found.append(((((part[5] * x + part[4]) * x + part[3]) * x + part[2]) * x + part[1]) * x + part[0])
    return rows, np.array(found)


@dataclass(frozen=True)
class InterpolationError:
    """Largest errors of the source's direction (rad) and, relative, of its distance when every other row is
    left out; with all rows both shrink by a factor, ``expected`` where they follow smooth functions.
    """

    direction: float
    distance: float
    expected: float = 2.0**-6  # an error of the sixth order


def interpolation_error(
    times: Sequence[Any], elements: Mapping[str, Sequence[Any]], moving: Collection[str]
) -> InterpolationError:
    """Measure the interpolation errors of a table with ``elements`` of each row (mpf, SI), of which those
    ``moving`` change; ``TableError`` for rows so far apart that the table means little between them.
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
    regular = tuple(elements[name] for name in (*EXCENTRIC, *TILTED))
    k, h = regular[:2]
    periapsis = np.arctan2(h, k)
    eccentric = eccentric_anomalies(longitude - periapsis, np.hypot(k, h)) + periapsis
    turn = np.cos(eccentric), np.sin(eccentric)
    r = 1 - k * turn[0] - h * turn[1]
    return np.array(regular_place(np, regular, turn, 1 / r)), r * elements[AXIS]
