"""Flights of rigid bodies by plain equations in SI, by scipy: the truth of several tests."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp
from support import angle_between, config, matrices

MU = 3.986004418e14  # m^3/s^2


def _zeros() -> np.ndarray:
    return np.zeros(3)


@dataclass
class Flight:
    """A body in flight about the origin with principal axes for body axes; vectors of shape (3,), in SI.

    Attributes:
        strength: of the attracting point, m^3/s^2.
        drag: the force -drag |v| v.
        moment, dipole: magnetic moments of the body (body axes) and of the centre (space axes), A m^2.
    """

    inertia: np.ndarray
    mass: float
    rates: np.ndarray
    quaternion: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    end: float
    strength: float = 0.0
    drag: float = 0.0
    moment: np.ndarray = field(default_factory=_zeros)
    dipole: np.ndarray = field(default_factory=_zeros)

    @property
    def text(self) -> str:
        """Its config."""
        pushes = [f"-{self.drag!r}*v{x}*sqrt(vx^2 + vy^2 + vz^2)" for x in "xyz"]
        loads = [
            f'kind = "central_gravity"\ngravitational_parameter = {self.strength!r}' * (self.strength > 0),
            f'kind = "force"\ncomponents = {pushes}'.replace("'", '"') * (self.drag > 0),
            'kind = "magnetic_dipole"\n'
            f"moment = {self.moment.tolist()}\nsource_moment = {self.dipole.tolist()}"
            * bool(self.moment.any()),
        ]
        start = f"angular_velocity = {self.rates.tolist()}\nquaternion = {self.quaternion.tolist()}\n"
        start += f"position = {self.position.tolist()}\nvelocity = {self.velocity.tolist()}"
        body = f"principal_moments = {self.inertia.tolist()}\nmass = {self.mass!r}"
        return config(body, start, loads, f"end = {self.end!r}\nsamples = 2")


def _rates(flight: Flight, y: np.ndarray) -> np.ndarray:
    """Of a state (13,), by Newton's and Euler's equations; gravity by MacCullagh's formula."""
    f, (x, v, q, w) = flight, (y[:3], y[3:6], y[6:10], y[10:])
    turn, r = matrices(q), np.linalg.norm(x)
    u = x / r
    c = turn.T @ u
    shape = (f.inertia.sum() - 5 * c @ (f.inertia * c)) * u + 2 * turn @ (f.inertia * c)
    force = -f.strength * (f.mass * u / r**2 + 3 * shape / (2 * r**4)) - f.drag * np.linalg.norm(v) * v
    magnetic = 1e-7 * (3 * (f.dipole @ u) * u - f.dipole) / r**3
    torque = 3 * f.strength / r**3 * np.cross(c, f.inertia * c) + np.cross(f.moment, turn.T @ magnetic)
    turned = np.concatenate([[-q[1:] @ w], q[0] * w + np.cross(q[1:], w)]) / 2
    spun = (torque - np.cross(w, f.inertia * w)) / f.inertia
    return np.concatenate([v, force / f.mass, turned, spun])


def by_scipy(flight: Flight) -> np.ndarray:
    """Position, velocity, quaternion and rates at the end by Dormand and Prince's method of order 8."""
    q = flight.quaternion / np.linalg.norm(flight.quaternion)
    start = np.concatenate([flight.position, flight.velocity, q, flight.rates])
    sizes = np.concatenate([[max(part)] * len(part) for part in np.split(np.abs(start), [3, 6, 10])])

    def rates(t: float, z: np.ndarray) -> np.ndarray:
        return _rates(flight, z * sizes) / sizes

    found = solve_ivp(rates, (0, flight.end), start / sizes, method="DOP853", rtol=1e-13, atol=1e-15)
    return np.asarray(found.y[:, -1] * sizes)


def turned_by(p: np.ndarray, q: np.ndarray) -> float:
    """Angle between two attitudes, rad."""
    return float(angle_between(p[None], q[None])[0])
