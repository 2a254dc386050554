"""Flights on which loads do work, held against scipy's integration of the plain equations in SI."""

from dataclasses import replace

import numpy as np
import pytest
from flights import MU, Flight, by_scipy, turned_by
from support import run_estimated, run_text, unoptimised_code

import rigidsim
from rigidsim import ConfigError

IN_ORBIT = Flight(
    np.array([1.0, 2.0, 3.0]), 100.0, np.array([0.01, 0.02, 0.015]), np.array([1.0, 0.1, 0.2, 0.3]),
    np.array([6900e3, 0.0, 0.0]), np.array([0.0, 5000.0, 5700.0]), 3600.0, strength=MU, drag=1e-9, power=2.0,
)  # fmt: skip


@pytest.mark.slow
@unoptimised_code()
def test_a_small_drag_leaves_the_attitude_as_right_as_announced() -> None:
    """The other integrator's own errors: 1e-13 of each of some thousand steps, over a hundred radians."""
    run, truth = run_estimated(IN_ORBIT.text), by_scipy(IN_ORBIT)
    assert turned_by(run.dataset["quaternion"].values[-1], truth[6:10]) <= 1e-11
    assert np.linalg.norm(run.dataset["position"].values[-1] - truth[:3]) <= 1e-5
    assert run.summary["accuracy"]["estimated_attitude_error"] <= 1e-11
    assert run.summary["warnings"] == []


def test_a_source_among_the_bodies_leaves_the_quaternion_its_norm() -> None:
    """Its force does work on the flight too, since it moves."""
    bodies = (
        f'[[bodies]]\nname = "earth"\ngravitational_parameter = {MU!r}\nposition = [0, 0, 0]\n'
        '[[bodies]]\nname = "moon"\ngravitational_parameter = 4.9e12\nposition = [3.8e8, 0, 0]\n'
        "velocity = [0, 1000, 100]\n"
    )
    text = replace(IN_ORBIT, drag=0.0).text
    place = f"gravitational_parameter = {MU!r}\nposition = [0.0, 0.0, 0.0]"
    text = text.replace(place, 'orbit = {body = "earth"}')
    assert run_text(text + bodies).summary["warnings"] == []
    gradient = '[[loads]]\nkind = "gravity_gradient"\norbit = {body = "earth"}\n'
    with pytest.raises(ConfigError, match="which has its torque; remove it"):
        rigidsim.plan(rigidsim.parse(text + gradient + bodies))
