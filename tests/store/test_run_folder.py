"""The run folder: nothing finished is overwritten by accident, nothing foreign is touched."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rigidsim
from rigidsim import RunFolderError
from rigidsim.store.atomic import replacing
from rigidsim.store.summary import read_summary


@pytest.fixture
def finished(tmp_path: Path, free_body: Callable[..., str]) -> rigidsim.Run:
    return rigidsim.run(rigidsim.parse(free_body()), out=tmp_path)


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


@pytest.mark.parametrize("force", [False, True])
def test_foreign_files_are_left_alone(force: bool, tmp_path: Path, free_body: Callable[..., str]) -> None:
    (tmp_path / "free").mkdir()
    thesis = tmp_path / "free" / "thesis.tex"
    thesis.write_text("years of work")
    with pytest.raises(RunFolderError, match=r"holds thesis\.tex, which no run writes; choose another out"):
        rigidsim.run(rigidsim.parse(free_body()), out=tmp_path, force=force)
    assert [p.name for p in (tmp_path / "free").iterdir()] == ["thesis.tex"]
    assert thesis.read_text() == "years of work"


def test_a_place_that_cannot_be_written(tmp_path: Path, free_body: Callable[..., str]) -> None:
    """/proc refuses even root; and a config that can't run writes nothing."""
    (tmp_path / "file").touch()
    for out in (Path("/proc/rigidsim-test"), tmp_path / "file" / "runs"):
        with pytest.raises(RunFolderError, match=r"can't be written: .+; choose another out"):
            rigidsim.run(rigidsim.parse(free_body()), out=out)
    text = free_body("end = 1", formulation="canonical").replace("[0.2, 1.1, 0.7]", "[0.2, 0, 0.7]")
    with pytest.raises(rigidsim.ConfigError, match="singularity"):
        rigidsim.run(rigidsim.parse(text), out=tmp_path / "runs")
    assert not (tmp_path / "runs").exists()


def test_an_unfinished_run_opens_and_is_not_overwritten(
    tmp_path: Path, free_body: Callable[..., str]
) -> None:
    text = free_body("end = 1e6\nevery = 1") + "[limits]\nmax_steps = 500\n"
    stopped = rigidsim.run(rigidsim.parse(text), out=tmp_path)
    assert stopped.status == "stopped: max_steps"
    assert stopped.folder.segments.is_dir()
    opened = rigidsim.open_run(str(stopped.folder.path))
    assert opened.status == "stopped: max_steps"
    with opened.dataset as dataset:
        assert dataset.attrs["status"] == "stopped: max_steps"
        assert dataset.sizes["time"] == opened.summary["samples"] > 10
        np.testing.assert_array_equal(dataset.time, np.arange(dataset.sizes["time"]))
    with pytest.raises(RunFolderError, match="holds an unfinished run; force=True replaces it"):
        rigidsim.run(rigidsim.parse(free_body()), out=tmp_path)
    again = rigidsim.run(rigidsim.parse(free_body()), out=tmp_path, force=True)
    assert again.status == "finished"
    assert not again.folder.segments.exists()


def test_a_run_is_found_by_its_folder_or_a_file_in_it(
    finished: rigidsim.Run, free_body: Callable[..., str], tmp_path: Path
) -> None:
    names = ["checkpoint.h5", "config.toml", "dataset.h5", "summary.json"]
    assert sorted(p.name for p in finished.folder.path.iterdir()) == names
    assert finished.folder.config.read_text() == free_body()
    assert json.loads(finished.folder.summary.read_text()) == finished.summary
    for name in ("", *names[1:]):
        opened = rigidsim.open_run(finished.folder.path / name)
        assert opened.folder == finished.folder
        assert opened.summary == finished.summary
        assert opened.outcome == finished.outcome
    nothing = tmp_path / "nothing"
    for _ in range(2):  # missing, then a folder of other things
        with pytest.raises(RunFolderError, match=r"no run here; give a run folder \(runs/NAME\) or its"):
            rigidsim.open_run(nothing)
        nothing.mkdir(exist_ok=True)
        (nothing / "config.toml").touch()


def test_a_run_without_a_summary_was_killed(finished: rigidsim.Run) -> None:
    finished.folder.summary.unlink()
    finished.folder.dataset.unlink()
    finished.folder.segments.mkdir()
    opened = rigidsim.open_run(finished.folder.path)
    assert opened.status == "running"
    assert "killed" in opened.summary["message"]
    with pytest.raises(RunFolderError, match="nothing was saved"):
        _ = opened.dataset


# ---- ``summary.json``: what is written is what is read; what isn't a summary is refused

# hundreds of turns between samples, of a quaternion that matrices don't carry: a warning is certain


def test_an_older_summary_is_read_and_written_again_as_it_is(finished: rigidsim.Run, tmp_path: Path) -> None:
    older = {**finished.summary, "of_another_version": [1, {"x": 2.5}]}
    for key in ("warning_codes", "method", "hold_invariants", "lyapunov", "events", "chart_changes"):
        older.pop(key)
    path = tmp_path / "summary.json"
    path.write_text(json.dumps(older))
    assert read_summary(path).as_dict() == older


DAMAGES: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "a text for a number": (lambda s: s["cost"].update(steps="7"), "'cost.steps': Input should be"),
    "no number": (lambda s: s["invariants"]["energy"].update(scale=math.nan), "invariants.energy.scale"),
    "nothing": (lambda s: s.pop("invariants"), "'invariants': Field required"),
    "no seconds": (lambda s: s["cost"]["seconds"].pop("engine"), "'cost.seconds': "),
    "a digest": (lambda s: s.update(dataset_sha256="x"), "'dataset_sha256': "),
    "a status": (lambda s: s.update(status="\x1b[31m"), "'status': "),
}  # fmt: skip


def test_a_damaged_summary_is_refused_by_its_place(finished: rigidsim.Run) -> None:
    path = finished.folder.summary
    for content in (b"", b'{"status": "fini', b"[]", b"\xff\xfe"):
        path.write_bytes(content)
        with pytest.raises(RunFolderError, match=r"summary\.json: is damaged or no summary"):
            rigidsim.open_run(finished.folder.path)
    for damage, place in DAMAGES.values():
        summary = json.loads(json.dumps(finished.summary))
        damage(summary)
        path.write_text(json.dumps(summary))
        with pytest.raises(RunFolderError, match="is damaged or no summary of rigidsim") as refusal:
            rigidsim.open_run(path.parent)
        assert place in str(refusal.value)


# ---- what takes the place of a file or folder is whole, or nothing changes


class Cut(Exception):
    """Where a test breaks off."""


def test_a_file_that_fails_leaves_the_old_one_and_no_remains(tmp_path: Path) -> None:
    place = tmp_path / "file"
    with replacing(place) as new:
        new.write_text("old")
    with suppress(Cut), replacing(place) as new:
        new.write_text("torn")
        raise Cut
    assert place.read_text() == "old"
    with replacing(place) as new, replacing(tmp_path / "other") as other:
        assert other != new
        new.write_text("new")
        other.write_text("")
        assert place.read_text() == "old"
    assert place.read_text() == "new"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "other"]
