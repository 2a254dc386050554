"""Plots, plane figures, states, the legend and the clock as rerun entities."""

from collections.abc import Sequence
from itertools import cycle
from typing import Any

import numpy as np
import rerun as rr

from rigidsim.look.paths import Path
from rigidsim.look.plots import Plot, screen
from rigidsim.look.signals import joined
from rigidsim.look.solids import Array, Color
from rigidsim.look.stages.parts import NEAR, Arrow, Cone, Line, Stage, Trail, Vector
from rigidsim.look.states import States

PIXELS = 500  # about the width of a plot
_SMOOTH = 0.01  # of a curve's range, by which it may move within a pixel
CLOCK_ROWS = 2000  # largest number of rows of the clock on the screen
_INK: Color = (205, 210, 218)
_FAINT: Color = (90, 96, 108)
LEGEND_COLUMNS = 3
LEGEND_LINE = 0.78
"""Height of a line of the legend, which is 30 units wide: about 24 of 950 points of the screen."""


def plot_path(plot: Plot) -> str:
    """Entity of a plot."""
    return "/plots/" + rr.escape_entity_path_part(plot.name)


def draw_plots(recording: rr.RecordingStream, plots: Sequence[Plot], ends: list[rr.TimeColumn]) -> None:
    """Names and colours of the curves, and lines for values that hold for the whole run, at its ends."""
    for plot in plots:
        style: dict[str, Any] = {
            "names": [label or plot.title for label in plot.labels],
            "colors": [screen(hue) for hue, _ in zip(cycle(plot.hues), plot.labels, strict=False)],
            "widths": [1.5] * len(plot.labels),
        }
        look = (
            rr.SeriesLines(**style, aggregation_policy=aggregation(plot))
            if plot.error is None
            else rr.Measurements.from_fields(**style)
        )
        recording.log(plot_path(plot), look, static=True)
        for number, (label, value) in enumerate(plot.levels.items()):
            path = f"{plot_path(plot)}/level{number}"
            line = rr.SeriesLines(names=[label], colors=[screen("grey")], widths=[1.0])
            recording.log(path, line, static=True)
            scalars = [np.log10(value) if plot.log else value] * 2
            recording.send_columns(path, indexes=ends, columns=rr.Scalars.columns(scalars=scalars))


def draw_plot_rows(
    recording: rr.RecordingStream, plots: Sequence[Plot], times: list[rr.TimeColumn], rows: slice
) -> None:
    """The curves, for the rows of one chunk."""
    for plot in plots:
        values = shown_values(plot)[rows]
        columns: Any = rr.Scalars.columns(scalars=values)
        if plot.error is not None:  # a band of their uncertainty: the viewer draws the root of a variance
            count = values.shape[1]
            variances = np.repeat(plot.error[rows] ** 2, count)
            columns = rr.Measurements.columns(values=values.ravel(), variances=variances)
            columns = columns.partition([count] * len(values))
        recording.send_columns(plot_path(plot), indexes=times, columns=columns)


def shown_values(plot: Plot) -> Array:
    """Values as the viewer shows them: of what has a logarithmic axis the logarithms, and gaps for zeros."""
    if not plot.log:
        return plot.values
    return np.log10(plot.values, where=plot.values > 0, out=np.full_like(plot.values, np.nan))


def aggregation(plot: Plot) -> rr.components.AggregationPolicy:
    """Which of the rows that fall into one pixel the viewer draws: their average, which is smooth, where no
    curve moves by more than a hundredth of its own range within a pixel; else the extremes, as an average
    would show a fast rotation with a vanishing amplitude. Of a drift only the largest counts.
    """
    policies, values = rr.components.AggregationPolicy, plot.values
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


def draw_paths(recording: rr.RecordingStream, paths: Sequence[Path]) -> None:
    """Draw the static parts of plane figures: the whole path, circles, axes."""
    angle = np.linspace(0, 2 * np.pi, 121)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for path in paths:

        def log(name: str, part: rr.AsComponents, entity: str = f"/planes/{path.name}") -> None:
            recording.log(f"{entity}/{name}", part, static=True)

        finite = flipped(path.points[np.isfinite(path.points).all(axis=1)])
        whole = finite[:: max(len(finite) // 4000, 1)]
        bright = screen(path.hue)
        dim: Color = tuple(round(0.5 * x) for x in bright)  # type: ignore[assignment]
        if len(whole) > 1 and path.moves and not path.sparse and joined(whole, NEAR):
            log("whole", _faint([whole], color=dim, width=0.9, order=1.0))
        else:
            log("whole", rr.Points2D(whole, colors=[dim if path.moves else bright], radii=_points(1.6)))
        reach = path.reach
        power = 10.0 ** np.floor(np.log10(reach))
        step = next(s for s in (5, 2, 1, 0.5) if s * power <= 0.75 * reach) * power
        ends = [(1.1 * reach, 0), (0, -1.1 * reach)]
        log("axes", _faint([[(-x, -y), (x, y)] for x, y in ends]))
        log("axes/names", _texts(ends, list(path.labels)))
        for number in (1, 2):
            radius, at = number * step, 0.9 - 0.35 * (number % 2)  # neighbours' labels lie apart
            log(f"rings/{number}", _faint([radius * circle]))
            label = f"{radius:.3g} {path.unit}".strip()
            log(f"rings/{number}/label", _texts([(radius * np.cos(at), radius * np.sin(at))], [label]))
        if path.moves:
            log("now", rr.Points2D.from_fields(colors=[bright], radii=_points(5.0), draw_order=3.0))


def _points(size: float) -> Any:
    return rr.Radius.ui_points(size)


def _faint(strips: Any, *, color: Color = _FAINT, width: float = 0.5, order: float = -1.0) -> rr.LineStrips2D:
    return rr.LineStrips2D(strips, colors=[color], radii=_points(width), draw_order=order)


def _texts(places: Any, labels: list[str]) -> rr.Points2D:
    return rr.Points2D(places, labels=labels, colors=[_INK], radii=0.0, show_labels=True)


def draw_path_rows(
    recording: rr.RecordingStream, paths: Sequence[Path], times: list[rr.TimeColumn], rows: slice
) -> None:
    """The moving points of plane figures."""
    for path in paths:
        if path.moves:
            columns = rr.Points2D.columns(positions=flipped(path.points[rows]).astype(np.float32))
            recording.send_columns(f"/planes/{path.name}/now", indexes=times, columns=columns)


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
