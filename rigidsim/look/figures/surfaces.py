"""Surfaces in three dimensions on plain axes: the polhode and Poinsot's motion, the momentum's sphere.

They are seen from far away, with hidden parts removed: a flat drawing knows where every text will be, which
matplotlib's own 3D axes don't.

A free body's angular velocity keeps to two ellipsoids of its axes, sum I_i w_i^2 = 2 T and
sum I_i^2 w_i^2 = L^2 (Poinsot 1834): the curve that they share is the polhode. In space the first rolls
without slipping on the plane w . L = 2 T, where it leaves the herpolhode. The momentum of a body
with rotors moves on a sphere, along levels of the energy if no motor works; rotors move its equilibria, and
let them merge.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from rigidsim.look import gyrostats, signals
from rigidsim.look.figures.style import GREY, INK, PALE, PINK, X, Y, Z, key, titled
from rigidsim.look.gyrostats import Gyrostat
from rigidsim.look.paths import herpolhode_plane
from rigidsim.look.record import scene_of
from rigidsim.look.signals import joined
from rigidsim.look.solids import Array, rotation_matrix
from rigidsim.look.thinning import thinned_indices
from rigidsim.look.units import number
from rigidsim.scene.readable import si_scale

Mask = NDArray[np.bool_]

_AROUND, _ALONG = 144, 72  # facets of a surface
_LIGHT = (0.35, 0.25, 0.9)  # from where, in (right, up, towards) of the eye
COLORS = (X, Y, Z)
ENERGY_SURFACE, MOMENTUM_SURFACE = "#b9cde6", "#f0d3ae"
SEPARATRIX = "#4a5568"
_RING = "#8093ab"
_VIEWS = [np.array(v) for v in ((0.74, 0.52, 0.43), (0.52, 0.74, 0.43), (0.45, 0.6, 0.66), (0.85, 0.3, 0.43))]
_CLOSE = 0.06  # rad from an axis, within which facets are too coarse for the surfaces' meeting
_GROUND, _LEVEL = "#dfe7f1", "#7f97b8"
_LEVELS, _FINE = 12, 401  # levels, at equal shares of the sphere; points of the grid that they are found on
_ONES = np.ones(3)
_KINDS = ((-1, "o", Y, "stable"), (1, "X", X, "unstable"), (0, "D", GREY, "at the threshold"))


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


def surfaces(dataset: xarray.Dataset) -> tuple[Array, Array] | None:
    """Semi-axes (3,), rad/s, of the surfaces of energy and momentum; None if the motion isn't on them."""
    found = signals.energy_and_momentum(dataset)
    if found is None:
        return None
    moments, twice, square = found
    return np.sqrt(twice / moments), np.sqrt(square) / moments


def separatrix(moments: Array, radii: Array) -> list[Array]:
    """The two circles-in-perspective (361, 3) through the intermediate axis on the ellipsoid of energy.

    Where L^2 = 2 T B: the planes w_a sqrt(A (B - A)) = ± w_c sqrt(C (C - B)), A < B < C. None if two moments
    are alike.
    """
    a, b, c = np.argsort(moments)
    small, middle, large = moments[[a, b, c]]
    if min(middle - small, large - middle) <= 1e-9 * large:
        return []
    way = np.array([np.sqrt(large * (large - middle)), np.sqrt(small * (middle - small))])
    reach = 1 / np.sqrt((way**2 / radii[[a, c]] ** 2).sum())
    angle = np.linspace(0, 2 * np.pi, 361)
    curves = []
    for sign in (1.0, -1.0):
        points = np.zeros((361, 3))
        points[:, b] = radii[b] * np.cos(angle)
        points[:, a] = way[0] * reach * np.sin(angle)
        points[:, c] = sign * way[1] * reach * np.sin(angle)
        curves.append(points)
    return curves


def draw_polhode(axes: Axes, dataset: xarray.Dataset, rates: Array) -> None:
    """The tip of the angular velocity in principal axes, on the surfaces where it has some."""
    found, moments = surfaces(dataset), scene_of(dataset).moments
    names = [f"$ω_{name}$" for name in signals.axis_names(dataset)]
    if found is None or moments is None:
        _bare(axes, rates, names)
        return
    scale, unit = si_scale(np.concatenate(found), "rad/s")
    energy, momentum = (radii / scale for radii in found)
    points = rates / scale
    view = _polhode_view(points, energy, moments)
    covered = draw_ellipsoid(axes, view, energy, ENERGY_SURFACE)
    for ring in sections(energy):
        line(axes, view, ring, visible(ring, view, energy), color=_RING, lw=0.7)
    entries: list[Any] = [Line2D([], [], color=PINK, lw=1.9, label="ω")]
    for ring in separatrix(moments, energy):
        front = visible(ring, view, energy)
        style = {"color": SEPARATRIX, "ls": (0, (5, 2))}
        line(axes, view, ring, ~front, lw=0.6, alpha=0.25, **style)
        line(axes, view, ring, front, lw=1.2, zorder=2.5, label="separatrix", **style)
        entries[1:] = [axes.get_lines()[-1]]
    entries.append(Patch(color=ENERGY_SURFACE, label="2T"))
    title = "Polhode on the ellipsoid of energy"
    # About a body that spins close to an axis the surfaces meet too flatly: then the momentum's is left out.
    sizes = np.linalg.norm(points, axis=1, keepdims=True)
    if float(np.nanmax(np.sort(np.abs(points / sizes), axis=1)[:, 1])) > _CLOSE:
        outer = draw_ellipsoid(axes, view, momentum, MOMENTUM_SURFACE, outside=energy, alpha=0.42)
        covered = np.vstack([covered, outer])
        for ring in sections(momentum):
            beyond = visible(ring, view, momentum) & ((ring**2 / energy**2).sum(axis=1) > 1)
            line(axes, view, ring, beyond, color="#c0843a", lw=0.7, zorder=3)
        entries.append(Patch(color=MOMENTUM_SURFACE, label="L²"))
        title = "Polhode: the surfaces of energy and momentum"
    path(axes, view, points, visible(points, view, energy))
    size = float(np.abs(covered).max())
    for k, name in enumerate(names):
        way = np.eye(3)[k] if view.toward[k] >= 0 else -np.eye(3)[k]
        start = max(energy[k], momentum[k])
        text = f"{'' if view.toward[k] >= 0 else '−'}{name}\n{number(energy[k], 3)} {unit}"
        place = spoke(axes, view, start * way, (start + 0.16 * size) * way, text, COLORS[k], size)
        covered = np.vstack([covered, place])
    frame(axes, covered)
    key(axes, title, handles=entries)


def _polhode_view(points: Array, radii: Array, moments: Array) -> Eye:
    """A view from the side on which the polhode lies, and not along the plane of a separatrix."""
    mean = np.nanmean(points, axis=0)
    signs = np.where(mean / radii < -1e-3, -1.0, 1.0)
    normals = [np.cross(ring[0], ring[90]) for ring in separatrix(moments, radii)]
    normals = [normal / np.linalg.norm(normal) for normal in normals]
    best, found = -1.0, np.array([0.74, 0.52, 0.43])
    for toward in _VIEWS:
        direction = signs * toward / np.linalg.norm(toward)
        open_ = min((abs(float(direction @ normal)) for normal in normals), default=1.0)
        quality = min(open_, 0.35) + 0.3 * float(direction @ (mean / radii))
        if quality > best + 0.02:
            best, found = quality, direction
    return eye_at(found)


def _bare(axes: Axes, rates: Array, names: list[str]) -> None:
    """Draw the path without surfaces, between three axes with the ranges that it covers."""
    scale, unit = si_scale(rates, "rad/s")
    points = rates / scale
    reach = float((np.nanmax(points, axis=0) - np.nanmin(points, axis=0)).max())
    size = float(np.nanmax(np.abs(points)))
    view = eye_at(np.array([0.74, 0.52, 0.43]))
    path(axes, view, points, np.ones(len(points), dtype=bool))
    draw_box(axes, view, points, names, reach if reach > 1e-6 * size else size or 1.0, floors=range(3))
    titled(axes, f"Path of ω in body axes [{unit}]")


def rolling(dataset: xarray.Dataset) -> tuple[Array, Array, Array, Array] | None:
    """Semi-axes (3,) of the ellipsoid of energy, herpolhode (rows, 2), angular velocity (rows, 3) along the
    principal axes, rad/s, and the rotation (3, 3) from these to the picture's axes at the first sample.
    """
    found, plane, rates = surfaces(dataset), herpolhode_plane(dataset), signals.principal_rates(dataset)
    quaternion, along = signals.values(dataset, "quaternion"), signals.steady_momentum(dataset)
    if found is None or plane is None or rates is None or quaternion is None or along is None:
        return None
    # The picture's axes: across, across, and -L upwards, so that the plane lies below the body.
    first, second = signals.across(along)
    to_picture = np.stack([first, -second, -along])
    matrix = rotation_matrix(quaternion[:1])[0] @ scene_of(dataset).axes.T
    return found[0], plane, rates, to_picture @ matrix


def draw_poinsot(axes: Axes, dataset: xarray.Dataset, found: tuple[Array, Array, Array, Array]) -> None:
    """The ellipsoid of energy as it rolls on the invariable plane, at the first sample."""
    scale, _ = si_scale(found[0], "rad/s")
    radii, traced, points = (values / scale for values in found[:3])
    turn = found[3]
    tip = turn @ points[0]
    depth = float(tip[2])  # the plane's height, below zero
    ring = np.column_stack([traced[:, 0], -traced[:, 1], np.full(len(traced), depth)])
    azimuth = np.arctan2(tip[1], tip[0]) - 0.5
    view = eye_at(np.array([np.cos(azimuth), np.sin(azimuth), 0.42]))
    size = 1.15 * max(float(np.linalg.norm(traced, axis=1).max()), 0.75 * float(radii.max()))
    angle = np.linspace(0, 2 * np.pi, 181)
    disc = np.column_stack([size * np.cos(angle), size * np.sin(angle), np.full(181, depth)])
    axes.fill(*view.flat(disc).T, color="#e9edf2", zorder=0)
    entries = [Line2D([], [], color=PINK, lw=1.9, label="polhode")]
    if signals.joined(ring):
        ring = ring[thinned_indices(len(ring), 6000)]
        line(axes, view, ring, color=Z, lw=0.9, zorder=0.5, label="herpolhode")
        entries.append(axes.get_lines()[-1])
        line(axes, view, ring, color=Z, lw=0.6, alpha=0.25, zorder=2)  # through the body, faintly
    own = Eye(*(turn.T @ way for way in (view.right, view.up, view.toward)))  # in principal axes
    covered = draw_ellipsoid(axes, own, radii, ENERGY_SURFACE)
    for one in sections(radii):
        line(axes, own, one, visible(one, own, radii), color=_RING, lw=0.7, zorder=3)
    path(axes, own, points, visible(points, own, radii))
    place = view.flat(np.array([0.0, 0.0, 1.25 * depth]))
    axes.plot(*np.stack([np.zeros(2), view.flat(tip)]).T, color=PINK, lw=1.3, zorder=5)
    axes.plot(*np.stack([np.zeros(2), place]).T, color=GREY, lw=1.1, ls=(0, (4, 2)), zorder=5)
    axes.text(place[0], place[1], "L", color=GREY, ha="center", va="top", fontsize=9.5, fontweight="bold")
    frame(axes, np.vstack([covered, view.flat(disc), place[None]]), aside=0.06, above=0.1)
    key(axes, "It rolls on the invariable plane (Poinsot)", handles=entries)


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
        whole, gyrostat = gyrostats.path(dataset), None
        if row == 0 or driven:
            gyrostat = Gyrostat.of(dataset, row)
        if whole is None or gyrostat is None:
            return None
        title = "Momentum sphere in body axes: levels of energy"
        if driven:
            title = f"Momentum sphere: levels of energy if motors stopped at the {'end' if row else 'start'}"
        return Sphere(whole / signals.norms(whole)[:, None], gyrostat, title)

    return find


def draw_sphere(axes: Axes, dataset: xarray.Dataset, found: Sphere) -> None:
    """Levels of the energy, separatrices, equilibria, and the path of the run."""
    gyrostat, view = found.gyrostat, _sphere_view(found.directions)
    covered = draw_ellipsoid(axes, view, _ONES, _GROUND)
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
        for side, width, alpha, height in zip(sides, (1.3, 0.7), (1.0, 0.25), (3.0, 1.0), strict=True):
            drawn = axes.contour(right, up, side, heights, colors=INK, linewidths=width, alpha=alpha)
            drawn.set_zorder(height)
        entries.append(Line2D([], [], color=INK, lw=1.3, label="separatrix"))
    path(axes, view, found.directions, visible(found.directions, view, _ONES))
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
        place = spoke(axes, view, way, 1.16 * way, text, COLORS[k], 1.0)
        covered = np.vstack([covered, place])
    frame(axes, covered, aside=0.12, above=0.12)
    key(axes, found.title, handles=entries)


def _sphere_view(directions: Array) -> Eye:
    """A view of the path, of its start, and of positive axes."""
    return eye_at(np.nanmean(directions, axis=0) + 0.5 * directions[0] + np.array([0.5, 0.3, 0.4]))
