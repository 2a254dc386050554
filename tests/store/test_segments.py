"""Segments: written once and whole, merged without a trace, refused when one is missing."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import rigidsim
from rigidsim import RunFolderError
from rigidsim.session.session import Tuning
from rigidsim.solve.sampler import Pacing
from rigidsim.store.segments import SegmentLimits


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def full_disk(*_: Any, **__: Any) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_full_disk_ends_a_run_with_a_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free_body: Callable[..., str]
) -> None:
    """And with the segments that were written before."""
    replace = os.replace

    def full_after_one_segment(source: Any, target: Any) -> None:
        if Path(target).name == "00000001.h5":
            full_disk()
        replace(source, target)

    monkeypatch.setattr(os, "replace", full_after_one_segment)
    tuning = Tuning(Pacing(chunk_seconds=0.0, patience=0.0), SegmentLimits(bytes=1))
    with pytest.raises(RunFolderError, match=r"No space left on device"):
        rigidsim.run(rigidsim.parse(free_body()), out=tmp_path, tuning=tuning)
    assert names(tmp_path / "free" / "segments") == ["00000000.h5"]
    partial = rigidsim.open_run(tmp_path / "free")
    assert partial.status == "running"
    with partial.dataset as dataset:
        assert 0 < dataset.sizes["time"] < 49
