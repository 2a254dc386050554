"""A trajectory of another tool and an experiment: attitude error, drifts and local defects along time."""

from __future__ import annotations

import numpy as np
import xarray
from matplotlib.figure import Figure

from rigidsim.look.figures.style import PALETTE, sheet, styled

_LEAST = 1e-17
_ERRORS = {"attitude": "rad", "rate": "rad/s", "position": "m"}


@styled
def compared_figure(dataset: xarray.Dataset) -> Figure:
    """The figure of a comparison's dataset."""
    verdict = str(dataset.attrs.get("verdict", "")).replace("_", " ")
    figure = sheet(f"{dataset.attrs.get('title', '')}: {verdict}", 9, 8.2)
    drifts = [str(name) for name in dataset.data_vars if str(name).endswith("_drift")]
    defects = {"defect": "attitude, rad", "rate_defect": "angular velocity, rad/s"}
    panels = {
        "difference from the experiment": {f"{k}_error": f"{k}, {unit}" for k, unit in _ERRORS.items()},
        "drift of invariants, by the trajectory's own numbers": {
            name: name.removesuffix("_drift").replace("_", " ") for name in drifts
        },
        "local defects: what the equations miss from a row to the next": defects,
    }
    for axes, (title, curves) in zip(figure.subplots(3, 1, sharex=True), panels.items(), strict=True):
        for (name, label), color in zip(curves.items(), PALETTE, strict=False):
            if name in dataset:
                size = np.abs(dataset[name].values)
                times = dataset["defect_time" if name in defects else "time"].values
                axes.plot(times, np.where(size > _LEAST, size, np.nan), color=color, label=label, lw=1.1)
        axes.set(title=title, yscale="log")
        if axes.lines:
            axes.legend(loc="best", ncols=3)
    axes.set_xlabel("time, s")
    return figure
