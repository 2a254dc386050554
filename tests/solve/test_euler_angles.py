"""Euler angles as states: small inside, continuous outside, the same attitude as the quaternion."""

from __future__ import annotations

import numpy as np
import pytest
from support import angle_between, cases, law, run_text

from rigidsim.scene.fields import EULER_SEQUENCES

FREE = """
name = "free"
[body]
principal_moments = [1, 1, 1.5]
[initial]
angular_velocity = [0.1, 0.15, 2]
quaternion = [0.7, 0.4, 0.5, 0.3]
[time]
end = 60
samples = 1201
"""


@pytest.mark.parametrize("sequence", cases(EULER_SEQUENCES, ("zxz", "xyx", "zyx", "yzx")))
def test_each_sequence_gives_the_attitude_of_the_quaternion(sequence: str) -> None:
    record = 'output.record=["angular_velocity", "quaternion", "euler_angles"]'
    common = [record, f'integrator.euler_sequence="{sequence}"']
    plain = run_text(FREE, 'name="q"', *common)
    angles = run_text(FREE, 'name="e"', 'integrator.formulation="euler_angles"', *common)
    error = angle_between(plain.dataset["quaternion"].values, angles.dataset["quaternion"].values)
    # both formulations within three times the law, the angles' own with the amplification of their chart:
    # an error of the outer angles grows like 1/|singular factor|, whose smallest value the sample shows
    middle = angles.dataset["euler_angles"].values[:, 1]
    factor = np.abs(np.sin(middle) if sequence[0] == sequence[2] else np.cos(middle)).min()
    steps = angles.summary["cost"]["steps"]
    assert error.max() <= 3 * law(2.0**-52, steps, 2.01, 60) * (1 + 1 / factor)
    # angles found from the quaternion agree with those integrated, full turns included
    difference = plain.dataset["euler_angles"].values - angles.dataset["euler_angles"].values
    difference -= difference[0]  # the charts may start on different branches
    assert np.abs(difference).max() <= 6 * law(2.0**-52, steps, 2.01, 60) * (1 + 1 / factor**2)


def test_angles_grow_through_full_turns_without_a_jump() -> None:
    run = run_text(FREE, 'integrator.formulation="euler_angles"', "time.end=600", "time.samples=12001")
    angles = run.dataset["euler_angles"].values
    assert np.abs(angles[-1]).max() > 100  # many turns
    # the largest rate of an angle is |w| / |sin theta|; samples are 0.05 s apart
    smallest = np.abs(np.sin(angles[:, 1])).min()
    assert np.abs(np.diff(angles, axis=0)).max() < 2.01 / smallest * 0.05 * 2
    q = run.dataset["quaternion"].values
    assert (np.einsum("ij,ij->i", q[1:], q[:-1]) > 0.9).all()


@pytest.mark.parametrize("distance", ["1e-4", "1e-12", "0"])
def test_starting_close_to_the_singularity_costs_no_digits(distance: str) -> None:
    """Theta of a wobbling top nearly reaches zero: another chart carries it, without a warning."""
    text = FREE.replace("quaternion = [0.7, 0.4, 0.5, 0.3]", f"euler_angles = [0.0, {distance}, 0.0]")
    plain = run_text(text, 'name="q"')
    run = run_text(text, 'integrator.formulation="euler_angles"')
    assert not run.summary["warnings"]
    error = angle_between(plain.dataset["quaternion"].values, run.dataset["quaternion"].values)
    # both formulations within three times the law
    assert error.max() <= 6 * law(2.0**-52, run.summary["cost"]["steps"], 2.01, 60)
