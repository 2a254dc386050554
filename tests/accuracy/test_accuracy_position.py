"""``accuracy_position``: settings are chosen for the path as well, and what it kept is certified."""

from __future__ import annotations

import numpy as np
import pytest
from support import config
from support import run_estimated as run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.accuracy.choice import wanted

ATTRACTORS = config(
    "principal_moments = [1, 1.3, 1.6]\nmass = 1",
    "angular_velocity = [0.02, 0.05, 0.01]\nposition = [30, 0, 2]\nvelocity = [0, 0.25, 0]",
    [
        'kind = "central_gravity"\ngravitational_parameter = 1\nposition = [4, 0, 0]',
        'kind = "central_gravity"\ngravitational_parameter = 1\nposition = [-4, 0, 0]',
    ],
    "end = 400\nsamples = 5",
)


def test_the_path_is_certified_and_right() -> None:
    run = run_text(ATTRACTORS, "integrator.accuracy_position=1e-6")
    accuracy = run.summary["accuracy"]
    assert not run.summary["warnings"]
    assert accuracy["requested"] is None
    assert accuracy["certified_position"] <= accuracy["requested_position"] == 1e-6
    better = run_text(ATTRACTORS, 'integrator.precision="extended"', 'name="better"')
    with run.dataset as ours, better.dataset as theirs:
        off = np.linalg.norm(ours["position"].values - theirs["position"].values, axis=1).max()
    assert off <= accuracy["certified_position"]


def test_the_stricter_of_both_accuracies_is_chosen_for() -> None:
    both = ["integrator.accuracy=1e-9", "integrator.accuracy_position=3e-6"]
    size = np.linalg.norm([30, 0, 2])  # of the path, where it starts
    assert wanted(rigidsim.parse(ATTRACTORS, overrides=both)) == 1e-9
    assert wanted(rigidsim.parse(ATTRACTORS, overrides=both[1:])) == pytest.approx(3e-6 / size)
    assert wanted(rigidsim.parse(ATTRACTORS)) is None


def test_what_a_fixed_setting_misses_is_said() -> None:
    fixed = ['integrator.precision="double"', "integrator.tolerance=1e-4", 'integrator.method="taylor"']
    run = run_text(ATTRACTORS, "integrator.accuracy_position=1e-12", *fixed)
    assert "not_certified" in run.summary["warning_codes"]
    assert any("accuracy_position = 1e-12 m was asked for" in text for text in run.summary["warnings"])


def test_a_scene_without_a_path_refuses_an_accuracy_of_it() -> None:
    with pytest.raises(ConfigError, match="the scene has no position"):
        run_text(config(), "integrator.accuracy_position=1e-6")
    with pytest.raises(ConfigError, match="a length above 0"):
        rigidsim.parse(ATTRACTORS, overrides=["integrator.accuracy_position=0"])
