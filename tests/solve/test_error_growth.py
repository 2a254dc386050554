"""Stable and unstable motions are told apart before a summary promises digits."""

from __future__ import annotations

import math

import pytest
from support import run_estimated as run_text

SPIN = """
name = "spin"
[body]
principal_moments = [1, 2, 3]
[initial]
angular_velocity = {rates}
[time]
end = {end}
samples = 101
"""


def test_spin_about_the_middle_axis_amplifies_by_no_more_than_the_inverse_square_of_its_offset() -> None:
    """A passage takes (2 / rate) log(1/offset), so errors grow by up to 1/offset^2 in it; the rate is
    1 / sqrt 3, and the first passage begins half-way.
    """
    offset = "1e-6"
    end = 2 * math.sqrt(3) * math.log(1 / float(offset))
    run = run_text(SPIN.format(rates=f"[{offset}, 1, {offset}]", end=end))
    accuracy = run.summary["accuracy"]
    assert 1 < accuracy["amplification"] < 10 / float(offset) ** 2
    assert 0 < accuracy["amplification_seconds"] <= end * 1.1


SATELLITE = """
name = "satellite"
[body]
principal_moments = [0.59555, 0.85945, 1]
[initial]
angular_velocity = {rates}
euler_angles = [0, 0.3, 0]
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = 1
orbit = {{semi_major_axis = 1, eccentricity = {eccentricity}}}
[time]
end = 600
samples = 601
"""


@pytest.mark.slow
def test_hyperion_tumbles_beyond_prediction() -> None:
    """Wisdom, Peale & Mignard 1984: errors grow e-fold in about 8 / n; double has 15 digits to lose."""
    chaotic = run_text(SATELLITE.format(rates="[0.01, 0.02, 1]", eccentricity=0.1))
    accuracy = chaotic.summary["accuracy"]
    # the pilot sees some 40 orbits, over which the rate itself is uncertain by a factor of two
    assert 0.06 < accuracy["error_growth_rate"] < 0.24
    digits = 34.5  # natural logarithm of 1e15
    assert digits / 0.24 / 2 < accuracy["predictable_seconds"] < digits / 0.06
    assert any("digits are gone from about" in warning for warning in chaotic.summary["warnings"])
    extended = run_text(
        SATELLITE.format(rates="[0.01, 0.02, 1]", eccentricity=0.1), 'integrator.precision="extended"'
    )
    longer = extended.summary["accuracy"]["predictable_seconds"] - accuracy["predictable_seconds"]
    # eleven bits more are lost, at rates between which the local one varies
    assert math.log(2.0**11) / 0.24 < longer < math.log(2.0**11) / 0.06
