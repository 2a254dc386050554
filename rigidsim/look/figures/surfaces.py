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
from functools import partial
from typing import Any, Self

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from rigidsim.look import gyrostats, signals
from rigidsim.look.figures.style import GREY, INK, MOST_VECTOR_POINTS, PALE, PINK, X, Y, Z, key, titled
from rigidsim.look.gyrostats import Gyrostat
from rigidsim.look.paths import herpolhode_plane
from rigidsim.look.record import scene_of
from rigidsim.look.signals import from_start, joined, need, optional
from rigidsim.look.solids import Array, rotation_matrix
from rigidsim.scene.parts_of_values import BACKWARDS
from rigidsim.scene.readable import scaled, typeset

Mask = NDArray[np.bool_]
Draw = Callable[[Axes], None]

_AROUND, _ALONG = 144, 72  # facets of a surface
_LIGHT = (0.35, 0.25, 0.9)  # from where, in (right, up, towards) of the eye
COLORS = (X, Y, Z)
ENERGY_SURFACE, MOMENTUM_SURFACE = "#b9cde6", "#f0d3ae"
SEPARATRIX = "#4a5568"
_ALONG_SECTIONS = {ENERGY_SURFACE: "#8093ab", MOMENTUM_SURFACE: "#c0843a"}
_VIEWS = [np.array(v) for v in ((0.74, 0.52, 0.43), (0.52, 0.74, 0.43), (0.45, 0.6, 0.66), (0.85, 0.3, 0.43))]
_CLOSE = 0.06  # rad from an axis, within which facets are too coarse for the surfaces' meeting
_BEHIND = 0.3  # opacity of what a surface hides
_GROUND, _LEVEL = "#dfe7f1", "#7f97b8"
_LEVELS, _FINE = 12, 401  # levels, at equal shares of the sphere; points of the grid that they are found on
_ONES = np.ones(3)
_KINDS = ((-1, "o", Y, "stable"), (1, "X", X, "unstable"), (0, "D", GREY, "at the threshold"))


@dataclass(frozen=True)
class View:
    """Axes as seen from far away: unit vectors (3,) to the right of the picture, up, and to the eye."""

    axes: Axes
    right: Array
    up: Array
    toward: Array

    @classmethod
    def of(cls, axes: Axes, toward: Array, *, aside: float = 0.2, above: float = 0.2) -> Self:
        """The view from direction `toward` (3,), which isn't Z, with Z upwards, equal scales, and margins for
        labels, in shares of what is drawn.
        """
        axes.set_axis_off()
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(aside, above)
        forward = toward / np.linalg.norm(toward)
        right = np.cross(np.array([0.0, 0.0, 1.0]), forward)
        right /= np.linalg.norm(right)
        return cls(axes, right, np.cross(forward, right), forward)

    def flat(self, points: Array) -> Array:
        """Points (..., 3) in the picture (..., 2)."""
        return np.stack([points @ self.right, points @ self.up], axis=-1)

    def sees(self, points: Array, radii: Array) -> Mask:
        """Which points (rows, 3) of an ellipsoid face the eye."""
        return np.asarray((points / radii**2) @ self.toward > 0)

    def ellipsoid(
        self, radii: Array, color: str, label: str, *, outside: Array | None = None, alpha: float = 1.0
    ) -> None:
        """Draw the visible part of an ellipsoid with semi-axes (3,) about the origin, or what of it lies
        outside another; with its sections by the principal planes.
        """
        u, v = np.meshgrid(np.linspace(0, 2 * np.pi, _AROUND + 1), np.linspace(0, np.pi, _ALONG + 1))
        points = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1) * radii
        corners = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], axis=2)
        corners = corners.reshape(-1, 4, 3)
        hull = np.full(3, 1e-9) if outside is None else outside

        def shown(places: Array) -> Mask:
            return self.sees(places, radii) & ((places**2 / hull**2).sum(axis=1) > 1)

        seen = shown(corners.mean(axis=1))
        normals = corners.mean(axis=1)[seen] / radii**2
        light = _LIGHT[0] * self.right + _LIGHT[1] * self.up + _LIGHT[2] * self.toward
        cosine = normals @ light / (np.linalg.norm(normals, axis=1) * np.linalg.norm(light))
        faces = np.array(to_rgb(color)) * (0.74 + 0.26 * np.clip(cosine, 0, 1))[:, None]
        # Edges of the faces' colour close the seams; where light shines through they would be seen twice.
        solid = alpha == 1.0
        self.axes.add_collection(
            PolyCollection(
                list(self.flat(corners[seen])), facecolors=faces, edgecolors=faces if solid else "none",
                linewidths=0.35 if solid else 0.0, rasterized=True, antialiaseds=solid, alpha=alpha,
            )
        )  # fmt: skip
        self.axes.fill([], [], color=color, label=label)
        turn = np.linspace(0, 2 * np.pi, 361)
        circle = np.stack([np.cos(turn), np.sin(turn), np.zeros(361)], axis=1)
        for k in range(3) if color in _ALONG_SECTIONS else ():
            ring = np.roll(circle, k, axis=1) * radii
            self.line(ring, shown(ring), color=_ALONG_SECTIONS[color], lw=0.7, zorder=2.2)

    def line(self, points: Array, keep: Mask | None = None, **style: Any) -> None:
        """A curve (rows, 3), of which only the rows to keep are drawn; of sparse samples the points."""
        shown = points if keep is None else np.where(keep[:, None], points, np.nan)
        if not joined(points):
            style |= {"ls": "none", "marker": ".", "ms": 2.2, "mew": 0.0}
        self.axes.plot(*self.flat(shown).T, **style, rasterized=len(points) > MOST_VECTOR_POINTS)

    def over(
        self, points: Array, radii: Array, *, lw: float, zorder: float, label: str, **style: Any
    ) -> None:
        """A curve (rows, 3) on an ellipsoid, pale where it is hidden."""
        front = self.sees(points, radii)
        self.line(points, ~front, lw=0.55 * lw, alpha=_BEHIND, **style)
        self.line(points, front, lw=lw, zorder=zorder, label=label, **style)

    def run(self, points: Array, radii: Array, label: str) -> None:
        """The path (rows, 3) of a run on an ellipsoid, with its start: of a rotation about a principal axis
        the polhode is but a point.
        """
        self.over(points, radii, lw=1.9, zorder=5, label=label, color=PINK)
        alpha = 1.0 if self.sees(points[:1], radii)[0] else _BEHIND
        self.axes.plot(*self.flat(points[0]), "o", color=PINK, ms=4.0, alpha=alpha, zorder=6)

    def spoke(self, start: Array, stop: Array, text: str, color: str) -> None:
        """Draw an axis from where it leaves a body, with a label beyond."""
        ends = self.flat(np.stack([start, stop]))
        self.axes.plot(*ends.T, color=color, lw=1.6, zorder=6, solid_capstyle="butt")
        way = (ends[1] - ends[0]) / (np.linalg.norm(ends[1] - ends[0]) or 1.0)
        self.axes.annotate(
            text, ends[1], xytext=5 * way, textcoords="offset points", color=color, fontsize=9, zorder=7,
            linespacing=1.25, ha="left" if way[0] > 0.35 else "right" if way[0] < -0.35 else "center",
            va="center" if abs(way[1]) < 0.5 else "bottom" if way[1] > 0 else "top",
            path_effects=[withStroke(linewidth=2.5, foreground="white", alpha=0.85)],
        )  # fmt: skip

    def spokes(self, radii: Array, names: Sequence[str]) -> None:
        """Draw the principal axes outside an ellipsoid, towards the eye."""
        for k, name in enumerate(names):
            front = self.toward[k] >= 0
            way = np.eye(3)[k] if front else -np.eye(3)[k]
            stop = radii[k] + 0.16 * float(radii.max())
            self.spoke(radii[k] * way, stop * way, f"{'' if front else '−'}{name}", COLORS[k])

    def box(self, points: Array, names: Sequence[str], floors: Sequence[int]) -> None:
        """Draw three axes with the ranges that points (rows, 3) cover, and shadows along some of the axes."""
        low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
        reach = float((high - low).max())
        if not reach > 1e-6 * float(np.nanmax(np.abs(points))):  # a point and its rounding
            reach = float(np.nanmax(np.abs(points))) or 1.0
        corner = low - 0.04 * reach
        self.axes.margins(0.25, 0.28)  # labels of two lines, below the title
        for k, name in enumerate(names):
            stop = np.where(np.arange(3) == k, high + 0.12 * reach, corner)
            self.spoke(corner, stop, f"{name}\n{typeset(low[k], 3)} … {typeset(high[k], 3)}", COLORS[k])
        for k in floors:
            floor = np.where(np.arange(3) == k, corner, points)
            self.line(floor, color=PALE, lw=0.6, zorder=1)


@optional
def surfaces(dataset: xarray.Dataset) -> tuple[Array, Array]:
    """Semi-axes (3,), rad/s, of the surfaces of energy and momentum; None if the motion isn't on them."""
    moments, twice, square = need(signals.energy_and_momentum(dataset))
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


@optional
def polhode(dataset: xarray.Dataset) -> Draw:
    """The tip of the angular velocity in principal axes, on the surfaces where it has some, else between axes
    with the ranges that it covers.
    """
    return partial(_polhode, dataset=dataset, rates=need(signals.path_of_rates(dataset)))


def _polhode(axes: Axes, dataset: xarray.Dataset, rates: Array) -> None:
    found, moments = surfaces(dataset), scene_of(dataset).moments
    scale, unit = scaled(rates if found is None else np.concatenate(found), "rad/s", dataset.attrs)
    names = [f"$ω_{name}$" for name in signals.axis_names(dataset)]
    points = from_start(dataset, rates / scale)
    if found is None or moments is None:
        view = View.of(axes, _VIEWS[0])
        view.line(points, color=PINK, lw=1.9, zorder=5)
        axes.plot(*view.flat(points[0]), "o", color=PINK, ms=4.0, zorder=6)
        view.box(points, names, range(3))
        titled(axes, f"Path of ω in body axes [{unit}]", rows=2)  # of the upright axis' label
        return
    energy, momentum = (radii / scale for radii in found)
    view = View.of(axes, _polhode_way(points, energy, moments))
    view.ellipsoid(energy, ENERGY_SURFACE, "2T")
    for label, ring in zip(("separatrix", "_"), separatrix(moments, energy), strict=False):
        view.over(ring, energy, lw=1.2, zorder=2.5, label=label, color=SEPARATRIX, ls=(0, (5, 2)))
    title = "Polhode on the ellipsoid of energy"
    # About a body that spins close to an axis the surfaces meet too flatly: then the momentum's is left out.
    sizes = np.linalg.norm(points, axis=1, keepdims=True)
    if float(np.nanmax(np.sort(np.abs(points / sizes), axis=1)[:, 1])) > _CLOSE:
        view.ellipsoid(momentum, MOMENTUM_SURFACE, "L²", outside=energy, alpha=0.42)
        title = "Polhode: the surfaces of energy and momentum"
    view.run(points, energy, "ω")
    labels = [f"{name}\n{typeset(size, 3)} {unit}" for name, size in zip(names, energy, strict=True)]
    view.spokes(np.maximum(energy, momentum), labels)
    key(axes, title)


def _polhode_way(points: Array, radii: Array, moments: Array) -> Array:
    """Direction (3,) to the side on which the polhode lies, and not along the plane of a separatrix."""
    mean = np.nanmean(points, axis=0)
    normals = [np.cross(ring[0], ring[90]) for ring in separatrix(moments, radii)]
    ways = [np.where(mean / radii < -1e-3, -1.0, 1.0) * way / np.linalg.norm(way) for way in _VIEWS]

    def quality(way: Array) -> float:
        planes = [abs(float(way @ normal)) / float(np.linalg.norm(normal)) for normal in normals]
        return round(min([0.35, *planes]) + 0.3 * float(way @ (mean / radii)), 2)

    return max(ways, key=quality)


@optional
def poinsot(dataset: xarray.Dataset) -> Draw:
    """The ellipsoid of energy as it rolls on the invariable plane, at the start."""
    radii, rates = need(surfaces(dataset))[0], need(signals.principal_rates(dataset))
    quaternion, along = need(signals.values(dataset, "quaternion")), need(signals.steady_momentum(dataset))
    # The picture's axes: across, across, and -L upwards, so that the plane lies below the body.
    first, second = signals.across(along)
    to_picture = np.stack([first, -second, -along])
    turn = to_picture @ rotation_matrix(from_start(dataset, quaternion)[:1])[0] @ scene_of(dataset).axes.T
    scale, _ = scaled(radii, "rad/s")
    traced, points = herpolhode_plane(dataset) / scale, from_start(dataset, rates / scale)
    return partial(_poinsot, radii=radii / scale, traced=traced, points=points, turn=turn)


def _poinsot(axes: Axes, radii: Array, traced: Array, points: Array, turn: Array) -> None:
    tip = turn @ points[0]
    depth = float(tip[2])  # the plane's height, below zero
    azimuth = np.arctan2(tip[1], tip[0]) - 0.5
    view = View.of(axes, np.array([np.cos(azimuth), np.sin(azimuth), 0.42]), aside=0.03, above=0.05)
    size = 1.15 * max(float(np.linalg.norm(traced, axis=1).max()), 0.75 * float(radii.max()))
    angle = np.linspace(0, 2 * np.pi, 181)
    disc = np.column_stack([size * np.cos(angle), size * np.sin(angle), np.full(181, depth)])
    axes.fill(*view.flat(disc).T, color="#e9edf2", zorder=0)
    body = View(axes, *(turn.T @ way for way in (view.right, view.up, view.toward)))  # in principal axes
    body.ellipsoid(radii, ENERGY_SURFACE, "_")
    body.run(points, radii, "polhode")
    ring = np.column_stack([traced[:, 0], -traced[:, 1], np.full(len(traced), depth)])
    view.line(ring, color=Z, lw=0.9, zorder=0.5, label="herpolhode")
    view.line(ring, color=Z, lw=0.6, alpha=0.25, zorder=2)  # through the body, faintly
    axes.plot(*np.stack([np.zeros(2), view.flat(tip)]).T, color=PINK, lw=1.3, zorder=5)
    place = view.flat(np.array([0.0, 0.0, 1.25 * depth]))
    axes.plot(*np.stack([np.zeros(2), place]).T, color=GREY, lw=1.1, ls=(0, (4, 2)), zorder=5)
    axes.text(place[0], place[1], "L", color=GREY, ha="center", va="top", fontsize=9.5, fontweight="bold")
    key(axes, "It rolls on the invariable plane (Poinsot)")


@optional
def sphere(dataset: xarray.Dataset, row: int) -> Draw:
    """Levels of the energy where the run starts, or ends if motors have changed them, separatrices,
    equilibria, and the path of the run, its start and positive axes on the side that is seen.
    """
    driven = any(rotor.works for rotor in gyrostats.rotors(dataset))
    need(row == 0 or driven)
    way = from_start(dataset, need(gyrostats.path(dataset)))
    gyrostat = need(Gyrostat.of(dataset, -1 - row if dataset.attrs.get(BACKWARDS) else row))
    title = "Momentum sphere in body axes: levels of energy"
    if driven:
        title = f"Momentum sphere: levels of energy if motors stopped at the {'end' if row else 'start'}"
    return partial(_sphere, ways=way / signals.norms(way)[:, None], gyrostat=gyrostat, title=title)


def _sphere(axes: Axes, ways: Array, gyrostat: Gyrostat, title: str) -> None:
    toward = np.nanmean(ways, axis=0) + 0.5 * ways[0] + np.array([0.5, 0.3, 0.4])
    view = View.of(axes, toward, aside=0.06, above=0.06)
    view.ellipsoid(_ONES, _GROUND, "_")
    right, up = np.meshgrid(*[np.linspace(-1, 1, _FINE)] * 2)
    inside = right**2 + up**2 < 1
    depth = np.sqrt(np.where(inside, 1 - right**2 - up**2, np.nan))
    flat = right[..., None] * view.right + up[..., None] * view.up
    sides = [gyrostat.energy(flat + sign * depth[..., None] * view.toward) for sign in (1, -1)]
    both = np.concatenate([side[inside] for side in sides])
    weights = np.tile(1 / np.maximum(depth[inside], 1e-3), 2)  # of a pixel on the sphere
    if np.ptp(both) > 1e-9 * np.abs(both).max():
        order = np.argsort(both)
        shares = np.cumsum(weights[order]) / weights.sum()
        levels = np.interp((np.arange(_LEVELS) + 0.5) / _LEVELS, shares, both[order])
        axes.contour(right, up, sides[0], np.unique(levels), colors=_LEVEL, linewidths=0.6, zorder=2)
    view.run(ways, _ONES, f"L = {typeset(gyrostat.size, 3)} kg m²/s")
    saddles = np.array([one.direction for one in gyrostat.equilibria if one.unstable])
    if len(saddles):
        heights = np.unique(gyrostat.energy(saddles))
        for side, width, alpha, above in zip(sides, (1.3, 0.7), (1.0, 0.25), (3.0, 1.0), strict=True):
            axes.contour(right, up, side, heights, colors=INK, linewidths=width, alpha=alpha, zorder=above)
        axes.plot([], [], color=INK, lw=1.3, label="separatrix")
    for square, marker, color, label in _KINDS:
        style: dict[str, Any] = {"marker": marker, "mfc": color, "mec": "white", "ms": 8.0, "ls": "none"}
        kind = [one.direction for one in gyrostat.equilibria if np.sign(one.square) == square]
        for n, direction in enumerate(kind):
            alpha, above = (1.0, 4.0) if direction @ view.toward > 0 else (_BEHIND, 1.5)
            axes.plot(*view.flat(direction), **style, alpha=alpha, zorder=above, label="_" if n else label)
    view.spokes(_ONES, [f"$L_{name}$" for name in "xyz"])
    key(axes, title)
