"""Segments: written once and whole, merged without a trace, refused when one is missing."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from support import cases, same_bits

import rigidsim
from rigidsim import RunFolderError
from rigidsim.session.session import Tuning
from rigidsim.solve.sampler import Pacing
from rigidsim.store import netcdf
from rigidsim.store.segments import SegmentLimits, SegmentWriter, read_chain, segment_paths
from rigidsim.store.variables import SCHEMA_VERSION, Variable, time_variable

VARIABLES = [
    time_variable(2),
    Variable("rates", ("body_axis",), {"units": "rad s-1", "long_name": "some rates"}, 2),
    Variable("energy_drift", (), {"units": "1", "long_name": "a drift"}),
]


CHECKPOINT = {"counts": np.array([1, 2, 3]), "state_parts": np.array([[0.1, 0.2]])}


def block(first: int, rows: int) -> dict[str, list[np.ndarray]]:
    """Rows ``first ...`` of an endless table."""
    n = np.arange(first, first + rows, dtype=float)
    axes = np.array([1.0, 10.0, 100.0])
    return {
        "time": [n / 8, n * 1e-20],
        "rates": [np.sin(n[:, None] * axes), np.cos(n[:, None] * axes) * 1e-17],
        "energy_drift": [n[:, None] * 1e-16],
    }


def writer(folder: Path, limits: SegmentLimits | None = None) -> SegmentWriter:
    return SegmentWriter(
        folder,
        VARIABLES,
        {"title": "t", "status": "running", "run_id": "r", "schema_version": SCHEMA_VERSION},
        limits=limits,
    )


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def test_each_segment_is_a_dataset_of_its_own(tmp_path: Path) -> None:
    w = writer(tmp_path / "s")
    for first, rows in ((0, 5), (5, 1), (6, 7)):
        w.add(block(first, rows))
        w.flush(CHECKPOINT, {})
    assert names(tmp_path / "s") == ["00000000.h5", "00000001.h5", "00000002.h5"]
    for number, (first, rows) in enumerate(((0, 5), (5, 1), (6, 7))):
        with xarray.open_dataset(tmp_path / "s" / f"{number:08d}.h5") as segment:
            assert segment.attrs["segment"] == number
            assert segment.attrs["first_sample"] == first
            assert segment.attrs["title"] == "t"
            assert segment.body_axis.values.tolist() == ["x", "y", "z"]
            expected = block(first, rows)
            np.testing.assert_array_equal(segment.time, expected["time"][0])
            np.testing.assert_array_equal(segment.time_lo, expected["time"][1])
            np.testing.assert_array_equal(segment.rates, expected["rates"][0])
            np.testing.assert_array_equal(segment.rates_lo, expected["rates"][1])
            np.testing.assert_array_equal(segment.energy_drift, expected["energy_drift"][0][:, 0])


def full_disk(*_: Any, **__: Any) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


FAILURES = {"rename": (os, "replace"), "sync": (os, "fsync"), "write": (Path, "write_bytes")}


@pytest.mark.parametrize("failure", FAILURES)
def test_a_full_disk_leaves_no_half_segment_and_loses_nothing(
    failure: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    w = writer(tmp_path / "s")
    w.add(block(0, 4))
    w.flush(CHECKPOINT, {})
    w.add(block(4, 3))
    with monkeypatch.context() as patch:
        patch.setattr(*FAILURES[failure], full_disk)
        with pytest.raises(RunFolderError, match=r"No space left on device") as caught:
            w.flush(CHECKPOINT, {})
    assert "4 samples are saved" in str(caught.value)
    assert names(tmp_path / "s") == ["00000000.h5"]
    assert w.saved_rows == 4
    w.flush(CHECKPOINT, {})  # there is room again
    assert names(tmp_path / "s") == ["00000000.h5", "00000001.h5"]
    with xarray.open_dataset(tmp_path / "s" / "00000001.h5") as segment:
        np.testing.assert_array_equal(segment.rates, block(4, 3)["rates"][0])


@pytest.mark.parametrize("failure", ["rename", "sync"])
def test_a_full_disk_at_the_end_keeps_the_segments(
    failure: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    w = writer(tmp_path / "s")
    w.add(block(0, 4))
    w.flush(CHECKPOINT, {})
    w.add(block(4, 3))
    with monkeypatch.context() as patch:
        patch.setattr(*FAILURES[failure], full_disk)
        with pytest.raises(RunFolderError, match=r"No space left on device"):
            w.complete(tmp_path / "dataset.h5", {})
    assert names(tmp_path) == ["s"]
    assert names(tmp_path / "s") == ["00000000.h5"]
    assert w.complete(tmp_path / "dataset.h5", {}) == 7
    with xarray.open_dataset(tmp_path / "dataset.h5") as dataset:
        np.testing.assert_array_equal(dataset.rates, block(0, 7)["rates"][0])


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


@pytest.mark.parametrize("cuts", [[1] * 7 + [3, 12000, 5, 9000], [8192, 8192, 4631], [21015]])
def test_any_cuts_give_the_same_dataset(cuts: list[int], tmp_path: Path) -> None:
    """Across chunk boundaries, and with a rest that never became a segment."""
    w = writer(tmp_path / "s")
    first = 0
    for rows in cuts:
        w.add(block(first, rows))
        w.flush(CHECKPOINT, {})
        first += rows
    w.add(block(first, 11))
    assert w.complete(tmp_path / "d.h5", {"status": "finished"}) == first + 11
    assert not (tmp_path / "s").exists()
    expected = block(0, first + 11)
    with xarray.open_dataset(tmp_path / "d.h5") as dataset:
        assert dataset.attrs["status"] == "finished"
        for variable in VARIABLES:
            for name, part in zip(variable.part_names(), expected[variable.name], strict=True):
                np.testing.assert_array_equal(dataset[name].values, part.reshape(dataset[name].shape))


@pytest.mark.parametrize("precision", cases(['"double"', '"quadruple"'], ['"double"']))
def test_a_run_in_many_segments_is_the_run_in_one(
    precision: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free_body: Callable[..., str]
) -> None:
    text = free_body("end = 12\nsamples = 97", precision=precision)
    counts: list[int] = []
    original = SegmentWriter.complete

    def counted(self: SegmentWriter, *args: Any, **options: Any) -> int:
        counts.append(len(segment_paths(self._folder)))
        return original(self, *args, **options)

    monkeypatch.setattr(SegmentWriter, "complete", counted)
    one = rigidsim.run(rigidsim.parse(text), out=tmp_path / "one")
    pacing = Pacing(chunk_seconds=0.0, patience=0.0, rows_at_once=5)
    tuning = Tuning(pacing, SegmentLimits(bytes=1))
    many = rigidsim.run(rigidsim.parse(text), out=tmp_path / "many", tuning=tuning)
    assert counts[0] == 0
    assert counts[1] >= 7
    for run in (one, many):
        assert not run.folder.segments.exists()
        assert names(run.folder.path) == ["checkpoint.h5", "config.toml", "dataset.h5", "summary.json"]
    same_bits(one, many)


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

    tuning = Tuning(Pacing(rows_waiting=netcdf.CHUNK_ROWS), SegmentLimits(bytes=2_000_000))
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


@pytest.mark.parametrize("missing", [0, 1])
def test_a_missing_segment_is_named(missing: int, tmp_path: Path) -> None:
    folder = tmp_path / "r" / "segments"
    w = writer(folder)
    for first in range(3):
        w.add(block(first, 1))
        w.flush(CHECKPOINT, {})
    assert [p.name for p in segment_paths(folder)] == names(folder)
    (folder / f"{missing:08d}.h5").unlink()
    with pytest.raises(RunFolderError, match=rf"segment {missing:08d}\.h5 is missing"):
        segment_paths(folder)
    with pytest.raises(RunFolderError, match=rf"segment {missing:08d}\.h5 is missing"):
        _ = rigidsim.open_run(tmp_path / "r").dataset
    with pytest.raises(RunFolderError, match=rf"segment {missing:08d}\.h5 is missing"):
        w.complete(tmp_path / "d.h5", {})
    assert not (tmp_path / "d.h5").exists()


def test_a_missing_last_segment_is_no_gap_of_zeros(tmp_path: Path) -> None:
    """Nothing in the sequence shows it; the writer knows how many it wrote."""
    w = writer(tmp_path / "s")
    for first in range(3):
        w.add(block(first, 1))
        w.flush(CHECKPOINT, {})
    (tmp_path / "s" / "00000002.h5").unlink()
    with pytest.raises(RunFolderError, match=r"segment 00000002\.h5 is missing"):
        w.complete(tmp_path / "d.h5", {})
    assert not (tmp_path / "d.h5").exists()


def test_a_partial_run_reads_as_one_dataset(tmp_path: Path) -> None:
    w = writer(tmp_path / "r" / "segments")
    for first in range(0, 12, 4):
        w.add(block(first, 4))
        w.flush(CHECKPOINT, {})
    run = rigidsim.open_run(tmp_path / "r")
    assert run.status == "running"
    with run.dataset as dataset:
        assert dataset.attrs["status"] == "running"
        np.testing.assert_array_equal(dataset.time, block(0, 12)["time"][0])
        np.testing.assert_array_equal(dataset.rates_lo, block(0, 12)["rates"][1])
        assert dataset.rates.dims == ("time", "body_axis")
        assert dataset.body_axis.values.tolist() == ["x", "y", "z"]
