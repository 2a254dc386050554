"""Satellites of up to twelve plates in the light, many edge-on at the start, where all their kinks meet.

The truth is DOP853, whose step control makes steps small at the kinks of the force, which is continuous.
"""

import math
from collections.abc import Iterator

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import config, run_text, seeds, unoptimised_code

from rigidsim.errors import ConfigError

LIGHT, STRENGTH, DISTANCE = 299792458.0, 1.32712440018e20, 149597870700.0
TEXT = config(
    "principal_moments = {moments}\n{plates}",
    "angular_velocity = {rates}\nquaternion = {quaternion}",
    [
        'kind = "gravity_gradient"\nname = "sun"\norbit = {{semi_major_axis = "149597870.7 km"}}\n'
        'gravitational_parameter = "1.32712440018e20 m^3/s^2"',
        'kind = "radiation_pressure"\nlight = "sun"\nirradiance = {irradiance}',
    ],
    "end = {end}\nsamples = 5",
    output='record = ["angular_velocity", "quaternion"]',
)
PLATE = "[[body.surfaces]]\nnormal = {}\narea = {}\nposition = {}\nspecular = {}\ndiffuse = {}\n"


class Satellite:
    """A random one; most have plates edge-on, and some bodies are at rest or spin about the light."""

    def __init__(self, seed: int) -> None:
        draw = np.random.default_rng(seed)
        a, b = draw.uniform(1, 2, 2)
        self.moments = np.array([a, b, draw.uniform(max(a, b), a + b)])
        count = int(draw.integers(1, 13))
        self.normals = draw.normal(size=(count, 3))
        self.edge_on = int(draw.integers(0, count + 1)) if draw.random() < 0.6 else count
        self.normals[: self.edge_on, 0] = 0.0
        self.normals[: self.edge_on, 1:] = np.round(self.normals[: self.edge_on, 1:] * 4)
        self.normals[(self.normals == 0).all(axis=1), 1] = 1.0
        self.places, self.areas = draw.normal(size=(count, 3)) * 0.3, draw.uniform(0.1, 1, count)
        self.specular, self.diffuse = draw.uniform(0, 0.5, count), draw.uniform(0, 0.5, count)
        self.rates = draw.uniform(-0.4, 0.4, 3)
        kind = draw.random()
        self.rates[1 if kind < 0.15 else 3 :] = 0.0
        if 0.15 <= kind < 0.25:
            self.rates[:] = 0.0
        turned = draw.choice([0.0, draw.uniform(-3, 3)])
        self.quaternion = np.array([math.cos(turned / 2), math.sin(turned / 2), 0.0, 0.0])
        self.pressure = 10 ** draw.uniform(-3, -1)

    def text(self, end: float) -> str:
        given = self.normals.tolist(), self.areas, self.places.tolist(), self.specular, self.diffuse
        rows = zip(*given, strict=True)
        return TEXT.format(
            moments=self.moments.tolist(), rates=self.rates.tolist(), quaternion=self.quaternion.tolist(),
            irradiance=self.pressure * LIGHT, end=end, plates="".join(PLATE.format(*row) for row in rows),
        )  # fmt: skip

    def light(self, t: float, q: np.ndarray) -> np.ndarray:
        """Unit vector to the Sun, body axes."""
        moved = math.sqrt(STRENGTH / DISTANCE**3) * t
        a, b, c, d = q / np.linalg.norm(q)
        first = np.array([a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)])
        second = np.array([2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)])
        return math.cos(moved) * first + math.sin(moved) * second

    def facing(self, t: float, y: np.ndarray) -> np.ndarray:
        return self.normals @ self.light(t, y[3:]) / np.linalg.norm(self.normals, axis=1)

    def field(self, t: float, y: np.ndarray, lit: np.ndarray) -> np.ndarray:
        u, n = self.light(t, y[3:]), self.normals / np.linalg.norm(self.normals, axis=1)[:, None]
        c = np.where(lit, n @ u, 0.0)
        along = ((1 - self.specular) * c)[:, None] * u
        back = (2 * (self.specular * c + self.diffuse / 3) * c)[:, None] * n
        forces = -self.pressure * self.areas[:, None] * (along + back)
        torque = np.cross(self.places, forces).sum(axis=0)
        torque = torque + 3 * STRENGTH / DISTANCE**3 * np.cross(u, self.moments * u)
        w = y[:3]
        change = (torque - np.cross(w, self.moments * w)) / self.moments
        q = np.array([-(y[4:] @ w), *(y[3] * w + np.cross(y[4:], w))])
        return np.concatenate([change, q / 2])

    def end(self, until: float) -> np.ndarray:
        """Rates and quaternion at the end; the force is continuous, so that small steps pass its kinks."""
        found = solve_ivp(
            lambda t, y: self.field(t, y, self.facing(t, y) > 0), (0, until),
            np.concatenate([self.rates, self.quaternion]), "DOP853", rtol=1e-12, atol=1e-13, max_step=0.1,
        )  # fmt: skip
        return np.asarray(found.y[:, -1])


@pytest.fixture(autouse=True)
def _quickly_compiled() -> Iterator[None]:
    with unoptimised_code():
        yield


@pytest.mark.parametrize("seed", seeds(1, 100))
def test_satellites_of_plates(seed: int) -> None:
    satellite = Satellite(seed)
    run = run_text(satellite.text(20.0))
    assert run.summary["status"] == "finished", run.summary["message"]
    assert not run.summary["warnings"]
    truth, found = satellite.end(20.0), run.dataset
    assert np.abs(found.angular_velocity.values[-1] - truth[:3]).max() < 1e-8
    sign = math.copysign(1, found.quaternion.values[-1] @ truth[3:])
    assert np.abs(sign * found.quaternion.values[-1] - truth[3:]).max() < 1e-8


def test_words_name_what_was_written() -> None:
    """A refusal for plates names the plate, and its advice can be followed."""
    with pytest.raises(ConfigError, match=r"\[body\] surfaces\[\d+\].*take a sphere in place of the plate"):
        run_text(Satellite(1).text(20.0), "output.lyapunov=true")
