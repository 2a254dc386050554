"""Immutable segments, by which samples reach the disk while a run is under way.

Each segment holds rows and a checkpoint, sealed, written once and never changed. The first is a labelled
dataset, which says what the rows of all are. A sample is saved when its segment has its final name; a crash
can only cost later ones. Each names the run that it belongs to and the seal of the one before, so that a
missing, foreign or old one is noticed.
"""

import io
import os
import shutil
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.errors import RESUME, RunFolderError, StoppedWritingError, once_mended
from rigidsim.store import atomic, netcdf
from rigidsim.store.atomic import sink
from rigidsim.store.netcdf import ChunkedVariable
from rigidsim.store.seal import check_seal, refuse_special, seal, seal_of, sealed
from rigidsim.store.variables import Extra, Variable

REMOVED = ".segments.removed"
"""Name to which segments are moved before they are deleted."""
_ROWS_AT_ONCE = 16 * netcdf.CHUNK_ROWS
Arrays = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class SegmentLimits:
    """When a segment is due: by the size of the collected rows (as much again is in memory while it is
    assembled), or by the time since the latest one, which is what a crash can cost. One takes some 20 ms.
    """

    bytes: int = 16_000_000
    seconds: float = 30.0


@dataclass(frozen=True)
class Chain:
    """The segments of a run that belong together; what is wrong with the first that doesn't, if any, and
    which are spoiled: that one and all after it. The run's identity is empty without segments.
    """

    paths: list[Path] = field(default_factory=list)
    rows: int = 0
    run: str = ""
    seal: str = ""
    damage: str | None = None
    spoiled: list[Path] = field(default_factory=list)


class SegmentWriter:
    """Collects blocks and writes them as segments in a folder ``segments/``, which is created."""

    def __init__(
        self,
        folder: Path,
        variables: Sequence[Variable],
        attributes: Mapping[str, Any],
        chain: Chain | None = None,
        limits: SegmentLimits | None = None,
    ) -> None:
        chain = chain or Chain()
        self._limits = limits or SegmentLimits()
        self._folder = folder
        self._variables = variables
        self._attributes = dict(attributes)
        self._blocks: list[netcdf.Block] = []
        self._saved = time.monotonic()
        self._row_bytes = 8 * sum(v.parts * int(np.prod(v.shape)) for v in variables)
        self._seal = chain.seal
        self.saved_rows = chain.rows
        self.count = len(chain.paths)
        self.dataset_sha256 = ""  # of the complete dataset's file, once there is one
        with self._writing():
            folder.mkdir(parents=True, exist_ok=True)
            atomic.sync_folder(folder.parent)

    def add(self, block: netcdf.Block) -> None:
        """Take a block of samples."""
        self._blocks.append(block)

    @property
    def _rows(self) -> int:
        return sum(len(block["time"][0]) for block in self._blocks)

    @property
    def rows(self) -> int:
        """All rows so far, saved or not."""
        return self.saved_rows + self._rows

    @property
    def due(self) -> bool:
        """Whether a segment is due: the collected rows are large, or the last segment is old."""
        large = self._rows * self._row_bytes >= self._limits.bytes
        return large or time.monotonic() - self._saved >= self._limits.seconds

    def flush(self, checkpoint: Arrays, events: Arrays) -> None:
        """Write the collected rows, possibly just the checkpoint; on return they are saved."""
        place = {"segment": self.count, "first_sample": self.saved_rows, "previous_seal": self._seal}
        content = self._image(self._blocks, checkpoint, events, place)
        path = self._folder / f"{self.count:08d}.h5"
        with self._writing():
            atomic.write_bytes(path, content)
        self._seal = seal_of(content)
        self.count += 1
        self.saved_rows += self._rows
        self._blocks = []
        self._saved = time.monotonic()

    def _image(
        self, blocks: Sequence[netcdf.Block], checkpoint: Arrays, events: Arrays, place: Mapping[str, Any]
    ) -> memoryview:
        """A whole segment in memory."""
        buffer = io.BytesIO()
        with netcdf.writing(buffer) as file:
            attributes = {**self._attributes, **place}
            netcdf.write_blocks(file, self._variables, blocks, attributes, labelled=place["segment"] == 0)
            file.group("checkpoint", checkpoint)
            file.group("events", events)
        return sealed(buffer)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise StoppedWritingError(
                f"{self._folder.parent}: can't be written: {error.strerror or error}; "
                f"{self.saved_rows} samples are saved in {self._folder.name}/; "
                f"{once_mended(error)}, {RESUME} continues from there"
            ) from error

    def complete(
        self,
        target: Path,
        attributes: Mapping[str, Any],
        extras: Sequence[Extra] = (),
        *,
        unused: Collection[str] = (),
        checkpoint: tuple[Path, Arrays, Arrays] | None = None,
        conclude: Callable[[], None] = lambda: None,
        watch: Callable[[str, np.ndarray], None] | None = None,
    ) -> int:
        """Stream all segments, and what is still in memory, into one compressed, sealed dataset.

        The dataset appears atomically; the segments are removed last, in one step: as long as they are there,
        a run that was killed in between is known to be unfinished, and is completed again. Returns its rows.

        Args:
            unused: variables that are zero throughout, and left out.
            checkpoint: where to leave a last checkpoint and all events, from which the run can be prolonged.
            conclude: writes everything else of a complete run; called before the segments are removed.
            watch: sees all rows, by variable and in order, some thousands at once.
        """
        paths = segment_paths(self._folder)
        if len(paths) < self.count:  # rows that nothing fills would read as zeros
            raise RunFolderError(f"{self._folder}: segment {len(paths):08d}.h5 is missing")
        rows = self.rows
        with self._writing(), atomic.replacing(target) as temporary:
            with sink(temporary) as target_file, netcdf.writing(target_file) as file:
                wanted = [variable for variable in self._variables if variable.name not in unused]
                created = netcdf.declare(file, wanted, rows, attributes, compressed=True)
                chunks = {
                    name: ChunkedVariable(variable, watch and partial(watch, name))
                    for name, variable in created.items()
                }
                for path in paths:
                    target_file.check()
                    _copy(path, chunks)
                for block in self._blocks:
                    for variable in wanted:
                        for name, values in zip(variable.part_names(), block[variable.name], strict=True):
                            chunks[name].add(values)
                for chunk in chunks.values():
                    chunk.finish()
                netcdf.add_extras(file, extras)
            content_seal, self.dataset_sha256 = seal(temporary)
        with self._writing():
            if checkpoint is not None:
                path, last, events = checkpoint
                place = {"segment": 1, "first_sample": rows, "previous_seal": content_seal}
                atomic.write_bytes(path, self._image([], last, events, place))
            conclude()
        remove(self._folder)
        return rows


def segment_paths(folder: Path) -> list[Path]:
    """The segments of a run folder in order."""
    paths = _numbered(folder)
    for number, path in enumerate(paths):
        if path.stem != f"{number:08d}":
            raise RunFolderError(f"{folder}: segment {number:08d}.h5 is missing")
    return paths


def _numbered(folder: Path) -> list[Path]:
    """Files named like segments, in order; a folder that can't be listed raises rather than counting as
    empty.
    """
    try:
        names = os.listdir(folder)
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError as error:
        raise RunFolderError(f"{folder}: can't be read: {error.strerror or error}") from None
    return sorted(folder / name for name in names if name[0].isdigit() and name.endswith(".h5"))


def read_chain(folder: Path) -> Chain:
    """The segments that belong together, checked byte by byte, up to the first that doesn't."""
    paths = _numbered(folder)
    run = last = ""
    rows = 0
    for number, path in enumerate(paths):
        try:
            refuse_special(path)
            found = check_seal(path)
            labels = netcdf.root_attributes(path)
            run = run or str(labels.get("run_id", ""))
            damage = _misfit(path, labels, number, rows, run, last)
            if damage is None:
                rows += labels["rows"]
        except RunFolderError as error:
            damage = str(error)
        if damage is not None:
            return Chain(paths[:number], rows, run, last, damage, paths[number:])
        last = found
    return Chain(paths, rows, run, last)


def _misfit(path: Path, labels: Mapping[str, Any], number: int, rows: int, run: str, last: str) -> str | None:
    """Why an intact segment doesn't follow those before it; None if it does."""
    if path.stem != f"{number:08d}":
        return f"{path.parent}: segment {number:08d}.h5 is missing"
    if not run or str(labels.get("run_id", "")) != run:
        return f"{path}: belongs to another run"
    if number == 0 and "previous_seal" not in labels:  # a finished dataset that is being prolonged
        return None
    expected = {"segment": number, "first_sample": rows, "previous_seal": last}
    if any(labels.get(key) != value for key, value in expected.items()):
        return f"{path}: doesn't follow the segment before it; one of them was exchanged"
    return None


def _copy(path: Path, chunks: Mapping[str, ChunkedVariable]) -> None:
    """Append a segment, or a finished dataset that is being prolonged, which may lack variables of zeros."""
    with netcdf.reading(path) as file:
        segment = netcdf.rows_in(file)
        rows = len(segment["time"]) if len(segment) else 0
        for name, chunk in chunks.items():
            for first in range(0, rows, _ROWS_AT_ONCE):
                stop = min(first + _ROWS_AT_ONCE, rows)
                if name in segment:
                    chunk.add(segment[name][first:stop])
                else:
                    chunk.add_zeros(stop - first)


def remove(folder: Path) -> None:
    """Delete the segments of a run whose dataset is complete; for other processes, all at once."""
    gone = folder.with_name(REMOVED)
    shutil.rmtree(gone, ignore_errors=True)
    with suppress(FileNotFoundError):
        folder.replace(gone)
        atomic.sync_folder(folder.parent)
    shutil.rmtree(gone, ignore_errors=True)
