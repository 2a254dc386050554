"""Surroundings of a body, from the dataset's attribute ``surroundings``: frame, gravity, sources, attractors.

It is a JSON list of objects in SI units, written by the room that knows the scene: ``{"what": "frame",
"figure_axis", "reference_normal"}`` (unit vectors in body and space axes, null of a plane that moves;
datasets of 1.0.0 have none), ``{"what": "gravity", "acceleration"}`` of all uniform fields together,
``{"what": "attractor", "gravitational_parameter", "position"}`` and ``{"what": "source",
"gravitational_parameter"}`` with ``orbit`` (elements at time zero and their rates), ``position``,
``ephemeris``, or ``kernel``, the name by which its position was recorded.
"""

import json
from typing import Any

import numpy as np
import xarray

from rigidsim.look.solids import Array, Color
from rigidsim.scene.bodies.presets import KNOWN, KnownBody, known_body
from rigidsim.scene.kepler import combined, eccentric_anomalies, plane_vectors

_COLORS: dict[str, Color] = {
    "Sun": (255, 214, 110),
    "Mercury": (160, 150, 140),
    "Venus": (222, 190, 130),
    "Earth": (70, 122, 190),
    "Moon": (168, 166, 160),
    "Mars": (196, 112, 72),
    "Jupiter": (208, 172, 136),
    "Saturn": (218, 196, 148),
    "Uranus": (150, 205, 215),
    "Neptune": (80, 120, 205),
}


def told(dataset: xarray.Dataset, what: str) -> list[dict[str, Any]]:
    """The dataset's entries for one kind of surroundings; empty if there are none."""
    try:
        listed = json.loads(str(dataset.attrs.get("surroundings", "[]")))
    except ValueError:
        return []
    return [one for one in listed if isinstance(one, dict) and one.get("what") == what]


def has_rotors(dataset: xarray.Dataset) -> bool:
    """Whether rotors in the body carry momentum of their own: those kept at rest don't."""
    return any(one["drive"] != "fixed" or one["rate"] for one in told(dataset, "rotor"))


def carries_within(dataset: xarray.Dataset) -> bool:
    """Whether rotors or a fluid core carry momentum of their own."""
    return has_rotors(dataset) or bool(told(dataset, "core"))


def frame(dataset: xarray.Dataset) -> dict[str, Any] | None:
    """The entry on the frame; None of datasets of 1.0.0."""
    return next(iter(told(dataset, "frame")), None)


def gravity(dataset: xarray.Dataset) -> Array | None:
    """Acceleration (3,) of a uniform field, m/s^2, space axes; None if there is none."""
    for one in told(dataset, "gravity"):
        pull = _vector(one.get("acceleration"))
        if pull is not None and np.linalg.norm(pull) > 0:
            return pull
    return None


def vertical(dataset: xarray.Dataset) -> Array:
    """Unit vector (3,) against a uniform gravity; Z without any."""
    pull = gravity(dataset)
    return np.array([0.0, 0.0, 1.0]) if pull is None else np.asarray(-pull / np.linalg.norm(pull))


def body_of(one: dict[str, Any]) -> KnownBody | None:
    """The known body with the gravitational parameter of what was told; None if it is no known one."""
    return known_body(float(one.get("gravitational_parameter") or 0.0))


def named_body(name: str) -> KnownBody | None:
    """The known body of this name; None if it is no known one."""
    return next((body for body in KNOWN if body.name.lower() == name.lower()), None)


def called(body: KnownBody | None, unknown: str) -> str:
    """An attracting body in a sentence: ``the Sun``, ``Saturn``, or ``the`` and a word if unknown."""
    return f"the {unknown}" if body is None else body.called


def color_of(body: KnownBody | None, unknown: Color = (150, 154, 162)) -> Color:
    """The colour of an attracting body."""
    return unknown if body is None else _COLORS[body.name]


def source_path(one: dict[str, Any], dataset: xarray.Dataset, seconds: Array) -> Array | None:
    """Positions (rows, 3), m, space axes, of a source that was told, from the body; None if unknown."""
    if "source_position" in dataset and one.get("kernel") in dataset["source"].values:
        return np.asarray(dataset["source_position"].sel(source=one["kernel"]).values)
    place = _vector(one.get("position"))
    if place is not None:
        return np.tile(place, (len(seconds), 1))
    orbit = one.get("orbit")
    return kepler_path(orbit, seconds) if isinstance(orbit, dict) else None


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


def _vector(value: Any) -> Array | None:
    try:
        found = np.array(value, dtype=float)
    except (TypeError, ValueError):
        return None
    return found if found.shape == (3,) and np.isfinite(found).all() else None
