"""Harmonics that averaging removes: of the inertia tensor of a freely turning body, and of an orbit.

In a frame whose z axis is along the angular momentum the tensor is R_z(g t) T(l t) R_z(g t)^T with the rates
g and l of ``free_motion``; its parts of order i = 0, 1, 2 about z,

    T_zz - tr T / 3,   T_xz + i T_yz,   (T_xx - T_yy) / 2 + i T_xy,

are sums of harmonics c_ij exp i (i g t + j l t). A source's (a/r)^3 r r^T is one of exp(i k n t). All of it
is in double precision: it decides whether an average applies, and gives small corrections.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rigidsim.model.averaged.free_motion import FreeMotion
from rigidsim.scene.kepler import eccentric_anomalies

_POINTS = 256
_LEAST = 1e-12  # of the largest harmonic


@dataclass(frozen=True)
class BodySpectrum:
    """Harmonics of the inertia tensor of a freely turning body."""

    motion: FreeMotion
    rates: tuple[float, float]  # g and l, rad/s
    harmonics: np.ndarray  # (3, points) complex, c_ij in kg m^2 by i and by j as in ``fftfreq``
    turns: np.ndarray  # (points, 3, 3), T's rotation from the principal axes at equal steps of the wobble

    @cached_property
    def orders(self) -> tuple[np.ndarray, np.ndarray]:
        """i and j of each harmonic, (3, points)."""
        j = np.fft.fftfreq(_POINTS, 1 / _POINTS)
        return np.repeat(np.arange(3.0)[:, None], _POINTS, axis=1), np.repeat(j[None, :], 3, axis=0)

    @cached_property
    def frequencies(self) -> np.ndarray:
        """i g + j l of each harmonic, rad/s."""
        i, j = self.orders
        return np.asarray(i * self.rates[0] + j * self.rates[1])

    @cached_property
    def oscillating(self) -> np.ndarray:
        """Mask of the nonzero harmonics that averaging removes, (3, points)."""
        sizes = np.abs(self.harmonics)
        found = sizes > _LEAST * max(float(sizes.max()), float(max(self.motion.moments)) * 1e-6)
        found[0, 0] = False
        return np.asarray(found)

    def strong(self, weak: float) -> np.ndarray:
        """Mask of those that are larger than a part of the largest moment, (3, points)."""
        sizes = np.abs(self.harmonics)
        return np.asarray(self.oscillating & (sizes > weak * max(float(x) for x in self.motion.moments)))

    def phases(self, matrix: np.ndarray) -> tuple[float, float]:
        """Phases (rad) of precession and wobble for a rotation from the principal axes of ``motion`` to a
        frame with z along the momentum.
        """
        m = matrix[2]
        first, second, _ = (float(x) for x in self.motion.amplitudes)
        wobble = 0.0
        if first > 0 and second > 0 and not self.motion.symmetric:
            signed = second if self.motion.moments[2] > self.motion.moments[1] else -second
            amplitude = math.atan2(m[1] / signed, m[0] / first)
            wobble = _wobble_angle(amplitude, float(self.motion.parameter))
        at = np.array([self._at(entry, wobble) for entry in self.turns.reshape(_POINTS, 9).T]).reshape(3, 3)
        if self.motion.symmetric:
            at = self.turns[0]
            # turns about the symmetry axis have no effect: only the azimuth of that axis counts
            own, seen = at[:, 2], matrix[:, 2]
            if math.hypot(seen[0], seen[1]) < 1e-300:
                return 0.0, 0.0
            return math.atan2(seen[1], seen[0]) - math.atan2(own[1], own[0]), 0.0
        turned = matrix @ at.T
        return math.atan2(turned[1, 0] - turned[0, 1], turned[0, 0] + turned[1, 1]), wobble

    @staticmethod
    def _at(values: np.ndarray, angle: float) -> float:
        """Trigonometric interpolation of a periodic function between its points."""
        coefficients = np.fft.fft(values) / _POINTS
        j = np.fft.fftfreq(_POINTS, 1 / _POINTS)
        return float((coefficients * np.exp(1j * j * angle)).sum().real)

    def tensors(self, precession: float, wobble: float) -> tuple[np.ndarray, np.ndarray]:
        """Oscillating part of the tensor (3, 3), kg m^2, and its integral over time without a mean, at given
        phases of precession and wobble, in the momentum's frame.
        """
        i, j = self.orders
        waves = np.where(self.oscillating, self.harmonics, 0.0) * np.exp(1j * (i * precession + j * wobble))
        slow = np.where(self.oscillating, 1j * self.frequencies, 1.0)
        return _tensor(waves.sum(axis=1)), _tensor((waves / slow).sum(axis=1))


def _tensor(parts: np.ndarray) -> np.ndarray:
    axial, once, twice = parts[0].real, parts[1], parts[2]
    return np.array(
        [
            [-axial / 2 + twice.real, twice.imag, once.real],
            [twice.imag, -axial / 2 - twice.real, once.imag],
            [once.real, once.imag, axial],
        ]
    )


def body_spectrum(motion: FreeMotion) -> BodySpectrum:
    """The harmonics of a free motion."""
    moments = np.array(motion.moments, dtype=float)
    first, second, third = moments
    angle = 2 * np.pi * np.arange(_POINTS) / _POINTS
    g, length = float(motion.precession_rate), float(motion.momentum)
    if motion.symmetric:
        tilt = math.atan2(float(motion.amplitudes[0]), float(motion.amplitudes[2]))
        turns = np.repeat(_turned(np.zeros(1), np.full(1, tilt), np.zeros(1)), _POINTS, axis=0)
    else:
        cosine, sine, delta = _elliptic(angle, float(motion.parameter))
        sign = 1.0 if third > second else -1.0
        # M1 : M2, also where both vanish
        r1 = math.sqrt(first / abs(first - third))
        r2 = sign * math.sqrt(second / abs(second - third))
        across = float(motion.amplitudes[0]) / r1
        m1, m2, m3 = across * r1 * cosine, across * r2 * sine, float(motion.amplitudes[2]) * delta
        own = np.arctan2(r1 * cosine, r2 * sine)
        nodding = np.arctan2(np.hypot(m1, m2), m3)
        squares = (r1 * cosine) ** 2, (r2 * sine) ** 2
        rate = length * (squares[0] / first + squares[1] / second) / (squares[0] + squares[1])
        coefficients = np.fft.fft(rate) / _POINTS
        g = float(coefficients[0].real)
        j = np.fft.fftfreq(_POINTS, 1 / _POINTS)
        j[0] = 1.0
        coefficients[0] = 0.0
        wobble_rate = float(motion.wobble_rate)
        precession = np.real(np.fft.ifft(coefficients / (1j * j * wobble_rate) * _POINTS))
        turns = _turned(precession, nodding, own)
    tensors = np.einsum("nab,b,ncb->nac", turns, moments, turns)
    parts = np.array(
        [
            tensors[:, 2, 2] - moments.sum() / 3 + 0j,
            tensors[:, 0, 2] + 1j * tensors[:, 1, 2],
            (tensors[:, 0, 0] - tensors[:, 1, 1]) / 2 + 1j * tensors[:, 0, 1],
        ]
    )
    return BodySpectrum(motion, (g, float(motion.wobble_rate)), np.fft.fft(parts, axis=1) / _POINTS, turns)


def orbit_harmonics(eccentricity: float) -> np.ndarray:
    """Sizes (Frobenius norms) of the harmonics k >= 0 of (a/r)^3 r r^T, the mean first."""
    points = 512 if eccentricity < 0.6 else 4096
    mean = 2 * np.pi * np.arange(points) / points
    anomaly = eccentric_anomalies(mean, eccentricity)
    x, y = np.cos(anomaly) - eccentricity, math.sqrt(1 - eccentricity**2) * np.sin(anomaly)
    fifth = (x * x + y * y) ** -2.5
    parts = [np.fft.fft(f * fifth) / points for f in (x * x, x * y, x * y, y * y)]
    sizes = np.sqrt(sum(np.abs(p) ** 2 for p in parts))
    return np.asarray(sizes[: points // 2])


def _turned(precession: np.ndarray, nodding: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Rotation matrices R_z R_x R_z, (n, 3, 3)."""
    return np.asarray(_about_z(precession) @ _about_x(nodding) @ _about_z(own))


def _about_z(angle: np.ndarray) -> np.ndarray:
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.moveaxis(np.array([[c, -s, zero], [s, c, zero], [zero, zero, one]]), 2, 0)


def _about_x(angle: np.ndarray) -> np.ndarray:
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.moveaxis(np.array([[one, zero, zero], [zero, c, -s], [zero, s, c]]), 2, 0)


def _means(parameter: float) -> list[tuple[float, float]]:
    """Arithmetic-geometric means of 1 and k', with their differences (Abramowitz & Stegun 16.4)."""
    a, b, found = 1.0, math.sqrt(1 - parameter), []
    for _ in range(40):
        found.append((a, (a - b) / 2))
        a, b = (a + b) / 2, math.sqrt(a * b)
        if abs(a - b) <= 1e-16 * a:
            break
    found.append((a, 0.0))
    return found


def _elliptic(angle: np.ndarray, parameter: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """cn, sn, dn of u = 2 K angle / pi."""
    means = _means(parameter)
    phase = 2.0 ** (len(means) - 1) * angle
    for level in range(len(means) - 1, 0, -1):
        halved = means[level - 1][1] / means[level][0]
        phase = (phase + np.arcsin(np.clip(halved * np.sin(phase), -1, 1))) / 2
    return np.cos(phase), np.sin(phase), np.sqrt(1 - parameter * np.sin(phase) ** 2)


def _wobble_angle(amplitude: float, parameter: float) -> float:
    """Uniformly growing angle pi F(amplitude) / (2 K), rad."""
    nodes, weights = np.polynomial.legendre.leggauss(32)

    def integral(end: float) -> float:
        parts = max(1, math.ceil(abs(end) / 0.2))
        edges = np.linspace(0.0, end, parts + 1)
        x = edges[:-1, None] + (edges[1:] - edges[:-1])[:, None] * (nodes[None, :] + 1) / 2
        values = 1 / np.sqrt(1 - parameter * np.sin(x) ** 2)
        return float((values @ weights * (edges[1:] - edges[:-1]) / 2).sum())

    return math.pi / 2 * integral(amplitude) / integral(math.pi / 2)
