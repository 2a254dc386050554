"""Motions of elastic bodies by equations of their own: momentum in space and rotation matrix, the distortion
taken at t - tau by going back along the undistorted motion.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp


class Delayed:
    """An elastic body with a delay about a source on a Kepler orbit, in doubles."""

    def __init__(
        self, moments: Sequence[float], elastic: float, delay: float, mean_rate: float, attraction: float,
        axis: float, eccentricity: float, *, steps: int = 4, tilt: float = 0, node: float = 0,
    ) -> None:  # fmt: skip
        self.tensor, self.inverse = np.diag(moments), np.diag(1 / np.array(moments))
        self.elastic, self.delay, self.mu, self.steps = elastic, delay, attraction, steps
        self.offset = elastic / 3 * mean_rate**2 * (np.eye(3) / 3 - np.diag([0, 0, 1]))
        self.a, self.e, self.tilt, self.node = axis, eccentricity, tilt, node

    def source(self, t: float) -> np.ndarray:
        """Its place, by Kepler's equation, in a plane whose node moves at a rate."""
        mean = np.sqrt(self.mu / self.a**3) * t
        anomaly = mean
        for _ in range(30):
            error = anomaly - self.e * np.sin(anomaly) - mean
            anomaly -= error / (1 - self.e * np.cos(anomaly))
        x, y = np.cos(anomaly) - self.e, np.sqrt(1 - self.e**2) * np.sin(anomaly)
        c, s = np.cos(self.node * t), np.sin(self.node * t)
        flat, up = y * np.cos(self.tilt), y * np.sin(self.tilt)
        return self.a * np.array([c * x - s * flat, s * x + c * flat, up])

    def caused(self, t: float, w: np.ndarray, r: np.ndarray) -> np.ndarray:
        """The distortion that a moment causes, without delay."""
        x = r.T @ self.source(t)
        d = np.linalg.norm(x)
        tide = np.outer(x, x) / d**5 - np.eye(3) / (3 * d**3)
        spin = np.outer(w, w) - np.eye(3) * (w @ w) / 3
        return -self.elastic * self.mu * tide + self.elastic / 3 * spin

    def torque(self, t: float, r: np.ndarray, tensor: np.ndarray) -> np.ndarray:
        x = r.T @ self.source(t)
        return 3 * self.mu / np.linalg.norm(x) ** 5 * np.cross(x, tensor @ x)

    def _rigid(self, t: float, y: np.ndarray) -> np.ndarray:
        w, r = y[:3], y[3:].reshape(3, 3)
        turning = self.inverse @ (np.cross(self.tensor @ w, w) + self.torque(t, r, self.tensor))
        return np.concatenate([turning, (r @ _skew(w)).ravel()])

    def distortion(self, t: float, momentum: np.ndarray, r: np.ndarray) -> np.ndarray:
        """D by going back along the undistorted motion from the rate that solves M = (I + d(w)) w."""
        w = self.inverse @ momentum
        for _ in range(60):
            w = np.linalg.solve(self.tensor + self.offset + self.caused(t, w, r), momentum)
        y, h = np.concatenate([w, r.ravel()]), -self.delay / self.steps
        for n in range(self.steps if self.delay else 0):
            s = t + n * h
            k1 = self._rigid(s, y)
            k2 = self._rigid(s + h / 2, y + h / 2 * k1)
            k3 = self._rigid(s + h / 2, y + h / 2 * k2)
            k4 = self._rigid(s + h, y + h * k3)
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return self.offset + self.caused(t - self.delay, y[:3], y[3:].reshape(3, 3))

    def _rates(self, t: float, space: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        momentum = r.T @ space
        tensor = self.tensor + self.distortion(t, momentum, r)
        return np.linalg.solve(tensor, momentum), tensor

    def slope(self, t: float, y: np.ndarray) -> np.ndarray:
        """Derivatives of the momentum in space and of the matrix."""
        r = y[3:].reshape(3, 3)
        w, tensor = self._rates(t, y[:3], r)
        return np.concatenate([r @ self.torque(t, r, tensor), (r @ _skew(w)).ravel()])

    def begun(self, rates: Sequence[float]) -> np.ndarray:
        """The momentum at the start, of a body that is unturned then."""
        w = np.array(rates, float)
        momentum = self.tensor @ w
        for _ in range(60):
            momentum = (self.tensor + self.distortion(0.0, momentum, np.eye(3))) @ w
        return momentum

    def followed(self, rates: Sequence[float], times: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rates, matrices and distortions at times."""
        begin = np.concatenate([self.begun(rates), np.eye(3).ravel()])
        found = solve_ivp(self.slope, (0, times[-1]), begin, "DOP853", times, rtol=1e-13, atol=1e-14).y.T
        matrices = found[:, 3:].reshape(-1, 3, 3)
        each = [self._rates(t, y[:3], r) for t, y, r in zip(times, found, matrices, strict=True)]
        return np.array([w for w, _ in each]), matrices, np.array([i for _, i in each]) - self.tensor


def _skew(w: np.ndarray) -> np.ndarray:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
