"""Panels along time: their axes, curves, units and labels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rigidsim.look import signals
from rigidsim.look.figures.fits import secular
from rigidsim.look.figures.scales import (
    TimeAxis,
    angle_scale,
    angle_text,
    number,
    si_scale,
    time_axis_of,
)
from rigidsim.look.figures.style import BLUE, GREY, ORANGE, PALETTE, VIOLET, X, Y, Z, curve, key, titled
from rigidsim.look.solids import rotation_matrix
from rigidsim.scene.readable_time import DAY, named_unit, span_text, unit_for

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

AXIS_COLORS = {"figure": BLUE, "spin": ORANGE, "momentum": VIOLET}
_STILL = 1e-9  # of its size, below which what a curve does is rounding
_VISIBLE = 0.01  # of its start, from which a change is seen on an axis from zero
_QUICK = np.deg2rad(1.0)  # a day, from which a node's motion is told in the axis' own unit
_LEGIBLE = 0.01  # of an angle, from which the ticks along its swing need four digits at most
_AS_FAR = 0.7  # of the whole swing: what a straight line must leave of it to be of no help
_TURNS = 720.0  # degrees, from which the mean growth of an angle is taken off


def clock(dataset: xarray.Dataset) -> tuple[Array, TimeAxis]:
    """Sample times as the axis shows them, and the axis."""
    axis = time_axis_of(dataset)
    return axis.numbers(signals.seconds(dataset)), axis


def time_axis(axes: Axes, dataset: xarray.Dataset, *, labelled: bool, begins: float = 0.0) -> None:
    """Limits of the run on a panel, and on the lowest one the label with its unit.

    Args:
        begins: show only so many seconds from the start; 0 shows all.
    """
    time, axis = clock(dataset)
    end = time[0] + begins / axis.unit.seconds if begins else time[-1]
    if time[0] != end:
        axes.set_xlim(time[0], end)
    axes.tick_params(labelbottom=labelled)
    if labelled:
        axes.set_xlabel(axis.label + (f", the first {span_text(begins, 2)}" if begins else ""))


def lines(
    axes: Axes, dataset: xarray.Dataset, table: Array, labels: Sequence[str], hues: Sequence[str]
) -> None:
    """Curves of the columns of `table` (rows, n) over time."""
    time, _ = clock(dataset)
    for column, label, hue in zip(table.T, labels, hues, strict=False):
        curve(axes, time, column, color=hue, label=label)


def moves(values: Array) -> bool:
    """Whether a curve is more than a constant and its rounding errors."""
    finite = values[np.isfinite(values)]
    return bool(len(finite) and np.ptp(finite) > _STILL * np.abs(finite).max())


def steady(axes: Axes, table: Array) -> None:
    """Set limits of a panel with constant curves that don't magnify their rounding errors."""
    if not any(moves(column) for column in table.T):
        middle = float(np.nanmean(table))
        reach = 0.05 * abs(middle) or 1.0
        axes.set_ylim(middle - reach, middle + reach)


def rates(axes: Axes, dataset: xarray.Dataset) -> None:
    """Draw the angular velocity in body axes."""
    table = signals.values(dataset, "angular_velocity")
    assert table is not None
    scale, unit = si_scale(table, "rad/s")
    lines(axes, dataset, table / scale, ["$ω_x$", "$ω_y$", "$ω_z$"], (X, Y, Z))
    key(axes, "Angular velocity, body axes")
    axes.set_ylabel(f"ω [{unit}]")


def attitude(axes: Axes, dataset: xarray.Dataset) -> None:
    """Draw recorded Euler angles, or else the body's z axis in space."""
    angles = signals.values(dataset, "euler_angles")
    if angles is not None:
        table = np.rad2deg(angles)
        lost = "angles_wrapped_from" in dataset.attrs  # too sparse for lines from one to the next
        if lost:
            axes.set_prop_cycle(linestyle=["none"], marker=["."])
        labels = ["φ", "θ", "ψ"]
        if not lost:
            table, labels = without_growth(dataset, table)
        time, _ = clock(dataset)
        for column, label, hue in zip(table.T, labels, PALETTE, strict=False):
            axes.plot(time, column, color=hue, label=label, rasterized=len(time) > 6000)
        key(axes, "Euler angles" + (", within one turn" if lost else ""))
        axes.set_ylabel("angle [deg]")
        return
    quaternion = signals.values(dataset, "quaternion")
    assert quaternion is not None
    axis = rotation_matrix(quaternion)[..., 2]
    lines(axes, dataset, axis, ["$z_X$", "$z_Y$", "$z_Z$"], (X, Y, Z))
    key(axes, "Direction of the body's z axis in space")
    axes.set_ylabel("direction cosine")
    axes.set_ylim(-1.08, 1.08)


def without_growth(dataset: xarray.Dataset, angles: Array) -> tuple[Array, list[str]]:
    """Angles (rows, 3) in degrees, less their mean growth if they run through more than two turns.

    Otherwise one fast spin would press the others flat. The labels say what was taken off.
    """
    seconds = signals.seconds(dataset)
    shown, labels = angles.copy(), ["φ", "θ", "ψ"]
    for k, symbol in enumerate(labels):
        finite = np.flatnonzero(np.isfinite(angles[:, k]))
        if len(finite) < 2 or np.ptp(angles[finite, k]) <= _TURNS:
            continue
        first, last = finite[0], finite[-1]
        rate = (angles[last, k] - angles[first, k]) / (seconds[last] - seconds[first])
        shown[:, k] = angles[:, k] - angles[first, k] - rate * (seconds - seconds[first])
        labels[k] = f"{symbol} − {turning(np.deg2rad(rate))}"
    return shown, labels


def turning(rate: float) -> str:
    """A rate (rad/s) as turns per unit of time, chosen so that the number isn't tiny: ``0.6702 turns/s``."""
    unit = unit_for(20 * 2 * np.pi / rate if rate else 0.0)
    return f"{number(rate * unit.seconds / (2 * np.pi))} turns/{unit.symbol}"


def polar_motion(axes: Axes, dataset: xarray.Dataset) -> None:
    """Both components of polar motion."""
    table = signals.polar_motion(dataset)
    assert table is not None
    scale, unit = angle_scale(table)
    lines(axes, dataset, table / scale, ["$m_1$", "$m_2$"], (BLUE, ORANGE))
    key(axes, "Polar motion: the spin axis seen from the figure axis")
    axes.set_ylabel(f"polar motion [{unit}]")


def obliquity(axes: Axes, dataset: xarray.Dataset) -> None:
    """Obliquities, less the mean of the first axis shown where that would hide their swings."""
    shown = orientations(dataset)
    table = np.stack([pair[0] for pair in shown.values()], axis=1)
    title, label = "Obliquity", "obliquity"
    if not _legible(table):
        mean = secular(signals.seconds(dataset), table[:, 0], level=True).at_start
        table = table - mean
        title, label = f"Obliquity less its mean, {angle_text(mean, 7)}", "obliquity − mean"
    _of_axes(axes, dataset, table, title, label)


def longitude(axes: Axes, dataset: xarray.Dataset) -> None:
    """Longitudes of the node, less the straight line through that of the first axis shown unless they swing
    as far about it as without it.
    """
    seconds, axis = signals.seconds(dataset), time_axis_of(dataset)
    table = np.stack([pair[1] for pair in orientations(dataset).values()], axis=1)
    trend = secular(seconds, table[:, 0])
    rest = table - trend.at(seconds)[:, None]
    if _legible(table) and np.ptp(rest[np.isfinite(rest)]) > _AS_FAR * np.ptp(table[np.isfinite(table)]):
        _of_axes(axes, dataset, table, "Longitude of the node", "longitude")
        return
    # precession is told by the year, whatever the axis of time is in
    per = axis.unit if abs(trend.rate) * DAY > _QUICK else named_unit("yr")
    rate = angle_text(trend.rate * per.seconds, 3)
    title = f"Longitude of the node less its mean motion, {rate}/{per.symbol}"
    _of_axes(axes, dataset, rest, title, "longitude − line")


def _legible(table: Array) -> bool:
    """Whether ticks along angles (rows, n) tell their swings with few digits, nothing taken off."""
    finite = table[np.isfinite(table)]
    return bool(len(finite) and np.ptp(finite) >= _LEGIBLE * np.abs(finite).max())


def _of_axes(axes: Axes, dataset: xarray.Dataset, table: Array, title: str, label: str) -> None:
    """Draw an angle (rows, n), rad, of each axis shown."""
    shown = orientations(dataset)
    scale, unit = angle_scale(table)
    hues = [AXIS_COLORS[name] for name in shown]
    lines(axes, dataset, table / scale, [f"{name} axis" for name in shown], hues)
    key(axes, title)
    axes.set_ylabel(f"{label} [{unit}]")


def orientations(dataset: xarray.Dataset) -> dict[str, tuple[Array, Array]]:
    """Obliquity and node longitude of the distinguishable axes that are shown together, figure axis first."""
    found: dict[str, tuple[Array, Array]] = {}
    for name in ("figure", "spin", "momentum"):
        pair = signals.orientation(dataset, name)
        if pair is not None and np.isfinite(pair[0]).any():
            found[name] = pair
    if not found:
        return found
    first = next(iter(found))
    reach = max(float(np.nanmax(np.abs(found[first][0] - np.nanmean(found[first][0])))), 1e-300)
    return {
        name: pair
        for name, pair in found.items()
        if name == first
        or (
            float(np.nanmax(np.abs(pair[0] - found[first][0]))) > 0.03 * reach
            and float(np.nanmax(pair[1] - found[first][1]) - np.nanmin(pair[1] - found[first][1]))
            < np.pi  # else it goes about another pole
        )
    }


def braked(dataset: xarray.Dataset) -> dict[str, Array]:
    """Recorded size of the angular momentum and energy that change visibly, as shares of their start."""
    found = {}
    for name in ("angular_momentum_norm", "energy"):
        recorded = signals.values(dataset, name)
        if recorded is None or not np.isfinite(recorded).all() or not recorded[0] > 0:
            continue
        share = recorded / recorded[0]
        if np.abs(share - 1).max() > _VISIBLE:
            found[name] = share
    return found


def braking(axes: Axes, dataset: xarray.Dataset) -> None:
    """Draw the size of the angular momentum and the energy as shares of their start."""
    shares = braked(dataset)
    words = {"angular_momentum_norm": ("angular momentum", VIOLET), "energy": ("energy", ORANGE)}
    labels, hues = zip(*(words[name] for name in shares), strict=True)
    lines(axes, dataset, np.stack(list(shares.values()), axis=1), labels, hues)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    key(axes, "What is left of the rotation")
    axes.set_ylabel("share of the start")


def libration(axes: Axes, dataset: xarray.Dataset) -> None:
    """The long axis about the direction to the source, in the orbit's plane and out of it."""
    table, turned = swings(dataset)
    scale, unit = angle_scale(table)
    labels = ["in the orbit's plane", "out of it"]
    labels = [label + (f" − {180 * k}°" if k else "") for label, k in zip(labels, turned, strict=True)]
    lines(axes, dataset, table / scale, labels, (BLUE, ORANGE))
    key(axes, "Libration: the long axis from the direction to the source")
    axes.set_ylabel(f"libration [{unit}]")


def swings(dataset: xarray.Dataset) -> tuple[Array, list[int]]:
    """Libration angles (rows, 2), rad, less as many half turns as make them swing about zero, and these
    numbers.
    """
    table = signals.values(dataset, "libration")
    assert table is not None
    turned = [int(np.round(np.nanmean(column) / np.pi)) for column in table.T]
    return table - np.pi * np.array(turned), turned


def roll_pitch_yaw(axes: Axes, dataset: xarray.Dataset) -> None:
    """Roll, pitch and yaw against the local frame of the orbit."""
    table = signals.values(dataset, "roll_pitch_yaw")
    assert table is not None
    scale, unit = angle_scale(table)
    lines(axes, dataset, table / scale, ["roll", "pitch", "yaw"], (BLUE, ORANGE, VIOLET))
    key(axes, "Attitude against the local frame of the orbit")
    axes.set_ylabel(f"angle [{unit}]")


def one_angle(axes: Axes, dataset: xarray.Dataset, name: str, title: str, symbol: str, hue: str) -> None:
    """Draw a recorded angle, less its mean motion if it passes through more than a turn."""
    angle = signals.values(dataset, name)
    assert angle is not None
    seconds = signals.seconds(dataset)
    label = symbol
    span = float(np.nanmax(angle) - np.nanmin(angle))
    if span > 2 * np.pi:
        trend = secular(seconds, angle)
        rest = angle - trend.at(seconds)
        if np.nanmax(np.abs(rest)) > _STILL * span:
            angle, label = rest, f"{symbol} − line"
            title += f" less its mean motion, {turning(trend.rate)}"
        else:  # what is left of it is rounding
            title += f": uniform, {turning(trend.rate)}"
    scale, unit = angle_scale(angle)
    lines(axes, dataset, angle[:, None] / scale, [name], (hue,))
    steady(axes, angle[:, None] / scale)
    titled(axes, title)
    axes.set_ylabel(f"{label} [{unit}]")


def tilt(axes: Axes, dataset: xarray.Dataset) -> None:
    """Tilt of a top against the vertical."""
    if signals.values(dataset, "tilt") is not None:
        one_angle(axes, dataset, "tilt", "Tilt against the vertical", "θ", BLUE)
        return
    direction = signals.pole(dataset, "figure")
    assert direction is not None
    up = signals.vertical(dataset)
    angle = np.arctan2(np.linalg.norm(np.cross(direction, up), axis=1), direction @ up)
    scale, unit = angle_scale(angle)
    lines(axes, dataset, angle[:, None] / scale, ["tilt"], (BLUE,))
    steady(axes, angle[:, None] / scale)
    titled(axes, "Tilt of the figure axis against the vertical")
    axes.set_ylabel(f"θ [{unit}]")


def precession(axes: Axes, dataset: xarray.Dataset) -> None:
    """Precession angle of a top about the vertical, less its mean motion."""
    one_angle(axes, dataset, "precession_angle", "Precession", "φ", ORANGE)


def wobble(axes: Axes, dataset: xarray.Dataset) -> None:
    """Angle between the figure axis and the momentum."""
    angle = signals.values(dataset, "nutation_angle")
    if angle is None:
        direction, along = signals.pole(dataset, "figure"), signals.pole(dataset, "momentum")
        assert direction is not None
        assert along is not None
        angle = np.arctan2(
            np.linalg.norm(np.cross(direction, along), axis=1), np.einsum("ti,ti->t", direction, along)
        )
    scale, unit = angle_scale(angle)
    lines(axes, dataset, angle[:, None] / scale, ["nutation angle"], (GREY,))
    steady(axes, angle[:, None] / scale)
    titled(axes, "Nutation angle: the figure axis from the momentum")
    axes.set_ylabel(f"angle [{unit}]")
