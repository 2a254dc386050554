"""Bodies of a kernel that attract a freely flying one, in the frame of its host and the barycentre's."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import DOP853
from support import run_text
from test_kernels import KERNEL

import rigidsim

SCENE = """
name = "satellite"
[body]
principal_moments = [1, 2, 2.5]
mass = 10
host = "earth"
[initial]
position = ["42164 km", 0, 0]
velocity = [0, "3.0747 km/s", "0.1 km/s"]
angular_velocity = [1e-4, 0, 2e-4]
[ephemeris]
kernel = "de421"
[[loads]]
kind = "central_gravity"
source = "earth"
[[loads]]
kind = "central_gravity"
source = "moon"
name = "moon"
[[loads]]
kind = "central_gravity"
source = "sun"
[time]
epoch = "1969-07-20T12:00:00 TDB"
end = "10 day"
samples = 3
"""
DAY, CUBE = 86400.0, (KERNEL.AU * 1000) ** 3 / 86400.0**2
EARTH = KERNEL.GMB * KERNEL.EMRAT / (1 + KERNEL.EMRAT) * CUBE
STRENGTHS = {"earth": EARTH, "moon": EARTH / KERNEL.EMRAT, "sun": KERNEL.GMS * CUBE}


def barycentric(source: str, seconds: float) -> np.ndarray:
    """Position, m, by jplephem."""
    names = {"earth": -1 / (1 + KERNEL.EMRAT), "moon": KERNEL.EMRAT / (1 + KERNEL.EMRAT)}
    name = "earthmoon" if source in names else source
    found = np.asarray(KERNEL.position(name, 2440423.0, seconds / DAY))[:, 0]
    if source in names:
        found = found + names[source] * np.asarray(KERNEL.position("moon", 2440423.0, seconds / DAY))[:, 0]
    return 1000 * found


def flown(start: np.ndarray, origin: str, days: float) -> np.ndarray:
    """Position and velocity after some days of a point among the three bodies, by DOP853."""

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        shift = barycentric(origin, t) if origin else np.zeros(3)
        total = np.zeros(3)
        for name, strength in STRENGTHS.items():
            place = barycentric(name, t) - shift
            away = place - y[:3]
            total += strength * away / np.linalg.norm(away) ** 3
            if origin and name != origin:
                total -= strength * place / np.linalg.norm(place) ** 3
        return np.concatenate([y[3:], total])

    y = start
    for begin, end in pairwise([0, *(x for x in np.arange(1.5, days, 4)), days]):
        scale = np.array([1e8] * 3 + [1e4] * 3)
        solver = DOP853(slope, begin * DAY, y, end * DAY, rtol=1e-13, atol=1e-15 * scale)
        while solver.status == "running":
            solver.step()
        y = solver.y
    return y


def test_a_satellite_feels_the_tides_of_moon_and_sun() -> None:
    dataset = run_text(SCENE).dataset
    start = np.array([42164e3, 0, 0, 0, 3074.7, 100.0])
    wanted = flown(start, "earth", 10)
    # the body's shape adds 3 (I_max - I_min) / (2 m r^2) of the acceleration, 1e-16 of it
    assert np.linalg.norm(dataset["position"].values[-1] - wanted[:3]) < 1e-3
    beside = ["loads[1].gravitational_parameter=1e-3", "loads[2].gravitational_parameter=1e-3"]
    alone = run_text(SCENE, *beside).dataset["position"].values[-1]
    assert np.linalg.norm(alone - wanted[:3]) > 1e3


def test_the_balance_of_energy_holds() -> None:
    run = run_text(SCENE)
    found = run.summary["invariants"]["energy_balance"]
    assert found["largest_drift"] < found["bound"]


def test_about_the_barycentre_nothing_falls() -> None:
    place = barycentric("earth", 0.0) + np.array([5e8, 1e8, 0])
    speed = (barycentric("earth", 500.0) - barycentric("earth", -500.0)) / 1000 + np.array([0, 0, 800.0])
    text = SCENE.replace('host = "earth"\n', "")
    lines = {"position = ": [float(x) for x in place], "velocity = ": [float(x) for x in speed]}
    for key, value in lines.items():
        line = next(x for x in text.splitlines() if x.startswith(key))
        text = text.replace(line, f"{key}{value}")
    dataset = run_text(text).dataset
    wanted = flown(np.concatenate([place, speed]), "", 10)
    assert np.linalg.norm(dataset["position"].values[-1] - wanted[:3]) < 0.1  # of 1.5e11, by rounding


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("initial.position=,initial.velocity=", 'given "central_gravity" for a body without a position'),
        ('loads[1].source="pluton"', 'given "pluton"; did you mean "pluto"'),
        ("loads[1].position=[1, 0, 0]", "given beside source, which says it"),
        ('body.host="jupyter"', 'given "jupyter"; did you mean "jupiter"'),
    ],
)
def test_mistakes_are_refused(setting: str, words: str) -> None:
    with pytest.raises(rigidsim.ConfigError) as caught:
        run_text(SCENE, *(setting.split(",") if "initial" in setting else [setting]))
    assert words in str(caught.value)


SYSTEM = """
name = "system"
[body]
principal_moments = [8.79e34, 8.7920e34, 8.7955e34]
host = "moon"
[initial]
angular_velocity = [0, 0, 2.6617e-6]
[ephemeris]
kernel = "de421"
[[bodies]]
name = "sun"
ephemeris = true
[[bodies]]
name = "earth"
ephemeris = true
[[bodies]]
name = "moon"
ephemeris = true
[[bodies]]
name = "jupiter"
ephemeris = true
[[loads]]
kind = "gravity_gradient"
orbit = {body = "earth"}
[time]
epoch = "1969-07-20T12:00:00 TDB"
end = "10 day"
samples = 3
"""


def test_point_masses_start_from_the_kernel_and_go_on_as_it_says() -> None:
    dataset = run_text(SYSTEM).dataset
    assert dataset.attrs["axes"] == "ICRF"
    assert len(dataset.attrs["ephemeris_sha256"]) == 64
    places = dataset["point_mass_position"]
    for name in ("sun", "earth", "moon"):
        start = places.sel(point_mass=name).values[0]
        assert np.linalg.norm(start - barycentric(name, 0.0)) < 1e-3
    moon = places.sel(point_mass="moon").values - places.sel(point_mass="earth").values
    for row, time in enumerate(dataset["time"].values):
        wanted = barycentric("moon", time) - barycentric("earth", time)
        # the Earth's J2 alone, 1.5 J2 (R/r)^2 = 4e-7 of 2.7e-3 m/s^2, makes 450 m in ten days
        assert np.linalg.norm(moon[row] - wanted) < 600, time


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("bodies[0].position=[1, 0, 0]", "given beside ephemeris = true, which says it"),
        ('bodies[0].name="sunn"', 'given "sunn"; did you mean "sun"'),
        ("ephemeris=", "given true, but there is no [ephemeris]"),
        ('loads[0].orbit=; loads[0].source="sun"', "which is one of [[bodies]]"),
    ],
)
def test_mistakes_of_point_masses_are_refused(setting: str, words: str) -> None:
    with pytest.raises(rigidsim.ConfigError) as caught:
        run_text(SYSTEM, *setting.split("; "))
    assert words in str(caught.value)
