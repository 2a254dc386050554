"""Fits as members of a sweep: copies of their data in its folder, what is kept of each, and of all.

Members are computed from a config's text in whatever process, so that data are found by the names that the
config gives them, in the sweep's folder alone.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from rigidsim.errors import FORCE, SWEEP, ConfigError, RigidsimError, RunFolderError
from rigidsim.scene.config import Experiment
from rigidsim.scene.sweep import FITS, Sweep
from rigidsim.solve.status import Status
from rigidsim.store import atomic
from rigidsim.store.sweeps.saved import FittedOfMembers
from rigidsim.store.sweeps.tiles import Kept, KeptVariable
from rigidsim.workflows.fit.fitting import FitResult, fit_to
from rigidsim.workflows.fit.observations import DataFiles, content, digest
from rigidsim.workflows.sweeps.members import OUTCOMES, MemberResults, Outcome, naming_member, status_variable

_NUMBERS = {
    "chi_square": "sum of squares of residuals in sigmas, with the priors'",
    "scale": "residuals in sigmas, root mean square for the numbers that are free",
    "converged": "1: the fit converged, 0: it didn't, or there is none",
    "undetermined": "directions of the parameters that the data don't determine",
    "freedom": "used numbers less determined parameters",
    "rows": "rows that were used",
    "outliers": "rows that were left out as outliers",
    "evaluations": "of the motion, in the last round",
}
_OF_PARAMETERS = {
    "value": "estimate, in parameter_unit",
    "sigma": "standard deviation; nan if undetermined",
    "scaled_sigma": "the same, scaled by the residuals",
    "start": "value in the config of the member",
}


# --- data ---------------------------------------------------------------------------------------------------


def copies_of(experiment: Experiment, folder: Path) -> list[DataFiles]:
    """The data of a member in the folder of copies."""
    assert experiment.config.fit is not None
    return [
        tuple(_copy(folder, given) for given in (table.file, *table.kernels))
        for table in experiment.config.fit.data
    ]


def _copy(folder: Path, given: str) -> Path:
    """Where the copy of a file is that a config gives so."""
    name, which = Path(given), hashlib.sha256(given.encode()).hexdigest()[:8]
    return folder / f"{name.stem}_{which}{name.suffix or '.h5'}"  # the folder of a run: its dataset


def given_files(sweep: Sweep) -> list[str]:
    """The files of all members, as the config gives them.

    Raises:
        ConfigError: a member can't be run.
    """
    varied = any(axis.key.partition(".")[0].strip() == "fit" for axis in sweep.axes)
    found: dict[str, None] = {}
    for member in range(sweep.count) if varied else ():
        try:
            found |= dict.fromkeys(_files(sweep.worked_out(member)))
        except ConfigError:
            if sweep.table.impossible != "mark":
                raise
    return list(found if varied else dict.fromkeys(_files(sweep.base)))


def _files(experiment: Experiment) -> Iterable[str]:
    assert experiment.config.fit is not None
    for table in experiment.config.fit.data:
        yield from (table.file, *table.kernels)


def refuse_other_data(files: Sequence[str], beside: Path | None, folder: Path, *, anew: bool) -> None:
    """Refuse files that aren't there, or others than those with which a sweep was begun.

    Args:
        files: as the config gives them. beside: where they lie; None if the copies have to do.
        anew: whether copies don't count, since the sweep begins again.

    Raises:
        RigidsimError, RunFolderError.
    """
    for given in files:
        copy = _copy(folder, given)
        if beside is None or not (beside / given).exists():
            if anew or not copy.exists():
                raise _gone(given, copy if beside is None else beside / given)
        elif not anew and copy.exists() and digest(copy) != digest(beside / given):
            raise RunFolderError(
                f"{beside / given}: differs from {copy}, the copy made when the sweep began; "
                f"{FORCE} starts again"
            )


def _gone(given: str, place: Path) -> RigidsimError:
    return RigidsimError(
        f'{place}: there is no such file, which [[fit.data]] names as "{given}"; it belongs next to the '
        f"config, from where {SWEEP} copies it into the sweep's folder"
    )


def keep_data(files: Sequence[str], beside: Path, folder: Path) -> None:
    """Copy what isn't there yet."""
    folder.mkdir(parents=True, exist_ok=True)
    for given in files:
        if not (copy := _copy(folder, given)).exists():
            atomic.write_bytes(copy, content(beside / given))


class _Missing(RunFolderError):
    """Data aren't in the sweep's folder, as this process sees it."""


# --- members ------------------------------------------------------------------------------------------------


def fit_members(sweep: Sweep, members: Sequence[int], folder: Path) -> MemberResults:
    """Fit some members, by the copies of their data."""
    found = []
    for place, member in enumerate(members):
        with naming_member(member):
            found.append((np.array([place]), _fit_member(sweep, member, folder)))
    return MemberResults.together(found)


def _fit_member(sweep: Sweep, member: int, folder: Path) -> MemberResults:
    """Fit one member; a refusal or failure is recorded, and errors of the code are raised."""
    try:
        experiment = sweep.experiment_of(member)
        for given in _files(experiment):
            if not (copy := _copy(folder, given)).exists():
                raise _Missing(str(_gone(given, copy)))
        result = fit_to(experiment, copies_of(experiment, folder))
    except _Missing:
        raise  # it isn't the member's fault
    except ConfigError as error:
        return _without(Outcome.REFUSED.value, "; ".join(str(problem) for problem in error.problems))
    except RigidsimError as error:
        return _without(Outcome.FAILED.value, str(error))
    why = {} if result.converged else {0: "the fit didn't converge: its values are the last ones"}
    return MemberResults(_status(Status.FINISHED.value) | _kept(result), why, {"fits": 1})


def _without(status: str, reason: str) -> MemberResults:
    return MemberResults(_status(status), {0: reason}, {"fits": 1})


def _status(status: str) -> Kept:
    return {"status": status_variable(np.array([OUTCOMES.index(status)], dtype=np.int64))}


def _kept(result: FitResult) -> Kept:
    """What is kept of a fit."""
    dataset = result.dataset
    keys = [one.key for one in result.parameters]
    labels = {"parameter": keys, "parameter_unit": [one.unit for one in result.parameters]}
    found: Kept = {
        name: KeptVariable(("parameter",), dataset[name].values[None], {"long_name": words}, FITS, labels)
        for name, words in _OF_PARAMETERS.items()
    }
    found["covariance"] = KeptVariable(
        ("parameter", "other_parameter"), dataset["covariance"].values[None],
        {"long_name": "covariance with considered numbers; nan if undetermined"}, FITS,
        {**labels, "other_parameter": keys},
    )  # fmt: skip
    numbers = {
        "chi_square": result.chi_square,
        "scale": np.nan if result.scale is None else result.scale,
        "converged": int(result.converged),
        "undetermined": len(result.undetermined),
        "freedom": result.freedom,
        "rows": sum(one.used for one in result.data),
        "outliers": len(result.outliers),
        "evaluations": result.evaluations,
    }
    for name, words in _NUMBERS.items():
        about = {"units": "1", "long_name": words}
        found[name] = KeptVariable((), np.array([numbers[name]]), about, FITS)
    return found


# --- all of them --------------------------------------------------------------------------------------------


def fitted_of(parts: Sequence[tuple[Kept, np.ndarray]]) -> tuple[dict[str, FittedOfMembers], dict[str, str]]:
    """What all members estimated, by key, and what a user should know of them, by codes.

    Args:
        parts: what tiles hold, each with the rows that count.
    """
    held = [(kept, rows) for kept, rows in parts if "value" in kept]
    if not held:
        return {}, {}
    labels = held[0][0]["value"].labels

    def all_of(name: str) -> np.ndarray:
        return np.concatenate([kept[name].values[rows] for kept, rows in held])

    values, sigmas = all_of("value"), all_of("sigma")
    there = np.isfinite(values).all(axis=1)
    converged, undetermined = all_of("converged") == 1, all_of("undetermined") > 0
    fitted = {}
    for n, (key, unit) in enumerate(zip(labels["parameter"], labels["parameter_unit"], strict=True)):
        good = values[there & converged, n]
        known = sigmas[there & converged, n]
        known = known[np.isfinite(known)]
        if len(good):
            fitted[key] = FittedOfMembers(
                members=len(good), median=float(np.median(good)),
                spread=float(np.std(good, ddof=1)) if len(good) > 1 else 0.0,
                sigma=float(np.median(known)) if len(known) else None, unit=unit,
            )  # fmt: skip
    return fitted, _warnings(
        {
            "fits_not_converged": (there & ~converged, "didn't converge; converged says which"),
            "fits_undetermined": (there & undetermined, "leave parameters undetermined: their sigma is nan"),
        }
    )


def _warnings(found: Mapping[str, tuple[np.ndarray, str]]) -> dict[str, str]:
    counts = {code: (int(mask.sum()), words) for code, (mask, words) in found.items()}
    return {code: f"{number:,} fits {words}" for code, (number, words) in counts.items() if number}
