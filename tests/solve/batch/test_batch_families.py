"""Families: whoever shares a system has exactly the numbers of its own build; others are told apart."""

import re
from collections.abc import Sequence

import heyoka as hy
import pytest
from support import cases, config

from rigidsim import ConfigError, parse
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.solve.batch.family import Alone, Families, Family, Members, batchable
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


def assert_own_numbers(sweep: Sweep, most: int = 64, known: Sequence[Family] = ()) -> Families:
    """Each member's equations and start, bit for bit those of its own build, though families are known."""
    families = Families(Members(sweep))
    families.known = list(known)
    found = families.sort()
    assert not found.alone
    assert not found.refused
    together = sum(len(numbers.members) for _, numbers in found.groups)
    assert together == sweep.count
    for family, numbers in found.groups:
        traced = family.traced
        for place, member in list(enumerate(numbers.members.tolist()))[:most]:
            own = prepare(sweep.experiment_of(member))
            start = [own.precision.number(x) for x in own.system.initial]
            assert start == numbers.initial[:, place].tolist()
            table = dict(
                zip(
                    traced.parameters.variables,
                    [hy.expression(float(x)) for x in numbers.parameters[:, place]],
                    strict=True,
                )
            )
            pairs = [
                (traced.system.equations, own.system.equations),
                ([(0, x) for x in traced.system.outputs], [(0, x) for x in own.system.outputs]),
            ]
            for shared, alone in pairs:
                right = [hy.expression(x) for _, x in shared]
                right = hy.subs(right, table) if table else right
                assert [_plain(x) for x in right] == [_plain(x) for _, x in alone]
            scaling = own.system.scaling
            for ours, theirs in zip(
                (traced.system.scaling.time, *traced.system.scaling.rates),
                (scaling.time, *scaling.rates),
                strict=True,
            ):
                assert numbers.whole_numbers(ours)[place] == theirs
    return families


def _plain(expression: hy.expression) -> str:
    """Its text, without the factors of one that parameters may have."""
    return re.sub(r"\(1\.0{16} \* (\w+)\)", r"\1", repr(hy.expression(expression)))


SPANS = [
    (FREE, {"initial.angular_velocity[0]": (-2, 2), "body.principal_moments[1]": (1.6, 2.4)}),
    (FREE, {"initial.angular_velocity[1]": (0.2, 0.9), "body.mass": (1, 9)}),
    (ORBIT, {"loads[0].orbit.eccentricity": (0.01, 0.6), "loads[0].orbit.mean_anomaly": (0, 3)}),
    (ORBIT, {"loads[0].gravitational_parameter": (0.5, 2), "initial.euler_angles[1]": (0.1, 3)}),
    (PLANAR, {"initial.angular_velocity[2]": (0.5, 2), "initial.euler_angles[0]": (-3, 3)}),
    (TOP, {"body.center_of_mass[2]": (0.1, 0.5), "body.principal_moments[2]": (0.3, 0.8)}),
]


@pytest.mark.parametrize("number", cases(range(len(SPANS)), [0, 3, 4]))
def test_members_have_the_numbers_of_their_own_builds(number: int) -> None:
    text, axes = SPANS[number]
    sweep = swept(text, {key: f"uniform = {list(span)}, count = 6" for key, span in axes.items()})
    families = assert_own_numbers(sweep)
    assert len(families.known) <= 6
    assert any(family.traced.parameters.nodes for family in families.known)


def test_members_met_later_have_the_numbers_of_their_own_builds() -> None:
    axes = {"initial.angular_velocity[0]": "values = [0.25, 0.5, 0.7]", "body.mass": "values = [1, 2, 3]"}
    sweep = swept(FREE, axes, mode="product")
    before = Families(Members(sweep, [4, 1]))
    before.sort()
    assert_own_numbers(sweep, known=before.known)


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
