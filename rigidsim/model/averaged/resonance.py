"""Spin-orbit resonance: p turns of the body to one revolution of its source, 2 p = k a whole number.

The body turns nearly about its axis of largest moment. Turned back by p times the mean anomaly M about the
momentum L s, its principal axes a, b, c move slowly, and with P and T the directions of the orbit's
pericentre and across, averaged over M,

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
obliquity. ``anomaly_sums`` has what this mean leaves out to second order.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from rigidsim.model.averaged.anomaly_sums import AnomalySums, second_order
from rigidsim.model.averaged.free_motion import FreeMotion
from rigidsim.model.averaged.sources import Source
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Matrix, Vector, apply, hansen, multiply, norm, transpose
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene

_ROUNDS = 4  # iterations of the start; each gains a factor of the nutation's size


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
        assert self.source.of.orbit is not None
        return self.source.of.orbit

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
