"""Motions of elastic bodies by equations of their own.

Without delay, in 113 bits: Euler's equations for the true rates with dI/dt along the motion,

    (I + k/3 (w^2 + w w^T/3)) w' = N - w x I w - T' w,

where T is the tidal part and k the strength, and Newton's for the source. With a delay, in doubles: momentum
in space and rotation matrix, the distortion taken at t - tau by going back along the undistorted motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import heyoka as hy
import numpy as np
from gyrostats import BITS, exact
from scipy.integrate import solve_ivp

GRAVITATIONAL_CONSTANT = "6.67430e-11"


def strength(love: str, radius: str) -> Any:
    """k R^5 / G."""
    size = exact(radius)
    return exact(love) * size * size * size * size * size / exact(GRAVITATIONAL_CONSTANT)


def _cross(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _det(columns: Sequence[Sequence[Any]]) -> Any:
    return _dot(columns[0], _cross(columns[1], columns[2]))


def followed(
    moments: Sequence[Any],
    elastic: Any,
    mean_rate: Any,
    attraction: Any,
    start: Sequence[Sequence[Any]],
    rates: Sequence[Any],
    times: Any,
    *,
    spins: bool = True,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rates, matrices and angular momenta (space axes) at times, 80-bit numbers, without delay.

    Args:
        start: place and velocity of the source; the body starts unturned.
        spins: whether its own spin distorts the body, too.
    """
    w = list(hy.make_vars("w0", "w1", "w2"))
    r = [list(hy.make_vars(*(f"r{i}{j}" for j in range(3)))) for i in range(3)]
    x, v = (list(hy.make_vars(*(f"{n}{i}" for i in range(3)))) for n in "xv")
    third, mu = exact(1) / exact(3), exact(attraction)
    columns = [list(column) for column in zip(*r, strict=True)]
    seen = [_dot(column, x) for column in columns]
    turning = _cross(seen, w)
    moved = [_dot(column, v) + y for column, y in zip(columns, turning, strict=True)]
    squared = _dot(x, x)
    cube = 1.0 / (squared * hy.sqrt(squared))
    fifth = cube / squared
    slope = -5.0 * _dot(x, v) / squared * fifth
    size, rate, bulge = elastic * mu, exact(mean_rate), elastic * third if spins else exact(0)
    tensor, change, whole = ([[None] * 3 for _ in range(3)] for _ in range(3))
    own = [exact(m) for m in moments]
    for i in range(3):
        for j in range(3):
            same = 1.0 if i == j else 0.0
            tide = seen[i] * seen[j] * fifth - (third * cube if same else 0.0)
            spin = w[i] * w[j] - (third * _dot(w, w) if same else 0.0)
            known = rate * rate * ((third if same else exact(0)) - exact(float(i == j == 2)))
            tensor[i][j] = own[i] * same - size * tide + bulge * (spin + known)
            grown = third * (-3.0 * _dot(x, v) / squared * cube) if same else 0.0
            change[i][j] = -size * (
                slope * seen[i] * seen[j] + fifth * (seen[i] * moved[j] + moved[i] * seen[j]) - grown
            )
            whole[i][j] = tensor[i][j] + bulge * ((_dot(w, w) if same else 0.0) + third * (w[i] * w[j]))
    momentum = [_dot(row, w) for row in tensor]
    torque = [3.0 * mu * fifth * y for y in _cross(seen, [_dot(row, seen) for row in tensor])]
    right = [n + y - _dot(c, w) for n, y, c in zip(torque, _cross(momentum, w), change, strict=True)]
    volume = _det(whole)
    turned = [_det([right if j == i else whole[j] for j in range(3)]) / volume for i in range(3)]
    system = list(zip(w, turned, strict=True))
    turns = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    system += [(row[i], row[j] * w[k] - row[k] * w[j]) for row in r for i, j, k in turns]
    system += list(zip(x, v, strict=True)) + [(a, -mu * b * cube) for a, b in zip(v, x, strict=True)]
    initial = [exact(y) for y in rates] + [exact(float(i == j)) for i in range(3) for j in range(3)]
    initial += [exact(y) for part in start for y in part]
    grid = np.array([exact(t) for t in times])
    engine = hy.taylor_adaptive(system, initial, time=grid[0], fp_type=hy.real, prec=BITS, compact_mode=True)
    found = engine.propagate_grid(grid)[-1]
    spun = [_dot(row, momentum) for row in r]
    read = hy.cfunc(spun, [y for y, _ in system], fp_type=hy.real, prec=BITS, compact_mode=True)
    narrow = np.vectorize(lambda y: np.longdouble(str(y)), otypes=[np.longdouble])
    momenta = narrow(read(np.ascontiguousarray(found.T))).T
    return narrow(found[:, :3]), narrow(found[:, 3:12]).reshape(-1, 3, 3), momenta


class Delayed:
    """An elastic body with a delay about a source on a Kepler orbit in the plane XY, in doubles."""

    def __init__(
        self, moments: Sequence[float], elastic: float, delay: float, mean_rate: float, attraction: float,
        axis: float, eccentricity: float, *, steps: int = 4,
    ) -> None:  # fmt: skip
        self.tensor, self.inverse = np.diag(moments), np.diag(1 / np.array(moments))
        self.elastic, self.delay, self.mu, self.steps = elastic, delay, attraction, steps
        self.offset = elastic / 3 * mean_rate**2 * (np.eye(3) / 3 - np.diag([0, 0, 1]))
        self.a, self.e = axis, eccentricity

    def source(self, t: float) -> np.ndarray:
        """Its place, by Kepler's equation."""
        mean = np.sqrt(self.mu / self.a**3) * t
        anomaly = mean
        for _ in range(30):
            error = anomaly - self.e * np.sin(anomaly) - mean
            anomaly -= error / (1 - self.e * np.cos(anomaly))
        b = np.sqrt(1 - self.e**2)
        return self.a * np.array([np.cos(anomaly) - self.e, b * np.sin(anomaly), 0.0])

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
