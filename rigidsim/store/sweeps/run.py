"""Sweeps on disk: the dataset, read lazily, and the summary."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidsim.errors import RESUME, RunFolderError
from rigidsim.store.seal import check_seal, check_whole
from rigidsim.store.sweeps.folder import SweepFolder
from rigidsim.store.sweeps.generation import Generation

if TYPE_CHECKING:
    import xarray

_RECENT = 20  # tiles from which the rate is determined


@dataclass(frozen=True, repr=False)
class SavedSweep:
    """A sweep on disk, finished or not.

    Attributes:
        folder: its files.
        summary: contents of its summary; for an unfinished sweep, what its tiles tell.
    """

    folder: SweepFolder
    summary: dict[str, Any]

    @property
    def place(self) -> str:
        """Path of the sweep's folder."""
        return str(self.folder.path)

    @property
    def status(self) -> str:
        """Status of the sweep: "finished", "running", "interrupted" ..."""
        return str(self.summary["status"])

    @property
    def finished(self) -> bool:
        """Whether all members are complete."""
        return self.status == "finished"

    @property
    def dataset(self) -> xarray.Dataset:
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
        """Check the files of a complete sweep against their seals, which reads all of them.

        Raises:
            RunFolderError: the dataset or a tile is damaged or was edited.
        """
        if self.folder.dataset.exists():
            self._refuse_damaged_dataset()
        for path in sorted(self.folder.tiles.glob("g*.h5")):
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
            _, digest = check_whole(self.folder.dataset)
        except RunFolderError as error:
            again = f"; remove it, and {RESUME} writes it again" if self.folder.tiles.is_dir() else ""
            raise RunFolderError(f"{error}{again}") from None
        expected = self.summary.get("dataset_sha256")
        if expected not in (None, digest):
            raise RunFolderError(
                f"{self.folder.dataset}: isn't the dataset that summary.json beside it was written for"
            )

    def __repr__(self) -> str:
        return f"<Sweep {self.summary.get('name', '')!r} ({self.place}): {self.status}>"


def open_sweep(path: str | Path) -> SavedSweep:
    """Open the folder of a sweep, or the dataset in it, finished or not.

    Raises:
        RunFolderError: there is no sweep.
    """
    given = Path(path)
    folder = SweepFolder(given if given.is_dir() else given.parent)
    if not folder.is_sweep:
        raise RunFolderError(f"{path}: no sweep here; give the folder of one (runs/NAME)")
    return SavedSweep(folder, so_far(folder))


def so_far(folder: SweepFolder) -> dict[str, Any]:
    """The summary; for an unfinished sweep, what its tiles tell."""
    summary = folder.read_summary()
    generations = folder.generations()
    if not generations:
        return summary
    latest = generations[-1]
    present = folder.present(latest)
    ended = summary.get("config_sha256") == latest.config_sha256
    if summary and ended and bool(present.all()):
        return summary
    busy = folder.at_work
    done = int(sum(len(latest.members_of(int(t))) for t in np.flatnonzero(present)))
    status = "running" if busy else ("interrupted" if not ended else summary.get("status", "interrupted"))
    words = "a process is at work on it" if busy else "the tiles that are complete are kept"
    rate = _rate(folder, latest) if busy else None
    left = latest.members - done
    return {
        "kind": "sweep",
        "name": folder.path.name,
        "status": status,
        "message": f"{done:,} of {latest.members:,} members to be run are done; {words}",
        "exit_code": 0 if busy else 130,
        "members": latest.members,
        "members_done": done,
        "tiles": latest.tiles,
        "tiles_done": int(present.sum()),
        "members_per_second": rate,
        "seconds_left": left / rate if rate else None,
        "config_sha256": latest.config_sha256,
    }


def _rate(folder: SweepFolder, generation: Generation) -> float | None:
    """Members per second of the session that is at work, from the times at which its latest tiles were
    written.
    """
    begun = folder.generation_file(generation).stat().st_mtime
    written = (path.stat().st_mtime for path in folder.tiles.glob(f"g{generation.number:03d}-*.h5"))
    times = sorted([begun, *(when for when in written if when > begun)])[-_RECENT:]
    if len(times) < 2:
        return None
    span = max(time.time(), times[-1]) - times[0]
    return generation.length * (len(times) - 1) / span if span > 0 else None
