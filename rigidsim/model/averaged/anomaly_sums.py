"""Sums over the anomaly of a body in spin-orbit resonance: what averaging over the orbit removes, and what it
leaves behind to second order.

In the frame of ``resonance`` (body axes turned back by p M about the momentum) the rates of attitude and
momentum are periodic in M at fixed slow states x, x' = f(x, M). With u the integral over time of what isn't
their mean, the motion is x + u to first order, and x' = <f(x + u, M)> to second (Bogoliubov & Mitropolsky
1961). The frame's rate W is along body axes and its u a rotation vector, so that <u x du/dt> / 2 adds to it.
The sums are in double precision: they correct initial states and slow rates.

The second order is the torque of a potential K of the frame against the orbit. Of its harmonics those that
don't vanish with the eccentricity are

    K = sum k_j x^j (j = 1..4) + Re(z^2) (k_5 + k_6 x + k_7 x^2) + k_8 Re(z^4),
    x = n . c,   z = (P - i T) . (a + i b) / 2,

n, P, T being the orbit's normal, pericentre and across, and a, b, c the principal axes brought to the
momentum by the shortest turn; the k_j come from a fit over all orientations. For whole p the rest is e^2
times as large, for half-integers e times.
"""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rigidsim.scene.kepler import eccentric_anomalies

_POINTS = ((0.3, 64), (0.6, 256), (1.0, 8192))
"""Points per turn up to an eccentricity; harmonics beyond are below double precision up to 0.6."""
_TILTS, _PHASES = 6, 8  # a quadrature over orientations that is exact for harmonics of fourth degree
_STEP = 1e-20  # of derivatives in the complex plane
_MOST_POINTS = 256  # per turn, for the second order


@dataclass(frozen=True)
class AnomalySums:
    """Sums over the orbits after which a motion in resonance repeats: one, or two for odd multiples.

    Units: mean motion and largest moment are 1.
    """

    moments: np.ndarray  # (3,), the largest, 1, last
    strength: float  # 3 G M / (a^3 n^2)
    eccentricity: float
    multiple: int  # k = 2 p
    most: int = 1 << 30  # points per turn; as many as are enough

    @cached_property
    def points(self) -> int:
        """Points per turn."""
        return min(self.most, next(count for most, count in _POINTS if self.eccentricity < most))

    @property
    def turns(self) -> int:
        """Number of orbits."""
        return 1 + self.multiple % 2

    @cached_property
    def mean(self) -> np.ndarray:
        """Mean anomalies, (n,)."""
        count = self.turns * self.points
        return np.asarray(2 * np.pi * np.arange(count) / self.points)

    @cached_property
    def place(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position along P and T, and distance, over a, (n, 1)."""
        e, anomaly = self.eccentricity, eccentric_anomalies(self.mean, self.eccentricity)
        x, y = np.cos(anomaly) - e, math.sqrt(1 - e * e) * np.sin(anomaly)
        return x[:, None], y[:, None], np.hypot(x, y)[:, None]

    def seen(self, along: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Places of the source (.., n, 3) for P and T (.., 3)."""
        x, y, _ = self.place
        return np.asarray(x * along[..., None, :] + y * across[..., None, :])

    def rates(self, source: np.ndarray, momentum: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """W, its periodic part alone, and the torque, all (.., n, 3) along the frame's axes."""
        size = np.linalg.norm(momentum, axis=-1, keepdims=True)
        about = momentum / size
        body = self._turned(source, about, -1.0)
        torque = self.strength / self.place[2] ** 5 * np.cross(body, self.moments * body)
        periodic = np.cross(about, self._turned(torque, about, 1.0) - torque) / size
        return momentum / self.moments - self.multiple / 2 * about + periodic, periodic, torque

    def _turned(self, vectors: np.ndarray, about: np.ndarray, sign: float) -> np.ndarray:
        angle = sign * self.multiple / 2 * self.mean[:, None]
        along = (vectors * about).sum(axis=-1, keepdims=True) * about
        return np.asarray(
            along + np.cos(angle) * (vectors - along) + np.sin(angle) * np.cross(about, vectors)
        )

    def integral(self, values: np.ndarray) -> np.ndarray:
        """Integral over time of (.., n, 3) less the mean, without a mean of its own."""
        order = np.fft.fftfreq(values.shape[-2], 1 / values.shape[-2])[:, None] / self.turns
        order[0] = 1.0
        waves = np.fft.fft(values, axis=-2)
        waves[..., 0, :] = 0.0
        return np.asarray(np.fft.ifft(waves / (1j * order), axis=-2).real)

    def removed(
        self, along: np.ndarray, across: np.ndarray, momentum: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """u at all anomalies: of the momentum, and a rotation vector of the frame, (.., n, 3).

        The angle about the largest moment's axis follows the momentum along it.
        """
        held = np.broadcast_to(momentum[..., None, :], (*momentum.shape[:-1], len(self.mean), 3))
        _, periodic, torque = self.rates(self.seen(along, across), held)
        added = self.integral(torque)
        turn = self.integral(periodic)
        turn[..., 2] += self.integral(added)[..., 2] / self.moments[2]
        return added, turn

    def at(self, anomaly: float, values: np.ndarray) -> np.ndarray:
        """Trigonometric interpolation of values (n, 3) to a mean anomaly, (3,)."""
        order = np.fft.fftfreq(len(values), 1 / len(values))[:, None] / self.turns
        waves = np.fft.fft(values, axis=0) / len(values)
        return np.asarray((waves * np.exp(1j * order * anomaly)).sum(axis=0).real)

    def second_order(self) -> np.ndarray:
        """Coefficients k_1 .. k_8 of K, (8,)."""
        along, across = _orientations()
        momentum = np.zeros((len(along), 3))
        momentum[:, 2] = self.multiple / 2
        added, turn = self.removed(along, across, momentum)
        source, held = self.seen(along, across), np.broadcast_to(momentum[:, None, :], added.shape)
        before = self._total(source, held)
        moved = np.einsum("...ji,...j->...i", _rotations(turn), source)
        after = self._total(moved, held + added, turn)
        torques = _torques(_terms, along, across)
        columns = torques.reshape(-1, torques.shape[-1])
        return np.asarray(np.linalg.lstsq(columns, (after - before).ravel(), rcond=None)[0])

    def _total(self, source: np.ndarray, momentum: np.ndarray, turn: np.ndarray | None = None) -> np.ndarray:
        """Mean rate (.., 3) of the momentum in space, axes of the mean frame."""
        rates, _, torque = self.rates(source, momentum)
        change = (np.cross(momentum, momentum / self.moments) + torque).mean(axis=-2)
        turning = rates.mean(axis=-2)
        if turn is not None:
            turning = turning + np.cross(turn, rates - turning[..., None, :]).mean(axis=-2) / 2
        return np.asarray(np.cross(turning, momentum.mean(axis=-2)) + change)


@functools.cache
def second_order(
    moments: tuple[float, ...], strength: float, eccentricity: float, multiple: int
) -> tuple[float, ...]:
    """Coefficients of K for a body and an orbit, in the units of ``AnomalySums``."""
    sums = AnomalySums(np.array(moments), strength, eccentricity, multiple, _MOST_POINTS)
    return tuple(sums.second_order().tolist())


def _terms(along: np.ndarray, across: np.ndarray) -> list[np.ndarray]:
    """The eight terms of K from the components of P and T along a, b, c."""
    (pa, pb, _), (ta, tb, _) = along, across
    x = pa * tb - pb * ta
    c, s = 0.5 * (pa + tb), 0.5 * (pb - ta)
    once = c * c - s * s
    skew = 2.0 * (c * s)
    squared = x * x
    powers = [x, squared, x * squared, squared * squared]
    return [*powers, once, x * once, squared * once, once * once - skew * skew]


def _torques(terms: Callable[[Any, Any], list[Any]], along: np.ndarray, across: np.ndarray) -> np.ndarray:
    """(orientations, 3, terms): P x dK/dP + T x dK/dT of each term, by derivatives in the complex plane."""
    found = []
    for axis in np.eye(3):
        step = 1j * _STEP
        moved = (v.T + step * np.cross(axis, v).T for v in (along, across))
        found.append(np.array(terms(*moved)).imag / _STEP)
    return np.moveaxis(np.array(found), (0, 1, 2), (1, 2, 0))


def _orientations() -> tuple[np.ndarray, np.ndarray]:
    """P and T, (orientations, 3), over all orientations of the frame."""
    tilts = np.arccos(np.polynomial.legendre.leggauss(_TILTS)[0])
    phases = 2 * np.pi * np.arange(_PHASES) / _PHASES
    angles = [g.ravel() for g in np.meshgrid(phases, tilts, phases + 0.1, indexing="ij")]
    matrices = _about(angles[0], 2) @ _about(angles[1], 0) @ _about(angles[2], 2)
    return matrices[:, 0], matrices[:, 1]


def _about(angle: np.ndarray, axis: int) -> np.ndarray:
    vectors = np.zeros((len(angle), 3))
    vectors[:, axis] = angle
    return _rotations(vectors)


def _rotations(vectors: np.ndarray) -> np.ndarray:
    """Rotation matrices (.., 3, 3) of rotation vectors."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    skew = np.zeros((*vectors.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        skew[..., i, j], skew[..., j, i] = -vectors[..., k], vectors[..., k]
    once, twice = np.sinc(angle / np.pi), np.sinc(angle / (2 * np.pi)) ** 2 / 2
    return np.asarray(np.eye(3) + once * skew + twice * (skew @ skew))
