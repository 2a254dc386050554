"""Immutable segments: how samples reach the disk while a run is under way.

Each segment is a complete small dataset, written once and never touched again. A sample is saved when its
segment has its final name; a crash can only cost what came after.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5netcdf
import numpy as np

from rigidsim.errors import RunFolderError
from rigidsim.store import netcdf
from rigidsim.store.variables import Extra, Variable

SEGMENT_BYTES = 32_000_000
SEGMENT_SECONDS = 30.0
_CHUNKS_AT_ONCE = 16


class SegmentWriter:
    """Collects blocks and writes a segment when they are many or old.

    Args:
        folder: ``segments/`` of a run folder; created.
        variables: of the dataset, time first.
        attributes: root attributes that make a segment readable on its own.
    """

    def __init__(self, folder: Path, variables: Sequence[Variable], attributes: Mapping[str, Any]) -> None:
        self._folder = folder
        self._variables = variables
        self._attributes = dict(attributes)
        self._blocks: list[netcdf.Block] = []
        self._rows = 0
        self._oldest = 0.0
        self._row_bytes = 8 * sum(v.parts * int(np.prod(v.shape)) for v in variables)
        self.saved_rows = 0
        self.count = 0
        folder.mkdir(parents=True, exist_ok=True)

    def add(self, block: netcdf.Block) -> None:
        """Take a block of samples; writes a segment when due."""
        rows = len(block["time"][0])
        if not rows:
            return
        if not self._blocks:
            self._oldest = time.monotonic()
        self._blocks.append(block)
        self._rows += rows
        self.flush_if_due()

    def flush_if_due(self) -> None:
        """Write what is collected when it is large, or old enough that losing it would hurt."""
        large = self._rows * self._row_bytes >= SEGMENT_BYTES
        if self._blocks and (large or time.monotonic() - self._oldest >= SEGMENT_SECONDS):
            self.flush()

    def flush(self) -> None:
        """Write what is collected; on return it is saved.

        Raises:
            RunFolderError: the disk is full or fails; what is collected stays in memory.
        """
        if not self._blocks:
            return
        attributes = {**self._attributes, "segment": self.count, "first_sample": self.saved_rows}
        content = netcdf.image(self._variables, self._collected(), self._rows, attributes)
        with self._writing():
            netcdf.write_bytes(self._folder / f"{self.count:08d}.h5", content)
        self.count += 1
        self.saved_rows += self._rows
        self._blocks, self._rows = [], 0

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise RunFolderError(
                f"{self._folder.parent}: can't be written: {error.strerror or error}; "
                f"{self.saved_rows} samples are saved in {self._folder.name}/"
            ) from error

    def _collected(self) -> netcdf.Block:
        return {
            v.name: [
                np.concatenate([block[v.name][part] for block in self._blocks]) for part in range(v.parts)
            ]
            for v in self._variables
        }

    def complete(self, target: Path, attributes: Mapping[str, Any], extras: Sequence[Extra] = ()) -> int:
        """Stream all segments, and what is still in memory, into one compressed dataset.

        The dataset appears atomically; then the segments go. Returns its rows.

        Raises:
            RunFolderError: a segment is missing, or the disk is full or fails; the segments stay.
        """
        paths = segment_paths(self._folder)
        if len(paths) < self.count:  # rows that nothing fills would read as zeros
            raise RunFolderError(f"{self._folder}: segment {len(paths):08d}.h5 is missing")
        rows = self.saved_rows + self._rows
        with self._writing(), netcdf.atomic(target) as temporary:
            with h5netcdf.File(temporary, "w") as file:
                netcdf.declare(file, self._variables, rows, attributes, compressed=True)
                first = 0
                for path in paths:
                    first += _copy(path, file, self._variables, first)
                if self._blocks:
                    netcdf.fill(file, self._variables, self._collected(), first, self._rows)
                netcdf.add_extras(file, extras)
        remove(self._folder)
        return rows


def segment_paths(folder: Path) -> list[Path]:
    """The segments of a run folder in order.

    Raises:
        RunFolderError: one is missing in the sequence.
    """
    paths = sorted(folder.glob("[0-9]*.h5"))
    for number, path in enumerate(paths):
        if path.stem != f"{number:08d}":
            raise RunFolderError(f"{folder}: segment {number:08d}.h5 is missing")
    return paths


def _copy(path: Path, file: Any, variables: Sequence[Variable], first: int) -> int:
    """Copy one segment piece by piece, along the target's chunks so that none is compressed twice."""
    with h5netcdf.File(path, "r") as segment:
        rows = int(segment.dimensions["time"].size)
        start = 0
        while start < rows:
            to_boundary = netcdf.CHUNK_ROWS - (first + start) % netcdf.CHUNK_ROWS
            stop = min(rows, start + to_boundary + (_CHUNKS_AT_ONCE - 1) * netcdf.CHUNK_ROWS)
            for variable in variables:
                for name in variable.part_names():
                    file.variables[name][first + start : first + stop] = segment.variables[name][start:stop]
            start = stop
    return rows


def remove(folder: Path) -> None:
    """Delete the segments of a run whose dataset is complete."""
    shutil.rmtree(folder, ignore_errors=True)
