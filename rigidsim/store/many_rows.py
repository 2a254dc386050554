"""Tables of very many rows: worked on by blocks, and kept in a temporary file rather than in memory.

Such a file has no name, so that it is gone with the array or the process, however that ends. Its arrays are
ordinary ones, which can't be written to; the memory of their pages is let go of after each block. Tables of
few rows are arrays in memory, by the same calls.
"""

from __future__ import annotations

import mmap
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from typing import IO
from weakref import WeakSet

import numpy as np

from rigidsim.errors import RigidsimError

BLOCK = 65_536  # rows that are worked on together
_HELD = 16 * 2**20  # bytes, up to which a table stays in memory
_PIECE = 64  # rows anywhere in a file, each of which brings a dozen pages with it
_SAMPLED = 1_000_000  # values, up to which a median is that of all
_opened: WeakSet[mmap.mmap] = WeakSet()


def blocks_of(count: int, multiple: int = 1) -> Iterator[slice]:
    """Blocks of rows, of lengths that are multiples of a number; what each has read is let go of after it."""
    length = multiple * max(1, BLOCK // multiple)
    for begin in range(0, count, length):
        yield slice(begin, min(begin + length, count))
        let_go()


def let_go() -> None:
    """Give back the memory of what was read of files; it stays there, and is read again when needed."""
    if hasattr(mmap, "MADV_DONTNEED"):
        for pages in list(_opened):
            pages.madvise(mmap.MADV_DONTNEED)


def gathered(parts: Iterable[np.ndarray]) -> np.ndarray:
    """Parts (rows, ...) of one shape and type, one below the other, in a temporary file if they are many.

    Raises:
        RigidsimError: the folder of temporary files is full, or nothing can be written there.
    """
    held: list[np.ndarray] = []
    size = 0
    with ExitStack() as stack:
        file: IO[bytes] | None = None
        for part in parts:
            held.append(part)
            size += part.nbytes
            if size > _HELD:
                with _explained(size):
                    file = file or stack.enter_context(
                        tempfile.TemporaryFile(prefix="rigidsim-", buffering=0)
                    )
                    for one in held:
                        _write(file, np.ascontiguousarray(one))
                held = [part[:0]]
        if file is None:
            return np.concatenate(held)
        with _explained(size):
            pages = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    _opened.add(pages)
    return np.frombuffer(pages, held[0].dtype).reshape(-1, *held[0].shape[1:])


def _write(file: IO[bytes], values: np.ndarray) -> None:
    left = values.reshape(-1).view(np.uint8).data
    while len(left):  # a disk that fills up takes a part
        left = left[file.write(left) :]


@contextmanager
def _explained(size: int) -> Iterator[None]:
    """Tell what to do where rows can't be written."""
    try:
        yield
    except OSError as error:
        where = f" in {tempfile.tempdir}" if tempfile.tempdir else ""
        raise RigidsimError(
            f"{size / 1e6:,.0f} MB of rows can't be kept in a temporary file{where} "
            f"({error.strerror or error}); make room, or set TMPDIR to a folder that has it"
        ) from None


def picked(values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Rows anywhere in a table, in memory."""
    found = np.empty((len(rows), *values.shape[1:]), values.dtype)
    for begin in range(0, len(rows), _PIECE):
        found[begin : begin + _PIECE] = values[rows[begin : begin + _PIECE]]
        let_go()
    return found


def largest(values: np.ndarray) -> float:
    """The largest absolute value."""
    return max(float(np.abs(values[rows]).max()) for rows in blocks_of(len(values)))


def mean_square(values: np.ndarray) -> float:
    """Mean of the squares of values (rows,)."""
    return float(sum(np.sum(values[rows] ** 2) for rows in blocks_of(len(values))) / len(values))


def usual(values: Callable[[slice], np.ndarray], count: int) -> float:
    """Median of what a function gives for blocks of rows; of a million of them, if there are more."""
    stride = -(-count // _SAMPLED)
    return float(np.median(np.concatenate([values(rows)[::stride] for rows in blocks_of(count)])))


def usual_step(times: np.ndarray) -> float:
    """Median of the steps between rows, from times (rows,)."""
    return usual(lambda rows: steps_of(times, rows), len(times) - 1)


def steps_of(times: np.ndarray, rows: slice) -> np.ndarray:
    """Steps from each row of a block to the next row."""
    return np.diff(times[rows.start : rows.stop + 1])


def flagged(flags: Callable[[slice], np.ndarray], count: int) -> tuple[int, int]:
    """How many rows a function of blocks flags, and the first of them (-1: none)."""
    number, first = 0, -1
    for rows in blocks_of(count):
        found = np.flatnonzero(flags(rows))
        if len(found) and first < 0:
            first = rows.start + int(found[0])
        number += len(found)
    return number, first
