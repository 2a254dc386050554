"""A body as stages draw it: meshes in units of its reach, arrows and trails of its motion, the camera."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidsim.look import signals, surroundings
from rigidsim.look.roles import read_config
from rigidsim.look.signals import values
from rigidsim.look.solids import Mesh, body_meshes, point_positions, rotation_matrix
from rigidsim.look.stages.parts import (
    ARROW_REACH,
    AXIS_REACH,
    MOMENTUM,
    POLHODE,
    SOURCE,
    VELOCITY,
    Array,
    Arrow,
    Camera,
    Stage,
    Trail,
    longest,
    trail,
    viewer_quaternion,
)

if TYPE_CHECKING:
    from rigidsim.look.rows import Table

FIELD = np.deg2rad(55.0)
"""Field of view from bottom to top (rad), the viewer's own."""
_FLAT = 0.12  # of the other extents, below which a body is a plate


@dataclass(frozen=True)
class Subject:
    """The body of a dataset, ready to be put on a stage.

    Attributes:
        reach: metres, the unit of `meshes` and `points`.
        attitude: (rows, 3, 3) body to space, or None.
        quaternion: (rows, 4) w x y z as recorded, or None.
        position: (rows, 3), m, or None.
        solids: solids in the attribute ``drawing``.
    """

    reach: float
    meshes: list[Mesh]
    points: Array
    quaternion: Array | None
    attitude: Array | None
    position: Array | None
    solids: list[dict[str, Any]]

    @classmethod
    def of(cls, dataset: Table) -> Subject:
        """The body of a dataset in memory.

        Raises:
            ValueError: an unreadable ``drawing``, see ``solids.body_meshes``.
        """
        drawing = dataset.attrs.get("drawing")
        meshes = body_meshes(drawing)
        reach = max(mesh.reach() for mesh in meshes)
        quaternion = column(dataset, "quaternion", 4)
        return cls(
            reach=reach,
            meshes=[mesh.scaled(1 / reach) for mesh in meshes],
            points=point_positions(drawing) / reach,
            quaternion=quaternion,
            attitude=None if quaternion is None else rotation_matrix(quaternion),
            position=column(dataset, "position", 3),
            solids=json.loads(drawing) if drawing else [],
        )

    def stage(self, arrows: list[Arrow], trails: list[Trail], title: str = "") -> Stage:
        """A stage with the body at the origin, to scale."""
        return Stage(
            root="scene",
            title=title or ("Body in space" if self.attitude is not None else "Body axes"),
            unit=self.reach,
            meshes=self.meshes,
            points=self.points,
            axis_length=AXIS_REACH,
            quaternion=None if self.quaternion is None else viewer_quaternion(self.quaternion),
            translation=None,
            arrows=arrows,
            trails=trails,
        )

    @property
    def thin_axis(self) -> Array | None:
        """Unit vector (3,), body axes, across a plate; None for bodies that aren't plates."""
        corners = np.concatenate([mesh.vertices for mesh in self.meshes])
        _, spread, axes = np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)
        return axes[2] if spread[2] < _FLAT * spread[1] else None


def column(dataset: Table, name: str, width: int) -> Array | None:
    """A vector variable along time, (rows, width); None if there is none of that width."""
    found = values(dataset, name)
    return found if found is not None and found.ndim == 2 and found.shape[1] == width else None


def vectors_of(
    dataset: Table, subject: Subject, *, paths: bool = True
) -> tuple[list[Arrow], list[Trail], list[str]]:
    """Angular momentum and velocity with the paths of the latter's tip, and notes on their scales.

    Args:
        paths: whether polhode and herpolhode are wanted.
    """
    arrows: list[Arrow] = []
    trails: list[Trail] = []
    notes: list[str] = []
    attitude = subject.attitude
    momentum = column(dataset, "angular_momentum", 3)
    if momentum is not None and attitude is not None and longest(momentum) > 0:
        factor = ARROW_REACH / longest(momentum)
        arrows.append(
            Arrow(
                "angular_momentum",
                "L",
                MOMENTUM,
                momentum * factor,
                False,
                "angular momentum L",
                label_at=1.09,
            )
        )
        notes.append(f"angular momentum L (yellow), space axes: 1 unit = {1 / factor:.6g} kg m²/s")
    rates = column(dataset, "angular_velocity", 3)
    if rates is not None and longest(rates) > 0:
        factor = ARROW_REACH / longest(rates)
        in_body = rates * factor
        tip = in_body if attitude is None else np.einsum("tij,tj->ti", attitude, in_body)
        arrows.append(
            Arrow(
                "angular_velocity", "ω", VELOCITY, tip, attitude is None, "angular velocity ω",
                label_at=0.93 if arrows else 1.07,
            )
        )  # fmt: skip
        notes.append(f"angular velocity ω (cyan): 1 unit = {1 / factor:.6g} rad/s")
        if paths:
            trails.append(
                trail("polhode", POLHODE, in_body, in_body=True, words="polhode: ω's path in the body")
            )
            notes.append("polhode (pink): the path of the tip of ω in body axes, carried by the body")
        if paths and attitude is not None:
            trails.append(
                trail("herpolhode", VELOCITY, tip, with_centre=True, words="herpolhode: ω's path in space")
            )
            notes.append("herpolhode (cyan): the path of the tip of ω in space axes")
    if trails:
        notes.append("trails: bright for the time just passed, dark for the whole run")
    return arrows, trails, notes


def source_arrows(dataset: Table, subject: Subject, length: float) -> list[Arrow]:
    """Directions in space to attracting bodies: from orbits, recorded point masses, or the recorded nadir."""
    arrows = _mass_arrows(dataset, length)
    listed = surroundings.told(dataset, "source")
    nadir = column(dataset, "nadir", 3)
    for number, one in enumerate(listed):
        path = surroundings.source_path(one, signals.seconds(dataset))
        if path is None and nadir is not None and len(listed) == 1 and subject.attitude is not None:
            path = np.einsum("tij,tj->ti", subject.attitude, nadir)
        if path is None:
            continue
        way = length * path / np.linalg.norm(path, axis=1, keepdims=True)
        known = surroundings.globe_of(one)
        name = surroundings.called(known, str(one.get("ephemeris", "source")))
        color = known.color if known else SOURCE
        arrows.append(Arrow(f"source{number}", f"to {name}", color, way, False, f"direction of {name}"))
    return arrows


def _mass_arrows(dataset: Table, length: float) -> list[Arrow]:
    """Directions to the point masses whose positions were recorded, from the body that is one of them."""
    positions = signals.values(dataset, "point_mass_position")
    body = read_config(dataset).get("body", {})
    host = str(body.get("host", "")) if isinstance(body, dict) else ""
    if positions is None or "point_mass" not in dataset["point_mass_position"].coords:
        return []
    names = [str(name) for name in dataset["point_mass_position"].coords["point_mass"].values]
    if host not in names:
        return []
    arrows = []
    for number, name in enumerate(names):
        if name == host:
            continue
        way = positions[:, number] - positions[:, names.index(host)]
        way = length * way / np.linalg.norm(way, axis=1, keepdims=True)
        known = next((one for one in surroundings.GLOBES if one.name.lower() == name.lower()), None)
        called = surroundings.called(known, name)
        color = known.color if known else SOURCE
        arrows.append(Arrow(f"mass{number}", f"to {called}", color, way, False, f"direction of {called}"))
    return arrows


def eye_at(
    elevation: float, azimuth: float, radius: float, target: Array | None = None, *, narrow: bool = False
) -> Camera:
    """A camera that sees a ball of given radius from an elevation and azimuth (rad), Z up.

    Args:
        narrow: the view is about as wide as high, or less.
    """
    direction = direction_of(elevation, azimuth)
    target = np.zeros(3) if target is None else target
    distance = radius / np.sin(FIELD / 2) * (1.08 if narrow else 1.0)
    return Camera(target + distance * direction, target, np.array([0.0, 0.0, 1.0]))


def direction_of(elevation: float, azimuth: float) -> Array:
    """Unit vector (3,) of an elevation and azimuth (rad)."""
    flat = np.cos(elevation)
    return np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])


def camera(stage: Stage, *, narrow: bool = False, subject: Subject | None = None) -> Camera:
    """The stage's own camera, or one from which the leading arrow lies across the picture.

    Args:
        narrow: the view is about as wide as high, so the eye stands further back.
        subject: the body; a plate is seen so that its face shows most of the time.
    """
    if stage.camera is not None:
        if not narrow:
            return stage.camera
        back = stage.camera.target + 1.08 * (stage.camera.position - stage.camera.target)
        return Camera(back, stage.camera.target, stage.camera.up)
    target, radius = np.zeros(3), 1.12 * ARROW_REACH if stage.arrows else 1.3
    if stage.translation is not None:
        low, high = np.nanmin(stage.translation, axis=0), np.nanmax(stage.translation, axis=0)
        target = (low + high) / 2
        margin = ARROW_REACH if stage.arrows else 0.16
        radius = float(np.linalg.norm(high - low)) / 2 + margin
    elevation, azimuth = np.deg2rad((24.0, -55.0))
    if stage.translation is not None and not stage.arrows:
        elevation, azimuth = plane_view(stage.translation)
    space = [arrow for arrow in stage.arrows if not arrow.in_body] or stage.arrows
    leading = None
    if space:
        leading = np.nanmean(space[0].vectors, axis=0)
        if np.hypot(leading[0], leading[1]) > 0.3 * np.linalg.norm(leading):
            azimuth = np.arctan2(leading[1], leading[0]) - np.deg2rad(48.0)
    if subject is not None and subject.attitude is not None and subject.thin_axis is not None:
        elevation, azimuth = _facing(subject.attitude @ subject.thin_axis, leading)
    return eye_at(elevation, azimuth, radius, target, narrow=narrow)


def _facing(normals: Array, leading: Array | None) -> tuple[float, float]:
    """Elevation and azimuth (rad) from which a plate shows its face, and an arrow isn't seen end on.

    Args:
        normals: (rows, 3), normals of the plate.
        leading: (3,), the arrow.
    """
    normals = normals[:: max(len(normals) // 200, 1)]
    normals = normals[np.isfinite(normals).all(axis=1)]
    if not len(normals):
        return float(np.deg2rad(24.0)), float(np.deg2rad(-55.0))
    along = np.zeros(3) if leading is None else leading / (np.linalg.norm(leading) or 1.0)
    tried = [(e, a) for e in np.deg2rad((20.0, 30.0, 42.0)) for a in np.deg2rad(np.arange(0.0, 360.0, 15.0))]
    directions = np.array([direction_of(*angles) for angles in tried])
    shown = np.abs(normals @ directions.T)
    # about 55 degrees from the arrow neither it nor the circles about it are seen end on
    score = shown.mean(axis=0) + 0.5 * np.minimum(shown[0], 0.6)
    score -= 1.2 * (np.abs(directions @ along) - 0.57) ** 2 if along.any() else 0.0
    elevation, azimuth = tried[int(score.argmax())]
    return float(elevation), float(azimuth)


def plane_view(points: Array) -> tuple[float, float]:
    """Elevation and azimuth (radians) from which a path (points, 3) shows its plane, obliquely."""
    finite = points[np.isfinite(points).all(axis=1)]
    _, spread, axes = np.linalg.svd(finite - finite.mean(axis=0), full_matrices=False)
    if len(spread) < 3 or spread[1] < 0.05 * spread[0]:  # a point or a line lies in no one plane
        return float(np.deg2rad(24.0)), float(np.deg2rad(-55.0))
    normal = axes[2] if axes[2, 2] >= 0 else -axes[2]
    elevation = np.clip(np.arcsin(normal[2]), np.deg2rad(20.0), np.deg2rad(55.0))
    tilted = np.hypot(normal[0], normal[1]) > 0.05
    azimuth = np.arctan2(normal[1], normal[0]) - np.deg2rad(30.0) if tilted else np.deg2rad(-55.0)
    return float(elevation), float(azimuth)
