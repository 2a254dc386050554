"""The polhode on the ellipsoid of inertia, with the momentum's surface and the separatrix; Poinsot's motion.

A free body's angular velocity keeps to two ellipsoids of its axes, sum I_i w_i^2 = 2 T and
sum I_i^2 w_i^2 = L^2 (Poinsot 1834): the curve that they share is the polhode. In space the first rolls
without slipping on the plane w . L = 2 T, where it leaves the herpolhode.
"""

from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from rigidsim.look import signals
from rigidsim.look.figures import eye as eyes
from rigidsim.look.figures.style import GREY, PINK, Z, key, titled
from rigidsim.look.paths import herpolhode_plane
from rigidsim.look.record import scene_of
from rigidsim.look.solids import Array, rotation_matrix
from rigidsim.look.thinning import thinned_indices
from rigidsim.look.units import number
from rigidsim.scene.readable import si_scale

ENERGY_SURFACE, MOMENTUM_SURFACE = "#b9cde6", "#f0d3ae"
SEPARATRIX = "#4a5568"
_RING = "#8093ab"
_VIEWS = [np.array(v) for v in ((0.74, 0.52, 0.43), (0.52, 0.74, 0.43), (0.45, 0.6, 0.66), (0.85, 0.3, 0.43))]
_CLOSE = 0.06  # rad from an axis, within which facets are too coarse for the surfaces' meeting


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
    view = _view(points, energy, moments)
    covered = eyes.draw_ellipsoid(axes, view, energy, ENERGY_SURFACE)
    for ring in eyes.sections(energy):
        eyes.line(axes, view, ring, eyes.visible(ring, view, energy), color=_RING, lw=0.7)
    entries: list[Any] = [Line2D([], [], color=PINK, lw=1.9, label="ω")]
    for ring in separatrix(moments, energy):
        front = eyes.visible(ring, view, energy)
        style = {"color": SEPARATRIX, "ls": (0, (5, 2))}
        eyes.line(axes, view, ring, ~front, lw=0.6, alpha=0.25, **style)
        eyes.line(axes, view, ring, front, lw=1.2, zorder=2.5, label="separatrix", **style)
        entries[1:] = [axes.get_lines()[-1]]
    entries.append(Patch(color=ENERGY_SURFACE, label="2T"))
    title = "Polhode on the ellipsoid of energy"
    # About a body that spins close to an axis the surfaces meet too flatly: then the momentum's is left out.
    sizes = np.linalg.norm(points, axis=1, keepdims=True)
    if float(np.nanmax(np.sort(np.abs(points / sizes), axis=1)[:, 1])) > _CLOSE:
        outer = eyes.draw_ellipsoid(axes, view, momentum, MOMENTUM_SURFACE, outside=energy, alpha=0.42)
        covered = np.vstack([covered, outer])
        for ring in eyes.sections(momentum):
            beyond = eyes.visible(ring, view, momentum) & ((ring**2 / energy**2).sum(axis=1) > 1)
            eyes.line(axes, view, ring, beyond, color="#c0843a", lw=0.7, zorder=3)
        entries.append(Patch(color=MOMENTUM_SURFACE, label="L²"))
        title = "Polhode: the surfaces of energy and momentum"
    eyes.path(axes, view, points, eyes.visible(points, view, energy))
    size = float(np.abs(covered).max())
    for k, name in enumerate(names):
        way = np.eye(3)[k] if view.toward[k] >= 0 else -np.eye(3)[k]
        start = max(energy[k], momentum[k])
        text = f"{'' if view.toward[k] >= 0 else '−'}{name}\n{number(energy[k], 3)} {unit}"
        place = eyes.spoke(axes, view, start * way, (start + 0.16 * size) * way, text, eyes.COLORS[k], size)
        covered = np.vstack([covered, place])
    eyes.frame(axes, covered)
    key(axes, title, handles=entries)


def _view(points: Array, radii: Array, moments: Array) -> eyes.Eye:
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
    return eyes.eye_at(found)


def _bare(axes: Axes, rates: Array, names: list[str]) -> None:
    """Draw the path without surfaces, between three axes with the ranges that it covers."""
    scale, unit = si_scale(rates, "rad/s")
    points = rates / scale
    reach = float((np.nanmax(points, axis=0) - np.nanmin(points, axis=0)).max())
    size = float(np.nanmax(np.abs(points)))
    view = eyes.eye_at(np.array([0.74, 0.52, 0.43]))
    eyes.path(axes, view, points, np.ones(len(points), dtype=bool))
    eyes.draw_box(axes, view, points, names, reach if reach > 1e-6 * size else size or 1.0, floors=range(3))
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
    radii, path, points = (values / scale for values in found[:3])
    turn = found[3]
    tip = turn @ points[0]
    depth = float(tip[2])  # the plane's height, below zero
    ring = np.column_stack([path[:, 0], -path[:, 1], np.full(len(path), depth)])
    azimuth = np.arctan2(tip[1], tip[0]) - 0.5
    view = eyes.eye_at(np.array([np.cos(azimuth), np.sin(azimuth), 0.42]))
    size = 1.15 * max(float(np.linalg.norm(path, axis=1).max()), 0.75 * float(radii.max()))
    angle = np.linspace(0, 2 * np.pi, 181)
    disc = np.column_stack([size * np.cos(angle), size * np.sin(angle), np.full(181, depth)])
    axes.fill(*view.flat(disc).T, color="#e9edf2", zorder=0)
    entries = [Line2D([], [], color=PINK, lw=1.9, label="polhode")]
    if signals.joined(ring):
        ring = ring[thinned_indices(len(ring), 6000)]
        eyes.line(axes, view, ring, color=Z, lw=0.9, zorder=0.5, label="herpolhode")
        entries.append(axes.get_lines()[-1])
        eyes.line(axes, view, ring, color=Z, lw=0.6, alpha=0.25, zorder=2)  # through the body, faintly
    own = eyes.Eye(*(turn.T @ way for way in (view.right, view.up, view.toward)))  # in principal axes
    covered = eyes.draw_ellipsoid(axes, own, radii, ENERGY_SURFACE)
    for one in eyes.sections(radii):
        eyes.line(axes, own, one, eyes.visible(one, own, radii), color=_RING, lw=0.7, zorder=3)
    eyes.path(axes, own, points, eyes.visible(points, own, radii))
    place = view.flat(np.array([0.0, 0.0, 1.25 * depth]))
    axes.plot(*np.stack([np.zeros(2), view.flat(tip)]).T, color=PINK, lw=1.3, zorder=5)
    axes.plot(*np.stack([np.zeros(2), place]).T, color=GREY, lw=1.1, ls=(0, (4, 2)), zorder=5)
    axes.text(place[0], place[1], "L", color=GREY, ha="center", va="top", fontsize=9.5, fontweight="bold")
    eyes.frame(axes, np.vstack([covered, view.flat(disc), place[None]]), aside=0.06, above=0.1)
    key(axes, "It rolls on the invariable plane (Poinsot)", handles=entries)
