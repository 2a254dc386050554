"""Quantities of a dataset in memory: recorded ones by name, others from attitude and rates.

All are float64 arrays over its rows, or None if they can't be derived. Within a function that is `optional`,
`need` asks for others: where they are absent, it gives None.
"""

import re
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np
import xarray

from rigidsim.look.record import scene_of
from rigidsim.look.solids import Array, rotation_matrix
from rigidsim.scene.epochs import J2000
from rigidsim.scene.parts_of_values import BACKWARDS
from rigidsim.scene.readable import YEAR, TimeUnit, epoch_of, julian_year, unit_of
from rigidsim.scene.space_axes import CELESTIAL, EQUATOR, obliquity, to_equator

P = ParamSpec("P")
T = TypeVar("T")
_ORBIT_NORM = re.compile(r"orbit_norm_(\d+)")
_IN_WORDS = {"energy_balance": "energy less work"}
_AVERAGED = ("spin_averaged", "orbit_averaged")  # model levels whose datasets have axes but no attitude
NEAR_AXIS = 0.35  # largest polar motion (rad) shown as such; beyond it, the body tumbles
OVER_TIME = 0.8
"""Radii of the whole between neighbours that are joined over time: some eight samples a turn."""
_JOINED = 0.4  # the same of a path that is drawn as a line
_ALIKE_PLANES = 1e-5  # between unit normals of planes that have one name
_DEFINING = {
    "momentum": "angular_momentum", "spin": "angular_velocity", "core": "core_angular_velocity"
}  # fmt: skip
_SOME_MINUTES = 300.0  # s, up to which a clock counts seconds
_STEADY = 1e-6  # a momentum that turns by less is fixed
_SPREAD = 1e-5  # of the energy, up to which it counts as constant: more than rounding in single precision


class Absent(Exception):
    """A dataset hasn't what a part of a picture needs."""


def need(value: T | None) -> T:
    """A value, or a condition, that a part of a picture needs; ``Absent`` if it is None, or false."""
    if value is None or (isinstance(value, bool | np.bool_) and not value):
        raise Absent
    return value


def optional(find: Callable[P, T]) -> Callable[P, T | None]:
    """A function that is None where something that it needs is absent."""

    @wraps(find)
    def found(*args: P.args, **options: P.kwargs) -> T | None:
        try:
            return find(*args, **options)
        except Absent:
            return None

    return found


def title_of(dataset: xarray.Dataset) -> str:
    """Title of the run."""
    return str(dataset.attrs.get("title") or "rigid body")


def in_words(name: str) -> str:
    """A variable's name as people read it."""
    orbit = _ORBIT_NORM.fullmatch(name)
    return f"cos² + sin² of orbit {orbit[1]}" if orbit else _IN_WORDS.get(name, name.replace("_", " "))


def is_averaged(attributes: Mapping[str, Any]) -> bool:
    """Whether a dataset with these attributes is of an averaged model: it has axes, but no attitude."""
    return attributes.get("formulation") in _AVERAGED


def values(dataset: xarray.Dataset, name: str, width: int | None = None) -> Array | None:
    """A variable along time, time first; None if it wasn't recorded, or has another width than asked for."""
    if name not in dataset or "time" not in dataset[name].dims:
        return None
    found = np.asarray(dataset[name].transpose("time", ...).values, dtype=np.float64)
    return found if width is None or found.shape[1:] == (width,) else None


def place(dataset: xarray.Dataset) -> Array | None:
    """Position (rows, 3) of a body in flight, or of the second one from the first, m."""
    if "rigid_body_position" in dataset:
        dataset = dataset.assign(position=dataset["rigid_body_position"].isel(rigid_body=0))
    return values(dataset, "position", 3)


def seconds(dataset: xarray.Dataset) -> Array:
    """Sample times (rows,), s."""
    return np.asarray(dataset["time"].values, dtype=np.float64)


def from_start(dataset: xarray.Dataset, rows: Array) -> Array:
    """Rows, in the order of time, as the run took them: from the last one on if it went backwards."""
    return rows[::-1] if dataset.attrs.get(BACKWARDS) else rows


def clock(dataset: xarray.Dataset) -> tuple[Array, TimeUnit, str]:
    """Sample times as an axis shows them, their unit, and its label: years of the calendar, or time, in
    seconds up to five minutes unless the config has a unit.
    """
    times, epoch = seconds(dataset), epoch_of(dataset.attrs)
    span = max(abs(float(times[0])), abs(float(times[-1])))
    unit = unit_of(dataset.attrs, span if span > _SOME_MINUTES else min(span, 1.0))
    time = times / unit.seconds
    if epoch is None:
        return time, unit, f"time [{unit.symbol}]"
    if unit.seconds == YEAR:
        return time + julian_year(epoch), unit, f"year ({epoch.uniform().scale})"
    return time, unit, f"time since {'J2000' if epoch == J2000 else epoch} [{unit.symbol}]"


@optional
def principal_rates(dataset: xarray.Dataset) -> Array:
    """Angular velocity (rows, 3) along the principal axes, rad/s."""
    return turned(need(values(dataset, "angular_velocity", 3)), scene_of(dataset).axes)


@optional
def path_of_rates(dataset: xarray.Dataset) -> Array:
    """The same, if rows are dense enough for its path: a mean step, weighted by steps' lengths, is short."""
    rates = need(principal_rates(dataset))
    table = finite_rows(rates)
    if len(table) > 2 and energy_and_momentum(dataset) is None:
        steps, radius = norms(np.diff(table, axis=0)), float(norms(table - table.mean(axis=0)).max())
        need(steps @ steps <= _JOINED * radius * steps.sum())
    return rates


def turned(vectors: Array, matrix: Array) -> Array:
    """Vectors (rows, 3), each times a matrix (3, 3); BLAS keeps its threads busy for ten times as long."""
    if np.array_equal(matrix, np.eye(3)):
        return vectors
    return np.einsum("tj,ij->ti", vectors, matrix)


def finite_rows(vectors: Array) -> Array:
    """Rows of (rows, n) all of whose components are finite."""
    finite = np.isfinite(vectors)
    return vectors if finite.all() else vectors[finite.all(axis=1)]


def norms(vectors: Array) -> Array:
    """(rows,) of vectors (rows, n); some times faster than numpy's own over few components."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))


def joined(values: Array, reach: float = _JOINED) -> bool:
    """Whether neighbours of samples (rows,) or (rows, n) lie within `reach` radii of the whole.

    By default these are some sixteen a turn. Where a quantity swings faster than it was sampled, lines would
    draw a pattern that isn't there.
    """
    table = finite_rows(values.reshape(len(values), -1))
    if len(table) < 3:
        return True
    radius = float(norms(table - table.mean(axis=0)).max())
    return float(np.percentile(norms(np.diff(table, axis=0)), 95)) <= reach * radius or radius == 0.0


def aliased(dataset: xarray.Dataset, rates: float = 1.0) -> bool:
    """Whether a motion at so many times the body's rate, as recorded, makes half a turn or more between rows,
    so that lines would draw waves that are not there.
    """
    turning, time = values(dataset, "angular_velocity"), seconds(dataset)
    if turning is None or len(time) < 2 or not np.isfinite(turning).any():
        return False
    return bool(rates * np.nanmax(norms(turning)) * np.abs(np.diff(time)).max() > np.pi)


def wobble_aliased(dataset: xarray.Dataset) -> bool:
    """Whether rows are too far apart for the free wobble about the axis of largest or least moment, or for
    one that torques force, which goes round in a turn of the body.
    """
    moments, forced = scene_of(dataset).moments, pole(dataset, "momentum") is not None
    a, b, c = np.ones(3) if moments is None else np.sort(moments)
    free = float(np.sqrt(max((c - a) * (c - b) / (a * b), (c - a) * (b - a) / (c * b))))
    return aliased(dataset, 1.0 if forced and steady_momentum(dataset) is None else free)


def axis_names(dataset: xarray.Dataset) -> list[str]:
    """Names of the principal axes: names of body axes, or 1, 2, 3 if they aren't body axes."""
    axes = np.abs(scene_of(dataset).axes)
    along = np.abs(axes.max(axis=1) - 1) < 1e-9
    return ["xyz"[k] for k in axes.argmax(axis=1)] if along.all() else ["1", "2", "3"]


@optional
def polar_motion(dataset: xarray.Dataset) -> Array:
    """m1, m2 (rows, 2), rad: the spin axis seen from the figure axis; None if it departs too far from that.

    Recorded, or else the rates across the principal axis about which the body spins, over that along it.
    """
    recorded = values(dataset, "polar_motion", 2)
    if recorded is not None and np.isfinite(recorded).any():
        return recorded
    rates = need(principal_rates(dataset))
    finite = finite_rows(rates)
    need(scene_of(dataset).moments is not None and len(finite) > 0)
    k = int(np.abs(finite).mean(axis=0).argmax())
    need(not finite[:, k].min() <= 0 <= finite[:, k].max())
    return rates[:, [(k + 1) % 3, (k + 2) % 3]] / rates[:, [k]]


def near_axis(dataset: xarray.Dataset, *, exactly: bool = False) -> bool:
    """Whether the body spins nearly about its figure axis, so that polar motion matters, or exactly."""
    motion = polar_motion(dataset)
    largest = np.inf if motion is None else float(np.nanmax(norms(motion)))
    return largest < NEAR_AXIS and (exactly or largest > 0)


@optional
def energy_and_momentum(dataset: xarray.Dataset) -> tuple[Array, float, float]:
    """Moments, twice the energy and the squared momentum of a free body; None where these aren't constant."""
    moments, rates = need(scene_of(dataset).moments), finite_rows(need(principal_rates(dataset)))
    need(len(rates) > 0 and not scene_of(dataset).carries_within)
    twice, square = rates**2 @ moments, rates**2 @ moments**2
    for table in (twice, square):  # loads, or axes that aren't the principal ones, change them
        need(table.min() > 0 and table.max() <= (1 + _SPREAD) * table.min())
    return moments, float(twice.mean()), float(square.mean())


@optional
def in_space(dataset: xarray.Dataset, vectors: Array) -> Array:
    """Vectors of the body, (3,) or along time (rows, 3), in space axes (rows, 3); None without attitude."""
    turns = rotation_matrix(need(values(dataset, "quaternion", 4)))
    return np.asarray(np.einsum("tij,tj->ti", turns, np.broadcast_to(vectors, (len(turns), 3))))


@optional
def in_body(dataset: xarray.Dataset, vectors: Array) -> Array:
    """Vectors along time (rows, 3), space axes, in body axes (rows, 3); None without attitude."""
    turns = rotation_matrix(need(values(dataset, "quaternion", 4)))
    return np.asarray(np.einsum("tij,ti->tj", turns, vectors))


@optional
def pole(dataset: xarray.Dataset, axis: str) -> Array:
    """Unit vectors (rows, 3), space axes, of the axis named figure, spin, momentum or core (its rate's)."""
    recorded = values(dataset, f"{axis}_axis", 3)
    if recorded is not None:
        return recorded
    if axis == "figure":
        return need(in_space(dataset, scene_of(dataset).figure))
    found = need(values(dataset, _DEFINING[axis], 3))
    found = found if axis == "momentum" else need(in_space(dataset, found))
    with np.errstate(invalid="ignore"):  # a body at rest has no such axis
        return found / norms(found)[:, None]


@optional
def steady_momentum(dataset: xarray.Dataset) -> Array:
    """Direction (3,) of the momentum, recorded or the body's by its moments, if it is fixed in space."""
    found = pole(dataset, "momentum")
    if found is None:
        scene = scene_of(dataset)
        need(not scene.carries_within)
        along = need(in_space(dataset, (need(principal_rates(dataset)) * need(scene.moments)) @ scene.axes))
        with np.errstate(invalid="ignore"):
            found = along / norms(along)[:, None]
    directions = finite_rows(found)
    need(len(directions) > 0 and norms(directions - directions[0]).max() <= _STEADY)
    return np.asarray(directions.mean(axis=0) / np.linalg.norm(directions.mean(axis=0)))


@optional
def reference_axes(dataset: xarray.Dataset) -> tuple[Array, str]:
    """X', Y' and normal (3, 3), as rows, of the plane from which obliquities and longitudes count, and what
    it is called; None for one that moves.

    As ``[frame] reference`` says; where nothing says or was recorded against it, and space axes are those of
    the Earth's equator, the ecliptic.
    """
    scene = scene_of(dataset)
    need(scene.reference != "moving")
    ecliptic = np.array(to_equator([0.0, 0.0, 1.0], obliquity(np)))
    equatorial = scene.space_axes in (*CELESTIAL, EQUATOR)
    normal = ecliptic if equatorial and "obliquity" not in dataset else np.eye(3)[2]
    if scene.reference is not None:
        normal = np.array(scene.reference) / np.linalg.norm(scene.reference)
    flat = scene.space_axes.startswith("ecliptic") and normal[2] == 1.0
    seen_as = flat or (equatorial and float(np.linalg.norm(normal - ecliptic)) < _ALIKE_PLANES)
    x, y, z = normal
    first = np.eye(3)[0]
    if x or y:
        first = np.array([1 - x * x / (1 + z), -x * y / (1 + z), -x])
    return np.stack([first, np.cross(normal, first), normal]), "ecliptic" if seen_as else "plane of reference"


@optional
def orientation(dataset: xarray.Dataset, axis: str) -> tuple[Array, Array]:
    """Obliquity and node longitude (rows,) each, rad, of the axis named figure, spin or momentum.

    As recorded; otherwise against the plane of `reference_axes`, or XY of space where that moves, with a
    continuous longitude of the ascending node.
    """
    tilt, node = (values(dataset, name) for name in ("obliquity", "node_longitude"))
    if tilt is not None and node is not None and "axis" in dataset["obliquity"].coords:
        which = dataset["obliquity"].coords["axis"].values == axis
        need(np.isfinite(tilt[:, which]).any())  # an average over a tumbling has no figure axis
        return tilt[:, which][:, 0], node[:, which][:, 0]
    directions, plane = need(pole(dataset, axis)), reference_axes(dataset)
    x, y, z = (directions if plane is None else turned(directions, plane[0])).T
    longitude = np.arctan2(x, -y)
    finite = np.isfinite(longitude)
    longitude[finite] = np.unwrap(longitude[finite])
    return np.arctan2(np.hypot(x, y), z), longitude


def lever(dataset: xarray.Dataset) -> Array | None:
    """Arm (3,), m, body axes, to the centre of mass of a body held elsewhere under uniform gravity;
    None of others, such as a body held at its centre of mass, which gravity doesn't turn.
    """
    scene = scene_of(dataset)
    return scene.arm if "position" not in dataset and scene.gravity is not None and scene.arm.any() else None


def is_top(dataset: xarray.Dataset) -> bool:
    """Whether the scene is a top whose axis is known in space (see ``lever``), or a top's tip is recorded."""
    leaning = lever(dataset) is not None and pole(dataset, "figure") is not None
    return "position" not in dataset and (leaning or values(dataset, "tip") is not None)


def across(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors (3,) that complete a unit vector to a right-handed frame."""
    first = np.cross(np.eye(3)[np.abs(axis).argmin()], axis)
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)


def angle_between(directions: Array, others: Array) -> Array:
    """Angles (rows,), rad, between directions (rows, 3) and others (rows, 3) or another (3,)."""
    cosine = directions @ others if others.ndim == 1 else np.einsum("ti,ti->t", directions, others)
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(directions, others), axis=1), cosine))
