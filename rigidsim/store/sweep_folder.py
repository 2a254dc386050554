"""The folder of a sweep: ``config.toml``, ``tiles/``, ``dataset.h5``, ``summary.json``.

A generation is a config with the members that were missing when it was given, in tiles of so many. A sweep
begins with one; a longer axis or one more output adds another, whose tiles hold only what was new.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.errors import FORCE, OUT, RESUME, RunFolderError, StoppedWritingError, once_mended
from rigidsim.scene.records import dataclass
from rigidsim.store import atomic
from rigidsim.store.sweep_tile import Tile, read_tile

KIND = "sweep"
_GENERATION = re.compile(r"g(\d{3})\.json")


@dataclass(frozen=True)
class Work:
    """Members of which the same is to be computed.

    Attributes:
        keep: of what is kept.
        ranges: [first, stop) of the members, ascending.
    """

    keep: tuple[str, ...]
    ranges: tuple[tuple[int, int], ...]

    @property
    def count(self) -> int:
        """Of members."""
        return sum(stop - first for first, stop in self.ranges)

    def members(self, first: int, stop: int) -> np.ndarray:
        """The members at places first ... stop-1 among these."""
        found, before = [np.zeros(0, dtype=np.int64)], 0
        for begin, end in self.ranges:
            low, high = max(first - before, 0), min(stop - before, end - begin)
            if low < high:
                found.append(np.arange(begin + low, begin + high))
            before += end - begin
        return np.concatenate(found)

    def places(self, members: np.ndarray) -> np.ndarray:
        """The places of members among these; -1 where one isn't."""
        begins = np.array([first for first, _ in self.ranges], dtype=np.int64)
        sizes = np.array([stop - first for first, stop in self.ranges], dtype=np.int64)
        before = np.concatenate([[0], np.cumsum(sizes)[:-1]])
        which = np.searchsorted(begins, members, side="right") - 1
        offset = members - begins[which]
        inside = (which >= 0) & (members >= 0) & (offset < sizes[which])
        return np.where(inside, before[which] + offset, -1)


def ranges_of(members: np.ndarray) -> tuple[tuple[int, int], ...]:
    """Ascending members as ranges."""
    if not len(members):
        return ()
    breaks = np.flatnonzero(np.diff(members) != 1)
    firsts = members[np.concatenate([[0], breaks + 1])]
    lasts = members[np.concatenate([breaks, [len(members) - 1]])]
    return tuple((int(a), int(b) + 1) for a, b in zip(firsts, lasts, strict=True))


@dataclass(frozen=True)
class Generation:
    """A config with what was to be computed for it.

    Attributes:
        number: from 0.
        config: TOML text.
        length: of a tile, members.
        works: in order; tiles are numbered through them.
    """

    number: int
    config: str
    length: int
    works: tuple[Work, ...]

    @property
    def config_sha256(self) -> str:
        """Of the TOML text."""
        return hashlib.sha256(self.config.encode()).hexdigest()

    @cached_property
    def tile_counts(self) -> tuple[int, ...]:
        """Tiles of each work."""
        return tuple(-(-work.count // self.length) for work in self.works)

    @property
    def tiles(self) -> int:
        """How many there are."""
        return sum(self.tile_counts)

    @property
    def members(self) -> int:
        """How many are to be run."""
        return sum(work.count for work in self.works)

    def work_of(self, tile: int) -> tuple[Work, int]:
        """The work that a tile belongs to, and its number within."""
        for work, count in zip(self.works, self.tile_counts, strict=True):
            if tile < count:
                return work, tile
            tile -= count
        raise IndexError(tile)

    def members_of(self, tile: int) -> np.ndarray:
        """The members of a tile."""
        work, number = self.work_of(tile)
        return work.members(number * self.length, (number + 1) * self.length)

    def as_text(self) -> str:
        """For ``gNNN.json``."""
        works = [{"keep": list(work.keep), "ranges": [list(r) for r in work.ranges]} for work in self.works]
        content = {"format": 1, "config": self.config, "length": self.length, "works": works}
        return json.dumps(content) + "\n"

    @classmethod
    def read(cls, path: Path, number: int) -> Generation:
        """From a ``gNNN.json``.

        Raises:
            RunFolderError: damaged.
        """
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            works = tuple(
                Work(tuple(map(str, w["keep"])), tuple((int(a), int(b)) for a, b in w["ranges"]))
                for w in content["works"]
            )
            length = int(content["length"])
            if content["format"] != 1 or length < 1:
                raise ValueError("another format")
            return cls(number, str(content["config"]), length, works)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise RunFolderError(f"{path}: is damaged or of another version ({error})") from None


@dataclass(frozen=True)
class SweepFolder:
    """Paths of one sweep, and what lies there."""

    path: Path

    @property
    def config(self) -> Path:
        """What is run, in one visible value per key."""
        return self.path / "config.toml"

    @property
    def tiles(self) -> Path:
        """Generations and their tiles."""
        return self.path / "tiles"

    @property
    def dataset(self) -> Path:
        """All members, when all are there."""
        return self.path / "dataset.h5"

    @property
    def summary(self) -> Path:
        """How many members ended how, and what it took."""
        return self.path / "summary.json"

    @property
    def is_sweep(self) -> bool:
        """Whether one lies here."""
        return self.tiles.is_dir() or self.read_summary().get("kind") == KIND

    def read_summary(self) -> dict[str, Any]:
        """What ``summary.json`` says; empty without one."""
        try:
            content = json.loads(self.summary.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return content if isinstance(content, dict) else {}

    def generations(self) -> list[Generation]:
        """All of them, the oldest first.

        Raises:
            RunFolderError: one is damaged.
        """
        if not self.tiles.is_dir():
            return []
        found = [(path, _GENERATION.fullmatch(path.name)) for path in sorted(self.tiles.iterdir())]
        return [Generation.read(path, int(match[1])) for path, match in found if match]

    def add(self, generation: Generation, *, exclusive: bool = False) -> Generation:
        """Write a generation, whose tiles may be computed from now on.

        Args:
            exclusive: others may write the same one at the same time; the first counts.

        Returns:
            The one that is there.
        """
        self.tiles.mkdir(parents=True, exist_ok=True)
        path = self.tiles / f"g{generation.number:03d}.json"
        if exclusive:
            mine = self.tiles / f".{path.name}.{secrets.token_hex(8)}.{os.getpid()}.partial"
            mine.write_text(generation.as_text(), encoding="utf-8")
            try:
                os.link(mine, path)
            except FileExistsError:
                return Generation.read(path, generation.number)
            finally:
                mine.unlink(missing_ok=True)
        else:
            atomic.write_bytes(path, generation.as_text().encode())
        atomic.write_bytes(self.config, generation.config.encode())
        return generation

    def tile(self, generation: Generation, tile: int) -> Path:
        """Where a tile lies."""
        return self.tiles / f"g{generation.number:03d}-{tile:07d}.h5"

    def present(self, generation: Generation) -> np.ndarray:
        """Which tiles of a generation are there, (tiles,) bool."""
        there = np.zeros(generation.tiles, dtype=bool)
        pattern = re.compile(rf"g{generation.number:03d}-(\d{{7}})\.h5")
        if self.tiles.is_dir():
            for entry in os.scandir(self.tiles):
                match = pattern.fullmatch(entry.name)
                if match and int(match[1]) < len(there):
                    there[int(match[1])] = True
        return there

    def read(self, generation: Generation, tile: int) -> Tile:
        """A tile, checked.

        Raises:
            RunFolderError: damaged, or not what belongs there.
        """
        path = self.tile(generation, tile)
        found = read_tile(path, generation.config_sha256)
        if not np.array_equal(found.members, generation.members_of(tile)):
            raise RunFolderError(f"{path}: holds other members than belong there; remove it, and {RESUME} "
                                 "computes it again")  # fmt: skip
        return found

    def save(self, generation: Generation, tile: int, image: bytes) -> None:
        """Write a tile; on return it is saved."""
        atomic.write_bytes(self.tile(generation, tile), image)

    def begin(self, *, force: bool) -> None:
        """Make the folder ready for a sweep.

        Raises:
            RunFolderError: something else lies there, or it can't be written.
        """
        ours = {"config.toml", "tiles", "dataset.h5", "summary.json"}
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            there = [p for p in self.path.iterdir() if not p.name.startswith(".")]
            for path in there:
                if path.is_symlink():
                    raise RunFolderError(f"{path}: is a symbolic link, which no sweep writes; remove it")
                if path.name not in ours and not path.name.startswith("figure"):
                    raise RunFolderError(
                        f"{self.path}: holds {path.name}, which no sweep writes; choose another {OUT} or name"
                    )
            if there and not self.is_sweep and not force:
                raise RunFolderError(f"{self.path}: holds a run; {FORCE} replaces it, another {OUT} or name "
                                     "puts the sweep elsewhere")  # fmt: skip
            if force:
                for path in (self.summary, self.dataset, self.config):
                    path.unlink(missing_ok=True)
                if self.tiles.exists():
                    shutil.rmtree(self.tiles)
            self.remove_torn()
        except OSError as error:
            raise RunFolderError(
                f"{self.path}: can't be written: {error.strerror or error}; choose another {OUT}"
            ) from None

    def remove_torn(self) -> None:
        """Delete what killed processes were writing."""
        for folder in (self.path, self.tiles):
            for path in folder.glob(".*.partial"):
                if not _alive(path):
                    path.unlink(missing_ok=True)

    @contextmanager
    def locked(self, *, shared: bool = False) -> Iterator[None]:
        """Keep other processes out; the lock goes with the process, however it ends.

        Args:
            shared: others that compute a share of the tiles may be at work here, too.

        Raises:
            RunFolderError: another process works there, or the folder can't be written.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(self.path, os.O_RDONLY)
        except OSError as error:
            raise RunFolderError(
                f"{self.path}: can't be written: {error.strerror or error}; choose another {OUT}"
            ) from None
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
                    f"{error.strerror or error}; the tiles that are complete stay, and {once_mended(error)}, "
                    f"{RESUME} computes the others"
                ) from error
        finally:
            os.close(descriptor)

    @property
    def busy(self) -> bool:
        """Whether a process is at work here."""
        try:
            descriptor = os.open(self.path, os.O_RDONLY)
        except OSError:
            return False
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return True
        finally:
            os.close(descriptor)
        return False

    def write_summary(self, content: dict[str, Any]) -> None:
        """Write ``summary.json`` atomically."""
        text = json.dumps({"kind": KIND, **content}, indent=2, allow_nan=False)
        atomic.write_bytes(self.summary, (text + "\n").encode())


def _alive(partial: Path) -> bool:
    """Whether the process that writes a temporary file is still there (on this machine)."""
    number = partial.name.split(".")[-2]
    return number.isdigit() and Path(f"/proc/{number}").exists()


def is_sweep(path: str | Path) -> bool:
    """Whether a sweep lies at a folder, or beside a file."""
    given = Path(path)
    try:
        return SweepFolder(given if given.is_dir() else given.parent).is_sweep
    except OSError:
        return False
