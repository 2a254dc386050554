"""Chunks of rows compressed outside HDF5, several at a time, in the format of its shuffle and gzip filters.

HDF5 compresses one chunk after the other with zlib, which is most of the CPU time of writing a dense run.
ISA-L (by python-isal) gives the same format in a tenth of it; where it isn't installed zlib does.
"""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

import h5py
import numpy as np
from h5py import h5d, h5z

try:
    from isal.isal_zlib import compress as _deflate

    _LEVEL = 1  # levels 2 and 3 take 1.2 and 2.2 times as long for 0.02 and 0.2 % less
except ImportError:
    from zlib import compress as _deflate

    _LEVEL = 4

_MOST_THREADS = 4  # more of them wait for the disk
_MOST_WAITING = 64  # chunks, of 64 kB for each component
_FEWEST_FOR_THREADS = 250_000  # numbers: some milliseconds of work


def packed(values: np.ndarray) -> bytes:
    """Doubles as they stand in a chunk: all first bytes, all second bytes, ..., deflated."""
    octets = np.ascontiguousarray(values, "<f8").view(np.uint8).reshape(-1, 8)
    return bytes(_deflate(np.ascontiguousarray(octets.T), _LEVEL))


class ChunkWriter:
    """Writes chunks in the order in which they come, while later ones are compressed."""

    def __init__(self, pool: ThreadPoolExecutor | None) -> None:
        self._pool = pool
        self._waiting: deque[tuple[h5d.DatasetID, tuple[int, ...], Future[bytes]]] = deque()

    def put(self, target: h5d.DatasetID, place: tuple[int, ...], values: np.ndarray) -> None:
        """Compress a whole chunk, and write it now or later.

        Args:
            place: of its first number.
            values: not to be changed from now on.
        """
        if self._pool is None:
            target.write_direct_chunk(place, packed(values))
            return
        self._waiting.append((target, place, self._pool.submit(packed, values)))
        if len(self._waiting) > _MOST_WAITING:
            self._write_next()

    def finish(self) -> None:
        """Write what waits."""
        while self._waiting:
            self._write_next()

    def _write_next(self) -> None:
        target, place, content = self._waiting.popleft()
        target.write_direct_chunk(place, content.result())


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class ChunkedVariable:
    """The chunks of one compressed variable, filled with rows as they come.

    Args:
        target: created with chunks along its first dimension alone.
    """

    def __init__(self, target: h5d.DatasetID, writer: ChunkWriter) -> None:
        self._target = target
        self._writer = writer
        self._shape: tuple[int, ...] = target.get_create_plist().get_chunk()
        self._first = self._filled = 0
        self._open = np.zeros(self._shape)

    def add(self, values: np.ndarray) -> None:
        """Take rows: doubles in any shape of that many numbers, not to be changed from now on."""
        rows = self._shape[0]
        values = np.asarray(values, "<f8").reshape(-1, *self._shape[1:])
        taken = min(rows - self._filled, len(values)) if self._filled else 0
        if taken:
            self._open[self._filled : self._filled + taken] = values[:taken]
            self._filled += taken
            if self._filled == rows:
                self._put(self._open)
                self._open, self._filled = np.zeros(self._shape), 0
        while len(values) - taken >= rows:
            self._put(values[taken : taken + rows])
            taken += rows
        rest = len(values) - taken
        if rest:
            self._open[:rest] = values[taken:]
            self._filled = rest

    def add_chunks_of(self, saved: h5py.Dataset) -> int:
        """Take whole chunks of another file as they are, if they are made like these; returns their rows."""
        rows = self._shape[0]
        if self._filled or saved.chunks != self._shape or not _packed_alike(saved.id):
            return 0
        whole = len(saved) // rows
        for number in range(whole):
            mask, content = saved.id.read_direct_chunk((number * rows, *self._place[1:]))
            if mask:  # filters that were left out
                return number * rows
            self._target.write_direct_chunk(self._place, content)
            self._first += rows
        return whole * rows

    def finish(self) -> None:
        """Write the last chunk, which is a whole one in the file whatever rows there are."""
        if self._filled:
            self._put(self._open)

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
    """The chunks of compressed variables, whose rows are added inside the block; written when it ends.

    Threads compress where there is enough to do.
    """
    numbers = sum(math.prod(target.shape) for target in variables.values())
    threads = min(_MOST_THREADS, _processors()) if numbers >= _FEWEST_FOR_THREADS else 1
    pool = ThreadPoolExecutor(threads, "rigidsim-chunks") if threads > 1 else None
    writer = ChunkWriter(pool)
    chunks = {name: ChunkedVariable(target, writer) for name, target in variables.items()}
    try:
        yield chunks
        for variable in chunks.values():
            variable.finish()
        writer.finish()
    finally:
        if pool is not None:  # after an error or Ctrl-C nobody needs what waits
            pool.shutdown(cancel_futures=True)
