"""Sweeps whose folder or config is damaged or wrong: nothing is lost or replaced unasked, and all is told."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rigidsim import ConfigError, RunFolderError, SavedSweep, open_sweep, parse
from rigidsim import sweep as run_sweep
from rigidsim.cli.app import app
from rigidsim.workflows.sweeps.sweep import SweepObserver

CONFIG = """\
name = "box"
[body]
principal_moments = [1, 2, 3]
[initial]
angular_velocity = [0.1, 1, 0.05]
[time]
end = 8
samples = 3
[integrator]
formulation = "rates"
[output]
estimate = false
record = ["angular_velocity"]
[[events]]
name = "flip"
expression = "wy"
[sweep]
tile = 2
axes."initial.angular_velocity[2]" = {step = [0.1, 0.1, 6], name = "w3"}
"""
LONGER = CONFIG.replace("0.1, 6]", "0.1, 7]")


class Counting(SweepObserver):
    def __init__(self) -> None:
        self.missing = 0

    def started(self, folder: Path, members: int, done: int) -> None:
        self.missing = members - done


def swept(out: Path, text: str = CONFIG) -> tuple[SavedSweep, int]:
    """The sweep, and how many members were run for it."""
    counting = Counting()
    return run_sweep(parse(text), out=out, observer=counting), counting.missing


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("finished")
    swept(out)
    return out


@pytest.fixture
def out(finished: Path, tmp_path: Path) -> Path:
    shutil.copytree(finished / "box", tmp_path / "box")
    return tmp_path


def same(one: SavedSweep, other: SavedSweep) -> bool:
    return one.dataset.drop_attrs().identical(other.dataset.drop_attrs())


def test_another_experiment_replaces_no_finished_sweep_without_tiles(out: Path) -> None:
    shutil.rmtree(out / "box" / "tiles")
    before = (out / "box" / "dataset.h5").read_bytes()
    with pytest.raises(RunFolderError, match=r"holds a sweep of another experiment.*force=True"):
        swept(out, CONFIG.replace("[1, 2, 3]", "[1, 2, 2.5]"))
    assert (out / "box" / "dataset.h5").read_bytes() == before
    found, run = swept(out, LONGER)  # the same experiment goes on, though nothing of it can be used again
    assert (found.summary["members"], run) == (7, 7)
    shutil.rmtree(out / "box" / "tiles")
    (out / "box" / "config.toml").unlink()
    with pytest.raises(RunFolderError, match="another experiment"):
        swept(out)


def test_a_damaged_tile_is_told_with_its_remedy_which_works(out: Path, finished: Path) -> None:
    tile = out / "box" / "tiles" / "g000-0000001.h5"
    content = bytearray(tile.read_bytes())
    content[len(content) // 2] ^= 1
    tile.write_bytes(content)
    for command in ("info", "resume"):
        told = CliRunner().invoke(app, [command, str(out / "box")])
        assert told.exit_code == 2
        assert "g000-0000001.h5: is damaged or was edited" in told.stderr
        assert "dataset.h5, which holds its members, is whole" in told.stderr
    for _ in range(2):
        with pytest.raises(RunFolderError, match=r"g000-0000001\.h5.*remove it, and rigidsim\.resume"):
            swept(out, LONGER)
    tile.unlink()
    found, run = swept(out, LONGER)
    assert run == 2
    fresh, _ = swept(out / "fresh", LONGER)
    assert same(found, fresh)


def test_impossible_members_are_marked_where_that_is_asked_and_the_others_run(tmp_path: Path) -> None:
    """The first member and the last exceed I1 + I2 >= I3; what is left is as if it had been swept alone."""

    def text(moments: str, more: str = "") -> str:
        axes = f'tile = 2\n{more}axes."body.principal_moments[2]" = {{values = {moments}, name = "moment"}}\n'
        return CONFIG.partition("tile")[0] + axes

    marked, run = swept(tmp_path / "marked", text("[3.5, 2, 2.5, 3, 3.1]", 'impossible = "mark"\n'))
    possible, _ = swept(tmp_path / "possible", text("[2, 2.5, 3]"))
    assert run == 5
    assert marked.summary["outcomes"] == {"finished": 3, "refused": 2}
    found = marked.dataset
    np.testing.assert_array_equal(
        found.angular_velocity_final[1:4].values, possible.dataset.angular_velocity_final.values
    )
    assert np.isnan(found.angular_velocity_final[[0, 4]].values).all()
    assert found.failed_member.values.tolist() == [0, 4]
    assert all("the largest is more than the sum of the other two" in x for x in found.failed_reason.values)
    with pytest.raises(ConfigError, match=r'(?s)member 1 .*impossible = "mark" marks such members'):
        swept(tmp_path / "refused", text("[2, 3.5, 3.1]"))
    with pytest.raises(ConfigError, match="the largest is more than"):
        swept(tmp_path / "none", text("[3.5, 3.1]", 'impossible = "mark"\n'))


def test_what_is_gone_from_earlier_tiles_is_computed_again(out: Path) -> None:
    """The latest generation has none of it, and was complete."""
    more = CONFIG.replace("[sweep]\n", '[sweep]\nkeep = ["final", "means"]\n')
    found, run = swept(out, more)
    whole = found.dataset.load()
    assert run == 6
    (out / "box" / "tiles" / "g000-0000002.h5").unlink()
    (out / "box" / "dataset.h5").unlink()
    again, run = swept(out, more)
    assert run == 2
    assert whole.drop_attrs().identical(again.dataset.drop_attrs())


def test_axes_can_be_given_as_dictionaries(tmp_path: Path) -> None:
    axes = {"time.end": {"values": [1, 2, 3]}, "initial.angular_velocity": {"sphere": 1, "count": 2}}
    changes = {"sweep": {"tile": 100, "axes": axes}}
    found = run_sweep(parse(CONFIG.partition("[sweep]")[0]), out=tmp_path, changes=changes)
    assert found.dataset.status.dims == ("end", "initial_angular_velocity")


REFUSED = {
    "an index past the end": (
        'axes."initial.angular_velocity[3]" = {values = [1]}',
        'velocity[3]": there is nothing at "3" to set; the array there has entries 0 to 2',
    ),
    "a number beyond the range": (
        'axes."initial.angular_velocity[2]" = {values = [1, "1e400"], name = "w"}', "1e400",
    ),
    "a model without its loads": (
        'axes."model.level" = {values = ["full", "spin_averaged"], name = "level"}', "spin_averaged",
    ),
    "a parameter of no expression": (
        'axes."parameters.k" = {values = [1, 2]}', 'no expression uses the parameter "k"',
    ),
    "a name derived from another": (
        'axes."initial.angular_velocity" = {values = [[1, 2, 3]], name = "w"}\n'
        'axes."time.end" = {values = [1], name = "w_component"}',
        'axes."time.end": is named "w_component" like axes."initial.angular_velocity"',
    ),
    "too few": ('axes."time.end" = {linspace = [1, 2]}', "given 2 entries; exactly 3 are needed"),
    "a misspelt way": (
        'axes."time.end" = {value = [1]}',
        'axes."time.end".value: unknown key; did you mean "values"?',
    ),
    "an indicator that can't be": (
        'keep = ["megno"]\naxes."time.end".values = [1]',
        '[sweep] keep: given "megno": needs the attitude',
    ),
    "a tile beyond all bounds": (f'tile = 1{30 * "0"}\naxes."time.end" = {{values = [1]}}', "at most 1e+08"),
}  # fmt: skip


def test_a_bad_sweep_is_told_where_and_why(tmp_path: Path) -> None:
    for table, told in REFUSED.values():
        with pytest.raises(ConfigError) as caught:
            swept(tmp_path, CONFIG.partition("[sweep]")[0] + f"[sweep]\n{table}\n")
        assert told in str(caught.value)
        assert len(caught.value.problems) == 1
    assert not list(tmp_path.iterdir())


def test_a_limit_of_time_is_kept_where_it_is_swept(tmp_path: Path) -> None:
    axes = 'axes."limits.wall_time" = {values = ["1e-9 s", "1 h"], name = "limit"}\n'
    found, _ = swept(tmp_path, CONFIG.partition("tile")[0] + axes)
    assert found.summary["outcomes"] == {"finished": 1, "stopped: wall_time": 1}
    assert found.summary["why_alone"] == "wall_time"


@pytest.mark.slow  # five times two processes that import everything
def test_a_script_without_a_guard_is_told_what_it_lacks(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(CONFIG)
    script = tmp_path / "script.py"
    script.write_text('import rigidsim\nrigidsim.sweep("c.toml", workers=2)\n')
    command = [sys.executable, script.name]
    found = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert found.returncode == 1
    assert 'under  if __name__ == "__main__":' in found.stderr
    assert "freeze_support" not in found.stderr
    script.write_text(
        'import rigidsim\nif __name__ == "__main__":\n    rigidsim.sweep("c.toml", workers=2)\n'
    )
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=300)
    assert open_sweep(tmp_path / "runs" / "box").finished
