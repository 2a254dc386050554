"""Chunks compressed outside HDF5: what any reader unpacks is what was put in, whatever compressed it."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import netCDF4
import numpy as np
import pytest

from rigidsim.store import chunks, netcdf
from rigidsim.store.chunks import THREADS, ChunkedVariable, Threads, chunked, packed
from rigidsim.store.netcdf_file import writing

ROWS = 70
SPECIAL = [0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, 1.5]


def table(rows: int = ROWS) -> np.ndarray:
    n = np.arange(rows, dtype=float)
    found = np.sin(n[:, None] * [1.0, 10.0, 100.0])
    found.flat[: len(SPECIAL)] = SPECIAL
    return found


@contextmanager
def under_construction(
    path: Path, rows: int, threads: Threads = THREADS
) -> Iterator[dict[str, ChunkedVariable]]:
    """Rates and a number, in chunks of 16 rows."""
    with path.open("w+b") as target, writing(target) as file:
        file.dimension("time", rows)
        file.labels("body_axis", ["x", "y", "z"], {})
        created = {
            name: file.variable(name, dims, {}, chunk_rows=16, gzip=netcdf.GZIP_LEVEL)
            for name, dims in (("rates", ("time", "body_axis")), ("energy", ("time",)))
        }
        with chunked(created, threads) as made:
            yield made


@pytest.mark.parametrize("threads", [0, 3])
@pytest.mark.parametrize("cuts", [[ROWS], [1] * ROWS, [16, 16, 38], [5, 40, 0, 25], [15, 17, 1, 37]])
def test_rows_in_any_pieces_come_out_in_order(cuts: list[int], threads: int, tmp_path: Path) -> None:
    values, path, first = table(), tmp_path / "d.h5", 0
    columns = np.asfortranarray(values)  # as they come from compiled functions
    with under_construction(path, ROWS, Threads(threads, fewest=0, waiting=2)) as made:
        for rows in cuts:
            made["rates"].add(columns[first : first + rows])
            made["energy"].add(values[first : first + rows, 1:2])
            first += rows
    with h5py.File(path, "r") as file, netCDF4.Dataset(path) as other:
        assert file["rates"][:].tobytes() == values.tobytes()  # the signs of zeros, too
        assert file["energy"][:].tobytes() == values[:, 1].tobytes()
        assert other["rates"][:].tobytes() == values.tobytes()
        assert file["rates"].id.get_num_chunks() == 5


def test_a_chunk_is_what_hdf5_would_have_written(tmp_path: Path) -> None:
    values = table(64)
    with h5py.File(tmp_path / "d.h5", "w") as file:
        data = file.create_dataset("x", data=values, chunks=(64, 3), compression="gzip", shuffle=True)
        _, theirs = data.id.read_direct_chunk((0, 0))
    assert zlib.decompress(packed(values)) == zlib.decompress(theirs)


def test_chunks_that_fit_are_taken_as_they_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a finished dataset that is prolonged only the last chunk is compressed again."""
    values = table(100)
    with under_construction(tmp_path / "first.h5", ROWS) as made:
        made["rates"].add(values[:ROWS])
        made["energy"].add(values[:ROWS, 1])
    compressed: list[int] = []

    def counted(part: np.ndarray) -> bytes:
        compressed.append(part.size)
        return packed(part)

    monkeypatch.setattr(chunks, "packed", counted)
    with h5py.File(tmp_path / "first.h5", "r") as first, under_construction(tmp_path / "d.h5", 100) as made:
        for name, column in (("rates", values), ("energy", values[:, 1])):
            assert made[name].add_chunks_of(first[name]) == 64
            made[name].add(first[name][64:])
            assert made[name].add_chunks_of(first[name]) == 0  # not in the middle of a chunk
            made[name].add(column[ROWS:])
    assert sorted(compressed) == [16] * 3 + [48] * 3
    with h5py.File(tmp_path / "d.h5", "r") as file:
        assert file["rates"][:].tobytes() == values.tobytes()
        assert file["energy"][:].tobytes() == values[:, 1].tobytes()
