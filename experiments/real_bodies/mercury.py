"""Mercury's libration in longitude: the angle of an attitude, its lines, and published ones."""

import math
from dataclasses import dataclass

import numpy as np

ARCSEC = math.radians(1 / 3600)
YEAR = 365.25
FORCED = (11.862, 5.931, 5.663, 14.73, 6.58, 3.954)
"""Periods of forced librations, yr: Jupiter and its harmonics, Venus (the third), Saturn, the Earth."""
HARMONICS = 6


def anomaly(days: np.ndarray) -> np.ndarray:
    """Mean anomaly of Mercury, rad, so many days after J2000 (Archinal et al. 2018)."""
    return np.asarray(np.radians(174.7910857 + 4.092335 * days))


def angle(quaternion: np.ndarray) -> np.ndarray:
    """Angle of the x axis about the mean z axis, rad, continuous, from where that plane cuts the XY plane."""
    w, x, y, z = quaternion.T
    first = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)
    pole = np.mean(
        np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1), axis=0
    )
    pole /= np.linalg.norm(pole)
    node = np.array([-pole[1], pole[0], 0.0]) / math.hypot(pole[0], pole[1])
    return np.unwrap(np.arctan2(first @ np.cross(pole, node), first @ node))


@dataclass(frozen=True)
class Libration:
    """Lines of a libration in longitude.

    Attributes:
        rate: mean rate at J2000, deg/day.
        annual: amplitudes of sin kM, arcsec, from k = 1.
        quadrature: the largest of cos kM, arcsec.
        forced: amplitudes by period (yr), arcsec.
        free: complex amplitude of the free libration, as C exp(i s t) with t from the first sample, arcsec.
        period: the free libration's, yr.
        rest: what is left over, arcsec, rms.
    """

    rate: float
    annual: list[float]
    quadrature: float
    forced: dict[float, float]
    free: complex
    period: float
    rest: float


def fit(days: np.ndarray, turned: np.ndarray, near: float) -> Libration:
    """All lines, a parabola, and a free libration that is well seen, of a period (yr) near a given one."""
    width = 0.05
    for _ in range(4):  # the rest is quadratic in the period, near its least value
        tried = [lines(days, turned, near + step) for step in (-width, 0.0, width)]
        a, b, c = (one.rest**2 for one in tried)
        if a - 2 * b + c > 0:
            near += max(min(width * (a - c) / (2 * (a - 2 * b + c)), 5 * width), -5 * width)
        width /= 4
    return lines(days, turned, near)


def lines(days: np.ndarray, turned: np.ndarray, free: float) -> Libration:
    """All lines, a parabola, and a free libration of a given period (yr), by least squares."""
    centuries, m = days / 36525, anomaly(days)
    columns = [centuries**k for k in range(3)]
    for k in range(1, HARMONICS + 1):
        columns += [np.sin(k * m), np.cos(k * m)]
    for period in (*FORCED, free):
        phase = 2 * math.pi * (days - days[0]) / (YEAR * period)
        columns += [np.cos(phase), np.sin(phase)]
    matrix = np.stack(columns, axis=1)
    found, *_ = np.linalg.lstsq(matrix, turned / ARCSEC, rcond=None)
    annual, late = found[3 : 3 + 2 * HARMONICS], found[3 + 2 * HARMONICS :]
    return Libration(
        float(found[1]) / 3600 / 36525,
        annual[::2].tolist(),
        float(np.abs(annual[1::2]).max()),
        {period: float(np.hypot(*late[2 * i : 2 * i + 2])) for i, period in enumerate(FORCED)},
        complex(late[-2], -late[-1]),
        free,
        float(np.std(turned / ARCSEC - matrix @ found)),
    )
