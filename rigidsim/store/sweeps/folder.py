"""Sweeps on disk: the folder with ``config.toml``, ``tiles/``, ``dataset.h5`` and ``summary.json``, and how
far a sweep is.
"""

import fcntl
import hashlib
import json
import shutil
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from rigidsim.errors import FORCE, OUT, RESUME, RunFolderError
from rigidsim.store import atomic
from rigidsim.store.folder import FileOf, WorkFolder
from rigidsim.store.seal import check_seal, refuse_damaged
from rigidsim.store.summary import SummaryPart, first_of

if TYPE_CHECKING:
    import xarray


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
            why = "was begun by a version of rigidsim that this one can't go on with"
        except (OSError, ValueError) as error:
            why = f"is damaged ({str(error).splitlines()[0]})"
        raise RunFolderError(f"{self.note}: {why}; {FORCE} runs all members again")

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


_RECENT = 20  # tiles from which the rate is determined


class SweepCost(SummaryPart):
    """What all members cost: CPU and wall seconds of their tiles, and of the session that completed them."""

    steps: int
    cpu_seconds: float
    wall_seconds_of_tiles: float
    tiles: int
    estimate_cpu_seconds: float = 0.0
    session_wall_seconds: float
    session_cpu_seconds: float


class ErrorsOfMembers(SummaryPart):
    """Announced errors of the members that have one, in ``units``."""

    members: int
    median: float
    largest: float
    units: str


class FittedOfMembers(SummaryPart):
    """A number that each of these ``members`` of a sweep of fits estimated: median and standard deviation of
    the values, and the median of the fits' own sigmas (None if it is undetermined), in ``unit``.
    """

    members: int
    median: float
    spread: float
    sigma: float | None
    unit: str


class SweepSummary(SummaryPart):
    """Contents of a sweep's ``summary.json``; of an unfinished one, what its tiles say.

    Attributes:
        members_done, tiles, tiles_done, members_per_second, seconds_left: of an unfinished sweep alone.
        shape: members along each dimension.
        axes: key of each axis.
        outcomes, warned: number of members by how they ended, and by what they are warned of.
        engines: number of members by what ran them.
        why_alone: code of the reason why members were run one by one.
        fitted: by key what fits estimated.
        mixed_provenance: what differs between tiles, if anything.
    """

    kind: str = "sweep"
    name: str = ""
    description: str = ""
    status: str = ""
    message: str = ""
    exit_code: int = 0
    members: int = 0
    members_done: int = 0
    tiles: int | None = None
    tiles_done: int = 0
    members_per_second: float | None = None
    seconds_left: float | None = None
    shape: dict[str, int] = Field(default_factory=dict)
    axes: dict[str, str] = Field(default_factory=dict)
    keep: list[str] = Field(default_factory=list)
    outcomes: dict[str, int] = Field(default_factory=dict)
    warned: dict[str, int] = Field(default_factory=dict)
    warnings: list[str] = Field(default_factory=list)
    warning_codes: list[str] = Field(default_factory=list)
    engines: dict[str, int] = Field(default_factory=dict)
    why_alone: str | None = None
    cost: SweepCost | None = None
    largest_drifts: dict[str, float] = Field(default_factory=dict)
    estimated_errors: dict[str, ErrorsOfMembers] = Field(default_factory=dict)
    fitted: dict[str, FittedOfMembers] = Field(default_factory=dict)
    config_sha256: str = ""
    provenance: dict[str, str] = Field(default_factory=dict)
    mixed_provenance: str | None = None
    dataset_sha256: str | None = None


@dataclass(frozen=True, repr=False)
class SavedSweep:
    """A sweep on disk, finished or not; of an unfinished one, ``outcome`` is what its tiles say."""

    folder: SweepFolder
    outcome: SweepSummary

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The content of ``summary.json``."""
        return self.outcome.as_dict()

    @property
    def place(self) -> str:
        """Path of the sweep's folder."""
        return str(self.folder.path)

    @property
    def files(self) -> list[Path]:
        """Its folder, in which nothing may be written over."""
        return [self.folder.path]

    @property
    def status(self) -> str:
        """Status of the sweep: "finished", "running", "interrupted" ..."""
        return self.outcome.status

    @property
    def finished(self) -> bool:
        """Whether all members are complete."""
        return self.status == "finished"

    @property
    def dataset(self) -> "xarray.Dataset":
        """All members, read lazily.

        Raises:
            RunFolderError: the sweep isn't finished, or its dataset is damaged.
        """
        from rigidsim.store.reader import open_dataset

        if not self.folder.dataset.exists():
            raise RunFolderError(f"{self.place}: has no dataset.h5 yet; {RESUME} completes it")
        self._refuse_damaged_dataset()
        return open_dataset(self.folder.dataset)

    def refuse_damaged(self) -> None:
        """Check the files of a complete sweep against their seals, which reads all of them."""
        if self.folder.dataset.exists():
            self._refuse_damaged_dataset()
        for path in sorted(self.folder.tiles.glob("*.h5")):
            try:
                check_seal(path)
            except RunFolderError as error:
                raise RunFolderError(
                    f"{error}; remove it: dataset.h5, which holds its members, is whole, and a longer sweep "
                    "computes them again"
                    if self.finished
                    else f"{error}; remove it, and {RESUME} computes it again"
                ) from None

    def _refuse_damaged_dataset(self) -> None:
        try:
            refuse_damaged(self.folder.dataset, self.outcome.dataset_sha256)
        except RunFolderError as error:
            again = f"; remove it, and {RESUME} writes it again" if self.folder.tiles.is_dir() else ""
            raise RunFolderError(f"{error}{again}") from None

    def __repr__(self) -> str:
        return f"<Sweep {self.outcome.name!r} ({self.place}): {self.status}>"


def open_sweep(path: str | Path) -> SavedSweep:
    """Open the folder of a sweep, or the dataset in it, finished or not.

    Raises:
        RunFolderError: there is no sweep.
    """
    given = Path(path)
    folder = SweepFolder(given if given.is_dir() else given.parent)
    if not folder.is_sweep:
        raise RunFolderError(f"{path}: no sweep here; give the folder of one (runs/NAME)")
    return SavedSweep(folder, _so_far(folder))


def _so_far(folder: SweepFolder) -> SweepSummary:
    """The summary; for an unfinished sweep, what its tiles say."""
    try:
        summary = SweepSummary.model_validate(folder.read_summary())
    except ValidationError as error:
        why = first_of(error)
        raise RunFolderError(f"{folder.summary}: is damaged or no summary of rigidsim ({why})") from None
    begun = folder.begun
    if begun is None or (summary.status == "finished" and summary.config_sha256 == begun.config_sha256):
        return summary
    from rigidsim.store.sweeps.tiles import read_tile  # which a run doesn't need

    files = folder.tile_files(begun.config_sha256)
    done = min(sum(len(read_tile(path, whole=False).keys) for path in files), begun.members)
    busy = folder.at_work
    words = "a process is at work on it" if busy else "the tiles that are complete are kept"
    rate = _rate(folder, files, begun.tile) if busy else None
    return SweepSummary(
        kind="sweep",
        name=folder.path.name,
        status="running" if busy else "interrupted",
        message=f"{done:,} of {begun.members:,} members to be run are done; {words}",
        exit_code=0 if busy else 130,
        members=begun.members,
        members_done=done,
        tiles=begun.tiles,
        tiles_done=len(files),
        members_per_second=rate,
        seconds_left=(begun.members - done) / rate if rate else None,
        config_sha256=begun.config_sha256,
    )


def _rate(folder: SweepFolder, files: Sequence[Path], members: int) -> float | None:
    """Members per second of the session that is at work, by the times of its latest tiles."""
    begun = folder.note.stat().st_mtime
    times = sorted([begun, *(when for path in files if (when := path.stat().st_mtime) > begun)])[-_RECENT:]
    span = max(time.time(), times[-1]) - times[0]
    return members * (len(times) - 1) / span if len(times) > 1 and span > 0 else None
