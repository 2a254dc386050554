"""What scene a dataset is of: its attribute ``scene``, a JSON object written by the room that knows the scene.

| key | holds |
| --- | --- |
| ``version`` | 1 |
| ``moments``, ``axes``, ``inertia`` | principal moments and axes (rows, body axes), tensor, kg m^2 |
| ``center_of_mass``, ``mass`` | from the reference point, body axes, m; kg |
| ``drawing`` | solids, see ``solids.body_meshes``; from 2.0.0 also meshes of files |
| ``host`` | name of the body of the kernel that it is, or null |
| ``figure_axis``, ``reference`` | unit vectors, body and space axes; null for what the body or nobody says, and ``"moving"`` for the normal of a plane that moves |
| ``space_axes`` | name of the space axes |
| ``gravity`` | of all uniform fields together, m/s^2, space axes, or null |
| ``objects`` | of loads: ``{"what": "source" or "attractor", "gravitational_parameter"}`` with ``orbit`` (elements at time zero and their rates), ``position``, ``ephemeris`` or ``kernel`` (the name by which its position was recorded); ``{"what": "rotor"}``; ``{"what": "core"}``; ``{"what": "rigid_body", "name", "drawing"}`` |

Datasets of version 1.0.0 have parts of it in several attributes, and in the text of their config.
"""  # noqa: E501

import json
import tomllib
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import xarray

from rigidsim.look.solids import Array, Color
from rigidsim.scene.bodies.presets import KNOWN, KnownBody, known_body

Things = list[dict[str, Any]]
_ALIKE = 1e-9  # moments nearer than this are one
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


@dataclass(frozen=True)
class RecordedScene:
    """The scene of a dataset; see above. Moments and tensor are None where they aren't known, the principal
    axes then body axes; the figure axis is the axis of symmetry or of the largest moment where nobody says.
    """

    moments: Array | None
    axes: Array
    inertia: Array | None
    arm: Array
    mass: float | None
    drawing: Things
    host: str
    figure: Array
    reference: Any
    space_axes: str
    gravity: Array | None
    sources: Things
    attractors: Things
    rotors: Things
    partners: Things
    core: bool

    @property
    def vertical(self) -> Array:
        """Unit vector (3,) against gravity; Z without any."""
        pull = np.array([0.0, 0.0, -1.0]) if self.gravity is None else self.gravity
        return np.asarray(-pull / np.linalg.norm(pull))

    @property
    def has_rotors(self) -> bool:
        """Whether rotors carry momentum relative to the body; rotors kept at rest don't."""
        return any(one["drive"] != "fixed" or one["rate"] for one in self.rotors)

    @property
    def carries_within(self) -> bool:
        """Whether rotors or a fluid core carry momentum relative to the body."""
        return self.has_rotors or self.core

    @property
    def symmetry(self) -> int:
        """Index of the principal axis that the body is symmetric about, else of the largest moment."""
        moments = np.arange(3.0) if self.moments is None else self.moments
        for k in range(3):
            a, b = moments[(k + 1) % 3], moments[(k + 2) % 3]
            if abs(a - b) <= _ALIKE * max(a, b) and abs(moments[k] - a) > _ALIKE * a:
                return k
        return int(moments.argmax())


def scene_of(dataset: xarray.Dataset) -> RecordedScene:
    """The recorded scene of a dataset."""
    text = dataset.attrs.get("scene")
    return _read(str(text) if text else json.dumps(_of_version_1_0(dataset)))


@lru_cache(maxsize=4)
def _read(text: str) -> RecordedScene:
    found = json.loads(text)
    moments = None if found["moments"] is None else np.array(found["moments"], dtype=float)
    objects = found["objects"]
    names = ("source", "attractor", "rotor", "core", "rigid_body")
    kinds = {w: [x for x in objects if x["what"] == w] for w in names}
    pull = np.array(found["gravity"] or [0.0, 0.0, 0.0], dtype=float)
    inertia = None if found["inertia"] is None else np.array(found["inertia"], dtype=float)
    axes = np.eye(3) if found["axes"] is None else np.array(found["axes"], dtype=float)
    scene = RecordedScene(
        moments=moments,
        axes=axes,
        inertia=axes.T * moments @ axes if inertia is None and moments is not None else inertia,
        arm=np.array(found["center_of_mass"] or [0.0, 0.0, 0.0], dtype=float),
        mass=found["mass"],
        drawing=found["drawing"],
        host=found["host"] or "",
        figure=np.array([0.0, 0.0, 1.0]),
        reference=found["reference"],
        space_axes=found["space_axes"] or "",
        gravity=pull if pull.any() else None,
        sources=kinds["source"],
        attractors=kinds["attractor"],
        rotors=kinds["rotor"],
        partners=kinds["rigid_body"],
        core=bool(kinds["core"]),
    )
    figure = found["figure_axis"]
    if isinstance(figure, list):
        scene.figure[:] = figure
    elif moments is not None:
        scene.figure[:] = axes[moments.argmax() if figure == "largest" else scene.symmetry]
    return scene


def _of_version_1_0(dataset: xarray.Dataset) -> dict[str, Any]:
    """The same of a dataset of version 1.0.0, or one that was made elsewhere."""

    def listed(name: str) -> Any:
        try:
            return json.loads(str(dataset.attrs[name]))
        except (KeyError, ValueError):
            return None

    try:
        config = tomllib.loads(str(dataset.attrs.get("config", "")))
    except tomllib.TOMLDecodeError:
        config = {}
    frame, recorded = config.get("frame", {}), listed("surroundings") or []
    axis, normal = frame.get("figure_axis"), frame.get("reference")
    numbers = isinstance(normal, list) and all(isinstance(x, float | int) for x in normal)
    pull = next((one["acceleration"] for one in recorded if one["what"] == "gravity"), None)
    return {
        "moments": listed("principal_moments"),
        "axes": listed("principal_axes"),
        "inertia": listed("inertia_tensor"),
        "center_of_mass": listed("center_of_mass"),
        "mass": dataset.attrs.get("mass"),
        "drawing": listed("drawing") or [],
        "host": config.get("body", {}).get("host"),
        "figure_axis": [float(axis == k) for k in "xyz"] if axis in ("x", "y", "z") else axis,
        "reference": {"space": [0.0, 0.0, 1.0]}.get(
            str(normal), normal if numbers or not normal else "moving"
        ),
        "space_axes": dataset.attrs.get("axes"),
        "gravity": pull,
        "objects": recorded,
    }


def events_of(dataset: xarray.Dataset) -> list[str]:
    """Names of the events whose times the dataset has."""
    names = []
    for name in (*map(str, dataset.data_vars), *map(str, dataset.coords)):
        variable = dataset[name]
        event = str(variable.attrs.get("event", ""))
        if event and name == f"{event}_time" and variable.dims == (event,) and variable.shape[0]:
            names.append(event)
    return names


def body_of(one: dict[str, Any]) -> KnownBody | None:
    """The known body with the gravitational parameter of a recorded object; None if it is no known one."""
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
