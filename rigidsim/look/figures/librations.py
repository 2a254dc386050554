"""Panels of a body that turns one face to its source: librations, the source seen from it, phases."""

from __future__ import annotations

import numpy as np
import xarray
from matplotlib.axes import Axes

from rigidsim.look import signals
from rigidsim.look.figures import timelines
from rigidsim.look.figures.panel import angle_scale, panel
from rigidsim.look.figures.poles import flat, path_about
from rigidsim.look.figures.style import BLUE, ORANGE, VIOLET, curve, key, titled
from rigidsim.look.figures.timelines import angles_over_time
from rigidsim.look.librations import Librations, librations, pointing_angle, seen, toward
from rigidsim.look.solids import Array
from rigidsim.scene.readable import si_scale


@panel(librations)
def longitude(axes: Axes, dataset: xarray.Dataset, found: Librations) -> None:
    """The libration in longitude."""
    title = "Physical libration in longitude, less the mean rotation"
    angles_over_time(axes, dataset, found.longitude[:, None], title, hues=(BLUE,), word="longitude")


def _latitudes(dataset: xarray.Dataset) -> tuple[Array, Array] | None:
    found = librations(dataset)
    if found is None or found.inclination is None or found.node is None:
        return None
    return found.inclination, found.node


@panel(_latitudes)
def latitude(axes: Axes, dataset: xarray.Dataset, found: tuple[Array, Array]) -> None:
    """The librations of the figure axis."""
    labels = ("inclination less its mean", "node less its mean motion, × sin(inclination)")
    title = "Physical librations in latitude"
    table = np.stack(found, axis=1)
    angles_over_time(axes, dataset, table, title, hues=(ORANGE, VIOLET), labels=labels, word="angle")
    for line in axes.lines:  # both swing in a month: over many years the one would cover the other
        line.set(alpha=0.6, linewidth=0.7)


@panel(toward)
def nadir(axes: Axes, dataset: xarray.Dataset, directions: Array) -> None:
    """Direction of the source in body axes, about its mean direction."""
    mean = np.nanmean(directions, axis=0)
    k = int(np.abs(mean).argmax())  # the body axis that it is near to
    i, j = (k + 1) % 3, (k + 2) % 3
    plane = flat(*(directions[:, [i, j, k]] * np.sign(mean[k])).T)
    scale, unit = angle_scale(plane)
    sign = "" if mean[k] > 0 else "−"
    labels = (f"towards {sign}{'xyz'[axis]} [{unit}]" for axis in (i, j))
    path_about(axes, plane / scale, *labels)
    key(axes, f"The source seen from the body (+: {sign}{'xyz'[k]} axis)")


@panel(pointing_angle, begins=True)
def pointing(axes: Axes, dataset: xarray.Dataset, found: tuple[str, str, Array]) -> None:
    """How far a body axis points away from where the air or the light comes from."""
    axis, towards, angle = found
    title = f"Angle between the body's {axis} axis and {towards}"
    angles_over_time(axes, dataset, angle[:, None], title, hues=(BLUE,))
    axes.set_ylim(bottom=0.0)


_LAST_TURNS = 10  # before a body is locked, in the phase plane


def _swinging(dataset: xarray.Dataset) -> tuple[Array, tuple[str, ...]] | None:
    """Angles of libration (rows, 2), or roll, pitch and yaw (rows, 3), rad, and their names."""
    swings = timelines.swings(dataset)
    if swings is not None:
        return swings[0], ("in the orbit's plane", "out of it")
    table = timelines.regular(dataset)
    return None if table is None else (table, ("roll", "pitch", "yaw"))


@panel(_swinging)
def phases(axes: Axes, dataset: xarray.Dataset, found: tuple[Array, tuple[str, ...]]) -> None:
    """Rates of libration, or of roll, pitch and yaw, against the angles; librations are closed curves."""
    table, names = found
    rate = np.gradient(table, signals.seconds(dataset), axis=0)
    scale, unit = angle_scale(table)
    speed, speed_unit = si_scale(rate, "rad/s")
    for k, (name, hue) in enumerate(zip(names, (BLUE, ORANGE, VIOLET), strict=False)):
        curve(axes, table[:, k] / scale, rate[:, k] / speed, in_plane=True, color=hue, lw=0.8, label=name)
    axes.set(xlabel=f"angle [{unit}]", ylabel=f"rate [{speed_unit}]")
    key(axes, "Phase planes")


def _locked(dataset: xarray.Dataset) -> Array | None:
    """Longitude (rows,), rad, turns counted, under a source that a body faces in the end alone."""
    found, rates = seen(dataset), signals.values(dataset, "angular_velocity")
    if found is None or rates is None or not np.isfinite(found.directions).all():
        return None
    last = slice(-max(len(found.directions) // 10, 2), None)
    if found.stays() or not found.stays(last):
        return None
    longitude = found.coordinates(signals.figure_direction(dataset))[:, 0]
    steps = np.abs(np.diff(longitude))
    return (
        longitude - 2 * np.pi * np.round(np.mean(longitude[last]) / (2 * np.pi)) if steps.max() < 3 else None
    )


@panel(_locked)
def locking(axes: Axes, dataset: xarray.Dataset, longitude: Array) -> None:
    """Turns of the body before its source, until it keeps one face to it."""
    timelines.lines(axes, dataset, longitude[:, None] / (2 * np.pi), [None], (BLUE,))
    axes.set_ylabel("longitude [turns]")
    key(axes, "The point under the source, until the rotation is locked")


@panel(_locked)
def locking_phases(axes: Axes, dataset: xarray.Dataset, longitude: Array) -> None:
    """Rotation relative to the source against longitude within a turn: waves, and in the end a whirl."""
    rates = signals.values(dataset, "angular_velocity")
    assert rates is not None
    last = slice(-max(len(longitude) // 10, 2), None)
    middle, rate = float(np.mean(longitude[last])), rates @ signals.figure_direction(dataset)
    rate = rate - np.mean(rate[last])
    rest = slice(int(np.argmax(np.abs(longitude - middle) < 2 * np.pi * _LAST_TURNS)), None)
    speed, unit = si_scale(rate[rest], "rad/s")
    centre = np.degrees(np.remainder(middle + np.pi / 4, 2 * np.pi) - np.pi / 4) // 10 * 10
    within = np.degrees(np.remainder(longitude[rest] - middle + np.pi, 2 * np.pi) - np.pi) + np.degrees(
        middle
    )
    within += 360 * np.round((centre - np.degrees(middle)) / 360)
    shades = np.linspace(0, 1, len(within))
    axes.scatter(within, rate[rest] / speed, c=shades, cmap="plasma", s=4, lw=0, rasterized=True)
    axes.set(xlabel="longitude under the source [deg]", ylabel=f"spin less that in the end [{unit}]")
    titled(axes, "Until it is locked (lighter: later)")
