"""Members side by side: the motions of single runs, whoever is beside them and wherever they stand."""

import numpy as np
import pytest
from support import EPSILON, cases, config

import rigidsim
from rigidsim import parse
from rigidsim.scene.sweep import Sweep
from rigidsim.solve.batch.family import BatchBlock, BatchRun, Families, Members
from rigidsim.solve.status import Status

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


FLIGHT = config(
    "principal_moments = [1, 2, 2.5]\nmass = 3",
    "angular_velocity = [0.1, 1.0, 0.05]\nposition = [0, 0, 1]\nvelocity = [1, 0, 4]",
    'kind = "uniform_gravity"\nacceleration = [0, 0, -9.80665]',
    "end = 1\nsamples = 5",
    output='record = ["angular_velocity", "position"]',
)


def blocks_of(
    sweep: Sweep, members: list[int] | None = None, width: int | None = None, **options: float
) -> list[BatchBlock]:
    """All members, run with options of ``BatchRun``."""
    found = Families(Members(sweep, members)).sort()
    assert not found.alone
    return [b for family in found.groups for b in BatchRun(family, width, **options).blocks()]


def by_member(blocks: list[BatchBlock]) -> dict[int, tuple[dict[str, np.ndarray], int, Status | None]]:
    """Values and drifts, steps and status of each member."""
    return {
        member: (
            {name: table[:, m] for name, table in (block.values | block.drifts).items()},
            int(block.steps[m]),
            block.status[m],
        )
        for block in blocks
        for m, member in enumerate(block.members.tolist())
    }


SPANS = {
    "free": (FREE, {"initial.angular_velocity[0]": (-2, 2), "body.principal_moments[1]": (1.6, 2.4)}),
    "orbit": (ORBIT, {"loads[0].orbit.eccentricity": (0.01, 0.4), "initial.euler_angles[1]": (0.2, 1)}),
    "planar": (PLANAR, {"initial.angular_velocity[2]": (1.1, 2), "initial.euler_angles[0]": (-1, 1)}),
    "top": (TOP, {"body.center_of_mass[2]": (0.1, 0.5), "initial.angular_velocity[2]": (3, 6)}),
    "torque": (TORQUE, {"parameters.k": (0.05, 0.2), "initial.angular_velocity[1]": (0.1, 0.5)}),
    "flight": (FLIGHT, {"initial.velocity[2]": (1, 5), "initial.angular_velocity[0]": (0.1, 1)}),
}


@pytest.mark.parametrize("kind", cases(SPANS, ["free"]))
def test_batches_agree_with_single_runs(kind: str) -> None:
    text, axes = SPANS[kind]
    sweep = swept(text, {key: f"uniform = {list(span)}, count = 2" for key, span in axes.items()})
    found = by_member(blocks_of(sweep))
    assert sorted(found) == [0, 1]
    for member, (values, steps, status) in found.items():
        single = rigidsim.run(sweep.experiment_of(member), changes={"output.estimate": False}, out=None)
        dataset = single.dataset
        assert status is Status.FINISHED
        taken = single.summary["cost"]["steps"]
        assert abs(steps - taken) <= 2 + 0.05 * taken
        for name, table in values.items():
            theirs = dataset[name].values.reshape(table.shape)
            size = 1.0 if name.endswith("_drift") else np.abs(theirs).max()
            # roundings of steps add up like a random walk, and phases integrate them: twice, of two runs
            bound = 50 * EPSILON["double"] * np.sqrt(steps) * max(20.0, steps) * max(size, 1e-3)
            assert np.abs(table - theirs).max() <= bound, name
        assert set(values) == {n for n in dataset.data_vars if "time" in dataset[n].dims}


def test_bits_depend_neither_on_neighbours_nor_on_place() -> None:
    axes = {"initial.angular_velocity[0]": "uniform = [0.1, 3], count = 11"}
    for samples in (2, 4):
        text = FREE.replace("samples = 5", f"samples = {samples}").replace("end = 10", "end = 100")
        sweep = swept(text, axes)
        together = by_member(blocks_of(sweep))
        order = [3, 10, 0, 7, 5]
        again = by_member(blocks_of(sweep, order))
        for place, member in enumerate(order):
            for name, table in again[place][0].items():
                assert table.tobytes() == together[member][0][name].tobytes(), name
            assert again[place][1] == together[member][1]
    narrow = by_member(blocks_of(sweep, order, width=2))  # with another width they may
    assert np.abs(narrow[0][0]["quaternion"] - again[0][0]["quaternion"]).max() < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("samples", cases([2, 5], [2]))
def test_a_lost_member_takes_no_other_with_it(samples: int) -> None:
    text = TORQUE.replace("k*sin(t)^2/2", "k*wx^2").replace("-k*wz", "0").replace("wx - k/3", "wx - 3/4")
    axes = {
        "parameters.k": "values = [0.01, 30, 0.02, 0.03]",
        "initial.angular_velocity[0]": "values = [0.5, 0.5, 0.7, 0.8]",
    }
    sweep = swept(text.replace("samples = 5", f"samples = {samples}"), axes)
    found = by_member(blocks_of(sweep))
    alone = by_member(blocks_of(sweep, [0, 2, 3]))
    assert found[1][2] is Status.NON_FINITE
    assert np.isfinite(found[1][0]["angular_velocity"][0]).all()
    assert np.isnan(found[1][0]["angular_velocity"][-1]).all()
    for place, member in enumerate([0, 2, 3]):
        assert found[member][2] is Status.FINISHED
        for name, table in alone[place][0].items():
            assert table.tobytes() == found[member][0][name].tobytes(), name


@pytest.mark.slow
@pytest.mark.unoptimised
def test_events_and_guards_end_members() -> None:
    axes = {"initial.angular_velocity[0]": "values = [0.5, 0.6]"}
    stop = TORQUE + 'action = "stop"\ndirection = "down"\n'
    for block in blocks_of(swept(stop, axes)):
        for m, status in enumerate(block.status):
            mine = block.events[0].member == m
            assert status is Status.EVENT
            assert mine.sum() == 1
            reached = block.reached[m]
            assert block.times[reached - 1] <= block.events[0].time[mine][0] < block.times[reached]
            assert np.isnan(block.values["quaternion"][reached:, m]).all()
            assert np.isfinite(block.values["quaternion"][:reached, m]).all()
    for line, status in (("max_steps = 3", Status.MAX_STEPS), ("max_drift = 1e-20", Status.MAX_DRIFT)):
        text = FREE + f"[limits]\n{line}\n"
        for block in blocks_of(swept(text, axes)):
            assert set(block.status) == {status}
            assert (block.reached < 5).all()
            assert (block.steps <= 3).all() or status is Status.MAX_DRIFT


@pytest.mark.parametrize("key", ["gravitational_parameter", "orbit.eccentricity", "figure.J2"])
def test_members_whose_loads_are_swept_go_together(key: str) -> None:
    """Though loads are tried at states of numbers, to see what they conserve."""
    load = 'kind = "gravity_gradient"\ngravitational_parameter = 1\n'
    load += "orbit = {semi_major_axis = 1, eccentricity = 0.1}"
    if "figure" in key:
        load += "\nfigure = {J2 = 0.1, radius = 0.1, pole = [0, 0, 1]}"
    rates = "angular_velocity = [0.1, 0.2, 1]"
    text = config(
        "principal_moments = [1, 2, 2.5]",
        rates,
        load,
        "end = 5\nsamples = 3",
        output='record = ["quaternion"]',
    )
    found = Families(Members(swept(text, {f"loads[0].{key}": "values = [0.1, 0.14, 0.17]"}))).sort()
    assert len(found.groups) == 1
    assert not found.alone
