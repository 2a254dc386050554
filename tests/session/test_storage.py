"""A run that doesn't fit on its disk is refused before it begins, and ``plan`` warns of it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from support import config, run_text

import rigidsim
from rigidsim import RunFolderError
from rigidsim.session.storage import storage
from rigidsim.solve.problem import prepare

VAST = "end = 999999999999\nevery = 1"  # hundreds of terabytes


def test_a_run_that_does_not_fit_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match=r"scene: the run takes about .* TB of space .*; take fewer"):
        rigidsim.run(rigidsim.parse(config(time=VAST)), out=tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "ending",
    ["[limits]\nmax_steps = 5", '[[events]]\nname = "soon"\nexpression = "t - 2"\naction = "stop"'],
)
def test_one_that_may_end_before_is_not(ending: str, tmp_path: Path) -> None:
    run = run_text(config(time=VAST, more=ending), tmp_path)
    assert run.status in ("stopped: max_steps", "finished: event")
    assert 0 < run.summary["samples"] < 100


def test_plan_warns_of_it(tmp_path: Path) -> None:
    said = {}
    for time in (VAST, "end = 3\nsamples = 49"):
        plan = rigidsim.plan(rigidsim.parse(config(time=time)), out=tmp_path, pilot_seconds=0.01)
        said[time] = plan["warnings"]
        assert plan["predicted"]["free_bytes"] == pytest.approx(shutil.disk_usage(tmp_path).free, rel=0.1)
    assert said["end = 3\nsamples = 49"] == []
    assert len(said[VAST]) == 1
    assert "take fewer [time] samples" in said[VAST][0]


def test_what_is_predicted_is_what_it_takes(tmp_path: Path) -> None:
    """Segments beside labels of some kilobytes a file; a dataset is compressed by what repeats."""
    text = config(
        time="end = 20000\nsamples = 20001", output="estimate = false", more="[limits]\nmax_steps = 1000000"
    )
    predicted = storage(prepare(rigidsim.parse(text)), tmp_path)
    whole = run_text(text, out=tmp_path)
    size = whole.folder.dataset.stat().st_size
    assert size < 1.05 * predicted.dataset
    cut = run_text(text, "limits.max_steps=10000", out=tmp_path / "cut")
    segments = sum(file.stat().st_size for file in cut.folder.segments.iterdir())
    assert segments == pytest.approx(cut.summary["samples"] * predicted.row, rel=0.1)
