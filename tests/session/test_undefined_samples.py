"""Samples that aren't defined are counted; those lost on the way are warned of, those of the start aren't."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from support import IMPATIENT, config, run_text

import rigidsim
from rigidsim import RunFolderError

# spins about its middle axis and turns over: its spin leaves the cone about that axis and comes back
FLIPPING = """
name = "flipping"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.1, 1.0, 0.05]
[frame]
figure_axis = "y"
[time]
end = 60
samples = 241
[output]
record = ["polar_motion", "angular_velocity"]
timeline = false
estimate = false
"""
# falls over from upright: it has no node as long as it hasn't left the vertical
UPRIGHT = """
name = "upright"
[body]
principal_moments = [2, 2, 1]
mass = 1
center_of_mass = [0, 0, 1]
[initial]
angular_velocity = [{push}, 0, 1]
[[loads]]
kind = "uniform_gravity"
acceleration = [0, 0, -1]
[time]
end = 3
samples = 13
[output]
record = ["precession_angle", "tilt"]
timeline = false
estimate = false
"""


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
    assert flipping.summary["undefined_samples"] == {"polar_motion": int(outside.sum())}
    assert flipping.summary["warning_codes"] == ["undefined"]
    (told,) = flipping.summary["warnings"]
    first = flipping.dataset.time.values[outside][0]
    assert f"at {outside.sum()} of 241 samples, first at {first:g} s" in told
    assert "more than 45 degrees from the figure axis" in told


def test_the_count_is_that_of_all_sessions(flipping: rigidsim.Run, tmp_path: Path) -> None:
    steps = flipping.summary["cost"]["steps"]
    text = f"{FLIPPING}[limits]\nmax_steps = {2 * steps // 3}\n"
    cut = rigidsim.run(rigidsim.parse(text), out=tmp_path, tuning=IMPATIENT)
    assert cut.status == "stopped: max_steps"
    assert cut.summary["undefined_samples"]["polar_motion"] > 0
    done = rigidsim.resume(cut.folder.path)
    assert done.status == "finished"
    for key in ("undefined_samples", "warnings", "warning_codes"):
        assert done.summary[key] == flipping.summary[key]


@pytest.mark.parametrize(("push", "since"), [(0.0, 13), (1e-9, 1)])
def test_what_the_start_leaves_undefined_is_told_but_no_alarm(push: float, since: int) -> None:
    run = rigidsim.run(rigidsim.parse(UPRIGHT.format(push=push)), out=None)
    assert undefined(run, "precession_angle").tolist() == [True] * since + [False] * (13 - since)
    assert run.summary["undefined_samples"] == {"precession_angle": since}
    assert run.summary["warnings"] == []


def test_members_of_a_batch_are_warned_of_as_single_runs_are(tmp_path: Path) -> None:
    axes = 'axes."initial.angular_velocity[0]" = {values = [0.1, 0.0]}'  # the other stays where it is
    text = FLIPPING.replace("0.05]", "0.0]") + f'[sweep]\nkeep = ["final"]\n{axes}\n'
    codes = {}
    for batch in (True, False):
        experiment = rigidsim.parse(f"{text}batch = {str(batch).lower()}\n")
        sweep = rigidsim.sweep(experiment, out=tmp_path / str(batch))
        assert any("batch" in engine for engine in sweep.summary["engines"]) == batch
        warnings = sweep.dataset.warnings
        meanings = warnings.attrs["flag_meanings"].split()
        bit = 1 << meanings.index("undefined")
        codes[batch] = [bool(bits & bit) for bits in warnings.values.tolist()]
    assert codes == {True: [True, False], False: [True, False]}


# ---- a run that doesn't fit on its disk is refused before it begins, and ``plan`` warns of it

VAST = "end = 999999999999\nevery = 1"  # hundreds of terabytes


def test_a_run_that_does_not_fit_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match=r"scene: the run takes about .* TB of space .*; take fewer"):
        rigidsim.run(rigidsim.parse(config(time=VAST)), out=tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "ending", ["[limits]\nmax_steps = 5", '[[events]]\nname = "soon"\nexpression = "t - 2"\naction = "stop"']
)
def test_one_that_may_end_before_is_not(ending: str, tmp_path: Path) -> None:
    run = run_text(config(time=VAST, more=ending), tmp_path)
    assert run.status in ("stopped: max_steps", "finished: event")
    assert 0 < run.summary["samples"] < 100


def test_plan_warns_of_it(tmp_path: Path) -> None:
    said = {}
    for time in (VAST, "end = 3\nsamples = 49"):
        plan = rigidsim.plan(rigidsim.parse(config(time=time)), out=tmp_path, pilot_seconds=0.01)
        said[time] = plan.warnings
        assert plan.predicted.free_bytes == pytest.approx(shutil.disk_usage(tmp_path).free, rel=0.1)
    assert said["end = 3\nsamples = 49"] == []
    assert len(said[VAST]) == 1
    assert "take fewer [time] samples" in said[VAST][0]


def test_what_is_predicted_is_what_it_takes(tmp_path: Path) -> None:
    """Segments beside labels of some kilobytes a file; a dataset is compressed by what repeats."""
    text = config(
        time="end = 20000\nsamples = 20001", output="estimate = false", more="[limits]\nmax_steps = 1000000"
    )
    predicted = rigidsim.plan(rigidsim.parse(text)).predicted
    whole = run_text(text, out=tmp_path)
    size = whole.folder.dataset.stat().st_size
    assert size < 1.05 * predicted.dataset_bytes
