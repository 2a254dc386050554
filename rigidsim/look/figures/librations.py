"""Physical librations of a body that turns one face to its source: in longitude, and of its figure axis.

The normal is that of the cone on which the figure axis precesses, or the mean figure axis where it doesn't.
With phi the longitude of the node of the body's equator, theta its inclination and psi the angle from the
node to the axis of least moment, the libration in longitude is phi + psi less its mean motion (it has no
second order in theta), and those in latitude are theta and phi sin theta less theirs (Eckhardt 1981, The Moon
and the Planets 25, 3: tau, rho and I sigma).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray
from matplotlib.axes import Axes

from rigidsim.look import signals
from rigidsim.look.figures.fits import secular
from rigidsim.look.figures.panel import panel
from rigidsim.look.figures.style import BLUE, ORANGE, VIOLET
from rigidsim.look.figures.timelines import angles_over_time
from rigidsim.look.solids import Array, rotation_matrix

_FACING = 0.7  # cosine between the axis of least moment and the source
_ROUND = 0.3  # second over first extent of the figure axis' path, from which it is a cone's
_REGULAR = 0.3  # of the mean inclination, by which it may change for the node to be regular


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


def _faces(dataset: xarray.Dataset) -> bool:
    """Whether the axis of least moment stays near the source, or opposite to it."""
    swing, nadir = signals.values(dataset, "libration"), signals.values(dataset, "nadir")
    if nadir is not None:
        found = signals.moments(dataset)
        assert found is not None
        cosine = nadir @ signals.principal_axes(dataset)[found.argmin()]
        return bool(np.nanmin(np.abs(cosine)) > _FACING)
    return swing is not None and bool(np.nanmin(np.abs(np.cos(swing).prod(axis=1))) > _FACING)


def _normal(pole: Array) -> tuple[Array, bool]:
    """Unit normal (3,) from which inclinations count, and whether the poles (rows, 3) precess about it."""
    mean = pole.mean(axis=0) / np.linalg.norm(pole.mean(axis=0))
    _, extent, ways = np.linalg.svd(pole - pole.mean(axis=0), full_matrices=False)
    if extent[1] < _ROUND * extent[0] or extent[2] > _ROUND * extent[1]:
        return mean, False
    return ways[2] * np.sign(ways[2] @ mean), True


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
