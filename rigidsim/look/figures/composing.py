"""Composition of panels to a page: curves over time on the left, planes on the right, facts below."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from rigidsim.look import signals
from rigidsim.look.figures.panels import OVER_TIME, PLANES, Panel
from rigidsim.look.figures.style import GREY, INK, STYLE, blank
from rigidsim.look.pages import numbers
from rigidsim.look.plots import Plot, moves
from rigidsim.look.thinning import thin
from rigidsim.look.units import clock
from rigidsim.scene.parts_of_values import in_time_order
from rigidsim.scene.readable import span_text, unit_for

ROWS = 20_000  # that a figure draws

_TELLING = 0.5  # changes of sign to a sample: four samples a swing
_CYCLES, _MANY = 14, 60  # swings shown of the start, where there are more than so many
_NAME = 30  # letters that a name in the table has room for
_BANDS = 400  # parts of a panel's width, each with the least and the largest value in it
_CURVE, _PLANE, _FACT = 2.55, 4.7, 0.235  # heights, inches
_WIDE, _NARROW = 12.4, 8.2
_PLANES_WIDE = 5.2  # width of a plane where only planes stand side by side


_Drawn = Sequence[tuple[Panel, Any]]


@dataclass(frozen=True)
class Shown:
    """A dataset's rows as a figure shows them, evenly strided, in memory; and as many consecutive ones from
    the start.
    """

    rows: xarray.Dataset
    start: xarray.Dataset


def shown_rows(dataset: xarray.Dataset) -> Shown:
    """Read the rows that a figure draws of a dataset, possibly lazy."""
    dataset = in_time_order(dataset)
    rows = start = thin(dataset, ROWS).assign_attrs(dataset.attrs)
    if dataset.sizes["time"] > rows.sizes["time"]:
        start = thin(dataset.isel(time=slice(0, ROWS)), ROWS).assign_attrs(dataset.attrs)
    return Shown(rows, start)


def _beginning(shown: Shown, plot: Plot) -> float:
    """Seconds that hold `_CYCLES` swings of curves of ``shown.start``; 0 if the run has few more."""
    seconds, whole = signals.seconds(shown.start), signals.seconds(shown.rows)
    length, span = float(seconds[-1] - seconds[0]), float(whole[-1] - whole[0])
    most = 0
    for column in plot.values.T:
        values = column[np.isfinite(column)]
        if len(values) < 50 or not moves(values):
            continue
        changes = int(np.count_nonzero(np.diff(np.signbit(values - values.mean()))))
        if changes < _TELLING * len(values):  # else samples too sparse to tell swings from a pattern
            most = max(most, changes)
    if length <= 0 or most / 2 * span / length <= _MANY:
        return 0.0
    return 2 * _CYCLES * length / most


def compose(
    shown: Shown, curves: Sequence[str] = (), planes: Sequence[str] = (), *, facts: bool = False
) -> Figure:
    """A page of those panels for which there is data: curves over a common time axis, planes beside
    them or side by side, and below these a table of the motion's own numbers, if wanted.
    """
    over_time = [(OVER_TIME[name], found) for name, found in found_of(OVER_TIME, curves, shown.rows)]
    beside = [(PLANES[name], found) for name, found in found_of(PLANES, planes, shown.rows)]
    table = numbers(shown.rows) if facts else []
    with rc_context(STYLE):  # type: ignore[arg-type]
        if beside and not over_time and not table:
            figure = blank(shown.rows, max(_PLANES_WIDE * len(beside), 6.4), 5.2)
            places = figure.subplots(1, len(beside), squeeze=False)[0]
            for axes, (panel, found) in zip(places, beside, strict=True):
                panel.draw(axes, shown.rows, found)
        else:
            figure = _two_columns(shown, over_time, beside, table)
        figure.draw_without_rendering()  # the layout finds its sizes in this round and that of drawing
    return figure


def found_of(
    panels: Mapping[str, Panel], names: Sequence[str], rows: xarray.Dataset
) -> list[tuple[str, Any]]:
    """Names of those panels that a dataset has something for, with that."""
    found = ((name, panels[name].find(rows)) for name in names)
    return [(name, one) for name, one in found if one is not None]


def _two_columns(shown: Shown, curves: _Drawn, planes: _Drawn, table: list[tuple[str, str]]) -> Figure:
    rows = shown.rows
    right = bool(planes or table)
    below = _FACT * (len(table) + 1) if table else 0.0
    left_height = _CURVE * len(curves) if len(curves) > 1 else 3.6 * len(curves)
    height = max(left_height, _PLANE * len(planes) + below, 2.6)
    both = bool(right and curves)
    figure = blank(rows, _WIDE if both else _NARROW, height)
    outer = figure.add_gridspec(1, 1 + both, width_ratios=[1.38, 1.0] if both else None)
    if curves:
        grid = outer[0].subgridspec(len(curves), 1)
        for k, (panel, plot) in enumerate(curves):
            _curve_panel(figure, grid[k], panel, plot, shown, lowest=k == len(curves) - 1)
    if right:
        heights = [_PLANE] * len(planes) + ([below] if table else [])
        spare = height - sum(heights)
        heights += [spare] if spare > 0.1 else []
        grid = outer[-1].subgridspec(len(heights), 1, height_ratios=heights)
        for row, (panel, found) in enumerate(planes):
            panel.draw(figure.add_subplot(grid[row]), rows, found)
        if table:
            _table(figure.add_subplot(grid[len(planes)]), table)
    return figure


def _curve_panel(
    figure: Figure, place: SubplotSpec, panel: Panel, plot: Plot, shown: Shown, *, lowest: bool
) -> None:
    """Draw it over the whole run; of more swings than can be seen there as a band between the extremes, with
    the first of them beside it.
    """
    begins = first_swings(panel, plot, shown)
    if not begins:
        axes = figure.add_subplot(place)
        panel.draw(axes, shown.rows, plot)
        time_axis(axes, shown.rows, labelled=lowest)
        return
    parts = place.subgridspec(1, 2, width_ratios=[1.7, 1.0], wspace=0.03)
    whole, first = (figure.add_subplot(parts[k]) for k in range(2))
    panel.draw(whole, shown.rows, plot)
    _as_band(whole)
    time_axis(whole, shown.rows, labelled=True)
    draw_first(first, panel, shown, begins)
    legend = first.get_legend()
    if legend is not None:
        legend.remove()
    first.set(ylabel="")
    first.set_title(f"the first {span_text(begins, 2)}", fontweight="normal", color=GREY)


def time_axis(axes: Axes, dataset: xarray.Dataset, *, labelled: bool) -> None:
    """Set a panel's limits to the run's; label the lowest panel."""
    time, _, label = clock(dataset)
    if time[0] != time[-1]:
        axes.set_xlim(time[0], time[-1])
    axes.tick_params(labelbottom=labelled)
    if labelled:
        axes.set_xlabel(label)


def first_swings(panel: Panel, plot: Plot, shown: Shown) -> float:
    """Seconds of the start that a panel shows by itself; 0 if the whole run can be followed."""
    start = panel.find(shown.start) if plot.begins else None
    return 0.0 if start is None else _beginning(shown, start)


def draw_first(axes: Axes, panel: Panel, shown: Shown, begins: float) -> None:
    """Draw a panel over so many seconds of the start, in a unit of time that suits them."""
    start = shown.start.assign_attrs(time_unit=unit_for(begins).symbol)
    panel.draw(axes, start, panel.find(start))
    for line in axes.get_lines():
        if line.get_linestyle() == "None":  # few enough now to be told apart, and to be followed
            line.set(linestyle="-", linewidth=0.6, markersize=5.0)
    time, unit, _ = clock(start)
    axes.set(xlim=(time[0], time[0] + begins / unit.seconds), xlabel=f"time [{unit.symbol}]")


def _as_band(axes: Axes) -> None:
    """Replace curves that are denser than the panel by the band between their extremes."""
    for line in list(axes.get_lines()):
        x, y = (np.asarray(values, dtype=np.float64) for values in (line.get_xdata(), line.get_ydata()))
        per_part = len(x) // _BANDS
        if per_part < 4:
            continue
        parts = np.arange(0, len(x), per_part)
        low, high = np.fmin.reduceat(y, parts), np.fmax.reduceat(y, parts)
        places = np.append(x[parts[:-1]], x[-1]) if len(parts) > 1 else x[parts]
        color = line.get_color()
        axes.fill_between(places, low, high, color=color, alpha=0.35, lw=0.6)
        line.set(visible=False)


def _table(axes: Axes, lines: list[tuple[str, str]]) -> None:
    axes.set_axis_off()
    for row, (name, value) in enumerate(lines):
        height = 1.0 - (row + 0.5) / (len(lines) + 1)
        fitting = min(9.0, 9.0 * _NAME / len(name))
        axes.text(0.04, height, name, color=GREY, fontsize=fitting, va="center", clip_on=False)
        axes.text(0.56, height, value, color=INK, fontsize=9, va="center", clip_on=False)
