"""Euler angles through their singularity: another chart carries the run, and what is recorded stays what was
asked for, continuous and as accurate as a quaternion's.
"""

import math
from itertools import product

import numpy as np
import pytest
from support import angle_between, cases, config, law, run_text, wide

from rigidsim.scene.fields import EULER_SEQUENCES
from rigidsim.scene.rotations import AXES

RECORD = 'output.record=["angular_velocity", "quaternion", "euler_angles"]'
EULER = 'integrator.formulation="euler_angles"'


def tumbling(
    sequence: str, start: str = "quaternion = [0.7, 0.4, 0.5, 0.3]", time: str = "end = 100\nsamples = 1001"
) -> str:
    """A body that turns over about its middle axis, through all attitudes."""
    start = f"angular_velocity = [0.3, 1.0, 0.5]\n{start}"
    return config("principal_moments = [1, 2, 3]", start, (), time, f'euler_sequence = "{sequence}"')


def attitude_from(sequence: str, angles: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4) of Euler angles (n, 3) by products of three turns: numpy alone."""
    result = np.tile([1.0, 0, 0, 0], (len(angles), 1))
    for axis, turn in zip(sequence, angles.T, strict=True):
        w, v = result[:, 0], result[:, 1:]
        c, s = np.cos(turn / 2), np.sin(turn / 2)
        e = np.eye(3)[AXES.index(axis)]
        vector = w[:, None] * s[:, None] * e + c[:, None] * v + s[:, None] * np.cross(v, e)
        result = np.column_stack([w * c - s * (v @ e), vector])
    return result


@pytest.mark.parametrize("sequence", cases(EULER_SEQUENCES, ["xyz"]))
def test_a_tumbling_body_keeps_its_attitude_in_each_sequence(sequence: str) -> None:
    text = tumbling(sequence)
    exact = run_text(text, 'name="x"', RECORD, 'integrator.precision="extended"')
    run = run_text(text, 'name="e"', EULER, RECORD, estimate=True)
    reference = wide(exact.dataset, "quaternion")
    found = run.dataset["quaternion"].values
    # twice the steps of a quaternion: three times the law at most, with the growth that this motion about
    # its middle axis has (as the quaternion's bound would have it)
    steps = run.summary["cost"]["steps"]
    growth = max(1.0, run.summary["accuracy"]["amplification"])
    assert angle_between(found, reference).max() <= 3 * law(2.0**-52, steps, 1.16, 100) * growth
    # with its sign: never turned over
    assert np.abs(found - reference).max() < 1e-6
    changes = run.summary["chart_changes"]
    assert changes["count"] > 0
    assert changes["partner"] != sequence
    assert run.summary["warnings"] == []
    # the recorded angles are the same attitude, and the continuous ones
    angles = run.dataset["euler_angles"].values
    assert angle_between(attitude_from(sequence, angles), found).max() < 16 * 2.0**-52 * np.abs(angles).max()
    limits = (0, math.pi) if sequence[0] == sequence[2] else (-math.pi / 2, math.pi / 2)
    assert limits[0] <= angles[:, 1].min()
    assert angles[:, 1].max() <= limits[1]
    joined = exact.dataset["euler_angles"].values
    turns = (angles - joined - (angles - joined)[0]) / (2 * math.pi)
    # joined from quaternions at samples, a swing by more than half a turn between two is taken for less
    lost = np.abs(np.diff(angles, axis=0)) > 3.0
    assert (np.abs(np.diff(np.rint(turns), axis=0))[~lost] == 0).all()


@pytest.mark.parametrize(
    "case",
    cases(product(["zxz", "zyx"], ["0", "1e-16", "1e-12", "1e-9"]), [("zyx", "0"), ("zxz", "1e-12")]),
    ids="-".join,
)
def test_a_pass_that_no_sampling_shows_goes_straight_through(case: tuple[str, str]) -> None:
    """A body that spins about the line of nodes: the middle angle grows like t through 16 singularities."""
    sequence, offset = case
    rates = [float(axis == sequence[1]) for axis in AXES]
    start = f'angular_velocity = {rates}\neuler_angles = [0.4, 0.75, "{offset}"]'
    integrator = f'euler_sequence = "{sequence}"'
    text = config("principal_moments = [1, 1, 1]", start, (), "end = 50\nsamples = 5001", integrator)
    run = run_text(text, EULER, RECORD)
    angles = run.dataset["euler_angles"].values
    times = run.dataset["time"].values
    # off the node line by the offset, and by rounding, which adds up as in any attitude, the outer angles
    # move by that over the factor, whose smallest value at a sample is known beforehand
    factor = np.abs(np.sin(0.75 + times) if sequence[0] == sequence[2] else np.cos(0.75 + times)).min()
    rounding = 8 * 2.0**-52 * 50 * math.sqrt(run.summary["cost"]["steps"])
    bound = (float(offset) + rounding) / factor
    np.testing.assert_allclose(angles[:, 1], 0.75 + times, rtol=0, atol=bound)
    assert np.abs(angles[:, 0] - 0.4).max() < bound
    assert np.abs(angles[:, 2]).max() < bound
    quaternion = run.dataset["quaternion"].values
    assert np.abs(quaternion - attitude_from(sequence, angles)).max() < 1e-12  # in its sign, too


def test_events_are_found_in_both_charts() -> None:
    """An event on the asked sequence's own angle, and one that tells nothing of charts."""
    text = tumbling("zxz", time="end = 100\nsamples = 11") + (
        '[[events]]\nname = "flip"\nexpression = "wy"\n'
        '[[events]]\nname = "level"\nexpression = "theta - 0.3"\n'
    )
    run = run_text(text, EULER, RECORD)
    plain = run_text(text, 'name="q"', RECORD)
    assert run.summary["events"] == plain.summary["events"]
    assert run.summary["events"]["level"] > 3
    # at rest neither; both within the drift of the attitude over the rate of crossing
    for event in ("flip", "level"):
        difference = run.dataset[f"{event}_time"].values - plain.dataset[f"{event}_time"].values
        assert np.abs(difference).max() < 1e-10
    np.testing.assert_allclose(run.dataset["level_euler_angles"].values[:, 1], 0.3, rtol=0, atol=1e-12)
