"""Folders that can't be written: one clear message, everything saved kept, the same bits once they can."""

import subprocess
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import same_bits

import rigidsim
from rigidsim.session.session import Tuning
from rigidsim.solve.sampler import Pacing
from rigidsim.store import atomic
from rigidsim.store.segments import SegmentLimits

Config = Callable[..., str]
Command = Callable[..., Any]
Remount = Callable[[str], None]


@pytest.fixture
def remount(tmp_path: Path) -> Iterator[Remount]:
    """A file system of its own at ``disk``, that can be made read-only ("ro") and writable ("rw")."""
    place = tmp_path / "disk"
    place.mkdir()
    made = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64m", "tmpfs", place], capture_output=True)
    if made.returncode:
        pytest.skip("mounting isn't allowed here")

    def change(mode: str) -> None:
        subprocess.run(["mount", "-o", f"remount,{mode}", place], check=True, capture_output=True)

    yield change
    subprocess.run(["umount", "-l", place], check=True)


# a segment for each chunk of a few strides
EAGER = Tuning(Pacing(chunk_seconds=0.02, patience=0.0), SegmentLimits(seconds=0.0))


def message(result: Any, code: int = 2) -> str:
    """The one line that a refused command says."""
    assert result.exit_code == code, result.output
    assert isinstance(result.exception, SystemExit)
    lines = [line for line in result.stderr.splitlines() if line.startswith("rigidsim:")]
    assert len(lines) == 1, result.stderr
    return lines[0]


@pytest.mark.slow
def test_a_finished_run_is_read_verified_and_drawn(
    config: Config, rigidsim_command: Command, remount: Remount, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert rigidsim_command("run", config(), "--out", "disk").exit_code == 0
    remount("ro")
    before = sorted(p.name for p in Path("disk/free").iterdir())
    for command in (
        ["info", "disk/free"],
        ["verify", "disk/free"],
        ["plot", "disk/free", "--out", "figure.png"],
        ["export", "disk/free", "--format", "csv", "--out", "free.csv"],
        ["run", "--from", "disk/free/dataset.h5", "--out", "again"],
    ):
        result = rigidsim_command(*command)
        assert result.exit_code == 0, result.output
    same_bits(rigidsim.open_run("disk/free"), rigidsim.open_run("again/free"))
    shown: list[Path] = []

    def viewer(path: Path, *, web: bool) -> int:
        assert path.stat().st_size > 10_000
        shown.append(path)
        return 0

    monkeypatch.setattr("rigidsim.look.viewer.open_viewer", viewer)
    assert rigidsim_command("view", "disk/free").exit_code == 0
    assert not shown[0].exists()  # drawn for the viewer alone
    assert sorted(p.name for p in Path("disk/free").iterdir()) == before


@pytest.mark.slow
def test_a_folder_that_becomes_read_only_on_the_way(
    config: Config, rigidsim_command: Command, remount: Remount, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = config(time="end = 8000\nsamples = 8001")
    assert rigidsim_command("run", name).exit_code == 0
    replacing = atomic.replacing

    def writing(path: Path) -> Any:
        if path.name == "00000003.h5":
            remount("ro")
        return replacing(path)

    with monkeypatch.context() as patch:
        patch.setattr("rigidsim.workflows.run.run", partial(rigidsim.run, tuning=EAGER))
        patch.setattr(atomic, "replacing", writing)
        told = message(rigidsim_command("run", name, "--out", "disk"), code=3)
    assert "Read-only file system" in told
    assert "once its file system is mounted for writing again, rigidsim resume continues" in told
    opened = rigidsim.open_run("disk/free")
    with opened.dataset as saved, rigidsim.open_run("runs/free").dataset as whole:
        rows = saved.sizes["time"]
        assert 0 < rows < 8001
        np.testing.assert_array_equal(saved.quaternion.values, whole.quaternion.values[:rows])
    told = message(rigidsim_command("resume", "disk/free"))
    assert "disk/free: can't be written: Read-only file system" in told.replace("/segments", "")
    remount("rw")
    assert rigidsim_command("resume", "disk/free").exit_code == 0
    same_bits(rigidsim.open_run("disk/free"), rigidsim.open_run("runs/free"))
    assert not list(Path("disk/free").glob(".*"))


def test_a_timeline_that_cannot_be_written_costs_nothing_else(
    config: Config, rigidsim_command: Command, remount: Remount, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw = "rigidsim.look.timeline.write_timeline"
    from rigidsim.look.timeline import write_timeline

    def late(*arguments: Any, **options: Any) -> int:
        remount("ro")
        return write_timeline(*arguments, **options)

    with monkeypatch.context() as patch:
        patch.setattr(draw, late)
        drawn = rigidsim_command("run", config(), "--out", "disk", "--set", "output.timeline=true")
    told = message(drawn, code=3)
    assert "disk/free/timeline.rrd: can't be written: " in told
    assert "Read-only file system" in told
    assert "the dataset is complete, and rigidsim view draws the timeline" in told
    assert rigidsim.open_run("disk/free").status == "finished"
    assert rigidsim_command("verify", "disk/free").exit_code == 0
