"""The sphere of the momentum of a body with rotors, with its equilibria.

In body axes the momentum moves on a sphere, along levels of the energy if no motor works. Of a body without
rotors they are the polhodes; rotors move equilibria, and let them merge.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from rigidsim.look import gyrostats, signals
from rigidsim.look.figures import eye as eyes
from rigidsim.look.figures.style import GREY, INK, PINK, X, Y, key
from rigidsim.look.gyrostats import Gyrostat
from rigidsim.look.solids import Array
from rigidsim.look.units import number

_GROUND, _LEVEL = "#dfe7f1", "#7f97b8"
_LEVELS, _FINE = 12, 401  # levels, at equal shares of the sphere; points of the grid that they are found on
_ONES = np.ones(3)
_KINDS = ((-1, "o", Y, "stable"), (1, "X", X, "unstable"), (0, "D", GREY, "at the threshold"))


@dataclass(frozen=True)
class Sphere:
    """The momentum's directions (rows, 3), and the gyrostat whose levels are drawn, with a title."""

    directions: Array
    gyrostat: Gyrostat
    title: str


def sphere(row: int) -> Callable[[xarray.Dataset], Sphere | None]:
    """That with the levels at the first row, or at the last if motors have changed them."""

    def find(dataset: xarray.Dataset) -> Sphere | None:
        driven = any(rotor.drive == "driven" for rotor in gyrostats.rotors(dataset))
        path, gyrostat = gyrostats.path(dataset), None
        if row == 0 or driven:
            gyrostat = Gyrostat.of(dataset, row)
        if path is None or gyrostat is None:
            return None
        title = "Momentum sphere in body axes: levels of energy"
        if driven:
            title = f"Momentum sphere: levels of energy if motors stopped at the {'end' if row else 'start'}"
        return Sphere(path / signals.norms(path)[:, None], gyrostat, title)

    return find


def draw_sphere(axes: Axes, dataset: xarray.Dataset, found: Sphere) -> None:
    """Levels of the energy, separatrices, equilibria, and the path of the run."""
    gyrostat, view = found.gyrostat, _view(dataset, found.directions)
    covered = eyes.draw_ellipsoid(axes, view, _ONES, _GROUND)
    grid = np.linspace(-1, 1, _FINE)
    right, up = np.meshgrid(grid, grid)
    depth = np.sqrt(np.maximum(1 - right**2 - up**2, 0.0))
    toward = depth[..., None] * view.toward
    points = right[..., None] * view.right + up[..., None] * view.up + toward
    inside = right**2 + up**2 < 1
    sides = [np.where(inside, gyrostat.energy(side), np.nan) for side in (points, points - 2 * toward)]
    both = np.concatenate([side[inside] for side in sides])
    weights = np.tile(1 / np.maximum(depth[inside], 1e-3), 2)  # of a pixel on the sphere
    if np.ptp(both) > 1e-9 * np.abs(both).max():
        order = np.argsort(both)
        shares = np.cumsum(weights[order]) / weights.sum()
        levels = np.interp((np.arange(_LEVELS) + 0.5) / _LEVELS, shares, both[order])
        axes.contour(right, up, sides[0], np.unique(levels), colors=_LEVEL, linewidths=0.6, zorder=2)
    entries = [Line2D([], [], color=PINK, lw=1.9, label=f"L = {number(gyrostat.size, 3)} kg m²/s")]
    saddles = np.array([one.direction for one in gyrostat.equilibria if one.unstable])
    if len(saddles):
        heights = np.unique(gyrostat.energy(saddles))
        for side, style in zip(sides, ({"linewidths": 1.3, "zorder": 3}, {"alpha": 0.25}), strict=True):
            axes.contour(right, up, side, heights, **{"colors": INK, "linewidths": 0.7, "zorder": 1} | style)
        entries.append(Line2D([], [], color=INK, lw=1.3, label="separatrix"))
    eyes.path(axes, view, found.directions, eyes.visible(found.directions, view, _ONES))
    for square, marker, color, label in _KINDS:
        style: dict[str, Any] = {"marker": marker, "mfc": color, "mec": "white", "ms": 8.0, "ls": "none"}
        kind = [one.direction for one in gyrostat.equilibria if np.sign(one.square) == square]
        for direction in kind:
            alpha, height = (1.0, 4.0) if direction @ view.toward > 0 else (0.3, 1.5)
            axes.plot(*view.flat(direction), **style, alpha=alpha, zorder=height)
        if kind:
            entries.append(Line2D([], [], **style, label=label))
    for k, name in enumerate("xyz"):
        front = view.toward[k] >= 0
        way = np.eye(3)[k] if front else -np.eye(3)[k]
        text = f"{'' if front else '−'}$L_{name}$"
        place = eyes.spoke(axes, view, way, 1.16 * way, text, eyes.COLORS[k], 1.0)
        covered = np.vstack([covered, place])
    eyes.frame(axes, covered, aside=0.12, above=0.12)
    key(axes, found.title, handles=entries)


def _view(dataset: xarray.Dataset, directions: Array) -> eyes.Eye:
    """A view of most equilibria, at the start and the end, of the path, and of positive axes."""
    spheres = [Gyrostat.of(dataset, row) for row in (0, -1)]
    marked = [one for sphere in spheres if sphere is not None for one in sphere.equilibria]
    best, found = -np.inf, np.array([0.74, 0.52, 0.43])
    for azimuth in np.deg2rad(np.arange(7.5, 360.0, 15.0)):
        for height in np.deg2rad((-25.0, 18.0, 28.0, 38.0)):
            flat = np.cos(height)
            toward = np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(height)])
            seen = np.clip(directions @ toward, -0.3, 0.7)
            quality = 4 * float(np.nanmean(seen) + np.clip(directions[0] @ toward, -0.3, 0.6))
            for one in marked:
                quality += (1.5 if one.unstable else 1.0) * float(np.clip(one.direction @ toward, -0.2, 0.5))
            quality += 0.2 * float(toward.sum()) - float(np.abs(toward).max() > 0.9)
            if quality > best:
                best, found = quality, toward
    return eyes.eye_at(found)
