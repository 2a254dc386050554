"""Panels along time: their axes, curves, units and labels."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes

from rigidsim.look import signals, surroundings
from rigidsim.look.figures.panel import angle_scale, angle_text, clock, number, panel, recorded
from rigidsim.look.figures.style import BLUE, GREY, ORANGE, PALETTE, PINK, VIOLET, X, Y, Z, curve, key
from rigidsim.look.fits import secular
from rigidsim.look.solids import Array
from rigidsim.scene.readable import DAY, named_unit, si_scale, span_text, unit_for

AXIS_COLORS = {"figure": BLUE, "spin": ORANGE, "momentum": VIOLET, "core": PINK}
_STILL = 1e-9  # of its size, below which what a curve does is rounding
_VISIBLE = 0.01  # of its start, from which a change is seen on an axis from zero
_QUICK = np.deg2rad(1.0)  # a day, from which a node's motion is told in the axis' own unit
_LEGIBLE = 0.01  # of an angle, from which the ticks along its swing need four digits at most
_AS_FAR = 0.7  # of the whole swing: what a straight line must leave of it to be of no help
_TURNS = 720.0  # degrees, from which the mean growth of an angle is taken off
_STEEP = 1.5  # rad of pitch, near which roll and yaw are ill-defined


def time_axis(axes: Axes, dataset: xarray.Dataset, *, labelled: bool, begins: float = 0.0) -> None:
    """Set a panel's limits to the run's, or to so many seconds of its start; label the lowest panel."""
    time, unit, label = clock(dataset)
    end = time[0] + begins / unit.seconds if begins else time[-1]
    if time[0] != end:
        axes.set_xlim(time[0], end)
    axes.tick_params(labelbottom=labelled)
    if labelled:
        axes.set_xlabel(label + (f", the first {span_text(begins, 2)}" if begins else ""))


def lines(
    axes: Axes,
    dataset: xarray.Dataset,
    table: Array,
    labels: Sequence[str | None],
    hues: Sequence[str],
    *,
    sparse: bool = False,
) -> None:
    """Curves of the columns of `table` (rows, n) over time; points if they are `sparse`."""
    time = clock(dataset)[0]
    for column, label, hue in zip(table.T, labels, hues, strict=False):
        curve(axes, time, column, sparse=sparse, color=hue, label=label)


def angles_over_time(
    axes: Axes,
    dataset: xarray.Dataset,
    table: Array,
    title: str,
    *,
    hues: Sequence[str],
    labels: Sequence[str | None] = (None,),
    word: str = "angle",
) -> None:
    """Draw angles (rows, n), rad, in the unit that suits them; a single one needs no label."""
    scale, unit = angle_scale(table)
    lines(axes, dataset, table / scale, labels, hues)
    if len(table.T) == 1 and not moves(table):  # limits that don't magnify rounding errors
        middle = float(np.nanmean(table / scale))
        reach = 0.05 * abs(middle) or 1.0
        axes.set_ylim(middle - reach, middle + reach)
    key(axes, title)
    axes.set_ylabel(f"{word} [{unit}]")


def moves(values: Array) -> bool:
    """Whether a curve is more than a constant and its rounding errors."""
    finite = values[np.isfinite(values)]
    return bool(len(finite) and np.ptp(finite) > _STILL * np.abs(finite).max())


@panel(recorded("angular_velocity"), begins=True)
def rates(axes: Axes, dataset: xarray.Dataset, table: Array) -> None:
    """Angular velocity in body axes."""
    scale, unit = si_scale(table, "rad/s")
    lines(axes, dataset, table / scale, ["$ω_x$", "$ω_y$", "$ω_z$"], (X, Y, Z))
    key(axes, "Angular velocity, body axes")
    axes.set_ylabel(f"ω [{unit}]")


@panel(recorded("euler_angles", "quaternion"), begins=True)
def attitude(axes: Axes, dataset: xarray.Dataset, _: Array) -> None:
    """Recorded Euler angles, or else the body's z axis in space."""
    angles = signals.values(dataset, "euler_angles")
    if angles is None:
        table = signals.body_direction(dataset, np.array([0.0, 0.0, 1.0]))
        assert table is not None
        sparse = signals.aliased(dataset)
        lines(axes, dataset, table, ["$z_X$", "$z_Y$", "$z_Z$"], (X, Y, Z), sparse=sparse)
        key(axes, "Direction of the body's z axis in space" + (", samples" if sparse else ""))
        axes.set_ylabel("direction cosine")
        axes.set_ylim(-1.08, 1.08)
        return
    table, labels = np.rad2deg(angles), ["φ", "θ", "ψ"]
    lost = "angles_wrapped_from" in dataset.attrs  # too sparse for lines from one to the next
    if lost:
        axes.set_prop_cycle(linestyle=["none"], marker=["."])
    else:
        table, labels = without_growth(dataset, table)
    time = clock(dataset)[0]
    for column, label, hue in zip(table.T, labels, PALETTE, strict=False):
        axes.plot(time, column, color=hue, label=label, rasterized=len(time) > 6000)
    key(axes, "Euler angles" + (", within one turn" if lost else ""))
    axes.set_ylabel("angle [deg]")


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


@panel(signals.polar_motion, begins=True)
def polar_motion(axes: Axes, dataset: xarray.Dataset, table: Array) -> None:
    """Both components of polar motion."""
    title = "Polar motion: the spin axis seen from the figure axis"
    hues, labels = (BLUE, ORANGE), ("$m_1$", "$m_2$")
    angles_over_time(axes, dataset, table, title, hues=hues, labels=labels, word="polar motion")


def orientations(dataset: xarray.Dataset) -> dict[str, tuple[Array, Array]] | None:
    """Obliquity and node longitude of the distinguishable axes that are shown together, figure axis first."""
    found: dict[str, tuple[Array, Array]] = {}
    for name in ("figure", "spin", "momentum"):
        pair = signals.orientation(dataset, name)
        if pair is not None and np.isfinite(pair[0]).any():
            found[name] = pair
    if not found:
        return None
    first, (tilt, node) = next(iter(found.items()))
    reach = max(float(np.nanmax(np.abs(tilt - np.nanmean(tilt)))), 1e-300)

    def told_apart(pair: tuple[Array, Array]) -> bool:
        longitude = pair[1] - node  # of half a turn and more: it goes about another pole
        near = float(np.nanmax(longitude) - np.nanmin(longitude)) < np.pi
        return float(np.nanmax(np.abs(pair[0] - tilt))) > 0.03 * reach and near

    return {name: pair for name, pair in found.items() if name == first or told_apart(pair)}


def _of_axes(
    axes: Axes, dataset: xarray.Dataset, shown: dict[str, Any], table: Array, title: str, word: str
) -> None:
    """Draw an angle (rows, n), rad, of each axis shown."""
    hues, labels = [AXIS_COLORS[name] for name in shown], [f"{name} axis" for name in shown]
    angles_over_time(axes, dataset, table, title, hues=hues, labels=labels, word=word)


@panel(orientations, begins=True)
def obliquity(axes: Axes, dataset: xarray.Dataset, shown: dict[str, tuple[Array, Array]]) -> None:
    """Obliquities, less the mean of the first axis shown where that would hide their swings."""
    table = np.stack([pair[0] for pair in shown.values()], axis=1)
    title, word = "Obliquity", "obliquity"
    if not _legible(table):
        mean = secular(signals.seconds(dataset), table[:, 0]).value
        table = table - mean
        title, word = f"Obliquity less its mean, {angle_text(mean, 7)}", "obliquity − mean"
    _of_axes(axes, dataset, shown, table, title, word)


@panel(orientations, begins=True)
def longitude(axes: Axes, dataset: xarray.Dataset, shown: dict[str, tuple[Array, Array]]) -> None:
    """Longitudes of the node, less the straight line through that of the first axis shown unless they swing
    as far about it as without it.
    """
    seconds, unit = signals.seconds(dataset), clock(dataset)[1]
    table = np.stack([pair[1] for pair in shown.values()], axis=1)
    trend = secular(seconds, table[:, 0])
    rest = table - trend.at(seconds)[:, None]
    if _legible(table) and np.ptp(rest[np.isfinite(rest)]) > _AS_FAR * np.ptp(table[np.isfinite(table)]):
        _of_axes(axes, dataset, shown, table, "Longitude of the node", "longitude")
        return
    # precession is told by the year, whatever the axis of time is in
    per = unit if abs(trend.rate) * DAY > _QUICK else named_unit("yr")
    rate = trend.about + angle_text(trend.rate * per.seconds, 3)
    title = f"Longitude of the node less its mean motion, {rate}/{per.symbol}"
    _of_axes(axes, dataset, shown, rest, title, "longitude − line")


def _legible(table: Array) -> bool:
    """Whether ticks along angles (rows, n) tell their swings with few digits, nothing taken off."""
    finite = table[np.isfinite(table)]
    return bool(len(finite) and np.ptp(finite) >= _LEGIBLE * np.abs(finite).max())


def _braked(dataset: xarray.Dataset) -> dict[str, Array] | None:
    """Recorded size of the angular momentum and energy that change visibly, as shares of their start."""
    found = {}
    for name, words in (("angular_momentum_norm", "angular momentum"), ("energy", "energy")):
        table = signals.values(dataset, name)
        if table is None or not np.isfinite(table).all() or not table[0] > 0:
            continue
        share = table / table[0]
        if np.abs(share - 1).max() > _VISIBLE:
            found[words] = share
    return found or None


@panel(_braked)
def braking(axes: Axes, dataset: xarray.Dataset, shares: dict[str, Array]) -> None:
    """The size of the angular momentum and the energy as shares of their start."""
    hues = [{"angular momentum": VIOLET, "energy": ORANGE}[words] for words in shares]
    lines(axes, dataset, np.stack(list(shares.values()), axis=1), list(shares), hues)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    key(axes, "Remaining rotation")
    axes.set_ylabel("share of the start")


def swings(dataset: xarray.Dataset) -> tuple[Array, list[int]] | None:
    """Libration angles (rows, 2), rad, less half turns so that they swing about zero, and their numbers."""
    table = signals.values(dataset, "libration")
    if table is None:
        return None
    turned = [int(np.round(np.nanmean(column) / np.pi)) for column in table.T]
    return table - np.pi * np.array(turned), turned


@panel(swings)
def libration(axes: Axes, dataset: xarray.Dataset, found: tuple[Array, list[int]]) -> None:
    """The long axis about the direction to the source, in the orbit's plane and out of it."""
    table, turned = found
    labels = ["in the orbit's plane", "out of it"]
    labels = [label + (f" − {180 * k}°" if k else "") for label, k in zip(labels, turned, strict=True)]
    title = "Libration: the long axis from the direction to the source"
    angles_over_time(axes, dataset, table, title, hues=(BLUE, ORANGE), labels=labels, word="libration")


def regular(dataset: xarray.Dataset) -> Array | None:
    """Roll, pitch and yaw where roll and yaw are defined: pitch stays away from a right angle."""
    table = signals.values(dataset, "roll_pitch_yaw")
    return None if table is None or not np.nanmax(np.abs(table[:, 1])) < _STEEP else table


@panel(regular, begins=True)
def roll_pitch_yaw(axes: Axes, dataset: xarray.Dataset, table: Array) -> None:
    """Roll, pitch and yaw against the local frame of the orbit."""
    title = "Attitude against the local frame of the orbit"
    hues, labels = (BLUE, ORANGE, VIOLET), ("roll", "pitch", "yaw")
    angles_over_time(axes, dataset, table, title, hues=hues, labels=labels)


def _one_angle(axes: Axes, dataset: xarray.Dataset, angle: Array, title: str, word: str, hue: str) -> None:
    """Draw an angle (rows,), less its mean motion if it passes through more than a turn."""
    seconds = signals.seconds(dataset)
    span = float(np.nanmax(angle) - np.nanmin(angle))
    if span > 2 * np.pi:
        trend = secular(seconds, angle)
        rest = angle - trend.at(seconds)
        if np.nanmax(np.abs(rest)) > _STILL * span:
            angle, word = rest, f"{word} − line"
            title += f" less its mean motion, {trend.about}{turning(trend.rate)}"
        else:  # what is left of it is rounding
            title += f": uniform, {turning(trend.rate)}"
    angles_over_time(axes, dataset, angle[:, None], title, hues=(hue,), word=word)


def _tilt(dataset: xarray.Dataset) -> tuple[Array, str] | None:
    """Tilt of a top against the vertical, and the panel's title; None if the scene is no top."""
    angle = signals.values(dataset, "tilt")
    if angle is not None:
        return angle, "Tilt against the vertical"
    direction = signals.pole(dataset, "figure") if signals.is_top(dataset) else None
    if direction is None:
        return None
    angle = signals.angle_between(direction, surroundings.vertical(dataset))
    return angle, "Tilt of the figure axis against the vertical"


@panel(_tilt, begins=True)
def tilt(axes: Axes, dataset: xarray.Dataset, found: tuple[Array, str]) -> None:
    """Tilt of a top against the vertical."""
    _one_angle(axes, dataset, *found, "θ", BLUE)


@panel(recorded("precession_angle"), begins=True)
def precession(axes: Axes, dataset: xarray.Dataset, angle: Array) -> None:
    """Precession angle of a top about the vertical, less its mean motion."""
    _one_angle(axes, dataset, angle, "Precession", "φ", ORANGE)


def _wobble(dataset: xarray.Dataset) -> Array | None:
    """Angle (rows,) between the figure axis and the momentum."""
    angle = signals.values(dataset, "nutation_angle")
    if angle is not None:
        return angle
    direction, along = signals.pole(dataset, "figure"), signals.pole(dataset, "momentum")
    return None if direction is None or along is None else signals.angle_between(direction, along)


@panel(_wobble)
def wobble(axes: Axes, dataset: xarray.Dataset, angle: Array) -> None:
    """Angle between the figure axis and the momentum."""
    title = "Nutation angle: the figure axis from the momentum"
    angles_over_time(axes, dataset, angle[:, None], title, hues=(GREY,))
