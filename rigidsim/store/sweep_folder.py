"""The folder of a sweep: ``config.toml``, ``tiles/``, ``dataset.h5``, ``summary.json``."""

from __future__ import annotations

import fcntl
import json
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.errors import FORCE, OUT, RESUME, RunFolderError, StoppedWritingError, once_mended
from rigidsim.scene.records import dataclass
from rigidsim.store import atomic
from rigidsim.store.sweep_generation import Generation
from rigidsim.store.sweep_tile import Tile, read_tile

KIND = "sweep"
_GENERATION = re.compile(r"g(\d{3})\.json")


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
