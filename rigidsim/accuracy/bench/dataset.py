"""A measurement of settings as labelled data, its Pareto front, and the advice that follows from it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from rigidsim.accuracy.bench.measure import DEFAULT, Measurement, RowStatus
from rigidsim.accuracy.setting import Setting, precision_title, precision_titled
from rigidsim.scene.choices import METHODS

if TYPE_CHECKING:
    import xarray
    from numpy.typing import ArrayLike


TOLD = (
    "compared",
    "reference",
    "horizon_seconds",
    "measured_seconds",
    "closed_form",
    "processes",
    "seconds",
)
"""Attributes of a measurement that its JSON repeats."""


_RELATIVE = "relative to the default setting, per simulated second"
_NUMBERS = {
    "attitude_error_final": ("rad", "attitude error at the end of what was measured"),
    "attitude_error_largest": ("rad", "largest attitude error"),
    "reference_error": ("rad", "error of the reference itself, estimated, at the end"),
    "cpu_ratio": ("1", f"CPU time, median of the processes, {_RELATIVE}"),
    "cpu_ratio_least": ("1", f"CPU time, least of the processes, {_RELATIVE}"),
    "cpu_ratio_largest": ("1", f"CPU time, largest of the processes, {_RELATIVE}"),
    "cpu_seconds": ("s", "CPU time of the measured part"),
    "steps": ("1", "natural Taylor steps"),
    "taylor_order": ("1", "order of the Taylor series"),
    "work": ("1", "steps x order^2 x states"),
    "measured_time": ("s", "how much of the motion was measured"),
}
"""Numbers of a setting, nan where it wasn't measured: units and what they are."""


def dataset_of(measured: Measurement) -> xarray.Dataset:
    """The measurement as xarray data: dimensions ``setting``, ``time``, ``invariant``.

    Errors are in rad, costs relative to the default setting (double precision, quaternions). Where a setting
    was not measured, its numbers are nan and ``reason`` says why.
    """
    import xarray

    from rigidsim.store.provenance import versions

    rows, plan, span = measured.rows, measured.plan, measured.plan.span
    drifts = [{} if row.trial is None else row.trial.drifts for row in rows]
    names = sorted({name for one in drifts for name in one})
    error = np.full((len(rows), len(plan.times)), np.nan)
    columns: dict[str, list[float]] = {name: [math.nan] * len(rows) for name in _NUMBERS}
    for n, row in enumerate(rows):
        if not row.measured or row.trial is None:
            continue
        errors, own = row.errors()
        error[n, : len(errors)] = errors
        cost, trial = row.cost(rows[0]), row.trial
        values = [errors[-1], errors.max(), own[-1], *cost, row.cpu_seconds, trial.steps, trial.order]
        for name, value in zip(_NUMBERS, [*values, trial.work, row.part * span], strict=True):
            columns[name][n] = float(value)

    def words(values: Iterable[object]) -> np.ndarray:
        return np.array([str(value) for value in values], dtype=object)

    def variable(
        values: ArrayLike, units: str, long_name: str, dims: Sequence[str] = ("setting",)
    ) -> tuple[Sequence[str], ArrayLike, dict[str, str]]:
        return (dims, values, {"units": units, "long_name": long_name})

    settings = [row.setting for row in rows]
    drift = np.array([one.get(name, np.nan) for one in drifts for name in names]).reshape(len(rows), -1)
    tolerances = [s.step_tolerance if s.has_steps else math.nan for s in settings]
    precisions = words(precision_title(s.precision) for s in settings)
    held = np.array([s.hold_invariants for s in settings], dtype=np.int8)
    across = ("setting", "invariant")
    data = xarray.Dataset(
        {
            "status": variable(words(r.status.value for r in rows), "1", "what became of the setting"),
            "reason": variable(words(r.problem for r in rows), "1", "why it was not measured"),
            "attitude_error": variable(error, "rad", "attitude error", ("setting", "time")),
            **{name: variable(columns[name], *said) for name, said in _NUMBERS.items()},
            "drift": variable(drift, "1", "largest relative drift of the invariant", across),
        },
        coords={
            "setting": ("setting", words(s.title for s in settings), {"long_name": "setting"}),
            "precision": variable(precisions, "1", "arithmetic"),
            "tolerance": variable(tolerances, "1", "of the step control"),
            "formulation": variable(words(s.formulation for s in settings), "1", "of the attitude"),
            "held": variable(held, "1", "invariants projected"),
            "method": variable(words(s.method for s in settings), "1", " or ".join(METHODS)),
            "time": ("time", np.array(plan.times), {"units": "s", "long_name": "since start of the scene"}),
            "invariant": ("invariant", words(names), {"long_name": "invariant"}),
        },
        attrs={
            "title": measured.experiment.config.name,
            "config": measured.experiment.text,
            "config_sha256": measured.experiment.sha256,
            "compared": "attitudes, carried in every setting, whatever the config records",
            "reference": measured.reference.how,
            "reference_of_quadruple": measured.wide_reference.how,
            "default_setting": DEFAULT.title,
            "horizon_seconds": span,
            "measured_seconds": plan.part * span,
            "closed_form": "yes" if plan.exact else f"none: {plan.why}",
            "processes": measured.processes,
            "seconds": measured.seconds,
            **versions(),
        },
    )
    front = on_front(data).astype(np.int8)
    data["on_front"] = variable(front, "1", "no other setting is both cheaper and more accurate")
    return data


def trusted_error(dataset: xarray.Dataset) -> np.ndarray:
    """Largest attitude errors, but at least what the reference can resolve."""
    largest, own = dataset["attitude_error_largest"].values, dataset["reference_error"].values
    return np.asarray(np.maximum(largest, own))


def on_front(dataset: xarray.Dataset) -> np.ndarray:
    """Whether no setting is both cheaper and at least as accurate; only for settings measured over the full
    length, since errors over less of a motion don't compare.
    """
    error, cost = trusted_error(dataset), dataset["cpu_ratio"].values
    fit = (dataset["status"].values == RowStatus.MEASURED.value) & np.isfinite(error) & np.isfinite(cost)
    result = np.zeros(len(error), dtype=bool)
    best = math.inf
    for n in sorted(np.nonzero(fit)[0], key=lambda n: (cost[n], error[n])):
        if error[n] < best:
            best, result[n] = error[n], True
    return result


@dataclass(frozen=True)
class BestSetting:
    """For an attitude error of at most ``at_most`` and more than ``more_than``: the cheapest setting, its
    largest error (rad), its cost relative to the default setting's and in CPU seconds of the part measured,
    and whether it was measured over less than the others, so that costs don't compare.
    """

    at_most: float
    more_than: float
    title: str
    error: float
    cost: float
    seconds: float
    cpu_seconds: float
    less: bool
    keys: tuple[str, ...]


def advice(dataset: xarray.Dataset) -> list[BestSetting]:
    """For each decade of accuracy from 1 rad on, the cheapest setting that reaches it.

    A setting that was measured over less of the motion is named only if no other reaches the accuracy.
    """
    error, cost = trusted_error(dataset), dataset["cpu_ratio"].values
    status = dataset["status"].values
    known = np.isfinite(error) & np.isfinite(cost)
    if not known.any():
        return []
    smallest = max(float(error[known].min()), 1e-60)
    found: list[tuple[int, int, bool]] = []  # exponent, setting, measured over less
    for exponent in range(0, math.floor(math.log10(smallest)) - 1, -1):
        for kind in (RowStatus.MEASURED, RowStatus.SHORT):
            fit = np.nonzero(known & (status == kind.value) & (error <= 10.0**exponent))[0]
            if len(fit):
                found.append((exponent, int(min(fit, key=lambda n: cost[n])), kind is RowStatus.SHORT))
                break
    result: list[BestSetting] = []
    for n, decades in groupby(found, key=lambda best: best[1]):
        same = list(decades)
        (exponent, _, less), (last, _, _) = same[0], same[-1]
        one = dataset.isel(setting=n)
        result.append(
            BestSetting(
                at_most=10.0**exponent,
                more_than=10.0 ** (last - 1),
                title=str(one["setting"].item()),
                error=float(error[n]),
                cost=float(one["cpu_ratio"]),
                seconds=float(one["measured_time"]),
                cpu_seconds=float(one["cpu_seconds"]),
                less=less,
                keys=_keys(one),
            )
        )
    return result


def _keys(one: xarray.Dataset) -> tuple[str, ...]:
    """The setting as lines for ``[integrator]``."""
    precision = precision_titled(str(one["precision"].item()))
    keys = [f"precision = {precision}" if isinstance(precision, int) else f'precision = "{precision}"']
    default, method, tolerance = Setting(precision), one["method"].item(), float(one["tolerance"])
    if method != default.method:
        keys.append(f'method = "{method}"')
    if math.isfinite(tolerance) and tolerance != default.step_tolerance:
        keys.append(f"tolerance = {tolerance:.0e}")
    if one["formulation"].item() != default.formulation:
        keys.append(f'formulation = "{one["formulation"].item()}"')
    if one["held"].item():
        keys.append("hold_invariants = true")
    return tuple(keys)
