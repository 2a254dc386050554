"""Panels of axis directions: polar motion, pole path, nutation, a top from above, libration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rigidsim.look import signals
from rigidsim.look.figures import fits, timelines
from rigidsim.look.figures.scales import angle_scale, angle_text, si_scale
from rigidsim.look.figures.style import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    VIOLET,
    curve,
    key,
    note,
    square,
    titled,
    trace,
)
from rigidsim.scene.readable_time import span_text

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
_TURN = 2 * np.pi
_SMALL = 0.05  # rad: sines of smaller angles read as angles


def polar_motion_panel(axes: Axes, dataset: xarray.Dataset) -> None:
    """The spin axis seen from the figure axis, m1 to the right and m2 up, and its period."""
    plane = signals.polar_motion(dataset)
    assert plane is not None
    seconds = signals.seconds(dataset)
    scale, unit = angle_scale(plane)
    x, y = (plane / scale).T
    trace(axes, x, y)
    axes.plot(0, 0, "+", color=INK, ms=10, mew=1.3)
    square(axes, np.append(x, 0), np.append(y, 0))
    axes.set_xlabel(f"$m_1$ [{unit}]")
    axes.set_ylabel(f"$m_2$ [{unit}]")
    rate = fits.circulation(seconds, plane)
    radius = np.hypot(*plane.T)
    round_ = np.nanmax(radius) - np.nanmin(radius) < 1e-3 * np.nanmax(radius)
    size = angle_text(float(np.nanmean(radius)))
    if not round_:
        size = f"{angle_text(float(np.nanmin(radius)))} to {angle_text(float(np.nanmax(radius)))}"
    title = "Polar motion (+: figure axis)"
    if rate is None:
        key(axes, f"{title}, {size}")
        return
    period = span_text(_TURN / abs(rate), 5)
    way = "counterclockwise" if rate > 0 else "clockwise"
    if np.nanmin(radius) > 0.55 * np.nanmax(radius):
        note(axes, 0.5, 0.62, f"{period}\n{way}", fontsize=11.5, fontweight="bold")
        note(axes, 0.5, 0.40, f"radius {size}", color=GREY)
        titled(axes, title)
    else:
        key(axes, f"{title}: once round in {period}, {way}")


def pole_path_panel(axes: Axes, dataset: xarray.Dataset) -> None:
    """Path of the figure axis in space, seen from outside along the pole that it circles.

    Distances from the centre are angles. A free body's pole circles the momentum; else the reference
    plane's pole is the centre.
    """
    shown, center, title = pole_paths(dataset)
    scale, unit = angle_scale(np.concatenate([path.ravel() for path in shown.values()]))
    everything = []
    for name, path in shown.items():
        x, y = (path / scale).T
        everything.append(np.stack([x, y], axis=1))
        if name == "figure" or len(shown) == 1:
            trace(axes, x, y)
        else:
            color = timelines.AXIS_COLORS[name]
            curve(axes, x, y, in_plane=True, color=color, lw=0.7, alpha=0.6, zorder=1, label=f"{name} axis")
    points = np.vstack(everything)
    reach = float(np.nanmax(np.abs(points - np.nanmean(points, axis=0))))
    if np.nanmin(np.hypot(*points.T)) < 3 * reach:  # not so far that it would press the path flat
        axes.plot(0, 0, "+", color=INK, ms=10, mew=1.3)
        title += f" (+: {center})"
        points = np.vstack([points, [[0.0, 0.0]]])
    square(axes, *points.T)
    axes.set_xlabel(f"along X [{unit}]")
    axes.set_ylabel(f"along Y [{unit}]")
    if center == "momentum":
        axes.set_xlabel(f"across the momentum [{unit}]")
        axes.set_ylabel(f"across the momentum [{unit}]")
    rate = fits.circulation(signals.seconds(dataset), next(iter(shown.values())))
    if rate is not None:
        period = span_text(_TURN / abs(rate), 4)
        title += f", once round in {period}"
    key(axes, title)


def pole_paths(dataset: xarray.Dataset) -> tuple[dict[str, Array], str, str]:
    """Paths (rows, 2), rad, by axis; a description of the centre; and a title."""
    along = signals.steady_momentum(dataset)
    if along is not None:
        first = np.cross(np.eye(3)[np.abs(along).argmin()], along)
        first /= np.linalg.norm(first)
        paths = {}
        for name in ("figure", "spin"):
            axis = signals.pole(dataset, name)
            if axis is not None:
                across = np.stack([axis @ first, axis @ np.cross(along, first)], axis=1)
                size = np.linalg.norm(across, axis=1)
                angle = np.arctan2(size, axis @ along)
                ratio = np.divide(angle, size, out=np.ones_like(size), where=size > 1e-12)
                paths[name] = across * ratio[:, None]
        return paths, "momentum", "Path of the figure axis in space"
    paths = {}
    for name in ("figure", "momentum"):
        found = signals.orientation(dataset, name)
        if found is not None:
            tilt, node = found
            paths[name] = np.stack([tilt * np.sin(node), -tilt * np.cos(node)], axis=1)
    if len(paths) == 2 and _near(paths["figure"], paths["momentum"]):
        del paths["momentum"]
    return paths, "reference pole", "Path of the pole in space"


def nutation_panel(axes: Axes, dataset: xarray.Dataset) -> None:
    """Motion of the pole about its mean motion: longitude times sin(obliquity) across, obliquity up."""
    plane = nutation(dataset)
    assert plane is not None
    seconds = signals.seconds(dataset)
    scale, unit = angle_scale(plane)
    x, y = (plane / scale).T
    trace(axes, x, y)
    square(axes, x, y)
    axes.set_xlabel(f"Δlongitude · sin(obliquity) [{unit}]")
    axes.set_ylabel(f"Δobliquity [{unit}]")
    ellipse = fits.leading_ellipse(seconds, plane)
    if ellipse is None:
        titled(axes, "Nutation: the pole about its mean motion")
        return
    across, along = (ellipse.curve() / scale).T
    period = span_text(_TURN / ellipse.rate, 3)
    axes.plot(across, along, color=INK, lw=1.1, ls=(0, (4, 2)), label=_ellipse_label(ellipse, period))
    key(axes, "Nutation: the pole about its mean motion")


def _ellipse_label(ellipse: fits.FittedEllipse, period: str) -> str:
    long, short = ellipse.semi_axes
    return f"{period}: semi-axes {angle_text(long, 3)}, {angle_text(short, 3)}"


def nutation(dataset: xarray.Dataset) -> Array | None:
    """The figure axis (else the momentum) less its secular motion (rows, 2), rad.

    Longitude of the node, less a straight line, times sin of the mean obliquity; obliquity less its mean.
    """
    found = signals.orientation(dataset, "figure") or signals.orientation(dataset, "momentum")
    if found is None:
        return None
    tilt, node = found
    seconds = signals.seconds(dataset)
    mean = fits.secular(seconds, tilt, level=True).at_start
    across = (node - fits.secular(seconds, node).at(seconds)) * np.sin(mean)
    return np.stack([across, tilt - mean], axis=1)


def tip_panel(axes: Axes, dataset: xarray.Dataset) -> None:
    """The tip of a top seen from above; its first turn about the vertical stands out."""
    path, unit_name, what = tip(dataset)
    up = signals.vertical(dataset)
    across, along = _level(up)
    plane = np.stack([path @ across, path @ along], axis=1)
    if unit_name:
        scale, unit = si_scale(plane, unit_name)
    else:  # a unit vector: its components are angles where they are small
        scale, unit = angle_scale(plane) if np.nanmax(np.abs(plane)) < _SMALL else (1.0, "")
    x, y = (plane / scale).T
    trace(axes, x, y)
    axes.plot(0, 0, "+", color=INK, ms=10, mew=1.3)
    square(axes, np.append(x, 0), np.append(y, 0))
    label = f" [{unit}]" if unit else " of the unit vector"
    named = np.allclose(up, [0, 0, 1])
    axes.set_xlabel(("X" if named else "across") + label)
    axes.set_ylabel(("Y" if named else "across") + label)
    key(axes, f"{what}, seen from above (+: vertical)")


def tip(dataset: xarray.Dataset) -> tuple[Array, str, str]:
    """A top's tip (rows, 3), its unit and description: recorded, or else the end of the unit figure axis."""
    recorded = signals.values(dataset, "tip")
    if recorded is not None:
        return recorded, "m", "Tip"
    direction = signals.pole(dataset, "figure")
    assert direction is not None
    return direction, "", "Figure axis"


def nadir_panel(axes: Axes, dataset: xarray.Dataset) -> None:
    """Direction of the source in body axes, about its mean direction."""
    directions = signals.values(dataset, "nadir")
    assert directions is not None
    mean = np.nanmean(directions, axis=0)
    k = int(np.abs(mean).argmax())  # the body axis that it is near to
    way = np.sign(mean[k])
    plane = directions[:, [(k + 1) % 3, (k + 2) % 3]] * way
    size = np.linalg.norm(plane, axis=1)
    angle = np.arctan2(size, directions[:, k] * way)
    plane = plane * np.divide(angle, size, out=np.ones_like(size), where=size > 1e-12)[:, None]
    scale, unit = angle_scale(plane)
    x, y = (plane / scale).T
    trace(axes, x, y)
    axes.plot(0, 0, "+", color=INK, ms=10, mew=1.3)
    square(axes, np.append(x, 0), np.append(y, 0))
    sign = "" if way > 0 else "−"
    axes.set_xlabel(f"towards {sign}{'xyz'[(k + 1) % 3]} [{unit}]")
    axes.set_ylabel(f"towards {sign}{'xyz'[(k + 2) % 3]} [{unit}]")
    key(axes, f"The source seen from the body (+: {sign}{'xyz'[k]} axis)")


def phase_panel(axes: Axes, dataset: xarray.Dataset) -> None:
    """Rates of libration, or of roll, pitch and yaw, against the angles; librations are closed curves."""
    if signals.values(dataset, "libration") is not None:
        table = timelines.swings(dataset)[0]
        names = ["in the orbit's plane", "out of it"]
    else:
        found = signals.values(dataset, "roll_pitch_yaw")
        assert found is not None
        table, names = found, ["roll", "pitch", "yaw"]
    rate = np.gradient(table, signals.seconds(dataset), axis=0)
    scale, unit = angle_scale(table)
    speed, speed_unit = si_scale(rate, "rad/s")
    for k, (name, hue) in enumerate(zip(names, (BLUE, ORANGE, VIOLET), strict=False)):
        curve(axes, table[:, k] / scale, rate[:, k] / speed, in_plane=True, color=hue, lw=0.8, label=name)
    axes.set_xlabel(f"angle [{unit}]")
    axes.set_ylabel(f"rate [{speed_unit}]")
    key(axes, "Phase planes")


def _level(up: Array) -> tuple[Array, Array]:
    """Two horizontal unit vectors; X and Y if Z is up."""
    along = np.array([1.0, 0.0, 0.0])
    if abs(up[0]) > 0.9:
        along = np.array([0.0, 1.0, 0.0])
    across = along - (along @ up) * up
    across /= np.linalg.norm(across)
    return across, np.cross(up, across)


def _near(one: Array, other: Array) -> bool:
    reach = float(np.nanmax(np.abs(one - np.nanmean(one, axis=0))))
    return float(np.nanmax(np.abs(one - other))) < 0.005 * max(reach, 1e-300)
