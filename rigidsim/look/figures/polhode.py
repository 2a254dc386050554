"""The polhode on the ellipsoid of inertia, with the momentum's surface and the separatrix; Poinsot's motion.

A free body's angular velocity keeps to two ellipsoids of its axes, sum I_i w_i^2 = 2 T and
sum I_i^2 w_i^2 = L^2 (Poinsot 1834): the curve that they share is the polhode. In space the first rolls
without slipping on the plane w . L = 2 T, where it leaves the herpolhode.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rigidsim.look import signals
from rigidsim.look.figures import eye as eyes
from rigidsim.look.figures.scales import number, si_scale
from rigidsim.look.figures.style import GREY, INK, PALE, PINK, X, Y, Z, joined, key, square, titled, trace
from rigidsim.look.solids import rotation_matrix
from rigidsim.look.thinning import thinned_indices

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

ENERGY_SURFACE, MOMENTUM_SURFACE = "#b9cde6", "#f0d3ae"
SEPARATRIX = "#4a5568"
_COLORS = (X, Y, Z)
_VIEWS = [np.array(v) for v in ((0.74, 0.52, 0.43), (0.52, 0.74, 0.43), (0.45, 0.6, 0.66), (0.85, 0.3, 0.43))]
_SPREAD = 1e-5  # of 2 T, up to which it counts as constant: more than rounding in single precision
_CLOSE = 0.06  # rad from an axis, within which facets are too coarse for the surfaces' meeting


def surfaces(dataset: xarray.Dataset) -> tuple[Array, Array] | None:
    """Semi-axes (3,), rad/s, of the surfaces of energy and momentum; None if the motion isn't on them."""
    moments, rates = signals.moments(dataset), signals.principal_rates(dataset)
    if moments is None or rates is None:
        return None
    rates = rates[np.isfinite(rates).all(axis=1)]
    twice, square_ = rates**2 @ moments, rates**2 @ moments**2
    for values in (twice, square_):
        # loads, or axes that aren't the principal ones, move the tip off them
        if not len(values) or values.min() <= 0 or values.max() > (1 + _SPREAD) * values.min():
            return None
    return np.sqrt(twice.mean() / moments), np.sqrt(square_.mean()) / moments


def separatrix(moments: Array, radii: Array) -> list[Array]:
    """The two circles-in-perspective (361, 3) through the intermediate axis on the ellipsoid of energy.

    Where L^2 = 2 T B: the planes w_a sqrt(A (B - A)) = ± w_c sqrt(C (C - B)), A < B < C. None for a body
    with two moments alike.
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


def polhode_panel(axes: Axes, dataset: xarray.Dataset) -> None:
    """The tip of the angular velocity in principal axes, on the surfaces where it has some."""
    rates, found = signals.principal_rates(dataset), surfaces(dataset)
    assert rates is not None
    if found is None:
        _bare(axes, dataset, rates)
        return
    moments = signals.moments(dataset)
    assert moments is not None
    scale, unit = si_scale(np.concatenate(found), "rad/s")
    energy, momentum = (radii / scale for radii in found)
    points = rates / scale
    curves = separatrix(moments, energy)
    view = _view(points, energy, moments)
    covered = eyes.draw_ellipsoid(axes, view, energy, ENERGY_SURFACE)
    for ring in eyes.sections(energy):
        eyes.line(axes, view, ring, eyes.visible(ring, view, energy), color="#8093ab", lw=0.7)
    for number_, ring in enumerate(curves):
        front = eyes.visible(ring, view, energy)
        style = {"color": SEPARATRIX, "ls": (0, (5, 2))}
        eyes.line(axes, view, ring, ~front, lw=0.6, alpha=0.25, **style)
        label = None if number_ else "separatrix"
        eyes.line(axes, view, ring, front, lw=1.2, zorder=2.5, label=label, **style)
    handles = axes.get_legend_handles_labels()[0]
    # About a body that spins close to an axis the surfaces meet too flatly: then the momentum's is left out.
    sizes = np.linalg.norm(points, axis=1, keepdims=True)
    both = float(np.nanmax(np.sort(np.abs(points / sizes), axis=1)[:, 1])) > _CLOSE
    if both:
        outer = eyes.draw_ellipsoid(axes, view, momentum, MOMENTUM_SURFACE, outside=energy, alpha=0.42)
        covered = np.vstack([covered, outer])
        for ring in eyes.sections(momentum):
            beyond = eyes.visible(ring, view, momentum) & ((ring**2 / energy**2).sum(axis=1) > 1)
            eyes.line(axes, view, ring, beyond, color="#c0843a", lw=0.7, zorder=3)
    _path(axes, view, points, eyes.visible(points, view, energy))
    size = float(np.abs(covered).max())
    for k, name in enumerate(signals.axis_names(dataset)):
        sign = 1.0 if view.toward[k] >= 0 else -1.0
        ends = np.zeros((2, 3))
        start = max(energy[k], momentum[k])
        ends[:, k] = sign * start, sign * (start + 0.16 * size)
        text = f"{'' if sign > 0 else '−'}$ω_{name}$\n{number(energy[k], 3)} {unit}"
        place = eyes.spoke(axes, view, ends[0], ends[1], text, _COLORS[k], size)
        covered = np.vstack([covered, place])
    eyes.frame(axes, covered)
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries = [
        Line2D([], [], color=PINK, lw=1.9, label="ω"),
        *handles,
        Patch(color=ENERGY_SURFACE, label="2T"),
    ]
    if both:
        entries.append(Patch(color=MOMENTUM_SURFACE, label="L²"))
    key(
        axes,
        "Polhode: the surfaces of energy and momentum" if both else "Polhode on the ellipsoid of energy",
        handles=entries,
    )


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


def _path(axes: Axes, view: eyes.Eye, points: Array, front: NDArray[np.bool_], **style: object) -> None:
    if joined(points):
        eyes.line(axes, view, points, ~front, color=PINK, lw=1.1, alpha=0.35)
        eyes.line(axes, view, points, front, color=PINK, lw=1.9, zorder=5)
    else:
        dots = {"ls": "none", "marker": ".", "ms": 2.2, "mew": 0.0, "color": PINK}
        eyes.line(axes, view, points, ~front, alpha=0.3, **dots)
        eyes.line(axes, view, points, front, zorder=5, **dots)
    # The start is marked: of a rotation about a principal axis the polhode is but a point.
    (x, y) = view.flat(points[0])
    axes.plot(x, y, "o", color=PINK, ms=4.0, alpha=1.0 if front[0] else 0.35, zorder=6)


def _bare(axes: Axes, dataset: xarray.Dataset, rates: Array) -> None:
    """Draw the path without surfaces, between three axes with the ranges that it covers."""
    scale, unit = si_scale(rates, "rad/s")
    points = rates / scale
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    reach = float((high - low).max())
    reach = reach if reach > 1e-6 * np.nanmax(np.abs(points)) else float(np.nanmax(np.abs(points))) or 1.0
    view = eyes.eye_at(np.array([0.74, 0.52, 0.43]))
    corner = low - 0.04 * reach
    covered = [view.flat(points)]
    for k, name in enumerate(signals.axis_names(dataset)):
        start, stop = corner.copy(), corner.copy()
        stop[k] = high[k] + 0.12 * reach
        text = f"$ω_{name}$\n{number(low[k], 3)} … {number(high[k], 3)}"
        covered.append(eyes.spoke(axes, view, start, stop, text, _COLORS[k], reach)[None])
        floor = points.copy()
        floor[:, k] = corner[k]
        eyes.line(axes, view, floor, color=PALE, lw=0.6, zorder=1, rasterized=len(points) > 6000)
        covered.append(view.flat(floor))
    _path(axes, view, points, np.ones(len(points), dtype=bool))
    eyes.frame(axes, np.vstack(covered), aside=0.34, above=0.3)
    titled(axes, f"Path of ω in body axes [{unit}]")


def herpolhode_panel(axes: Axes, dataset: xarray.Dataset) -> None:
    """The tip of the angular velocity on the invariable plane, seen along the momentum."""
    plane = herpolhode(dataset)
    assert plane is not None
    scale, unit = si_scale(plane, "rad/s")
    x, y = (plane / scale).T
    trace(axes, x, y)
    axes.plot(0, 0, "+", color=INK, ms=9, mew=1.3)
    square(axes, np.append(x, 0), np.append(y, 0))
    axes.set_xlabel(f"across L [{unit}]")
    axes.set_ylabel(f"across L [{unit}]")
    key(axes, "Herpolhode on the invariable plane (+: L)")


def herpolhode(dataset: xarray.Dataset) -> Array | None:
    """Component of the angular velocity across the momentum (rows, 2), rad/s; None if the momentum moves."""
    along = signals.steady_momentum(dataset)
    rates, quaternion = signals.values(dataset, "angular_velocity"), signals.values(dataset, "quaternion")
    if along is None or rates is None or quaternion is None:
        return None
    first = np.cross(np.eye(3)[np.abs(along).argmin()], along)
    first /= np.linalg.norm(first)
    in_space = np.einsum("tij,tj->ti", rotation_matrix(quaternion), rates)
    return np.stack([in_space @ first, in_space @ np.cross(along, first)], axis=1)


def poinsot_panel(axes: Axes, dataset: xarray.Dataset) -> None:
    """The ellipsoid of energy as it rolls on the invariable plane, at the first sample."""
    found, quaternion = surfaces(dataset), signals.values(dataset, "quaternion")
    plane, rates = herpolhode(dataset), signals.principal_rates(dataset)
    along = signals.steady_momentum(dataset)
    assert found is not None
    assert quaternion is not None
    assert plane is not None
    assert rates is not None
    assert along is not None
    scale, _ = si_scale(found[0], "rad/s")
    radii, points, path = found[0] / scale, rates / scale, plane / scale
    # The picture's axes: across, across, and -L upwards, so that the plane lies below the body.
    first = np.cross(np.eye(3)[np.abs(along).argmin()], along)
    first /= np.linalg.norm(first)
    second = np.cross(along, first)
    to_picture = np.stack([first, -second, -along])
    matrix = rotation_matrix(quaternion[:1])[0] @ signals.principal_axes(dataset).T
    turn = to_picture @ matrix
    tip = turn @ points[0]
    depth = float(tip[2])  # the plane's height, below zero
    ring = np.column_stack([path[:, 0], -path[:, 1], np.full(len(path), depth)])
    azimuth = np.arctan2(tip[1], tip[0]) - 0.5
    view = eyes.eye_at(np.array([np.cos(azimuth), np.sin(azimuth), 0.42]))
    size = 1.15 * max(float(np.linalg.norm(path, axis=1).max()), 0.75 * float(radii.max()))
    angle = np.linspace(0, 2 * np.pi, 181)
    disc = np.column_stack([size * np.cos(angle), size * np.sin(angle), np.full(181, depth)])
    axes.fill(*view.flat(disc).T, color="#e9edf2", zorder=0)
    handles = []
    drawn = joined(ring)
    if drawn:
        ring = ring[thinned_indices(len(ring), 6000)]
        eyes.line(axes, view, ring, color=Z, lw=0.9, zorder=0.5, label="herpolhode")
        handles.append(axes.get_lines()[-1])
    own = eyes.Eye(*(turn.T @ way for way in (view.right, view.up, view.toward)))  # in principal axes
    covered = eyes.draw_ellipsoid(axes, own, radii, ENERGY_SURFACE)
    if drawn:  # through the body, faintly
        eyes.line(axes, view, ring, color=Z, lw=0.6, alpha=0.25, zorder=2)
    for one in eyes.sections(radii):
        eyes.line(axes, own, one, eyes.visible(one, own, radii), color="#8093ab", lw=0.7, zorder=3)
    _path(axes, own, points, eyes.visible(points, own, radii))
    start, stop = np.zeros(3), np.array([0.0, 0.0, 1.25 * depth])
    axes.plot(*view.flat(np.stack([start, tip])).T, color=PINK, lw=1.3, zorder=5)
    axes.plot(*view.flat(np.stack([start, stop])).T, color=GREY, lw=1.1, ls=(0, (4, 2)), zorder=5)
    place = view.flat(stop)
    axes.text(place[0], place[1], "L", color=GREY, ha="center", va="top", fontsize=9.5, fontweight="bold")
    everything = np.vstack([covered, view.flat(disc), place[None]])
    eyes.frame(axes, everything, aside=0.06, above=0.1)
    from matplotlib.lines import Line2D

    entries = [Line2D([], [], color=PINK, lw=1.9, label="polhode"), *handles]
    key(axes, "It rolls on the invariable plane (Poinsot)", handles=entries)
