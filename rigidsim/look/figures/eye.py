"""Bodies in three dimensions drawn on plain axes: seen from far away, with hidden parts removed.

A flat drawing knows where every text will be, which matplotlib's own 3D axes don't.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from rigidsim.look.figures.style import PALE, PINK, X, Y, Z
from rigidsim.look.signals import joined
from rigidsim.look.solids import Array
from rigidsim.look.units import number

Mask = NDArray[np.bool_]

_AROUND, _ALONG = 144, 72  # facets of a surface
_LIGHT = (0.35, 0.25, 0.9)  # from where, in (right, up, towards) of the eye
COLORS = (X, Y, Z)


@dataclass(frozen=True)
class Eye:
    """A direction of view from far away: unit vectors (3,) to the right of the picture, up, to the eye."""

    right: Array
    up: Array
    toward: Array

    def flat(self, points: Array) -> Array:
        """Points (..., 3) in the picture (..., 2)."""
        return np.stack([points @ self.right, points @ self.up], axis=-1)


def eye_at(toward: Array) -> Eye:
    """The eye in direction `toward` (3,), which isn't Z, with Z upwards in the picture."""
    forward = toward / np.linalg.norm(toward)
    right = np.cross(np.array([0.0, 0.0, 1.0]), forward)
    right /= np.linalg.norm(right)
    return Eye(right, np.cross(forward, right), forward)


def draw_ellipsoid(
    axes: Axes, eye: Eye, radii: Array, color: str, *, outside: Array | None = None, alpha: float = 1.0
) -> Array:
    """Draw the visible part of an ellipsoid with semi-axes (3,) about the origin, or what of it lies outside
    another; returns the covered points of the picture, (n, 2).
    """
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, _AROUND + 1), np.linspace(0, np.pi, _ALONG + 1))
    points = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1) * radii
    corners = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], axis=2)
    corners = corners.reshape(-1, 4, 3)
    middle = corners.mean(axis=1)
    normals = middle / radii**2
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    seen = normals @ eye.toward > 0
    if outside is not None:
        seen &= (middle**2 / outside**2).sum(axis=1) > 1
    light = _LIGHT[0] * eye.right + _LIGHT[1] * eye.up + _LIGHT[2] * eye.toward
    shade = 0.74 + 0.26 * np.clip(normals[seen] @ (light / np.linalg.norm(light)), 0, 1)
    faces = np.clip(np.array(to_rgb(color)) * shade[:, None], 0, 1)
    # Edges of the faces' colour close the seams; where light shines through they would be seen twice.
    solid = alpha == 1.0
    axes.add_collection(
        PolyCollection(
            list(eye.flat(corners[seen])), facecolors=faces, edgecolors=faces if solid else "none",
            linewidths=0.35 if solid else 0.0, rasterized=True, antialiaseds=solid, alpha=alpha,
        )
    )  # fmt: skip
    return np.asarray(eye.flat(corners[seen]).reshape(-1, 2))


def sections(radii: Array) -> list[Array]:
    """The sections (361, 3) of an ellipsoid by its three principal planes."""
    angle = np.linspace(0, 2 * np.pi, 361)
    found = []
    for k in range(3):
        ring = np.zeros((361, 3))
        ring[:, (k + 1) % 3] = radii[(k + 1) % 3] * np.cos(angle)
        ring[:, (k + 2) % 3] = radii[(k + 2) % 3] * np.sin(angle)
        found.append(ring)
    return found


def visible(points: Array, eye: Eye, radii: Array) -> Mask:
    """Which points (rows, 3) of an ellipsoid face the eye."""
    return np.asarray((points / radii**2) @ eye.toward > 0)


def line(axes: Axes, eye: Eye, points: Array, keep: Mask | None = None, **style: Any) -> None:
    """A curve (rows, 3), of which only the rows to keep are drawn."""
    shown = points if keep is None else np.where(keep[:, None], points, np.nan)
    axes.plot(*eye.flat(shown).T, **style)


def path(axes: Axes, eye: Eye, points: Array, front: Mask) -> None:
    """The path (rows, 3) of a run, pale where it isn't in front, with its start."""
    if joined(points):
        line(axes, eye, points, ~front, color=PINK, lw=1.1, alpha=0.35)
        line(axes, eye, points, front, color=PINK, lw=1.9, zorder=5)
    else:
        dots = {"ls": "none", "marker": ".", "ms": 2.2, "mew": 0.0, "color": PINK}
        line(axes, eye, points, ~front, alpha=0.3, **dots)
        line(axes, eye, points, front, zorder=5, **dots)
    # The start is marked: of a rotation about a principal axis the polhode is but a point.
    (x, y) = eye.flat(points[0])
    axes.plot(x, y, "o", color=PINK, ms=4.0, alpha=1.0 if front[0] else 0.35, zorder=6)


def spoke(axes: Axes, eye: Eye, start: Array, stop: Array, text: str, color: str, reach: float) -> Array:
    """Draw an axis from where it leaves a body, with a label beyond; returns the label's place (2,)."""
    ends = eye.flat(np.stack([start, stop]))
    axes.plot(*ends.T, color=color, lw=1.6, zorder=6, solid_capstyle="butt")
    way = ends[1] - ends[0]
    length = float(np.linalg.norm(way))
    way = way / length if length > 0 else np.array([0.0, 1.0])
    place = ends[1] + 0.04 * reach * way
    level = abs(way[1]) < 0.5
    halo = withStroke(linewidth=2.5, foreground="white", alpha=0.85)
    axes.text(
        place[0], place[1], text, color=color, fontsize=9, zorder=7, linespacing=1.25,
        ha="left" if way[0] > 0.35 else "right" if way[0] < -0.35 else "center",
        va="center" if level else "bottom" if way[1] > 0 else "top", path_effects=[halo],
    )  # fmt: skip
    return np.asarray(place)


def draw_box(
    axes: Axes, eye: Eye, points: Array, names: Sequence[str], reach: float, floors: Sequence[int]
) -> None:
    """Draw three axes with the ranges that points (rows, 3) cover, and shadows along some of the axes."""
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    corner = low - 0.04 * reach
    covered = [eye.flat(points)]
    for k, name in enumerate(names):
        stop = corner.copy()
        stop[k] = high[k] + 0.12 * reach
        text = f"{name}\n{number(low[k], 3)} … {number(high[k], 3)}"
        covered.append(spoke(axes, eye, corner, stop, text, COLORS[k], reach)[None])
        if k in floors:
            floor = points.copy()
            floor[:, k] = corner[k]
            line(axes, eye, floor, color=PALE, lw=0.6, zorder=1, rasterized=len(points) > 6000)
            covered.append(eye.flat(floor))
    frame(axes, np.vstack(covered), aside=0.34, above=0.3)


def frame(axes: Axes, covered: Array, *, aside: float = 0.42, above: float = 0.3) -> None:
    """Set limits about the covered points (n, 2): equal scales, room for labels on all sides, no frame."""
    low, high = np.nanmin(covered, axis=0), np.nanmax(covered, axis=0)
    middle, half = (low + high) / 2, (high - low) / 2
    reach = max(float(half.max()), 1e-300)
    x, y = half[0] + aside * reach, half[1] + above * reach
    axes.set_xlim(middle[0] - x, middle[0] + x)
    axes.set_ylim(middle[1] - y, middle[1] + y)
    axes.set_aspect("equal", adjustable="box")
    axes.set_axis_off()
