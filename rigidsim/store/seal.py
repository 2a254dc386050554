"""Seals: a file's last bytes hold the SHA-256 of all others, so that damage is known before anything is read.

HDF5 readers ignore bytes after the end of their data. A file without a seal was torn, or written by another
program.
"""

import hashlib
import io
import stat
from pathlib import Path

from rigidsim.errors import RunFolderError
from rigidsim.store.netcdf import check_version, root_attributes

_MARK = b"\nrigidsim sha256 "
_LENGTH = len(_MARK) + 64 + 1


def sealed(content: io.BytesIO) -> memoryview:
    """The content with its seal appended in place, since it may be large."""
    digest = hashlib.sha256(content.getbuffer()).hexdigest()
    content.seek(0, io.SEEK_END)
    content.write(_MARK + digest.encode() + b"\n")
    return content.getbuffer()


def seal_of(content: memoryview) -> str:
    """The digest in the seal of sealed content."""
    return bytes(content[-65:-1]).decode()


def seal(path: Path) -> tuple[str, str]:
    """Append the seal to a file; returns the digests of its content and of the sealed file."""
    with path.open("rb") as file:
        running = hashlib.file_digest(file, "sha256")
    digest = running.hexdigest()
    mark = _MARK + digest.encode() + b"\n"
    with path.open("ab") as file:
        file.write(mark)
    running.update(mark)
    return digest, running.hexdigest()


def refuse_special(path: Path) -> None:
    """Refuse anything but a plain file: a link shows another file's content, a pipe never ends."""
    try:
        mode = path.lstat().st_mode
    except OSError as error:
        raise RunFolderError(f"{path}: can't be read: {error.strerror or error}") from None
    if stat.S_ISLNK(mode):
        raise RunFolderError(f"{path}: is a symbolic link, which no run writes; remove it")
    if not stat.S_ISREG(mode):
        raise RunFolderError(f"{path}: is no file, but a folder, pipe or device; remove it")


def check_seal(path: Path) -> str:
    """The digest of a sealed file, verified against its content."""
    return check_whole(path)[0]


def check_whole(path: Path) -> tuple[str, str]:
    """Like ``check_seal``, but also returns the digest of the file including its seal."""
    torn = RunFolderError(f"{path}: is torn or foreign: its end holds no seal of rigidsim")
    if not path.is_file():
        raise torn
    try:
        with path.open("rb") as file:
            left = max(0, file.seek(0, 2) - _LENGTH)
            file.seek(left)
            tail = file.read()
            if len(tail) != _LENGTH or not (tail.startswith(_MARK) and tail.endswith(b"\n")):
                raise torn
            running = hashlib.sha256()
            file.seek(0)
            while left > 0 and (piece := file.read(min(left, 1 << 20))):
                running.update(piece)
                left -= len(piece)
    except OSError as error:
        raise RunFolderError(f"{path}: can't be read: {error.strerror or error}") from None
    claimed = tail[len(_MARK) : -1].decode("ascii", "replace")
    if running.hexdigest() != claimed:
        raise RunFolderError(f"{path}: is damaged or was edited: its content isn't what its seal says")
    running.update(tail)
    return claimed, running.hexdigest()


def refuse_damaged(path: Path, expected: str | None) -> None:
    """Check a run's complete dataset against its seal, and against the SHA-256 that the summary next to it
    gives, if any.
    """
    _, digest = check_whole(path)
    labels = root_attributes(path)
    check_version(labels.get("schema_version"), path)
    if "segment" in labels:
        raise RunFolderError(f"{path}: is a segment of an unfinished run, no complete dataset")
    if expected not in (None, digest):
        raise RunFolderError(f"{path}: isn't the dataset for which the summary.json next to it was written")
