"""A file object for HDF5 that never reports an error to HDF5 itself.

HDF5 keeps data that it couldn't write, tries again while it closes, and then crashes the process (seen with
HDF5 2.0 on a full disk). So the first error is kept here, later writes are dropped, and the error is raised
afterwards.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


class Sink(io.RawIOBase):
    """A new file, open for reading and writing.

    Attributes:
        error: the first error; the content is worthless after it.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._file = path.open("w+b", buffering=0)
        self._size = 0
        self.error: OSError | None = None

    def check(self) -> None:
        """Raise the error that was kept, if any."""
        if self.error is not None:
            raise self.error

    def readable(self) -> bool:
        """True."""
        return True

    def writable(self) -> bool:
        """True."""
        return True

    def seekable(self) -> bool:
        """True."""
        return True

    def seek(self, offset: int, whence: int = 0) -> int:
        """As for any file; dropped writes count as done."""
        if whence == 2:
            offset, whence = self._size + offset, 0
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """As for any file."""
        return self._file.tell()

    def readinto(self, buffer: Any) -> int:
        """As for any file; dropped data read as zeros."""
        view = memoryview(buffer).cast("B")
        done = 0
        while done < len(view):
            count = self._file.readinto(view[done:])
            if not count:
                view[done:] = bytes(len(view) - done)
                break
            done += count
        return len(view)

    def write(self, content: Any) -> int:
        """Write everything, or nothing after an error."""
        view = memoryview(content).cast("B")
        start = self._file.tell()
        done = 0
        try:
            while done < len(view) and self.error is None:
                done += self._file.write(view[done:])
        except OSError as error:
            self.error = error
        if done < len(view):
            self._file.seek(start + len(view))
        self._size = max(self._size, start + len(view))
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        """Resize the file, as HDF5 does when it closes one."""
        wanted = self._file.tell() if size is None else size
        try:
            self._file.truncate(wanted)
        except OSError as error:
            self.error = self.error or error
        self._size = wanted
        return wanted

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        super().close()


@contextmanager
def sink(path: Path) -> Iterator[Sink]:
    """A file into which one HDF5 file can be written inside the block."""
    opened = Sink(path)
    try:
        yield opened
    except Exception:
        opened.check()  # HDF5's own errors on dropped data tell nothing new
        raise
    finally:
        opened.close()
    opened.check()
