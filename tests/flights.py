"""Flights of rigid bodies by plain equations in SI, and integrators for them: the truth of several tests."""

from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

MU = 3.986004418e14  # m^3/s^2
_MIDPOINTS = 2 * np.arange(1, 8)  # order 14; higher ones multiply rounding by their large weights


def _zeros() -> np.ndarray:
    return np.zeros(3)


@dataclass
class Flight:
    """A body in flight with principal axes for body axes; vectors of shape (3,), in SI.

    Attributes:
        strength, centre: of the attracting point, m^3/s^2 and m.
        drag, power: the force -drag |v|^(power - 1) v; ``arm`` is where it acts, body axes, m.
        thrust: a constant force, space axes; ``gravity`` a constant acceleration.
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
    centre: np.ndarray = field(default_factory=_zeros)
    drag: float = 0.0
    power: float = 1.0
    arm: np.ndarray = field(default_factory=_zeros)
    thrust: np.ndarray = field(default_factory=_zeros)
    gravity: np.ndarray = field(default_factory=_zeros)
    moment: np.ndarray = field(default_factory=_zeros)
    dipole: np.ndarray = field(default_factory=_zeros)

    @property
    def text(self) -> str:
        """Its config."""
        speed = "sqrt(vx^2+vy^2+vz^2)" if self.power != 1 else "1"
        pushes = [
            f'"{-self.drag!r}*v{x}*{speed}^{self.power - 1!r} + {f!r}"'
            for x, f in zip("xyz", self.thrust.tolist(), strict=True)
        ]
        loads = [
            (
                "central_gravity",
                f"gravitational_parameter = {self.strength!r}\nposition = {_row(self.centre)}",
            ),
            ("uniform_gravity", f"acceleration = {_row(self.gravity)}"),
            ("force", f"components = [{', '.join(pushes)}]\npoint = {_row(self.arm)}"),
            ("magnetic_dipole", f"moment = {_row(self.moment)}\nsource_moment = {_row(self.dipole)}"),
        ]
        present = [
            self.strength > 0, self.gravity.any(), self.drag > 0 or self.thrust.any(), self.moment.any()
        ]  # fmt: skip
        found = zip(loads, present, strict=True)
        tables = "".join(f'[[loads]]\nkind = "{kind}"\n{keys}\n' for (kind, keys), there in found if there)
        return (
            f'name = "flight"\n[body]\nprincipal_moments = {_row(self.inertia)}\nmass = {self.mass!r}\n'
            f"[initial]\nangular_velocity = {_row(self.rates)}\nquaternion = {_row(self.quaternion)}\n"
            f"position = {_row(self.position)}\nvelocity = {_row(self.velocity)}\n{tables}"
            f"[time]\nend = {self.end!r}\nsamples = 2\n"
        )

    @property
    def start(self) -> np.ndarray:
        """Position, velocity, unit quaternion, rates: shape (13,)."""
        q = self.quaternion.astype(np.longdouble)
        return np.concatenate([self.position, self.velocity, q / np.sqrt(q @ q), self.rates])


def _row(values: np.ndarray) -> str:
    return "[" + ", ".join(repr(float(x)) for x in values) + "]"


def _across(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _along(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(axis=0)


class Flights:
    """Several flights side by side; states have the shape (13, flights)."""

    def __init__(self, flights: list[Flight], kind: type = np.longdouble) -> None:
        names = (
            "inertia",
            "mass",
            "strength",
            "centre",
            "drag",
            "power",
            "arm",
            "thrust",
            "gravity",
            "moment",
        )
        names = (*names, "dipole", "end", "start")
        self._of = {
            name: np.stack([np.asarray(getattr(f, name), kind) for f in flights], axis=-1) for name in names
        }
        self._small = kind("1e-7")

    def rates(self, y: np.ndarray) -> np.ndarray:
        """Derivatives by time, by Newton's and Euler's equations; gravity by MacCullagh's formula."""
        g, (x, v, q, w) = self._of, (y[:3], y[3:6], y[6:10], y[10:])
        i, m = g["inertia"], g["mass"]
        q = q / np.sqrt(_along(q, q))

        def to_space(a: np.ndarray) -> np.ndarray:
            t = 2 * _across(q[1:], a)
            return a + q[0] * t + _across(q[1:], t)

        def to_body(a: np.ndarray) -> np.ndarray:
            t = 2 * _across(a, q[1:])
            return a + q[0] * t + _across(t, q[1:])

        away = x - g["centre"]
        r = np.sqrt(_along(away, away))
        u = away / r
        c = to_body(u)
        shape = (i.sum(axis=0) - 5 * _along(c, i * c)) * u + 2 * to_space(i * c)
        force = -g["strength"] * (m * u / r**2 + 3 * shape / (2 * r**4))
        torque = 3 * g["strength"] / r**3 * _across(c, i * c)
        speed = np.sqrt(_along(v, v))
        push = g["thrust"] - g["drag"] * speed ** (g["power"] - 1) * v
        field = self._small * (3 * _along(g["dipole"], u) * u - g["dipole"]) / r**3
        torque = torque + _across(g["arm"], to_body(push)) + _across(g["moment"], to_body(field))
        turned = np.concatenate([[-_along(q[1:], w)], q[0] * w + _across(q[1:], w)]) / 2
        spun = (torque - _across(w, i * w)) / i
        return np.concatenate([v, (force + push) / m + g["gravity"], turned, spun])

    def at_end(self, steps: int) -> np.ndarray:
        """States at the ends: the modified midpoint rule, extrapolated to order 14 (Gragg 1965)."""
        y, whole = self._of["start"], self._of["end"] / steps
        for _ in range(steps):
            table: list[np.ndarray] = []
            first = self.rates(y)
            for n in _MIDPOINTS:
                h = whole / int(n)
                before, now = y, y + h * first
                for _ in range(n - 1):
                    before, now = now, before + 2 * h * self.rates(now)
                row = [(before + now + h * self.rates(now)) / 2]
                for k, known in enumerate(table):
                    ratio = y.dtype.type(n) / y.dtype.type(_MIDPOINTS[len(table) - 1 - k])
                    row.append(row[k] + (row[k] - known) / (ratio**2 - 1))
                table = row
            y = table[-1]
            y[6:10] /= np.sqrt(_along(y[6:10], y[6:10]))
        return y


def by_scipy(flight: Flight) -> np.ndarray:
    """State at the end, shape (13,), in double precision by Dormand and Prince's method of order 8."""
    alone = Flights([flight], np.float64)
    scale = np.abs(flight.start.astype(float))
    sizes = np.concatenate([[max(part)] * len(part) for part in np.split(scale, [3, 6, 10])])

    def rates(t: float, z: np.ndarray) -> np.ndarray:
        return alone.rates((z * sizes)[:, None])[:, 0] / sizes

    start = flight.start.astype(float) / sizes
    return solve_ivp(rates, (0, flight.end), start, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1] * sizes


def turned_by(p: np.ndarray, q: np.ndarray) -> float:
    """Angle between two attitudes given by unit quaternions, rad."""
    apart = min(np.sqrt(((p - s * q) ** 2).sum()) for s in (1, -1))
    return float(4 * np.arcsin(min(1.0, apart / 2)))


def direction(random: np.random.Generator) -> np.ndarray:
    """A random unit vector."""
    v = random.normal(size=3)
    return v / np.linalg.norm(v)


def in_orbit(random: np.random.Generator, **more: object) -> Flight:
    """A random satellite about the Earth for less than one turn, 60 rad of its own rotation."""
    up, inertia = direction(random), np.sort(random.uniform(1, 3, 3))
    inertia[2] = min(inertia[2], 0.95 * (inertia[0] + inertia[1]))
    across = np.cross(up, direction(random))
    distance, rate = random.uniform(6.7e6, 2e7), random.uniform(0.01, 0.03)
    speed = np.sqrt(MU / distance) * random.uniform(0.95, 1.15)
    return Flight(
        inertia,
        10 ** random.uniform(0, 3),
        rate * direction(random),
        random.normal(size=4),
        distance * up,
        speed * across / np.linalg.norm(across),
        60 / rate,
        strength=MU,
        **more,  # type: ignore[arg-type]
    )
