"""The folder of a sweep: ``config.toml``, ``tiles/``, ``dataset.h5``, ``summary.json``."""

import fcntl
import json
import os
import re
import secrets
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.errors import FORCE, OUT, RESUME, RunFolderError
from rigidsim.store import atomic
from rigidsim.store.folder import FileOf, WorkFolder
from rigidsim.store.sweeps.tiles import Generation, Tile, read_tile

KIND = "sweep"
_GENERATION = re.compile(r"g(\d{3})\.json")


@dataclass(frozen=True)
class SweepFolder(WorkFolder):
    """Paths of one sweep, and what is stored there."""

    kind = KIND
    kept = "the tiles that are complete stay"
    resumed = "computes the others"
    seen_by = fcntl.LOCK_EX

    tiles = FileOf("tiles")
    """Folder of generations and their tiles."""
    data = FileOf("data")
    """Folder with copies of the data of a sweep of fits."""

    @property
    def is_sweep(self) -> bool:
        """Whether the folder holds a sweep."""
        return self.tiles.is_dir() or self.read_summary().get("kind") == KIND

    def read_summary(self) -> dict[str, Any]:
        """Contents of ``summary.json``; empty if there is none."""
        try:
            content = json.loads(self.summary.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return content if isinstance(content, dict) else {}

    def generations(self) -> list[Generation]:
        """All of them, the oldest first; RunFolderError for a damaged one."""
        if not self.tiles.is_dir():
            return []
        found = [(path, _GENERATION.fullmatch(path.name)) for path in sorted(self.tiles.iterdir())]
        return [Generation.read(path, int(match[1])) for path, match in found if match]

    def finished_config(self) -> list[str]:
        """The config of a finished sweep whose tiles may be gone, as far as it is there; empty if none is."""
        if not self.dataset.exists():
            return []
        try:
            return [self.config.read_text(encoding="utf-8")]
        except (OSError, ValueError):
            return [""]  # that of no sweep

    def add(self, generation: Generation, *, exclusive: bool = False) -> Generation:
        """Write a generation, whose tiles may then be computed, and return the one that is stored: with
        ``exclusive`` other processes may write the same one at the same time, and the first counts.
        """
        self.tiles.mkdir(parents=True, exist_ok=True)
        path = self.generation_file(generation)
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

    def generation_file(self, generation: Generation) -> Path:
        """Path of a generation; a session that begins to work on it makes the time of its file its own."""
        return self.tiles / f"g{generation.number:03d}.json"

    def tile(self, generation: Generation, tile: int) -> Path:
        """Path of a tile."""
        return self.tiles / f"g{generation.number:03d}-{tile:07d}.h5"

    def present(self, generation: Generation) -> np.ndarray:
        """Which tiles of a generation exist, (tiles,) bool."""
        there = np.zeros(generation.tiles, dtype=bool)
        pattern = re.compile(rf"g{generation.number:03d}-(\d{{7}})\.h5")
        if self.tiles.is_dir():
            for entry in os.scandir(self.tiles):
                match = pattern.fullmatch(entry.name)
                if match and int(match[1]) < len(there):
                    there[int(match[1])] = True
        return there

    def read(self, generation: Generation, tile: int) -> Tile:
        """Read and check a tile; RunFolderError if it is damaged, or isn't the one that belongs there."""
        path = self.tile(generation, tile)
        again = f"remove it, and {RESUME} computes it again"
        try:
            found = read_tile(path, generation.config_sha256)
        except RunFolderError as error:
            raise RunFolderError(f"{error}; {again}") from None
        if not np.array_equal(found.members, generation.members_of(tile)):
            raise RunFolderError(f"{path}: holds other members than belong there; {again}")
        return found

    def save(self, generation: Generation, tile: int, image: bytes) -> None:
        """Write a tile; on return it is saved."""
        atomic.write_bytes(self.tile(generation, tile), image)

    def begin(self, *, force: bool) -> None:
        """Make the folder ready; RunFolderError if it holds something else, or can't be written."""
        ours = ["config.toml", "tiles", "data", "dataset.h5", "summary.json"]
        try:
            present = self.content([*ours, *(path.name for path in self.path.glob("figure*"))])
            self.path.mkdir(parents=True, exist_ok=True)
            if not (self.is_sweep or force or all(name.startswith(".") for name in present)):
                raise RunFolderError(f"{self.path}: holds a run; {FORCE} replaces it, another {OUT} or name "
                                     "puts the sweep elsewhere")  # fmt: skip
            if force:
                for path in (self.summary, self.dataset, self.config):
                    path.unlink(missing_ok=True)
                for folder in (self.tiles, self.data):
                    if folder.exists():
                        shutil.rmtree(folder)
            self.remove_torn()
        except OSError as error:
            raise self.unwritable(error) from None

    def remove_torn(self) -> None:
        """Delete partial files that killed processes were writing."""
        for folder in (self.path, self.tiles, self.data):
            for path in folder.glob(".*.partial"):
                if not _alive(path):
                    path.unlink(missing_ok=True)


def _alive(partial: Path) -> bool:
    """Whether the process that writes a temporary file is still running (on this machine)."""
    number = partial.name.split(".")[-2]
    return number.isdigit() and Path(f"/proc/{number}").exists()


def is_sweep(path: str | Path) -> bool:
    """Whether a path is the folder of a sweep, or a file in one."""
    given = Path(path)
    try:
        return SweepFolder(given if given.is_dir() else given.parent).is_sweep
    except OSError:
        return False
