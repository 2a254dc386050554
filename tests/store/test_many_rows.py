"""Tables of many rows lie in a temporary file: the same numbers, and no memory."""

from __future__ import annotations

import resource
import tempfile
from pathlib import Path

import numpy as np
import pytest

import rigidsim
from rigidsim.formats.trajectories import trajectory_of
from rigidsim.store.many_rows import BLOCK, gathered
from rigidsim.workflows.compare.columns import attitudes_of

PARTS = [np.random.default_rng(n).normal(size=(40_000, 8)) for n in range(9)]  # 23 MB


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


def test_damage_at_the_border_of_blocks_is_seen() -> None:
    row = BLOCK
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
