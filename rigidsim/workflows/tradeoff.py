"""``rigidsim tradeoff``: measure a scene's settings, save and draw the measurement, and say what to use.

The settings are compared by the attitude, which each of them carries for this purpose, whatever the config
records. For a long motion the beginning is measured, as far as a time budget allows, and nothing is
extrapolated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidsim.accuracy.bench import ATTRIBUTES, DEFAULT, BestSetting, advice, measure
from rigidsim.errors import RigidsimError, RunFolderError
from rigidsim.scene.choices import FULL
from rigidsim.scene.config import Experiment
from rigidsim.store.outputs import refuse_loss, write_drawn
from rigidsim.workflows.compare.compared import Comparison, compare
from rigidsim.workflows.plan import compared_levels
from rigidsim.workflows.read import Given, as_experiment

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

DATASET, FIGURE = "tradeoff.h5", "tradeoff.png"


@dataclass(frozen=True, repr=False)
class Tradeoff:
    """A measurement as labelled data (``rigidsim.accuracy.bench.measure``), and the advice drawn from it."""

    dataset: xarray.Dataset
    folder: Path | None = None

    @property
    def advice(self) -> list[BestSetting]:
        """The cheapest setting for each decade of accuracy that some setting reaches; equal neighbours are
        merged.
        """
        return advice(self.dataset)

    def plot(self) -> Figure:
        """The work-precision figure."""
        from rigidsim.look.figures.work_precision import work_precision_figure

        return work_precision_figure(self.dataset)

    def __repr__(self) -> str:
        best = "; ".join(f"{a.error:.1e} rad at {a.cost:.3g}: {', '.join(a.keys)}" for a in self.advice)
        return f"<Tradeoff of {self.dataset.attrs['title']!r}: {best}>"

    def as_dict(self) -> dict[str, Any]:
        """Values for JSON."""
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
            "models": [
                {
                    "level": str(one["model"].item()),
                    "error_rad": float(one["model_error"]),
                    "cpu_ratio": float(one["model_cpu_ratio"]),
                }
                for one in (data.isel(model=n) for n in range(data.sizes.get("model", 0)))
            ],
            "others": [
                {
                    "name": str(one["other"].item()),
                    "verdict": str(one["other_verdict"].item()),
                    "error_rad": float(one["other_error"]),
                    "cpu_ratio": float(one["other_cpu_ratio"]),
                }
                for one in (data.isel(other=n) for n in range(data.sizes.get("other", 0)))
            ],
            **{key: _plain(value) for key, value in data.attrs.items() if key in ATTRIBUTES},
            "advice": [asdict(a) for a in self.advice],
            "settings": rows,
            "folder": None if self.folder is None else str(self.folder),
        }


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def tradeoff(
    experiment: Given,
    *,
    others: Sequence[tuple[str | Path, float]] = (),
    out: str | Path | None = None,
    budget: float = 90.0,
    repeats: int = 3,
    full: bool = False,
    force: bool = False,
    told: Callable[[str], None] = lambda _: None,
) -> Tradeoff:
    """Measure an experiment's settings, of a ``full`` measurement every tolerance in every formulation and
    precision, in about ``budget`` seconds, speeds in ``repeats`` fresh processes; save dataset and figure in
    ``out/NAME_tradeoff`` unless that is None. ``others`` are trajectories of other tools with the CPU time
    (s) that each took. Raises ``ConfigError`` and ``RunFolderError``.
    """
    experiment = as_experiment(experiment)
    folder = None
    if out is not None:
        folder = Path(out) / f"{experiment.config.name}_tradeoff"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RunFolderError(f"{folder}: can't be made: {error.strerror or error}") from None
        read = [*experiment.files, *(Path(file) for file, _ in others)]
        refuse_loss([folder / DATASET, folder / FIGURE], read, force=force)
    judged = [_judged(experiment, file, seconds) for file, seconds in others]  # before what takes long
    resolved = experiment
    if experiment.config.model.level != FULL:
        resolved = experiment.with_overrides([f'model.level="{FULL}"', "model.short_period=false"])
    dataset = measure(resolved, budget=budget, repeats=repeats, full=full, report=told)
    dataset = with_others(with_models(dataset, experiment), judged)
    result = Tradeoff(dataset, folder)
    if folder is not None:
        write_drawn(dataset, folder / DATASET, result.plot(), folder / FIGURE)
    return result


def _judged(experiment: Experiment, file: str | Path, seconds: float) -> tuple[Comparison, float]:
    """A trajectory's comparison, and its CPU time."""
    if not (math.isfinite(seconds) and seconds > 0):
        raise RigidsimError(f"{file}: given {seconds:g} s; a positive CPU time, in s, is allowed")
    return compare(experiment, Path(file)), seconds


def with_others(dataset: xarray.Dataset, judged: Sequence[tuple[Comparison, float]]) -> xarray.Dataset:
    """The dataset with trajectories of other tools, and their CPU times (s), as points of the figure.

    Added along ``other``: ``other_error``, rad, the largest in the part of the motion that was measured;
    ``other_cpu_ratio``, over the default setting, both per simulated second; ``other_verdict``.
    """
    if not judged:
        return dataset
    default = dataset.sel(setting=DEFAULT.title)
    usual = float(default["cpu_seconds"]) / float(default["measured_time"])
    end = float(dataset["time"].values[-1])
    errors = []
    for found, _ in judged:
        error = found.dataset["attitude_error"]
        errors.append(float((error[error["time"] <= end] if error["time"][0] <= end else error).max()))
    ratios = [seconds / found.span_s / usual for found, seconds in judged]
    what = "largest attitude error of another tool's trajectory"
    relative = "CPU time, as it was given, relative to the default setting, per simulated second"
    return dataset.assign(
        other_error=("other", np.array(errors), {"units": "rad", "long_name": what}),
        other_cpu_ratio=("other", np.array(ratios), {"units": "1", "long_name": relative}),
        other_verdict=("other", np.array([found.verdict for found, _ in judged], dtype=object)),
    ).assign_coords(other=("other", np.array([Path(found.source).stem for found, _ in judged], dtype=object)))


def with_models(dataset: xarray.Dataset, experiment: Experiment) -> xarray.Dataset:
    """The dataset with errors and costs of averaged models, if the config says anything about models.

    Added along ``model``: ``model_error``, rad, of axes at the end of the whole motion; ``model_cpu_ratio``,
    over the cost of the full model in the default setting, both from short pilots.
    """
    rows = compared_levels(experiment, None)
    full = next((row.cpu_seconds for row in rows if row.level == FULL), None)
    known = [
        (r.level, r.error_rad, r.cpu_seconds / full) for r in rows if r.error_rad and r.cpu_seconds and full
    ]
    if not known:
        return dataset
    levels, errors, ratios = (list(column) for column in zip(*known, strict=True))
    what = "error of the momentum's and the figure axis' direction at the end"
    relative = "CPU time relative to the full model in the default setting"
    return dataset.assign(
        model_error=("model", np.array(errors), {"units": "rad", "long_name": what}),
        model_cpu_ratio=("model", np.array(ratios), {"units": "1", "long_name": relative}),
    ).assign_coords(model=("model", np.array(levels, dtype=object), {"long_name": "averaged model"}))
