"""The run folder: nothing finished is overwritten by accident, nothing foreign is touched."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import rigidsim
from rigidsim import RunFolderError


@pytest.fixture
def finished(tmp_path: Path, free_body: Callable[..., str]) -> rigidsim.Run:
    return rigidsim.run(rigidsim.parse(free_body()), out=tmp_path)


def partial(folder: Path, free_body: Callable[..., str]) -> rigidsim.Run:
    """A run that a guard stopped."""
    text = free_body("end = 1e6\nevery = 1") + "[limits]\nmax_steps = 500\n"
    return rigidsim.run(rigidsim.parse(text), out=folder)


def test_what_a_finished_run_consists_of(finished: rigidsim.Run, free_body: Callable[..., str]) -> None:
    assert sorted(p.name for p in finished.folder.path.iterdir()) == [
        "checkpoint.h5",
        "config.toml",
        "dataset.h5",
        "summary.json",
    ]
    assert finished.folder.config.read_text() == free_body()
    assert json.loads(finished.folder.summary.read_text()) == finished.summary
    assert finished.status == "finished"


def test_a_finished_run_is_not_overwritten(finished: rigidsim.Run, free_body: Callable[..., str]) -> None:
    folder = finished.folder.path
    before = {p.name: (p.read_bytes(), p.stat().st_mtime_ns) for p in folder.iterdir()}
    with pytest.raises(RunFolderError) as caught:
        rigidsim.run(rigidsim.parse(free_body("end = 1")), out=folder.parent)
    text = str(caught.value)
    assert str(folder) in text
    assert "holds a finished run" in text
    assert "force=True replaces it" in text
    assert "another out puts" in text
    assert {p.name: (p.read_bytes(), p.stat().st_mtime_ns) for p in folder.iterdir()} == before


def test_force_replaces_all_of_it(finished: rigidsim.Run, free_body: Callable[..., str]) -> None:
    """A timeline or a figure of the old run would show what the new one isn't."""
    finished.folder.timeline.write_bytes(b"old")
    again = rigidsim.run(
        rigidsim.parse(free_body("end = 1\nsamples = 9")), out=finished.folder.path.parent, force=True
    )
    assert again.summary["samples"] == 9
    assert not again.folder.timeline.exists()
    with again.dataset as dataset:
        assert dataset.sizes["time"] == 9
    assert "samples = 9" in again.folder.config.read_text()


def test_an_unfinished_run_is_not_overwritten(tmp_path: Path, free_body: Callable[..., str]) -> None:
    stopped = partial(tmp_path, free_body)
    assert stopped.status == "stopped: max_steps"
    assert stopped.folder.segments.is_dir()
    with pytest.raises(RunFolderError, match="holds an unfinished run; force=True replaces it"):
        rigidsim.run(rigidsim.parse(free_body()), out=tmp_path)
    again = rigidsim.run(rigidsim.parse(free_body()), out=tmp_path, force=True)
    assert again.status == "finished"
    assert not again.folder.segments.exists()


@pytest.mark.parametrize("force", [False, True])
def test_foreign_files_are_left_alone(force: bool, tmp_path: Path, free_body: Callable[..., str]) -> None:
    (tmp_path / "free").mkdir()
    thesis = tmp_path / "free" / "thesis.tex"
    thesis.write_text("years of work")
    with pytest.raises(RunFolderError, match=r"holds thesis\.tex, which no run writes; choose another out"):
        rigidsim.run(rigidsim.parse(free_body()), out=tmp_path, force=force)
    assert [p.name for p in (tmp_path / "free").iterdir()] == ["thesis.tex"]
    assert thesis.read_text() == "years of work"


@pytest.mark.parametrize("where", ["a file as parent", "/proc"])
def test_a_place_that_cannot_be_written(where: str, tmp_path: Path, free_body: Callable[..., str]) -> None:
    """/proc refuses even root."""
    out = Path("/proc/rigidsim-test") if where == "/proc" else tmp_path / "file" / "runs"
    (tmp_path / "file").touch()
    with pytest.raises(RunFolderError, match=r"can't be written: .+; choose another out"):
        rigidsim.run(rigidsim.parse(free_body()), out=out)


def test_a_config_that_cannot_run_writes_nothing(tmp_path: Path, free_body: Callable[..., str]) -> None:
    text = free_body("end = 1", formulation="canonical").replace("[0.2, 1.1, 0.7]", "[0.2, 0, 0.7]")
    with pytest.raises(rigidsim.ConfigError, match="singularity"):
        rigidsim.run(rigidsim.parse(text), out=tmp_path / "runs")
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize("name", ["", "dataset.h5", "summary.json", "config.toml"])
def test_a_run_is_found_by_its_folder_or_a_file_in_it(name: str, finished: rigidsim.Run) -> None:
    opened = rigidsim.open_run(finished.folder.path / name)
    assert opened.folder == finished.folder
    assert opened.summary == finished.summary
    with opened.dataset as dataset:
        assert dataset.sizes["time"] == 49


def test_a_partial_run_opens(tmp_path: Path, free_body: Callable[..., str]) -> None:
    stopped = partial(tmp_path, free_body)
    for path in (stopped.folder.path, str(stopped.folder.path)):
        opened = rigidsim.open_run(path)
        assert opened.status == "stopped: max_steps"
        with opened.dataset as dataset:
            assert dataset.attrs["status"] == "stopped: max_steps"
            assert dataset.sizes["time"] == opened.summary["samples"] > 10
            np.testing.assert_array_equal(dataset.time, np.arange(dataset.sizes["time"]))


@pytest.mark.parametrize("what", ["missing", "empty folder", "folder of other things"])
def test_no_run_there(what: str, tmp_path: Path) -> None:
    path = tmp_path / "nothing"
    if what != "missing":
        path.mkdir()
    if what == "folder of other things":
        (path / "config.toml").touch()
    with pytest.raises(RunFolderError, match=r"no run here; give a run folder \(runs/NAME\) or its dataset"):
        rigidsim.open_run(path)


@pytest.mark.parametrize("content", [b"", b'{"status": "fini', b"[]", b"\xff\xfe"])
def test_a_damaged_summary_is_refused(content: bytes, finished: rigidsim.Run) -> None:
    finished.folder.summary.write_bytes(content)
    with pytest.raises(RunFolderError, match=r"summary\.json: is damaged or no summary"):
        rigidsim.open_run(finished.folder.path)


def test_a_run_without_a_summary_was_killed(finished: rigidsim.Run) -> None:
    finished.folder.summary.unlink()
    finished.folder.dataset.unlink()
    finished.folder.segments.mkdir()
    opened = rigidsim.open_run(finished.folder.path)
    assert opened.status == "running"
    assert "killed" in opened.summary["message"]
    with pytest.raises(RunFolderError, match="nothing was saved"):
        _ = opened.dataset
