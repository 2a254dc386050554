"""Plots, plane figures, states, the legend and the clock as rerun entities, with paths from the root."""

from collections.abc import Callable, Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rigidsim.look.curves import Plot, screen
from rigidsim.look.paths import Path
from rigidsim.look.signals import joined
from rigidsim.look.solids import Array, Color
from rigidsim.look.stages.parts import NEAR, Columns, Part, Rows, Stage, points_wide
from rigidsim.look.states import States

CLOCK_ROWS = 2000  # largest number of rows of the clock on the screen
_INK: Color = (205, 210, 218)
_FAINT: Color = (90, 96, 108)
LEGEND_COLUMNS = 3
LEGEND_LINE = 0.78
"""Height of a line of the legend, which is 30 units wide: about 24 of 950 points of the screen."""


def plot_path(plot: Plot) -> str:
    """Entity of a plot."""
    return "plots/" + rr.escape_entity_path_part(plot.name)


def plot_parts(plot: Plot) -> list[Part]:
    """Curves with their names and colours, and lines for values that hold for the whole run, at its ends."""
    path, shown = plot_path(plot), plot.values
    count = shown.shape[1]
    if plot.log:  # the logarithms, and gaps for zeros
        shown = np.log10(shown, where=shown > 0, out=np.full_like(shown, np.nan))
    style: dict[str, Any] = {
        "names": [label or plot.title for label in plot.labels],
        "colors": [screen(hue) for hue, _ in zip(cycle(plot.hues), plot.labels, strict=False)],
        "widths": [1.5] * len(plot.labels),
    }

    def columns(rows: Rows) -> Columns:
        values = shown[rows]
        if plot.error is None:
            return rr.Scalars.columns(scalars=values)
        # a band of their uncertainty: the viewer draws the root of a variance
        variances = np.repeat(plot.error[rows] ** 2, count)
        found = rr.Measurements.columns(values=values.ravel(), variances=variances)
        return found.partition([count] * len(values))

    # of rows that fall into one pixel the extremes, as an average would show a fast rotation with a vanishing
    # amplitude; of a drift only the largest counts
    policies = rr.components.AggregationPolicy
    policy = policies.Max if plot.place == "drift" else policies.MinMax
    look: rr.AsComponents = rr.Measurements.from_fields(**style)
    if plot.error is None:
        look = rr.SeriesLines(**style, aggregation_policy=policy)
    found = [Part(path, [look], columns)]
    for number, (label, value) in enumerate(plot.levels.items()):
        line = rr.SeriesLines(names=[label], colors=[screen("grey")], widths=[1.0])
        level = np.full(len(shown), np.log10(value) if plot.log else value)
        moving, ends = _scalars(level), np.array([0, len(shown) - 1])
        found.append(Part(f"{path}/level{number}", [line], moving, only=ends))
    return found


def _scalars(values: Array) -> Callable[[Rows], Columns]:
    return lambda rows: rr.Scalars.columns(scalars=values[rows])


def plane_parts(plane: Path) -> list[Part]:
    """A plane figure: the whole path, circles, axes, and the moving point."""
    points, root, bright = flipped(plane.points), f"planes/{plane.name}", screen(plane.hue)
    dim = tuple(round(0.5 * x) for x in bright)
    finite = points[np.isfinite(points).all(axis=1)]
    whole = finite[:: max(len(finite) // 4000, 1)]
    drawn: Any = rr.Points2D(whole, colors=[dim if plane.moves else bright], radii=points_wide(1.6))
    if len(whole) > 1 and plane.moves and not plane.sparse and joined(whole, NEAR):
        drawn = rr.LineStrips2D([whole], colors=[dim], radii=points_wide(0.9), draw_order=1.0)
    ends = 1.1 * plane.reach * np.array([[1, 0], [0, -1]])
    found = [
        Part(f"{root}/whole", [drawn]),
        Part(f"{root}/axes", [_faint([[-end, end] for end in ends])]),
        Part(f"{root}/axes/names", [_texts(ends, plane.labels)]),
    ]
    angle = np.linspace(0, 2 * np.pi, 121)
    power = 10.0 ** np.floor(np.log10(plane.reach))
    step = next(s for s in (5, 2, 1, 0.5) if s * power <= 0.75 * plane.reach) * power
    for number in (1, 2):
        radius, at = number * step, 0.9 - 0.35 * (number % 2)  # neighbours' labels lie apart
        ring, label = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1), f"{radius:.3g} {plane.unit}"
        place = radius * np.array([[np.cos(at), np.sin(at)]])
        found.append(Part(f"{root}/rings/{number}", [_faint([ring])]))
        found.append(Part(f"{root}/rings/{number}/label", [_texts(place, [label.strip()])]))
    if plane.moves:
        dot = rr.Points2D.from_fields(colors=[bright], radii=points_wide(5.0), draw_order=3.0)

        def now(rows: Rows) -> Columns:
            return rr.Points2D.columns(positions=points[rows].astype(np.float32))

        found.append(Part(f"{root}/now", [dot], now))
    return found


def _faint(strips: Any) -> rr.LineStrips2D:
    return rr.LineStrips2D(strips, colors=[_FAINT], radii=points_wide(0.5), draw_order=-1.0)


def _texts(places: Any, labels: Sequence[str], colors: Sequence[Color] = (_INK,)) -> rr.Points2D:
    return rr.Points2D(places, labels=list(labels), colors=list(colors), radii=0.0, show_labels=True)


def flipped(points: Array) -> Array:
    """Plane points for the viewer, whose second axis points down."""
    return points * np.array([1.0, -1.0])


def legend_of(stages: Sequence[Stage]) -> dict[str, Color]:
    """Colours of parts by what they mean."""
    found: dict[str, Color] = {}
    for part in (part for stage in stages for part in stage.parts if part.words):
        found.setdefault(part.words, part.color)
    return found


def legend_parts(entries: Mapping[str, Color], times: Sequence[str], rows: NDArray[np.int64]) -> list[Part]:
    """The legend as a plane figure, 30 units wide, and before it the scene's time in words at some rows."""
    width = 30.0 / LEGEND_COLUMNS
    places = [
        (width * (number % LEGEND_COLUMNS + 0.5), LEGEND_LINE * (number // LEGEND_COLUMNS + 0.06))
        for number in range(1 + len(entries))
    ]
    texts = [f"■ {words}" for words in entries]
    style = rr.Points2D.from_fields(colors=[_INK], radii=[0.0], show_labels=True)
    numbers = dict(zip(rows.tolist(), times, strict=True))

    def clock(picked: Rows) -> Columns:
        labels = [numbers[row] for row in np.asarray(picked).tolist()]
        return rr.Points2D.columns(positions=places[:1] * len(labels), labels=labels)

    words = [Part("legend/words", [_texts(places[1:], texts, list(entries.values()))])] if entries else []
    return [*words, Part("legend/clock", [style], clock, only=rows)]


def draw_states(recording: rr.RecordingStream, lane: States, times: list[rr.TimeColumn]) -> None:
    """Draw a lane of states over time."""
    path = f"/states/{rr.escape_entity_path_part(lane.name)}"
    values = sorted(set(lane.values))
    colors = [lane.colors[value] for value in values]
    recording.log(path, rr.StateConfiguration(values=values, labels=values, colors=colors), static=True)
    recording.send_columns(path, indexes=times, columns=rr.StateChange.columns(state=lane.values))
