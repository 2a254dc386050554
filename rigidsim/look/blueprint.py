"""The page that the viewer opens with: the body beside its plots and the summary.

Imports rerun when it is loaded, so load it only where a timeline is written.
"""

from __future__ import annotations

from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.components import LinkAxis

from rigidsim.look.clock import Clock
from rigidsim.look.drawing import plot_path, trail_path
from rigidsim.look.plots import Plot
from rigidsim.look.stage import Stage, camera

SCREEN_SECONDS = 60.0  # the longest that playing a whole run may take
TURN_SECONDS = 3.0  # per turn of the body, when the run has few enough turns for it
TRAIL_ROWS = 1500  # at most in a sliding trail, and never more than a fifth of the run


def build_blueprint(
    stages: Sequence[Stage], plots: Sequence[Plot], clock: Clock, turns: float
) -> rrb.Blueprint:
    """The layout for stages and plots.

    Args:
        stages: the first is the body's.
        plots: as from `plots.plan_plots`.
        clock: timeline that the page opens on, at its end, so that every curve is complete.
        turns: how often the body turns during the run, for the playback speed.
    """
    spaces = [_space_view(stage, clock, narrow=len(stages) > 1) for stage in stages]
    space = spaces[0] if len(spaces) == 1 else rrb.Horizontal(*spaces)
    by_place = {
        place: [_plot_view(plot) for plot in plots if plot.place == place]
        for place in ("drift", "rates", "attitude", "more")
    }
    page = rrb.TextDocumentView(origin="/summary", name="Summary")
    right = [_tabs(views) for place in ("rates", "attitude", "drift") if (views := by_place[place])]
    left = rrb.Vertical(space, _tabs([page, *by_place["more"]]), row_shares=[2, 1])
    content = rrb.Horizontal(left, rrb.Vertical(*right), column_shares=[5, 4]) if right else left
    return rrb.Blueprint(
        content,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        _time_panel(clock, turns),
    )


def _tabs(views: Sequence[rrb.View]) -> rrb.View | rrb.Container:
    return views[0] if len(views) == 1 else rrb.Tabs(*views, active_tab=0)


def _time_panel(clock: Clock, turns: float) -> rrb.TimePanel:
    span = float(abs(clock.ticks[-1] - clock.ticks[0])) or 1.0
    screen = min(max(TURN_SECONDS * turns, 10.0), SCREEN_SECONDS)
    return rrb.TimePanel(
        state="collapsed",
        timeline=clock.name,
        # A duration plays in its seconds per second, a sequence in ticks per second.
        playback_speed=span * clock.seconds_per_tick / screen if clock.duration else 1.0,
        fps=None if clock.duration else span / screen,
        play_state="following",
    )


def _space_view(stage: Stage, clock: Clock, *, narrow: bool) -> rrb.Spatial3DView:
    eye, target, up = camera(stage, narrow=narrow)
    count = len(clock.ticks)
    rows = max(min(TRAIL_ROWS, count // 5), 2)
    ticks = int(abs(clock.ticks[-1] - clock.ticks[0]) * (rows / max(count - 1, 1)))
    recent = [
        rr.VisibleTimeRange(
            clock.name,
            start=rr.TimeRangeBoundary.cursor_relative(seq=-ticks),
            end=rr.TimeRangeBoundary.cursor_relative(),
        ),
        rr.VisibleTimeRange(
            "step",
            start=rr.TimeRangeBoundary.cursor_relative(seq=-rows),
            end=rr.TimeRangeBoundary.cursor_relative(),
        ),
    ]
    return rrb.Spatial3DView(
        origin=f"/{stage.root}",
        name=stage.title,
        background=(18, 20, 26),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=eye, look_target=target, eye_up=up
        ),
        overrides={
            trail_path(stage, trail) + "/recent": rrb.VisibleTimeRanges(recent) for trail in stage.trails
        },
    )


def _plot_view(plot: Plot) -> rrb.TimeSeriesView:
    # Drifts grow upwards along time: their legend stays out of the way below.
    corner = rrb.Corner2D.RightBottom if plot.place == "drift" else rrb.Corner2D.LeftTop
    return rrb.TimeSeriesView(
        origin="/plots",
        contents=[plot_path(plot, series.name) for series in plot.series],
        name=plot.title,
        plot_legend=rrb.PlotLegend(visible=True, corner=corner),
        # Independent axes of infinite range: a long run opens whole.
        axis_x=rrb.TimeAxis(
            link=LinkAxis.Independent,
            view_range=rr.TimeRange(
                start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite()
            ),
        ),
    )
