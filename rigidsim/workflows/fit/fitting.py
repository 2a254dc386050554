"""``rigidsim fit``: an experiment's parameters from observations, as typed values with dataset, figure and
fitted config; kept in a folder, viewed.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from html import escape
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray
from pydantic import PrivateAttr

from rigidsim.errors import FORCE, RESUME, SWEEP, ConfigError, Problem, Remedy, RigidsimError, RunFolderError
from rigidsim.scene.config import Experiment
from rigidsim.scene.rotations import conjugated, multiplied, normalised, turned, vector_of
from rigidsim.store import atomic, provenance
from rigidsim.store.folder import FitFolder
from rigidsim.store.outputs import refuse_inputs
from rigidsim.store.run import ShownRun
from rigidsim.store.summary import SummaryPart
from rigidsim.workflows.fit.estimation import Ended, Solution, Weighing, consider_covariance, search
from rigidsim.workflows.fit.observations import (
    QUATERNION,
    ByDifferences,
    ByTangents,
    DataFiles,
    FitKey,
    FitKeys,
    Prediction,
    Predictor,
    Readings,
    content,
    digest,
    files_beside,
    observing,
    read_readings,
)
from rigidsim.workflows.read import Given, as_experiment, load
from rigidsim.workflows.run import sampled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KIND = "fit"
_COVARIANCE = "attitude_covariance"
_ROUNDING = 1e-6  # rad: between two ways of integrating a motion that isn't chaotic
_SHARE = 0.1  # of a sigma, by which these may differ where the motion amplifies both
_NOTHING = 1e-6  # of a direction's largest part, below which another may be rounding
_PART = 1e-3  # of a direction of norm one, below which a number takes no part in it


class FittedParameter(SummaryPart):
    """One number that was estimated, SI.

    Attributes:
        sigma: standard deviation by the sigmas of data, priors and considered numbers; None if undetermined.
        scaled_sigma: the same with the data's sigmas multiplied so that the residuals fit them.
        start: the config's value. prior_sigma: of its prior; None for none.
    """

    key: str
    unit: str
    value: float
    sigma: float | None
    scaled_sigma: float | None
    start: float
    prior_sigma: float | None


class Undetermined(SummaryPart):
    """Numbers that the data can't separate, or don't determine at all.

    Attributes:
        keys: those that take part. amounts: by how much each changes along the direction, SI: the data
            stay the same to first order. text: the same in words.
    """

    keys: list[str]
    amounts: list[float]
    text: str


class Outlier(SummaryPart):
    """A row that was left out; ``sigmas``: its largest residual."""

    data: int
    observable: str
    row: str
    time: float
    sigmas: float


class FittedData(SummaryPart):
    """One set of observations; ``rms``: of the residuals of used rows, in ``unit``; ``sigmas``: the same over
    their sigmas.
    """

    number: int
    file: str
    sha256: str
    observable: str
    rows: int
    used: int
    rms: float
    unit: str
    sigmas: float


class ConsideredNumber(SummaryPart):
    """A number that wasn't estimated, and by how much each estimated one follows it, SI."""

    key: str
    unit: str
    value: float
    sigma: float
    effect: list[float]


class FitResult(SummaryPart):
    """Parameters of an experiment, estimated from observations.

    Attributes:
        chi_square: sum of squares of used residuals in sigmas, with the priors'. freedom: used numbers less
            determined parameters. scale: root of their ratio, by which scaled sigmas differ; None without.
        correlations: between parameters, in their order; None for undetermined ones.
        evaluations: of the motion in the last round. starts: how many, and the sums of squares where each
            ended. derivatives: where they came from.
        told: what a user should know besides. folder: of its files; empty if nowhere.
    """

    kind: str = KIND
    name: str
    converged: bool
    parameters: list[FittedParameter]
    correlations: list[list[float | None]]
    undetermined: list[Undetermined]
    outliers: list[Outlier]
    considered: list[ConsideredNumber]
    data: list[FittedData]
    chi_square: float
    freedom: int
    scale: float | None
    evaluations: int
    starts: list[float | None]
    derivatives: str
    told: list[str]
    folder: str = ""

    _dataset: Any = PrivateAttr(default=None)
    _experiment: Any = PrivateAttr(default=None)

    @property
    def dataset(self) -> xarray.Dataset:
        """Parameters, covariances, residuals, and predicted uncertainties along time, with their units."""
        found: xarray.Dataset = self._dataset
        return found

    @property
    def experiment(self) -> Experiment:
        """The config with the estimated values, without ``[fit]``."""
        found: Experiment = self._experiment
        return found

    def value(self, key: str) -> float:
        """The estimated value of a parameter, SI; ``KeyError`` for others."""
        return self._parameter(key).value

    def sigma(self, key: str) -> float | None:
        """Its standard deviation, SI; None if undetermined."""
        return self._parameter(key).sigma

    def _parameter(self, key: str) -> FittedParameter:
        for one in self.parameters:
            if one.key == key:
                return one
        raise KeyError(f"{key}; parameters are {', '.join(one.key for one in self.parameters)}")

    def plot(self) -> Figure:
        """Residuals, correlations, predicted uncertainty along time and the ellipse of the pole."""
        from rigidsim.look.figures.fitted import fitted_figure

        return fitted_figure(self.dataset)

    def view(
        self, *, web: bool = False, png: str | Path | None = None, at: float | str | None = None,
        part: str = "page",
    ) -> int:  # fmt: skip
        """The fitted motion in the viewer, with a cone of one standard deviation about the figure axis, or a
        picture of it; arguments, value and errors as in ``Run.view``.
        """
        shown = fitted_run(self.experiment, self.dataset, self.folder or "memory")
        return shown.view(web=web, png=png, at=at, part=part)

    def __repr__(self) -> str:
        lines = [f"<FitResult {self.name!r}: {self.sentence}"]
        lines += [f"  {one.key} = {value_text(one)}" for one in self.parameters]
        return "\n".join(lines) + ">"

    __str__ = __repr__

    @property
    def sentence(self) -> str:
        """The fit in one line."""
        state = "converged" if self.converged else "NOT converged"
        left = f", {len(self.outliers)} left out" if self.outliers else ""
        rows = sum(one.used for one in self.data)
        size = "" if self.scale is None else f", residuals {self.scale:.3g} sigmas"
        return f"{state}, {rows:,} row{'' if rows == 1 else 's'}{left}{size}"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th>{escape(one.key)}</th><td>{escape(value_text(one))}</td></tr>"
            for one in self.parameters
        )
        unknown = "".join(f"<p>undetermined: {escape(one.text)}</p>" for one in self.undetermined)
        return f"<b>{escape(self.name)}</b>: {escape(self.sentence)}<table>{rows}</table>{unknown}"


def value_text(one: FittedParameter) -> str:
    """Value and sigma, to two digits of the sigma, with the unit."""
    unit = "" if one.unit == "1" else f" {one.unit}"
    if one.sigma is None:
        return f"{one.value:.6g}{unit} (undetermined)"
    return f"{digits_text(one.value, one.sigma)} +- {one.sigma:.2g}{unit}"


def digits_text(value: float, sigma: float) -> str:
    """A value to the second digit of its sigma."""
    if not sigma > 0 or not math.isfinite(sigma):
        return f"{value:.12g}"
    size = math.floor(math.log10(max(abs(value), sigma)))
    digits = min(16, max(2, size - math.floor(math.log10(sigma)) + 2))
    return f"{value:.{digits}g}"


# --- from where a fit ended ---------------------------------------------------------------------------------


def result_of(
    name: str, keys: FitKeys, weighing: Weighing, ended: Ended, costs: Sequence[float], derivatives: str,
    notes: Sequence[str], along: Prediction, times: np.ndarray,
) -> FitResult:  # fmt: skip
    """The result of a search, with its dataset and the fitted config.

    Args:
        costs: sums of squares where each start ended.
        derivatives: where they came from. notes: what a user should know besides.
        along: predictions with derivatives at times (s) along the run, as far as the scene has them.
    """
    linear, solution, values, count = ended.linear, ended.solution, ended.values, len(keys.estimated)
    known = np.array([one.sigma or 0.0 for one in keys.considered])
    covariance, sensitivity = consider_covariance(linear, solution, known)
    null = solution.null / solution.scales  # rows in the numbers' own units
    directions, parts = _directions(null, solution.scales, np.array([one.size for one in keys.estimated]))
    determined = ~parts.any(axis=0)
    sets = list(zip(weighing.moved(values), weighing.used, linear.sets, strict=True))
    used = sum(int(u.sum()) * r.sigmas.shape[1] for r, u, _ in sets)
    freedom = used + int((linear.weights > 0).sum()) - count + len(null)
    scale = float(np.sqrt(linear.cost / freedom)) if freedom > 0 else None
    sigmas = np.where(determined, np.sqrt(np.diag(covariance)[:count]), np.nan)
    scaled = np.full(count, np.nan)
    if scale:  # the data's sigmas times this; priors and considered numbers keep theirs
        other = {key: getattr(linear, key) / scale for key in ("residuals", "slopes", "noise")}
        formal = Solution(replace(linear, **other)).covariance
        formal += sensitivity @ np.diag(known**2) @ sensitivity.T
        scaled = np.where(determined, np.sqrt(np.diag(formal)), np.nan)
    correlations = covariance[:count, :count] / np.outer(sigmas, sigmas)
    undetermined = []
    for direction, part in zip(directions, parts, strict=True):
        members = [one for one, p in zip(keys.estimated, part, strict=True) if p]
        text = _direction_text(members, values[part], direction[part])
        names = [one.key for one in members]
        undetermined.append(Undetermined(keys=names, amounts=direction[part].tolist(), text=text))
    made = FitResult(
        kind=KIND,
        name=name,
        converged=ended.converged,
        parameters=[
            FittedParameter(
                key=one.key, unit=one.unit, value=float(values[n]), sigma=_finite(sigmas[n]),
                scaled_sigma=_finite(scaled[n]), start=one.start, prior_sigma=one.sigma,
            )
            for n, one in enumerate(keys.estimated)
        ],
        correlations=[[_finite(x) for x in row] for row in correlations],
        undetermined=undetermined,
        outliers=[
            Outlier(
                data=readings.number, observable=readings.quantity.text, row=readings.rows[int(n)],
                time=float(readings.times[n]), sigmas=float(size[n]),
            )
            for (readings, kept, _), size in zip(sets, weighing.sizes(linear.sets), strict=True)
            for n in np.flatnonzero(~kept)
        ],
        considered=[
            ConsideredNumber(
                key=one.key, unit=one.unit, value=one.start, sigma=known[n], effect=sensitivity[:, n].tolist()
            )
            for n, one in enumerate(keys.considered)
        ],
        data=[_data_of(*one) for one in sets],
        chi_square=linear.cost,
        freedom=freedom,
        scale=scale,
        evaluations=ended.evaluations,
        starts=[_finite(cost) for cost in costs],
        derivatives=derivatives,
        told=[*notes, *_counted_twice(weighing.readings)],
    )  # fmt: skip
    known_words = {"long_name": "covariance with considered numbers; nan if undetermined"}
    square = ("parameter", "other_parameter")
    shown = np.where(np.outer(determined, determined), covariance[:count, :count], np.nan)
    names = [one.key for one in keys.estimated]
    variables: dict[str, Any] = {
        "value": ("parameter", values, {"long_name": "estimate, in parameter_unit"}),
        "start": ("parameter", [one.start for one in keys.estimated], {"long_name": "value in the config"}),
        "sigma": ("parameter", sigmas, {"long_name": "standard deviation; nan if undetermined"}),
        "scaled_sigma": ("parameter", scaled, {"long_name": "the same, scaled by the residuals"}),
        "covariance": (square, shown, known_words),
        "correlation": (square, correlations, {"units": "1"}),
        "undetermined": (
            ("direction", "parameter"), null, {"long_name": "directions that nothing determines"}
        ),
    }  # fmt: skip
    if keys.considered:
        words = {"long_name": "change of the parameter with a considered number"}
        variables["consider_sensitivity"] = (("parameter", "considered"), sensitivity, words)
    coordinates = {
        "parameter": names,
        "other_parameter": names,
        "parameter_unit": ("parameter", [one.unit for one in keys.estimated]),
        "considered": np.array([one.key for one in keys.considered], dtype=str),
        "time": ("time", times, {"units": "s"}),
    }
    attributes = {"title": f"fit of {name}", "kind": KIND, "converged": int(made.converged)}
    attributes |= {key: getattr(made, key) for key in ("chi_square", "freedom", "derivatives", "sentence")}
    made._experiment = keys.fitted(values)
    if (unit := made.experiment.config.time.unit) is not None:
        attributes["time_unit"] = unit
    dataset = xarray.Dataset(variables, coordinates, attributes)
    for readings, kept, residuals in sets:
        dataset = dataset.merge(_residuals_of(readings, kept, residuals))

    def spread(slopes: np.ndarray) -> np.ndarray:
        """Covariances (times, components, components) by slopes (times, components, numbers); nan where an
        undetermined direction would show.
        """
        found = np.einsum("nij,jk,nlk->nil", slopes, covariance, slopes)
        if len(null):  # one unit of a scaled direction is about a sigma of all data together
            apart = np.abs(np.einsum("nij,dj->nid", slopes[:, :, :count], null)).max(axis=(1, 2))
            found[apart > 1e-3 * np.sqrt(np.einsum("nii->n", found))] = np.nan
        return np.asarray(found)

    made._dataset = dataset.merge(_along(along, spread, keys))
    return made


def _data_of(readings: Readings, used: np.ndarray, residuals: np.ndarray) -> FittedData:
    kept, sigmas = residuals[used], readings.sigmas[used]
    return FittedData(
        number=readings.number,
        file=readings.source,
        sha256=readings.sha256,
        observable=readings.quantity.text,
        rows=len(used),
        used=len(kept),
        rms=float(np.sqrt(np.mean(np.sum(kept**2, axis=1)))) if len(kept) else np.nan,
        unit=readings.unit,
        sigmas=float(np.sqrt(np.mean((kept / sigmas) ** 2))) if len(kept) else np.nan,
    )


def _residuals_of(readings: Readings, used: np.ndarray, residuals: np.ndarray) -> xarray.Dataset:
    """Residuals of one set of observations, with what was used."""
    n, unit = readings.number, {"units": readings.unit}
    row, component = f"row_{n}", f"component_{n}"
    words = {**unit, "long_name": readings.label, "observable": readings.quantity.text}
    labels = ["X", "Y", "Z"] if readings.quantity.rotation else list(readings.quantity.components)
    return xarray.Dataset(
        {
            f"residual_{n}": ((row, component), residuals, words),
            f"residual_sigma_{n}": ((row, component), readings.sigmas, unit),
            f"used_{n}": (row, used.astype(np.int8), {"long_name": "1: used, 0: outlier"}),
        },
        {component: labels, f"time_{n}": (row, readings.times, {"units": "s"})},
    )


def _along(along: Prediction, spread: Callable[[np.ndarray], np.ndarray], keys: FitKeys) -> xarray.Dataset:
    """Predictions along time with their uncertainty."""
    made: dict[str, Any] = {}
    for name, (dim, labels, unit, sigma_unit) in _ALONG.items():
        if name not in along.values:
            continue
        values, found = along.values[name], spread(along.slopes[name])
        rotation = name == QUATERNION
        axes, subject = ("space_axis" if rotation else dim), ("attitude" if rotation else name)
        words = {"units": sigma_unit, "long_name": "predicted standard deviation"}
        made |= {dim: list(labels), axes: list("XYZ" if axes == "space_axis" else "xyz")}
        made[name] = (("time", dim), values, {"units": unit})
        made[f"{subject}_sigma"] = (("time", axes), np.sqrt(np.einsum("nii->ni", found)), words)
        if rotation:
            more = {"units": "rad2", "long_name": "predicted covariance of the attitude as a rotation vector"}
            pole = turned(values, np.array([[float(x) for x in keys.scene.figure.pole]]))
            made["other_space_axis"] = list("XYZ")
            made[_COVARIANCE] = (("time", axes, "other_space_axis"), found, more)
            made["figure_axis"] = (("time", axes), pole, {"units": "1"})
            words |= {"long_name": f"{words['long_name']}, space axes", "frame": "space axes"}
    return xarray.Dataset(made)


_ALONG = {
    QUATERNION: ("quaternion_component", "wxyz", "1", "rad"),
    "angular_velocity": ("body_axis", "xyz", "rad s-1", "rad s-1"),
    "position": ("space_axis", "XYZ", "m", "m"),
}
"""Dimension, labels and unit of what is predicted along the run, and the unit of its uncertainty."""


def _directions(null: np.ndarray, scales: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Undetermined directions of few numbers, one a row in the numbers' own units, and which take part."""
    directions = _simplest(null / sizes) * sizes
    scaled = np.abs(directions * scales)
    scaled /= np.maximum(scaled.max(axis=1, keepdims=True), 1e-300)
    # what data hardly depend on has a small part of its column's size, and all the same moves along
    return directions, (scaled > _PART) | ((np.abs(directions / sizes) > _PART) & (scaled > _NOTHING))


def _counted_twice(sets: Sequence[Readings]) -> list[str]:
    """Of which sets rows are the same observations."""
    found = []
    for one, other in combinations(sets, 2):
        if one.quantity.text != other.quantity.text:
            continue
        rows = [
            {(t, *v) for t, v in zip(x.times.tolist(), x.values.tolist(), strict=True)} for x in (one, other)
        ]
        if same := len(rows[0] & rows[1]):
            found.append(
                f"data {one.number} and {other.number} have rows with the same time and values of "
                f"{one.quantity.text} ({same:,}), which count twice and make sigmas too small: "
                "remove one of each"
            )
    return found


def _simplest(directions: np.ndarray) -> np.ndarray:
    """The same space by directions of few numbers: reduced row echelon form, the largest entries leading."""
    rows = np.array(directions, dtype=float)
    lead: list[int] = []
    for n in range(len(rows)):
        free = [j for j in range(rows.shape[1]) if j not in lead]
        rest = np.abs(rows[n:, free])
        i, j = divmod(int(np.argmax(rest)), len(free))
        rows[[n, n + i]] = rows[[n + i, n]]
        column = free[j]
        rows[n] /= rows[n, column]
        for other in range(len(rows)):
            if other != n:
                rows[other] -= rows[other, column] * rows[n]
        lead.append(column)
    return rows / np.abs(rows).max(axis=1, keepdims=True) if len(rows) else rows


def _direction_text(keys: Sequence[FitKey], values: np.ndarray, amounts: np.ndarray) -> str:
    if len(keys) == 1:
        return f"{keys[0].key}: no row depends on it"
    relative = np.divide(amounts, values, out=np.full(len(keys), np.nan), where=values != 0)
    names = " and ".join([", ".join(one.key for one in keys[:-1]), keys[-1].key])
    if np.isfinite(relative).all() and np.ptp(relative) < 1e-3 * np.abs(relative).max():
        return f"{names}: only their ratios are determined"
    changes = ", ".join(f"{one.key} by {x:.3g}" for one, x in zip(keys, amounts, strict=True))
    return f"{names}: a joint change ({changes}) changes no row"


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


# --- a fitted motion --------------------------------------------------------------------------------------


def fitted_run(experiment: Experiment, fit: xarray.Dataset, source: str = "memory") -> ShownRun:
    """Run a fitted experiment at the times of its fit's dataset, and store the predicted covariance with it.

    Args:
        experiment: with the estimated values. fit: the fit's dataset.

    Raises:
        RunFolderError: the experiment's motion isn't the dataset's.
    """
    asked = experiment.config.output.record
    more = asked is not None and QUATERNION not in asked and _COVARIANCE in fit
    record = [*asked, QUATERNION] if more and asked else None
    # without its own error, which would mislead next to the fit's
    made = sampled(experiment, fit["time"].values.tolist(), record)
    found = made.dataset
    if found.sizes["time"] != fit.sizes["time"]:
        raise RunFolderError(f"{source}: the fitted motion {made.outcome.message}, before the fit's own end")
    if _COVARIANCE in fit:
        covariance = fit[_COVARIANCE].variable.copy()
        covariance.attrs["covariance_of"] = "attitude"
        _refuse_other(found, fit, source)
        found = found.assign({_COVARIANCE: covariance})
    shown = found.assign_attrs(fit=str(fit.attrs.get("sentence", "")))
    return ShownRun(Path(source), made.outcome, shown)


def _refuse_other(found: xarray.Dataset, fit: xarray.Dataset, source: str) -> None:
    """Refuse a config that was changed since: its motion would have another uncertainty."""
    here, there = (normalised(one[QUATERNION].values) for one in (found, fit))
    apart = np.linalg.norm(vector_of(multiplied(here, conjugated(there))), axis=1)
    sigma = np.sqrt(np.nan_to_num(np.einsum("tii->t", fit[_COVARIANCE].values), nan=np.inf))
    worst = int(np.argmax(apart - _SHARE * sigma))
    if apart[worst] > max(_ROUNDING, _SHARE * sigma[worst]):
        raise RunFolderError(
            f"{source}: the motion of fitted.toml is {apart[worst]:.2g} rad from the fit's dataset "
            f"at {found['time'].values[worst]:.6g} s; was it changed? rigidsim verify {source} checks it"
        )


# --- a fit --------------------------------------------------------------------------------------------------

_ALONG_ROWS = 201
_AGAIN = f"copy it again from an intact copy, or make the fit again ({FORCE})"

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
        experiment: as for ``rigidsim.run``; data files lie next to the config, or in the working directory if
            the config comes from no file.
        changes: values to replace, as for ``rigidsim.run``.
        out: folder of the fits' folders, where ``out/NAME/`` keeps everything; None: nothing is written.
        force: replace a fit of the same name.
        told: receives lines on the progress.

    Returns:
        The result; ``converged`` says whether it may be used.

    Raises:
        ConfigError: the config has no [fit], or one that can't be used.
        RigidsimError: data can't be used, or the motion can't be computed at the fit's start.
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
        what = f"asks for many fits: use {SWEEP}, or {one} for a single fit"
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
            every = np.concatenate([one.times for one in readings])
            try:
                predictor = ByTangents(keys, quiet, quantities, every)
            except ConfigError as error:
                predictor = ByDifferences(keys, quiet, quantities)
                predictor.how += f" ({error.problems[0].what})"
            weighing = Weighing(keys, readings, predictor)
            ended, costs, more = search(weighing, table.starts, report or (lambda _: None))
            run = keys.scene.samples  # and the observations on the other side of its start
            ends = [float(run.start), float(run.last), every.min(), every.max()]
            times = np.linspace(min(ends), max(ends), _ALONG_ROWS)
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
