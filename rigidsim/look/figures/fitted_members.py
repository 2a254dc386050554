"""Figure of a sweep of fits: what each member estimated, with its sigma, over the swept values."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rigidsim.look.figures import sweep_axes
from rigidsim.look.figures.style import GREY, INK, PALETTE, blank, key, titled
from rigidsim.look.units import pretty_unit

_MOST_PANELS = 14
_COLUMNS = 2
_PANEL = 1.75  # inches high
_MOST_LINES = 6  # values of a second axis, each with a colour
_APART = 0.012  # of the axis, between members of different colours
_SAME = 1e-12  # relative difference of starts that are the same


def holds_fits(dataset: xarray.Dataset) -> bool:
    """Whether a sweep's members are fits."""
    return "parameter" in dataset.dims and {"value", "sigma", "converged"} <= set(dataset.data_vars)


def fitted_members_figure(dataset: xarray.Dataset) -> Figure:
    """A panel for each parameter: estimates with bars of one sigma over the longest axis, in colours by a
    second one; dashed where all fits began, hollow without sigma, crosses where a fit didn't converge. The
    last panel has the residuals in their sigmas.
    """
    dims = sweep_axes.axes_of(dataset)
    longest = sorted(dims, key=lambda dim: -dataset.sizes[dim])[:2]
    axis = longest[0]
    other = next((dim for dim in longest[1:] if 1 < dataset.sizes[dim] <= _MOST_LINES), None)
    cut = dataset.isel({dim: 0 for dim in dims if dim not in (axis, other)})
    said = [f"{dim.replace('_', ' ')} {sweep_axes.label_of(dataset, dim, 0)}" for dim in dims
            if dim not in (axis, other)]  # fmt: skip
    count = min(cut.sizes["parameter"], _MOST_PANELS - 1)
    rows = math.ceil((count + 1) / _COLUMNS)
    figure = blank(dataset, 11.0, _PANEL * rows + 1.2)
    panels = np.ravel(figure.subplots(rows, _COLUMNS, squeeze=False))
    for n, axes in enumerate(panels[:count]):
        _parameter(axes, cut.isel(parameter=n), axis, other, told=n == 0)
    _members(panels[count], cut, axis, other, cut["scale"], None)
    panels[count].axhline(1.0, color=GREY, lw=1.0, ls="--")
    panels[count].set_ylabel("in sigmas")
    titled(panels[count], "; ".join(["Residuals", *said]))
    for empty in panels[count + 1 :]:
        empty.set_visible(False)
    place, label, _ = sweep_axes.along(dataset, axis)
    for n, axes in enumerate(panels[: count + 1]):
        if sweep_axes.geometric(place):
            axes.set_xscale("log")
        sweep_axes.number_ticks(axes.xaxis, dataset, axis, along_x=True)
        lowest = n + _COLUMNS > count
        axes.tick_params(labelbottom=lowest)
        axes.set_xlabel(label if lowest else "")
    return figure


def _parameter(axes: Axes, one: xarray.Dataset, axis: str, other: str | None, *, told: bool) -> None:
    """Estimates of one parameter; the key is told in one of the panels."""
    starts = np.unique(one["start"].values[np.isfinite(one["start"].values)])
    if len(starts) and np.ptp(starts) <= _SAME * np.abs(starts).max():
        axes.axhline(float(starts[0]), color=GREY, lw=1.0, ls="--", label="start")
    _members(axes, one, axis, other, one["value"], one["sigma"])
    unit = pretty_unit(str(one["parameter_unit"].values))
    axes.set_ylabel("" if unit == "1" else unit)
    title = str(one["parameter"].values)
    if told:
        key(axes, title)
    else:
        titled(axes, title)


def _members(
    axes: Axes, cut: xarray.Dataset, axis: str, other: str | None, values: xarray.DataArray, sigmas: Any
) -> None:
    place, _, _ = sweep_axes.along(cut, axis)
    count = cut.sizes[other] if other else 1
    log = sweep_axes.geometric(place)
    width = _APART * (float(np.ptp(place)) or 1.0) if count > 1 and not log else 0.0
    for n in range(count):
        here = {other: n} if other else {}
        value = values.isel(here).values
        sigma = np.full(len(value), np.nan) if sigmas is None else sigmas.isel(here).values
        good = cut["converged"].isel(here).values == 1
        at = place + width * (n - (count - 1) / 2)
        color = PALETTE[n % len(PALETTE)]
        known = good & (np.isfinite(sigma) if sigmas is not None else True)
        axes.errorbar(
            at[known], value[known], yerr=None if sigmas is None else sigma[known], fmt="o", ms=3.6, lw=1.2,
            color=color, label=sweep_axes.label_of(cut, other, n) if other else "estimate, 1 sigma",
        )  # fmt: skip
        axes.plot(at[good & ~known], value[good & ~known], "o", ms=4.2, mfc="none", color=color)
        axes.plot(at[~good], value[~good], "x", ms=4.2, color=INK)
