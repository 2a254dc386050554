"""Free tumbling of many bodies at once: periods, mean precession, points of the polhode; all float64 arrays.

Moments a < b < c in this order; short-axis mode (SAM) where L^2 > 2 E b: L circles the axis of the largest
moment in the body, which for an asteroid is its shortest axis; long-axis mode (LAM) else. Formulas: Landau &
Lifshitz, Mechanics, section 37; Jacobi's functions by SciPy.
Good to about 1e-13 away from the separatrix, which is what studies of measured bodies need; the digits of
``closed_forms`` are for comparisons with runs.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ellipj, ellipkm1

_POINTS = 64  # of a mean over half a period; the rest falls like exp(-64 pi K(1 - m) / K(m))


@dataclass(frozen=True)
class Tumbling:
    """States of free rotation, each attribute (bodies,).

    Attributes: momentum: abs(L). short: True in short-axis mode. excitation: 2 E c / L^2: 1 for rotation
        about the axis of the largest moment, which has the least energy that a momentum can have (E / E0 of
        Pravec et al. 2014). rotation: period of the body rates, P_psi = 4 K / p. precession: period in
        which the circled axis goes round L on average, P_phi. effective: 2 E / L, the rate of the sphere
        that has as much of both.
    """

    momentum: np.ndarray
    short: np.ndarray
    excitation: np.ndarray
    rotation: np.ndarray
    precession: np.ndarray
    effective: np.ndarray


@dataclass(frozen=True)
class Polhode:
    """Amplitudes and argument of the rates (w_i, w_b, w_j) = (A cn, B sn, C dn)(p t).

    Attributes:
        order: of the axes: that of cn, the middle one, that of dn; (bodies, 3).
        amplitudes: (bodies, 3), in that order.
        p, m, quarter: rate, parameter and quarter period K of the elliptic functions.
    """

    order: np.ndarray
    amplitudes: np.ndarray
    p: np.ndarray
    m: np.ndarray
    quarter: np.ndarray

    def rates(self, u: np.ndarray) -> np.ndarray:
        """Angular velocity at arguments (bodies,) or (bodies, points), body axes, (..., 3)."""
        wide = u if u.ndim == 2 else u[:, None]
        sn, cn, dn, _ = ellipj(wide, np.maximum(self.m, 0)[:, None])  # rounding may make it negative
        told = np.stack([cn, sn, dn], axis=-1) * self.amplitudes[:, None, :]
        found = np.empty_like(told)
        np.put_along_axis(found, np.broadcast_to(self.order[:, None, :], told.shape), told, axis=-1)
        return found if u.ndim == 2 else found[:, 0]


def polhode(moments: np.ndarray, momentum: np.ndarray, excitation: np.ndarray) -> Polhode:
    """Of bodies with these moments (bodies, 3), ascending, abs(L) and 2 E c / L^2."""
    square = momentum**2
    twice = excitation * square / moments[:, 2]
    short = square > twice * moments[:, 1]
    order = np.where(short[:, None], [0, 1, 2], [2, 1, 0])
    a, b, c = np.take_along_axis(moments, order, axis=1).T
    across, along = square - twice * c, square - twice * a
    p = np.sqrt(along * (c - b) / (a * b * c))
    m = across * (a - b) / (along * (c - b))
    complement = (c - a) * (square - twice * b) / (along * (c - b))
    amplitudes = np.sqrt(
        np.stack([across / (a * (a - c)), across / (b * (b - c)), along / (c * (c - a))], axis=1)
    )
    return Polhode(order, amplitudes, p, m, ellipkm1(complement))


def tumbling(moments: np.ndarray, momentum: np.ndarray, excitation: np.ndarray) -> Tumbling:
    """Periods of bodies; arguments as of ``polhode``."""
    path = polhode(moments, momentum, excitation)
    u = path.quarter[:, None] * 2 * np.arange(_POINTS) / _POINTS  # all means have half the rates' period
    rates = np.take_along_axis(
        path.rates(u), np.broadcast_to(path.order[:, None, :], (len(u), _POINTS, 3)), 2
    )
    a, b, _ = (row[:, None] for row in np.take_along_axis(moments, path.order, axis=1).T)
    x, y = rates[..., 0] ** 2, rates[..., 1] ** 2
    turning = momentum * ((a * x + b * y) / (a * a * x + b * b * y)).mean(axis=1)
    twice = excitation * momentum**2 / moments[:, 2]
    rotation, precession = 4 * path.quarter / path.p, 2 * np.pi / turning
    return Tumbling(momentum, path.order[:, 2] == 2, excitation, rotation, precession, twice / momentum)


def tumbling_of(moments: np.ndarray, rates: np.ndarray) -> Tumbling:
    """Of bodies that turn at these rates (bodies, 3)."""
    momentum = np.linalg.norm(moments * rates, axis=1)
    twice = (moments * rates**2).sum(axis=1)
    return tumbling(moments, momentum, twice * moments[:, 2] / momentum**2)


def excitation_of(moments: np.ndarray, ratio: np.ndarray) -> np.ndarray:
    """The 2 E c / L^2 of short-axis modes for which P_psi / P_phi has these values; nan where none has."""
    one = np.ones(len(moments))
    low, high = one * (1 + 1e-12), moments[:, 2] / moments[:, 1] * (1 - 1e-12)

    def ratio_at(excitation: np.ndarray) -> np.ndarray:
        found = tumbling(moments, one, excitation)
        return found.rotation / found.precession

    possible = ratio_at(low) <= ratio
    for _ in range(45):
        middle = (low + high) / 2
        above = ratio_at(middle) > ratio
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return np.where(possible, (low + high) / 2, np.nan)
