"""Families: members of another structure are told apart, and bad ones are refused as alone."""

import pytest
from support import config

from rigidsim import ConfigError, parse
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.solve.batch.family import Alone, Families, Members, batchable
from rigidsim.solve.problem import prepare

FREE = config(
    "principal_moments = [1, 2, 2.5]\nmass = 2",
    "angular_velocity = [0.1, 1.0, 0.05]",
    time="end = 10\nsamples = 5",
    output='record = ["angular_velocity", "quaternion", "energy"]',
)
ORBIT = config(
    "principal_moments = [1, 1.5, 1.8]",
    "angular_velocity = [0.01, 0.02, 1.1]\neuler_angles = [0.3, 0.1, 0]",
    'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {semi_major_axis = 1, '
    'eccentricity = 0.1, inclination = 0.2, mean_anomaly = 0.4, period = "2*pi"}',
    "end = 20\nsamples = 5",
    output='record = ["angular_velocity", "quaternion"]',
)
PLANAR = (
    ORBIT.replace("[0.01, 0.02, 1.1]", "[0, 0, 1.1]")
    .replace("[0.3, 0.1, 0]", "[0.3, 0, 0]")
    .replace("inclination = 0.2", "inclination = 0")
)
TOP = config(
    "principal_moments = [1, 1, 0.5]\nmass = 1\ncenter_of_mass = [0, 0, 0.3]",
    "angular_velocity = [0.1, 0.2, 5]\neuler_angles = [0, 0.5, 0]",
    'kind = "uniform_gravity"\nacceleration = [0, 0, -9.8]',
    "end = 2\nsamples = 5",
    output='record = ["angular_velocity"]',
)
TORQUE = config(
    "principal_moments = [1, 2, 2.5]",
    "angular_velocity = [0.1, 0.2, 1]",
    'kind = "torque"\ncomponents = ["k*sin(t)^2/2", "0", "-k*wz"]\nframe = "body"',
    "end = 10\nsamples = 5",
    output='record = ["angular_velocity", "quaternion"]',
    more='[parameters]\nk = 0.1\n[[events]]\nname = "flip"\nexpression = "wx - k/3"',
)


def swept(text: str, axes: dict[str, str], mode: str = "zip") -> Sweep:
    """A sweep of a config."""
    lines = [f'axes."{key}" = {{{spec}, name = "axis_{n}"}}' for n, (key, spec) in enumerate(axes.items())]
    return Sweep.of(parse(f'{text}\n[sweep]\nmode = "{mode}"\nseed = 7\n' + "\n".join(lines)))


def test_members_of_another_structure_are_another_family() -> None:
    axes = {
        "body.principal_moments": "values = [[1, 2, 2.5], [1, 2, 2.4], [1, 1, 2], [2, 2, 2], [1, 2, 2.6]]"
    }
    found = Families(Members(swept(FREE, axes))).sort()
    groups = sorted(numbers.members.tolist() for _, numbers in found.groups)
    assert groups == [[0, 1, 4], [2], [3]]
    axes = {"parameters.k": "values = [0.1, 0, 0.3]"}
    found = Families(Members(swept(TORQUE, axes))).sort()
    assert sorted(numbers.members.tolist() for _, numbers in found.groups) == [[0, 2], [1]]


def test_a_bad_member_is_refused_as_its_own_run_would_be() -> None:
    axes = {"body.principal_moments[2]": "values = [2.5, 2.6, 7, -1, 2.7]"}
    sweep = swept(FREE, axes)
    found = Families(Members(sweep)).sort()
    assert sorted(found.refused) == [2, 3]
    for member, error in found.refused.items():
        with pytest.raises(ConfigError) as own:
            prepare(sweep.experiment_of(member))
        assert str(own.value) == str(error)
    assert sorted(numbers.members.tolist() for _, numbers in found.groups) == [[0, 1, 4]]


@pytest.mark.parametrize(
    ("override", "reason"),
    [
        ('integrator.precision="quadruple"', Alone.PRECISION),
        ('integrator.method="closed_form"', Alone.CLOSED_FORM),
        ("integrator.hold_invariants=true", Alone.HELD),
        ("integrator.accuracy=1e-9", Alone.ACCURACY),
        ('integrator.formulation="euler_angles"', Alone.CHART),
        ("output.lyapunov=true", Alone.LYAPUNOV),
    ],
)
def test_what_a_batch_cannot_do_is_said(override: str, reason: Alone) -> None:
    key = "initial.angular_velocity[0]"
    assert batchable(parse(FREE), [key]) is None
    assert batchable(parse(FREE, overrides=[override]), [key]) is reason
    assert batchable(parse(FREE), ["time.end"]) is Alone.KEY
