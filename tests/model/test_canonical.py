"""The canonical formulation: Hamilton's equations give the motion that Euler's equations give."""

import numpy as np
import pytest
from support import CONFIGS, Trial, amplification, angle_between, config, law, run_text, tried

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare

RECORD = 'output.record=["angular_velocity", "quaternion"]'
STABLE = ("asymmetric_top", "heavy_top_nutating")
SATELLITE = config(
    "principal_moments = [1, 1.75, 2]",
    "angular_velocity = [0.1, 0, 1.5]\neuler_angles = [0.3, 1.0, 0.2]",
    'kind = "gravity_gradient"\ngravitational_parameter = 1\n'
    "orbit = {semi_major_axis = 1, eccentricity = 0.1, inclination = 0.3, node_rate = 0.01}",
    "end = 20\nsamples = 201",
)


def both(text: str, *overrides: str) -> tuple[Trial, Trial]:
    return tried(text, "double", "quaternion", *overrides), tried(text, "double", "canonical", *overrides)


def fastest(text: str) -> float:
    """A bound of the absolute angular velocity, rad/s."""
    return float(prepare(rigidsim.parse(text)).system.rate_bound)


def agree(plain: Trial, canonical: Trial, rate: float, duration: float, growth: float = 0.0) -> None:
    """Within three times the law (or the motion's own growth of errors, where that is larger)."""
    steps = canonical.steps
    bound = 3 * max(law(2.0**-52, steps, rate, duration), 2.0**-53 * np.sqrt(steps) * growth)
    assert angle_between(plain.attitudes[0], canonical.attitudes[0]).max() < 4 * bound
    for drift in canonical.drifts.values():
        assert drift <= 50 * 2.0**-52 * np.sqrt(steps)


@pytest.mark.parametrize("name", STABLE)
def test_ready_scenes_agree_with_the_quaternion(name: str) -> None:
    text = next(path for path in CONFIGS if path.stem == name).read_text()
    samples = prepare(rigidsim.parse(text)).scene.samples
    agree(*both(text), fastest(text), float(samples.last - samples.start))


@pytest.mark.slow
def test_a_potential_that_moves_with_an_orbit() -> None:
    agree(
        *both(SATELLITE),
        fastest(SATELLITE),
        20.0,
        amplification(rigidsim.parse(SATELLITE, overrides=[RECORD])),
    )


def test_loads_without_a_potential_are_refused() -> None:
    load = 'kind = "viscous_torque"\ncoefficients = [1, 1, 1]'
    with pytest.raises(ConfigError, match='given "canonical", but viscous_torque has no potential'):
        run_text(config(loads=load), 'integrator.formulation="canonical"')
