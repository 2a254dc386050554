"""A trajectory of another tool beside an experiment: attitude error, drifts and local defects along time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes

from rigidsim.look.figures.style import BLUE, GREY, ORANGE, STYLE, ShownFigure

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

_LEAST = 1e-17
_COLORS = (BLUE, ORANGE, GREY, "#2c8a57", "#8a4fb0", "#b0574f")


def compared_figure(dataset: xarray.Dataset) -> Figure:
    """The figure of a comparison's dataset."""
    with rc_context(STYLE):  # type: ignore[arg-type]
        figure = ShownFigure(figsize=(9, 8.2), layout="constrained")
        error, drift, defect = figure.subplots(3, 1, sharex=True)
        time = dataset["time"].values
        _line(error, time, dataset["attitude_error"].values, BLUE, "attitude, rad")
        if "rate_error" in dataset:
            _line(error, time, dataset["rate_error"].values, ORANGE, "angular velocity, rad/s")
        if "position_error" in dataset:
            _line(error, time, dataset["position_error"].values, GREY, "position, m")
        error.set_title("difference from the experiment")
        names = [str(name) for name in dataset.data_vars if str(name).endswith("_drift")]
        for name, color in zip(names, _COLORS, strict=False):
            _line(drift, time, np.abs(dataset[name].values), color, name[: -len("_drift")].replace("_", " "))
        drift.set_title("drift of invariants, by the trajectory's own numbers")
        if "defect" in dataset:
            starts = dataset["defect_time"].values
            _line(defect, starts, dataset["defect"].values, BLUE, "attitude, rad")
            if "rate_defect" in dataset:
                _line(defect, starts, dataset["rate_defect"].values, ORANGE, "angular velocity, rad/s")
        defect.set_title("local defects: what the equations miss from a row to the next")
        for axes in (error, drift, defect):
            axes.set_yscale("log")
            if axes.lines:
                axes.legend(loc="best", ncols=3)
        defect.set_xlabel("time, s")
        verdict = str(dataset.attrs.get("verdict", "")).replace("_", " ")
        figure.suptitle(f"{dataset.attrs.get('title', '')}: {verdict}")
    return figure


def save_compared(dataset: xarray.Dataset, path: Path, file_format: str = "png") -> Path:
    """Draw the figure to a file."""
    with rc_context(STYLE):  # type: ignore[arg-type]
        compared_figure(dataset).savefig(path, dpi=130, format=file_format)
    return path


def _line(axes: Axes, times: np.ndarray, values: np.ndarray, color: str, label: str) -> None:
    """A line; zeros aren't drawn."""
    axes.plot(times, np.where(values > _LEAST, values, np.nan), color=color, label=label, linewidth=1.1)
