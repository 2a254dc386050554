"""Timelines as files: of a run, whole or as it goes on, and of several side by side, on one clock, with the
distances between their attitudes. Errors are strict, and disks never full.
"""

import errno
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import xarray
from rerun.error_utils import set_strict_mode, strict_mode

from rigidsim.look.curves import HUES, PALETTE, Plot
from rigidsim.look.pages import legible
from rigidsim.look.signals import seconds as seconds_of
from rigidsim.look.signals import title_of, values
from rigidsim.look.solids import Array
from rigidsim.look.stages.uncertainty import CONE
from rigidsim.look.timeline.blueprint import PIXELS, build_blueprint, build_comparison
from rigidsim.look.timeline.drawn import DrawnRun, build_clock, dated
from rigidsim.scene.parts_of_values import in_time_order
from rigidsim.scene.readable import epoch_of
from rigidsim.scene.row_rotations import angles_between, normalised

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
    """A run under entities and titles of its own, with only its leading plots."""
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
    title, table, hues = "Angle between the attitudes", np.stack([*found.values()], axis=1), PALETTE[1:]
    return Plot("difference", title, table, [*found], "rad", hues, place="drift", log=True)
