"""A free rotation over one turn of its wobble, in double precision: what averaging over it removes.

At the amplitude f of Jacobi's functions (see ``free_motion``) the body's principal axes follow from a frame
with z along the angular momentum by R_z(g t) R_z(phase) R_x(nodding) R_z(own). With theta = l t, any function
of f is a sum of harmonics c_j exp(i j theta). One that precesses i times is a sum of c_j exp i(i g t + j l
t), of which an average keeps i = j = 0; the rest has the integral over time c_j exp i(i g t + j l t) / (i (i
g + j l)).
"""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from rigidsim.model.averaged.free_motion import FreeMotion
from rigidsim.scene.arithmetic import Vector, dot

_POINTS = 256
ORDERS = np.fft.fftfreq(_POINTS, 1 / _POINTS)
"""j of the harmonics."""
_LEAST = 1e-12  # of the largest harmonic, which rounding leaves


class Wobble:
    """A free rotation of amplitudes P (``axial``) and Q (``transverse``) from f = ``amplitude`` on.

    Attributes:
        amplitudes: f at equal steps of time, the present one first.
        momentum: along the principal axes, (3, points).
        size: of the momentum.
        parameter: k^2.
        rates: g and l; l is signed.
        turns: rotations from the principal axes to a frame that precesses at g, (points, 3, 3).
    """

    def __init__(
        self, moments: Sequence[Any], axial: float, transverse: float, amplitude: float = 0.0
    ) -> None:
        first, second, third = (float(x) for x in moments)
        ratio = first * (second - third) / (second * (first - third)) if first != second else 1.0
        self.moments, root = np.array([first, second, third]), math.sqrt(ratio)
        self.parameter = (1 - ratio) * (transverse / axial) ** 2 if ratio != 1 else 0.0
        self.size = math.hypot(axial, root * transverse)
        means = _means(self.parameter)
        self._theta = _wobbled(amplitude, means)
        self.amplitudes = _amplitudes(self._theta + 2 * np.pi * np.arange(_POINTS) / _POINTS, means)
        cosine, sine, sign = np.cos(self.amplitudes), np.sin(self.amplitudes), math.copysign(1.0, transverse)
        delta = np.sqrt(1 - self.parameter * sine**2)
        self.momentum = np.array([root * transverse * cosine, transverse * sine, axial * delta])
        # f' = pace dn, of which 1 / dn has the mean 2 K / pi
        wobble = axial * (third - second) / (root * second * third) * means[-1][0]
        squares = ratio * cosine**2, sine**2
        rate = self.size * (squares[0] / first + squares[1] / second) / (squares[0] + squares[1])
        self.rates = float(rate.mean()), wobble
        parts = np.fft.fft(rate) / np.where(ORDERS == 0, 1.0, 1j * ORDERS * wobble if wobble else math.inf)
        phase = np.fft.ifft(np.where(ORDERS == 0, 0.0, parts)).real
        nodding = np.arctan2(np.hypot(*self.momentum[:2]), self.momentum[2])
        own = np.arctan2(sign * root * cosine, sign * sine)
        self.turns = _about_z(phase) @ _about_x(nodding) @ _about_z(own)

    @classmethod
    def of(cls, motion: FreeMotion, direction: Vector | None = None) -> "Wobble":
        """The wobble of a free motion, SI, from where the momentum has this direction (unit, body axes)."""
        first, transverse, axial = (float(motion.momentum * x) for x in motion.amplitudes)
        amplitude = 0.0
        if direction is not None and transverse != 0:
            along = [float(dot(axis, direction)) for axis in motion.axes[:2]]
            amplitude = math.atan2(along[1], along[0] * transverse / first)
        return cls(motion.moments, axial, transverse, amplitude)

    @property
    def excess(self) -> float:
        """See ``FreeMotion``."""
        squares = (self.momentum**2).mean(axis=1) / self.size**2
        return float(3 * self.moments @ squares - self.moments.sum()) / 2

    def removed(self, values: np.ndarray, order: int, scale: float, least: float = 0.0) -> Any:
        """At the present f, the integral over time without a mean of rates (.., points) that precess so many
        times, in the frame that precesses. Harmonics that are rounding of a scale are left out, and those
        whose frequencies are below ``least`` times their sizes.
        """
        parts, frequencies = np.fft.fft(values) / _POINTS, order * self.rates[0] + ORDERS * self.rates[1]
        sizes = np.abs(parts)
        moving = (np.abs(frequencies) > least * sizes) & (sizes > _LEAST * scale) & (frequencies != 0)
        return np.where(moving, parts / np.where(moving, 1j * frequencies, 1.0), 0.0).sum(axis=-1)

    def precessed(self, matrix: np.ndarray) -> float:
        """Angle of precession of a rotation from the principal axes to a frame with z along the momentum."""
        turned = matrix @ self.turns[0].T
        return math.atan2(turned[1, 0] - turned[0, 1], turned[0, 0] + turned[1, 1])

    # --- the inertia tensor ---------------------------------------------------------------------------------

    @cached_property
    def tensor(self) -> np.ndarray:
        """T_zz - tr T / 3, T_xz + i T_yz and (T_xx - T_yy) / 2 + i T_xy, which precess 0, 1 and 2 times."""
        excess = self.moments - self.moments.min()  # a sphere's part is constant
        t = np.einsum("nab,b,ncb->acn", self.turns, excess, self.turns)
        parts = [t[2, 2] - excess.sum() / 3 + 0j, t[0, 2] + 1j * t[1, 2]]
        return np.array([*parts, (t[0, 0] - t[1, 1]) / 2 + 1j * t[0, 1]])

    def strong(self, weak: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Sizes, i, j and i g + j l of the tensor's harmonics that averaging removes, (harmonics,), as far as
        they are larger than a part of the largest moment.
        """
        sizes = np.abs(np.fft.fft(self.tensor) / _POINTS)
        sizes[0, 0] = 0.0
        i, j = np.nonzero(sizes > weak * self.moments.max())
        return sizes[i, j], i, ORDERS[j], i * self.rates[0] + ORDERS[j] * self.rates[1]

    def removed_tensor(self, precession: float) -> np.ndarray:
        """Integral over time of the tensor's part that averaging removes, (3, 3), in the momentum's frame."""
        scale = float(np.ptp(self.moments))
        parts = [self.removed(self.tensor[i], i, scale) * np.exp(1j * i * precession) for i in range(3)]
        axial, once, twice = parts[0].real, parts[1], parts[2]
        return np.array(
            [
                [-axial / 2 + twice.real, twice.imag, once.real],
                [twice.imag, -axial / 2 - twice.real, once.imag],
                [once.real, once.imag, axial],
            ]
        )


def _means(parameter: float) -> list[tuple[float, float]]:
    """Arithmetic-geometric means of 1 and k' (Abramowitz & Stegun 16.4)."""
    found = [(1.0, math.sqrt(1 - parameter))]
    while abs(found[-1][0] - found[-1][1]) > 1e-16 * found[-1][0] and len(found) < 40:
        a, b = found[-1]
        found.append(((a + b) / 2, math.sqrt(a * b)))
    return found


def _amplitudes(theta: np.ndarray, means: list[tuple[float, float]]) -> np.ndarray:
    """Jacobi's amplitude of 2 K theta / pi, by descending transformations of Landen."""
    phase = 2.0 ** (len(means) - 1) * theta
    for a, b in reversed(means[:-1]):
        phase = (phase + np.arcsin(np.clip((a - b) / (a + b) * np.sin(phase), -1, 1))) / 2
    return phase


def _wobbled(amplitude: float, means: list[tuple[float, float]]) -> float:
    """The inverse, pi F(amplitude) / (2 K)."""
    for a, b in means[:-1]:
        turned = math.remainder(amplitude, 2 * math.pi)
        amplitude += math.atan2(b * math.sin(turned), a * math.cos(turned)) + amplitude - turned
    return amplitude / 2.0 ** (len(means) - 1)


def _about_z(angle: np.ndarray) -> np.ndarray:
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.moveaxis(np.array([[c, -s, zero], [s, c, zero], [zero, zero, one]]), 2, 0)


def _about_x(angle: np.ndarray) -> np.ndarray:
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.moveaxis(np.array([[one, zero, zero], [zero, c, -s], [zero, s, c]]), 2, 0)
