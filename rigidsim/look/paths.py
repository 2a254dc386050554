"""Where axes point and what they trace, as paths in a plane: one form for figures and timelines."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray

from rigidsim.look import fits, signals, sources
from rigidsim.look.curves import precesses
from rigidsim.look.record import events_of, scene_of
from rigidsim.look.signals import need, optional
from rigidsim.look.solids import Array
from rigidsim.scene.readable import angle_text, period_text, scaled, span_text, with_unit

_TURN = 2 * np.pi
_SMALL = 0.05  # rad: sines of smaller angles read as angles
_FAR = 0.5  # rad from its mean motion, up to which a pole's path is as on a plane to a tenth
_SAME = 0.005  # of a path's reach, within which two are one
_FLAT = 1e-3  # of a flight's reach: it lies in a plane up to this thickness
_ELONGATED = 6.0  # length over height, from which a flight has a scale for each
_SECTION_POINTS = 8  # least number of points for a section to be drawn
_SECTIONS = ("libration", "polar_motion", "tip", "nadir", "angular_velocity", "euler_angles")


@dataclass(frozen=True)
class Path:
    """A path (rows, 2) in a unit, whose point moves along time, or points that stand for themselves.

    Attributes:
        across, up: what the axes count. center: what is at the origin; without, that isn't marked.
        others: further paths by name. ellipse: points of the one that is closest, and words on it.
        sparse: samples are too far apart to be joined. moves: the point moves along time.
        alike: both scales are equal.
    """

    name: str
    title: str
    points: Array
    across: str
    up: str
    unit: str = ""
    hue: str = "blue"
    center: str = ""
    others: Mapping[str, Array] = field(default_factory=dict)
    ellipse: tuple[Array, str] | None = None
    sparse: bool = False
    moves: bool = True
    alike: bool = True

    @property
    def reach(self) -> float:
        """Extent of what is drawn, from the origin."""
        return float(np.nanmax(np.abs(self.points), initial=0.0)) or 1.0

    @property
    def labels(self) -> tuple[str, str]:
        """Names of both axes with the unit."""
        return with_unit(self.across, self.unit), with_unit(self.up, self.unit)


Find = Callable[[xarray.Dataset], Path | None]


def planar(
    name: str, title: str, plane: Array, across: str, up: str, *, of: str = "rad",
    others: Mapping[str, Array] | None = None, attributes: Mapping[str, Any] | None = None, **options: Any,
) -> Path:  # fmt: skip
    """The path of a point of a plane (rows, 2), with others, in the unit that suits it, and a run with these
    attributes.
    """
    divisor, unit = scaled(plane, of, attributes)
    beside = {key: path / divisor for key, path in (others or {}).items()}
    return Path(name, title, plane / divisor, across, up, unit, others=beside, **options)


def once_round(dataset: xarray.Dataset, plane: Array, node: Array | None = None) -> str:
    """Words on the period and the sense in which a point goes round the origin; empty if it doesn't. The rate
    is the mean motion of the node (rows,), rad, of a pole that precesses.
    """
    mean = fits.circulation(signals.seconds(dataset), plane)
    if mean is None:
        return ""
    way = "counterclockwise" if mean.rate > 0 else "clockwise"
    mean = mean if node is None else fits.secular(signals.seconds(dataset), node)
    return f": once round in {fits.turn_text(mean, dataset.attrs)}, {way}"


def polar_motion(dataset: xarray.Dataset) -> Path:
    """The spin axis seen from the figure axis, m1 to the right and m2 up, and its period."""
    need(signals.near_axis(dataset))
    plane = need(signals.polar_motion(dataset))
    sparse, radius = signals.wobble_aliased(dataset), signals.norms(plane)
    least, most = float(np.nanmin(radius)), float(np.nanmax(radius))
    reach = f"{angle_text(least, like=most)} to " if most - least > 1e-3 * most else ""
    words = "" if sparse else once_round(dataset, plane)
    title = f"Polar motion{words}, {reach}{angle_text(most)}"
    return planar("polar_motion", title, plane, "m₁", "m₂", hue="pink", center="figure axis", sparse=sparse)


def pole_path(dataset: xarray.Dataset) -> Path:
    """Path of the figure axis in space, seen from outside along the pole that it circles: of a free body the
    momentum, else the reference plane's. Distances from the centre are angles.
    """
    along, node = signals.steady_momentum(dataset), None
    if along is not None:
        frame = np.stack([*signals.across(along), along], axis=1)
        axes = {name: signals.pole(dataset, name) for name in ("figure", "spin", "core")}
        paths = {name: flat(axis @ frame) for name, axis in axes.items() if axis is not None}
        title, names, center = "the figure axis", ("across the momentum",) * 2, "momentum"
    else:
        found = {name: signals.orientation(dataset, name) for name in ("figure", "momentum")}
        paths = {
            name: pair[0][:, None] * np.stack([np.sin(pair[1]), -np.cos(pair[1])], axis=1)
            for name, pair in found.items()
            if pair is not None
        }
        title, names, center = "the pole", ("along X", "along Y"), "reference pole"
        node = next((pair[1] for pair in found.values() if pair is not None), None)
    need(bool(paths))
    shown = next(iter(paths.values()))
    reach = max(float(np.nanmax(np.abs(shown - np.nanmean(shown, axis=0)))), 1e-300)
    others = {f"{n} axis": p for n, p in paths.items() if not np.nanmax(np.abs(p - shown)) < _SAME * reach}
    sparse = along is not None and signals.aliased(dataset)
    title = f"Path of {title} in space" + ("" if sparse else once_round(dataset, shown, node))
    if np.nanmin(signals.norms(shown)) > 3 * reach:  # so far that it would press the path flat
        center = ""
    return planar("pole_path", title, shown, *names, center=center, others=others, sparse=sparse)


def flat(directions: Array) -> Array:
    """Directions (rows, 3) as points (rows, 2) whose distance from the centre is the angle from z, rad."""
    plane = directions[:, :2]
    size = signals.norms(plane)
    angle = np.arctan2(size, directions[:, 2])
    return plane * np.divide(angle, size, out=np.ones_like(size), where=size > 1e-12)[:, None]


def nutation(dataset: xarray.Dataset) -> Path:
    """A precessing figure axis, else the momentum, less its mean motion, if that stays small, and its
    strongest part: longitude of the node, times sin of the mean obliquity, across, and obliquity up.
    """
    tilt, node = need(signals.orientation(dataset, "figure") or signals.orientation(dataset, "momentum"))
    seconds = signals.seconds(dataset)
    need(precesses(dataset))
    mean = fits.secular(seconds, tilt).value
    path = np.stack([(node - fits.secular(seconds, node).at(seconds)) * np.sin(mean), tilt - mean], axis=1)
    need(0 < np.nanmax(signals.norms(path)) < _FAR)
    ellipse, drawn = fits.leading_ellipse(seconds, node, tilt, float(np.sin(mean))), None
    if ellipse is not None:
        points, axes, rate = ellipse
        long, short = (angle_text(size, 3, like=axes[0]) for size in axes)
        words = f"{period_text(_TURN / rate, dataset.attrs)}: semi-axes {long}, {short}"
        drawn = points / scaled(path, "rad")[0], words
    title, labels = "Nutation: the pole about its mean motion", ("Δlongitude · sin(obliquity)", "Δobliquity")
    return planar("nutation", title, path, *labels, ellipse=drawn)


def tip(dataset: xarray.Dataset) -> Path:
    """The point of a top that was recorded, its centre of mass unless the config has another, or the end of
    the unit figure axis, seen from above.
    """
    up, points, what, unit = scene_of(dataset).vertical, signals.values(dataset, "tip", 3), "Tip", "m"
    if points is None:
        points, what, unit = need(signals.pole(dataset, "figure")), "Figure axis", ""
    elif (arm := signals.lever(dataset)) is not None:
        center = signals.in_space(dataset, arm)
        if center is not None and np.allclose(points, center, atol=1e-6 * np.abs(arm).max(), equal_nan=True):
            what = "Centre of mass"
    need(signals.is_top(dataset))
    plane = points @ _in_plane(up)
    if not unit and np.nanmax(np.abs(plane)) < _SMALL:  # components of a unit vector are angles
        unit = "rad"
    names = ("X", "Y") if np.allclose(up, [0, 0, 1]) else ("across", "across")
    return planar("tip", f"{what}, seen from above", plane, *names, of=unit, center="vertical")


def nadir(dataset: xarray.Dataset) -> Path:
    """Direction of the source in body axes, about the axis that it is near to."""
    directions = need(sources.toward(dataset))
    mean = np.nanmean(directions, axis=0)
    k, names = int(np.abs(mean).argmax()), "xyz"
    sign, facing = ("", 1.0) if mean[k] > 0 else ("−", -1.0)
    i, j = (k + 1) % 3, (k + 2) % 3
    across, up = (f"towards {sign}{names[axis]}" for axis in (i, j))
    plane, center = flat(facing * directions[:, [i, j, k]]), f"{sign}{names[k]} axis"
    return planar("nadir", "The source seen from the body", plane, across, up, center=center)


def sub_source(dataset: xarray.Dataset) -> Path:
    """The point under a source that a body always faces, from longitude and latitude zero."""
    found = need(sources.seen(dataset))
    need(np.isfinite(found.directions).all() and found.stays())
    title, plane = (
        f"Sub-{found.body.name if found.body else 'source'} point",
        found.coordinates(scene_of(dataset).figure),
    )
    return planar("sub_source", title, plane, "longitude", "latitude", hue="orange", center="zero")


def herpolhode(dataset: xarray.Dataset) -> Path:
    """The tip of the angular velocity on the invariable plane, seen along the momentum."""
    plane, title = herpolhode_plane(dataset), "Herpolhode on the invariable plane"
    options: dict[str, Any] = {"of": "rad/s", "attributes": dataset.attrs, "center": "L"}
    return planar("herpolhode", title, plane, "across L", "across L", **options)


def herpolhode_plane(dataset: xarray.Dataset) -> Array:
    """Component of the angular velocity across the momentum (rows, 2), rad/s."""
    along, rates = need(signals.steady_momentum(dataset)), signals.values(dataset, "angular_velocity", 3)
    return need(signals.in_space(dataset, need(rates))) @ np.stack(signals.across(along), axis=1)


@optional
def flight(dataset: xarray.Dataset) -> Path:
    """The path of the centre of mass: of a body thrown seen from the side, else in its plane; None if it lies
    in none.
    """
    position, scene = need(signals.place(dataset)), scene_of(dataset)
    (scale, unit), up = scaled(position - position[0], "m"), scene.vertical
    if scene.gravity is not None and not scene.attractors:
        level = position - np.outer(position @ up, up)
        way = level[-1] - level[0]
        run = (level - level[0]) @ way / (np.linalg.norm(way) or 1.0)
        points = np.stack([run, position @ up], axis=1)
        low, high = sorted(np.ptp(points, axis=0))
        title = f"Path over {span_text(float(np.ptp(signals.seconds(dataset))))}, seen from the side"
        names = ("horizontal distance", "height")
        return Path("path", title, points / scale, *names, unit, alike=high < _ELONGATED * low)
    finite = signals.finite_rows(position)
    _, spread, ways = np.linalg.svd(finite - finite.mean(axis=0), full_matrices=False)
    need(len(spread) == 3 and spread[1] > 0 and spread[2] <= _FLAT * spread[0])
    normal = ways[2] * np.sign(ways[2, np.abs(ways[2]).argmax()])
    points, size = position @ _in_plane(normal), float(np.linalg.norm(np.ptp(position, axis=0)))
    pair = "rigid_body_position" in dataset
    near = pair or any(not any(one["position"]) for one in scene.attractors)
    center = "origin" if near and signals.norms(points).min() < size else ""
    names = ("X", "Y") if normal[2] > 1 - 1e-9 else ("across, in the plane",) * 2
    title = "Second body, from the first" if pair else "Path in its plane"
    return Path("path", title, points / scale, *names, unit, center=center)


def _in_plane(normal: Array) -> Array:
    """Two unit vectors across a normal (3,), as columns (3, 2): X and Y where that is Z."""
    first = np.eye(3)[1 if abs(normal[0]) > 0.9 else 0]
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)], axis=1)


PATHS: dict[str, Find] = {
    find.__name__: optional(find)
    for find in (polar_motion, pole_path, nutation, tip, nadir, sub_source, herpolhode)
}
"""All of them by name."""


def sections(dataset: xarray.Dataset) -> list[Path]:
    """For each frequent event, two components recorded there, as points."""
    found = []
    for event in events_of(dataset):
        recorded = (dataset[f"{event}_{name}"] for name in _SECTIONS if f"{event}_{name}" in dataset)
        tables = (
            (one, signals.finite_rows(np.asarray(one.values, dtype=float)))
            for one in recorded
            if one.ndim == 2
        )
        for variable, table in [pair for pair in tables if len(pair[1]) >= _SECTION_POINTS][:1]:
            both = sorted(np.argsort(np.ptp(table, axis=0))[-2:])
            dimension = str(variable.dims[1])
            labels = dataset[dimension].values if dimension in dataset else np.arange(table.shape[1])
            divisor, unit = scaled(table, str(variable.attrs.get("units", "")))
            # the origin is their middle, which the names say: a small section would be a dot far off
            points = table[:, both] / divisor
            middle = (points.min(axis=0) + points.max(axis=0)) / 2
            across, up = (f"{labels[k]} − {at:.4g}" for k, at in zip(both, middle, strict=True))
            title = f"Section at {event}: {str(variable.name).removeprefix(f'{event}_').replace('_', ' ')}"
            options: dict[str, Any] = {"hue": "orange", "moves": False}
            found.append(Path(f"section_{event}", title, points - middle, across, up, unit, **options))
    return found
