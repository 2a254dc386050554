"""Atomic replacement of files and folders, so that none is ever seen half-written.

New content is written under a hidden name beside its destination, which no other process uses, synced to
disk and then renamed; so a file with its final name is whole, whatever kills the process or fills the disk.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path`` for a file that replaces it when the block ends without an error."""
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
