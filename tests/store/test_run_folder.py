"""The run folder: nothing finished is overwritten by accident, nothing foreign is touched."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rigidsim
from rigidsim import RunFolderError


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


# ---- ``summary.json``: what is written is what is read; what isn't a summary is refused

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
