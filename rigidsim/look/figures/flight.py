"""The path of a moving body: height over range, in the plane of an orbit, or in space."""

import numpy as np
import xarray
from matplotlib.axes import Axes

from rigidsim.look import signals
from rigidsim.look.figures import eye as eyes
from rigidsim.look.figures.panel import panel, recorded
from rigidsim.look.figures.scales import si_scale
from rigidsim.look.figures.style import INK, Z, curve, square, titled
from rigidsim.look.solids import Array
from rigidsim.scene.readable import span_text

_FLAT = 1e-3  # of a path's reach: it lies in a plane up to this thickness


@panel(recorded("position"))
def path(axes: Axes, dataset: xarray.Dataset, position: Array) -> None:
    """The path of the centre of mass; the start is marked."""
    scale, unit = si_scale(position - position[0], "m")
    if "uniform_gravity" in signals.load_kinds(dataset):
        _thrown(axes, dataset, position, scale, unit)
        return
    finite = position[np.isfinite(position).all(axis=1)]
    _, spread, ways = np.linalg.svd(finite - finite.mean(axis=0), full_matrices=False)
    if len(spread) < 3 or spread[1] == 0 or spread[2] > _FLAT * spread[0]:
        _in_space(axes, position / scale, unit)
        return
    normal = ways[2] if ways[2, np.abs(ways[2]).argmax()] > 0 else -ways[2]
    across = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    across -= (across @ normal) * normal
    across /= np.linalg.norm(across)
    x, y = position @ across / scale, position @ np.cross(normal, across) / scale
    curve(axes, x, y, in_plane=True, color=Z, lw=1.2)
    axes.plot(x[0], y[0], "o", color=Z, ms=4.5)
    title = "Path in its plane"
    size = float(np.hypot(x - x.mean(), y - y.mean()).max())
    if np.hypot(x, y).min() < 3 * size and "central_gravity" in signals.load_kinds(dataset):
        axes.plot(0, 0, "+", color=INK, ms=10, mew=1.3)
        x, y = np.append(x, 0), np.append(y, 0)
        title += " (+: origin)"
    square(axes, x, y)
    names = ("X", "Y") if normal[2] > 1 - 1e-9 else ("across, in the plane",) * 2
    axes.set(xlabel=f"{names[0]} [{unit}]", ylabel=f"{names[1]} [{unit}]")
    titled(axes, title)


def _thrown(axes: Axes, dataset: xarray.Dataset, position: Array, scale: float, unit: str) -> None:
    up = signals.vertical(dataset)
    height = position @ up
    level = position - height[:, None] * up
    way = level[-1] - level[0]
    length = float(np.linalg.norm(way))
    seconds = signals.seconds(dataset)
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
