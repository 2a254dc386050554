"""A rigid Earth turned by Moon, Sun and planets, with heyoka alone: its nutations beside the published ones.

Level 1 is degree 2 with Moon and Sun, level 2 adds J3 and the planets, level 3 the difference of the
equatorial moments and the tesserals of degree 3 (felt by the Moon and the Sun). Moments from H = (C -
A)/C of the rigid-Earth series and the package's J2. Rates in body axes and a quaternion, kilometres and
days, blocks as in ``moon``.
"""

import math
import time
from typing import Any

import heyoka as hy
import numpy as np

from experiments.bare import blocks, mechanics, precession
from experiments.bare.mechanics import total

H = 0.0032737548
RADIUS = 6378.1366
C22, S22 = 1.5745e-6, -9.0387e-7
TESSERALS = {(3, 1): (2.1931e-6, 2.681e-7), (3, 2): (3.0905e-7, -2.1143e-7), (3, 3): (1.0058e-7, 1.9722e-7)}
"""Greenwich longitudes."""
START = 2442412.5
SAMPLES = 5
"""Samples a block: 0.8 days apart, no simple part of a day or half a day."""


class Earth:
    """Constants, equations and blocks."""

    def __init__(self, package: str = "de421", level: int = 3) -> None:
        self.kernel = blocks.Kernel(package)
        c = self.kernel.constants
        polar = c["J2E"] / H
        mean = polar - c["J2E"]
        # Principal axes: x along the longitude of the smallest moment, B - A = 4 sqrt(C22^2 + S22^2).
        self.longitude = 0.5 * math.atan2(S22, C22) if level > 2 else 0.0
        half = 2 * math.hypot(C22, S22) if level > 2 else 0.0
        self.moments = [mean - half, mean + half, polar]
        self.sources = ("moon", "sun", *(blocks.PLANETS if level > 1 else ()))
        self.field: dict[tuple[int, int], tuple[float, float]] = {}
        if level > 1:
            self.field[3, 0] = (-c["J3E"], 0.0)
        if level > 2:
            for (n, m), (cosine, sine) in TESSERALS.items():
                a, b = math.cos(m * self.longitude), math.sin(m * self.longitude)
                self.field[n, m] = (cosine * a + sine * b, sine * a - cosine * b)
        self.free_rate = 1 + (polar - mean) / mean

    def equations(self, columns: blocks.Columns) -> list:
        """heyoka's system; time counts from the block's edge."""
        states = hy.make_vars(*(f"w{k}" for k in "xyz"), *(f"q{k}" for k in "wxyz"))
        w, q = states[:3], states[3:]
        a, b, c = self.moments
        tensor = [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]
        torque: list = [(b - c) * w[1] * w[2], (c - a) * w[2] * w[0], (a - b) * w[0] * w[1]]
        for name in self.sources:
            seen, parameter = mechanics.to_body(q, columns.place(name)), self.kernel.parameters[name]
            torque = total(torque, mechanics.gradient_torque(parameter, seen, tensor))
            if self.field and name in ("moon", "sun"):
                torque = total(torque, mechanics.field_torque(parameter, seen, RADIUS, self.field))
        right = [n / m for n, m in zip(torque, self.moments, strict=True)]
        return list(zip(states, right + mechanics.quaternion_rate(q, w), strict=True))

    def initial(self) -> np.ndarray:
        """True pole of the start, turned by its sidereal time, at the mean rate about the figure axis."""
        dates = np.array([START])
        pole = precession.true_pole(dates)[0]
        days = START - 2451545.0
        turned = 2 * math.pi * ((0.7790572732640 + 1.00273781191135448 * days) % 1.0) + self.longitude
        node = np.array([-pole[1], pole[0], 0.0])  # the ascending node of the equator on that of J2000
        right_ascension, tilt = math.atan2(node[1], node[0]), math.acos(pole[2])
        q = blocks.euler_quaternion((right_ascension, 3), (tilt, 1), (turned - right_ascension, 3))
        return np.array([0.0, 0.0, 2 * math.pi * 1.00273781191135448, *q])

    def integrate(self, days: float) -> dict[str, Any]:
        """Attitudes five times a block, and the cost."""
        count = math.ceil(days / blocks.DAYS)
        places = self.kernel.places("earth", self.sources, START, count)
        columns = blocks.Columns({name: blocks.powers(x, blocks.terms(x)) for name, x in places.items()})
        integrator = hy.taylor_adaptive(
            self.equations(columns), self.initial(), compact_mode=True, pars=columns.rows[0]
        )
        compiled = time.process_time()
        grid = np.linspace(0.0, blocks.DAYS, SAMPLES + 1)
        states, steps = [], 0
        for row in columns.rows:
            integrator.time = 0.0
            integrator.pars[:] = row
            told = integrator.propagate_grid(grid)
            steps += told[3]
            states.append(told[-1][:-1, 3:7])
        done = time.process_time()
        dates = START + (blocks.DAYS * np.arange(count)[:, None] + grid[:-1]).ravel()
        return {
            "dates": dates,
            "quaternion": np.concatenate(states),
            "steps": steps,
            "seconds": done - compiled,
        }


def figure_axis(quaternions: np.ndarray) -> np.ndarray:
    """Of the body's z axis, in space axes, (n, 3)."""
    q = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    return np.stack([row[2] for row in mechanics.body_to_space(list(q.T))], axis=1)
