"""Averages over orbits by a table: columns that rest, and the obliquity of Mars."""

from pathlib import Path

import numpy as np
import pytest
from support import config, run_text

import rigidsim
from rigidsim.solve.problem import prepare

pytestmark = pytest.mark.unoptimised


def test_columns_that_rest_are_constants() -> None:
    """A column of equal values changes no bit of what the same constant gives."""
    times = np.arange(-12.0, 120.0, 4.0)  # every half turn or so; whole turns follow from Kepler's third law
    rows = [f"{t}, 0.2, 0.2, {1 + 0.004 * t}, {0.5 + 0.006 * t}" for t in times]
    header, momenta = "time, eccentricity, inclination, ascending_node, periapsis", []
    for head, cell, key in (
        (header, "", ", semi_major_axis = 1"),
        (f"{header}, semi_major_axis", ", 1.0", ""),
    ):
        table = "\n".join([head, *(row + cell for row in rows)])
        text = config(
            "principal_moments = [0.98, 0.98, 1]",
            'angular_velocity = [0, 0, 60]\neuler_angles = [0.3, "35 deg", 0]',
            'kind = "gravity_gradient"\ngravitational_parameter = 1\n'
            f'orbit = {{table = "orbit.csv", mean_anomaly = 0.3{key}}}',
            "end = 100\nsamples = 101",
            output='record = ["momentum_axis"]',
            more='[model]\nlevel = "orbit_averaged"\n[frame]\nreference = "orbit"\n'
            f"[tables.\"orbit.csv\"]\ntext = '''\n{table}\n'''",
        )
        momenta.append(run_text(text).dataset.momentum_axis.values)
        assert not [name for name in prepare(rigidsim.parse(text)).system.states if "axis" in name]
    assert (momenta[0] == momenta[1]).all()


@pytest.mark.slow
def test_the_obliquity_of_mars_swings_as_published() -> None:
    """On its perturbed orbit, over half a million years: Ward 1973, Science 181, 260, says some 120,000 years
    for a swing, between 14.9 and 35.5 deg at most.
    """
    path = Path(__file__).parents[2] / "configs" / "tables" / "mars_obliquity.toml"
    short = ["time.end='500 kyr'", "output.timeline=false", "output.estimate=false"]
    data = rigidsim.run(rigidsim.load(path, overrides=short), out=None).dataset
    obliquity = np.degrees(data.obliquity.values[:, 0])
    assert obliquity[0] == pytest.approx(25.19, abs=0.005)  # of almanacs
    # his elements are of 1950 and linear; a degree is what Laskar & Robutel 1993 differ by over so long
    assert 14.9 - 1 < obliquity.min() < 18
    assert 33 < obliquity.max() < 35.5 + 1
    turns = np.flatnonzero(np.diff(np.sign(np.diff(obliquity))) < 0)
    assert np.diff(turns).mean() * 2 == pytest.approx(120, abs=6)  # thousands of years; 1.2e5 has two digits
