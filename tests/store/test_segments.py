"""Segments: written once and whole, merged without a trace, refused when one is missing."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support import same_bits

import rigidsim
from rigidsim import RunFolderError
from rigidsim.session.session import Tuning
from rigidsim.solve.sampler import Pacing
from rigidsim.store.segments import SegmentLimits, SegmentWriter, read_chain


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


@pytest.mark.slow
def test_a_dense_run_that_was_killed_resumes_from_its_segments(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free_body: Callable[..., str]
) -> None:
    """What waits at a checkpoint is found again; steps and numbers are those of the run in one."""
    text = free_body("end = 400\nsamples = 60_001")
    one = rigidsim.run(rigidsim.parse(text), out=tmp_path / "one")
    flush = SegmentWriter.flush

    def killed(self: SegmentWriter, *given: Any) -> None:
        if self.count == 1:
            raise RunFolderError("killed")
        flush(self, *given)

    tuning = Tuning(Pacing(chunk_seconds=0.002), SegmentLimits(bytes=2_000_000))
    with monkeypatch.context() as patch:
        patch.setattr(SegmentWriter, "flush", killed)
        with pytest.raises(RunFolderError, match="killed"):
            rigidsim.run(rigidsim.parse(text), out=tmp_path / "two", tuning=tuning)
    [folder] = (tmp_path / "two").iterdir()
    chain = read_chain(folder / "segments")
    assert chain.rows > 0
    two = rigidsim.resume(folder)
    same_bits(one, two)
    assert one.summary["cost"]["steps"] == two.summary["cost"]["steps"]
