"""Tables of many rows lie in a temporary file: the same numbers, and no memory."""

from __future__ import annotations

import resource
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

import rigidsim
from rigidsim.formats.trajectories import trajectory_of
from rigidsim.store.many_rows import BLOCK, blocks_of, flagged, gathered, picked, usual_step
from rigidsim.workflows.compare.columns import attitudes_of

PARTS = [np.random.default_rng(n).normal(size=(40_000, 8)) for n in range(9)]  # 23 MB


def test_rows_in_a_file_are_those_that_were_given() -> None:
    whole = np.concatenate(PARTS)
    found = gathered(iter(PARTS))
    assert not found.flags.writeable  # it is in a file
    assert gathered(PARTS[:2]).flags.writeable  # these are in memory
    assert np.array_equal(found, whole)
    rows = np.random.default_rng(1).integers(0, len(whole), 300)
    assert np.array_equal(picked(found, rows), whole[rows])
    assert flagged(lambda block: found[block, 0] > 4, len(found)) == (
        np.sum(whole[:, 0] > 4),
        np.argmax(whole[:, 0] > 4),
    )
    times = np.cumsum(np.abs(whole[:, 0]))
    assert usual_step(times) == np.median(np.diff(times))


def test_blocks_cover_all_rows() -> None:
    for count, multiple in ((1, 1), (200_000, 1), (200_000, 7), (200_000, 150_000)):
        blocks = list(blocks_of(count, multiple))
        assert np.array_equal(np.concatenate([np.arange(count)[rows] for rows in blocks]), np.arange(count))
        assert all(rows.start % multiple == 0 for rows in blocks)


def file_pages() -> float:
    """Memory (MB) of this process that is a file's."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("RssFile"):
            return float(line.split()[1]) / 1024
    raise AssertionError


@pytest.mark.skipif(sys.platform != "linux", reason="measured as Linux tells it")
def test_memory_is_given_back_after_each_block() -> None:
    found = gathered(iter(PARTS))
    before, most = file_pages(), 0.0
    for rows in blocks_of(len(found)):
        found[rows].sum()
        most = max(most, file_pages() - before)
    assert 0 < most < 1.5 * BLOCK * 64 / 2**20
    assert file_pages() - before < 1
    found.sum()
    assert file_pages() - before > 0.9 * found.nbytes / 2**20


def test_where_rows_cannot_be_kept_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000_000, hard))  # a write stops there, as on a full disk
    try:
        with pytest.raises(rigidsim.RigidsimError, match=r"MB of rows can't be kept .* set TMPDIR"):
            gathered(iter(PARTS))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    with pytest.raises(rigidsim.RigidsimError, match=r"No such file or directory.*set TMPDIR"):
        gathered(iter(PARTS))


@pytest.mark.parametrize("row", [BLOCK - 1, BLOCK])
def test_damage_at_the_border_of_blocks_is_seen(row: int) -> None:
    times = np.arange(BLOCK + 10.0)
    whole = np.tile([0.5, 0.5, 0.5, 0.5], (len(times), 1)) * (1 + 1e-5 * times)[:, None]
    attitudes_of(trajectory_of({"t": times, "q": whole}), None)
    broken = whole.copy()
    broken[row] *= 2
    with pytest.raises(rigidsim.RigidsimError, match=rf"row {row}: a quaternion of norm .* \(1 such rows\)"):
        attitudes_of(trajectory_of({"t": times, "q": broken}), None)
    again = np.where(np.arange(len(times)) == row, times - 1, times)
    with pytest.raises(rigidsim.RigidsimError, match=f"row {row} has the time of the row before"):
        attitudes_of(trajectory_of({"t": again, "q": whole}), None)
