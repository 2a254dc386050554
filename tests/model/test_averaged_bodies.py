"""Averages over the rotation under point masses that are integrated beside the body."""

import math

import numpy as np
import pytest
from support import config, run_text

AU, SUN, EARTH, MOON = 149597870700.0, 1.32712440018e20, 3.986004418e14, 4.9028e12
DAY = 86400.0
SPIN = 3600.0  # deg a day
SCENE = config(
    'principal_moments = ["8.010e37 kg m^2", "8.012e37 kg m^2", "8.0365e37 kg m^2"]\n'
    'mass = "5.97219e24 kg"\n%s',
    'euler_angles = [0, "23.44 deg", 0]\nangular_velocity = [0, 0, "%s deg/day"]\n%s',
    time='end = "60 day"\nsamples = 31',
    output='record = ["momentum_axis", "point_mass_position", "orbital_energy"]',
    more='[model]\nlevel = "%s"',
)
SUN_AND_EARTH = f"""
[[bodies]]
name = "sun"
gravitational_parameter = {SUN!r}
[[bodies]]
name = "earth"
gravitational_parameter = {EARTH!r}
orbit = {{about = "sun", semi_major_axis = "1 au", eccentricity = 0.3, inclination = "7 deg"}}
"""
THE_MOON = f"""
[[bodies]]
name = "moon"
gravitational_parameter = {MOON!r}
orbit = {{about = "earth", semi_major_axis = "384400 km", eccentricity = 0.0549, inclination = "5.145 deg"}}
"""


def scene(level: str) -> str:
    gradient = '[[loads]]\nkind = "gravity_gradient"\norbit = {body = "%s"}\n'
    masses = SUN_AND_EARTH + THE_MOON + gradient % "sun" + gradient % "moon"
    return SCENE % ('host = "earth"\ncoupling = "one_way"', SPIN, masses, level)


def nodding() -> float:
    """Rate of the momentum's direction that the Moon and the Sun can drive, over the spin."""
    shape = 1 - 8.011 / 8.0365
    spin = math.radians(SPIN) / DAY
    drive = 3 * shape / spin * (SUN / (0.7 * AU) ** 3 + MOON / (0.92 * 384.4e6) ** 3)
    return drive / spin


@pytest.mark.slow
@pytest.mark.unoptimised
def test_the_momentum_is_that_of_every_rotation_as_announced() -> None:
    full, averaged = run_text(scene("full")), run_text(scene("spin_averaged"), estimate=True)
    moved = full.dataset.momentum_axis.values
    apart = moved - averaged.dataset.momentum_axis.values
    path = float(np.linalg.norm(moved - moved[0], axis=1).max())
    assert path > 1e-6
    # what goes round with the rotation, to first order subtracted at the start: nodding, and of its second
    # order along the path
    assert np.abs(apart).max() < nodding() + 10 * nodding() * path
    assert averaged.summary["cost"]["steps"] * 20 < full.summary["cost"]["steps"]
    found = averaged.summary["modelling"]
    assert found["whole"]
    true = np.linalg.norm(apart, axis=1).max()
    assert true <= found["momentum_axis"] <= 10 * true
