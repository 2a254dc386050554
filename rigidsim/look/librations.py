"""A body that turns one face to its source, as the Moon to the Earth: where it is seen, and its librations.

Of physical librations the normal is that of the cone on which the figure axis precesses, or the mean figure
axis where it doesn't. With phi the longitude of the node of the body's equator, theta its inclination and psi
the angle from the node to the axis of least moment, the libration in longitude is phi + psi less its mean
motion (it has no second order in theta), and those in latitude are theta and phi sin theta less theirs
(Eckhardt 1981, The Moon and the Planets 25, 3: tau, rho and I sigma).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray

from rigidsim.look import signals, surroundings
from rigidsim.look.fits import secular
from rigidsim.look.solids import Array, rotation_matrix
from rigidsim.scene.bodies.presets import KnownBody

_FACING = 0.7  # cosine between the axis of least moment, or a mean direction, and the source
_ROUND = 0.3  # second over first extent of the figure axis' path, from which it is a cone's
_REGULAR = 0.3  # of the mean inclination, by which it may change for the node to be regular


@dataclass(frozen=True)
class Seen:
    """The strongest source of tides: which known body it is, and unit vectors (rows, 3) to it, body axes."""

    body: KnownBody | None
    name: str
    directions: Array

    def stays(self, rows: slice = slice(None)) -> bool:
        """Whether it stays over one face in these rows."""
        ways = signals.finite_rows(self.directions[rows])
        mean = ways.mean(axis=0) if len(ways) else np.zeros(3)
        size = float(np.linalg.norm(mean))
        return size > _FACING and bool((ways @ mean).min() > _FACING * size)

    def coordinates(self, figure: Array) -> Array:
        """Longitude and latitude (rows, 2), rad, of the point under it; with the figure axis z from body axis
        x eastwards, continuous.
        """
        first = np.eye(3)[(int(np.abs(figure).argmax()) + 1) % 3]
        first = first - (first @ figure) * figure
        first /= np.linalg.norm(first)
        second = np.cross(figure, first)
        longitude = np.unwrap(np.arctan2(self.directions @ second, self.directions @ first))
        longitude -= 2 * np.pi * np.round(np.nanmean(longitude) / (2 * np.pi))
        return np.stack([longitude, np.arcsin(np.clip(self.directions @ figure, -1, 1))], axis=1)


def seen(dataset: xarray.Dataset) -> Seen | None:
    """The strongest source of tides in body axes, from positions and attitude or the recorded nadir; None
    where that isn't known.
    """
    listed, times = surroundings.told(dataset, "source"), signals.seconds(dataset)
    found: list[tuple[float, dict[str, object], Array]] = []
    for one in listed:
        path = surroundings.source_path(one, dataset, times)
        if path is not None:
            tide = float(one.get("gravitational_parameter") or 0.0) / float(
                np.nanmean(signals.norms(path) ** 3)
            )
            found.append((tide, one, path))
    quaternion, nadir = signals.values(dataset, "quaternion"), signals.values(dataset, "nadir")
    if found and quaternion is not None and len(found) == len(listed):
        _, one, path = max(found, key=lambda entry: entry[0])
        ways = np.einsum("tij,ti->tj", rotation_matrix(quaternion), path)
        ways /= signals.norms(ways)[:, None]
    elif nadir is not None and len(listed) == 1:
        one, ways = listed[0], nadir
    else:
        return None
    return Seen(surroundings.body_of(one), str(one.get("ephemeris", one.get("kernel", "source"))), ways)


@dataclass(frozen=True)
class Librations:
    """Angles (rows,), rad: longitude less its mean motion; inclination less its mean, and the node less its
    mean motion times the inclination's sine, which are None where the figure axis doesn't precess.
    """

    longitude: Array
    inclination: Array | None
    node: Array | None


def librations(dataset: xarray.Dataset) -> Librations | None:
    """Those of a dataset; None of a body that doesn't turn one face to its source."""
    quaternion, rates = signals.values(dataset, "quaternion"), signals.values(dataset, "angular_velocity")
    found, seconds = signals.moments(dataset), signals.seconds(dataset)
    if quaternion is None or rates is None or found is None or not _faces(dataset) or len(seconds) < 3:
        return None
    axes = signals.principal_axes(dataset)
    long, figure = axes[found.argmin()], axes[found.argmax()]
    figure = figure * np.sign(np.nanmean(rates @ figure))
    matrix = rotation_matrix(quaternion)
    pole, first, second = (matrix @ vector for vector in (figure, long, np.cross(figure, long)))
    normal, precesses = _normal(pole)
    e1, e2 = signals.across(normal)
    turned = np.arctan2(first @ e2 - second @ e1, first @ e1 + second @ e2)
    rate = rates @ figure
    between = np.diff(seconds) * (rate[1:] + rate[:-1]) / 2
    counted = np.concatenate([[0.0], np.cumsum(between)])
    longitude = counted + np.unwrap(turned - counted)
    inclination = node = None
    if precesses:
        tilt = np.arctan2(np.hypot(pole @ e1, pole @ e2), pole @ normal)
        mean = float(tilt.mean())
        if np.ptp(tilt) < _REGULAR * mean:
            inclination = tilt - mean
            line = np.unwrap(np.arctan2(pole @ e1, -(pole @ e2)))
            node = (line - secular(seconds, line).at(seconds)) * np.sin(mean)
    return Librations(longitude - secular(seconds, longitude).at(seconds), inclination, node)


def toward(dataset: xarray.Dataset) -> Array | None:
    """Directions (rows, 3), body axes, to the source: the recorded nadir, or from a kernel's positions."""
    nadir = signals.values(dataset, "nadir")
    if nadir is None and "source_position" in dataset and (one := seen(dataset)) is not None:
        return one.directions
    return nadir


def pointing_angle(dataset: xarray.Dataset) -> tuple[str, str, Array] | None:
    """A body axis, a direction in words, and the angle (rows,), rad, between them: of the axis nearest to the
    oncoming air or, where no other angles tell of it, to the source.
    """
    ways, towards = signals.values(dataset, "air_velocity"), "the oncoming air"
    if ways is None and not any(name in dataset for name in ("libration", "roll_pitch_yaw")):
        ways, one = signals.values(dataset, "nadir"), seen(dataset)
        towards = "the direction of " + surroundings.called(None if one is None else one.body, "source")
    if ways is None or not np.isfinite(ways).any():
        return None
    ways = ways / signals.norms(ways)[:, None]
    mean = np.nanmean(ways, axis=0)
    k = int(np.abs(mean).argmax())
    axis = np.eye(3)[k] * (1.0 if mean[k] > 0 else -1.0)
    name = ("" if mean[k] > 0 else "−") + "xyz"[k]
    return name, towards, signals.angle_between(ways, axis)


def _faces(dataset: xarray.Dataset) -> bool:
    """Whether the axis of least moment stays near the source, or opposite to it."""
    swing, ways = signals.values(dataset, "libration"), toward(dataset)
    if ways is not None:
        found = signals.moments(dataset)
        assert found is not None
        cosine = ways @ signals.principal_axes(dataset)[found.argmin()]
        return bool(np.nanmin(np.abs(cosine)) > _FACING)
    return swing is not None and bool(np.nanmin(np.abs(np.cos(swing).prod(axis=1))) > _FACING)


def _normal(pole: Array) -> tuple[Array, bool]:
    """Unit normal (3,) from which inclinations count, and whether the poles (rows, 3) precess about it."""
    mean = pole.mean(axis=0) / np.linalg.norm(pole.mean(axis=0))
    _, extent, ways = np.linalg.svd(pole - pole.mean(axis=0), full_matrices=False)
    if extent[1] < _ROUND * extent[0] or extent[2] > _ROUND * extent[1]:
        return mean, False
    return ways[2] * np.sign(ways[2] @ mean), True
