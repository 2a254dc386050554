"""Plots, plane figures, states, the legend and the clock as rerun entities."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr

from rigidsim.look.plots import Plot
from rigidsim.look.signals import joined
from rigidsim.look.solids import Array
from rigidsim.look.stages.parts import NEAR, Arrow, Color, Cone, Line, Plane, Stage, Trail, Vector
from rigidsim.look.states import States

PIXELS = 500  # about the width of a plot
_SMOOTH = 0.01  # of a curve's range, by which it may move within a pixel
CLOCK_ROWS = 2000  # largest number of rows of the clock on the screen
_INK: Color = (205, 210, 218)
_FAINT: Color = (90, 96, 108)
LEGEND_COLUMNS = 3
LEGEND_LINE = 0.78
"""Height of a line of the legend, which is 30 units wide: about 24 of 950 points of the screen."""


def plot_path(plot: Plot, name: str) -> str:
    """Entity of one variable in one plot."""
    folder = "/plots/drift/" if plot.place == "drift" else "/plots/"
    return folder + rr.escape_entity_path_part(name)


def draw_plot_styles(recording: rr.RecordingStream, plots: Sequence[Plot]) -> None:
    """Names and colours of the curves."""
    for plot in plots:
        for series in plot.series:
            style: dict[str, Any] = {
                "names": series.labels,
                "colors": series.colors,
                "widths": [1.5] * len(series.labels),
            }
            look = (
                rr.SeriesLines(**style, aggregation_policy=aggregation(plot, series.values))
                if series.error is None
                else rr.Measurements.from_fields(**style)
            )
            recording.log(plot_path(plot, series.name), look, static=True)


def draw_plot_rows(
    recording: rr.RecordingStream, plots: Sequence[Plot], times: list[rr.TimeColumn], rows: slice
) -> None:
    """The curves, for the rows of one chunk."""
    for plot in plots:
        for series in plot.series:
            values = series.values[rows]
            if series.error is None:
                columns = rr.Scalars.columns(scalars=values)
            else:  # with a band of their uncertainty: the viewer draws the root of a variance
                count = values.shape[1]
                variances = np.repeat(series.error[rows] ** 2, count)
                columns = rr.Measurements.columns(values=values.ravel(), variances=variances).partition(
                    [count] * len(values)
                )
            recording.send_columns(plot_path(plot, series.name), indexes=times, columns=columns)


def draw_levels(recording: rr.RecordingStream, plots: Sequence[Plot], ends: list[rr.TimeColumn]) -> None:
    """Values that hold for the whole run, as level lines from the first to the last row's time."""
    for plot in plots:
        for level in plot.levels:
            path = plot_path(plot, level.key)
            style = rr.SeriesLines(names=[level.label], colors=[level.color], widths=[1.0])
            recording.log(path, style, static=True)
            columns = rr.Scalars.columns(scalars=[level.value, level.value])
            recording.send_columns(path, indexes=ends, columns=columns)


def aggregation(plot: Plot, values: Array) -> rr.components.AggregationPolicy:
    """Which of the rows (rows, components) that fall into one pixel the viewer draws: their average, which is
    smooth, where no component moves by more than a hundredth of its own range within a pixel; else the
    extremes, as an average would show a fast rotation with a vanishing amplitude. Of a drift only the largest
    counts.
    """
    policies = rr.components.AggregationPolicy
    if plot.place == "drift":
        return policies.Max
    step = len(values) // PIXELS
    if step < 2:
        return policies.Average  # each row has a pixel of its own
    parts = np.arange(0, len(values), step)
    low, high = np.fmin.reduceat(values, parts), np.fmax.reduceat(values, parts)
    ranges = np.fmax.reduce(high) - np.fmin.reduce(low)
    moved = np.fmax.reduce(high - low)
    return policies.Average if (moved <= _SMOOTH * ranges)[np.isfinite(moved)].all() else policies.MinMax


def draw_planes(recording: rr.RecordingStream, planes: Sequence[Plane]) -> None:
    """Draw the static parts of plane figures: the whole path, circles, axes."""
    angle = np.linspace(0, 2 * np.pi, 121)
    for plane in planes:

        def log(name: str, part: rr.AsComponents, path: str = f"/planes/{plane.key}") -> None:
            recording.log(f"{path}/{name}", part, static=True)

        points = flipped(plane.points)
        finite = points[np.isfinite(points).all(axis=1)]
        whole = finite[:: max(len(finite) // 4000, 1)]
        dim: Color = tuple(round(0.5 * x) for x in plane.color)  # type: ignore[assignment]
        if len(whole) > 1 and plane.moves and joined(whole, NEAR):
            log("whole", _faint([whole], color=dim, width=0.9, order=1.0))
        else:
            color = dim if plane.moves else plane.color
            log("whole", rr.Points2D(whole, colors=[color], radii=rr.Radius.ui_points(1.6)))
        margin = 0.1 * plane_reach(plane)
        left, top = np.min(whole, axis=0, initial=0.0) - margin
        right, bottom = np.max(whole, axis=0, initial=0.0) + margin
        log("axes", _faint([[(left, 0), (right, 0)], [(0, top), (0, bottom)]]))
        if any(plane.names):
            log("axes/names", _texts([(right, 0), (0, top)], list(plane.names)))
        for number, (radius, label) in enumerate(plane.rings):
            log(f"rings/{number}", _faint([radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)]))
            at = 0.9 - 0.35 * (number % 2)  # neighbours' labels lie apart
            log(f"rings/{number}/label", _texts([(radius * np.cos(at), radius * np.sin(at))], [label]))
        if plane.moves:
            size = rr.Radius.ui_points(5.0)
            log("now", rr.Points2D.from_fields(colors=[plane.color], radii=size, draw_order=3.0))


def _faint(strips: Any, *, color: Color = _FAINT, width: float = 0.5, order: float = -1.0) -> rr.LineStrips2D:
    return rr.LineStrips2D(strips, colors=[color], radii=rr.Radius.ui_points(width), draw_order=order)


def _texts(places: Any, labels: list[str]) -> rr.Points2D:
    return rr.Points2D(places, labels=labels, colors=[_INK], radii=0.0, show_labels=True)


def draw_plane_rows(
    recording: rr.RecordingStream, planes: Sequence[Plane], times: list[rr.TimeColumn], rows: slice
) -> None:
    """The moving points of plane figures."""
    for plane in planes:
        if plane.moves:
            places = flipped(plane.points[rows]).astype(np.float32)
            columns = rr.Points2D.columns(positions=places)
            recording.send_columns(f"/planes/{plane.key}/now", indexes=times, columns=columns)


def plane_reach(plane: Plane) -> float:
    """Extent of what is drawn of a plane figure, from its origin."""
    finite = plane.points[np.isfinite(plane.points).all(axis=1)]
    return float(np.abs(finite).max(initial=0.0)) or 1.0


def flipped(points: Array) -> Array:
    """Plane points for the viewer, whose second axis points down."""
    return points * np.array([1.0, -1.0])


def legend_of(stages: Sequence[Stage]) -> list[tuple[str, Color]]:
    """Meaning of each colour, once."""
    found: dict[str, Color] = {}
    for stage in stages:
        parts: list[Arrow | Vector | Trail | Line | Cone]
        parts = [*stage.arrows, *stage.vectors, *stage.trails, *stage.lines, *stage.cones]
        for part in parts:
            if part.words:
                found.setdefault(part.words, part.color)
    return list(found.items())


def draw_legend(
    recording: rr.RecordingStream,
    entries: Sequence[tuple[str, Color]],
    clock: list[str],
    times: list[rr.TimeColumn],
) -> None:
    """Draw the legend as a plane figure, 30 units wide and one per line; first the scene's time in words, for
    some of the rows.
    """
    if entries:
        words = [f"■ {words}" for words, _ in entries]
        places = [_legend_place(number + 1) for number in range(len(entries))]
        colors = [color for _, color in entries]
        text = rr.Points2D(places, labels=words, colors=colors, radii=0.0, show_labels=True)
        recording.log("/legend/words", text, static=True)
    style = rr.Points2D.from_fields(colors=[_INK], radii=[0.0], show_labels=True)
    recording.log("/legend/clock", style, static=True)
    columns = rr.Points2D.columns(positions=[_legend_place(0)] * len(clock), labels=clock)
    recording.send_columns("/legend/clock", indexes=times, columns=columns)


def _legend_place(number: int) -> tuple[float, float]:
    width = 30.0 / LEGEND_COLUMNS
    return width * (number % LEGEND_COLUMNS + 0.5), LEGEND_LINE * (number // LEGEND_COLUMNS + 0.06)


def draw_states(recording: rr.RecordingStream, lane: States, times: list[rr.TimeColumn]) -> None:
    """Draw a lane of states over time."""
    path = f"/states/{rr.escape_entity_path_part(lane.name)}"
    values = sorted(set(lane.values))
    colors = [lane.colors[value] for value in values]
    recording.log(path, rr.StateConfiguration(values=values, labels=values, colors=colors), static=True)
    recording.send_columns(path, indexes=times, columns=rr.StateChange.columns(state=lane.values))
