"""What pulls at a body: where sources are, how they are seen from it, and librations of one that faces one.

For physical librations the normal is the axis of the figure axis's cone of precession, or the mean figure
axis without precession. With phi the longitude of the node of the body's equator, theta its inclination and
psi the angle from the node to the axis of least moment, the libration in longitude is phi + psi less its mean
motion (it has no second order in theta), and those in latitude are theta and phi sin theta less theirs
(Eckhardt 1981, The Moon and the Planets 25, 3: tau, rho and I sigma).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray

from rigidsim.look import signals
from rigidsim.look.fits import secular
from rigidsim.look.record import body_of, called, named_body, scene_of
from rigidsim.look.signals import need, optional
from rigidsim.look.solids import Array, rotation_matrix
from rigidsim.scene.bodies.presets import KnownBody
from rigidsim.scene.kepler import combined, eccentric_anomalies, plane_vectors

_FACING = 0.7  # cosine between the axis of least moment, or a mean direction, and the source
_STEEP = 1.5  # rad of pitch, near which roll and yaw are ill-defined
_ROUND = 0.3  # second over first extent of the figure axis' path, from which it is a cone's
_REGULAR = 0.3  # of the mean inclination, by which it may change for the node to be regular


@dataclass(frozen=True)
class Source:
    """An attracting body: what it is, if known, its name, its path (rows, 3), m, space axes, as seen from the
    body, and its tide (1/s^2; 0 where nobody says).
    """

    key: str
    body: KnownBody | None
    name: str
    path: Array
    tide: float = 0.0


def sources(dataset: xarray.Dataset) -> list[Source]:
    """Sources of torque whose places are known: recorded, on orbits, at rest, or towards the nadir."""
    found = []
    listed, times = scene_of(dataset).sources, signals.seconds(dataset)
    nadir = signals.values(dataset, "nadir", 3)
    for number, one in enumerate(listed):
        path = None
        if "source_position" in dataset and one.get("kernel") in dataset["source"].values:
            path = np.asarray(dataset["source_position"].sel(source=one["kernel"]).values)
        elif one.get("position") is not None:
            path = np.tile(np.array(one["position"], dtype=float), (len(times), 1))
        elif one.get("orbit"):
            path = kepler_path(one["orbit"], times)
        elif nadir is not None and len(listed) == 1:
            path = signals.in_space(dataset, nadir)
        if path is not None:
            distance = float(np.nanmean(signals.norms(path) ** 3))
            tide = float(one.get("gravitational_parameter") or 0.0) / distance
            found.append(Source(f"source{number}", body_of(one), _name_of(one), path, tide))
    return found


def _name_of(one: dict[str, Any]) -> str:
    return str(one.get("ephemeris", one.get("kernel", "source")))


def point_masses(dataset: xarray.Dataset) -> list[Source]:
    """Point masses whose positions were recorded, if the body is one of them."""
    positions, host = signals.values(dataset, "point_mass_position"), scene_of(dataset).host
    names = [str(name) for name in dataset.coords.get("point_mass", xarray.DataArray([])).values]
    if positions is None or host not in names:
        return []
    own = positions[:, names.index(host)]
    others = [(k, name) for k, name in enumerate(names) if name != host]
    return [Source(f"mass{k}", named_body(name), name, positions[:, k] - own) for k, name in others]


def kepler_path(orbit: dict[str, float], seconds: Array) -> Array:
    """Positions (rows, 3), m, on an orbit of classical elements at time zero (m, rad), whose node and
    periapsis move uniformly (rad/s).
    """
    e, axis = orbit["eccentricity"], orbit["semi_major_axis"]
    mean = np.remainder(orbit["mean_anomaly"] + orbit["mean_motion"] * seconds + np.pi, 2 * np.pi) - np.pi
    anomaly = eccentric_anomalies(mean, e)
    periapsis = orbit["periapsis"] + orbit["periapsis_rate"] * seconds
    node = orbit["ascending_node"] + orbit["node_rate"] * seconds
    axes = plane_vectors(*((np.cos(x), np.sin(x)) for x in (orbit["inclination"], node, periapsis)))
    across = axis * np.sqrt(1 - e * e) * np.sin(anomaly)
    return np.stack(combined(axes, axis * (np.cos(anomaly) - e), across), axis=1)


def orbit_normal(orbit: dict[str, float]) -> Array:
    """Unit normal (3,) of the orbit at time zero, space axes, about which the source moves directly."""
    tilt, node = orbit["inclination"], orbit["ascending_node"]
    return np.array([np.sin(tilt) * np.sin(node), -np.sin(tilt) * np.cos(node), np.cos(tilt)])


def keeps(ways: Array, cosine: float) -> bool:
    """Whether unit vectors (rows, 3) have a mean of such a length, and stay within such a cosine from it."""
    finite = signals.finite_rows(ways)
    mean = finite.mean(axis=0) if len(finite) else np.zeros(3)
    size = float(np.linalg.norm(mean))
    return size > cosine and bool((finite @ mean).min() > cosine * size)


@dataclass(frozen=True)
class Seen:
    """The strongest source of tides: which known body it is, and unit vectors (rows, 3) to it, body axes."""

    body: KnownBody | None
    name: str
    directions: Array

    @property
    def last(self) -> slice:
        """The last tenth of the run."""
        return slice(-max(round(0.1 * len(self.directions)), 2), None)

    def stays(self, rows: slice = slice(None)) -> bool:
        """Whether it stays over one face in these rows."""
        return keeps(self.directions[rows], _FACING)

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


@optional
def seen(dataset: xarray.Dataset) -> Seen:
    """The strongest source of tides in body axes, from positions and attitude or the recorded nadir; None
    where that isn't known.
    """
    listed, found = scene_of(dataset).sources, sources(dataset)
    strongest = max(found, key=lambda source: source.tide, default=None)
    ways = None if strongest is None else signals.in_body(dataset, strongest.path)
    if strongest is not None and ways is not None and len(found) == len(listed):
        return Seen(strongest.body, strongest.name, ways / signals.norms(ways)[:, None])
    need(len(listed) == 1)
    return Seen(body_of(listed[0]), _name_of(listed[0]), need(signals.values(dataset, "nadir", 3)))


def toward(dataset: xarray.Dataset) -> Array | None:
    """Directions (rows, 3), body axes, to the source: the recorded nadir, or from a kernel's positions."""
    nadir = signals.values(dataset, "nadir", 3)
    if nadir is None and "source_position" in dataset and (one := seen(dataset)) is not None:
        return one.directions
    return nadir


def librates(dataset: xarray.Dataset) -> bool:
    """Whether the body keeps its attitude to its orbit: the source stays near one body direction."""
    ways = toward(dataset)
    if ways is None:
        return signals.values(dataset, "libration") is not None
    return keeps(ways, 0.5)


@optional
def librations(dataset: xarray.Dataset) -> tuple[Array, Array | None]:
    """Angles, rad, of a body that turns one face to its source: longitude (rows,) less its mean motion; and
    (rows, 2) inclination less its mean, and the node less its mean motion times the inclination's sine, which
    are None where the figure axis doesn't precess. None of other bodies.
    """
    scene, seconds = scene_of(dataset), signals.seconds(dataset)
    rates = need(signals.values(dataset, "angular_velocity", 3))
    quaternion, ways = need(signals.values(dataset, "quaternion", 4)), toward(dataset)
    moments = need(scene.moments)
    long, figure = scene.axes[moments.argmin()], scene.axes[moments.argmax()]
    if ways is None:
        cosine = np.cos(need(signals.values(dataset, "libration", 2))).prod(axis=1)
    else:
        cosine = ways @ long
    need(len(seconds) > 2 and np.nanmin(np.abs(cosine)) > _FACING)
    figure = figure * np.sign(np.nanmean(rates @ figure))
    pole, first, second = (rotation_matrix(quaternion) @ v for v in (figure, long, np.cross(figure, long)))
    normal, precesses = _normal(pole)
    e1, e2 = signals.across(normal)
    counted = integrated(seconds, rates @ figure)
    turned = np.arctan2(first @ e2 - second @ e1, first @ e1 + second @ e2)
    longitude = counted + np.unwrap(turned - counted)
    longitude -= secular(seconds, longitude).at(seconds)
    tilt = np.arctan2(np.hypot(pole @ e1, pole @ e2), pole @ normal)
    mean = float(tilt.mean())
    if not precesses or np.ptp(tilt) >= _REGULAR * mean:
        return longitude, None
    line = np.unwrap(np.arctan2(pole @ e1, -(pole @ e2)))
    node = (line - secular(seconds, line).at(seconds)) * np.sin(mean)
    return longitude, np.stack([tilt - mean, node], axis=1)


def integrated(seconds: Array, rate: Array) -> Array:
    """The angle (rows,) that a rate (rows,) turns by from the first row on."""
    return np.concatenate([[0.0], np.cumsum(np.diff(seconds) * (rate[1:] + rate[:-1]) / 2)])


def _normal(pole: Array) -> tuple[Array, bool]:
    """Unit normal (3,) from which inclinations count, and whether the poles (rows, 3) precess about it."""
    mean = pole.mean(axis=0) / np.linalg.norm(pole.mean(axis=0))
    _, extent, ways = np.linalg.svd(pole - pole.mean(axis=0), full_matrices=False)
    if extent[1] < _ROUND * extent[0] or extent[2] > _ROUND * extent[1]:
        return mean, False
    return ways[2] * np.sign(ways[2] @ mean), True


def steep(angles: Array) -> bool:
    """Whether roll and yaw of (rows, 3), rad, are ill-defined: pitch comes near a right angle."""
    return not np.nanmax(np.abs(angles[:, 1])) < _STEEP


@optional
def pointing_angle(dataset: xarray.Dataset) -> tuple[str, str, Array]:
    """A body axis, a direction in words, and the angle (rows,), rad, between them: of the axis nearest to the
    oncoming air or, where no other angles show it, to the source, or to the only attractor of a body that
    keeps an axis towards it.
    """
    ways, towards = signals.values(dataset, "air_velocity", 3), "the oncoming air"
    angles, bodies = signals.values(dataset, "roll_pitch_yaw", 3), scene_of(dataset).attractors
    if ways is None and "libration" not in dataset and (angles is None or steep(angles)):
        ways, one = signals.values(dataset, "nadir", 3), seen(dataset)
        body, position = None if one is None else one.body, signals.values(dataset, "position", 3)
        if ways is None and position is not None and len(bodies) == 1:
            place, body = np.array(bodies[0].get("position") or np.zeros(3)), body_of(bodies[0])
            ways = need(signals.in_body(dataset, place - position))
            need(np.linalg.norm((ways / signals.norms(ways)[:, None]).mean(axis=0)) > _FACING)
        towards = "the direction of " + called(body, "source")
    ways = need(ways)
    need(np.isfinite(ways).any())
    mean = np.nanmean(ways / signals.norms(ways)[:, None], axis=0)
    k = int(np.abs(mean).argmax())
    sign = "" if mean[k] > 0 else "−"
    return sign + "xyz"[k], towards, signals.angle_between(ways, np.eye(3)[k] * np.sign(mean[k]))
