"""A day of a tumbling CubeSat in a low orbit with everything that acts on it, with heyoka alone.

The Earth's field to degree 4 by Cunningham's recursion in axes that turn (Montenbruck & Gill, Satellite
Orbits, section 3.2), gravity-gradient torques of Earth and Sun, drag and light on a box and a panel (3.4
and 3.5, Wertz 1978, 17.2), the Earth's shadow of a point Sun, a magnet and eddy currents in a dipole. Earth
radii and circular periods over 2 pi for units; sides of faces are numbers that events turn. Or a sphere in
place of box and panel, which has no sides, in full light or with the shadow. The scenes are in
``experiments/satellite_cost.py``.
"""

import math
import time
from collections.abc import Sequence
from typing import Any

import heyoka as hy
import numpy as np

from experiments.bare.mechanics import cross, dot, quaternion_rate

MU, RADIUS = 3.986004418e14, 6378136.6
UNIT = math.sqrt(RADIUS**3 / MU)
SPIN = 7.2921151e-5
MASS, MOMENTS = 4.0, (0.01, 0.03, 0.034)
EDGES, PANEL, PLACE = (0.34, 0.1, 0.1), 0.06, (-0.02, 0.01, 0.004)
BALL = 0.15  # radius of the sphere, about PLACE
SPECULAR, DIFFUSE, DRAG = 0.2, 0.1, 2.2
DENSITY, ALTITUDE, HEIGHT = 4e-12, 400e3, 60e3
MAGNET, DIPOLE, CONDUCTOR = (1e-4, -2e-4, 3e-4), (1.3e22, 0.0, -7.6e22), (30.0, 10.0, 20.0)
SUN, FAR, TILT = 1.32712440018e20, 149597870700.0, math.radians(23.44)
C = {(2, 0): -1.0826e-3, (2, 2): 1.5745e-6, (3, 0): 2.53e-6, (3, 1): 2.193e-6, (4, 0): 1.62e-6}
S = {(2, 2): -9.0387e-7, (3, 1): 2.68e-7}
POSITION, VELOCITY = (6.778e6, 0.0, 0.0), (0.0, 4769.0, 6004.0)
RATES, QUATERNION = (0.004, -0.003, 0.04), (0.6, -0.4, 0.5, 0.3)


def field(x: Sequence[Any]) -> list[Any]:
    """Acceleration at a place in axes of the Earth, in Earth radii and with mu = 1."""
    square = dot(x, x)
    v: dict[tuple[int, int], Any] = {(0, 0): square**-0.5}
    w: dict[tuple[int, int], Any] = {(0, 0): 0.0}
    for m in range(6):
        if m:
            a, b = v[m - 1, m - 1], w[m - 1, m - 1]
            v[m, m] = (2 * m - 1) * (x[0] * a - x[1] * b) / square
            w[m, m] = (2 * m - 1) * (x[0] * b + x[1] * a) / square
        for n in range(m + 1, 6):
            for u in (v, w):
                u[n, m] = (2 * n - 1) / (n - m) * x[2] * u[n - 1, m] / square
                if n > m + 1:
                    u[n, m] = u[n, m] - (n + m - 1) / (n - m) * u[n - 2, m] / square
    found: list[Any] = [-v[1, 1], -w[1, 1], -v[1, 0]]
    for n, m in C:
        c, s, k = C[n, m], S.get((n, m), 0.0), n + 1
        found[2] = found[2] - (n - m + 1) * (c * v[k, m] + s * w[k, m])
        if m == 0:
            found[0], found[1] = found[0] - c * v[k, 1], found[1] - c * w[k, 1]
            continue
        low = (n - m + 2) * (n - m + 1)
        found[0] = found[0] + 0.5 * (
            -c * v[k, m + 1] - s * w[k, m + 1] + low * (c * v[k, m - 1] + s * w[k, m - 1])
        )
        found[1] = found[1] + 0.5 * (
            -c * w[k, m + 1] + s * v[k, m + 1] + low * (s * v[k, m - 1] - c * w[k, m - 1])
        )
    return found


class Satellite:
    """Equations, events and start of one with plates or a sphere for its outside."""

    def __init__(self, *, plates: bool = True, shadow: bool = True) -> None:
        self.plates, self.shadow = plates, shadow
        self.x, self.v = hy.make_vars("x", "y", "z"), hy.make_vars("u", "v", "w")
        self.w, self.q = hy.make_vars("wx", "wy", "wz"), hy.make_vars("q0", "q1", "q2", "q3")
        self.states = [*self.x, *self.v, *self.w, *self.q]
        q0, q1, q2, q3 = self.q
        self.r = [
            [1.0 - 2.0 * (q2 * q2 + q3 * q3), 2.0 * (q1 * q2 - q0 * q3), 2.0 * (q1 * q3 + q0 * q2)],
            [2.0 * (q1 * q2 + q0 * q3), 1.0 - 2.0 * (q1 * q1 + q3 * q3), 2.0 * (q2 * q3 - q0 * q1)],
            [2.0 * (q1 * q3 - q0 * q2), 2.0 * (q2 * q3 + q0 * q1), 1.0 - 2.0 * (q1 * q1 + q2 * q2)],
        ]

    def seen(self, vector: Sequence[Any]) -> list[Any]:
        """In body axes."""
        return [dot([self.r[i][j] for i in range(3)], vector) for j in range(3)]

    def equations(self) -> tuple[list[Any], dict[int, Any]]:
        """The system, and what changes its sign where a face or the Sun turns away, by its parameter."""
        far = hy.sqrt(dot(self.x, self.x))
        up = self.seen([x / far for x in self.x])
        tensor = [a * b for a, b in zip(MOMENTS, up, strict=True)]
        # what gives torques in N m and forces in N; times in units
        torque = [3.0 * MU / RADIUS**3 * k / far**3.0 for k in cross(up, tensor)]
        angle = math.sqrt(SUN / FAR**3) * UNIT * hy.time
        sun = [hy.cos(angle), math.cos(TILT) * hy.sin(angle), math.sin(TILT) * hy.sin(angle)]
        light = self.seen(sun)
        pull = cross(light, [a * b for a, b in zip(MOMENTS, light, strict=True)])
        torque = [a + 3.0 * SUN / FAR**3 * b for a, b in zip(torque, pull, strict=True)]
        # air
        swept = [-SPIN * UNIT * self.x[1], SPIN * UNIT * self.x[0], 0.0]
        wind = self.seen([RADIUS / UNIT * (a - b) for a, b in zip(self.v, swept, strict=True)])
        thick = DENSITY * hy.exp((6378136.6 + ALTITUDE - RADIUS * far) / HEIGHT)
        # what meets the box, or nothing; and the panel, or the sphere
        outside = self.on_plates if self.plates else self.on_sphere
        box, panel = outside(wind, thick, light)
        torque = [a + b for a, b in zip(torque, cross(PLACE, panel), strict=True)]
        # magnetic field
        pole = self.seen(DIPOLE)
        along = 3.0 * dot(pole, up)
        b = [1e-7 / RADIUS**3 * (along * u - p) / far**3.0 for u, p in zip(up, pole, strict=True)]
        w = [k / UNIT for k in self.w]
        braked = cross([m * k for m, k in zip(CONDUCTOR, cross(w, b), strict=True)], b)
        torque = [n + m + e for n, m, e in zip(torque, cross(MAGNET, b), braked, strict=True)]
        i1, i2, i3 = MOMENTS
        wx, wy, wz = self.w
        own = [(i2 - i3) * wy * wz, (i3 - i1) * wz * wx, (i1 - i2) * wx * wy]
        right = [(o + UNIT**2 * n) / i for o, n, i in zip(own, torque, MOMENTS, strict=True)]
        # flight, in axes of the Earth and back
        cosine, sine = hy.cos(SPIN * UNIT * hy.time), hy.sin(SPIN * UNIT * hy.time)
        x, y, z = self.x
        a = field([cosine * x + sine * y, cosine * y - sine * x, z])
        earth = [cosine * a[0] - sine * a[1], sine * a[0] + cosine * a[1], a[2]]
        total = [p + q for p, q in zip(box, panel, strict=True)]
        pushed = [UNIT**2 / RADIUS / MASS * dot(row, total) for row in self.r]
        turning = quaternion_rate(self.q, self.w)
        flight = [p + q for p, q in zip(earth, pushed, strict=True)]
        edge = dot(self.x, sun) + hy.sqrt(dot(self.x, self.x) - 1.0)
        rates = [*self.v, *flight, *right, *turning]
        turning_away = dict(enumerate([*wind, *light])) if self.plates else {}
        return list(zip(self.states, rates, strict=True)), turning_away | ({6: edge} if self.shadow else {})

    def on_plates(self, wind: list[Any], thick: Any, light: list[Any]) -> tuple[list[Any], list[Any]]:
        """Forces of air and light in body axes, on the box and on the panel."""
        faces = [EDGES[1] * EDGES[2], EDGES[0] * EDGES[2], EDGES[0] * EDGES[1]]
        met = [hy.par[k] * wind[k] for k in range(3)]
        push = -0.5 * DRAG * thick
        box = [push * dot(faces, met) * k for k in wind]
        panel = [push * PANEL * met[2] * k for k in wind]
        # light, unless the Earth is before the Sun
        pressure = hy.par[6] * (1361.0 / 299792458.0)
        for i, area in enumerate([*faces, PANEL]):
            axis = min(i, 2) if i < 3 else 2
            c = hy.par[3 + axis] * light[axis]
            force = [-pressure * area * c * (1.0 - SPECULAR) * k for k in light]
            normal = 2.0 * pressure * area * c * (SPECULAR * c + DIFFUSE / 3.0) * hy.par[3 + axis]
            force[axis] = force[axis] - normal
            if i < 3:
                box = [a + b for a, b in zip(box, force, strict=True)]
            else:
                panel = [a + b for a, b in zip(panel, force, strict=True)]
        return box, panel

    def on_sphere(self, wind: list[Any], thick: Any, light: list[Any]) -> tuple[list[Any], list[Any]]:
        """Nothing, and the forces on the sphere."""
        area = math.pi * BALL**2
        pressure = (hy.par[6] if self.shadow else 1.0) * (1361.0 / 299792458.0)
        push = -0.5 * DRAG * thick * area * hy.sqrt(dot(wind, wind))
        pull = -pressure * area * (1.0 + 4.0 / 9.0 * DIFFUSE)
        return [0.0, 0.0, 0.0], [push * a + pull * b for a, b in zip(wind, light, strict=True)]

    def integrate(self, hours: float = 24.0, samples: int = 1441) -> dict[str, Any]:
        """Samples in SI, and the cost."""
        equations, looks = self.equations()
        start = [x / RADIUS for x in POSITION] + [v * UNIT / RADIUS for v in VELOCITY]
        size = math.sqrt(dot(QUATERNION[:3], QUATERNION[:3]) + QUATERNION[3] ** 2)
        start += [w * UNIT for w in RATES] + [q / size for q in QUATERNION]
        off = (-1.0,) * 6 + (0.0,)
        pars = [1.0] * 7
        for k, look in looks.items():
            if hy.cfunc([look], vars=self.states)(np.array(start), time=0.0)[0] <= 0:
                pars[k] = off[k]

        def turn(k: int) -> Any:
            def flip(engine: Any, sign: int) -> bool:
                engine.pars[k] = 1.0 if sign > 0 else off[k]
                return True

            return flip

        events = [hy.t_event(look, callback=turn(k)) for k, look in looks.items()]
        used = pars[: len(off)] if looks else []
        engine = hy.taylor_adaptive(equations, start, pars=used, t_events=events, compact_mode=True)
        steps = 0

        def count(_: Any) -> bool:
            nonlocal steps
            steps += 1
            return True

        grid = np.linspace(0.0, 3600 * hours / UNIT, samples)
        compiled = time.process_time()
        told = engine.propagate_grid(grid, callback=count)
        done = time.process_time()
        rows = told[-1]
        return {
            "position": rows[:, :3] * RADIUS,
            "angular_velocity": rows[:, 6:9] / UNIT,
            "quaternion": rows[:, 9:] / np.linalg.norm(rows[:, 9:], axis=1, keepdims=True),
            "steps": steps,
            "seconds": done - compiled,
        }
