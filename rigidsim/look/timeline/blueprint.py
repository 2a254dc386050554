"""The page that the viewer opens with: scene, legend, plots, and summary; of several runs side by side."""

from collections.abc import Mapping, Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.components import LinkAxis

from rigidsim.look.curves import Plot
from rigidsim.look.paths import Path
from rigidsim.look.stages.parts import Color, Stage
from rigidsim.look.timeline.drawn import (
    LEGEND_COLUMNS,
    LEGEND_LINE,
    Clock,
    DrawnRun,
    legend_of,
    plot_path,
)

TRAIL_ROWS = 450  # at most in the bright end of a trail, and never more than a tenth of the run
PIXELS = 800.0  # about the height of the page
_DARK = (18, 20, 26)
PARTS = ("page", "scene", "plots")
"""What a picture can show: the scene and its plots, or one of them."""
PLAYER = "player"
"""The part for a small frame within another page: the scene above its first plot, and the time to play."""
_CURVES = 6  # of runs side by side: more names would cover the curves


def build_blueprint(
    run: DrawnRun, *, following: bool = False, part: str | None = None, height: float = PIXELS
) -> rrb.Blueprint:
    """The layout for a run, which opens at its start and plays, or stays at the end of one that goes on; of a
    picture one of ``PARTS``, without the viewer's own bars; or ``PLAYER``.
    """
    stages, planes, clock = run.picture.stages, run.paths, run.clock
    narrow, facing = len(stages) > 1, stages[0].flat
    titled = part is None or narrow
    spaces: list[rrb.View | rrb.Container]
    spaces = [space_view(stage, run, narrow=narrow, titled=titled) for stage in stages]
    beside = [tabs([plane_view(plane) for plane in planes])] if planes else []
    if facing and planes:  # the disc, and beside it where its source is seen, and how it moves in space
        first, *others = map(plane_view, planes)
        spaces, beside = spaces[:1], [tabs([first, *spaces[1:], *others])]
    shares = [3.0] * len(spaces) + [2.6 if facing else 1.6] * len(beside)
    scene = spaces[0] if len(shares) == 1 else rrb.Horizontal(*spaces, *beside, column_shares=shares)
    pages = {page.lower(): page for page in run.pages if part is None or (part, page) == ("page", "Summary")}
    height = height / 2 if part == PLAYER else height
    left = left_side(scene, legend_of(stages), pages, height)
    views = {
        place: [plot_view([plot], clock) for plot in run.plots if plot.place == place]
        for place in ("leading", "drift", "more")
    }
    right: list[rrb.View | rrb.Container] = [*views["leading"]]
    heights = [3.0 if len(right) < 3 else 2.2] * len(right)
    if views["drift"] or views["more"]:
        right.append(tabs([*views["drift"], *views["more"]]))
        heights.append(1.8)
    if run.states:
        right.append(rrb.StateTimelineView(origin="/states", name="Events"))
        heights.append(1.2)
    panel = time_panel(clock, run.screen_seconds, following=following, hidden=part in PARTS)
    whole = beside_plots(left, right, heights)
    shown: dict[str | None, rrb.View | rrb.Container] = {
        "scene": left,
        "plots": rrb.Vertical(*right, row_shares=heights) if right else left,
        PLAYER: rrb.Vertical(left, *right[:1], row_shares=[5, 2][: 1 + len(right)]),
    }
    return page_of(shown.get(part, whole), panel, hidden=part is not None)


def build_comparison(
    named: Sequence[tuple[str, DrawnRun]], clock: Clock, difference: Plot | None, *, bars: bool = True
) -> rrb.Blueprint:
    """The layout for runs side by side on a common clock, each with one stage, under names of its own, and
    the distances between their attitudes, if known; with the viewer's own ``bars`` or without.
    """
    runs = [run for _, run in named]
    eyes = [space_view(run.picture.stages[0], run, narrow=True) for run in runs]
    half = -(-len(eyes) // 2)
    scene = (
        rrb.Horizontal(*eyes)
        if len(eyes) <= 3
        else rrb.Vertical(rrb.Horizontal(*eyes[:half]), rrb.Horizontal(*eyes[half:]))
    )
    common: dict[str, list[Plot]] = {}
    for plot in (plot for run in runs for plot in run.plots):
        common.setdefault(plot.heading, []).append(plot)
    views = [] if difference is None else [plot_view([difference], clock)]
    views += [plot_view(found, clock) for found in common.values() if found[0].place == "leading"][
        : 4 - len(views)
    ]
    for found in (found for found in common.values() if found[0].place == "drift"):
        curves = sum(len(plot.labels) + len(plot.levels) for plot in found)
        views.append(plot_view(found, clock, named=curves <= _CURVES))  # leading plots name the colours, too
    left = left_side(
        scene,
        legend_of([stage for run in runs for stage in run.picture.stages]),
        {page.lower(): name for name, run in named for page in run.pages},
    )
    panel = time_panel(clock, max(run.screen_seconds for run in runs), hidden=not bars)
    return page_of(beside_plots(left, views), panel, hidden=not bars)


def beside_plots(
    left: rrb.Container, right: Sequence[rrb.View | rrb.Container], heights: Sequence[float] | None = None
) -> rrb.Container:
    """The scene with plots beside it, if there are any."""
    if not right:
        return left
    return rrb.Horizontal(left, rrb.Vertical(*right, row_shares=heights), column_shares=[5, 3.4])


def page_of(content: rrb.View | rrb.Container, panel: rrb.TimePanel, *, hidden: bool) -> rrb.Blueprint:
    """A page, of a picture without the viewer's own bars."""
    state = "hidden" if hidden else "collapsed"
    bars = [rrb.TopPanel(state="hidden")] if hidden else []
    return rrb.Blueprint(
        content, rrb.BlueprintPanel(state=state), rrb.SelectionPanel(state=state), *bars, panel
    )


def left_side(
    scene: rrb.View | rrb.Container,
    legend: Mapping[str, Color],
    pages: Mapping[str, str],
    pixels: float = PIXELS,
) -> rrb.Container:
    """The scene above its legend and the text pages, by their entities, about so many pixels high."""
    lines = -(-(1 + len(legend)) // LEGEND_COLUMNS)  # with the clock
    height = 30.0 + 24.0 * lines
    key = rrb.Spatial2DView(
        origin="/legend",
        name="What is shown",
        titlebar=bool(pages),
        background=_DARK,
        visual_bounds=rrb.VisualBounds2D(x_range=(0.0, 30.0), y_range=(0.0, LEGEND_LINE * lines)),
    )
    texts: list[rrb.View] = [
        rrb.TextDocumentView(origin=f"/{entity}", name=name) for entity, name in pages.items()
    ]
    if not texts:
        return rrb.Vertical(scene, key, row_shares=[pixels - height, height])
    return rrb.Vertical(scene, key, tabs(texts), row_shares=[pixels * 0.7 - height, height, pixels * 0.3])


def tabs(views: Sequence[rrb.View | rrb.Container]) -> rrb.View | rrb.Container:
    """Views behind tabs, if there are several."""
    return views[0] if len(views) == 1 else rrb.Tabs(*views, active_tab=0)


def time_panel(
    clock: Clock, screen: float, *, following: bool = False, hidden: bool = False
) -> rrb.TimePanel:
    """The time panel: at the start, playing, the whole run in so many seconds."""
    if hidden:
        return rrb.TimePanel(state="hidden", timeline=clock.name)
    span = float(abs(clock.ticks[-1] - clock.ticks[0])) or 1.0
    return rrb.TimePanel(
        state="collapsed",
        timeline=clock.name,
        # A duration plays in its seconds per second, a sequence in ticks per second.
        playback_speed=span * clock.seconds_per_tick / screen if clock.in_nanoseconds else 1.0,
        fps=None if clock.in_nanoseconds else span / screen,
        play_state="following" if following else "playing",
        loop_mode="off" if following else "all",
    )


def space_view(stage: Stage, run: DrawnRun, *, narrow: bool, titled: bool = True) -> rrb.Spatial3DView:
    """A view of one stage of a run."""
    eye = stage.camera
    assert eye is not None
    # further back in a narrow view, about as wide as high
    position = eye.target + (1.08 if narrow else 1.0) * (eye.position - eye.target)
    rows = max(min(TRAIL_ROWS, len(run.steps) // 10), 2)
    overrides: dict[Any, Any] = {
        f"/{stage.root}/{part.path}": rrb.VisibleTimeRanges(_window(run.clock, part.lasting or rows))
        for part in stage.parts
        if part.lasting is not None
    }
    origin = f"/{stage.root}/{stage.looked_from}" if stage.looked_from else f"/{stage.root}"
    return rrb.Spatial3DView(
        origin=origin,
        contents=f"/{stage.root}/**",
        name=stage.title,
        titlebar=titled,
        background=_DARK,
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=position, look_target=eye.target, eye_up=eye.up
        ),
        overrides=overrides,
    )


def _ticks_per_row(clock: Clock) -> float:
    return float(abs(clock.ticks[-1] - clock.ticks[0])) / max(len(clock.ticks) - 1, 1)


def _window(clock: Clock, rows: int) -> list[rr.VisibleTimeRange]:
    """So many rows before the cursor."""
    per_row = _ticks_per_row(clock)
    return [
        rr.VisibleTimeRange(
            name,
            start=rr.TimeRangeBoundary.cursor_relative(seq=-round(rows * size)),
            end=rr.TimeRangeBoundary.cursor_relative(seq=0),
        )
        for name, size in ((clock.name, per_row), ("step", 1.0))
    ]


def plane_view(plane: Path) -> rrb.Spatial2DView:
    """A view of one plane figure."""
    size = 1.35 * plane.reach
    return rrb.Spatial2DView(
        origin=f"/planes/{plane.name}",
        name=plane.title,
        background=_DARK,
        visual_bounds=rrb.VisualBounds2D(x_range=(-size, size), y_range=(-size, size)),
    )


def plot_view(plots: Sequence[Plot], clock: Clock, *, named: bool = True) -> rrb.TimeSeriesView:
    """A view of a plot, or of several runs' plots, with the names of its curves or without."""
    # Independent axes of infinite range: a long run opens whole.
    first, lines = plots[0], sum(len(plot.labels) + len(plot.levels) for plot in plots)
    shown = rr.TimeRange(start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite())
    if first.window:
        reach = round(first.window / 2 * _ticks_per_row(clock))
        shown = rr.TimeRange(
            start=rr.TimeRangeBoundary.cursor_relative(seq=-reach),
            end=rr.TimeRangeBoundary.cursor_relative(seq=reach),
        )
    # Drifts grow upwards along time: their legend stays below, out of the way.
    corner = rrb.Corner2D.RightBottom if first.place == "drift" else rrb.Corner2D.LeftTop
    return rrb.TimeSeriesView(
        origin="/plots",
        contents=[f"/{plot_path(plot)}/**" for plot in plots],
        name=first.heading,
        plot_legend=rrb.PlotLegend(visible=named and lines > 1, corner=corner),
        axis_y=None if first.steady is None else rrb.ScalarAxis(range=first.steady),
        axis_x=rrb.TimeAxis(link=LinkAxis.Independent, view_range=shown),
    )
