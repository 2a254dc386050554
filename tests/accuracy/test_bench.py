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
from rigidsim.accuracy.bench.dataset import dataset_of, on_front
from rigidsim.accuracy.bench.measure import Measurement, RowStatus, measure
from rigidsim.accuracy.bench.plan import DEFAULT, Plan, every_setting, grid, make_plan
from rigidsim.accuracy.bench.worker import Task, ask
from rigidsim.accuracy.comparison import angles_between
from rigidsim.accuracy.setting import Setting
from rigidsim.accuracy.trial import try_setting
from rigidsim.errors import RigidsimError
from rigidsim.solve.closed_form import closed_form_of
from rigidsim.solve.problem import prepare
from rigidsim.workflows.tradeoff import save

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


def error_of(dataset: xarray.Dataset, setting: Setting) -> float:
    return float(dataset["attitude_error_largest"].sel(setting=setting.title))


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
def test_precision_and_tolerance_order_the_errors(dataset: xarray.Dataset) -> None:
    # 3 (eps/2) sqrt(steps) |w| t / sqrt 3: the round-off law, over some 270 steps and 115 rad
    law = 3 * EPSILON / 2 * 270**0.5 * 115 / 3**0.5
    assert error_of(dataset, DEFAULT) < law
    assert law < error_of(dataset, LOOSE) < error_of(dataset, SINGLE) * 10
    # 29 bits between the precisions; each error is a random walk of its own, known to some 5 bits
    assert error_of(dataset, SINGLE) > error_of(dataset, DEFAULT) * 2**24
    assert error_of(dataset, CLOSED) < 100 * EPSILON  # no growth: some rounding of O(1) numbers


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


@pytest.mark.slow
def test_held_invariants_drift_less_over_a_long_run() -> None:
    plan = fixed_plan(3e4, closed=True)
    long = dataset_of(measure(free(3e4), plan=plan, repeats=1, settings=[HELD], budget=LONG))
    drift = long["drift"].sel(invariant="energy")
    assert drift.sel(setting=HELD.title) < drift.sel(setting=DEFAULT.title) / 4
    assert error_of(long, HELD) < error_of(long, DEFAULT) / 30


@pytest.mark.slow
def test_the_dataset_opens_as_it_was(dataset: xarray.Dataset, tmp_path: Path) -> None:
    save(dataset, tmp_path)
    with xarray.open_dataset(tmp_path / "tradeoff.h5") as again:
        xarray.testing.assert_equal(again.load(), dataset)
        assert set(again.coords) >= {"precision", "tolerance", "formulation", "held", "method"}
        assert all(again[name].dims[0] == "setting" for name in again.data_vars)
        for name in again.variables:
            assert again[name].attrs["long_name"], name
        for name in again.data_vars:
            assert "units" in again[name].attrs, name
        assert again.attrs["reference"] == "closed form to 50 digits"
        assert rigidsim.parse(again.attrs["config"]).config.name == "free"


@pytest.mark.slow
def test_the_figure_shows_every_point(dataset: xarray.Dataset, tmp_path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.image import imread

    from rigidsim.look.work_precision import draw_points

    save(dataset, tmp_path)
    pixels = imread(tmp_path / "tradeoff.png")[:, :, :3]
    assert pixels.shape[0] > 700
    assert pixels.shape[1] > 1200
    figure = Figure()
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    draw_points(axes, dataset)
    drawn = {(float(x), float(y)) for line in axes.lines for x, y in zip(*line.get_data(), strict=True)}
    cost = dataset["cpu_ratio"].values
    error = np.maximum(dataset["attitude_error_largest"].values, dataset["reference_error"].values)
    assert {(float(c), float(e)) for c, e in zip(cost, error, strict=True)} <= drawn
    assert axes.get_xscale() == axes.get_yscale() == "log"


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
def test_the_front_is_what_nothing_beats(points: list[tuple[float, float, str]]) -> None:
    error, cost, status = (list(column) for column in zip(*points, strict=True))
    front = on_front(made_up(error, cost, status))
    for n, (e, c, s) in enumerate(points):
        rivals = [(f, d) for f, d, other in points if other == RowStatus.MEASURED]
        beaten = any(f <= e and d <= c and (f, d) != (e, c) for f, d in rivals)
        if s != RowStatus.MEASURED or beaten:
            assert not front[n]
        elif rivals.count((e, c)) == 1:
            assert front[n]


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


def test_every_kind_of_setting_is_there_once() -> None:
    settings = every_setting(CLOSED.method, full=True)
    assert len(settings) == len(set(settings))
    kinds = {(s.precision, s.formulation, s.hold_invariants) for s in settings if s.tolerance is None}
    for precision in ("single", "double", "extended"):
        for formulation in ("quaternion", "rotation_matrix", "euler_angles", "canonical"):
            assert {(precision, formulation, False), (precision, formulation, True)} <= kinds
    assert set(every_setting()) <= set(settings)
    assert all(s.has_steps for s in every_setting())


@given(st.floats(0, 1e6), st.floats(1e-3, 1e9), st.floats(1e-6, 1), st.integers(1, 40))
def test_sample_times_are_exact_in_single_and_within_the_part(
    start: float, span: float, part: float, count: int
) -> None:
    times = grid(start, start + span, part, count)
    assert list(times) == sorted(set(times))
    assert times[-1] <= start + span * part * (1 + 1e-12)
    assert times[0] > start
    if len(times) > 1:
        assert all(float(np.float32(t)) == t for t in times)


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
