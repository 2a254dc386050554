"""Writing a rerun recording to a file: with strict errors, its layout, and never on a full disk."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.error_utils import set_strict_mode, strict_mode

from rigidsim.look.page import legible

CHUNK = 4096  # rows per chunk: larger ones make the viewer slow, smaller ones heavy
_ROW_BYTES = 600  # at most: some twenty variables
_FIRST_BYTES = 1024 * _ROW_BYTES  # bodies, layout, page


def chunks(first: int, count: int) -> Iterator[slice]:
    """The rows from the first to the last, ``CHUNK`` at a time."""
    return (slice(start, min(start + CHUNK, count)) for start in range(first, count, CHUNK))


@dataclass
class Recording:
    """A recording of this name that is written to a file."""

    stream: rr.RecordingStream
    path: Path
    name: str

    def start(self, blueprint: rrb.Blueprint) -> None:
        """Open the file and send its layout."""
        self.stream.save(self.path, default_blueprint=blueprint)
        self.stream.send_recording_name(legible(self.name))


@contextmanager
def recording_to(path: Path, name: str, rows: int) -> Iterator[Recording]:
    """A recording of at most so many rows that is whole when the block ends.

    Raises:
        RuntimeError: the environment variable RERUN switches recording off.
        OSError: there is no room for it.
    """
    check_room(path, rows)
    with strict():
        # The context manager finishes the file: without it there is no footer.
        with rr.RecordingStream("rigidsim") as stream:
            if not rr.is_enabled(stream):
                raise RuntimeError("RERUN is set to off in the environment: unset it")
            yield Recording(stream, path, name)


@contextmanager
def strict() -> Iterator[None]:
    """Turn errors of the rerun API into exceptions inside the block.

    Otherwise wrong lengths, shapes and times are dropped with a warning.
    """
    before = strict_mode()
    set_strict_mode(True)
    try:
        yield
    finally:
        set_strict_mode(before)


def check_room(path: Path, rows: int) -> None:
    """Refuse if there is too little room, before rerun finds the disk full and may wait for ever."""
    room, needed = shutil.disk_usage(path.parent).free, _FIRST_BYTES + _ROW_BYTES * rows
    if room < needed:
        missing = f"it may need {needed / 1e6:.1f} MB, and {room / 1e6:.1f} MB are free"
        raise OSError(errno.ENOSPC, missing, str(path))
