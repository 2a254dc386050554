"""Panels of figures: curves over time and paths in planes as matplotlib draws them, and its own planes."""

from collections.abc import Callable
from functools import partial
from itertools import cycle

import numpy as np
import xarray
from matplotlib.axes import Axes

from rigidsim.look import curves, paths, signals, sources
from rigidsim.look.curves import Plot, paper
from rigidsim.look.figures import style, surfaces
from rigidsim.look.figures.style import INK, Z, curve, key, square, titled
from rigidsim.look.paths import PATHS, Path
from rigidsim.look.record import scene_of
from rigidsim.look.signals import clock, need, optional
from rigidsim.look.solids import Array
from rigidsim.scene.readable import scaled, with_unit

_HUES = {"spin axis": "orange", "momentum axis": "violet", "core axis": "pink"}
_BANDS = 400  # parts of a panel's width, each with the least and the largest value in it
MANY = 60  # swings of a curve that can't be followed
_LAST_TURNS = 10  # before a body is locked, in the phase plane

Panel = Plot | Path | Callable[[Axes], None]
Find = Callable[[xarray.Dataset], Panel | None]


def draw(axes: Axes, dataset: xarray.Dataset, panel: Panel | None, *, dense: bool = True) -> None:
    """Draw a panel of a dataset in memory, if there is one, with title, labels and units; curves over time of
    `MANY` swings as bands between the extremes, if wanted (`dense`).
    """
    if isinstance(panel, Plot):
        _plot(axes, dataset, panel, dense=dense)
    elif isinstance(panel, Path):
        _path(axes, panel)
    elif panel is not None:
        panel(axes)


def _plot(axes: Axes, dataset: xarray.Dataset, plot: Plot, *, dense: bool) -> None:
    """Draw curves over time, with bands of their uncertainty or of what is expected of them."""
    time = clock(dataset)[0]
    for column, label, hue in zip(plot.values.T, plot.labels, cycle(plot.hues), strict=False):
        color = paper(hue)
        if plot.log:
            axes.plot(time, np.where(column > 0, column, np.nan), color=color, label=label, lw=0.9)
        elif dense and len(time) >= 4 * _BANDS and _crossings(column) > 2 * MANY:
            parts = np.arange(0, len(time), len(time) // _BANDS)
            low, high = np.fmin.reduceat(column, parts), np.fmax.reduceat(column, parts)
            at = np.append(time[parts[:-1]], time[-1])
            axes.fill_between(at, low, high, color=color, alpha=0.35, lw=0.6)
            axes.plot([], [], color=color, label=label)
        else:
            curve(axes, time, column, sparse=plot.sparse, color=color, label=label)
        if plot.error is not None:
            axes.fill_between(time, column - plot.error, column + plot.error, color=color, alpha=0.2, lw=0)
    if plot.log and (plot.band is not None or (plot.values > 0).any()):
        axes.set_yscale("log")
    if plot.band is not None:
        low = np.nanpercentile(plot.values, 1) if np.isfinite(plot.values).any() else plot.band[0][0]
        # what cancels to far less than a rounding says nothing
        low = max(min(low, plot.band[0][0]), 0.02 * plot.band[0][0]) / 5
        axes.fill_between(time, low, plot.band[1], color="#e9edf2", lw=0, zorder=0)
        axes.set_ylim(low)
    if plot.steady is not None:
        axes.set_ylim(*plot.steady)
    if plot.from_zero:
        axes.set_ylim(0.0, 1.1 * axes.get_ylim()[1])
    key(axes, plot.title + (" (grey: what rounding explains)" if plot.band else ""))
    axes.set_ylabel(with_unit(plot.word, plot.unit))


def _crossings(column: Array) -> int:
    """How often a curve passes its mean."""
    return int(np.count_nonzero(np.diff(np.signbit(column - np.nanmean(column)))))


def _path(axes: Axes, path: Path) -> None:
    """Draw a path, a cross at the origin as its center, and what is beside it."""
    style.trace(axes, *path.points.T, sparse=path.sparse)
    faint = {"lw": 0.7, "alpha": 0.6, "zorder": 1, "sparse": path.sparse, "in_plane": True}
    for name, points in path.others.items():
        curve(axes, *points.T, color=paper(_HUES[name]), label=name, **faint)
    if path.ellipse is not None:
        axes.plot(*path.ellipse[0].T, color=INK, lw=1.1, ls=(0, (4, 2)), label=path.ellipse[1])
    if path.center:
        axes.plot(0, 0, "+", color=INK, ms=10, mew=1.3)
    if path.alike:
        square(
            axes, *np.vstack([path.points, *path.others.values(), np.zeros((1 if path.center else 0, 2))]).T
        )
    axes.set(xlabel=path.labels[0], ylabel=path.labels[1])
    key(axes, path.title + (f" (+: {path.center})" if path.center else ""))


@optional
def phases(dataset: xarray.Dataset) -> Panel:
    """Rates of libration, or of roll, pitch and yaw, against the angles; librations are closed curves."""
    table, options = need(curves.swings(dataset) or curves.regular(dataset))
    names = options["labels"]
    rate = np.gradient(table, signals.seconds(dataset), axis=0)
    (scale, unit), (speed, speed_unit) = scaled(table, "rad"), scaled(rate, "rad/s")

    def drawn(axes: Axes) -> None:
        for x, y, name, hue in zip((table / scale).T, (rate / speed).T, names, style.PALETTE, strict=False):
            curve(axes, x, y, in_plane=True, color=hue, lw=0.8, label=name)
        axes.set(xlabel=f"angle [{unit}]", ylabel=f"rate [{speed_unit}]")
        key(axes, "Phase planes")

    return drawn


@optional
def locking_phases(dataset: xarray.Dataset) -> Panel:
    """Rotation relative to the source against longitude within a turn: waves, and in the end a whirl."""
    longitude, found = need(curves.locked_longitude(dataset)), need(sources.seen(dataset))
    rate = dataset["angular_velocity"].values @ scene_of(dataset).figure
    middle, rate = float(np.mean(longitude[found.last])), rate - np.mean(rate[found.last])
    rest = slice(int(np.argmax(np.abs(longitude - middle) < 2 * np.pi * _LAST_TURNS)), None)
    speed, unit = scaled(rate[rest], "rad/s")
    # within half a turn of where it ends, that between -45 and 315 degrees
    centre = np.remainder(middle + np.pi / 4, 2 * np.pi) - np.pi / 4
    within = np.degrees(np.remainder(longitude[rest] - middle + np.pi, 2 * np.pi) - np.pi + centre)

    def drawn(axes: Axes) -> None:
        shades = np.linspace(0, 1, len(within))
        axes.scatter(within, rate[rest] / speed, c=shades, cmap="plasma", s=4, lw=0, rasterized=True)
        axes.set(xlabel="longitude under the source [deg]", ylabel=f"spin less that in the end [{unit}]")
        titled(axes, "Until it is locked (lighter: later)")

    return drawn


def flight(dataset: xarray.Dataset) -> Panel | None:
    """The path of the centre of mass, in a plane or in space."""
    position, flat = signals.values(dataset, "position", 3), paths.flight(dataset)
    if flat is not None or position is None:
        return flat
    scale, unit = scaled(position - position[0], "m")

    def drawn(axes: Axes) -> None:
        view = surfaces.View.of(axes, np.array([0.74, -0.52, 0.43]))
        view.line(position / scale, color=Z, lw=1.3, zorder=4)
        axes.plot(*view.flat(position[0] / scale), "o", color=Z, ms=4.5, zorder=5)
        view.box(position / scale, "XYZ", floors=[2])
        titled(axes, f"Path in space [{unit}]")

    return drawn


PLANES: dict[str, Find] = {
    **PATHS,
    "phases": phases,
    "locking_phases": locking_phases,
    "path": flight,
    "polhode": surfaces.polhode,
    "poinsot": surfaces.poinsot,
    "momentum_sphere": partial(surfaces.sphere, row=0),
    "momentum_sphere_at_end": partial(surfaces.sphere, row=-1),
}
"""Square panels by name."""
