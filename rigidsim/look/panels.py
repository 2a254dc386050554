"""The single panels of the standard figure. Imported only where a figure is drawn."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import cycle, islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rigidsim.look.page import read_config
from rigidsim.look.readable_time import unit_for
from rigidsim.look.roles import drifts, put_backs
from rigidsim.look.solids import rotation_matrix
from rigidsim.look.stage import plane_view
from rigidsim.look.thinning import thinned_indices

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from mpl_toolkits.mplot3d import Axes3D

Array = NDArray[np.float64]

X, Y, Z, W = "#d1495b", "#3a9a5b", "#2f6fbf", "#6b7280"
PINK = "#c2327a"
PALETTE = ("#2f6fbf", "#e08e2b", "#8f5bb5", "#3a9a5b", "#d1495b", "#17a2b0", "#8c6d46", "#6b7280")
VIEW = (22.0, 36.0)  # elevation and azimuth of the 3D panels, degrees

_PREFIXES = {0: "", -3: "m", -6: "µ", -9: "n", -12: "p", -15: "f", -18: "a", 3: "k", 6: "M", 9: "G"}


@dataclass(frozen=True)
class Panel:
    """What a panel needs (`shows`) and how it is drawn on axes (`draw`)."""

    shows: Callable[[xarray.Dataset], bool]
    draw: Callable[[Any, xarray.Dataset], None]


def time_scale(seconds: Array) -> tuple[float, str]:
    """Divisor and unit in which the span of `seconds` reads as a number of order 1 to 1000."""
    unit = unit_for(float(np.abs(seconds).max(initial=0.0)))
    return unit.seconds, unit.symbol


def si_scale(values: Array, unit: str) -> tuple[float, str]:
    """Divisor and prefixed unit for values of a plain SI unit such as m or rad/s."""
    finite = np.abs(values[np.isfinite(values)])
    largest = float(finite.max(initial=0.0))
    if largest == 0 or 0.1 <= largest < 1e3:
        return 1.0, unit
    exponent = 3 * int(np.floor(np.log10(largest) / 3 + 1e-9))
    if exponent in _PREFIXES:
        return 10.0**exponent, _PREFIXES[exponent] + unit
    return 10.0**exponent, f"1e{exponent} {unit}"


def time_axis(axes: Axes, dataset: xarray.Dataset, *, labelled: bool) -> None:
    """Limits of the run on a panel over time, and the label with its unit on the lowest one."""
    seconds = _seconds(dataset)
    scale, unit = time_scale(seconds)
    if seconds[0] != seconds[-1]:
        axes.set_xlim(seconds[0] / scale, seconds[-1] / scale)
    axes.tick_params(labelbottom=labelled)
    if labelled:
        axes.set_xlabel(f"time [{unit}]")


def _seconds(dataset: xarray.Dataset) -> Array:
    return np.asarray(dataset["time"].values, dtype=np.float64)


def _values(dataset: xarray.Dataset, name: str) -> Array:
    return np.asarray(dataset[name].transpose("time", ...).values, dtype=np.float64)


def _curves(
    axes: Axes, dataset: xarray.Dataset, values: Array, labels: list[str], hues: Sequence[str]
) -> None:
    seconds = _seconds(dataset)
    time = seconds / time_scale(seconds)[0]
    for column, label, hue in zip(values.T, labels, hues, strict=False):
        axes.plot(time, column, color=hue, label=label)
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 0.99),
        ncols=len(labels),
        borderaxespad=0.0,
        handlelength=1.2,
        columnspacing=1.1,
        handletextpad=0.5,
    )


def _rates(axes: Axes, dataset: xarray.Dataset) -> None:
    values = _values(dataset, "angular_velocity")
    scale, unit = si_scale(values, "rad/s")
    _curves(axes, dataset, values / scale, ["$ω_x$", "$ω_y$", "$ω_z$"], (X, Y, Z))
    axes.set_title("Angular velocity, body axes")
    axes.set_ylabel(f"ω [{unit}]")


def _attitude(axes: Axes, dataset: xarray.Dataset) -> None:
    if "euler_angles" in dataset:
        values = np.rad2deg(_values(dataset, "euler_angles"))
        if lost := "angles_wrapped_from" in dataset.attrs:  # too sparse for lines from one to the next
            axes.set_prop_cycle(linestyle=["none"], marker=["."])
        values, labels = (values, ["φ", "θ", "ψ"]) if lost else _without_growth(dataset, values)
        _curves(axes, dataset, values, labels, PALETTE)
        axes.set_title("Euler angles" + (", within one turn" if lost else ""))
        axes.set_ylabel("angle [deg]")
        return
    axis = rotation_matrix(_values(dataset, "quaternion"))[..., 2]
    _curves(axes, dataset, axis, ["$z_X$", "$z_Y$", "$z_Z$"], (X, Y, Z))
    axes.set_title("Direction of the body's z axis in space")
    axes.set_ylabel("direction cosine")
    axes.set_ylim(-1.08, 1.08)


def _without_growth(dataset: xarray.Dataset, angles: Array) -> tuple[Array, list[str]]:
    """Angles (rows, 3) in degrees, less their mean growth where they run through more than two turns.

    Otherwise one fast spin would press the others flat. The labels say what was taken off.
    """
    seconds = _seconds(dataset)
    scale, unit = time_scale(seconds)
    shown, labels = angles.copy(), ["φ", "θ", "ψ"]
    for k, symbol in enumerate(labels):
        finite = np.flatnonzero(np.isfinite(angles[:, k]))
        if len(finite) < 2 or np.ptp(angles[finite, k]) <= 720:
            continue
        first, last = finite[0], finite[-1]
        rate = (angles[last, k] - angles[first, k]) / (seconds[last] - seconds[first])
        shown[:, k] = angles[:, k] - angles[first, k] - rate * (seconds - seconds[first])
        labels[k] = f"{symbol} − {rate * scale / 360:.4g} turns/{unit}"
    return shown, labels


def _drifts(axes: Axes, dataset: xarray.Dataset) -> None:
    seconds = _seconds(dataset)
    time = seconds / time_scale(seconds)[0]
    found, projected = drifts(dataset), put_backs(dataset)
    top, low = 0.0, np.inf
    for (name, drift), hue in zip(found.items(), cycle(PALETTE), strict=False):
        magnitude = np.abs(_values(dataset, str(drift.name))).reshape(len(time), -1).max(axis=1)
        # Zero has no place on a logarithmic axis: a gap there, not a spike to the frame.
        shown = np.where(magnitude > 0, magnitude, np.nan)
        axes.plot(time, shown, color=hue, label=name.replace("_", " "), lw=0.7, alpha=0.85)
        curves = [shown]
        if name in projected:  # what the drift would have been
            magnitude = np.abs(_values(dataset, str(projected[name].name))).reshape(-1)
            curves.append(np.where(magnitude > 0, magnitude, np.nan))
            axes.plot(time, curves[-1], color=hue, lw=1.0, ls=(0, (4, 2)))
        for curve in curves:
            if np.isfinite(curve).any():
                top = max(top, float(np.nanmax(curve)))
                low = min(low, float(np.nanpercentile(curve, 1)))
    axes.set_title("Drift of invariants" + (" (dashed: what was put back)" if projected else ""))
    axes.set_ylabel("relative drift")
    if top > 0:
        axes.set_yscale("log")
        axes.set_ylim(low / 5, top * 8)
    axes.legend(
        loc="upper left", ncols=2 if len(found) > 3 else 3, borderaxespad=0.2, handlelength=1.2,
        columnspacing=1.1, labelspacing=0.25,
    )  # fmt: skip


def _polhode(axes: Axes3D, dataset: xarray.Dataset) -> None:
    values = _values(dataset, "angular_velocity")
    scale, unit = si_scale(values, "rad/s")
    axes.set_title("Polhode: the tip of ω in body axes")
    radii = _ellipsoid(dataset)
    points = _evenly(values / scale)
    if radii is None:
        _frame(axes, ["$ω_x$", "$ω_y$", "$ω_z$"], unit)
        axes.plot(*points.T, color=PINK, lw=1.4)
        _equal(axes, points, zoom=0.8)
        return
    radii = radii / scale
    axes.set_title("Polhode on the ellipsoid of inertia")
    axes.view_init(*VIEW)
    axes.set_proj_type("ortho")
    axes.set_axis_off()
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 61), np.linspace(0, np.pi, 31))
    surface = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1) * radii
    axes.plot_surface(
        *np.moveaxis(surface, -1, 0), color="#9db7d5", alpha=0.16, linewidth=0, shade=True,
        rcount=31, ccount=61,
    )  # fmt: skip
    eye = _eye()
    for k in range(3):  # the sections by the coordinate planes give the ellipsoid its shape
        angle = np.linspace(0, 2 * np.pi, 181)
        ring = np.zeros((181, 3))
        ring[:, (k + 1) % 3] = radii[(k + 1) % 3] * np.cos(angle)
        ring[:, (k + 2) % 3] = radii[(k + 2) % 3] * np.sin(angle)
        front = (ring / radii**2) @ eye > 0
        _broken(axes, ring, front, color="#8093ab", lw=0.8)
        _broken(axes, ring, ~front, color="#c3cedb", lw=0.6)
        # Its semi-axes, drawn outside it only and labelled with their length, stand for a frame.
        ends = np.zeros((2, 3))
        ends[:, k] = radii[k], radii[k] + 0.3 * radii.max()
        axes.plot(*ends.T, color=(X, Y, Z)[k], lw=1.6, zorder=6)
        text = f"$ω_{'xyz'[k]}$  {radii[k]:.3g} {unit}"
        axes.text(
            *(ends[1] + 0.06 * radii.max() * np.eye(3)[k]), text, color=(X, Y, Z)[k], fontsize=9,
            ha="center", va="bottom" if k == 2 else "top", zorder=7,
        )  # fmt: skip
    front = (points / radii**2) @ eye > 0
    _broken(axes, points, ~front, color=PINK, lw=1.2, alpha=0.35)
    _broken(axes, points, front, color=PINK, lw=1.9, zorder=5)
    # The start is marked: of a rotation about a principal axis the polhode is but a point.
    axes.scatter(*points[0], color=PINK, s=16, depthshade=False, alpha=1.0 if front[0] else 0.35, zorder=6)
    _equal(axes, surface.reshape(-1, 3), zoom=1.2)


def _ellipsoid(dataset: xarray.Dataset) -> Array | None:
    """Semi-axes (3,) rad/s of sum I_i w_i^2 = 2T, or None where the motion isn't on one."""
    try:
        moments = np.array(json.loads(str(dataset.attrs["principal_moments"])), dtype=float)
    except (KeyError, ValueError, TypeError):
        return None
    if moments.shape != (3,) or not (moments > 0).all():
        return None
    twice = (_values(dataset, "angular_velocity") ** 2) @ moments
    twice = twice[np.isfinite(twice)]
    # One per cent: loads, or body axes that aren't the principal ones, move the tip off it.
    if not len(twice) or twice.min() <= 0 or twice.max() > 1.01 * twice.min():
        return None
    return np.asarray(np.sqrt(twice.mean() / moments))


def _position(axes: Axes3D, dataset: xarray.Dataset) -> None:
    values = _values(dataset, "position")
    scale, unit = si_scale(values, "m")
    axes.set_title("Position in space")
    _frame(axes, ["X", "Y", "Z"], unit)
    points = _evenly(values / scale)
    elevation, azimuth = np.rad2deg(plane_view(points))
    axes.view_init(elevation, azimuth)
    _ribbon(axes, points)
    axes.scatter(*points[0], color="#1b2733", s=16, depthshade=False)
    _equal(axes, points, zoom=0.8)


def facts(axes: Axes, dataset: xarray.Dataset, *, largest: dict[str, float], complete: bool) -> None:
    """What was run and what was conserved, as a short table.

    `largest`: magnitude of each invariant's drift; `complete`: whether every sample was read for them.
    """
    config = read_config(dataset)
    integrator = config.get("integrator", {})
    lines = [
        (key, str(value))
        for key, value in (
            ("formulation", dataset.attrs.get("formulation") or integrator.get("formulation")),
            ("precision", dataset.attrs.get("precision") or integrator.get("precision")),
            ("tolerance", integrator.get("tolerance")),
            ("steps", dataset.attrs.get("steps")),
        )
        if value not in (None, "")
    ]
    bound = "" if complete else "≥ "  # of the samples that were read
    for name, drift in islice(largest.items(), max(8 - len(lines), 2)):
        label = name.replace("_", " ")
        lines.append((f"largest drift, {label}", f"{bound}{drift:.1e}" if drift else f"{bound}0"))
    axes.set_axis_off()
    for row, (key, value) in enumerate(lines):
        height = 1.0 - row / 8
        axes.text(0.06, height, key, color="#6b7280", fontsize=9, va="top", clip_on=False)
        axes.text(0.62, height, value, color="#1b2733", fontsize=9, va="top", clip_on=False)


def _frame(axes: Axes3D, labels: list[str], unit: str) -> None:
    axes.view_init(*VIEW)
    axes.set_proj_type("ortho")
    for name, label in zip("xyz", labels, strict=True):
        axis = getattr(axes, f"{name}axis")
        axis.set_pane_color((1, 1, 1, 0))
        axis._axinfo["grid"]["color"] = "#eceff2"
        getattr(axes, f"set_{name}label")(f"{label} [{unit}]", labelpad=2)
    axes.tick_params(labelsize=7.5, pad=0)


def _eye() -> Array:
    up, around = np.deg2rad(VIEW)
    return np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])


def _ribbon(axes: Axes3D, points: Array) -> None:
    """A curve coloured by time, from dark to light."""
    from matplotlib import colormaps
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    pieces = np.stack([points[:-1], points[1:]], axis=1)
    hues = colormaps["plasma"](np.linspace(0.0, 0.86, len(pieces)))
    axes.add_collection3d(Line3DCollection(pieces, colors=hues, linewidths=1.7))


def _broken(axes: Axes3D, points: Array, keep: NDArray[np.bool_], **style: Any) -> None:
    axes.plot(*np.where(keep[:, None], points, np.nan).T, **style)


def _evenly(points: Array) -> Array:
    """At most 2000 of the points: each piece of a 3D curve is an object of its own in the file."""
    return points[thinned_indices(len(points), 2000)]


def _equal(axes: Axes3D, points: Array, *, zoom: float) -> None:
    from matplotlib.ticker import MaxNLocator

    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    # A constant vector is a point and rounding: not something to magnify.
    middle, span = (
        (low + high) / 2,
        max(float((high - low).max()), 1e-6 * np.nanmax(np.abs(points))),
    )
    # A curve that is almost plane or straight keeps a box of some depth.
    half = np.maximum((high - low) / 2, 0.15 * (span or 1.0)) * 1.05
    for name, center, reach in zip("xyz", middle, half, strict=True):
        getattr(axes, f"set_{name}lim")(center - reach, center + reach)
        bins = 4 if reach > 0.5 * half.max() else 2
        getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(bins))
    axes.set_box_aspect(half, zoom=zoom)


def _has(*names: str) -> Callable[[xarray.Dataset], bool]:
    return lambda dataset: any(name in dataset for name in names)


CURVES = (
    Panel(_has("angular_velocity"), _rates),
    Panel(_has("euler_angles", "quaternion"), _attitude),
    Panel(lambda dataset: bool(drifts(dataset)), _drifts),
)
SPACES = (Panel(_has("angular_velocity"), _polhode), Panel(_has("position"), _position))
