"""Sweeps whose folder or config is damaged: nothing is lost or replaced unasked, and all is reported."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from support import config
from typer.testing import CliRunner

from rigidsim import ConfigError, RunFolderError, SavedSweep, parse
from rigidsim import sweep as run_sweep
from rigidsim.cli.app import app
from rigidsim.workflows.sweeps.sweep import SweepObserver

CONFIG = config(
    "principal_moments = [1, 2, 3]",
    "angular_velocity = [0.1, 1, 0.05]",
    time="end = 8\nsamples = 3",
    integrator='formulation = "rates"',
    output='record = ["angular_velocity"]',
    more='[[events]]\nname = "flip"\nexpression = "wy"\n[sweep]\ntile = 2\n'
    'axes."initial.angular_velocity[2]" = {step = [0.1, 0.1, 6], name = "w3"}',
    name="box",
)
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


def test_a_damaged_tile_is_told_with_its_remedy_which_works(out: Path, finished: Path) -> None:
    tile = sorted((out / "box" / "tiles").glob("*.h5"))[1]
    content = bytearray(tile.read_bytes())
    content[len(content) // 2] ^= 1
    tile.write_bytes(content)
    for command in ("info", "resume"):
        shown = CliRunner().invoke(app, [command, str(out / "box")])
        assert shown.exit_code == 2
        assert f"{tile.name}: is damaged or was edited" in shown.stderr
        assert "dataset.h5, which holds its members, is whole" in shown.stderr
    for _ in range(2):
        with pytest.raises(RunFolderError, match=rf"{tile.name}.*remove it, and rigidsim\.resume"):
            swept(out, LONGER)
    tile.unlink()
    found, run = swept(out, LONGER)
    assert run in (2, 3)  # the damage may have been seen before the seventh was run
    fresh, _ = swept(out / "fresh", LONGER)
    assert same(found, fresh)


def test_a_torn_dataset_is_written_again(out: Path, finished: Path) -> None:
    path = out / "box" / "dataset.h5"
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 3])
    shown = CliRunner().invoke(app, ["info", str(out / "box")])
    assert shown.exit_code == 2
    assert "remove it, and rigidsim resume writes it again" in shown.stderr
    path.unlink()
    assert CliRunner().invoke(app, ["resume", str(out / "box")]).exit_code == 0
    assert len(path.read_bytes()) == len(content)


@pytest.mark.slow
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


REFUSED = {
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
    "an indicator that can't be": (
        'keep = ["megno"]\naxes."time.end".values = [1]',
        '[sweep] keep: given "megno": needs the attitude',
    ),
    "a tile beyond all bounds": (f'tile = 1{30 * "0"}\naxes."time.end" = {{values = [1]}}', "at most 1e+08"),
}  # fmt: skip


def test_a_bad_sweep_is_told_where_and_why(tmp_path: Path) -> None:
    for table, refusal in REFUSED.values():
        with pytest.raises(ConfigError) as caught:
            swept(tmp_path, CONFIG.partition("[sweep]")[0] + f"[sweep]\n{table}\n")
        assert refusal in str(caught.value)
        assert len(caught.value.problems) == 1
    assert not list(tmp_path.iterdir())
