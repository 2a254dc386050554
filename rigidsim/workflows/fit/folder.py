"""The folder of a fit: config and copies of the data, and at the end its results."""

from __future__ import annotations

import fcntl
import hashlib
import json
import platform
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import heyoka
import numpy as np
import xarray

from rigidsim import __version__
from rigidsim.errors import FORCE, OUT, RESUME, RunFolderError
from rigidsim.scene.config import Experiment
from rigidsim.store import atomic
from rigidsim.store.fits import BEGUN
from rigidsim.store.folder import FileOf, WorkFolder
from rigidsim.workflows.fit.readings import DataFiles
from rigidsim.workflows.fit.result import KIND, FitResult

_NAMES = (
    "config.toml", "dataset.h5", "summary.json", "fitted.toml", "figure.png", "data", "evaluations", BEGUN,
)  # fmt: skip
_AGAIN = f"copy it again from where it is whole, or make the fit again ({FORCE})"


@dataclass(frozen=True)
class FitFolder(WorkFolder):
    """Paths of one fit."""

    kind = KIND
    kept = "its copies of config and data stay"
    resumed = "makes it"
    seen_by = fcntl.LOCK_EX

    fitted = FileOf("fitted.toml")
    """The config with the estimated values."""
    figure = FileOf("figure.png")
    """The figure."""
    data = FileOf("data")
    """Copies of the data."""
    begun = FileOf(BEGUN)
    """What it was begun with."""

    @property
    def is_fit(self) -> bool:
        """Whether the folder holds a fit, finished or not."""
        return self.begun.is_file()

    @property
    def finished(self) -> bool:
        """Whether its results are there."""
        return self.summary.is_file() and self.is_fit

    def begin(self, experiment: Experiment, sources: Sequence[DataFiles], *, force: bool) -> None:
        """Copy config and data; what an interrupted fit left is replaced.

        Raises:
            RunFolderError: a finished fit, or something else, is there.
        """
        there = self.content(_NAMES)
        if self.finished and not force:
            raise RunFolderError(
                f"{self.path}: a finished fit is there; {FORCE} replaces it, or choose {OUT}"
            )
        if there and not self.is_fit and not force:
            raise RunFolderError(
                f"{self.path}: holds {min(there)}, and no fit; {FORCE} replaces it, or choose {OUT}"
            )
        for name in there:
            path = self.path / name
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        atomic.write_bytes(self.begun, json.dumps(identity(experiment, sources), indent=2).encode())
        self.data.mkdir()
        for files, copies in zip(sources, self.copies(experiment), strict=True):
            for path, copy in zip(files.all, copies.all, strict=True):
                atomic.write_bytes(copy, content(path))
        atomic.write_bytes(self.config, experiment.text.encode())

    def read_result(self) -> FitResult:
        """The result as it was saved, without its dataset.

        Raises:
            RunFolderError: the fit isn't finished, or its summary can't be read.
        """
        if not self.finished:
            raise RunFolderError(f"{self.path}: an unfinished fit; {RESUME} makes it")
        try:
            return FitResult.model_validate_json(self.summary.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise RunFolderError(f"{self.summary}: can't be read ({error}); {_AGAIN}") from None

    def read_dataset(self) -> xarray.Dataset:
        """The dataset of a finished fit.

        Raises:
            RunFolderError: it can't be read.
        """
        self.read_result()
        try:
            return xarray.load_dataset(self.dataset, engine="h5netcdf", decode_times=False)
        except (OSError, ValueError) as error:
            raise RunFolderError(f"{self.dataset}: can't be read ({error}); {_AGAIN}") from None

    def copies(self, experiment: Experiment) -> list[DataFiles]:
        """The kept data of a config."""
        assert experiment.config.fit is not None
        return [
            DataFiles(
                self._copy(f"{number}", table.file),
                tuple(self._copy(f"{number}_{k}", name) for k, name in enumerate(table.kernels, start=1)),
            )
            for number, table in enumerate(experiment.config.fit.data, start=1)
        ]

    def _copy(self, number: str, given: str) -> Path:
        name = Path(given)  # the folder of a run is kept as its dataset
        return self.data / f"{number}_{name.stem}{name.suffix or '.h5'}"


def identity(experiment: Experiment, sources: Sequence[DataFiles]) -> dict[str, Any]:
    """What the bits of a fit depend on: config, data, kernels and versions."""
    kernels = [[digest(path) for path in files.kernels] for files in sources]
    return {
        "kind": KIND,
        "text_sha256": hashlib.sha256(experiment.text.encode()).hexdigest(),
        "data_sha256": [digest(files.file) for files in sources],
        **({"kernels_sha256": kernels} if any(kernels) else {}),
        "versions": {
            "rigidsim": __version__, "heyoka": heyoka.__version__, "numpy": np.__version__,
            "python": platform.python_version(),
        },
    }  # fmt: skip


def content(path: Path) -> bytes:
    """Bytes of a file, or of the dataset of a run's folder."""
    return (path / "dataset.h5" if path.is_dir() else path).read_bytes()


def digest(path: Path) -> str:
    """SHA-256 of a file, or of the dataset of a run's folder."""
    return hashlib.sha256(content(path)).hexdigest()
