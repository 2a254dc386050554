"""``rigidsim tradeoff``: measure a scene's settings, save the measurement, draw it, and say what to use.

The settings are compared by the attitude, which every one of them carries for that, whatever the config
records. Of a long motion the beginning is measured, as far as a budget of time allows, and nothing is
extrapolated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidsim.bench.measure import Measurement, Row, measure
from rigidsim.bench.plan import DEFAULT
from rigidsim.errors import RunFolderError
from rigidsim.scene.context import working_bits
from rigidsim.scene.reading import Experiment

if TYPE_CHECKING:
    import xarray

DATASET, FIGURE = "tradeoff.h5", "tradeoff.png"
MEASURED, SHORT, LEFT_OUT, FAILED = "measured", "measured over less", "left out", "refused"


@dataclass(frozen=True)
class Advice:
    """For an attitude error of at most ``at_most`` and more than ``more_than``: the cheapest setting.

    Attributes:
        error: its largest attitude error, rad.
        cost: CPU time relative to the default setting's.
        seconds: of the motion that this was measured over.
        less: whether that is less than for the other settings, which is why they don't compare.
        keys: lines of ``[integrator]``.
    """

    at_most: float
    more_than: float
    title: str
    error: float
    cost: float
    seconds: float
    less: bool
    keys: tuple[str, ...]


@dataclass(frozen=True)
class Tradeoff:
    """A measurement as labelled data, and what it says.

    Attributes:
        dataset: dimension ``setting``; see ``dataset_of``.
        folder: where it was saved; None where it wasn't.
    """

    dataset: xarray.Dataset
    folder: Path | None = None

    @property
    def advice(self) -> list[Advice]:
        """For each decade of accuracy that some setting reaches, the cheapest; equal neighbours joined."""
        return advice(self.dataset)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        data = self.dataset
        rows = []
        for n in range(data.sizes["setting"]):
            one = data.isel(setting=n)
            row = {str(name): _plain(one[name].item()) for name in one.variables if not one[name].dims}
            row["drifts"] = {
                str(i): float(one["drift"].sel(invariant=i))
                for i in data["invariant"].values
                if math.isfinite(one["drift"].sel(invariant=i))
            }
            rows.append(row)
        return {
            "name": data.attrs["title"],
            **{key: _plain(value) for key, value in data.attrs.items() if key in _TOLD},
            "advice": [asdict(a) for a in self.advice],
            "settings": rows,
            "folder": None if self.folder is None else str(self.folder),
        }


_TOLD = (
    "compared",
    "reference",
    "horizon_seconds",
    "measured_seconds",
    "closed_form",
    "processes",
    "seconds",
)


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def tradeoff(
    experiment: Experiment,
    *,
    out: str | Path | None = None,
    budget: float = 90.0,
    repeats: int = 3,
    full: bool = False,
    force: bool = False,
    told: Callable[[str], None] = lambda _: None,
) -> Tradeoff:
    """Measure an experiment's settings; save dataset and figure.

    Args:
        out: folder in which ``NAME_tradeoff`` is made; None saves nothing.
        budget: seconds that it may take, roughly.
        repeats: fresh processes in which speeds are taken.
        full: every tolerance in every formulation and precision.
        force: replace an earlier measurement.
        told: called with what is being done.

    Raises:
        ConfigError: the config can't be run.
        RunFolderError: there is an earlier measurement, or the folder can't be written.
    """
    folder = None
    if out is not None:
        folder = Path(out) / f"{experiment.config.name}_tradeoff"
        if (folder / DATASET).exists() and not force:
            raise RunFolderError(
                f"{folder / DATASET}: there is an earlier measurement; give --force to replace it, "
                "or another --out"
            )
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RunFolderError(f"{folder}: can't be made: {error.strerror or error}") from None
    dataset = dataset_of(measure(experiment, budget=budget, repeats=repeats, full=full, told=told))
    result = Tradeoff(dataset, folder)
    if folder is not None:
        save(dataset, folder)
    return result


def save(dataset: xarray.Dataset, folder: Path) -> None:
    """Write dataset and figure, each visible only when it is whole.

    Raises:
        RunFolderError: they can't be written.
    """
    from rigidsim.look.work_precision import save_work_precision
    from rigidsim.store.netcdf import atomic

    try:
        with atomic(folder / DATASET) as temporary:
            dataset.to_netcdf(temporary, engine="h5netcdf")
        save_work_precision(dataset, folder / FIGURE)
    except OSError as error:
        raise RunFolderError(f"{folder}: can't be written: {error.strerror or error}") from None


# --- labelled data ---------------------------------------------------------------------------------------


def dataset_of(measured: Measurement) -> xarray.Dataset:
    """The measurement as xarray data: dimensions ``setting``, ``time``, ``invariant``.

    Errors are in rad, costs relative to the default setting (double precision, quaternions). Where a setting
    was not measured its numbers are nan and ``reason`` says why.
    """
    import xarray

    from rigidsim.store.provenance import versions

    rows, plan = measured.rows, measured.plan
    names = sorted({name for row in rows for name in row.drifts})
    span = plan.end - plan.start
    error = np.full((len(rows), len(plan.times)), np.nan)
    own = np.full(len(rows), np.nan)
    cost = np.full((len(rows), 3), np.nan)
    for n, row in enumerate(rows):
        if row.measured:
            errors, reference = measured.errors(row)
            error[n, : len(errors)], own[n] = errors, float(reference[-1])
            cost[n] = measured.cost(row)
    final = np.array([e[np.isfinite(e)][-1] if np.isfinite(e).any() else np.nan for e in error])
    largest = np.array([np.nanmax(e) if np.isfinite(e).any() else np.nan for e in error])
    text = {"setting": [r.setting.title for r in rows]}
    text |= {"status": [_status(r, plan.part) for r in rows], "reason": [r.problem for r in rows]}
    known = [r.measured for r in rows]

    def numbers(values: Sequence[float]) -> np.ndarray:
        return np.where(known, np.array(values, dtype=np.float64), np.nan)

    def variable(values: Any, units: str, long_name: str, dims: Sequence[str] = ("setting",)) -> Any:
        return (dims, values, {"units": units, "long_name": long_name})

    relative = "relative to the default setting, per simulated second"
    data = xarray.Dataset(
        {
            "status": variable(np.array(text["status"], dtype=object), "1", "what became of the setting"),
            "reason": variable(np.array(text["reason"], dtype=object), "1", "why it was not measured"),
            "attitude_error": variable(error, "rad", "attitude error", ("setting", "time")),
            "attitude_error_final": variable(final, "rad", "attitude error at the end of what was measured"),
            "attitude_error_largest": variable(largest, "rad", "largest attitude error"),
            "reference_error": variable(own, "rad", "error of the reference itself, estimated, at the end"),
            "cpu_ratio": variable(cost[:, 0], "1", f"CPU time, median of the processes, {relative}"),
            "cpu_ratio_least": variable(cost[:, 1], "1", f"CPU time, least of the processes, {relative}"),
            "cpu_ratio_largest": variable(cost[:, 2], "1", f"CPU time, largest of the processes, {relative}"),
            "cpu_seconds": variable(
                numbers([measured.cpu_seconds(r) for r in rows]), "s", "CPU time of the measured part"
            ),
            "steps": variable(numbers([r.steps for r in rows]), "1", "natural Taylor steps"),
            "taylor_order": variable(numbers([r.order for r in rows]), "1", "order of the Taylor series"),
            "work": variable(numbers([r.work for r in rows]), "1", "steps x order^2 x states"),
            "measured_time": variable(
                numbers([row.part * span for row in rows]), "s", "how much of the motion was measured"
            ),
            "drift": variable(
                np.array([[row.drifts.get(name, np.nan) for name in names] for row in rows]).reshape(
                    len(rows), len(names)
                ),
                "1",
                "largest relative drift of the invariant",
                ("setting", "invariant"),
            ),
        },
        coords={
            "setting": ("setting", np.array(text["setting"], dtype=object), {"long_name": "setting"}),
            "precision": variable(np.array([_shown(r) for r in rows], dtype=object), "1", "arithmetic"),
            "tolerance": variable([_tolerance(r) for r in rows], "1", "of the step control"),
            "formulation": variable(
                np.array([r.setting.formulation for r in rows], dtype=object), "1", "of the attitude"
            ),
            "held": variable(
                np.array([r.setting.hold_invariants for r in rows], dtype=np.int8), "1", "invariants put back"
            ),
            "method": variable(
                np.array([r.setting.method for r in rows], dtype=object), "1", "taylor or closed_form"
            ),
            "time": ("time", np.array(plan.times), {"units": "s", "long_name": "since start of the scene"}),
            "invariant": ("invariant", np.array(names, dtype=object), {"long_name": "invariant"}),
        },
        attrs={
            "Conventions": "CF-1.10",
            "title": measured.experiment.config.name,
            "config": measured.experiment.text,
            "config_sha256": measured.experiment.sha256,
            "compared": "attitudes, carried in every setting, whatever the config records",
            "reference": measured.reference.how,
            "reference_of_quadruple": (measured.wide_reference or measured.reference).how,
            "default_setting": DEFAULT.title,
            "horizon_seconds": span,
            "measured_seconds": plan.part * span,
            "closed_form": "yes" if plan.closed else f"none: {plan.why}",
            "processes": measured.processes,
            "seconds": measured.seconds,
            **versions(),
        },
    )
    front = on_front(data)
    data["on_front"] = variable(
        front.astype(np.int8), "1", "no other setting is both cheaper and more accurate"
    )
    return data


def _status(row: Row, part: float) -> str:
    if row.measured:
        return MEASURED if row.part >= part else SHORT
    return LEFT_OUT if row.problem.startswith("left out") else FAILED


def _shown(row: Row) -> str:
    precision = row.setting.precision
    return f"{precision} digits" if isinstance(precision, int) else precision


def _tolerance(row: Row) -> float:
    if row.setting.method == "closed_form":
        return math.nan
    epsilon = 2.0 ** (1 - working_bits(row.setting.precision))
    return epsilon if row.setting.tolerance is None else row.setting.tolerance


# --- what it says ----------------------------------------------------------------------------------------


def trusted_error(dataset: xarray.Dataset) -> np.ndarray:
    """Largest attitude errors, none below what the reference can tell."""
    largest, own = dataset["attitude_error_largest"].values, dataset["reference_error"].values
    return np.asarray(np.maximum(largest, own))


def on_front(dataset: xarray.Dataset) -> np.ndarray:
    """Whether no setting is both cheaper and at least as accurate; only for those measured over all that was
    measured, since errors over less of a motion don't compare.
    """
    error, cost = trusted_error(dataset), dataset["cpu_ratio"].values
    fit = (dataset["status"].values == MEASURED) & np.isfinite(error) & np.isfinite(cost)
    result = np.zeros(len(error), dtype=bool)
    best = math.inf
    for n in sorted(np.nonzero(fit)[0], key=lambda n: (cost[n], error[n])):
        if error[n] < best:
            best, result[n] = error[n], True
    return result


def advice(dataset: xarray.Dataset) -> list[Advice]:
    """For each decade of accuracy from 1 rad on, the cheapest setting that reaches it.

    A setting that was measured over less of the motion is named only where no other reaches the accuracy.
    """
    error, cost = trusted_error(dataset), dataset["cpu_ratio"].values
    status = dataset["status"].values
    known = np.isfinite(error) & np.isfinite(cost)
    if not known.any():
        return []
    smallest = max(float(error[known].min()), 1e-60)
    found: list[tuple[int, int, bool]] = []  # exponent, setting, measured over less
    for exponent in range(0, math.floor(math.log10(smallest)) - 1, -1):
        for kind in (MEASURED, SHORT):
            fit = np.nonzero(known & (status == kind) & (error <= 10.0**exponent))[0]
            if len(fit):
                found.append((exponent, int(min(fit, key=lambda n: cost[n])), kind == SHORT))
                break
    result: list[Advice] = []
    for position, (exponent, n, less) in enumerate(found):
        if position and found[position - 1][1] == n:
            continue
        last = exponent
        for later, other, _ in found[position:]:
            if other != n:
                break
            last = later
        result.append(_advice_of(dataset, n, exponent, last, less, float(error[n])))
    return result


def _advice_of(dataset: xarray.Dataset, n: int, first: int, last: int, less: bool, error: float) -> Advice:
    one = dataset.isel(setting=n)
    return Advice(
        at_most=10.0**first,
        more_than=10.0 ** (last - 1),
        title=str(one["setting"].item()),
        error=error,
        cost=float(one["cpu_ratio"]),
        seconds=float(one["measured_time"]),
        less=less,
        keys=_keys(one),
    )


def _keys(one: xarray.Dataset) -> tuple[str, ...]:
    """Lines for ``[integrator]``."""
    precision = str(one["precision"].item())
    keys = [
        f'precision = "{precision}"' if not precision[0].isdigit() else f"precision = {precision.split()[0]}"
    ]
    if one["method"].item() == "closed_form":
        return (*keys, 'method = "closed_form"')
    tolerance = float(one["tolerance"])
    digits = working_bits(precision if not precision[0].isdigit() else int(precision.split()[0]))
    if tolerance != 2.0 ** (1 - digits):
        keys.append(f"tolerance = {tolerance:.0e}")
    if one["formulation"].item() != "quaternion":
        keys.append(f'formulation = "{one["formulation"].item()}"')
    if one["held"].item():
        keys.append("hold_invariants = true")
    return tuple(keys)
