"""Rows on their way into files: collected, and compressed outside HDF5 in the format of its gzip filter.

HDF5 compresses one chunk after the other with zlib, which is most of the CPU time of writing a dense run.
ISA-L (through python-isal) gives the same format in a tenth of it; without it, zlib is used.
"""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

import h5py
import numpy as np
from h5py import h5d, h5z

from rigidsim.store.netcdf import CHUNK_ROWS, Block, Created, write_rows
from rigidsim.store.variables import Variable

try:
    from isal.isal_zlib import compress as _deflate

    _LEVEL = 1  # levels 2 and 3 take 1.2 and 2.2 times as long for 0.02 and 0.2 % less
except ImportError:
    from zlib import compress as _deflate

    _LEVEL = 4
_MOST_THREADS = 4  # more wait for the disk
_FEWEST = 250_000  # numbers to compress from which on threads are used: some milliseconds of work
_WAITING = 64  # chunks of 64 kB per component that may wait to be written


def packed(values: np.ndarray) -> bytes:
    """Doubles as stored in a chunk: all first bytes, all second bytes, ..., deflated."""
    octets = np.ascontiguousarray(values, "<f8").view(np.uint8).reshape(-1, 8)
    return bytes(_deflate(np.ascontiguousarray(octets.T), _LEVEL))


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
    """Cuts rows into chunks of a shape as they arrive; ``filled`` rows don't fill one yet."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._shape = shape
        self._open = np.zeros(shape)
        self.filled = 0

    def cut(self, values: np.ndarray) -> Iterator[np.ndarray]:
        """Take rows of doubles, which must not be changed afterwards, and yield the chunks that they
        complete.
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


class CollectedRows:
    """The rows since the last segment; chunks are compressed if the first row begins one."""

    def __init__(self, variables: Sequence[Variable], first: int, compressor: Compressor) -> None:
        self.rows = 0
        self._variables = variables
        self._compressor = compressor
        self._fitting = first % CHUNK_ROWS == 0
        self._blocks: list[Block] = []
        self._packed: dict[str, list[Future[bytes]]] = {}
        self._cutters: dict[str, RowCutter] = {}
        for variable in variables:
            for name in variable.part_names():
                self._packed[name] = []
                self._cutters[name] = RowCutter((CHUNK_ROWS, *variable.shape))

    @property
    def compressed(self) -> bool:
        """Whether the rows are written as chunks; less than one chunk isn't worth it."""
        return self._fitting and self.rows >= CHUNK_ROWS

    def add(self, block: Block) -> None:
        """Take the rows that follow."""
        self.rows += len(block["time"][0])
        if not self._fitting:
            self._blocks.append(block)
            return
        for variable in self._variables:
            for name, values in zip(variable.part_names(), block[variable.name], strict=True):
                for chunk in self._cutters[name].cut(values):
                    self._packed[name].append(self._compressor.packed(chunk))

    def write(self, created: Created) -> None:
        """Write the rows into a segment whose variables were declared for this count, compressed or not."""
        if self.compressed:
            self._write_chunks(created)
        elif self._fitting:
            for name, cutter in self._cutters.items():
                write_rows(created[name], 0, cutter.rest)
        else:
            joined = JoinedBlocks(self._blocks, self._variables)
            for variable in self._variables:
                for name, values in zip(variable.part_names(), joined[variable.name], strict=True):
                    write_rows(created[name], 0, values)

    def _write_chunks(self, created: Created) -> None:
        for name, cutter in self._cutters.items():
            last = [self._compressor.packed(cutter.last.copy())] if cutter.filled else []
            beside = (0,) * (cutter.last.ndim - 1)
            for number, chunk in enumerate(self._packed[name] + last):
                created[name].write_direct_chunk((number * CHUNK_ROWS, *beside), chunk.result())

    def add_to(self, chunks: Mapping[str, ChunkedVariable]) -> None:
        """Append the rows of the given variables to a dataset that already has all segments."""
        for block in self._blocks:
            for variable in self._variables:
                for name, values in zip(variable.part_names(), block[variable.name], strict=True):
                    if name in chunks:
                        chunks[name].add(values)
        for name, cutter in self._cutters.items():
            if name not in chunks:
                continue
            for chunk in self._packed[name]:
                chunks[name].add_packed(chunk.result())
            chunks[name].add(cutter.rest)


class JoinedBlocks(Mapping[str, Sequence[np.ndarray]]):
    """Concatenation of blocks; only the variable being read is in memory twice."""

    def __init__(self, blocks: Sequence[Block], variables: Sequence[Variable]) -> None:
        self._blocks = blocks
        self._parts = {v.name: v.parts for v in variables}

    def __getitem__(self, name: str) -> list[np.ndarray]:
        return [self._column(name, part) for part in range(self._parts[name])]

    def _column(self, name: str, part: int) -> np.ndarray:
        """One part of a variable, row by row as it is stored in a file; blocks are stored column by
        column.
        """
        pieces = [block[name][part] for block in self._blocks]
        rows = sum(len(piece) for piece in pieces)
        return np.concatenate(pieces, out=np.empty((rows, *pieces[0].shape[1:])))

    def __iter__(self) -> Iterator[str]:
        return iter(self._parts)

    def __len__(self) -> int:
        return len(self._parts)
