"""``rigidsim fit``: an experiment's parameters from observations."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.errors import SWEEP, ConfigError, Problem, Remedy, RigidsimError, RunFolderError
from rigidsim.scene.config import Experiment
from rigidsim.store import atomic
from rigidsim.store.outputs import refuse_inputs
from rigidsim.workflows.fit.folder import FitFolder, identity
from rigidsim.workflows.fit.keys import FitKeys
from rigidsim.workflows.fit.observed import observing
from rigidsim.workflows.fit.predictions import ByDifferences, ByTangents, Predictor
from rigidsim.workflows.fit.readings import DataFiles, files_beside, read_readings
from rigidsim.workflows.fit.result import FitResult, result_of
from rigidsim.workflows.fit.searching import Weighing, search
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
        out: folder of the fits' folders, where ``out/NAME/`` keeps everything; None: nothing is written.
        force: replace a fit of the same name.
        told: receives lines on the progress.

    Returns:
        The result; ``converged`` tells whether it may be used.

    Raises:
        ConfigError: the config has no [fit], or one that can't be used.
        RigidsimError: data can't be used, or the motion can't be computed where the fit starts.
        RunFolderError: a finished fit, or something else, is in the folder.
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
        return _kept(asked, folder, told)


def resume_fit(path: str | Path, *, told: Told | None = None) -> FitResult:
    """Make an interrupted fit from the copies of config and data in its folder.

    Raises:
        RunFolderError: no fit is there, or a finished one.
    """
    folder = FitFolder(Path(path))
    if not folder.is_fit or not folder.config.is_file():
        raise RunFolderError(f"{path}: no fit here; give the folder of one (fits/NAME)")
    if folder.finished:
        raise RunFolderError(f"{path}: the fit is finished; rigidsim verify makes it again and compares")
    with folder.locked():
        return _kept(load(folder.config), folder, told)


@dataclass(frozen=True)
class FitVerdict:
    """Result of a verification; ``environment``: versions that changed since, which may explain the rest."""

    path: str
    identical: bool
    problems: list[str] = field(default_factory=list)
    differing: list[str] = field(default_factory=list)
    environment: list[str] = field(default_factory=list)
    variables: int = 0

    def as_dict(self) -> dict[str, Any]:
        """Values for JSON."""
        return asdict(self)


def verify_fit(path: str | Path, *, told: Told | None = None) -> FitVerdict:
    """Make a finished fit again and compare every number of its dataset, and its fitted config.

    Raises:
        RunFolderError: no finished fit is there.
    """
    given = Path(path)
    folder = FitFolder(given if given.is_dir() else given.parent)
    saved, experiment = folder.read_dataset(), load(folder.config)
    copies = folder.copies(experiment)
    begun = json.loads(folder.begun.read_text(encoding="utf-8"))
    now = identity(experiment, copies)
    problems = [
        f"{key.removesuffix('_sha256')}: not the bytes that the fit was made from"
        for key, known in begun.items()
        if key != "versions" and known != now.get(key)
    ]
    again = fit_to(experiment, copies, told=told)
    if again.experiment.text != folder.fitted.read_text(encoding="utf-8"):
        problems.append(f"{folder.fitted.name}: other values than those fitted again")
    names = sorted({*map(str, saved.variables), *map(str, again.dataset.variables)})
    differing = [
        name
        for name in names
        if name not in saved.variables
        or name not in again.dataset.variables
        or not saved[name].variable.equals(again.dataset[name].variable)
    ]
    changed = [
        f"{name} {then} -> {now['versions'].get(name)}"
        for name, then in begun["versions"].items()
        if now["versions"].get(name) != then
    ]
    identical = not problems and not differing
    return FitVerdict(str(folder.path), identical, problems, differing, changed, len(names))


def _kept(experiment: Experiment, folder: FitFolder, told: Told | None) -> FitResult:
    """Fit, and write the results."""
    from rigidsim.look.figures.fitted import save_fitted

    result = fit_to(experiment, folder.copies(experiment), told=told)
    with atomic.replacing(folder.dataset) as temporary:
        result.dataset.to_netcdf(temporary, engine="h5netcdf")
    atomic.write_bytes(folder.fitted, result.experiment.text.encode())
    with atomic.replacing(folder.figure) as temporary:
        save_fitted(result.dataset, temporary)
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


def fit_to(experiment: Experiment, places: list[DataFiles], *, told: Told | None = None) -> FitResult:
    """Fit by data in given files.

    Raises:
        ConfigError, RigidsimError: as for ``fit``.
    """
    keys = FitKeys(experiment)
    assert experiment.config.fit is not None
    with ExitStack() as stack:
        try:
            quantities, quiet = stack.enter_context(observing(experiment))
            readings = [
                read_readings(number, *given, keys.scene)
                for number, given in enumerate(
                    zip(experiment.config.fit.data, quantities, places, strict=True), start=1
                )
            ]
        except ConfigError as error:
            raise error.at(experiment.source) from None
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
        times = np.linspace(float(keys.scene.start), float(keys.scene.samples.last), _ALONG_ROWS)
        weighing = Weighing(keys, readings, predictor)
        ended, costs, more = search(weighing, experiment.config.fit.starts, told or (lambda _: None))
        notes = list(dict.fromkeys(text for one in readings for text in one.told))
        along = weighing.along(ended.values, times)
        return result_of(
            experiment.config.name, keys, weighing, ended, costs, predictor.how, [*notes, *more], along, times
        )
