"""Spin-orbit resonance: p turns of the body to one revolution of its source, 2 p = k a whole number.

**Sums over the anomaly** are what averaging over the orbit removes, and what it leaves behind to second
order. In the frame of the resonance (body axes turned back by p M about the momentum) the rates of attitude
and momentum are periodic in M at fixed slow states x, x' = f(x, M). With u the integral over time of what
isn't their mean, the motion is x + u to first order, and x' = <f(x + u, M)> to second (Bogoliubov &
Mitropolsky 1961). The frame's rate W is along body axes and its u a rotation vector, so that <u x du/dt> / 2
adds to it. The sums are in double precision: they correct initial states and slow rates.

The second order is the torque of a potential K of the frame against the orbit. Of its harmonics those that
don't vanish with the eccentricity are

    K = sum k_j x^j (j = 1..4) + Re(z^2) (k_5 + k_6 x + k_7 x^2) + k_8 Re(z^4),
    x = n . c,   z = (P - i T) . (a + i b) / 2,

n, P, T being the orbit's normal, pericentre and across, and a, b, c the principal axes brought to the
momentum by the shortest turn; the k_j come from a fit over all orientations. For whole p the rest is e^2
times as large, for half-integers e times.

**The mean.** The body turns nearly about its axis of largest moment. Turned back by p times the mean anomaly
M about the momentum L s, its principal axes a, b, c move slowly, and with P and T the directions of the
orbit's pericentre and across, averaged over M,

    U = (3 G M / 2 a^3) sum over i = a, b, c of I_i <(a/r)^3 (i . r)^2>,
    <(a/r)^3 (i . r)^2> = X_0^0 m^2 (P_s^2 + T_s^2) / 2
        + ((X_0^0 + X_k^2) S^2 + (X_0^0 - X_k^2) D^2 + (X_0^0 + X_k^-2) S'^2 + (X_0^0 - X_k^-2) D'^2) / 8
        + X_k^0 (S S' + D D') / 4
        + m (P_s ((Y_0 + Y_2) S + (Y_0 + Y_-2) S') + T_s ((Y_0 - Y_2) D + (Y_0 - Y_-2) D')) / 2,
    S, S' = E_P +- G_T,   D, D' = E_T -+ G_P,   m = i . s,   P_s = P . s,   T_s = T . s,
    E_P = P . (i - m s),   G_P = P . (s x i),   and so for T,

with Hansen's coefficients X_k^m = X_k^{-3,m}(e), and Y_m = X_p^{-3,m}(e) for whole p and 0 elsewhere: the
whole mean at fixed a, b, c and s, at any obliquity and eccentricity. For c along s and about the orbit's
normal it is the potential of Goldreich & Peale 1966; with a moving node it has Colombo's top and Cassini's
states (Colombo 1966; Peale 1969, Astronomical Journal 74, 483) besides. The terms in Y are constant in the
body, and for a nearly spherical one, whose free wobble is as slow, bend c away from s by some 3 e times the
obliquity.
"""

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from rigidsim.errors import required
from rigidsim.model.averaged.free_motion import FreeMotion
from rigidsim.model.averaged.sources import Source
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Matrix, Vector, apply, hansen, multiply, norm, transpose
from rigidsim.scene.kepler import eccentric_anomalies
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene

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
    matrices = _about_axis(angles[0], 2) @ _about_axis(angles[1], 0) @ _about_axis(angles[2], 2)
    return matrices[:, 0], matrices[:, 1]


def _about_axis(angle: np.ndarray, axis: int) -> np.ndarray:
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


_ROUNDS = 4  # iterations of the start; each gains a factor of the nutation's size


# --- the resonance ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SlowStart:
    """Initial state of a resonant average; mpf."""

    quaternion: Vector  # attitude of the axes a, b, c, to space axes
    momentum: Vector  # along them beyond the momentum at exactly p turns a revolution about c, kg m^2/s


@dataclass(frozen=True)
class Resonance:
    """A spin-orbit resonance of a body with one of its sources, of the multiple k = 2 p."""

    motion: FreeMotion
    source: Source
    multiple: int
    context: Any

    @property
    def orbit(self) -> KeplerOrbit:
        """The source's orbit."""
        return required(self.source.of.orbit)

    @property
    def name(self) -> str:
        """Name of the resonance, turns to revolutions, such as "3:2"."""
        return f"{self.multiple}:2" if self.multiple % 2 else f"{self.multiple // 2}:1"

    @cached_property
    def coefficients(self) -> tuple[Any, ...]:
        """Hansen coefficients X_0, X_2, X_-2 (mpf)."""
        return self._hansen(self.multiple)

    @cached_property
    def of_wobble(self) -> tuple[Any, ...]:
        """Hansen coefficients Y_0, Y_2, Y_-2 (mpf)."""
        return (self.context.zero,) * 3 if self.multiple % 2 else self._hansen(self.multiple // 2)

    def _hansen(self, order: int) -> tuple[Any, ...]:
        return tuple(hansen(self.context, self.orbit.eccentricity, order, m) for m in (0, 2, -2))

    @cached_property
    def second_order(self) -> Vector:
        """Coefficients of the second order's potential, J (mpf); see ``anomaly_sums``."""
        largest, rate = self.motion.moments[2], self.orbit.mean_motion
        unit = largest * rate * rate
        found = second_order(self._ratios, *self._drive, self.multiple)
        return [unit * self.context.mpf(k) for k in found]

    @property
    def _ratios(self) -> tuple[float, ...]:
        return tuple(float(x / self.motion.moments[2]) for x in self.motion.moments)

    @property
    def _drive(self) -> tuple[float, float]:
        """3 G M / (a^3 n^2), and the eccentricity."""
        strength = float(self.source.strength / self.orbit.mean_motion**2)
        return strength, float(self.orbit.eccentricity)

    @cached_property
    def strength(self) -> Any:
        """Strength (3 G M / 2 a^3) (B - A) / 2, J (mpf)."""
        least, middle, _ = self.motion.moments
        return self.source.strength * (middle - least) / 4

    @property
    def pace(self) -> Any:
        """Rotation rate p n, rad/s (mpf)."""
        return self.multiple * self.orbit.mean_motion / 2

    @property
    def libration_rate(self) -> float:
        """Rate of small librations in longitude at small obliquity, n sqrt(3 H (B - A) / C), rad/s."""
        zero, plus, minus = (abs(float(x)) for x in self.coefficients)
        return math.sqrt(4 * float(self.strength) * max(zero, plus, minus) / float(self.motion.moments[2]))

    def with_source_in(self, sources: Sequence[Source]) -> Self:
        """The same resonance with the same one of these sources."""
        (source,) = (x for x in sources if x.number == self.source.number)
        return replace(self, source=source)

    # --- between the full motion and the slow one ---------------------------------------------------------

    def anomaly(self, time: Any) -> Any:
        """Mean anomaly M, rad (mpf)."""
        return self.orbit.mean_anomaly + self.orbit.mean_motion * time

    def whole(self, slow: SlowStart) -> Vector:
        """Angular momentum along a, b, c, kg m^2/s (mpf)."""
        first, second, third = slow.momentum
        return [first, second, third + self.pace * self.motion.moments[2]]

    def start(self, scene: Scene) -> SlowStart:
        """The slow motion at the scene's start, without the terms that go round with the orbit."""
        context, body = self.context, scene.body
        matrix = attitude.rotation_matrix(scene.quaternion)
        momentum = apply(matrix, apply(body.inertia, scene.angular_velocity))
        principal = multiply(matrix, transpose(self.motion.axes))
        about = [x / norm(context, momentum) for x in momentum]
        frame = multiply(_about(context, about, -self._angle(scene.start)), principal)
        inside = apply(transpose(frame), momentum)
        slow = self._slow(frame, inside)
        for _ in range(_ROUNDS):
            added, turn = self._left_out(slow, scene.start)
            mean = multiply(frame, _turned(context, [-x for x in turn]))
            slow = self._slow(mean, [x - y for x, y in zip(inside, added, strict=True)])
        return slow

    def osculating(self, slow: SlowStart, scene: Scene, time: Any) -> tuple[Vector, Vector]:
        """Quaternion and angular velocity (body axes, rad/s) of the full motion at a time in seconds."""
        context = self.context
        added, turn = self._left_out(slow, time)
        frame = multiply(attitude.rotation_matrix(slow.quaternion), _turned(context, turn))
        momentum = [x + y for x, y in zip(self.whole(slow), added, strict=True)]
        about = apply(frame, momentum)
        about = [x / norm(context, about) for x in about]
        principal = multiply(_about(context, about, self._angle(time)), frame)
        matrix = multiply(principal, self.motion.axes)
        rates = [x / moment for x, moment in zip(momentum, self.motion.moments, strict=True)]
        velocity = apply(transpose(self.motion.axes), rates)
        return attitude.unit_quaternion(context, attitude.quaternion_from_matrix(context, matrix)), velocity

    def _angle(self, time: Any) -> Any:
        """Angle p M by which the frame is turned back."""
        return self.multiple * self.anomaly(time) / 2

    def _slow(self, frame: Matrix, momentum: Vector) -> SlowStart:
        context = self.context
        quaternion = attitude.unit_quaternion(context, attitude.quaternion_from_matrix(context, frame))
        first, second, third = momentum
        return SlowStart(quaternion, [first, second, third - self.pace * self.motion.moments[2]])

    def _left_out(self, slow: SlowStart, time: Any) -> tuple[Vector, Vector]:
        """Terms that go round with the orbit, along a, b, c: of the momentum (kg m^2/s), and the rotation
        vector (rad) of the frame; mpf.
        """
        context = self.context
        unit = self.motion.moments[2] * self.orbit.mean_motion
        place = self.source.place(context, time)
        back = transpose(attitude.rotation_matrix(slow.quaternion))
        along, across = (np.array(apply(back, v), dtype=float) for v in (place.pericentre, place.across))
        momentum = np.array([x / unit for x in self.whole(slow)], dtype=float)
        sums = AnomalySums(np.array(self._ratios), *self._drive, self.multiple)
        anomaly = float(self.anomaly(time) % (2 * context.pi * sums.turns))
        added, turn = (sums.at(anomaly, x) for x in sums.removed(along, across, momentum))
        return [unit * context.mpf(float(x)) for x in added], [context.mpf(float(x)) for x in turn]


def _turned(context: Any, vector: Vector) -> Matrix:
    """Rotation matrix (mpf) of a rotation vector."""
    angle = norm(context, vector)
    if angle == 0:
        return attitude.rotation_matrix([context.one, *([context.zero] * 3)])
    return _about(context, [x / angle for x in vector], angle)


def _about(context: Any, axis: Vector, angle: Any) -> Matrix:
    """Rotation matrix (mpf) about a unit axis."""
    s = context.sin(angle / 2)
    return attitude.rotation_matrix([context.cos(angle / 2), *(s * x for x in axis)])
