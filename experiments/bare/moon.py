"""The full Moon of DE421 with heyoka alone: degree 4, Sun, planets, Earth's figure, tide, spin, delay, core.

States are the mantle's momentum (not its rate), the core's rate in the mantle's axes, and a quaternion:
with the momentum nothing asks for the distorted tensor's rate of change, since L' = N + N_c - w x L, and
w = (I + dI - I_c)^-1 L. What dI needs of w is taken from the undistorted tensor first, then from that
result (dI/I is 1e-6: the second time is exact to rounding). The delayed tide is computed from the Earth's
polynomial at t - tau itself, in the body axes of then, to the third order in the angle turned since.
Kilometres and days; each block of four days has its own time, and the sources' polynomials are parameters
of the compiled system. Nothing is fitted to the package's own librations.
"""

import math
import time
from collections.abc import Sequence
from typing import Any

import heyoka as hy
import numpy as np
from numpy.polynomial import chebyshev

from experiments.bare import blocks, mechanics, precession
from experiments.bare.mechanics import scaled, total

EFFECTS = (
    "core",
    "core_flattening",
    "core_friction",
    "degree3",
    "degree4",
    "sun",
    "planets",
    "figure",
    "distortion",
    "spin_distortion",
    "delay",
)
"""What can be left out; "sun" takes the planets with it."""
MEAN_RATE = 0.2299715
MAS = math.degrees(1.0) * 3.6e6


class Moon:
    """Constants, equations and blocks of one package's Moon, with some effects left out."""

    def __init__(self, package: str = "de421", without: Sequence[str] = ()) -> None:
        unknown = sorted(set(without) - set(EFFECTS))
        if unknown:
            raise ValueError(f"{', '.join(unknown)}: not among {', '.join(EFFECTS)}")
        self.kernel = blocks.Kernel(package)
        self.without = set(without) | ({"planets"} if "sun" in without else set())
        c = self.constants = self.kernel.constants
        # beta = (C - A)/B, gamma = (B - A)/C, J2 = (C - (A + B)/2)/(M R^2).
        beta, gamma, j2 = c["LBET"], c["LGAM"], c["J2M"]
        polar = 2 * (1 + beta) * j2 / (2 * beta - gamma + beta * gamma)
        self.moments = [polar * (1 - beta * gamma) / (1 + beta), polar * (1 + gamma) / (1 + beta), polar]
        self.radius = c["AM"]
        self.field = self._field()
        self.core_polar = 0.0 if "core" in self.without else c["IFAC"] * polar
        flattening = 0.0 if "core_flattening" in self.without else c["COBLAT"]
        self.core_equatorial = self.core_polar * (1 - flattening)
        self.friction = 0.0 if self.without & {"core", "core_friction"} else c["KVC"] * polar
        self.delay = 0.0 if "delay" in self.without else c["TAUM"]
        self.love = 0.0 if "distortion" in self.without else c["K2M"]
        self.start = c["JDEPOC"]
        far = [] if "sun" in self.without else ["sun", *(() if "planets" in self.without else blocks.PLANETS)]
        self.sources = ("earth", *far)

    def _field(self) -> dict[tuple[int, int], tuple[float, float]]:
        """Degrees 3 and 4 that are asked for."""
        c, found = self.constants, {}
        for n in (3, 4):
            if f"degree{n}" in self.without:
                continue
            found[n, 0] = (-c[f"J{n}M"], 0.0)
            for m in range(1, n + 1):
                found[n, m] = (c[f"C{n}{m}M"], c.get(f"S{n}{m}M", 0.0))
        return found

    def rigid_torque(self, q: Any, places: dict[str, Any], pole: Any) -> list:
        """On the undistorted body."""
        tensor = [[self.moments[0], 0.0, 0.0], [0.0, self.moments[1], 0.0], [0.0, 0.0, self.moments[2]]]
        found: list = [0.0, 0.0, 0.0]
        for name in self.sources:
            seen = mechanics.to_body(q, places[name])
            found = total(found, mechanics.gradient_torque(self.kernel.parameters[name], seen, tensor))
        earth, parameter = mechanics.to_body(q, places["earth"]), self.kernel.parameters["earth"]
        if self.field:
            found = total(found, mechanics.field_torque(parameter, earth, self.radius, self.field))
        return total(found, self.figure_torque(q, earth, tensor, pole))

    def figure_torque(self, q: Any, earth: Any, tensor: Any, pole: Any) -> list:
        """Of the Earth's oblateness."""
        if "figure" in self.without:
            return [0.0, 0.0, 0.0]
        c, parameter, axis = self.constants, self.kernel.parameters["earth"], mechanics.to_body(q, pole)
        return mechanics.figure_torque(parameter, earth, tensor, c["J2E"], c["RE"], axis)

    def distortion(self, q: Any, w: Any, acceleration: Any, delayed: Any) -> list[list]:
        """What tide and spin added a delay ago; the Earth's place is that of then, all else of now."""
        parameters = self.kernel.parameters
        seen = mechanics.turned_back(w, acceleration, self.delay, mechanics.to_body(q, delayed))
        found = mechanics.tide_tensor(self.love, parameters["earth"] / parameters["moon"], self.radius, seen)
        if "spin_distortion" not in self.without:
            then = [a - self.delay * b for a, b in zip(w, acceleration, strict=True)]
            spin = mechanics.spin_tensor(self.love, parameters["moon"], self.radius, then, MEAN_RATE)
            found = [[found[i][j] + spin[i][j] for j in range(3)] for i in range(3)]
        return found

    def motion(self, momentum: Any, core: Any, q: Any, places: dict, delayed: Any, pole: Any) -> tuple:
        """(w, the whole torque on the mantle)."""
        a, b, c = self.moments
        mantle = [a - self.core_equatorial, b - self.core_equatorial, c - self.core_polar]
        rigid = self.rigid_torque(q, places, pole)

        def coupling(w: Any) -> list:
            """Of the core."""
            if not self.core_polar:
                return [0.0, 0.0, 0.0]
            return mechanics.core_torque(self.friction, self.core_equatorial, self.core_polar, w, core)

        w = [x / m for x, m in zip(momentum, mantle, strict=True)]
        if not self.love:
            return w, total(rigid, coupling(w))
        change: list = []
        for _ in range(2):
            torque = total(rigid, coupling(w), scaled(-1.0, mechanics.cross(w, momentum)))
            acceleration = [x / m for x, m in zip(torque, mantle, strict=True)]
            change = self.distortion(q, w, acceleration, delayed)
            distorted = [[change[i][j] + (mantle[i] if i == j else 0.0) for j in range(3)] for i in range(3)]
            w = mechanics.solved(distorted, momentum)
        torque = total(rigid, coupling(w))
        for name in self.sources:
            seen = mechanics.to_body(q, places[name])
            torque = total(torque, mechanics.gradient_torque(self.kernel.parameters[name], seen, change))
        return w, total(torque, self.figure_torque(q, mechanics.to_body(q, places["earth"]), change, pole))

    def columns(self, count: int) -> blocks.Columns:
        """Places of the sources, the Earth's a delay ago, and its pole."""
        found = {
            name: blocks.powers(series, blocks.terms(series))
            for name, series in self.kernel.places("moon", self.sources, self.start, count).items()
        }
        if self.love:
            found["delayed"] = blocks.later(found["earth"], -self.delay)
        nodes = chebyshev.chebpts1(3)
        dates = self.start + blocks.DAYS * (np.arange(count)[:, None] + (nodes + 1) / 2)
        poles = precession.true_pole(dates.ravel()).reshape(count, 3, 3)
        series = np.swapaxes(np.linalg.inv(chebyshev.chebvander(nodes, 2)) @ poles, 1, 2)
        if "figure" not in self.without:
            found["pole"] = blocks.powers(series, 3)
        return blocks.Columns(found)

    def equations(self, columns: blocks.Columns) -> list:
        """heyoka's system; time counts from the block's edge."""
        names = [f"l{k}" for k in "xyz"] + [f"q{k}" for k in "wxyz"]
        names += [f"c{k}" for k in "xyz"] if self.core_polar else []
        states = hy.make_vars(*names)
        momentum, q, core = states[:3], states[3:7], states[7:]
        places = {name: columns.place(name) for name in self.sources}
        w, torque = self.motion(momentum, core, q, places, columns.place("delayed"), columns.place("pole"))
        right = total(torque, scaled(-1.0, mechanics.cross(w, momentum))) + mechanics.quaternion_rate(q, w)
        if self.core_polar:
            right += mechanics.core_acceleration(
                self.friction, self.core_equatorial, self.core_polar, w, core
            )
        return list(zip(states, right, strict=True))

    def initial(self, columns: blocks.Columns) -> np.ndarray:
        """The package's start: the momentum that belongs to its rate."""
        c = self.constants
        q = blocks.euler_quaternion((c["PHI"], 3), (c["THT"], 1), (c["PSI"], 3))
        rate = np.array([c["OMEGAX"], c["OMEGAY"], c["OMEGAZ"]])
        core = np.array([c["OMGCX"], c["OMGCY"], c["OMGCZ"]]) if self.core_polar else np.zeros(3)
        places = {name: columns.begin(name) for name in self.sources}
        far = columns.begin("delayed"), columns.begin("pole")
        momentum = np.array(self.moments) * rate
        for _ in range(5):
            w, _ = self.motion(list(momentum), list(core), list(q), places, *far)
            momentum = momentum + np.array(self.moments) * (rate - np.array(w))
        return np.concatenate([momentum, q, core if self.core_polar else []])

    def integrate(self, days: float, tolerance: float | None = None) -> dict[str, Any]:
        """States at the block edges, and the cost."""
        count = math.ceil(days / blocks.DAYS)
        columns = self.columns(count)
        options = {} if tolerance is None else {"tol": tolerance}
        integrator = hy.taylor_adaptive(
            self.equations(columns), self.initial(columns), compact_mode=True, pars=columns.rows[0], **options
        )
        compiled = time.process_time()
        states, steps = [integrator.state.copy()], 0
        for row in columns.rows:
            integrator.time = 0.0
            integrator.pars[:] = row
            steps += integrator.propagate_until(blocks.DAYS)[3]
            states.append(integrator.state.copy())
        done = time.process_time()
        found = np.array(states)
        return {
            "days": blocks.DAYS * np.arange(count + 1),
            "quaternion": found[:, 3:7],
            "states": found,
            "steps": steps,
            "seconds": done - compiled,
        }


def librations(package: str, julian_dates: np.ndarray) -> np.ndarray:
    """The package's own attitudes: matrices from body to ICRF, (n, 3, 3)."""
    kernel = blocks.Kernel(package)
    stored = np.load(kernel.folder / "jpl-librations.npy", mmap_mode="r")
    length = (kernel.last - kernel.first) / len(stored)
    since = (julian_dates - kernel.first) / length
    index = np.minimum(since.astype(int), len(stored) - 1)
    values = chebyshev.chebvander(2 * (since - index) - 1, stored.shape[2] - 1)
    phi, theta, psi = np.einsum("nk,nak->an", values, stored[index])
    return turn(2, phi) @ turn(0, theta) @ turn(2, psi)


def turn(axis: int, angle: np.ndarray) -> np.ndarray:
    """Matrices that turn vectors about one axis."""
    found = np.zeros((len(angle), 3, 3))
    a, b = (axis + 1) % 3, (axis + 2) % 3
    found[:, axis, axis] = 1.0
    found[:, a, a] = found[:, b, b] = np.cos(angle)
    found[:, b, a] = np.sin(angle)
    found[:, a, b] = -np.sin(angle)
    return found


def between(computed: np.ndarray, published: np.ndarray) -> np.ndarray:
    """The small rotation vector (body axes, rad) from published attitudes to computed ones, (n, 3)."""
    small = np.swapaxes(published, 1, 2) @ computed
    parts = (small - np.swapaxes(small, 1, 2)) / 2
    return np.stack([parts[:, 2, 1], parts[:, 0, 2], parts[:, 1, 0]], axis=1)


def matrices(quaternions: np.ndarray) -> np.ndarray:
    """Body to space, (n, 3, 3)."""
    q = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    return np.moveaxis(np.array(mechanics.body_to_space(list(q.T))), -1, 0)


def left_over(package: str, start: float, days: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
    """Rotation vectors from the package's librations to these attitudes, milliarcseconds."""
    return between(matrices(quaternions), librations(package, start + days)) * MAS
