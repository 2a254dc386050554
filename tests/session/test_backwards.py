"""Runs that go backwards in time, where ``[time] end`` is before ``start``."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import CONFIGS, angle_between, cases, config, loaded, run_text, same_bits, wide
from test_contracts import CASES, EPSILON, SCENES, settings

import rigidsim
from rigidsim.accuracy.reversal import there_and_back
from rigidsim.solve.problem import prepare
from rigidsim.store import pictures

BACK = "end = -3\nsamples = 49"
DRIVEN = (
    'kind = "torque"\ncomponents = ["0.1*sin(2*t)", "0.05*t - 0.1*wy", "-0.2*step(t + 1.3)"]',
    'kind = "viscous_torque"\ncoefficients = [0.05, 0.02, 0.1]',
)


@pytest.mark.parametrize(
    "formulation",
    cases(["quaternion", "rotation_matrix", "euler_angles", "closed_form"], ["closed_form"]),
)
def test_the_same_motion_is_found_from_its_other_end(formulation: str) -> None:
    """Forwards from the state at -3 s in 80 bits, and backwards from the state at 0 in double precision."""
    how = f'integrator.formulation="{formulation}"'
    loads: Any = DRIVEN
    if formulation == "closed_form":
        how, loads = 'integrator.method="closed_form"', ()
    back = loaded(run_text(config(loads=loads, time=BACK), how, estimate=True))
    assert back.time.values[[0, -1]].tolist() == [0.0, -3.0]
    last = back.isel(time=-1)
    start = (
        f"quaternion = {last.quaternion.values.tolist()}\n"
        f"angular_velocity = {last.angular_velocity.values.tolist()}"
    )
    time = "start = -3\nend = 0\nsamples = 49"
    there = loaded(run_text(config(initial=start, loads=loads, time=time), 'integrator.precision="extended"'))
    apart = angle_between(wide(there, "quaternion")[::-1], wide(back, "quaternion"))
    assert apart.max() < 2e-14
    np.testing.assert_allclose(there.angular_velocity[::-1], back.angular_velocity, rtol=0, atol=2e-14)


@pytest.mark.parametrize(
    "name",
    cases([path.stem for path in CONFIGS], ["satellite_libration", "earth_precession_averaged"], daily=2),
)
def test_ready_scenes_come_back_to_their_start(name: str) -> None:
    """From the end of a hundred units of their own time, within what both ways announce."""
    experiment = rigidsim.load(name)
    if experiment.config.model.level == "auto":
        experiment = experiment.replace({"model.level": "full", "integrator.accuracy_axis": None})
    prepared = prepare(experiment)
    start, unit = float(prepared.scene.start), abs(prepared.clock.unit)
    changes: dict[str, Any] = {"time.end": start + min(float(prepared.scene.duration), 100 * unit)}
    changes["time.samples"] = 2
    changes |= {f"time.{key}": None for key in ("every", "times") if getattr(experiment.config.time, key)}
    found = there_and_back(experiment.replace(changes))
    assert not found.beyond


@pytest.mark.parametrize("case", cases(CASES, [("top", "double", "euler_angles")], daily=2), ids="-".join)
def test_a_run_that_was_stopped_has_the_same_bits(case: tuple[str, str, str], tmp_path: Path) -> None:
    text = SCENES[case[0]].replace("end = 12", "end = -4")
    given = settings(*case[1:])
    whole = run_text(text, *given)
    if whole.status != "finished":  # what is damped forwards grows backwards
        pytest.skip(whole.status)
    guard = f"limits.max_steps={whole.summary['cost']['steps'] // 2}"
    run_text(text, *given, guard, out=tmp_path)
    done = rigidsim.resume(tmp_path / "scene", overrides=["limits.max_steps=100000"])
    assert done.summary["cost"]["sessions"] == 2
    same_bits(done, whole)


def test_events_dates_and_lines_are_those_of_the_motion_forwards(tmp_path: Path) -> None:
    """Of a free symmetric body with wx = cos(t)/2, by ((C - A)/A) wz = 1 rad/s."""
    event = '[[events]]\nname = "up"\nexpression = "wx"\ndirection = "up"\n'
    time = 'end = -40\nsamples = 401\nepoch = "J2000"\n'
    text = config("principal_moments = [2, 2, 3]", "angular_velocity = [0.5, 0, 2]", time=time, more=event)
    back = run_text(text, out=tmp_path, estimate=True)
    data = loaded(back)
    np.testing.assert_allclose(data.up_time, -(np.pi / 2 + 2 * np.pi * np.arange(len(data.up))), rtol=1e-14)
    assert len(data.up) == 7
    days = data.julian_date + data.julian_date_lo - 2451545
    np.testing.assert_allclose(days, -np.arange(401) * 0.1 / 86400, rtol=0, atol=1e-9)
    (signal,) = rigidsim.analyse(back, ["angular_velocity.x+iy"]).signals
    assert abs(float(signal.lines[0].frequency)) == pytest.approx(1.0, rel=1e-12)
    verdict = rigidsim.verify(tmp_path / "scene", reversed=True)
    assert verdict.identical
    assert verdict.reversal.attitude <= verdict.reversal.announced
    assert "returns to its start" in verdict.as_dict()["reversal"]["words"]


@pytest.mark.slow
@pytest.mark.unoptimised
def test_members_go_either_way(tmp_path: Path) -> None:
    swept = config(loads=DRIVEN[1]) + '[sweep]\nkeep = ["final"]\naxes."time.end" = {values = [-2, 1]}\n'
    members = rigidsim.sweep(rigidsim.parse(swept), out=tmp_path).dataset
    for n, end in enumerate((-2, 1)):
        alone = loaded(run_text(config(loads=DRIVEN[1]), f"time.end={end}")).isel(time=-1)
        found = members.angular_velocity_final.values[n]
        np.testing.assert_allclose(found, alone.angular_velocity.values, rtol=0, atol=1e-13)
        assert members.time_reached.values[n] == end


@pytest.mark.parametrize(
    ("time", "words"),
    [
        ("end = 0\nsamples = 3", "given 0.0 s, which is start"),
        ("end = -1\nevery = -0.1", "a positive time is allowed"),
        ("times = [0, -1, -0.5]", "times must decrease"),
        ("start = 1\nend = -1\ntimes = [2, 0]", "given 2.0 s after 1.0 s; times must decrease"),
        ("end = -1\nevery = 2", "makes 1.0 samples of the run"),
    ],
)
def test_times_that_contradict_each_other_are_refused(time: str, words: str) -> None:
    with pytest.raises(rigidsim.ConfigError) as caught:
        run_text(config(time=time))
    assert words in str(caught.value)


def test_lists_of_times_and_tables_go_backwards_too() -> None:
    times = [0, -0.25, -1, -2.5]
    listed = loaded(run_text(config(loads=DRIVEN, time=f"times = {times}")))
    grid = loaded(run_text(config(loads=DRIVEN, time="end = -2.5\nevery = 0.25")))
    assert listed.time.values.tolist() == times
    np.testing.assert_array_equal(listed.quaternion, grid.quaternion.isel(time=[0, 1, 4, 10]))
    assert np.abs(listed.quaternion.values).max() <= 1 + EPSILON["double"] * 10


def test_derivatives_by_a_rate_are_differences_of_runs() -> None:
    asked = 'output.sensitivity=["initial.angular_velocity[0]"]'
    made = loaded(run_text(config(loads=DRIVEN[1], time=BACK), asked))
    found = made.angular_velocity_sensitivity.isel(time=-1).values.ravel()
    ends = [
        loaded(run_text(config(loads=DRIVEN[1], time=BACK), f"initial.angular_velocity[0]={0.3 + h}"))
        for h in (-1e-5, 1e-5)
    ]
    before, after = (end.angular_velocity.isel(time=-1).values for end in ends)
    np.testing.assert_allclose(found, (after - before) / 2e-5, rtol=1e-8)


def test_pictures_mark_the_start_and_count_moments_in_the_order_of_time(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Of a slow spin: the pole starts at a known place; a quarter of the run back is 0.75 of its timeline."""
    drawn: list[float] = []
    monkeypatch.setattr(pictures, "draw_recording", lambda *_, at, **__: drawn.append(at))
    text = config("principal_moments = [1, 1, 1.5]", "angular_velocity = [0.01, 0, 1]", time="end = -40")
    run = run_text(text)
    pictures.draw(run.dataset, tmp_path / "made.png", at="-10")
    assert drawn == [0.75]
    assert not np.signbit(run.dataset.time.values[0])
    starts = {}
    for end in ("-40", "40"):
        axes = run_text(text.replace("end = -40", f"end = {end}")).plot("pole_path").axes[0]
        starts[end] = next(one.get_xydata() for one in axes.get_lines() if one.get_label() == "start")
    np.testing.assert_allclose(starts["-40"], starts["40"], rtol=0, atol=1e-6 * np.abs(starts["40"]).max())
