"""From where a fit ended to its result: sigmas, directions without any, residuals, uncertainty along time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import xarray

from rigidsim.scene.row_rotations import turned
from rigidsim.workflows.fit.estimation import consider_covariance
from rigidsim.workflows.fit.keys import FitKey, FitKeys
from rigidsim.workflows.fit.observed import QUATERNION
from rigidsim.workflows.fit.predictions import Prediction
from rigidsim.workflows.fit.readings import Readings
from rigidsim.workflows.fit.result import (
    ConsideredNumber,
    FitResult,
    FittedData,
    FittedParameter,
    Outlier,
    Undetermined,
)
from rigidsim.workflows.fit.searching import FoundFit
from rigidsim.workflows.fit.weighing import Weighing

_ROUNDING = 1e-6  # of it, below which a part may be rounding
_PART = 1e-3  # of a direction of norm one, below which a number takes no part in it


@dataclass
class Findings:
    """Everything that a fit found, and the dataset and typed result made of it."""

    name: str
    keys: FitKeys
    weighing: Weighing
    search: FoundFit
    derivatives: str
    told: list[str]

    def __post_init__(self) -> None:
        ended = self.search.ended
        self._linear, self._solution = ended.linear, ended.solution
        self._known = np.array([one.sigma or 0.0 for one in self.keys.considered])
        self.covariance, self.sensitivity = consider_covariance(self._linear, self._solution, self._known)
        self.null = self._solution.null / self._solution.scales  # rows in the numbers' own units
        sizes = np.array([one.size for one in self.keys.estimated])
        self._directions = _simplest(self.null / sizes) * sizes  # one a row, in the numbers' own units
        scaled = np.abs(self._directions * self._solution.scales)
        scaled /= np.maximum(scaled.max(axis=1, keepdims=True), 1e-300)
        relative = np.abs(self._directions / sizes)
        # what data hardly depend on has a small part of its column's size, and all the same moves along
        self._parts = (scaled > _PART) | ((relative > _PART) & (scaled > _ROUNDING))
        self.determined = ~self._parts.any(axis=0)
        used = sum(int(u.sum()) * r.sigmas.shape[1] for u, r in zip(*self._sets, strict=True))
        priors = int((self._linear.weights > 0).sum())
        self.freedom = used + priors - len(self.determined) + len(self.null)
        self.scale = float(np.sqrt(ended.linear.cost / self.freedom)) if self.freedom > 0 else None

    @property
    def _sets(self) -> tuple[list[np.ndarray], list[Readings]]:
        return self.weighing.used, self.weighing.readings

    def sigmas(self) -> np.ndarray:
        """Of the parameters, nan for undetermined ones."""
        count = len(self.keys.estimated)
        found = np.sqrt(np.diag(self.covariance)[:count])
        return np.where(self.determined, found, np.nan)

    def scaled(self) -> np.ndarray:
        """The same with the data's sigmas times ``scale``; priors and considered numbers keep theirs."""
        if self.scale is None:
            return np.full(len(self.keys.estimated), np.nan)
        formal = self._solution.covariance * self.scale**2
        if (self._linear.weights > 0).any():  # the priors' sigmas are known, only the data's aren't
            formal = _rescaled(self._linear, self.scale)
        part = self.sensitivity @ np.diag(self._known**2) @ self.sensitivity.T
        return np.where(self.determined, np.sqrt(np.diag(formal + part)), np.nan)

    def correlations(self) -> np.ndarray:
        """Between parameters, nan for undetermined ones."""
        count, sigmas = len(self.keys.estimated), self.sigmas()
        return np.asarray(self.covariance[:count, :count] / np.outer(sigmas, sigmas))

    # --- typed ----------------------------------------------------------------------------------------------

    def result(self, along: Prediction, times: np.ndarray) -> FitResult:
        """The result, with its dataset."""
        ended = self.search.ended
        sigmas, scaled = self.sigmas(), self.scaled()
        parameters = [
            FittedParameter(
                key=one.key, unit=one.unit, value=float(value), sigma=_finite(sigma),
                scaled_sigma=_finite(more), start=one.start, prior_sigma=one.sigma,
            )
            for one, value, sigma, more in zip(
                self.keys.estimated, ended.values, sigmas, scaled, strict=True
            )
        ]  # fmt: skip
        made = FitResult(
            kind="fit",
            name=self.name,
            converged=ended.converged,
            parameters=parameters,
            correlations=[[_finite(x) for x in row] for row in self.correlations()],
            undetermined=self._undetermined(),
            outliers=self._outliers(),
            considered=[
                ConsideredNumber(
                    key=one.key, unit=one.unit, value=one.start, sigma=one.sigma or 0.0,
                    effect=[float(x) for x in self.sensitivity[:, n]],
                )
                for n, one in enumerate(self.keys.considered)
            ],
            data=self._data(),
            chi_square=ended.linear.cost,
            freedom=self.freedom,
            scale=self.scale,
            evaluations=ended.iterations,
            starts=[_finite(cost) for cost in self.search.costs],
            derivatives=self.derivatives,
            told=[*self.told, *_counted_twice(self._sets[1]), *self.search.told],
        )  # fmt: skip
        made._dataset = self._dataset(made, along, times)
        made._experiment = self.keys.fitted(ended.values)
        return made

    def _undetermined(self) -> list[Undetermined]:
        """Directions, each as the changes of the numbers that make it."""
        found = []
        for direction, part in zip(self._directions, self._parts, strict=True):
            keys = [one for one, p in zip(self.keys.estimated, part, strict=True) if p]
            amounts = direction[part]
            found.append(
                Undetermined(
                    keys=[one.key for one in keys],
                    amounts=[float(x) for x in amounts],
                    text=_direction_text(keys, self.search.ended.values[part], amounts),
                )
            )
        return found

    def _outliers(self) -> list[Outlier]:
        sizes = self.weighing.sizes(self.search.compared)
        return [
            Outlier(
                data=readings.number, observable=readings.quantity.text, row=readings.rows[int(n)],
                time=float(readings.times[n]), sigmas=float(size[n]),
            )
            for used, readings, size in zip(*self._sets, sizes, strict=True)
            for n in np.flatnonzero(~used)
        ]  # fmt: skip

    def _data(self) -> list[FittedData]:
        found = []
        for used, readings, residuals in zip(*self._sets, self.search.compared.residuals, strict=True):
            kept = residuals[used]
            rms = np.sqrt(np.mean(np.sum(kept**2, axis=1))) if len(kept) else np.nan
            over = np.sqrt(np.mean((kept / readings.sigmas[used]) ** 2)) if len(kept) else np.nan
            unit = "rad" if readings.quantity.rotation else readings.quantity.unit or "SI"
            found.append(
                FittedData(
                    number=readings.number, file=readings.source, sha256=readings.sha256,
                    observable=readings.quantity.text, rows=len(used), used=int(used.sum()),
                    rms=float(rms), unit=unit, sigmas=float(over),
                )
            )  # fmt: skip
        return found

    # --- dataset --------------------------------------------------------------------------------------------

    def _dataset(self, made: FitResult, along: Prediction, times: np.ndarray) -> xarray.Dataset:
        names = [one.key for one in self.keys.estimated]
        count, starts = len(names), [one.start for one in self.keys.estimated]
        values = {
            "value": ("parameter", self.search.ended.values, {"long_name": "estimate, in parameter_unit"}),
            "start": ("parameter", starts, {"long_name": "value in the config"}),
            "sigma": ("parameter", self.sigmas(), {"long_name": "standard deviation; nan if undetermined"}),
            "scaled_sigma": ("parameter", self.scaled(), {"long_name": "the same, scaled by the residuals"}),
            "covariance": (
                ("parameter", "other_parameter"),
                np.where(np.outer(self.determined, self.determined), self.covariance[:count, :count], np.nan),
                {"long_name": "covariance with considered numbers; nan if undetermined"},
            ),
            "correlation": (("parameter", "other_parameter"), self.correlations(), {"units": "1"}),
            "undetermined": (
                ("direction", "parameter"), self.null, {"long_name": "directions that nothing determines"}
            ),
        }  # fmt: skip
        if self.keys.considered:
            words = {"long_name": "change of the parameter with a considered number"}
            values["consider_sensitivity"] = (("parameter", "considered"), self.sensitivity, words)
        coordinates = {
            "parameter": names,
            "other_parameter": names,
            "parameter_unit": ("parameter", [one.unit for one in self.keys.estimated]),
            "considered": np.array([one.key for one in self.keys.considered], dtype=str),
        }
        attributes = {
            "title": f"fit of {self.name}",
            "kind": "fit",
            "converged": int(made.converged),
            "chi_square": made.chi_square,
            "freedom": made.freedom,
            "derivatives": made.derivatives,
            "sentence": made.sentence,
        }
        dataset = xarray.Dataset(values, coordinates, attributes)
        self._put_residuals(dataset)
        self._put_along(dataset, along, times)
        return dataset

    def _put_residuals(self, dataset: xarray.Dataset) -> None:
        for used, readings, residuals in zip(*self._sets, self.search.compared.residuals, strict=True):
            n = readings.number
            rotation = readings.quantity.rotation
            labels = ["X", "Y", "Z"] if rotation else list(readings.quantity.components)
            unit = "rad" if rotation else readings.quantity.unit or "SI"
            words = {"units": unit, "long_name": readings.label, "observable": readings.quantity.text}
            dataset.coords[f"component_{n}"] = labels
            dataset.coords[f"time_{n}"] = (f"row_{n}", readings.times, {"units": "s"})
            dataset[f"residual_{n}"] = ((f"row_{n}", f"component_{n}"), residuals, words)
            dataset[f"residual_sigma_{n}"] = (
                (f"row_{n}", f"component_{n}"),
                readings.sigmas,
                {"units": unit},
            )
            dataset[f"used_{n}"] = (f"row_{n}", used.astype(np.int8), {"long_name": "1: used, 0: outlier"})

    def _put_along(self, dataset: xarray.Dataset, along: Prediction, times: np.ndarray) -> None:
        """Prediction uncertainty along time; nan where an undetermined direction would show."""
        dataset.coords["time"] = ("time", times, {"units": "s"})
        if QUATERNION in along.values:
            found = self._spread(along.slopes["quaternion"])
            words = {
                "units": "rad",
                "long_name": "predicted standard deviation, space axes",
                "frame": "space axes",
            }
            dataset.coords["space_axis"] = ["X", "Y", "Z"]
            dataset["attitude_sigma"] = (("time", "space_axis"), _roots(found), words)
            more = {"units": "rad2", "long_name": "predicted covariance of the attitude as a rotation vector"}
            dataset.coords["other_space_axis"] = ["X", "Y", "Z"]
            dataset["attitude_covariance"] = (("time", "space_axis", "other_space_axis"), found, more)
            values = along.values["quaternion"]
            dataset.coords["quaternion_component"] = ["w", "x", "y", "z"]
            dataset["quaternion"] = (("time", "quaternion_component"), values, {"units": "1"})
            pole = turned(values, np.array([[float(x) for x in self.keys.scene.figure.pole]]))
            dataset["figure_axis"] = (("time", "space_axis"), pole, {"units": "1"})
        for name, dim, unit, labels in (
            ("angular_velocity", "body_axis", "rad s-1", ["x", "y", "z"]),
            ("position", "space_axis", "m", ["X", "Y", "Z"]),
        ):
            if name in along.values:
                dataset.coords[dim] = labels
                dataset[name] = (("time", dim), along.values[name], {"units": unit})
                words = {"units": unit, "long_name": "predicted standard deviation"}
                dataset[f"{name}_sigma"] = (("time", dim), _roots(self._spread(along.slopes[name])), words)

    def _spread(self, slopes: np.ndarray) -> np.ndarray:
        """Covariances (times, components, components) by slopes (times, components, numbers)."""
        found = np.einsum("nij,jk,nlk->nil", slopes, self.covariance, slopes)
        estimated = slopes[:, :, : len(self.keys.estimated)]
        if len(self.null):
            # one unit of a scaled direction is about a sigma of all data together
            apart = np.abs(np.einsum("nij,dj->nid", estimated, self.null)).max(axis=(1, 2))
            own = np.sqrt(np.einsum("nii->n", found))
            found[apart > 1e-3 * own] = np.nan
        return np.asarray(found)


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


def _rescaled(linear: object, scale: float) -> np.ndarray:
    """Covariance with the data's sigmas multiplied by a factor, and the priors' as they are."""
    from dataclasses import replace

    from rigidsim.workflows.fit.estimation import Linear, Solution

    assert isinstance(linear, Linear)
    other = replace(
        linear, residuals=linear.residuals / scale, slopes=linear.slopes / scale, noise=linear.noise / scale
    )
    return Solution(other).covariance


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
        return f"{names}: only their ratios show"
    changes = ", ".join(f"{one.key} by {x:.3g}" for one, x in zip(keys, amounts, strict=True))
    return f"{names}: changed together ({changes}) they leave all rows as they are"


def _roots(covariances: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("nii->ni", covariances))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
