"""Composition of panels to a page: curves over time on the left, planes on the right, facts below."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from rigidsim.look import signals
from rigidsim.look.figures import timelines
from rigidsim.look.figures.panel import Panel, clock
from rigidsim.look.figures.style import GREY, INK, STYLE, ShownFigure, blank
from rigidsim.look.page import largest_drift
from rigidsim.look.signals import by_role, in_words, is_averaged, read_config
from rigidsim.look.thinning import thin
from rigidsim.scene.readable import span_text, unit_for

ROWS, FULL_READ = 20_000, 2_000_000  # that a figure draws; that are read for the largest drift

_TELLING = 0.5  # changes of sign to a sample: four samples a swing
_CYCLES, _MANY = 14, 60  # swings shown of the start, where there are more than so many
_NAME = 38  # letters that a name in the table has room for
_BANDS = 400  # parts of a panel's width, each with the least and the largest value in it
_CURVE, _PLANE, _FACT = 2.55, 4.7, 0.235  # heights, inches
_WIDE, _NARROW = 12.4, 8.2
_PLANES_WIDE = 5.2  # width of a plane where only planes stand side by side


@dataclass(frozen=True)
class Shown:
    """A dataset's rows as a figure shows them, evenly strided, in memory; as many consecutive ones from the
    start; the largest magnitude of each invariant's drift, and whether every sample was read for it.
    """

    rows: xarray.Dataset
    start: xarray.Dataset
    largest: dict[str, float]
    complete: bool


def shown_rows(dataset: xarray.Dataset) -> Shown:
    """Read the rows that a figure draws of a dataset, possibly lazy, and all drifts of one not too long."""
    rows = thin(dataset, ROWS).assign_attrs(dataset.attrs)
    # A figure of few points shouldn't understate the drifts, unless reading them all takes long.
    complete = dataset.sizes["time"] <= max(FULL_READ, rows.sizes["time"])
    whole = dataset if complete else rows
    largest = {name: largest_drift(drift) for name, drift in by_role(whole, "drift_of").items()}
    start = rows
    if dataset.sizes["time"] > rows.sizes["time"]:
        start = thin(dataset.isel(time=slice(0, ROWS)), ROWS).assign_attrs(dataset.attrs)
    return Shown(rows, start, largest, complete)


def _beginning(axes: Axes, shown: Shown) -> float:
    """Seconds that hold `_CYCLES` swings of the curves drawn of `shown.start`; 0 if the run has few more."""
    seconds, whole = signals.seconds(shown.start), signals.seconds(shown.rows)
    length, span = float(seconds[-1] - seconds[0]), float(whole[-1] - whole[0])
    most = 0
    for line in axes.get_lines():
        values = np.asarray(line.get_ydata(), dtype=np.float64)
        values = values[np.isfinite(values)]
        if len(values) < 50 or not timelines.moves(values):
            continue
        values = values - values.mean()
        changes = int(np.count_nonzero(np.diff(np.signbit(values))))
        if line.get_linestyle() == "None" and changes > _TELLING * len(values):
            continue  # samples too sparse to tell swings from a pattern
        most = max(most, changes)
    if length <= 0 or most / 2 * span / length <= _MANY:
        return 0.0
    return 2 * _CYCLES * length / most


def compose(
    shown: Shown, curves: Sequence[Panel] = (), planes: Sequence[Panel] = (), *, facts: bool = False
) -> Figure:
    """A page of those panels for which there is data: curves over a common time axis, planes beside
    them or side by side, and below these a table of what was run and what was conserved, if wanted.
    """
    curves = [panel for panel in curves if panel.shows(shown.rows)]
    planes = [panel for panel in planes if panel.shows(shown.rows)]
    table = facts_of(shown) if facts else []
    with rc_context(STYLE):  # type: ignore[arg-type]
        figure = _side_by_side(shown.rows, planes) if planes and not curves and not table else None
        if figure is None:
            figure = _two_columns(shown, curves, planes, table)
        figure.draw_without_rendering()  # the layout finds its sizes in this round and that of drawing
    return figure


def _side_by_side(rows: xarray.Dataset, planes: Sequence[Panel]) -> Figure:
    figure = blank(rows, max(_PLANES_WIDE * len(planes), 6.4), 5.2)
    for axes, panel in zip(figure.subplots(1, len(planes), squeeze=False)[0], planes, strict=True):
        panel.draw(axes, rows)
    return figure


def _two_columns(
    shown: Shown, curves: Sequence[Panel], planes: Sequence[Panel], table: list[tuple[str, str]]
) -> Figure:
    rows = shown.rows
    right = bool(planes or table)
    below = _FACT * (len(table) + 1) if table else 0.0
    left_height = _CURVE * len(curves) if len(curves) > 1 else 3.6 * len(curves)
    height = max(left_height, _PLANE * len(planes) + below, 2.6)
    figure = blank(rows, _WIDE if right and curves else _NARROW, height)
    outer = figure.add_gridspec(
        1, 2 if right and curves else 1, width_ratios=[1.38, 1.0] if right and curves else None
    )
    if curves:
        grid = outer[0].subgridspec(len(curves), 1)
        for k, panel in enumerate(curves):
            _curve_panel(figure, grid[k], panel, shown, lowest=k == len(curves) - 1)
    if right:
        heights = [_PLANE] * len(planes) + ([below] if table else [])
        spare = height - sum(heights)
        grid = outer[-1].subgridspec(
            len(heights) + (spare > 0.1), 1, height_ratios=heights + ([spare] if spare > 0.1 else [])
        )
        for row, panel in enumerate(planes):
            panel.draw(figure.add_subplot(grid[row]), rows)
        if table:
            _table(figure.add_subplot(grid[len(planes)]), table)
    return figure


def _curve_panel(figure: Figure, place: SubplotSpec, panel: Panel, shown: Shown, *, lowest: bool) -> None:
    """Draw it over the whole run; of more swings than can be seen there as a band between the extremes, with
    the first of them beside it.
    """
    begins = first_swings(panel, shown)
    if not begins:
        axes = figure.add_subplot(place)
        panel.draw(axes, shown.rows)
        timelines.time_axis(axes, shown.rows, labelled=lowest)
        return
    parts = place.subgridspec(1, 2, width_ratios=[1.7, 1.0], wspace=0.03)
    whole, first = (figure.add_subplot(parts[k]) for k in range(2))
    panel.draw(whole, shown.rows)
    _as_band(whole)
    timelines.time_axis(whole, shown.rows, labelled=True)
    draw_first(first, panel, shown, begins)
    legend = first.get_legend()
    if legend is not None:
        legend.remove()
    first.set(ylabel="")
    first.set_title(f"the first {span_text(begins, 2)}", fontweight="normal", color=GREY)


def first_swings(panel: Panel, shown: Shown) -> float:
    """Seconds of the start that a panel shows by itself; 0 if the whole run can be followed."""
    if not panel.begins:
        return 0.0
    trial = ShownFigure(figsize=(6.0, 3.0)).add_subplot()
    panel.draw(trial, shown.start)
    return _beginning(trial, shown)


def draw_first(axes: Axes, panel: Panel, shown: Shown, begins: float) -> None:
    """Draw a panel over so many seconds of the start, in a unit of time that suits them."""
    start = shown.start.assign_attrs(time_unit=unit_for(begins).symbol)
    panel.draw(axes, start)
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


def facts_of(shown: Shown) -> list[tuple[str, str]]:
    """Table rows of what was run and what was conserved."""
    dataset = shown.rows
    integrator = read_config(dataset).get("integrator", {})
    status = str(dataset.attrs.get("status", ""))
    kind = "model" if is_averaged(dataset.attrs) else "formulation"
    lines = [
        (name, str(value))
        for name, value in (
            ("status", status if status != "finished" else ""),
            (kind, dataset.attrs.get("formulation") or integrator.get("formulation")),
            ("precision", dataset.attrs.get("precision") or integrator.get("precision")),
            ("tolerance", integrator.get("tolerance")),
            ("steps", dataset.attrs.get("steps")),
        )
        if value not in (None, "")
    ]
    if "attitude_error" in dataset.attrs:
        what = "axis integrated to" if is_averaged(dataset.attrs) else "attitude uncertain by"
        lines.append((what, f"{float(dataset.attrs['attitude_error']):.1e} rad"))
    bound = "" if shown.complete else "≥ "  # of the samples that were read
    for name, drift in shown.largest.items():
        largest = f"{drift:.1e}" if drift else "0"
        lines.append((f"largest drift, {in_words(name)}", bound + largest))
    return lines


def _table(axes: Axes, lines: list[tuple[str, str]]) -> None:
    axes.set_axis_off()
    for row, (name, value) in enumerate(lines):
        height = 1.0 - (row + 0.5) / (len(lines) + 1)
        fitting = min(9.0, 9.0 * _NAME / len(name))
        axes.text(0.04, height, name, color=GREY, fontsize=fitting, va="center", clip_on=False)
        axes.text(0.70, height, value, color=INK, fontsize=9, va="center", clip_on=False)
