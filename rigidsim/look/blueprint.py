"""The page that the viewer opens with: scene, legend, plots, and summary.

Imports rerun when it is loaded, so load it only where a timeline is written.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.components import LinkAxis

from rigidsim.look.clock import Clock
from rigidsim.look.drawing import OLDER, fades, trail_path, trail_stride
from rigidsim.look.plots import Plot
from rigidsim.look.plotting import LEGEND_LINE, legend_lines, plane_path, plane_reach, plot_path
from rigidsim.look.stages.bodies import Subject, camera
from rigidsim.look.stages.parts import Color, Plane, Stage

SCREEN_SECONDS = 60.0  # the longest that playing a whole run may take
TURN_SECONDS = 3.0  # per turn of the body, when the run has few enough turns for it
TRAIL_ROWS = 1500  # at most in a sliding trail, and never more than a fifth of the run
RECENT = 0.3  # of a sliding trail: its bright part
PIXELS = 800.0  # about the height of the page
_DARK = (18, 20, 26)


def build_blueprint(
    stages: Sequence[Stage],
    plots: Sequence[Plot],
    clock: Clock,
    turns: float,
    *,
    planes: Sequence[Plane] = (),
    subject: Subject | None = None,
    legend: Sequence[tuple[str, Color]] = (),
    states: bool = False,
    pages: Sequence[str] = ("Summary",),
    following: bool = False,
) -> rrb.Blueprint:
    """The layout for stages and plots.

    Args:
        stages: the first is the body's.
        plots: as from `plots.plan_plots`.
        clock: timeline that the page opens on, at its start, and plays.
        turns: how often the body turns during the run, for the playback speed.
        planes: plane figures beside the stages.
        subject: the body, for the eye's place.
        states: whether there are lanes of states.
        pages: text pages by name.
        following: stay at the end of a run that goes on.
    """
    narrow = len(stages) > 1
    spaces: list[rrb.View | rrb.Container] = [
        space_view(stage, clock, narrow=narrow, subject=subject) for stage in stages
    ]
    figures = [plane_view(plane) for plane in planes]
    beside = [tabs(figures)] if figures else []
    shares = [3.0] * len(spaces) + [1.6] * len(beside)
    scene = spaces[0] if len(shares) == 1 else rrb.Horizontal(*spaces, *beside, column_shares=shares)
    texts: list[rrb.View] = [rrb.TextDocumentView(origin=f"/{page.lower()}", name=page) for page in pages]
    more = [plot_view(plot) for plot in plots if plot.place == "more"]
    height = 30.0 + 24.0 * legend_lines(legend)
    left = rrb.Vertical(
        scene,
        legend_view(legend),
        tabs(texts),
        row_shares=[PIXELS * 0.7 - height, height, PIXELS * 0.3],
    )
    right: list[rrb.View | rrb.Container] = [plot_view(plot) for plot in plots if plot.place == "leading"]
    heights = [3.0 if len(right) < 3 else 2.2] * len(right)
    small = [plot_view(plot) for plot in plots if plot.place == "drift"]
    if small or more:
        right.append(tabs([*small, *more]))
        heights.append(1.8)
    if states:
        right.append(rrb.StateTimelineView(origin="/states", name="Events"))
        heights.append(1.2)
    content = (
        rrb.Horizontal(left, rrb.Vertical(*right, row_shares=heights), column_shares=[5, 3.4])
        if right
        else left
    )
    return rrb.Blueprint(
        content,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        time_panel(clock, turns, following=following),
    )


def tabs(views: Sequence[rrb.View]) -> rrb.View | rrb.Container:
    """Views behind tabs, if there are several."""
    return views[0] if len(views) == 1 else rrb.Tabs(*views, active_tab=0)


def time_panel(clock: Clock, turns: float, *, following: bool) -> rrb.TimePanel:
    """The time panel: at the start, playing, at a speed that shows the motion."""
    span = float(abs(clock.ticks[-1] - clock.ticks[0])) or 1.0
    screen = min(max(TURN_SECONDS * turns, 10.0), SCREEN_SECONDS)
    return rrb.TimePanel(
        state="collapsed",
        timeline=clock.name,
        # A duration plays in its seconds per second, a sequence in ticks per second.
        playback_speed=span * clock.seconds_per_tick / screen if clock.duration else 1.0,
        fps=None if clock.duration else span / screen,
        play_state="following" if following else "playing",
        loop_mode="off" if following else "all",
    )


def space_view(stage: Stage, clock: Clock, *, narrow: bool, subject: Subject | None) -> rrb.Spatial3DView:
    """A view of one stage."""
    eye = camera(stage, narrow=narrow, subject=subject)
    count = len(clock.ticks)
    rows = max(min(TRAIL_ROWS, count // 5), 2)
    overrides: dict[Any, Any] = {}
    for trail in stage.trails:
        path = trail_path(stage, trail)
        # A piece of the older part ends where its row is: it must not stand out over the bright one.
        stride = trail_stride(trail)
        fading = fades(trail, stride)
        shown = round(RECENT * rows) if fading else rows
        overrides[f"{path}/recent"] = rrb.VisibleTimeRanges(_window(clock, shown, 0))
        if fading:
            piece = OLDER * stride
            overrides[f"{path}/older"] = rrb.VisibleTimeRanges(_window(clock, max(rows, 2 * piece), 0))
    origin = f"/{stage.root}/{stage.looked_from}" if stage.looked_from else f"/{stage.root}"
    return rrb.Spatial3DView(
        origin=origin,
        contents=f"/{stage.root}/**",
        name=stage.title,
        background=_DARK,
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=eye.position, look_target=eye.target, eye_up=eye.up
        ),
        overrides=overrides,
    )


def _window(clock: Clock, rows: int, until: int) -> list[rr.VisibleTimeRange]:
    """The rows shown, from ``rows`` to ``until`` before the cursor."""
    per_row = float(abs(clock.ticks[-1] - clock.ticks[0])) / max(len(clock.ticks) - 1, 1)
    return [
        rr.VisibleTimeRange(
            name,
            start=rr.TimeRangeBoundary.cursor_relative(seq=-round(rows * size)),
            end=rr.TimeRangeBoundary.cursor_relative(seq=-round(until * size)),
        )
        for name, size in ((clock.name, per_row), ("step", 1.0))
    ]


def plane_view(plane: Plane) -> rrb.Spatial2DView:
    """A view of one plane figure."""
    size = 1.35 * plane_reach(plane)
    middle = np.zeros(2)
    return rrb.Spatial2DView(
        origin=plane_path(plane),
        name=plane.title,
        background=_DARK,
        visual_bounds=rrb.VisualBounds2D(
            x_range=(middle[0] - size, middle[0] + size), y_range=(middle[1] - size, middle[1] + size)
        ),
    )


def legend_view(legend: Sequence[tuple[str, Color]]) -> rrb.Spatial2DView:
    """A view of the legend."""
    lines = legend_lines(legend)
    return rrb.Spatial2DView(
        origin="/legend",
        name="What is shown",
        background=_DARK,
        visual_bounds=rrb.VisualBounds2D(x_range=(0.0, 30.0), y_range=(0.0, LEGEND_LINE * lines)),
    )


def plot_view(plot: Plot) -> rrb.TimeSeriesView:
    """A view of one plot."""
    # Drifts grow upwards along time: their legend stays below, out of the way.
    corner = rrb.Corner2D.RightBottom if plot.place == "drift" else rrb.Corner2D.LeftTop
    return rrb.TimeSeriesView(
        origin="/plots",
        contents=[
            *(plot_path(plot, series.name) for series in plot.series),
            *(plot_path(plot, level.key) for level in plot.levels),
        ],
        name=plot.title,
        plot_legend=rrb.PlotLegend(visible=True, corner=corner),
        axis_y=None if plot.range is None else rrb.ScalarAxis(range=plot.range),
        # Independent axes of infinite range: a long run opens whole.
        axis_x=rrb.TimeAxis(
            link=LinkAxis.Independent,
            view_range=rr.TimeRange(
                start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite()
            ),
        ),
    )
