"""Free librations of the Moon, from two motions that differ by nothing else: forced librations cancel."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import least_squares

MONTH, NODE = 27.321661, -6798.384
"""Sidereal month, and period of the orbit's node, which moves backwards; days."""
ECLIPTIC = math.radians(84381.406 / 3600)


def smoothed(days: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means over twelve months with a Hann window: what goes round with the orbit vanishes."""
    window = np.hanning(2 * round(6 * MONTH / (days[1] - days[0])) + 3)[1:-1]
    window /= window.sum()
    half = len(window) // 2
    return days[half:-half], np.stack([np.convolve(x, window, "valid") for x in values.T], axis=1)


def longitude(days: np.ndarray, body: np.ndarray) -> float:
    """Period (days) of the libration in longitude, from small turns about the body axes."""
    t, values = smoothed(days, body[:, 2:])
    return _period(t, values, 1056.0, 1)[0]


def wobble(days: np.ndarray, body: np.ndarray) -> tuple[float, float]:
    """Period (days) of the axis' path in the body, and the ratio of its axes."""
    t, values = smoothed(days, body[:, :2])
    period, size = _period(t, values, 27257.0, 0)
    return period, float(size[0] / size[1])


def latitude(days: np.ndarray, space: np.ndarray) -> float:
    """Period (days) of the precession in the frame of the orbit's node, from small turns about the axes of
    the ICRF.
    """
    t, values = smoothed(days, space)
    across = math.cos(ECLIPTIC) * values[:, 1] + math.sin(ECLIPTIC) * values[:, 2]
    signal = values[:, 0] + 1j * across
    slow = [k / NODE for k in (-2, -1, 0, 1, 2)]

    def rest(point: np.ndarray) -> np.ndarray:
        rates = [sign * point[0] / 1e5 + rate for sign in (1, -1) for rate in slow]
        matrix = np.stack([np.exp(2j * math.pi * rate * t) for rate in rates], axis=1)
        found = signal - matrix @ np.linalg.lstsq(matrix, signal, rcond=None)[0]
        return np.concatenate([found.real, found.imag])

    rate = float(least_squares(rest, [-3.4], x_scale=0.01).x[0]) / 1e5
    return 1 / (rate - 1 / NODE)


def _period(t: np.ndarray, values: np.ndarray, near: float, order: int) -> tuple[float, np.ndarray]:
    """The period that is common to columns, beside a polynomial, and its amplitudes."""

    def matrix(period: float) -> np.ndarray:
        phase = 2 * math.pi * t / period
        return np.stack([*((t / t[-1]) ** k for k in range(order + 1)), np.cos(phase), np.sin(phase)], axis=1)

    def rest(point: np.ndarray) -> np.ndarray:
        columns = matrix(near * math.exp(point[0]))
        return np.asarray((values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]).ravel())

    found = least_squares(rest, [0.0], x_scale=1e-3, xtol=1e-14, ftol=1e-14)
    period = near * math.exp(float(found.x[0]))
    parts = np.linalg.lstsq(matrix(period), values, rcond=None)[0]
    return period, np.hypot(parts[-2], parts[-1])
