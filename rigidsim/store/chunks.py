"""Chunks of rows compressed outside HDF5, several at a time, in the format of its shuffle and gzip filters.

HDF5 compresses one chunk after the other with zlib, which is most of the CPU time of writing a dense run.
ISA-L (through python-isal) gives the same format in a tenth of it; without it, zlib is used.
"""

from __future__ import annotations

import math
import os
import zlib
from collections import deque
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

import h5py
import numpy as np
from h5py import h5d, h5z

try:
    from isal import isal_zlib

    _DEFLATE, _LEVEL = (
        isal_zlib.compress,
        1,
    )  # the next levels take 1.2 and 2.2 times as long for 0.2 %
except ImportError:
    _DEFLATE, _LEVEL = zlib.compress, 4
_MOST_THREADS = 4  # more wait for the disk
_FEWEST = 250_000  # numbers to compress from which on threads are used: some milliseconds of work
_WAITING = 64  # chunks of 64 kB per component that may wait to be written


def packed(values: np.ndarray) -> bytes:
    """Doubles as stored in a chunk: all first bytes, all second bytes, ..., deflated."""
    octets = np.ascontiguousarray(values, "<f8").view(np.uint8).reshape(-1, 8)
    return bytes(_DEFLATE(np.ascontiguousarray(octets.T), _LEVEL))


class Compressor:
    """Compresses chunks, in threads as soon as there is enough to do; call ``close`` at the end."""

    def __init__(self) -> None:
        self._pool: ThreadPoolExecutor | None = None
        self._numbers = 0

    def packed(self, chunk: np.ndarray) -> Future[bytes]:
        """Compress a whole chunk, now or later; it mustn't change afterwards."""
        self._numbers += chunk.size
        if self._pool is None and self._numbers > _FEWEST and _processors():
            self._pool = ThreadPoolExecutor(min(_MOST_THREADS, _processors()), "rigidsim-chunks")
        if self._pool is not None:
            return self._pool.submit(packed, chunk)
        done: Future[bytes] = Future()
        done.set_result(packed(chunk))
        return done

    def close(self) -> None:
        """End the threads and drop work that hasn't begun."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool, self._numbers = None, 0


class ChunkWriter:
    """Writes chunks in the order in which they arrive, while later ones are being compressed."""

    def __init__(self, compressor: Compressor) -> None:
        self._compressor = compressor
        self._waiting: deque[tuple[h5d.DatasetID, tuple[int, ...], Future[bytes]]] = deque()

    def put(self, target: h5d.DatasetID, place: tuple[int, ...], values: np.ndarray) -> None:
        """Compress a whole chunk and write it at an index, now or later; it mustn't change afterwards."""
        self._waiting.append((target, place, self._compressor.packed(values)))
        while self._waiting and (len(self._waiting) > _WAITING or self._waiting[0][2].done()):
            self._write_next()

    def finish(self) -> None:
        """Write all chunks that are still waiting."""
        while self._waiting:
            self._write_next()

    def _write_next(self) -> None:
        target, place, content = self._waiting.popleft()
        target.write_direct_chunk(place, content.result())


def _processors() -> int:
    """Number of processors idle of late: beside other work, threads save no time and cost a fifth more."""
    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    busy = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    return max(0, round(there - busy))


class RowCutter:
    """Cuts rows into chunks as they arrive.

    Attributes:
        filled: rows that don't fill a chunk yet.

    Args:
        shape: shape of a chunk.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._shape = shape
        self._open = np.zeros(shape)
        self.filled = 0

    def cut(self, values: np.ndarray) -> Iterator[np.ndarray]:
        """Take rows and yield the chunks that they complete.

        Args:
            values: doubles in any shape of that many numbers; must not be changed afterwards.
        """
        rows = self._shape[0]
        values = np.asarray(values, "<f8").reshape(-1, *self._shape[1:])
        taken = min(rows - self.filled, len(values)) if self.filled else 0
        if taken:
            self._open[self.filled : self.filled + taken] = values[:taken]
            self.filled += taken
            if self.filled == rows:
                full, self._open, self.filled = self._open, np.zeros(self._shape), 0
                yield full
        while len(values) - taken >= rows:
            taken += rows
            yield values[taken - rows : taken]
        rest = len(values) - taken
        if rest:
            self._open[:rest] = values[taken:]
            self.filled = rest

    @property
    def rest(self) -> np.ndarray:
        """The rows that don't fill a chunk."""
        return self._open[: self.filled]

    @property
    def last(self) -> np.ndarray:
        """The remaining rows as a chunk, which has full size in a file however few rows there are."""
        return self._open


class ChunkedVariable:
    """Chunks of one compressed variable, filled with rows as they arrive."""

    def __init__(self, target: h5d.DatasetID, writer: ChunkWriter) -> None:
        self._target = target
        self._writer = writer
        self._shape: tuple[int, ...] = target.get_create_plist().get_chunk()
        self._first = 0
        self._cutter = RowCutter(self._shape)

    def add(self, values: np.ndarray) -> None:
        """Take rows: doubles in any shape of that many numbers, which must not be changed afterwards."""
        for chunk in self._cutter.cut(values):
            self._put(chunk)

    def add_zeros(self, count: int) -> None:
        """Append ``count`` rows of zeros."""
        for start in range(0, count, self._shape[0]):
            self.add(np.zeros((min(self._shape[0], count - start), *self._shape[1:])))

    def add_packed(self, content: bytes) -> None:
        """Append a compressed chunk as it is; no incomplete chunk may be waiting."""
        if self._cutter.filled:
            raise AssertionError("a whole chunk in the middle of another")
        self._target.write_direct_chunk(self._place, content)
        self._first += self._shape[0]

    def add_chunks_of(self, saved: h5py.Dataset) -> int:
        """Copy whole chunks of another file unchanged if they are laid out like these; returns the rows
        copied.
        """
        rows = self._shape[0]
        if self._cutter.filled or saved.chunks != self._shape or not _packed_alike(saved.id):
            return 0
        whole = len(saved) // rows
        for number in range(whole):
            mask, content = saved.id.read_direct_chunk((number * rows, *self._place[1:]))
            if mask:  # some filters were left out
                return number * rows
            self.add_packed(content)
        return whole * rows

    def finish(self) -> None:
        """Write the last chunk, which has full size in the file however few rows there are."""
        if self._cutter.filled:
            self._put(self._cutter.last)

    @property
    def _place(self) -> tuple[int, ...]:
        return (self._first, *(0 for _ in self._shape[1:]))

    def _put(self, values: np.ndarray) -> None:
        self._writer.put(self._target, self._place, values)
        self._first += self._shape[0]


def _packed_alike(saved: h5d.DatasetID) -> bool:
    how = saved.get_create_plist()
    filters = [how.get_filter(number)[0] for number in range(how.get_nfilters())]
    doubles = saved.dtype == np.dtype("<f8") and math.prod(saved.shape[1:]) > 0
    return doubles and filters == [h5z.FILTER_SHUFFLE, h5z.FILTER_DEFLATE]


@contextmanager
def chunked(variables: Mapping[str, h5d.DatasetID]) -> Iterator[dict[str, ChunkedVariable]]:
    """Compressed variables to which rows are added inside the block; everything is written when it ends."""
    compressor = Compressor()
    writer = ChunkWriter(compressor)
    chunks = {name: ChunkedVariable(target, writer) for name, target in variables.items()}
    try:
        yield chunks
        for variable in chunks.values():
            variable.finish()
        writer.finish()
    finally:
        compressor.close()  # after an error or Ctrl-C nobody needs the waiting chunks
