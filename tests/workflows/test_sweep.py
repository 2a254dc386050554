"""Sweeps from config to dataset: labels, exactness against single runs, extension, shares, workers, kills."""

import json
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import h5py
import netCDF4
import numpy as np
import pytest
from typer.testing import CliRunner

import rigidsim
from rigidsim import ConfigError, RunFolderError, open_sweep, parse
from rigidsim import sweep as run_sweep
from rigidsim.cli.app import app
from rigidsim.errors import StoppedError
from rigidsim.store.folder import SweepFolder
from rigidsim.store.seal import seal
from rigidsim.store.sweeps.tiles import read_tile
from rigidsim.workflows.sweeps.sweep import resume_sweep

pytestmark = pytest.mark.optimised  # compared with runs of other processes

CONFIG = """\
name = "box"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.1, 1, 0.05]
[time]
end = 5
samples = 6
[integrator]
formulation = "rates"
[output]
estimate = false
record = ["angular_velocity", "energy"]
[[events]]
name = "middle"
expression = "wx"
"""
SWEEP = """\
[sweep]
keep = ["final"]
tile = 2
axes."initial.angular_velocity[2]" = {step = [0.1, 0.1, 3], name = "w3"}
axes."body.principal_moments[2]" = {values = [2.5, 2.75], name = "C"}
"""


def swept(out: Path, text: str = CONFIG + SWEEP, **options: object) -> rigidsim.SavedSweep:
    return run_sweep(parse(text), out=out, **options)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("sweeps")
    everything = SWEEP.replace(
        '["final"]', '["final", "extremes", "means", "events", "section", "series"]\nmost_events = 2'
    )
    assert swept(out, CONFIG + everything).finished
    return out / "box"


def test_members_are_single_runs_with_labels(folder: Path) -> None:
    sweep = open_sweep(folder)
    dataset = sweep.dataset
    assert dict(dataset.sizes) == {"w3": 3, "C": 2, "time": 6, "body_axis": 3, "middle_occurrence": 2}
    assert dataset.w3.values.tolist() == [0.1, 0.2, 0.3]
    assert dataset.w3.attrs["units"] == "rad/s"
    assert dataset.C.attrs["swept_key"] == "body.principal_moments[2]"
    assert (dataset.status == 0).all()
    changes = {"initial.angular_velocity[2]": 0.2, "body.principal_moments[2]": 2.75}
    alone = rigidsim.run(parse(CONFIG), changes=changes, out=None)
    cell, single = dataset.sel(w3=0.2, C=2.75), alone.dataset
    np.testing.assert_array_equal(cell.time.values, single.time.values)
    rates = single.angular_velocity.values
    if "alone" not in sweep.summary["engines"]:  # a batch rounds otherwise, each lane for itself
        np.testing.assert_allclose(cell.angular_velocity.values, rates, atol=1e-13)
        rates = cell.angular_velocity.values
        single = single.assign(
            energy_drift=cell.energy_drift, middle_time=cell.middle_times.dropna("middle_occurrence")
        )
    np.testing.assert_array_equal(cell.angular_velocity.values, rates)
    np.testing.assert_array_equal(cell.angular_velocity_final.values, rates[-1])
    np.testing.assert_array_equal(cell.angular_velocity_min.values, rates.min(axis=0))
    np.testing.assert_array_equal(cell.angular_velocity_max.values, rates.max(axis=0))
    at = single.time.values[rates.argmax(axis=0)]
    np.testing.assert_array_equal(cell.angular_velocity_max_time.values, at)
    np.testing.assert_allclose(cell.angular_velocity_mean.values, rates.mean(axis=0), rtol=1e-15)
    assert cell.energy_drift_largest == abs(single.energy_drift).max()
    assert cell.energy_drift_final == single.energy_drift[-1]
    assert cell.steps == alone.summary["cost"]["steps"]
    found = single.middle_time.values
    assert cell.middle_count == len(found) >= 1
    kept = min(2, len(found))
    np.testing.assert_array_equal(cell.middle_times.values[:kept], found[:kept])
    assert cell.middle_first == found[0]
    assert sweep.summary["outcomes"] == {"finished": 6}
    with netCDF4.Dataset(folder / "dataset.h5") as file:
        assert file["angular_velocity_final"].dimensions == ("w3", "C", "body_axis")
        assert "[sweep]" in file.config
    np.testing.assert_allclose(
        cell.middle_angular_velocity.values[:kept], single.middle_angular_velocity.values[:kept], atol=1e-13
    )


def test_a_longer_axis_and_one_more_output_compute_only_what_is_new(tmp_path: Path) -> None:
    first = swept(tmp_path)
    tiles = SweepFolder(tmp_path / "box").tiles
    before = {path.name: path.read_bytes() for path in tiles.glob("*.h5")}
    final = first.dataset.angular_velocity_final.load()
    longer = SWEEP.replace("0.1, 3]", "0.1, 4]").replace('["final"]', '["final", "means"]')
    second = swept(tmp_path, CONFIG + longer)
    dataset = second.dataset
    assert {p.name: p.read_bytes() for p in tiles.iterdir() if p.name in before} == before
    new = [read_tile(path) for path in tiles.glob("*.h5") if path.name not in before]
    assert sorted((one.items, len(one.keys)) for one in new) == [
        (("always", "final", "means"), 2), *[(("means",), 2)] * 3
    ]  # fmt: skip
    assert dataset.sizes["w3"] == 4
    np.testing.assert_array_equal(dataset.angular_velocity_final.values[:3], final.values)
    assert np.isfinite(dataset.angular_velocity_mean).all()
    assert np.isfinite(dataset.angular_velocity_final).all()
    with pytest.raises(RunFolderError, match="another experiment"):
        swept(tmp_path, (CONFIG + SWEEP).replace("end = 5", "end = 6"))


def test_verify_runs_members_again_and_finds_a_flipped_bit(folder: Path, tmp_path: Path) -> None:
    def told(*options: str) -> tuple[int, dict[str, Any]]:
        found = CliRunner().invoke(app, ["verify", *options, "--json"])
        return found.exit_code, json.loads(found.stdout)

    code, verdict = told(str(folder))
    assert code == 0
    assert verdict["identical"]
    assert verdict["samples"] == 6
    forged = tmp_path / "forged"
    shutil.copytree(folder, forged)
    with h5py.File(forged / "dataset.h5", "r+") as file:
        values = file["angular_velocity_final"]
        values[2, 1, 0] = np.nextafter(values[2, 1, 0], 1)
    summary = json.loads((forged / "summary.json").read_text())
    assert CliRunner().invoke(app, ["verify", str(forged)]).exit_code != 0  # whose seal is broken
    summary["dataset_sha256"] = seal(forged / "dataset.h5")[1]
    (forged / "summary.json").write_text(json.dumps(summary))
    code, verdict = told(str(forged))
    assert code == 1
    assert verdict["differing_variables"] == ["angular_velocity_final"]
    first = verdict["first_difference"]
    assert first["sample"] == 5
    assert 0 < first["size"] < 1e-15
    wrong = CliRunner().invoke(app, ["verify", str(folder), "--members", "0"])
    assert wrong.exit_code == 2
    assert "one or more are allowed" in wrong.output


def test_a_failing_member_is_recorded_and_the_rest_go_on(tmp_path: Path) -> None:
    text = (
        CONFIG
        + """
[[loads]]
kind = "torque"
components = ["0", "0", "wz^3"]
[sweep]
mode = "zip"
axes."initial.angular_velocity[2]" = {values = [0.1, 3]}
"""
    )
    sweep = swept(tmp_path, text)
    dataset = sweep.dataset
    assert sweep.summary["outcomes"]["finished"] == 1
    assert dataset.sizes["member"] == 2
    assert dataset.angular_velocity_2.dims == ("member",)
    assert "angular_velocity_2" in dataset.coords
    assert dataset.failed_member.values.tolist() == [1]
    assert str(dataset.failed_reason.values[0])
    assert dataset.time_reached[1] < 5
    assert any("didn't end well" in text for text in sweep.summary["warnings"])


LARGEST = ", ".join("2.9" if i == 40 else f"2.0{i:02}" for i in range(75))
BAD = {
    # on no edge of the product; another value of either axis would make it possible
    "one bad member among many": (
        f'axes."body.principal_moments[2]".values = [{LARGEST}]\n'
        'axes."body.principal_moments[0]".values = [1, 0.5, 1]',
        r"member 121 .*2\.9.*0\.5.*principal moments",
    ),
    "unknown key": ('axes."initial.angular_velocty[2]" = {values = [1]}', 'did you mean "angular_velocity"'),
    "name of the dataset's": ('axes."time.end" = {values = [1], name = "steps"}', "needs itself"),
    "nothing to keep": ('keep = ["events"]\naxes."time.end" = {values = [1]}', "no \\[\\[events\\]\\]"),
}


def test_bad_sweeps_are_refused_before_work_begins(tmp_path: Path) -> None:
    for case, (table, told) in BAD.items():
        config = CONFIG.partition("[[events]]")[0] if case == "nothing to keep" else CONFIG
        with pytest.raises(ConfigError, match=told) as refused:
            swept(tmp_path, f"{config}[sweep]\n{table}\n")
        assert len(refused.value.problems) == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_what_a_batch_estimates_is_told_of_all_and_of_one(tmp_path: Path) -> None:
    output = CONFIG[CONFIG.index("estimate") : CONFIG.index("[[ev")]
    text = CONFIG.replace(output, "").replace('rates"', 'quaternion"')
    text += '[sweep]\naxes."initial.angular_velocity[0]" = {values = [0.1, 0.2]}\n'
    told = swept(tmp_path, text)
    errors = told.dataset.attitude_error.values
    assert told.summary["warning_codes"] == []
    assert told.summary["cost"]["estimate_cpu_seconds"] > 0
    summed = {"members": 2, "median": np.median(errors), "largest": errors.max(), "units": "rad"}
    assert told.summary["estimated_errors"] == {"attitude": summed}
    shown = CliRunner().invoke(app, ["info", str(tmp_path / "box")])
    assert f"attitude: {np.median(errors):.2g} rad in the median" in " ".join(shown.stdout.split())
    (tmp_path / "c.toml").write_text(text)
    out = ["--out", str(tmp_path), "--set", "output.timeline=false", "--json"]
    ran = CliRunner().invoke(app, ["run", str(tmp_path / "c.toml"), "--member", "1", *out])
    single = json.loads(ran.stdout)
    assert (tmp_path / "box_1").is_dir()
    assert 0.1 < errors[1] / single["accuracy"]["estimated_attitude_error"] < 10
    with pytest.raises(RunFolderError, match="another experiment"):
        swept(tmp_path, text.replace("[sweep]", "[sweep]\nbatch = false"))
    alone = swept(tmp_path, text.replace("[sweep]", "[sweep]\nbatch = false"), force=True)
    assert (alone.dataset.attitude_error > 0).all()
    assert alone.summary["why_alone"] == "asked"
    refused = CliRunner().invoke(app, ["run", str(tmp_path / "c.toml"), "--member", "2"])
    assert "its members are 0 to 1" in refused.output


def _killed_sweep(tmp_path: Path, *options: str) -> SweepFolder:
    """A sweep whose process group is killed when a tile is there."""
    (tmp_path / "c.toml").write_text(CONFIG + SWEEP.replace("tile = 2", "tile = 1"))
    folder = SweepFolder(tmp_path / "box")
    command = [sys.executable, "-m", "rigidsim", "sweep", str(tmp_path / "c.toml"), "--out", str(tmp_path)]
    process = subprocess.Popen([*command, *options], stderr=subprocess.DEVNULL, start_new_session=True)
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline and process.poll() is None:
        if len(list(folder.tiles.glob("*.h5"))) >= 1:
            break
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    return folder


def test_a_killed_sweep_is_resumed_to_the_same_bits(folder: Path, tmp_path: Path) -> None:
    killed = _killed_sweep(tmp_path)
    assert not killed.summary.exists()
    kept = {path.name: path.stat().st_mtime_ns for path in killed.tiles.glob("*.h5")}
    found = resume_sweep(killed.path)
    assert found.finished
    for name, modified in kept.items():  # nothing is computed twice
        assert (killed.tiles / name).stat().st_mtime_ns == modified
    expected = open_sweep(folder).dataset.angular_velocity_final
    np.testing.assert_array_equal(found.dataset.angular_velocity_final.values, expected.values)


@pytest.mark.slow  # three processes that import everything
def test_workers_make_the_same_dataset_after_one_died(folder: Path, tmp_path: Path) -> None:
    from rigidsim.workflows.sweeps.sweep import SweepObserver

    class Killer(SweepObserver):
        killed = 0

        def progressed(self, done: int) -> None:
            workers = multiprocessing.active_children()
            if workers and not self.killed:
                self.killed = workers[0].pid or 0
                workers[0].kill()

    killer = Killer()
    text = CONFIG + SWEEP.replace("tile = 2", "tile = 1")
    with pytest.raises(StoppedError, match="worker process died"):
        swept(tmp_path, text, workers=2, observer=killer)
    kept = set((tmp_path / "box/tiles").glob("*.h5"))
    assert kept
    found = swept(tmp_path, text, workers=2)
    assert found.finished
    assert kept < set(found.folder.tiles.glob("*.h5"))
    expected = open_sweep(folder).dataset.angular_velocity_final
    np.testing.assert_array_equal(found.dataset.angular_velocity_final.values, expected.values)
