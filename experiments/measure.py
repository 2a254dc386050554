"""Measuring: rates of angles, crossings between samples, attitudes as matrices."""

from collections.abc import Sequence
from typing import Any

import mpmath
import numpy as np

from rigidsim.scene.rotations import rotation_matrix


def phase_rate(time: np.ndarray, angle: np.ndarray) -> float:
    """Rate (rad/s) of an angle that grows linearly: least squares over all samples, unwrapped.

    The noise of n samples averages out as sqrt(12 / n) / duration.
    """
    phase = np.unwrap(angle)
    centred = time - time.mean()
    return float(centred @ (phase - phase.mean()) / (centred @ centred))


class Interpolant:
    """Polynomial through the samples around a time, in the current mpmath precision.

    With n points of spacing h and the nearest complex singularity r away, its error in the middle is
    about ((n/2)!)^2 (h / r)^n.

    Args:
        time, values: sequences of floats or mpf.
        index: the polynomial's points lie evenly around ``time[index]`` and ``time[index + 1]``.
        points: how many.
    """

    def __init__(self, time: Sequence[Any], values: Sequence[Any], index: int, points: int) -> None:
        first = min(max(index + 1 - points // 2, 0), len(time) - points)
        self.nodes = [mpmath.mpf(t) for t in time[first : first + points]]
        self.values = [mpmath.mpf(v) for v in values[first : first + points]]
        unit = self.nodes[1] - self.nodes[0]
        self.weights = [
            1 / mpmath.fprod((a - b) / unit for j, b in enumerate(self.nodes) if j != i)
            for i, a in enumerate(self.nodes)
        ]

    def __call__(self, t: Any) -> Any:
        """Barycentric formula (Berrut & Trefethen 2004, equation 4.2)."""
        above = below = mpmath.mpf(0)
        for node, value, weight in zip(self.nodes, self.values, self.weights, strict=True):
            if t == node:
                return value
            part = weight / (t - node)
            above += part * value
            below += part
        return above / below


def crossings(
    time: Sequence[Any], values: Sequence[Any], *, direction: int = 0, points: int = 12
) -> list[Any]:
    """Times (mpf) at which the values cross zero, between samples.

    Args:
        time, values: samples, floats or mpf; several tens of them between two crossings.
        direction: 1 upward, -1 downward, 0 both.
        points: of the interpolating polynomials; crossings closer to either end are left out.
    """
    signs = np.sign(np.array([float(v) for v in values]))
    found = []
    for i in np.nonzero(signs[:-1] * signs[1:] <= 0)[0].tolist():
        way = signs[i + 1] - signs[i]
        if signs[i + 1] == 0 or (direction and way * direction <= 0):
            continue
        if not points // 2 <= i + 1 <= len(signs) - points // 2:
            continue
        polynomial = Interpolant(time, values, i, points)
        found.append(_root(polynomial, mpmath.mpf(time[i]), mpmath.mpf(time[i + 1])))
    return found


def _root(function: Any, a: Any, b: Any) -> Any:
    """A root in [a, b] by the Illinois form of false position, to the current precision."""
    fa, fb = function(a), function(b)
    if fa == 0:
        return a
    width = abs(b - a)
    for _ in range(60):
        c = b - fb * (b - a) / (fb - fa)
        fc = function(c)
        if fc * fb < 0:
            a, fa = b, fb
        else:
            fa = fa / 2
        moved = abs(c - b)
        b, fb = c, fc
        if fb == 0 or moved < width * mpmath.mpf(10) ** (4 - mpmath.mp.dps):
            break
    return b


def value_at(time: Sequence[Any], values: Sequence[Any], t: Any, points: int = 12) -> Any:
    """The values between samples, at time ``t`` (mpf)."""
    index = int(np.searchsorted(np.array([float(x) for x in time]), float(t))) - 1
    return Interpolant(time, values, max(index, 0), points)(t)


def matrices(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3), body to space, of quaternions (n, 4), normalised here."""
    unit = (quaternion / np.linalg.norm(quaternion, axis=1)[:, None]).T
    return np.moveaxis(np.array(rotation_matrix(list(unit))), 2, 0)


def tilt(quaternion: np.ndarray) -> np.ndarray:
    """Angle (rad) between the body's z axis and the vertical Z; accurate for tiny angles too."""
    w, x, y, z = quaternion.T
    return 2 * np.arctan2(np.hypot(x, y), np.hypot(w, z))
