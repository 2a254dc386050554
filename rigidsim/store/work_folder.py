"""A folder in which one process at a time works: names of its files, its lock, and messages about faults."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from rigidsim.errors import OUT, RESUME, RunFolderError, StoppedWritingError, once_mended


class FileOf:
    """A file of a folder, by its name there."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, folder: WorkFolder, owner: type[WorkFolder]) -> Path:
        return folder.path / self._name


@dataclass(frozen=True)
class WorkFolder:
    """Common base of the folders of runs and sweeps.

    Attributes:
        kept: what remains when writing stops, for messages.
        resumed: what the command that resumes does with the rest, for messages.
        seen_by: the lock (of ``fcntl``) by which it is seen whether a process is at work: a shared one
            disturbs nobody else who looks, an exclusive one sees those that share the work too.
    """

    path: Path
    kept: ClassVar[str]
    resumed: ClassVar[str]
    seen_by: ClassVar[int]

    config = FileOf("config.toml")
    """The config that is run, one visible value per key."""
    dataset = FileOf("dataset.h5")
    """The dataset, once the work is finished."""
    summary = FileOf("summary.json")
    """The summary: how the work ended and what it cost."""

    @contextmanager
    def locked(self, *, shared: bool = False) -> Iterator[None]:
        """Keep out other processes (but those that share the work) inside the block; the lock disappears with
        the process, however it ends.
        """
        try:
            self.refuse_a_file()
            self.path.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(self.path, os.O_RDONLY)  # the folder itself: no file is left behind
        except OSError as error:
            raise self.unwritable(error) from None
        try:
            try:
                fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
            except OSError:
                raise RunFolderError(
                    f"{self.path}: another process is at work there; wait for it, or choose another {OUT} or "
                    "name"
                ) from None
            try:
                yield
            except OSError as error:
                raise StoppedWritingError(
                    f"{self.path}: can't be read or written: {error.filename or 'a file'}: "
                    f"{error.strerror or error}; {self.kept}, and {once_mended(error)}, {RESUME} "
                    f"{self.resumed}"
                ) from error
        finally:
            os.close(descriptor)

    @property
    def at_work(self) -> bool:
        """Whether a process is at work here, as far as can be told."""
        try:
            descriptor = os.open(self.path, os.O_RDONLY)
        except OSError:
            return False
        try:
            fcntl.flock(descriptor, self.seen_by | fcntl.LOCK_NB)
        except OSError:
            return True
        finally:
            os.close(descriptor)
        return False

    def refuse_a_file(self) -> None:
        """Refuse a plain file in the folder's place."""
        if self.path.exists() and not self.path.is_dir():
            raise RunFolderError(f"{self.path}: is no folder; choose another {OUT} or name")

    def unwritable(self, error: OSError) -> RunFolderError:
        """The error to raise if nothing can be written."""
        return RunFolderError(
            f"{self.path}: can't be written: {error.strerror or error}; choose another {OUT}"
        )
