"""Rows waiting for their segment: whole chunks are compressed as soon as they are full, the rest stays as it
is.

A segment's chunks that coincide with the dataset's are copied into it unchanged, so that
each is compressed once, and while the next samples are being integrated.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future

import numpy as np

from rigidsim.store.chunks import ChunkedVariable, Compressor, RowCutter
from rigidsim.store.netcdf import CHUNK_ROWS, Block, Created
from rigidsim.store.netcdf_file import write_rows
from rigidsim.store.variables import Variable


class CollectedRows:
    """The rows since the last segment.

    Args:
        first: index of the first row; chunks are compressed if it begins one.
    """

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
