"""Runs on disk, finished or partial, opened for reading."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigidsim.errors import RunFolderError
from rigidsim.store import segments
from rigidsim.store.folder import RunFolder, find_run

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Run:
    """A run on disk, finished or partial.

    Attributes:
        folder: its files.
        summary: the content of ``summary.json``.
    """

    folder: RunFolder
    summary: dict[str, Any]

    @property
    def status(self) -> str:
        """How it ended; ``"finished"`` is the only complete one."""
        return str(self.summary["status"])

    @property
    def saved(self) -> bool:
        """Whether anything is on disk that ``dataset`` could read."""
        return self.folder.dataset.exists() or bool(segments.segment_paths(self.folder.segments))

    @property
    def dataset(self) -> xarray.Dataset:
        """The dataset, read lazily; of an unfinished run what its segments hold.

        Raises:
            RunFolderError: nothing was saved, or a file is damaged.
        """
        import xarray

        if self.folder.dataset.exists():
            return _opened(self.folder.dataset)
        paths = segments.segment_paths(self.folder.segments)
        if not paths:
            raise RunFolderError(f"{self.folder.path}: nothing was saved")
        pieces = [_opened(path) for path in paths]
        joined = xarray.concat(
            pieces, dim="time", data_vars="minimal", coords="minimal", compat="override", join="override"
        )
        joined.attrs = dict(pieces[0].attrs, status=self.status)
        return joined


def _opened(path: Path) -> xarray.Dataset:
    import xarray

    try:
        return xarray.open_dataset(path, engine="h5netcdf")
    except OSError as error:
        raise RunFolderError(f"{path}: can't be read ({error})") from None


def open_run(path: str | Path) -> Run:
    """Open a run folder, or the dataset in one, finished or partial.

    Raises:
        RunFolderError: no run there, or a damaged summary.
    """
    folder = find_run(path)
    return Run(folder, folder.read_summary())
