"""Errors that a user can act on: what was given, what is allowed, what to do, and where."""

from __future__ import annotations

import errno
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

_MOST_SHOWN = 30
_T = TypeVar("_T")


def required(part: _T | None) -> _T:
    """The part itself, which the caller knows to be there: without it the code is wrong, not the input."""
    assert part is not None
    return part


class Wording:
    """Whether remedies are worded as commands and options, which only a command's process asks for."""

    commands = False

    @classmethod
    @contextmanager
    def of_commands(cls) -> Iterator[None]:
        """Word remedies as commands and options meanwhile."""
        before, cls.commands = cls.commands, True
        try:
            yield
        finally:
            cls.commands = before


@dataclass(frozen=True)
class Remedy:
    """What to do, for the command line and in Python; its text is the one that the reader can use."""

    command: str
    python: str

    def __str__(self) -> str:
        return self.command if Wording.commands else self.python


FORCE = Remedy("--force", "force=True")
OUT = Remedy("--out", "out")
RESUME = Remedy("rigidsim resume", "rigidsim.resume(...)")
SWEEP = Remedy("rigidsim sweep", "rigidsim.sweep(...)")
VIEW = Remedy("rigidsim view", "run.view()")


def run_again(folder: Path) -> str:
    """What to do about a damaged file in a run's folder, which only a copy or another run replaces."""
    config = folder / "config.toml"
    command = Remedy(f"rigidsim run {config} --out ELSEWHERE", f'rigidsim.run("{config}", out=...)')
    again = command if config.is_file() else "run its config again"
    return f"copy it again from an intact copy, or make it again: {again}"


class RigidsimError(Exception):
    """Base of all errors that rigidsim raises on purpose; its text is meant for the user."""

    exit_code = 2


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong in a config.

    Attributes:
        where: the key as it stands in the file, for instance ``[body] principal_moments[1]``.
        what: what was given, what is allowed and what to do.
    """

    where: str
    what: str

    def __str__(self) -> str:
        return _visible(f"{self.where}: {self.what}")


def _visible(text: str) -> str:
    """The text with control characters escaped, so that a terminal shows them instead of obeying."""
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)


class ConfigError(RigidsimError):
    """The config can't be run; ``problems`` lists everything that is wrong, not only the first."""

    def __init__(self, problems: Sequence[Problem] | Problem, source: str | None = None) -> None:
        self.problems = [problems] if isinstance(problems, Problem) else list(problems)
        self.source = source
        super().__init__(problems, source)

    def __str__(self) -> str:  # formed when it is read: most errors are only made for ``ensure``
        lines = "\n".join(f"  {problem}" for problem in self.problems[:_MOST_SHOWN])
        if len(self.problems) > _MOST_SHOWN:
            lines += f"\n  and {len(self.problems) - _MOST_SHOWN} more"
        head = f"{_visible(self.source)}: " if self.source else ""
        count = len(self.problems)
        return f"{head}{count} problem{'s' if count > 1 else ''} in the config\n{lines}"

    def at(self, source: str) -> ConfigError:
        """The same error with the file that it came from."""
        return ConfigError(self.problems, source)


def ensure(holds: object, error: Exception) -> None:
    """Raise an error unless a condition holds."""
    if not holds:
        raise error


class MemberError(ConfigError):
    """A member of a sweep can't be run; ``problems`` name the member besides the key."""


class RunFolderError(RigidsimError):
    """A run folder is missing, unfinished, damaged, in use, or would be overwritten."""


class StoppedError(RigidsimError):
    """A run could not go on; the last good state was kept."""

    exit_code = 3


class StoppedWritingError(RunFolderError, StoppedError):
    """A run's folder can't be written any more; what was saved stays."""


_ONCE = {
    errno.ENOSPC: "once there is room",
    errno.EDQUOT: "once there is room",
    errno.EFBIG: "once files may be larger",
    errno.EROFS: "once its file system is mounted for writing again",
    errno.EACCES: "once it may be written",
    errno.EPERM: "once it may be written",
}


def once_mended(error: OSError) -> str:
    """What has to happen before a place that couldn't be written can be written again."""
    return _ONCE.get(error.errno or 0, "once that is mended")
