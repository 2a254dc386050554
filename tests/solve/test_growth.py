"""Stable and unstable motions are told apart before a summary promises digits."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import run_text

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


@pytest.mark.parametrize("rates", ["[1, 1e-3, 1e-3]", "[1e-3, 1e-3, 1]", "[0.5, 0.25, 1]"])
def test_spin_about_an_outer_axis_is_stable(rates: str, runs: Path) -> None:
    run = run_text(SPIN.format(rates=rates, end=500), runs)
    assert run.summary["accuracy"]["amplification"] == 1


@pytest.mark.parametrize("offset", ["1e-2", "1e-4", "1e-6"])
def test_spin_about_the_middle_axis_amplifies_by_the_inverse_square_of_its_offset(
    offset: str, runs: Path
) -> None:
    """A passage takes (2 / rate) log(1/offset), so errors grow by up to 1/offset^2 in it."""
    run = run_text(SPIN.format(rates=f"[{offset}, 1, {offset}]", end=200), runs)
    accuracy = run.summary["accuracy"]
    largest = 1 / float(offset) ** 2
    # an offset of 2^-30 saturates at O(1); a randomly chosen one has some part along the growing solution
    assert 1e-4 * min(largest, 2**30) < accuracy["amplification"] < 10 * largest
    assert 0 < accuracy["amplification_seconds"] <= 200


def test_lost_digits_are_said(runs: Path) -> None:
    lost = run_text(SPIN.format(rates="[1e-4, 1, 1e-4]", end=200), runs, 'integrator.precision="single"')
    assert any("digits are gone" in warning for warning in lost.summary["warnings"])
    kept = run_text(SPIN.format(rates="[1e-4, 1, 1e-4]", end=200), runs, 'integrator.precision="quadruple"')
    assert not kept.summary["warnings"]
