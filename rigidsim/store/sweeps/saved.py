"""Sweeps on disk, finished or not: their summary, and how far they are."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import Field, ValidationError

from rigidsim.errors import RESUME, RunFolderError
from rigidsim.store.folder import SweepFolder, folder_at
from rigidsim.store.run import Saved, SavedRun, open_run
from rigidsim.store.seal import check_seal, refuse_damaged
from rigidsim.store.summary import Brief, SummaryPart, first_of

if TYPE_CHECKING:
    import xarray


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


class SweepSummary(Brief):
    """Contents of a sweep's ``summary.json``; of an unfinished one, what its tiles say.

    Attributes:
        members_done, tiles, tiles_done: of an unfinished sweep alone.
        shape: members along each dimension.
        axes: key of each axis.
        outcomes, warned: number of members by how they ended, and by what they are warned of.
        engines: number of members by what ran them.
        why_alone: code of the reason why members were run one by one.
        fitted: by key what fits estimated.
        mixed_provenance: what differs between tiles, if anything.
    """

    kind: str = "sweep"
    status: str = ""
    members: int = 0
    members_done: int = 0
    tiles: int | None = None
    tiles_done: int = 0
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
class SavedSweep(Saved):
    """A sweep on disk, finished or not; of an unfinished one, ``outcome`` is what its tiles say."""

    folder: SweepFolder
    outcome: SweepSummary

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


def open_sweep(path: str | Path) -> SavedSweep:
    """Open the folder of a sweep, or the dataset in it, finished or not.

    Raises:
        RunFolderError: there is no sweep.
    """
    folder = folder_at(path)
    if not isinstance(folder, SweepFolder):
        raise RunFolderError(f"{path}: no sweep here; give the folder of one (runs/NAME)")
    return SavedSweep(folder, _so_far(folder))


def open_saved(path: str | Path) -> SavedRun | SavedSweep:
    """Open a run or a sweep; errors as of ``open_run`` and ``open_sweep``."""
    return open_sweep(path) if isinstance(folder_at(path), SweepFolder) else open_run(path)


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
        config_sha256=begun.config_sha256,
    )
