"""Measured speed and accuracy: errors are the true ones, nothing is dropped or extrapolated in silence."""

from __future__ import annotations

import os
import stat
import sys
import time
from pathlib import Path

import mpmath
import numpy as np
import pytest
import xarray
from hypothesis import given
from hypothesis import strategies as st

import rigidsim
from rigidsim.accuracy.bench.advice import advice
from rigidsim.accuracy.bench.dataset import dataset_of
from rigidsim.accuracy.bench.measure import Measurement, RowStatus, measure
from rigidsim.accuracy.bench.plan import DEFAULT, Plan, grid, make_plan
from rigidsim.accuracy.bench.worker import Task, ask
from rigidsim.accuracy.comparison import angles_between
from rigidsim.accuracy.setting import Setting
from rigidsim.accuracy.trial import try_setting
from rigidsim.errors import RigidsimError
from rigidsim.solve.closed_form import closed_form_of
from rigidsim.solve.problem import prepare

FREE = """
name = "free"
[body]
principal_moments = [1, 2, 3]
[initial]
angular_velocity = [0.5, 0.25, 1]
euler_angles = [0.2, 1.1, 0.7]
[time]
end = {end}
samples = 11
"""
DAMPED = FREE + '[[loads]]\nkind = "viscous_torque"\ncoefficients = [0.01, 0.01, 0.01]\n'
EPSILON = 2.0**-52
LOOSE = Setting("double", 1e-6)
HELD = Setting("double", hold_invariants=True)
SINGLE = Setting("single")
LONG = 1000.0  # seconds: a budget that no machine uses up
CLOSED = Setting("double", method="closed_form")


def free(end: float = 100.0, text: str = FREE) -> rigidsim.Experiment:
    return rigidsim.parse(text.format(end=end))


def fixed_plan(end: float, *, closed: bool, count: int = 8) -> Plan:
    times = (0.0, *grid(0.0, end, 1.0, count))
    why = (CLOSED.method, "") if closed else ("", "for this test")
    return Plan(0.0, end, 0.0, 1.0, 1.0, times, count + 1, *why, 11)


@pytest.fixture(scope="module")
def measured() -> Measurement:
    plan = fixed_plan(100.0, closed=True)
    return measure(free(), plan=plan, repeats=2, settings=[LOOSE, HELD, SINGLE, CLOSED], budget=LONG)


@pytest.fixture(scope="module")
def dataset(measured: Measurement) -> xarray.Dataset:
    return dataset_of(measured)


@pytest.mark.slow
def test_errors_are_angles_from_the_exact_motion(measured: Measurement, dataset: xarray.Dataset) -> None:
    times = [mpmath.mpf(t) for t in measured.plan.times]
    form = closed_form_of(prepare(free()).scene)
    trial = try_setting(free(), LOOSE, times)
    for n, t in enumerate(times):
        exact = form.exactly(t, 30)[1]
        mine = [mpmath.mpf(float(x)) for x in trial.attitudes[0][n]]
        sign = mpmath.sign(sum(a * b for a, b in zip(exact, mine, strict=True)))
        chord = mpmath.sqrt(sum((a - sign * b) ** 2 for a, b in zip(exact, mine, strict=True)))
        angle = 4 * mpmath.asin(chord / 2)
        found = float(dataset["attitude_error"].sel(setting=LOOSE.title)[n])
        assert found == pytest.approx(float(angle), rel=1e-6, abs=EPSILON)
        assert found < 1e-4  # and it is the motion that begins at the start


@pytest.mark.slow
def test_the_default_costs_one_and_every_speed_has_a_spread(dataset: xarray.Dataset) -> None:
    assert float(dataset["cpu_ratio"].sel(setting=DEFAULT.title)) == 1.0
    assert (dataset["cpu_ratio_least"] <= dataset["cpu_ratio"]).all()
    assert (dataset["cpu_ratio"] <= dataset["cpu_ratio_largest"]).all()
    assert (dataset["cpu_seconds"] > 0).all()
    # a loose tolerance takes a lower order with about as many steps
    loose, tight = (dataset.sel(setting=s.title) for s in (LOOSE, DEFAULT))
    assert loose["taylor_order"] < tight["taylor_order"]
    assert loose["work"] < tight["work"]
    assert int(tight["work"]) == int(tight["steps"]) * int(tight["taylor_order"]) ** 2 * 7


def made_up(error: list[float], cost: list[float], status: list[str]) -> xarray.Dataset:
    n = len(error)
    values = {
        "attitude_error_largest": ("setting", np.array(error)),
        "reference_error": ("setting", np.full(n, 1e-45)),
        "cpu_ratio": ("setting", np.array(cost)),
        "status": ("setting", np.array(status, dtype=object)),
        "measured_time": ("setting", np.full(n, 10.0)),
    }
    coords = {
        "setting": [f"s{i}" for i in range(n)],
        "precision": ("setting", ["double"] * n),
        "tolerance": ("setting", np.full(n, EPSILON)),
        "formulation": ("setting", ["quaternion"] * n),
        "held": ("setting", np.zeros(n, dtype=np.int8)),
        "method": ("setting", ["taylor"] * n),
    }
    return xarray.Dataset(values, coords=coords)


POINTS = st.lists(
    st.tuples(
        st.floats(-30, 0).map(lambda x: 10**x),
        st.floats(-2, 4).map(lambda x: 10**x),
        st.sampled_from([RowStatus.MEASURED, RowStatus.MEASURED, RowStatus.SHORT]),
    ),
    min_size=1,
    max_size=12,
)


@given(POINTS)
def test_the_advice_is_the_cheapest_that_keeps_the_accuracy(points: list[tuple[float, float, str]]) -> None:
    error, cost, status = (list(column) for column in zip(*points, strict=True))
    for row in advice(made_up(error, cost, status)):
        for level in np.arange(np.log10(row.at_most), np.log10(row.more_than) + 0.5, -1.0):
            allowed = 10.0 ** round(level)
            full = [c for e, c, s in points if s == RowStatus.MEASURED and e <= allowed]
            short = [c for e, c, s in points if s == RowStatus.SHORT and e <= allowed]
            assert row.error <= allowed
            assert row.less == (not full)
            assert row.cost == min(full or short)


@pytest.mark.slow
def test_a_formulation_that_refuses_is_listed_with_its_reason() -> None:
    canonical = Setting(formulation="canonical")
    plan = fixed_plan(5.0, closed=False, count=3)
    settings = [canonical, Setting("extended"), Setting("extended", hold_invariants=True)]
    damped = free(5.0, DAMPED)
    found = measure(damped, plan=plan, repeats=1, settings=settings, budget=LONG, reference="extended")
    data = dataset_of(found)
    row = data.sel(setting=canonical.title)
    assert row["status"].item() == "refused"
    assert "canonical" in row["reason"].item()
    assert np.isnan(row["attitude_error_largest"])
    assert np.isnan(row["cpu_ratio"])


@pytest.mark.slow
def test_a_reference_without_closed_form_knows_its_own_error() -> None:
    plan = fixed_plan(8.0, closed=False, count=3)
    found = measure(free(8.0), plan=plan, repeats=1, settings=[HELD], budget=LONG)
    for reference in (found.reference, found.wide_reference):
        assert reference is not None
        times = [mpmath.mpf(t) for t in plan.times]
        exact = try_setting(free(8.0), Setting(60, method="closed_form"), times)
        assert (angles_between(reference.attitudes, exact.attitudes) <= reference.error).all()
    # and it is far better than what it judges
    assert found.reference.error[-1] < 1e-25
    assert found.wide_reference is not None
    assert found.wide_reference.error[-1] < 1e-38


def test_of_a_long_motion_the_beginning_is_measured_and_that_is_said() -> None:
    plan = make_plan(free(1e9), budget=20.0)
    assert plan.part < 1e-3
    assert plan.short < plan.part
    assert plan.times[-1] <= 1e9 * plan.part
    assert plan.times[plan.short_count - 1] <= 1e9 * plan.short
    whole = make_plan(free(10.0), budget=20.0)
    assert whole.part == whole.short == 1.0
    assert whole.times[-1] == 10.0


@pytest.mark.slow
def test_settings_past_the_budget_are_listed_as_left_out() -> None:
    plan = fixed_plan(3e4, closed=True, count=2)
    settings = [Setting("quadruple"), Setting("extended")]  # a minute in quadruple precision
    data = dataset_of(measure(free(3e4), plan=plan, repeats=1, settings=settings, budget=40.0))
    assert data.sizes["setting"] == 3
    status = dict(zip(data["setting"].values, data["status"].values, strict=True))
    assert status[DEFAULT.title] == RowStatus.MEASURED
    assert status[Setting("quadruple").title] != RowStatus.MEASURED
    assert status[Setting("extended").title] in (RowStatus.LEFT_OUT, RowStatus.MEASURED)
    reason = str(data["reason"].sel(setting=Setting("quadruple").title).item())
    assert "budget" in reason


def test_a_process_that_dies_costs_one_setting(tmp_path: Path) -> None:
    script = tmp_path / "python"
    script.write_text("#!/bin/sh\necho 'out of luck' >&2\nexit 3\n")
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    tasks = [Task(DEFAULT, "attitudes", (1.0,), 1.0)] * 3
    answers = list(ask(free(), tasks, deadline=time.monotonic() + 20, python=str(script)))
    assert [a.index for a in answers] == [0, 1, 2]
    assert all("code 3 (out of luck)" in str(a.problem) for a in answers)


@pytest.mark.slow
def test_when_time_is_up_the_process_is_stopped() -> None:
    slow = Task(Setting("quadruple"), "attitudes", (0.0, 1e7), 1e6)
    quick = Task(DEFAULT, "attitudes", (1.0,), 1.0)
    begun = time.monotonic()
    before = children()
    answers = list(ask(free(), [quick, slow], deadline=begun + 20))
    assert [a.index for a in answers] == [0]
    assert time.monotonic() - begun < 40
    assert children() <= before


def children() -> set[str]:
    """Processes that this one has started and that still run."""
    if not sys.platform.startswith("linux"):
        pytest.skip("reads /proc")
    found = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text()
    return set(found.split())


@pytest.mark.parametrize(
    ("given_", "words"), [({"budget": 1.0}, "--budget 1 s is too short"), ({"repeats": 0}, "--repeats 0")]
)
def test_impossible_requests_are_refused(given_: dict[str, float], words: str) -> None:
    with pytest.raises(RigidsimError, match=words):
        measure(free(), **given_)  # type: ignore[arg-type]
