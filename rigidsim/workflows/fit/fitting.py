"""``rigidsim fit``: an experiment's parameters from observations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.errors import SWEEP, ConfigError, Problem, Remedy, RigidsimError, RunFolderError
from rigidsim.scene.config import Experiment
from rigidsim.store import atomic
from rigidsim.store.outputs import refuse_inputs
from rigidsim.workflows.fit.findings import Findings
from rigidsim.workflows.fit.folder import FitFolder, Remembered
from rigidsim.workflows.fit.keys import FitKeys
from rigidsim.workflows.fit.observed import Observed, observing
from rigidsim.workflows.fit.predictions import ByDifferences, ByTangents, Predictor
from rigidsim.workflows.fit.readings import DataFiles, Readings, files_beside, read_readings
from rigidsim.workflows.fit.result import FitResult
from rigidsim.workflows.fit.searching import search
from rigidsim.workflows.fit.weighing import Weighing
from rigidsim.workflows.read import Given, as_experiment, load

_ALONG_ROWS = 201

Told = Callable[[str], None]


def fit(
    experiment: Given,
    *,
    changes: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    force: bool = False,
    told: Told | None = None,
) -> FitResult:
    """Estimate the parameters of a config's ``[fit]`` from its data.

    Args:
        experiment: as for ``rigidsim.run``; data files lie next to the config, or in the working directory
            where it comes from no file.
        changes: values to replace, as for ``rigidsim.run``.
        out: folder of the fits' folders, where ``out/NAME/`` keeps everything, and where an interrupted fit
            goes on; None: nothing is written.
        force: replace a fit of the same name.
        told: receives lines on the progress.

    Returns:
        The result; ``converged`` tells whether it may be used.

    Raises:
        ConfigError: the config has no [fit], or one that can't be used.
        RigidsimError: data can't be used, or the motion can't be computed where the fit starts.
        RunFolderError: another fit is in the folder.
    """
    asked = as_experiment(experiment, changes)
    _refuse(asked)
    places = files_beside(asked)
    if out is None:
        return fit_to(asked, places, told=told)
    folder = FitFolder(Path(out) / asked.config.name)
    missing = [path for files in places for path in files.all if not path.exists()]
    if missing:
        raise RigidsimError(f"{missing[0]}: there is no such file; [[fit.data]] files lie next to the config")
    refuse_inputs([folder.path], [*asked.files, *(path for files in places for path in files.all)])
    with folder.locked():
        folder.begin(asked, places, force=force)
        return _kept(asked, folder, told or _silent)


def resume_fit(path: str | Path, *, told: Told | None = None) -> FitResult:
    """Go on with an interrupted fit, from its own copies of config and data; the same bits come out.

    Raises:
        RunFolderError: no fit is there, or a finished one.
    """
    folder = FitFolder(Path(path))
    if not folder.is_fit:
        raise RunFolderError(f"{path}: no fit here; give the folder of one (fits/NAME)")
    if folder.finished:
        raise RunFolderError(f"{path}: the fit is finished; rigidsim verify makes it again and compares")
    with folder.locked():
        return _kept(load(folder.config), folder, told or _silent)


def fit_again(folder: FitFolder, *, told: Told | None = None) -> FitResult:
    """The fit of a folder made again from its own copies, without writing anything."""
    experiment = load(folder.config)
    return fit_to(experiment, folder.copies(experiment), told=told)


def _kept(experiment: Experiment, folder: FitFolder, told: Told) -> FitResult:
    """Fit, and write the results."""
    from rigidsim.look.figures.fitted import save_fitted

    result = fit_to(experiment, folder.copies(experiment), folder.evaluations, told=told)
    with atomic.replacing(folder.dataset) as temporary:
        result.dataset.to_netcdf(temporary, engine="h5netcdf")
    atomic.write_bytes(folder.fitted, result.experiment.text.encode())
    with atomic.replacing(folder.figure) as temporary:
        save_fitted(result.dataset, temporary)
    dataset, fitted = result.dataset, result.experiment
    result = result.having(folder=str(folder.path))
    result._dataset, result._experiment = dataset, fitted
    folder.write_summary(result)
    for path in folder.evaluations.iterdir():
        path.unlink()
    folder.evaluations.rmdir()
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


def fit_to(
    experiment: Experiment, places: list[DataFiles], memory: Path | None = None, *, told: Told | None = None
) -> FitResult:
    """Fit by data in given files; predictions are kept in a folder ``memory``.

    Raises:
        ConfigError, RigidsimError: as for ``fit``.
    """
    keys = FitKeys(experiment)
    assert experiment.config.fit is not None
    with ExitStack() as stack:
        try:
            quantities, quiet = stack.enter_context(observing(experiment))
            readings = [
                read_readings(number, table, quantity, keys.scene, place)
                for number, (table, quantity, place) in enumerate(
                    zip(experiment.config.fit.data, quantities, places, strict=True), start=1
                )
            ]
        except ConfigError as error:
            raise error.at(experiment.source) from None
        _refuse_few(keys, readings)
        predictor = _predictor(keys, quiet, quantities)
        times = np.linspace(float(keys.scene.start), float(keys.scene.samples.last), _ALONG_ROWS)
        kept = predictor if memory is None else Remembered(predictor, memory)
        weighing = Weighing(keys, readings, kept, times)
        found = search(weighing, experiment.config.fit.starts, told or _silent)
        notes = list(dict.fromkeys(text for one in readings for text in one.told))
        findings = Findings(experiment.config.name, keys, weighing, found, predictor.how, notes)
        return findings.result(weighing.along(found.ended.values), times)


def _predictor(keys: FitKeys, quiet: Experiment, quantities: list[Observed]) -> Predictor:
    """Variational equations, or differences of runs where a scene has none."""
    try:
        return ByTangents(keys, quiet, quantities)
    except ConfigError as error:
        made = ByDifferences(keys, quiet, quantities)
        made.how += f" ({error.problems[0].what})"
        return made


def _refuse_few(keys: FitKeys, readings: list[Readings]) -> None:
    numbers = sum(one.sigmas.size for one in readings)
    known = sum(one.sigma is not None for one in keys.estimated)
    if numbers + known < len(keys.estimated):
        raise RigidsimError(
            f"fit: {numbers} numbers are observed, fewer than the {len(keys.estimated)} that are "
            "estimated; add data or priors, or estimate fewer"
        )


def _silent(_: str) -> None:
    return None
