"""Timelines as files: of a run, whole or as it goes on, and of several side by side, on one clock, with the
distances between their attitudes; and the page that the viewer opens with. Errors are strict, and disks never
full.
"""

import errno
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import xarray
from rerun.blueprint.components import LinkAxis
from rerun.error_utils import set_strict_mode, strict_mode

from rigidsim.look.curves import HUES, PALETTE, Plot
from rigidsim.look.pages import legible
from rigidsim.look.paths import Path as Plane
from rigidsim.look.signals import seconds as seconds_of
from rigidsim.look.signals import title_of, values
from rigidsim.look.solids import Array, Color
from rigidsim.look.stages.parts import Stage, screen_seconds
from rigidsim.look.stages.uncertainty import CONE
from rigidsim.look.thinning import Thinning
from rigidsim.look.timeline.drawn import (
    LEGEND_COLUMNS,
    LEGEND_LINE,
    Clock,
    DrawnRun,
    build_clock,
    dated,
    legend_of,
    plot_path,
)  # fmt: skip
from rigidsim.scene.parts_of_values import in_time_order
from rigidsim.scene.readable import epoch_of
from rigidsim.scene.rotations import angles_between, normalised

TRAIL_ROWS = 450  # at most in the bright end of a trail, and never more than a tenth of the run
PIXELS = 800.0  # about the height of the page
_DARK = (18, 20, 26)
PARTS = ("page", "scene", "plots")
"""What a picture can show: the scene and its plots, or one of them."""
PLAYER = "player"
"""The part for a small frame within another page: the scene above its first plot, and the time to play."""
_CURVES = 6  # of runs side by side: more names would cover the curves
LIVE_ROWS = 100_000
_ROW_BYTES = 600  # at most: some twenty variables
_FIRST_BYTES = 1024 * _ROW_BYTES  # bodies, layout, page
MOST = 6  # largest number of runs shown side by side
ROWS = 20_000  # largest number of rows shown of each run
_SHADES = (1.0, 0.62, 1.35, 0.8)  # of a run's colour, by curve
_FLOOR = 1e-18  # rad: below what a difference of attitudes in double precision can be


def write_timeline(
    dataset: xarray.Dataset,
    path: Path,
    *,
    rows: int = 100_000,
    part: str | None = None,
    height: float = PIXELS,
    known: Thinning | None = None,
) -> int:
    """Write a dataset as a rerun recording with its own layout; returns the number of rows written.

    Args:
    dataset: of a run, or any part of it: what is missing isn't shown, every other numeric variable along
    time gets a plot. It may be lazy: only the rows shown are read.
    path: the file; it is whole when this returns.
    rows: at most so many rows are shown, evenly strided, with the first and the last.
    part: of the page that a picture shows, "page", "scene" or "plots", without the viewer's own bars;
    or "player", for a small frame within another page.
    height: of the picture, points of the screen, of which letters take as many on any.
    known: the rows and extremes of its variables, as far as they needn't be read.

    Raises:
    ValueError: no samples, a time that isn't finite, `rows` < 2 or an unreadable `drawing`.
    RuntimeError: the environment variable RERUN switches recording off.
    OSError: the file can't be written, or there is no room for it.
    """
    ascending = in_time_order(dataset)
    run = DrawnRun.of(ascending, rows, known if ascending is dataset else None)
    count = len(run.steps)
    with recording_to(
        path, title_of(dataset), count, build_blueprint(run, part=part, height=height)
    ) as recording:
        run.draw(recording, before=lambda left: check_room(path, left))
    return count


@contextmanager
def recording_to(path: Path, name: str, rows: int, blueprint: rrb.Blueprint) -> Iterator[rr.RecordingStream]:
    """A recording of at most so many rows, with its layout, whose file is whole when the block ends."""
    check_room(path, rows)
    with strict():
        # The context manager finishes the file: without it there is no footer.
        with rr.RecordingStream("rigidsim") as stream:
            if not rr.is_enabled(stream):
                raise RuntimeError("RERUN is set to off in the environment: unset it")
            stream.save(path, default_blueprint=blueprint)
            stream.send_recording_name(legible(name))
            yield stream


@contextmanager
def strict() -> Iterator[None]:
    """Turn errors of the rerun API into exceptions; wrong shapes and times would be dropped otherwise."""
    before = strict_mode()
    set_strict_mode(True)
    try:
        yield
    finally:
        set_strict_mode(before)


def check_room(path: Path, rows: int) -> None:
    """Refuse if there is too little room, before rerun finds the disk full and may wait for ever."""
    room, needed = shutil.disk_usage(path.parent).free, _FIRST_BYTES + _ROW_BYTES * rows
    if room < needed:
        missing = f"it may need {needed / 1e6:.1f} MB, and {room / 1e6:.1f} MB are free"
        raise OSError(errno.ENOSPC, missing, str(path))


class LiveRecording:
    """A recording that grows with a run, on a stream to a viewer or a file."""

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        self._scales: tuple[object, ...] = ()
        self._last = -1

    def update(self, dataset: xarray.Dataset) -> None:
        """Send the new rows of all so far; everything where the scales have changed with them."""
        if dataset.sizes["time"] - 1 == self._last:  # nothing is new
            return
        run = DrawnRun.of(dataset, LIVE_ROWS)
        with strict():
            scales = _scales_of(run)
            if scales != self._scales:
                self._scales, self._last = scales, -1
                self._stream.send_blueprint(build_blueprint(run, following=True))
                self._stream.send_recording_name(legible(title_of(dataset)))
            run.draw(self._stream, int(np.searchsorted(run.steps, self._last, side="right")))
        self._last = int(run.steps[-1])
        self._stream.flush()


def _scales_of(run: DrawnRun) -> tuple[object, ...]:
    """What earlier rows were drawn with: equal for two parts of a run whose rows fit together."""
    plots = [(p.heading, p.place, len(p.labels)) for p in run.plots]
    stages = [(stage.title, stage.unit) for stage in run.picture.stages]
    shown = [
        (path, part.words, type(part.static[0]), *np.round(part.values[:1], 4).ravel())
        for path, part in run.entities()
        if part.static and (part.columns is not None or part.words)
    ]
    return (run.clock.name, *stages, *shown, *plots)


@contextmanager
def live_recording(address: str) -> Iterator[LiveRecording]:
    """A recording that grows in a viewer which listens at an address."""
    with rr.RecordingStream("rigidsim") as stream:
        stream.connect_grpc(address)
        yield LiveRecording(stream)


def write_comparison(
    named: Sequence[tuple[str, xarray.Dataset]], path: Path, *, rows: int = ROWS, bars: bool = True
) -> int:
    """Write two to ``MOST`` datasets, at most so many rows of each, with their names on the screen as one
    recording on one clock, side by side; it is whole when this returns the number of rows written. A picture
    is without the viewer's own ``bars``.

    Raises:
        ValueError: another number of datasets, or as for ``timeline.write_timeline``.
        OSError: the file can't be written, or there is no room for it.
    """
    if not 2 <= len(named) <= MOST:
        raise ValueError(f"given {len(named)} runs; 2 to {MOST} can be seen side by side")
    runs = [(name, DrawnRun.of(in_time_order(dataset), rows)) for name, dataset in named]
    seconds = np.unique(np.concatenate([run.seconds for _, run in runs]))
    first, *others = [epoch_of(run.rows.attrs) for _, run in runs]
    clock = dated(build_clock(seconds), first if all(epoch == first for epoch in others) else None)
    drawn = []
    for number, (name, run) in enumerate(runs):
        ticks = clock.ticks[np.searchsorted(seconds, run.seconds)]
        drawn.append(_named(replace(run, clock=replace(clock, ticks=ticks)), name, number))
    apart = attitude_differences([(name, run.rows) for name, run in runs])
    titles = [legible(name) for name, _ in named]
    blueprint = build_comparison(list(zip(titles, drawn, strict=True)), clock, apart, bars=bars)
    if apart is not None:
        drawn[0].plots.append(apart)
    stages = [stage for run in drawn for stage in run.picture.stages]
    count, name = sum(len(run.steps) for run in drawn), " and ".join(name for name, _ in named)
    with recording_to(path, name, count, blueprint) as recording:
        for run in drawn:
            run.draw(recording, legend=stages if run is drawn[0] else ())
    return count


def _named(run: DrawnRun, name: str, number: int) -> DrawnRun:
    """A run under separate entities and titles, with only its leading plots."""
    root, title = f"run{number}", legible(name)
    first = run.picture.stages[0]
    drawn = [
        replace(part, words=f"{title}: {part.words}") if part.words and part.path.startswith(CONE) else part
        for part in first.parts
    ]
    stage = replace(first, root=f"{root}/{first.root}", title=f"{title}: {first.title}", parts=drawn)
    color = np.array(HUES[PALETTE[number]][1])
    shades = [np.minimum(np.rint(part * color), 255).astype(int).tolist() for part in _SHADES]
    plots = [
        replace(
            plot,
            name=f"{root} {plot.name}",
            labels=[f"{title}: {label or plot.word}" for label in plot.labels],
            levels={f"{title}: {label}": value for label, value in plot.levels.items()},
            hues=shades,
        )
        for plot in run.plots
        if plot.place != "more"
    ]
    pages = {f"{root}_{key}": text for key, text in run.pages.items() if key == "Summary"}
    picture = replace(run.picture, stages=[stage])
    return replace(run, picture=picture, plots=plots, paths=[], states=[], pages=pages)


def attitude_differences(named: Sequence[tuple[str, xarray.Dataset]]) -> Plot | None:
    """The angle (rad) between the first run's attitude and each other's, at the first run's times,
    where quaternions are interpolated on the chord. None if the first has no attitude, or no other has one
    then.
    """
    (leading, first), *others = named
    found: dict[str, Array] = {}
    for name, table in others:
        base, theirs = values(first, "quaternion"), values(table, "quaternion")
        if base is None or theirs is None:
            continue
        turned = np.einsum("ij,ij->i", theirs[1:], theirs[:-1]) < 0
        theirs = theirs * np.append(1.0, np.cumprod(np.where(turned, -1.0, 1.0)))[:, None]
        at = partial(np.interp, seconds_of(first), seconds_of(table), left=np.nan, right=np.nan)
        angle = angles_between(normalised(base), normalised(np.stack([*map(at, theirs.T)], axis=1)))
        if np.isfinite(angle).any():
            found[f"{legible(name)} from {legible(leading)}"] = np.maximum(angle, _FLOOR)
    if not found:
        return None
    title, angles, hues = "Angle between the attitudes", np.stack([*found.values()], axis=1), PALETTE[1:]
    return Plot("difference", title, angles, [*found], "rad", hues, place="drift", log=True)


# ---- the page: scene, legend, plots, and summary


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
    if facing and planes:  # the disc, next to it where the source is seen, and how it moves in space
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
    panel = time_panel(clock, screen_seconds(run.rows), following=following, hidden=part in PARTS)
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
    """The layout for runs side by side on a common clock, each with one stage, under separate names, and
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
        : 2
        - len(
            views
        )  # more would cut the names of six curves
    ]
    for found in (found for found in common.values() if found[0].place == "drift"):
        curves = sum(len(plot.labels) + len(plot.levels) for plot in found)
        views.append(plot_view(found, clock, named=curves <= _CURVES))  # leading plots name the colours, too
    left = left_side(
        scene,
        legend_of([stage for run in runs for stage in run.picture.stages]),
        {page.lower(): name for name, run in named for page in run.pages},
    )
    panel = time_panel(clock, max(screen_seconds(run.rows) for run in runs), hidden=not bars)
    return page_of(beside_plots(left, views), panel, hidden=not bars)


def beside_plots(
    left: rrb.Container, right: Sequence[rrb.View | rrb.Container], heights: Sequence[float] | None = None
) -> rrb.Container:
    """The scene with plots next to it, if there are any."""
    if not right:
        return left
    return rrb.Horizontal(left, rrb.Vertical(*right, row_shares=heights), column_shares=[5, 3.4])


def page_of(content: rrb.View | rrb.Container, panel: rrb.TimePanel, *, hidden: bool) -> rrb.Blueprint:
    """A page, of a picture without the viewer's own bars."""
    state: Literal["hidden", "collapsed"] = "hidden" if hidden else "collapsed"
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


def plane_view(plane: Plane) -> rrb.Spatial2DView:
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
