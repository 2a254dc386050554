"""The folder of a sweep: ``config.toml``, ``tiles/``, ``dataset.h5``, ``summary.json``."""

import fcntl
import hashlib
import json
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter

from rigidsim.errors import FORCE, OUT, RunFolderError
from rigidsim.store import atomic
from rigidsim.store.folder import FileOf, WorkFolder

KIND = "sweep"


@dataclass(frozen=True)
class Begun:
    """What a sweep was begun with.

    Attributes:
        members, tiles: that were to be computed for this config.
        tile: members of a block of the sweep, of which a tile holds those that were missing.
        alone: whether all members run one by one though some might share equations, as was found when the
            first members were run; None if that wasn't asked.
    """

    config: str
    config_sha256: str
    members: int
    tiles: int
    tile: Annotated[int, Field(ge=1)]
    alone: bool | None


@dataclass(frozen=True)
class SweepFolder(WorkFolder):
    """Paths of one sweep, and what is stored there."""

    kind = KIND
    kept = "the tiles that are complete stay"
    resumed = "computes the others"
    seen_by = fcntl.LOCK_EX

    tiles = FileOf("tiles")
    """Folder of the tiles, and of what they were begun with."""
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

    @property
    def note(self) -> Path:
        """File of ``begun``; a session that begins to work on the sweep makes the file's time its own."""
        return self.tiles / "sweep.json"

    @property
    def begun(self) -> Begun | None:
        """What the sweep was begun with; None if it wasn't, or if its tiles were deleted.

        Raises:
            RunFolderError: it is damaged, or of a version whose tiles aren't read; a finished one opens.
        """
        try:
            return TypeAdapter(Begun).validate_json(self.note.read_bytes())
        except FileNotFoundError:
            if not any(self.tiles.glob("g*.json")) or self.dataset.exists():
                return None
            why = "begun by a version of rigidsim that this one can't go on with"
        except (OSError, ValueError) as error:
            why = f"damaged ({str(error).splitlines()[0]})"
        raise RunFolderError(f"{self.note}: is {why}; {FORCE} runs all members again")

    def begin(self, begun: Begun) -> None:
        """Write what is begun with. Several processes that share a sweep write the same."""
        self.tiles.mkdir(parents=True, exist_ok=True)
        atomic.write_bytes(self.note, json.dumps(asdict(begun)).encode())
        atomic.write_bytes(self.config, begun.config.encode())

    def tile_files(self, config_sha256: str = "") -> list[Path]:
        """The tiles there are, or those that were computed for a config."""
        return sorted(self.tiles.glob(f"t{config_sha256[:8]}*.h5"))

    def tile_file(self, config_sha256: str, block: int, keys: np.ndarray, items: Sequence[str]) -> Path:
        """Where the tile with these members of a block is saved."""
        content = hashlib.sha256(keys.tobytes() + " ".join(items).encode()).hexdigest()
        return self.tiles / f"t{config_sha256[:8]}-{block:07d}-{content[:8]}.h5"

    def claim(self, *, force: bool) -> None:
        """Make the folder ready; RunFolderError if it holds something else, or can't be written."""
        ours = ["config.toml", "tiles", "data", "dataset.h5", "summary.json"]
        try:
            present = self.content([*ours, *(path.name for path in self.path.glob("figure*"))])
            if not (self.is_sweep or force or all(name.startswith(".") for name in present)):
                raise RunFolderError(f"{self.path}: holds a run; {FORCE} replaces it, another {OUT} or name "
                                     "puts the sweep elsewhere")  # fmt: skip
            for path in (self.summary, self.dataset, self.config) if force else ():
                path.unlink(missing_ok=True)
            for folder in (self.tiles, self.data) if force else ():
                shutil.rmtree(folder, ignore_errors=True)
            for folder in (self.path, self.tiles, self.data):
                for path in folder.glob(".*.partial"):  # of a process that was killed on this machine
                    if not Path(f"/proc/{path.name.split('.')[-2]}").exists():
                        path.unlink(missing_ok=True)
        except OSError as error:
            raise self.unwritable(error) from None


def is_sweep(path: str | Path) -> bool:
    """Whether a path is the folder of a sweep, or a file in one."""
    given = Path(path)
    try:
        return SweepFolder(given if given.is_dir() else given.parent).is_sweep
    except OSError:
        return False
