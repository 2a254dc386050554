"""Stable and unstable motions are told apart before a summary promises digits."""

import math

from support import config
from support import run_estimated as run_text

SPIN = config(
    "principal_moments = [1, 2, 3]", "angular_velocity = {rates}", time="end = {end}\nsamples = 101"
)


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
