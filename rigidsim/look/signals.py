"""A dataset as pictures read it: config, title, roles of variables, quantities.

Quantities are recorded ones by name, others derived from attitude and rates; all take a dataset in memory and
give float64 arrays over its rows, or None if they can't be derived.
"""

import json
import re
import tomllib
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray

from rigidsim.look.solids import Array, rotation_matrix
from rigidsim.look.surroundings import carries_within, frame, gravity
from rigidsim.scene.space_axes import CELESTIAL, EQUATOR, obliquity, to_equator

_ORBIT_NORM = re.compile(r"orbit_norm_(\d+)")
_IN_WORDS = {"energy_balance": "energy less work"}
_AVERAGED = ("spin_averaged", "orbit_averaged")  # model levels whose datasets have axes but no attitude


def read_config(dataset: xarray.Dataset) -> dict[str, Any]:
    """The embedded config as a dictionary; empty when there is none or it can't be read."""
    try:
        return tomllib.loads(str(dataset.attrs.get("config", "")))
    except tomllib.TOMLDecodeError:
        return {}


def title_of(dataset: xarray.Dataset) -> str:
    """Title of the run: attribute `title`, else the config's name."""
    return str(dataset.attrs.get("title") or read_config(dataset).get("name") or "rigid body")


def by_role(dataset: xarray.Dataset, role: str) -> dict[str, xarray.DataArray]:
    """Drifts ("drift_of") or corrections put back ("put_back_of"), by the name of their invariant."""
    return {name: v for v in dataset.data_vars.values() if (name := v.attrs.get(role))}


def is_own_state(variable: xarray.DataArray) -> bool:
    """Whether a variable is a state of ``[[states]]``."""
    return variable.attrs.get("given_by") == "[[states]]"


def in_words(name: str) -> str:
    """A variable's name as people read it."""
    orbit = _ORBIT_NORM.fullmatch(name)
    return f"cos² + sin² of orbit {orbit[1]}" if orbit else _IN_WORDS.get(name, name.replace("_", " "))


def is_averaged(attributes: Mapping[str, Any]) -> bool:
    """Whether a dataset with these attributes is of an averaged model: it has axes, but no attitude."""
    return attributes.get("formulation") in _AVERAGED


NEAR_AXIS = 0.35  # largest polar motion (rad) shown as such; beyond it, the body tumbles
_ALIKE_PLANES = 1e-5  # between unit normals of planes that have one name
_ALIKE = 1e-9  # moments nearer than this are one
_STEADY = 1e-6  # a momentum that turns by less is fixed
_SPREAD = 1e-5  # of the energy, up to which it counts as constant: more than rounding in single precision


def values(dataset: xarray.Dataset, name: str) -> Array | None:
    """A variable along time, time first; None if it wasn't recorded."""
    if name not in dataset or "time" not in dataset[name].dims:
        return None
    return np.asarray(dataset[name].transpose("time", ...).values, dtype=np.float64)


def seconds(dataset: xarray.Dataset) -> Array:
    """Sample times (rows,), s."""
    return np.asarray(dataset["time"].values, dtype=np.float64)


def moments(dataset: xarray.Dataset) -> Array | None:
    """Principal moments (3,), kg m^2."""
    found = attribute(dataset, "principal_moments")
    return found if found is not None and found.shape == (3,) and (found > 0).all() else None


def principal_axes(dataset: xarray.Dataset) -> Array:
    """Principal axes as rows (3, 3), in body axes, in the order of the moments; right-handed."""
    found = attribute(dataset, "principal_axes")
    return found if found is not None and found.shape == (3, 3) else np.eye(3)


def principal_rates(dataset: xarray.Dataset) -> Array | None:
    """Angular velocity (rows, 3) along the principal axes, rad/s."""
    rates = values(dataset, "angular_velocity")
    return None if rates is None else turned(rates, principal_axes(dataset))


def turned(vectors: Array, matrix: Array) -> Array:
    """Vectors (rows, 3), each times a matrix (3, 3); BLAS keeps its threads busy for ten times as long."""
    if np.array_equal(matrix, np.eye(3)):
        return vectors
    return np.einsum("tj,ij->ti", vectors, matrix)


def finite_rows(vectors: Array) -> Array:
    """Those of (rows, n) all of whose components are finite."""
    finite = np.isfinite(vectors)
    return vectors if finite.all() else vectors[finite.all(axis=1)]


def norms(vectors: Array) -> Array:
    """(rows,) of vectors (rows, n); some times faster than numpy's own over few components."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))


def joined(values: Array, reach: float = 0.4) -> bool:
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


def axis_names(dataset: xarray.Dataset) -> list[str]:
    """Names of the principal axes: those of body axes, or 1, 2, 3 if they aren't body axes."""
    axes = principal_axes(dataset)
    order = np.abs(axes).argmax(axis=1)
    along = np.abs(np.abs(axes).max(axis=1) - 1) < 1e-9
    return ["xyz"[k] for k in order] if along.all() else ["1", "2", "3"]


def polar_motion(dataset: xarray.Dataset) -> Array | None:
    """m1, m2 (rows, 2), rad: the spin axis seen from the figure axis; None if it departs too far from that.

    Recorded, or else the rates across the principal axis about which the body spins, over that along it.
    """
    recorded = values(dataset, "polar_motion")
    if recorded is not None and recorded.shape[1:] == (2,) and np.isfinite(recorded).any():
        return recorded
    rates = principal_rates(dataset)
    if rates is None or moments(dataset) is None:
        return None
    full, rates = rates, finite_rows(rates)
    if not len(rates):
        return None
    k = int(np.abs(rates).mean(axis=0).argmax())
    if not (np.abs(rates[:, k]) > 0).all() or np.ptp(np.sign(rates[:, k])):
        return None
    across = full[:, [(k + 1) % 3, (k + 2) % 3]]
    return across / full[:, [k]]


def near_axis(dataset: xarray.Dataset) -> bool:
    """Whether the body spins nearly about its figure axis, so that polar motion is of interest."""
    motion = polar_motion(dataset)
    if motion is None:
        return False
    return bool(0 < np.nanmax(norms(motion)) < NEAR_AXIS)


def figure_direction(dataset: xarray.Dataset) -> Array:
    """Unit vector (3,) of the figure axis in body axes: as asked, of symmetry, or of the largest moment."""
    recorded = frame(dataset)
    if recorded is not None:
        return np.array(recorded["figure_axis"])
    asked = _frame_asked(dataset).get("figure_axis")
    if asked in ("x", "y", "z"):
        return np.asarray(np.eye(3)["xyz".index(asked)])
    found = moments(dataset)
    if found is None:
        return np.array([0.0, 0.0, 1.0])
    axes = principal_axes(dataset)
    return np.asarray(axes[int(found.argmax()) if asked == "largest" else figure_index(found)])


def figure_index(found: Array) -> int:
    """Index of the principal axis that is the figure axis."""
    for k in range(3):
        a, b = found[(k + 1) % 3], found[(k + 2) % 3]
        if abs(a - b) <= _ALIKE * max(a, b) and abs(found[k] - a) > _ALIKE * a:
            return k
    return int(found.argmax())


def energy_and_momentum(dataset: xarray.Dataset) -> tuple[Array, float, float] | None:
    """Moments, twice the energy and the squared momentum of a free body; None where these aren't constant."""
    found, rates = moments(dataset), principal_rates(dataset)
    if found is None or rates is None or carries_within(dataset):
        return None
    rates = finite_rows(rates)
    twice, square = rates**2 @ found, rates**2 @ found**2
    for table in (twice, square):
        # loads, or axes that aren't the principal ones, change them
        if not len(table) or table.min() <= 0 or table.max() > (1 + _SPREAD) * table.min():
            return None
    return found, float(twice.mean()), float(square.mean())


def body_direction(dataset: xarray.Dataset, direction: Array) -> Array | None:
    """A body-fixed direction along time, (rows, 3), space axes."""
    quaternion = values(dataset, "quaternion")
    return None if quaternion is None else np.einsum("tij,j->ti", rotation_matrix(quaternion), direction)


def pole(dataset: xarray.Dataset, axis: str) -> Array | None:
    """Unit vectors (rows, 3), space axes, of the axis named figure, spin, momentum or core (its rate's)."""
    recorded = values(dataset, f"{axis}_axis")
    if recorded is not None:
        return recorded
    if axis == "figure":
        return body_direction(dataset, figure_direction(dataset))
    if axis == "momentum":
        momentum = values(dataset, "angular_momentum")
        return None if momentum is None else _unit(momentum)
    rates = values(dataset, "core_angular_velocity" if axis == "core" else "angular_velocity")
    quaternion = values(dataset, "quaternion")
    if rates is None or quaternion is None:
        return None
    return _unit(np.einsum("tij,tj->ti", rotation_matrix(quaternion), rates))


def steady_momentum(dataset: xarray.Dataset) -> Array | None:
    """Direction (3,) of the momentum if it is fixed in space; else None."""
    directions = pole(dataset, "momentum")
    if directions is None:
        return None
    directions = finite_rows(directions)
    if not len(directions) or norms(directions - directions[0]).max() > _STEADY:
        return None
    return np.asarray(directions.mean(axis=0) / np.linalg.norm(directions.mean(axis=0)))


def reference_axes(dataset: xarray.Dataset) -> tuple[Array, str] | None:
    """X', Y' and normal (3, 3), as rows, of the plane from which obliquities and longitudes count, and what
    it is called; None for one that moves.

    As ``[frame] reference`` says; where nothing says or was recorded against it, and space axes are those of
    the Earth's equator, the ecliptic.
    """
    recorded, asked = frame(dataset), _frame_asked(dataset).get("reference")
    if asked == "orbit":
        return None
    named = str(dataset.attrs.get("axes", ""))
    ecliptic = np.array(to_equator([0.0, 0.0, 1.0], obliquity(np)))
    equatorial = named in (*CELESTIAL, EQUATOR)
    normal = ecliptic if asked is None and equatorial and "obliquity" not in dataset else np.eye(3)[2]
    if recorded is not None and asked is not None:
        normal = np.array(recorded["reference_normal"])
    elif isinstance(asked, list):
        try:
            normal = np.array([float(x) for x in asked])
            normal /= np.linalg.norm(normal)
        except (TypeError, ValueError):  # expressions
            return None
    flat = named.startswith("ecliptic") and normal[2] == 1.0
    seen_as = flat or (equatorial and float(norms((normal - ecliptic)[None])[0]) < _ALIKE_PLANES)
    x, y, z = normal
    first = (
        np.array([1.0, 0.0, 0.0])
        if x == 0 and y == 0
        else np.array([1 - x * x / (1 + z), -x * y / (1 + z), -x])
    )
    return np.stack([first, np.cross(normal, first), normal]), "ecliptic" if seen_as else "plane of reference"


def orientation(dataset: xarray.Dataset, axis: str) -> tuple[Array, Array] | None:
    """Obliquity and node longitude (rows,) each, rad, of the axis named figure, spin or momentum.

    As recorded; otherwise against the plane of `reference_axes`, or XY of space where that moves, with a
    continuous longitude of the ascending node.
    """
    if "obliquity" in dataset and "node_longitude" in dataset and "axis" in dataset["obliquity"].coords:
        names = [str(label) for label in dataset["obliquity"].coords["axis"].values]
        if axis not in names:
            return None
        obliquity, node = values(dataset, "obliquity"), values(dataset, "node_longitude")
        assert obliquity is not None
        assert node is not None
        found = obliquity[:, names.index(axis)], node[:, names.index(axis)]
        return found if np.isfinite(found[0]).any() else None  # an average over a tumbling has no figure axis
    directions = pole(dataset, axis)
    if directions is None:
        return None
    plane = reference_axes(dataset)
    x, y, z = directions.T if plane is None else turned(directions, plane[0]).T
    tilt = np.arctan2(np.hypot(x, y), z)
    longitude = np.arctan2(x, -y)
    finite = np.isfinite(longitude)
    longitude[finite] = np.unwrap(longitude[finite])
    return tilt, longitude


def lever(dataset: xarray.Dataset) -> Array | None:
    """Of a body held off its centre of mass under uniform gravity the arm (3,) to the latter, m, body axes;
    None of others, such as a body held at its centre of mass, which gravity doesn't turn.
    """
    arm = attribute(dataset, "center_of_mass")
    held = "position" not in dataset and gravity(dataset) is not None
    return arm if held and arm is not None and np.linalg.norm(arm) > 0 else None


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


def _frame_asked(dataset: xarray.Dataset) -> dict[str, Any]:
    """``[frame]`` of the embedded config."""
    found = read_config(dataset).get("frame", {})
    return found if isinstance(found, dict) else {}


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / norms(vectors)[:, None])


def attribute(dataset: xarray.Dataset, name: str) -> Array | None:
    """An attribute that is a JSON list of numbers, as an array; None if it is missing or something else."""
    try:
        return np.array(json.loads(str(dataset.attrs[name])), dtype=float)
    except (KeyError, ValueError, TypeError):
        return None
