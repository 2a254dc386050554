"""Samples that aren't defined are counted; those lost on the way are warned of, those of the start aren't."""

import numpy as np
import pytest
from support import IMPATIENT, config

import rigidsim

# spins about its middle axis and turns over: its spin leaves the cone about that axis and comes back
FLIPPING = config(
    initial="angular_velocity = [0.1, 1.0, 0.05]",
    time="end = 60\nsamples = 241",
    output='record = ["polar_motion", "angular_velocity"]',
    more='[frame]\nfigure_axis = "y"',
)
# falls over from upright: it has no node as long as it hasn't left the vertical
UPRIGHT = config(
    "principal_moments = [2, 2, 1]\nmass = 1\ncenter_of_mass = [0, 0, 1]",
    "angular_velocity = [{push}, 0, 1]",
    'kind = "uniform_gravity"\nacceleration = [0, 0, -1]',
    "end = 3\nsamples = 13",
    output='record = ["precession_angle", "tilt"]',
)


def undefined(run: rigidsim.Run, name: str) -> np.ndarray:
    return np.isnan(run.dataset[name].values).reshape(run.dataset.sizes["time"], -1).any(axis=1)


@pytest.fixture(scope="module")
def flipping(tmp_path_factory: pytest.TempPathFactory) -> rigidsim.Run:
    return rigidsim.run(rigidsim.parse(FLIPPING), out=tmp_path_factory.mktemp("runs"), tuning=IMPATIENT)


def test_a_variable_lost_on_the_way_is_warned_of(flipping: rigidsim.Run) -> None:
    rates = flipping.dataset.angular_velocity.values
    outside = np.hypot(rates[:, 0], rates[:, 2]) > np.abs(rates[:, 1])
    assert 0 < outside.sum() < len(outside)  # the definition, not what was recorded
    np.testing.assert_array_equal(undefined(flipping, "polar_motion"), outside)
    pole = (rates[:, [2, 0]] / rates[:, [1]])[~outside]
    np.testing.assert_allclose(flipping.dataset.polar_motion.values[~outside], pole, rtol=1e-14)
    assert flipping.summary["undefined_samples"] == {"polar_motion": int(outside.sum())}
    assert flipping.summary["warning_codes"] == ["undefined"]
    (told,) = flipping.summary["warnings"]
    first = flipping.dataset.time.values[outside][0]
    assert f"at {outside.sum()} of 241 samples, first at {first:g} s" in told
    assert "more than 45 degrees from the figure axis" in told


@pytest.mark.parametrize(("push", "since"), [(0.0, 13), (1e-9, 1)])
def test_what_the_start_leaves_undefined_is_told_but_no_alarm(push: float, since: int) -> None:
    run = rigidsim.run(rigidsim.parse(UPRIGHT.format(push=push)), out=None)
    assert undefined(run, "precession_angle").tolist() == [True] * since + [False] * (13 - since)
    assert run.summary["undefined_samples"] == {"precession_angle": since}
    assert run.summary["warnings"] == []
