"""Atomic replacement of files and folders, so that none is ever seen half-written.

New content is written under a hidden name next to its destination, which no other process uses, synced to
disk and then renamed; so a file with its final name is whole, whatever kills the process or fills the disk.
"""

import io
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path next to ``path`` for a file that replaces it when the block ends without an error."""
    path.parent.stat()  # a missing parent folder is reported before the work is done
    temporary = _hidden(path, "partial")
    try:
        yield temporary
        descriptor = os.open(temporary, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        os.replace(temporary, path)
        sync_folder(path.parent)
    except BaseException:
        with suppress(OSError):  # of a file system that became read-only; what matters is the first error
            temporary.unlink(missing_ok=True)
        raise


@contextmanager
def replacing_folder(path: Path) -> Iterator[Path]:
    """The same for a folder, in two steps if there is one already: a rename can't replace a folder with
    files.
    """
    temporary, old = _hidden(path, "partial"), _hidden(path, "replaced")
    try:
        yield temporary
        if path.exists():
            os.replace(path, old)
        os.replace(temporary, path)
    finally:
        for leftover in (temporary, old):
            shutil.rmtree(leftover, ignore_errors=True)


def _hidden(path: Path, what: str) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.{what}")


def sync_folder(folder: Path) -> None:
    """Make new names in a folder outlast a loss of power."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_bytes(path: Path, content: bytes | memoryview) -> None:
    """Write a small file atomically."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)


class Sink(io.FileIO):
    """A new file, open for reading and writing, that never reports an error to HDF5 itself.

    HDF5 keeps data that it couldn't write, tries again while it closes, and then crashes the process (seen
    with HDF5 2.0 on a full disk). So the first error is kept, later writes are dropped, and it is raised
    afterwards.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+")
        self._size = 0
        self.error: OSError | None = None

    def check(self) -> None:
        """Raise the error that was kept, if any."""
        if self.error is not None:
            raise self.error

    def seek(self, offset: int, whence: int = 0) -> int:
        """As for any file; dropped writes count as done."""
        return super().seek(self._size + offset) if whence == 2 else super().seek(offset, whence)

    def readinto(self, buffer: Any) -> int:
        """As for any file; dropped data read as zeros."""
        view = memoryview(buffer).cast("B")
        done = 0
        while done < len(view) and (count := super().readinto(view[done:])):
            done += count
        view[done:] = bytes(len(view) - done)
        return len(view)

    def write(self, content: Any) -> int:
        """Write everything, or nothing after an error."""
        view = memoryview(content).cast("B")
        start, done = self.tell(), 0
        try:
            while done < len(view) and self.error is None:
                done += super().write(view[done:])
        except OSError as error:
            self.error = error
        self.seek(start + len(view))
        self._size = max(self._size, start + len(view))
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        """Resize the file, as HDF5 does when it closes one."""
        self._size = self.tell() if size is None else size
        try:
            super().truncate(self._size)
        except OSError as error:
            self.error = self.error or error
        return self._size


@contextmanager
def sink(path: Path) -> Iterator[Sink]:
    """A file into which one HDF5 file can be written inside the block."""
    with Sink(path) as opened:
        try:
            yield opened
        except Exception:
            opened.check()  # HDF5's own errors on dropped data add nothing
            raise
    opened.check()
