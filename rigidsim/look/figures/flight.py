"""The path of a moving body: height over range, in the plane of an orbit, or in space."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rigidsim.look import signals
from rigidsim.look.figures import eye as eyes
from rigidsim.look.figures.scales import number, si_scale
from rigidsim.look.figures.style import INK, PALE, X, Y, Z, curve, square, titled
from rigidsim.scene.readable_time import span_text

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

_FLAT = 1e-3  # of a path's reach: it lies in a plane up to this thickness


def path_panel(axes: Axes, dataset: xarray.Dataset) -> None:
    """The path of the centre of mass; the start is marked."""
    position = signals.values(dataset, "position")
    assert position is not None
    scale, unit = si_scale(position - position[0], "m")
    if "uniform_gravity" in signals.load_kinds(dataset):
        _thrown(axes, dataset, position, scale, unit)
        return
    finite = position[np.isfinite(position).all(axis=1)]
    middle = finite.mean(axis=0)
    _, spread, ways = np.linalg.svd(finite - middle, full_matrices=False)
    if len(spread) < 3 or spread[1] == 0 or spread[2] > _FLAT * spread[0]:
        _in_space(axes, position, scale, unit)
        return
    normal = ways[2] if ways[2, np.abs(ways[2]).argmax()] > 0 else -ways[2]
    across = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    across -= (across @ normal) * normal
    across /= np.linalg.norm(across)
    along = np.cross(normal, across)
    names = [f"across, in the plane [{unit}]"] * 2
    if normal[2] > 1 - 1e-9:
        names = [f"X [{unit}]", f"Y [{unit}]"]
    x, y = position @ across / scale, position @ along / scale
    curve(axes, x, y, in_plane=True, color=Z, lw=1.2)
    axes.plot(x[0], y[0], "o", color=Z, ms=4.5)
    title = "Path in its plane"
    size = float(np.hypot(x - x.mean(), y - y.mean()).max())
    if np.hypot(x, y).min() < 3 * size and "central_gravity" in signals.load_kinds(dataset):
        axes.plot(0, 0, "+", color=INK, ms=10, mew=1.3)
        x, y = np.append(x, 0), np.append(y, 0)
        title += " (+: origin)"
    square(axes, x, y)
    axes.set_xlabel(names[0])
    axes.set_ylabel(names[1])
    titled(axes, title)


def _thrown(axes: Axes, dataset: xarray.Dataset, position: Array, scale: float, unit: str) -> None:
    up = signals.vertical(dataset)
    height = position @ up
    level = position - height[:, None] * up
    way = level[-1] - level[0]
    length = float(np.linalg.norm(way))
    seconds = signals.seconds(dataset)
    if length < 1e-6 * max(float(np.ptp(height)), 1e-300):
        curve(axes, seconds, height / scale, color=Z)
        axes.set_xlabel("time [s]")
        axes.set_ylabel(f"height [{unit}]")
        titled(axes, "Height")
        return
    run = (level - level[0]) @ (way / length)
    curve(axes, run / scale, height / scale, in_plane=True, color=Z, lw=1.5)
    axes.plot(run[0] / scale, height[0] / scale, "o", color=Z, ms=4.5)
    if max(np.ptp(run), np.ptp(height)) < 6 * min(np.ptp(run), np.ptp(height)):
        square(axes, run / scale, height / scale)
    axes.set_xlabel(f"horizontal distance [{unit}]")
    axes.set_ylabel(f"height [{unit}]")
    titled(axes, f"Path over {span_text(seconds[-1] - seconds[0])}, seen from the side")


def _in_space(axes: Axes, position: Array, scale: float, unit: str) -> None:
    points = position / scale
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    reach = float((high - low).max()) or 1.0
    view = eyes.eye_at(np.array([0.74, -0.52, 0.43]))
    corner = low - 0.04 * reach
    covered = [view.flat(points)]
    for k, hue in enumerate((X, Y, Z)):
        start, stop = corner.copy(), corner.copy()
        stop[k] = high[k] + 0.12 * reach
        text = f"{'XYZ'[k]}\n{number(low[k], 3)} … {number(high[k], 3)}"
        covered.append(eyes.spoke(axes, view, start, stop, text, hue, reach)[None])
    floor = points.copy()
    floor[:, 2] = corner[2]
    eyes.line(axes, view, floor, color=PALE, lw=0.7, zorder=1, rasterized=len(points) > 6000)
    eyes.line(axes, view, points, color=Z, lw=1.3, zorder=4, rasterized=len(points) > 6000)
    covered.append(view.flat(floor))
    x, y = view.flat(points[0])
    axes.plot(x, y, "o", color=Z, ms=4.5, zorder=5)
    eyes.frame(axes, np.vstack(covered), aside=0.34, above=0.3)
    titled(axes, f"Path in space [{unit}]")
