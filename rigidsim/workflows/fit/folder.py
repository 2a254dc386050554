"""The folder of a fit: config and data, what was evaluated so far, and at the end its results."""

from __future__ import annotations

import fcntl
import hashlib
import io
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
from rigidsim.workflows.fit.predictions import Prediction, Predictor
from rigidsim.workflows.fit.readings import DataFiles
from rigidsim.workflows.fit.result import KIND, FitResult
from rigidsim.workflows.fit.seen import FittedRun, fitted_run
from rigidsim.workflows.read import load

_NAMES = (
    "config.toml",
    "dataset.h5",
    "summary.json",
    "fitted.toml",
    "figure.png",
    "data",
    "evaluations",
    BEGUN,
)
_AGAIN = "copy it again from where it is whole, or make the fit again"


@dataclass(frozen=True)
class FitFolder(WorkFolder):
    """Paths of one fit."""

    kind = KIND
    kept = "what was evaluated stays"
    resumed = "goes on"
    seen_by = fcntl.LOCK_EX

    fitted = FileOf("fitted.toml")
    """The config with the estimated values."""
    figure = FileOf("figure.png")
    """The figure."""
    data = FileOf("data")
    """Copies of the data."""
    evaluations = FileOf("evaluations")
    """Predictions so far, while the fit isn't finished."""
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
        """Begin a fit, or go on with the same one.

        Raises:
            RunFolderError: another fit, or something else, is there.
        """
        there = self.content(_NAMES)
        now: dict[str, Any] = {
            "kind": KIND,
            "text_sha256": hashlib.sha256(experiment.text.encode()).hexdigest(),
            "data_sha256": [digest(files.file) for files in sources],
            "versions": versions(),
        }
        if any(files.kernels for files in sources):
            now["kernels_sha256"] = kernel_digests(sources)
        if there and not force:
            if self.finished:
                raise RunFolderError(
                    f"{self.path}: a finished fit is there; {FORCE} replaces it, or choose {OUT}"
                )
            if not self.is_fit or json.loads(self.begun.read_text()) != now:
                raise RunFolderError(
                    f"{self.path}: a fit of another config, other data or other versions was begun there; "
                    f"{FORCE} begins anew"
                )
            return
        for name in there:
            path = self.path / name
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        self.data.mkdir()
        self.evaluations.mkdir()
        for files, copies in zip(sources, self.copies(experiment), strict=True):
            for path, copy in zip(files.all, copies.all, strict=True):
                atomic.write_bytes(copy, content(path))
        atomic.write_bytes(self.config, experiment.text.encode())
        atomic.write_bytes(self.begun, json.dumps(now, indent=2).encode())

    def read_result(self) -> FitResult:
        """The result as it was saved, without its dataset.

        Raises:
            RunFolderError: the fit isn't finished, or its summary can't be read.
        """
        if not self.finished:
            raise RunFolderError(f"{self.path}: an unfinished fit; {RESUME} goes on with it")
        try:
            return FitResult.model_validate_json(self.summary.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise RunFolderError(f"{self.summary}: can't be read ({error}); {_AGAIN} ({FORCE})") from None

    def motion(self) -> FittedRun:
        """The fitted experiment's motion with the predicted uncertainty, to be viewed.

        Raises:
            RunFolderError: the fit isn't finished, or its files can't be used.
        """
        self.read_result()
        try:
            fit = xarray.load_dataset(self.dataset, engine="h5netcdf")
        except (OSError, ValueError) as error:
            raise RunFolderError(f"{self.dataset}: can't be read ({error}); {_AGAIN} ({FORCE})") from None
        return fitted_run(load(self.fitted), fit, str(self.path))

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
        name = Path(given).name
        suffix = Path(name).suffix or ".h5"  # the folder of a run is kept as its dataset
        return self.data / f"{number}_{Path(name).stem}{suffix}"


class Remembered:
    """Predictions of another predictor, kept in a folder: a fit that goes on takes the same steps again from
    there, and ends with the same bits.
    """

    def __init__(self, predictor: Predictor, folder: Path) -> None:
        self._predictor, self._folder = predictor, folder
        self.how = predictor.how

    def at(self, values: Sequence[float], times: np.ndarray, *, slopes: bool = True) -> Prediction:
        """See ``Predictor.at``."""
        said = np.asarray([*values, slopes], dtype=float).tobytes() + times.tobytes()
        path = self._folder / f"{hashlib.sha256(said).hexdigest()[:32]}.npz"
        if path.is_file():
            return _read(path)
        found = self._predictor.at(values, times, slopes=slopes)
        buffer = io.BytesIO()
        parts: dict[str, Any] = {}
        for kind in ("values", "slopes", "noise"):
            parts |= {f"{kind}:{name}": array for name, array in getattr(found, kind).items()}
        np.savez(buffer, **parts)
        atomic.write_bytes(path, buffer.getvalue())
        return found

    def along(self, values: Sequence[float], times: np.ndarray) -> Prediction:
        """See ``Predictor.along``; it is computed once, and not kept."""
        return self._predictor.along(values, times)


def _read(path: Path) -> Prediction:
    found = Prediction({})
    with np.load(path, allow_pickle=False) as arrays:
        for key in arrays.files:
            kind, _, name = key.partition(":")
            getattr(found, kind)[name] = arrays[key]
    return found


def versions() -> dict[str, str]:
    """What the bits of a fit depend on besides config and data."""
    return {
        "rigidsim": __version__, "heyoka": heyoka.__version__, "numpy": np.__version__,
        "python": platform.python_version(),
    }  # fmt: skip


def content(path: Path) -> bytes:
    """Bytes of a file, or of the dataset of a run's folder."""
    return (path / "dataset.h5" if path.is_dir() else path).read_bytes()


def digest(path: Path) -> str:
    """SHA-256 of a file, or of the dataset of a run's folder."""
    return hashlib.sha256(content(path)).hexdigest()


def kernel_digests(sources: Sequence[DataFiles]) -> list[list[str]]:
    """SHA-256 of the kernels that each file is read with."""
    return [[digest(path) for path in files.kernels] for files in sources]
