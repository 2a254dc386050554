"""Spin-orbit resonance: p turns of the body to one revolution of its source, 2 p = k a whole number.

The body turns about its axis of largest moment, which is along the angular momentum L s. Turned back by p
times the mean anomaly M about s, its axes of least and middle moment, a and b, move slowly, and with P and T
the directions of the orbit's pericentre and across, averaged over M,

    U = (3 G M / 2 a^3) ((C - (A + B)/2) <(a/r)^3 (r . s)^2> - ((B - A)/2) h),
    h = X_0 (Pa^2 - Pb^2 + Ta^2 - Tb^2) / 2
        + X_2 ((Pa + Tb)^2 - (Pb - Ta)^2) / 4 + X_-2 ((Pa - Tb)^2 - (Pb + Ta)^2) / 4,

Pa = P . a and so on, with Hansen's coefficients X_m = X_k^{-3,m}(e): the whole commensurable harmonic, at
any obliquity and eccentricity. For spin and orbit about the same axis h = X_2 cos 2 gamma, the potential of
Goldreich & Peale 1966; with a moving node it has Colombo's top and Cassini's states (Colombo 1966; Peale
1969, Astronomical Journal 74, 483) besides.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np

from rigidsim.model.averaged.free_motion import FreeMotion
from rigidsim.model.averaged.hansen import hansen
from rigidsim.model.averaged.sources import Source
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Matrix, Vector, apply, cross, dot, multiply, norm, transpose
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.records import dataclass
from rigidsim.scene.scene import Scene

_POINTS = {True: 512, False: 8192}  # points per turn, by whether the eccentricity is below 0.6


@dataclass(frozen=True)
class SlowStart:
    """Initial state of a resonant average; mpf.

    Attributes:
        quaternion: attitude of the axes a, b, s, to space axes.
        excess: angular momentum beyond that of exactly p turns to a revolution, kg m^2/s.
    """

    quaternion: Vector
    excess: Any


@dataclass(frozen=True)
class Resonance:
    """A spin-orbit resonance of a body with one of its sources.

    Attributes:
        multiple: k = 2 p.
    """

    motion: FreeMotion
    source: Source
    multiple: int
    context: Any

    @property
    def orbit(self) -> KeplerOrbit:
        """The source's orbit."""
        assert self.source.orbit is not None
        return self.source.orbit

    @property
    def name(self) -> str:
        """Name of the resonance, turns to revolutions, such as "3:2"."""
        return f"{self.multiple}:2" if self.multiple % 2 else f"{self.multiple // 2}:1"

    @cached_property
    def coefficients(self) -> tuple[Any, Any, Any]:
        """Hansen coefficients X_0, X_2, X_-2 (mpf)."""
        e = self.orbit.eccentricity
        zero, plus, minus = (hansen(self.context, e, self.multiple, m) for m in (0, 2, -2))
        return zero, plus, minus

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

    # --- between the full motion and the slow one ---------------------------------------------------------

    def anomaly(self, time: Any) -> Any:
        """Mean anomaly M, rad (mpf)."""
        return self.orbit.mean_anomaly + self.orbit.mean_motion * time

    def start(self, scene: Scene) -> SlowStart:
        """The slow motion at the scene's start, without the terms that go round with the orbit."""
        context, body = scene.context, scene.body
        matrix = attitude.rotation_matrix(scene.quaternion)
        principal = multiply(matrix, transpose(self.motion.axes))
        momentum = apply(matrix, apply(body.inertia, scene.angular_velocity))
        found = self._slow(principal, momentum, scene.start)
        removed, angle = self._left_out(found, scene.start)
        momentum = [x - context.mpf(y) for x, y in zip(momentum, removed, strict=True)]
        about = [x / norm(context, momentum) for x in momentum]
        principal = multiply(_about(context, about, -context.mpf(angle)), principal)
        return self._slow(principal, momentum, scene.start)

    def osculating(self, slow: SlowStart, scene: Scene, time: Any) -> tuple[Vector, Vector]:
        """Quaternion and angular velocity (body axes, rad/s) of the full motion at a time in seconds."""
        context = self.context
        principal = attitude.rotation_matrix(slow.quaternion)
        axis = [row[2] for row in principal]
        added, angle = self._left_out(slow, time)
        turn = self.multiple * self.anomaly(time) / 2 + context.mpf(angle)
        principal = multiply(_about(context, axis, turn), principal)
        size = slow.excess + self.pace * self.motion.moments[2]
        momentum = [size * x + context.mpf(y) for x, y in zip(axis, added, strict=True)]
        principal = multiply(_shortest(context, axis, momentum), principal)
        matrix = multiply(principal, self.motion.axes)
        rate = norm(context, momentum) / self.motion.moments[2]
        velocity = [rate * x for x in self.motion.axes[2]]
        return attitude.unit_quaternion(context, attitude.quaternion_from_matrix(context, matrix)), velocity

    def _slow(self, principal: Matrix, momentum: Vector, time: Any) -> SlowStart:
        """Slow state from the principal axes (columns, space axes) and the momentum, to which the third axis
        is brought.
        """
        context = self.context
        axis = [row[2] for row in principal]
        principal = multiply(_shortest(context, axis, momentum), principal)
        axis = [row[2] for row in principal]
        back = multiply(_about(context, axis, -self.multiple * self.anomaly(time) / 2), principal)
        quaternion = attitude.unit_quaternion(context, attitude.quaternion_from_matrix(context, back))
        excess = norm(context, momentum) - self.pace * self.motion.moments[2]
        return SlowStart(quaternion, excess)

    def _left_out(self, slow: SlowStart, time: Any) -> tuple[np.ndarray, float]:
        """Terms removed from the momentum (space axes, kg m^2/s) and from the angle about it (rad): the
        integrals over time, without their means, of the torque less its mean.
        """
        e, n = float(self.orbit.eccentricity), float(self.orbit.mean_motion)
        count = _POINTS[e < 0.6]
        mean = 2 * np.pi * np.arange(count) / count
        anomaly = mean + e * np.sin(mean)
        for _ in range(60):
            step = (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
            anomaly = anomaly - np.clip(step, -0.5, 0.5)
        place = self.source.place(self.context, time)
        along, across = (np.array([float(x) for x in v]) for v in (place.pericentre, place.across))
        x, y = np.cos(anomaly) - e, math.sqrt(1 - e * e) * np.sin(anomaly)
        radius = np.hypot(x, y)
        seen = (x[:, None] * along + y[:, None] * across) / radius[:, None]
        frame = np.array([[float(v) for v in row] for row in attitude.rotation_matrix(slow.quaternion)])
        angle = self.multiple * mean / 2
        c, s, zero = np.cos(angle), np.sin(angle), np.zeros(count)
        turn = np.moveaxis(np.array([[c, -s, zero], [s, c, zero], [zero, zero, zero + 1]]), 2, 0)
        axes = frame @ turn
        inside = np.einsum("nij,ni->nj", axes, seen)
        moments = np.array([float(v) for v in self.motion.moments])
        product = np.einsum("nij,nj->ni", axes, moments * inside)
        torque = float(self.source.strength) * np.cross(seen, product) / radius[:, None] ** 3
        waves = np.fft.fft(torque, axis=0) / count
        order = np.fft.fftfreq(count, 1 / count)
        order[0] = 1.0
        at = np.exp(1j * order * float(self.anomaly(time) % (2 * self.context.pi)))[:, None]
        waves[0] = 0.0
        once = waves * at / (1j * n * order)[:, None]
        twice = once / (1j * n * order)[:, None]
        axis = frame[:, 2]
        return once.sum(axis=0).real, float(twice.sum(axis=0).real @ axis / moments[2])


def _about(context: Any, axis: Vector, angle: Any) -> Matrix:
    """Rotation matrix (mpf) about a unit axis."""
    s = context.sin(angle / 2)
    return attitude.rotation_matrix([context.cos(angle / 2), *(s * x for x in axis)])


def _shortest(context: Any, before: Vector, after: Vector) -> Matrix:
    """Smallest rotation of one direction to another, which must not be its opposite."""
    size = norm(context, before) * norm(context, after)
    quaternion = [size + dot(before, after), *cross(before, after)]
    return attitude.rotation_matrix(attitude.unit_quaternion(context, quaternion))
