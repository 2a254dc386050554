"""Several runs side by side: their bodies, their curves in common plots, and the distances between their
attitudes.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray

from rigidsim.look.page import legible
from rigidsim.look.plots import HUES, PALETTE, Plot
from rigidsim.look.signals import values
from rigidsim.look.solids import Array, Color
from rigidsim.look.timeline.blueprint import build_comparison
from rigidsim.look.timeline.drawn import Clock, DrawnRun, build_clock, dated
from rigidsim.look.timeline.writing import chunks, recording_to
from rigidsim.scene.parts_of_values import in_time_order
from rigidsim.scene.readable import epoch_of
from rigidsim.scene.row_rotations import angles_between, normalised

MOST = 6  # largest number of runs shown side by side
ROWS = 20_000  # largest number of rows shown of each run
_FLOOR = 1e-18  # rad: below what a difference of attitudes in double precision can be


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
            run.draw_static(recording, legend=stages if run is drawn[0] else ())
            for part in chunks(0, len(run.seconds)):
                run.draw_rows(recording, part)
    return count


def _part(clock: Clock, shown: Clock, seconds: Array) -> Clock:
    """The common clock as it is shown, with dates or without, for the times of one run."""
    whole = np.asarray(clock.ticks * clock.seconds_per_tick)
    places = np.clip(np.searchsorted(whole, seconds - 0.5 * clock.seconds_per_tick), 0, len(whole) - 1)
    return replace(shown, ticks=shown.ticks[places])


def _named(run: DrawnRun, name: str, number: int) -> DrawnRun:
    """A run under entities and titles of its own, with only its leading plots."""
    root, title = f"run{number}", legible(name)
    stages = [
        replace(
            stage,
            root=f"{root}/{stage.root}",
            title=f"{title}: {stage.title}",
            cones=[replace(cone, words=f"{title}: {cone.words}") for cone in stage.cones],
        )
        for stage in run.picture.stages[:1]
    ]
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
    picture = replace(run.picture, stages=stages)
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
