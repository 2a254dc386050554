"""Samples on both sides of a table's row, within one call of the integrator, against circles."""

import random
from dataclasses import replace

import numpy as np
import pytest
from support import config, loaded, matrices, run_text, seeds, unoptimised_code

from rigidsim.session.session import Tuning
from rigidsim.solve.sampler import MEASURED

# chunks so long that a call takes many steps from the start on, however busy the machine is
PATIENT = Tuning(replace(MEASURED, chunk_seconds=100.0))
GM, RADIUS = 3.986004418e14, 7e6


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_the_source_stays_on_its_circle(seed: int) -> None:
    """Nadir in space axes, at samples before and after rows."""
    draw = random.Random(seed)
    turn = 2 * np.pi * (RADIUS**3 / GM) ** 0.5
    end, tilt, node = draw.uniform(6, 12) * turn, draw.uniform(0, 3), draw.uniform(0, 6)
    moments = np.linspace(0, end, draw.randint(8, 12)).tolist()  # tens of steps from row to row
    rows = [f"{t!r}, {RADIUS}, 0, {tilt}, {node}, 0, {2 * np.pi * t / turn!r}" for t in moments]
    names = "time, semi_major_axis, eccentricity, inclination, ascending_node, periapsis, mean_anomaly"
    table = "\n".join([names, *rows])
    text = config(
        body="principal_moments = [10, 14, 19]",
        initial="angular_velocity = [1e-4, -2e-4, 3e-4]\nquaternion = [1, 0.2, 0.1, 0.3]",
        loads=f'kind = "gravity_gradient"\ngravitational_parameter = {GM}\n'
        'satellite_orbit = {table = "it.csv"}',
        time=f"end = {end!r}\nsamples = {draw.randint(100, 600)}",
        output='record = ["quaternion", "nadir"]',
        more=f"[tables.\"it.csv\"]\ntext = '''\n{table}'''\n",
    )
    with unoptimised_code():
        dataset = loaded(run_text(text, tuning=PATIENT))
    phase = 2 * np.pi * dataset.time.values / turn
    cos, sin = np.cos(phase), np.sin(phase) * np.cos(tilt)
    up = [
        np.cos(node) * cos - np.sin(node) * sin,
        np.sin(node) * cos + np.cos(node) * sin,
        np.sin(phase) * np.sin(tilt),
    ]
    found = np.einsum("nij,nj->ni", matrices(dataset["quaternion"]), dataset["nadir"])
    assert np.abs(found + np.array(up).T).max() < 1e-11  # rows of float64, and their interpolation
