"""``rigidsim fit``: an experiment's parameters from observations, kept in a folder, made again, viewed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from rigidsim.errors import FORCE, RESUME, SWEEP, ConfigError, Problem, Remedy, RigidsimError, RunFolderError
from rigidsim.scene.config import Experiment
from rigidsim.store import atomic, provenance
from rigidsim.store.folder import FitFolder
from rigidsim.store.outputs import refuse_inputs
from rigidsim.workflows.fit.estimation import Weighing, search
from rigidsim.workflows.fit.keys import FitKeys
from rigidsim.workflows.fit.observations import (
    DataFiles,
    content,
    digest,
    files_beside,
    observing,
    read_readings,
)
from rigidsim.workflows.fit.predictions import ByDifferences, ByTangents, Predictor
from rigidsim.workflows.fit.result import KIND, FitResult, result_of
from rigidsim.workflows.read import Given, as_experiment, load

_ALONG_ROWS = 201
_AGAIN = f"copy it again from where it is whole, or make the fit again ({FORCE})"

Report = Callable[[str], None]


def fit(
    experiment: Given,
    *,
    changes: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    force: bool = False,
    told: Report | None = None,
) -> FitResult:
    """Estimate the parameters of a config's ``[fit]`` from its data.

    Args:
        experiment: as for ``rigidsim.run``; data files lie next to the config, or in the working directory
            where it comes from no file.
        changes: values to replace, as for ``rigidsim.run``.
        out: folder of the fits' folders, where ``out/NAME/`` keeps everything; None: nothing is written.
        force: replace a fit of the same name.
        told: receives lines on the progress.

    Returns:
        The result; ``converged`` says whether it may be used.

    Raises:
        ConfigError: the config has no [fit], or one that can't be used.
        RigidsimError: data can't be used, or the motion can't be computed where the fit starts.
        RunFolderError: a finished fit, or something else, is in the folder.
    """
    asked = as_experiment(experiment, changes)
    _refuse(asked)
    places = files_beside(asked)
    if out is None:
        return fit_to(asked, places, report=told)
    folder, data = FitFolder(Path(out) / asked.config.name), [path for files in places for path in files]
    missing = [path for path in data if not path.exists()]
    if missing:
        raise RigidsimError(f"{missing[0]}: there is no such file; [[fit.data]] files lie next to the config")
    refuse_inputs([folder.path], [*asked.files, *data])
    with folder.locked():
        # what an interrupted fit left needs no force
        folder.claim(force=force, mine=folder.holds if folder.begun_here and not folder.finished else ())
        atomic.write_bytes(folder.begun, json.dumps(identity(asked, places), indent=2).encode())
        folder.data.mkdir()
        for files, kept in zip(places, copies(folder, asked), strict=True):
            for path, copy in zip(files, kept, strict=True):
                atomic.write_bytes(copy, content(path))
        atomic.write_bytes(folder.config, asked.text.encode())
        return _kept(asked, folder, told)


def resume_fit(path: str | Path, *, told: Report | None = None) -> FitResult:
    """Make an interrupted fit from the copies of config and data in its folder.

    Raises:
        RunFolderError: no fit is there, or a finished one.
    """
    folder = FitFolder(Path(path))
    if not folder.begun_here or not folder.config.is_file():
        raise RunFolderError(f"{path}: no fit here; give the folder of one (fits/NAME)")
    if folder.finished:
        raise RunFolderError(f"{path}: the fit is finished; rigidsim verify makes it again and compares")
    with folder.locked():
        return _kept(load(folder.config), folder, told)


def _kept(experiment: Experiment, folder: FitFolder, report: Report | None) -> FitResult:
    """Fit, and write the results."""
    from rigidsim.look.figures.fitted import fitted_figure

    result = fit_to(experiment, copies(folder, experiment), report=report)
    with atomic.replacing(folder.dataset) as temporary:
        result.dataset.to_netcdf(temporary, engine="h5netcdf")
    atomic.write_bytes(folder.fitted, result.experiment.text.encode())
    with atomic.replacing(folder.figure) as temporary:
        fitted_figure(result.dataset).savefig(temporary, format="png")
    dataset, fitted = result.dataset, result.experiment
    result = result.having(folder=str(folder.path))
    result._dataset, result._experiment = dataset, fitted
    folder.write_summary(result)
    return result


def _refuse(experiment: Experiment) -> None:
    config, problems = experiment.config, []
    if config.fit is None:
        problems.append(Problem("[fit]", "missing; it names parameters and data, see docs/fits.md"))
    if config.sweep is not None:
        one = Remedy("--member N", "[sweep] removed")
        what = f"asks for many fits, which {SWEEP} makes; with {one} here it is a single one"
        problems.append(Problem("[sweep]", what))
    if config.integrator.precision == "single":
        what = (
            'given "single", in which differences of motions have no digits left; "double" is allowed, or a '
        )
        problems.append(Problem("[integrator] precision", what + "higher one"))
    if problems:
        raise ConfigError(problems, experiment.source)


def fit_to(experiment: Experiment, places: list[DataFiles], *, report: Report | None = None) -> FitResult:
    """Fit by data in given files.

    Raises:
        ConfigError, RigidsimError: as for ``fit``.
    """
    keys, table = FitKeys(experiment), experiment.config.fit
    assert table is not None
    try:
        with observing(experiment) as (quantities, quiet):
            sets = enumerate(zip(table.data, quantities, places, strict=True), start=1)
            readings = [read_readings(number, *given, keys.scene) for number, given in sets]
            numbers = sum(one.sigmas.size for one in readings)
            if numbers + sum(one.sigma is not None for one in keys.estimated) < len(keys.estimated):
                raise RigidsimError(
                    f"fit: {numbers} numbers are observed, fewer than the {len(keys.estimated)} that are "
                    "estimated; add data or priors, or estimate fewer"
                )
            predictor: Predictor
            try:
                predictor = ByTangents(keys, quiet, quantities)
            except ConfigError as error:
                predictor = ByDifferences(keys, quiet, quantities)
                predictor.how += f" ({error.problems[0].what})"
            weighing = Weighing(keys, readings, predictor)
            ended, costs, more = search(weighing, table.starts, report or (lambda _: None))
            times = np.linspace(float(keys.scene.start), float(keys.scene.samples.last), _ALONG_ROWS)
            along = weighing.along(ended.values, times)
    except ConfigError as error:
        raise error.at(experiment.source) from None
    notes = [*dict.fromkeys(text for one in readings for text in one.notes), *more]
    return result_of(experiment.config.name, keys, weighing, ended, costs, predictor.how, notes, along, times)


# --- the folder of a fit ----------------------------------------------------------------------------------


def read_result(folder: FitFolder) -> FitResult:
    """The result as it was saved, without its dataset.

    Raises:
        RunFolderError: the fit isn't finished, or its summary can't be read.
    """
    if not folder.finished:
        raise RunFolderError(f"{folder.path}: an unfinished fit; {RESUME} makes it")
    try:
        return FitResult.model_validate_json(folder.summary.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RunFolderError(f"{folder.summary}: can't be read ({error}); {_AGAIN}") from None


def read_dataset(folder: FitFolder) -> xarray.Dataset:
    """The dataset of a finished fit.

    Raises:
        RunFolderError: it can't be read.
    """
    read_result(folder)
    try:
        return xarray.load_dataset(folder.dataset, engine="h5netcdf", decode_times=False)
    except (OSError, ValueError) as error:
        raise RunFolderError(f"{folder.dataset}: can't be read ({error}); {_AGAIN}") from None


def copies(folder: FitFolder, experiment: Experiment) -> list[DataFiles]:
    """The kept data of a config."""
    assert experiment.config.fit is not None
    found = []
    for number, table in enumerate(experiment.config.fit.data, start=1):
        numbers = [f"{number}", *(f"{number}_{k}" for k in range(1, len(table.kernels) + 1))]
        names = [Path(name) for name in (table.file, *table.kernels)]
        pairs = zip(numbers, names, strict=True)  # the folder of a run is kept as its dataset
        found.append(tuple(folder.data / f"{n}_{x.stem}{x.suffix or '.h5'}" for n, x in pairs))
    return found


def identity(experiment: Experiment, sources: Sequence[DataFiles]) -> dict[str, Any]:
    """What the bits of a fit depend on: config, data, kernels and versions."""
    kernels = [[digest(path) for path in files[1:]] for files in sources]
    return {
        "kind": KIND,
        "text_sha256": hashlib.sha256(experiment.text.encode()).hexdigest(),
        "data_sha256": [digest(files[0]) for files in sources],
        **({"kernels_sha256": kernels} if any(kernels) else {}),
        "versions": provenance.versions(),
    }
