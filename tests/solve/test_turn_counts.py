"""Turns of Euler angles are those of the motion, however far apart the samples lie."""

import math

import numpy as np
import pytest
from support import bits, cases, config, run_text

ANGLES = 'record = ["quaternion", "euler_angles"]'
SYMMETRIC = "principal_moments = [1, 1, 1.5]"
# L along Z: the axis keeps its tilt, and both other angles grow uniformly
PRECESSING = "angular_momentum = [0, 0, 2]\neuler_angles = [0.3, 1.1, 0.2]"
TUMBLING = {
    "body": "principal_moments = [1, 2, 3]",
    "initial": "angular_velocity = [0.5, 0.25, 1]\nquaternion = [0.5, 0.1, -0.3, 0.7]",
    "loads": 'kind = "gravity_gradient"\ngravitational_parameter = 0.1\n'
    "orbit = {semi_major_axis = 1, eccentricity = 0.2, inclination = 0.5}",
}


WAYS = [
    'formulation = "quaternion"',
    'formulation = "euler_angles"',
    'method = "closed_form"',
    'precision = "single"',
]


@pytest.mark.parametrize("integrator", cases(WAYS, [WAYS[0], WAYS[2]]))
def test_a_body_turns_ten_thousand_radians_between_two_samples(integrator: str) -> None:
    text = config(SYMMETRIC, PRECESSING, (), "end = 10000\nsamples = 3", integrator, ANGLES)
    run = run_text(text)
    momentum, tilt, time = 2.0, 1.1, run.dataset["time"].values
    expected = np.array([0.3, tilt, 0.2]) + np.outer(
        time, [momentum / 1, 0, (1 / 1.5 - 1 / 1) * momentum * math.cos(tilt)]
    )
    assert expected[1, 0] == pytest.approx(10000, abs=1)
    # single precision loses a radian's digits long before (eps abs(w) t); whole turns are what is counted
    allowed = 1.0 if "single" in integrator else 1e-6
    assert np.abs(run.dataset["euler_angles"].values - expected).max() < allowed
    assert "angles_wrapped_from" not in run.dataset.attrs


@pytest.mark.slow
@pytest.mark.unoptimised
def test_a_tumbling_body_that_passes_poles_has_the_angles_that_states_have() -> None:
    """Within 0.02 rad of the pole at 400.4 s the nearest angles of dense samples are a turn off, too. To
    record angles changes no bit of the motion.
    """
    time = "end = 402\nsamples = 2"
    ours = run_text(config(**TUMBLING, time=time, output=ANGLES))
    states = run_text(config(**TUMBLING, time=time, integrator='formulation = "euler_angles"'))
    difference = ours.dataset["euler_angles"].values[-1] - states.dataset["euler_angles"].values[-1]
    assert np.abs(difference).max() < 1e-6  # two integrations, far below a turn
    assert not ours.summary["warnings"]
    without = run_text(config(**TUMBLING, time=time, output='record = ["quaternion"]'))
    np.testing.assert_array_equal(bits(ours.dataset["quaternion"]), bits(without.dataset["quaternion"]))


def test_angles_at_events_are_within_one_turn_and_say_so() -> None:
    """Nobody follows the motion from event to event; phi = 0.3 + 2 t."""
    event = '[[events]]\nname = "level"\nexpression = "wx"'
    run = run_text(config(SYMMETRIC, PRECESSING, (), "end = 30\nsamples = 301", "", ANGLES, event))
    found = run.dataset["level_euler_angles"]
    assert found.sizes["level"] == 3
    assert found.attrs["turns"] == found.attrs["angle"] == "within one turn"
    off = found.values[:, 0] - 0.3 - 2 * run.dataset["level_time"].values
    np.testing.assert_allclose(off, 2 * np.pi * np.rint(off / (2 * np.pi)), atol=1e-10)
    assert np.abs(found.values).max() <= np.pi


@pytest.mark.slow
@pytest.mark.unoptimised
def test_turns_of_a_motion_with_switching_surfaces() -> None:
    """Coulomb friction brings the body to rest after 40 turns; a switched torque turns it back and forth."""
    body, start = SYMMETRIC, "angular_velocity = [0, 0, 10]\neuler_angles = [0.2, 1, 0]"
    friction = 'kind = "torque"\ncomponents = [0, 0, "-0.3*sign(wz)"]'
    run = run_text(config(body, start, friction, "times = [0, 20, 70, 90]", "", ANGLES), 'name="a"')
    # w = 10 - 0.2 t until 50 s
    assert run.dataset["euler_angles"].values[:, 2] == pytest.approx([0, 160, 250, 250], abs=1e-6)
    switched = 'kind = "torque"\ncomponents = ["0.1*sign(sin(t))", 0, "0.05*abs(wy)"]'
    sparse, dense = (
        run_text(config(loads=switched, time=f"end = 40\nsamples = {n}", output=ANGLES), f'name="{n}"')
        for n in (3, 401)
    )
    np.testing.assert_array_equal(
        sparse.dataset["euler_angles"].values, dense.dataset["euler_angles"].values[::200]
    )
    assert not sparse.summary["warnings"]
