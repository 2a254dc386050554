"""Panels of figures: curves over time and paths in planes as matplotlib draws them, phase planes, flights."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes

from rigidsim.look import curves, paths, signals, sources
from rigidsim.look.figures import style
from rigidsim.look.figures import surfaces as eyes
from rigidsim.look.figures.style import INK, Z, curve, key, square, titled
from rigidsim.look.figures.surfaces import draw_poinsot, draw_polhode, draw_sphere, rolling, sphere
from rigidsim.look.paths import Path
from rigidsim.look.plots import Plot, paper
from rigidsim.look.record import scene_of
from rigidsim.look.solids import Array
from rigidsim.look.units import angle_scale, clock, with_unit
from rigidsim.scene.readable import si_scale, span_text

_HUES = {"spin axis": "orange", "momentum axis": "violet", "core axis": "pink"}
_FLAT = 1e-3  # of a path's reach: it lies in a plane up to this thickness
_LAST_TURNS = 10  # before a body is locked, in the phase plane


@dataclass(frozen=True)
class Panel:
    """A panel: `find` gives what it draws of a dataset in memory, or None; `draw` draws that on axes, with
    title, labels and units.
    """

    find: Callable[[xarray.Dataset], Any]
    draw: Callable[[Axes, xarray.Dataset, Any], None]


def draw_plot(axes: Axes, dataset: xarray.Dataset, plot: Plot) -> None:
    """Draw curves over time, with bands of their uncertainty or of what is expected of them."""
    time = clock(dataset)[0]
    for column, label, hue in zip(plot.values.T, plot.labels, cycle(plot.hues), strict=False):
        color = paper(hue)
        if plot.log:
            axes.plot(time, np.where(column > 0, column, np.nan), color=color, label=label, lw=0.9)
        else:
            curve(axes, time, column, sparse=plot.sparse, color=color, label=label)
        if plot.error is not None:
            axes.fill_between(time, column - plot.error, column + plot.error, color=color, alpha=0.2, lw=0)
    if plot.log and (plot.band is not None or (plot.values > 0).any()):
        axes.set_yscale("log")
    if plot.band is not None:
        axes.fill_between(time, *plot.band, color="#e9edf2", lw=0, zorder=0)
        low = np.nanpercentile(plot.values, 1) if np.isfinite(plot.values).any() else plot.band[0][0]
        # what cancels to far less than a rounding says nothing
        axes.set_ylim(max(min(low, plot.band[0][0]), 0.02 * plot.band[0][0]) / 5)
    if plot.steady is not None:
        axes.set_ylim(*plot.steady)
    if plot.from_zero:
        axes.set_ylim(0.0, 1.1 * axes.get_ylim()[1])
    key(axes, plot.title + (" (grey: what rounding explains)" if plot.band else ""))
    axes.set_ylabel(with_unit(plot.word, plot.unit))


def draw_path(axes: Axes, dataset: xarray.Dataset, path: Path) -> None:
    """Draw a path with equal scales, a cross at the origin as its center, and what is beside it."""
    x, y = path.points.T
    style.trace(axes, x, y, sparse=path.sparse)
    for name, points in path.others.items():
        options = {"color": paper(_HUES[name]), "lw": 0.7, "alpha": 0.6, "zorder": 1, "label": name}
        curve(axes, *points.T, in_plane=True, sparse=path.sparse, **options)
    if path.ellipse is not None:
        axes.plot(*path.ellipse[0].T, color=INK, lw=1.1, ls=(0, (4, 2)), label=path.ellipse[1])
    whole = np.vstack([path.points, *path.others.values()])
    if path.center:
        axes.plot(0, 0, "+", color=INK, ms=10, mew=1.3)
        whole = np.vstack([whole, [[0.0, 0.0]]])
    square(axes, *whole.T)
    axes.set(xlabel=path.labels[0], ylabel=path.labels[1])
    key(axes, path.title + (f" (+: {path.center})" if path.center else ""))


def _swinging(dataset: xarray.Dataset) -> tuple[Array, list[str]] | None:
    """Angles of libration (rows, 2), or roll, pitch and yaw (rows, 3), rad, and their names."""
    (table, names), other = curves.swings(dataset), curves.regular(dataset)
    if table is not None:
        return table, names
    return None if other is None else (other, ["roll", "pitch", "yaw"])


def _phases(axes: Axes, dataset: xarray.Dataset, found: tuple[Array, list[str]]) -> None:
    """Rates of libration, or of roll, pitch and yaw, against the angles; librations are closed curves."""
    table, names = found
    rate = np.gradient(table, signals.seconds(dataset), axis=0)
    (scale, unit), (speed, speed_unit) = angle_scale(table), si_scale(rate, "rad/s")
    for x, y, name, hue in zip(table.T, rate.T, names, style.PALETTE, strict=False):
        curve(axes, x / scale, y / speed, in_plane=True, color=hue, lw=0.8, label=name)
    axes.set(xlabel=f"angle [{unit}]", ylabel=f"rate [{speed_unit}]")
    key(axes, "Phase planes")


def _locking_phases(axes: Axes, dataset: xarray.Dataset, longitude: Array) -> None:
    """Rotation relative to the source against longitude within a turn: waves, and in the end a whirl."""
    rate, found = dataset["angular_velocity"].values @ scene_of(dataset).figure, sources.seen(dataset)
    last = slice(0) if found is None else found.last
    middle, rate = float(np.mean(longitude[last])), rate - np.mean(rate[last])
    rest = slice(int(np.argmax(np.abs(longitude - middle) < 2 * np.pi * _LAST_TURNS)), None)
    speed, unit = si_scale(rate[rest], "rad/s")
    # within half a turn of where it ends, that between -45 and 315 degrees
    centre = np.remainder(middle + np.pi / 4, 2 * np.pi) - np.pi / 4
    within = np.degrees(np.remainder(longitude[rest] - middle + np.pi, 2 * np.pi) - np.pi + centre)
    shades = np.linspace(0, 1, len(within))
    axes.scatter(within, rate[rest] / speed, c=shades, cmap="plasma", s=4, lw=0, rasterized=True)
    axes.set(xlabel="longitude under the source [deg]", ylabel=f"spin less that in the end [{unit}]")
    titled(axes, "Until it is locked (lighter: later)")


def _path(axes: Axes, dataset: xarray.Dataset, position: Array) -> None:
    """The path of the centre of mass; the start is marked."""
    scale, unit = si_scale(position - position[0], "m")
    scene = scene_of(dataset)
    if scene.gravity is not None and not scene.attractors:
        _thrown(axes, dataset, position, scale, unit)
        return
    finite = signals.finite_rows(position)
    _, spread, ways = np.linalg.svd(finite - finite.mean(axis=0), full_matrices=False)
    if len(spread) < 3 or spread[1] == 0 or spread[2] > _FLAT * spread[0]:
        _in_space(axes, position / scale, unit)
        return
    normal = ways[2] if ways[2, np.abs(ways[2]).argmax()] > 0 else -ways[2]
    across = np.eye(3)[0 if abs(normal[0]) < 0.9 else 1]
    across = across - (across @ normal) * normal
    across /= np.linalg.norm(across)
    x, y = position @ across / scale, position @ np.cross(normal, across) / scale
    curve(axes, x, y, in_plane=True, color=Z, lw=1.2)
    axes.plot(x[0], y[0], "o", color=Z, ms=4.5)
    title = "Path in its plane"
    size = float(np.hypot(x - x.mean(), y - y.mean()).max())
    if np.hypot(x, y).min() < 3 * size and any(not any(one["position"]) for one in scene.attractors):
        axes.plot(0, 0, "+", color=INK, ms=10, mew=1.3)
        x, y = np.append(x, 0), np.append(y, 0)
        title += " (+: origin)"
    square(axes, x, y)
    names = ("X", "Y") if normal[2] > 1 - 1e-9 else ("across, in the plane",) * 2
    axes.set(xlabel=f"{names[0]} [{unit}]", ylabel=f"{names[1]} [{unit}]")
    titled(axes, title)


def _thrown(axes: Axes, dataset: xarray.Dataset, position: Array, scale: float, unit: str) -> None:
    up, seconds = scene_of(dataset).vertical, signals.seconds(dataset)
    height = position @ up
    level = position - height[:, None] * up
    way = level[-1] - level[0]
    length = float(np.linalg.norm(way))
    axes.set_ylabel(f"height [{unit}]")
    if length < 1e-6 * max(float(np.ptp(height)), 1e-300):
        curve(axes, seconds, height / scale, color=Z)
        axes.set_xlabel("time [s]")
        titled(axes, "Height")
        return
    run = (level - level[0]) @ (way / length)
    curve(axes, run / scale, height / scale, in_plane=True, color=Z, lw=1.5)
    axes.plot(run[0] / scale, height[0] / scale, "o", color=Z, ms=4.5)
    if max(np.ptp(run), np.ptp(height)) < 6 * min(np.ptp(run), np.ptp(height)):
        square(axes, run / scale, height / scale)
    axes.set_xlabel(f"horizontal distance [{unit}]")
    titled(axes, f"Path over {span_text(seconds[-1] - seconds[0])}, seen from the side")


def _in_space(axes: Axes, points: Array, unit: str) -> None:
    reach = float((np.nanmax(points, axis=0) - np.nanmin(points, axis=0)).max()) or 1.0
    view = eyes.eye_at(np.array([0.74, -0.52, 0.43]))
    eyes.line(axes, view, points, color=Z, lw=1.3, zorder=4, rasterized=len(points) > 6000)
    axes.plot(*view.flat(points[0]), "o", color=Z, ms=4.5, zorder=5)
    eyes.draw_box(axes, view, points, "XYZ", reach, floors=[2])
    titled(axes, f"Path in space [{unit}]")


OVER_TIME = {name: Panel(find, draw_plot) for name, find in curves.CURVES.items()}
"""Panels over time by name."""
PLANES = {name: Panel(find, draw_path) for name, find in paths.PATHS.items()} | {
    "phases": Panel(_swinging, _phases),
    "locking_phases": Panel(curves.locked_longitude, _locking_phases),
    "path": Panel(lambda dataset: signals.values(dataset, "position", 3), _path),
    "polhode": Panel(signals.principal_rates, draw_polhode),
    "poinsot": Panel(rolling, draw_poinsot),
    "momentum_sphere": Panel(sphere(0), draw_sphere),
    "momentum_sphere_at_end": Panel(sphere(-1), draw_sphere),
}
"""Square panels by name."""
