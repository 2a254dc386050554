"""Timelines as files: of a run, whole or as it goes on, and of several side by side, on one clock, with the
distances between their attitudes. Errors are strict, and disks never full.
"""

import errno
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import xarray
from rerun.error_utils import set_strict_mode, strict_mode

from rigidsim.look.pages import legible
from rigidsim.look.plots import HUES, PALETTE, Plot
from rigidsim.look.signals import title_of, values
from rigidsim.look.solids import Array, Color
from rigidsim.look.stages.uncertainty import CONE
from rigidsim.look.timeline.blueprint import PIXELS, build_blueprint, build_comparison
from rigidsim.look.timeline.drawn import Clock, DrawnRun, build_clock, dated
from rigidsim.scene.parts_of_values import in_time_order
from rigidsim.scene.readable import epoch_of
from rigidsim.scene.row_rotations import angles_between, normalised

LIVE_ROWS = 100_000
_ROW_BYTES = 600  # at most: some twenty variables
_FIRST_BYTES = 1024 * _ROW_BYTES  # bodies, layout, page
MOST = 6  # largest number of runs shown side by side
ROWS = 20_000  # largest number of rows shown of each run
_FLOOR = 1e-18  # rad: below what a difference of attitudes in double precision can be


def write_timeline(
    dataset: xarray.Dataset,
    path: Path,
    *,
    rows: int = 100_000,
    part: str | None = None,
    height: float = PIXELS,
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

    Raises:
    ValueError: no samples, a time that isn't finite, `rows` < 2 or an unreadable `drawing`.
    RuntimeError: the environment variable RERUN switches recording off.
    OSError: the file can't be written, or there is no room for it.
    """
    run = DrawnRun.of(in_time_order(dataset), rows)
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
    """A recording that grows with a run, by `rows` so far, on a stream to a viewer or a file."""

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        self._scales: tuple[object, ...] = ()
        self._last = -1
        self.rows = 0

    def update(self, dataset: xarray.Dataset) -> None:
        """Send the new rows of all so far; everything where the scales have changed with them."""
        if dataset.sizes["time"] - 1 == self._last:  # nothing is new
            return
        run = DrawnRun.of(dataset, LIVE_ROWS)
        steps = run.steps
        with strict():
            scales = _scales_of(run)
            if scales != self._scales:
                self._scales, self._last = scales, -1
                self._stream.send_blueprint(build_blueprint(run, following=True))
                self._stream.send_recording_name(legible(title_of(dataset)))
            first = int(np.searchsorted(steps, self._last, side="right"))
            run.draw(self._stream, first)
            self.rows += len(steps) - first
        self._last = int(steps[-1])
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
    clock = build_clock(np.unique(np.concatenate([run.seconds for _, run in runs])))
    first, *others = [epoch_of(run.rows.attrs) for _, run in runs]
    shown = dated(clock, first) if all(epoch == first for epoch in others) else clock
    drawn = [
        _named(replace(run, clock=_part(clock, shown, run.seconds)), name, number)
        for number, (name, run) in enumerate(runs)
    ]
    apart = attitude_differences([(name, run.rows) for name, run in runs])
    titles = [legible(name) for name, _ in named]
    blueprint = build_comparison(list(zip(titles, drawn, strict=True)), shown, apart, bars=bars)
    if apart is not None:
        drawn[0].plots.append(apart)
    stages = [stage for run in drawn for stage in run.picture.stages]
    count, name = sum(len(run.steps) for run in drawn), " and ".join(name for name, _ in named)
    with recording_to(path, name, count, blueprint) as recording:
        for run in drawn:
            run.draw(recording, legend=stages if run is drawn[0] else ())
    return count


def _part(clock: Clock, shown: Clock, seconds: Array) -> Clock:
    """The common clock as it is shown, with dates or without, for the times of one run."""
    whole = np.asarray(clock.ticks * clock.seconds_per_tick)
    places = np.clip(np.searchsorted(whole, seconds - 0.5 * clock.seconds_per_tick), 0, len(whole) - 1)
    return replace(shown, ticks=shown.ticks[places])


def _named(run: DrawnRun, name: str, number: int) -> DrawnRun:
    """A run under entities and titles of its own, with only its leading plots."""
    root, title = f"run{number}", legible(name)
    first = run.picture.stages[0]
    drawn = [
        replace(part, words=f"{title}: {part.words}") if part.words and part.path.startswith(CONE) else part
        for part in first.parts
    ]
    stage = replace(first, root=f"{root}/{first.root}", title=f"{title}: {first.title}", parts=drawn)
    plots = [
        replace(
            plot,
            name=f"{root} {plot.name}",
            labels=[f"{title}: {label or plot.word}" for label in plot.labels],
            levels={f"{title}: {label}": value for label, value in plot.levels.items()},
            hues=[_shade(HUES[PALETTE[number]][1], k) for k in range(len(plot.labels))],
        )
        for plot in run.plots
        if plot.place != "more"
    ]
    pages = {f"{root}_{key}": text for key, text in run.pages.items() if key == "Summary"}
    picture = replace(run.picture, stages=[stage])
    return replace(run, picture=picture, plots=plots, paths=[], states=[], pages=pages)


def _shade(color: Color, number: int) -> Color:
    """The colour of a run, brighter for its second curve and darker for its third."""
    part = (1.0, 0.62, 1.35, 0.8)[number % 4]
    red, green, blue = (min(round(part * x), 255) for x in color)
    return red, green, blue


def attitude_differences(named: Sequence[tuple[str, xarray.Dataset]]) -> Plot | None:
    """The angle (rad) between the first run's attitude and each other's, at the first run's times,
    where quaternions are interpolated on the chord. None if the first has no attitude, or no other has one
    then.
    """
    (_, first), *others = named
    base = values(first, "quaternion")
    if base is None:
        return None
    times = np.asarray(first["time"].values, dtype=np.float64)
    base = normalised(base)
    labels, columns = [], []
    for name, table in others:
        quaternion = values(table, "quaternion")
        if quaternion is None:
            continue
        theirs = _at(times, np.asarray(table["time"].values, dtype=np.float64), quaternion)
        angle = angles_between(base, theirs)
        if np.isfinite(angle).any():
            labels.append(f"{legible(name)} from {legible(named[0][0])}")
            columns.append(np.maximum(angle, _FLOOR))
    title, place = "Angle between the attitudes", "drift"
    if not columns:
        return None
    hues = PALETTE[1:]  # of the others
    return Plot("difference", title, np.stack(columns, axis=1), labels, "rad", hues, place=place, log=True)


def _at(times: Array, theirs: Array, quaternion: Array) -> Array:
    """Unit quaternions at given times: as sampled, on the chord between two samples, nan elsewhere."""
    changes = np.einsum("ij,ij->i", quaternion[1:], quaternion[:-1]) < 0
    steady = quaternion * np.append(1.0, np.cumprod(np.where(changes, -1.0, 1.0)))[:, None]
    columns = [np.interp(times, theirs, column, left=np.nan, right=np.nan) for column in steady.T]
    return normalised(np.stack(columns, axis=1))
