"""A body as stages draw it: meshes in units of its reach, arrows and trails of its motion, the camera."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import xarray

from rigidsim.look import signals, sources
from rigidsim.look.record import called, color_of, named_body, scene_of
from rigidsim.look.signals import values
from rigidsim.look.solids import Mesh, ball, body_meshes, point_positions, rotation_matrix
from rigidsim.look.stages import parts
from rigidsim.look.stages.parts import Array, Arrow, Camera, Stage, Trail
from rigidsim.scene.bodies.presets import KnownBody

FIELD = np.deg2rad(55.0)  # field of view from bottom to top (rad), the viewer's own
USUAL_VIEW = (float(np.deg2rad(24.0)), float(np.deg2rad(-55.0)))
"""Elevation and azimuth (rad) of the eye where nothing asks for another."""
NEAR = 6.0  # reaches: a body that moves further gets a track view of its own
DISTANT = 30.0  # extents from the origin, beyond which the picture has an origin of its own
_WEAK = 1e-3  # of the strongest tide
TRACK_BODY = 0.08  # reach of the enlarged body in the track view
_FLAT = 0.12  # of the other extents, below which a body is a plate


@dataclass(frozen=True)
class Subject:
    """The body of a dataset, ready to be put on a stage: meshes and points in units of its reach (metres),
    quaternions (rows, 4) w x y z as recorded, attitudes (rows, 3, 3) to space and positions (rows, 3), m, as
    far as known, and the solids in the attribute ``drawing``.
    """

    reach: float
    meshes: list[Mesh]
    points: Array
    quaternion: Array | None
    attitude: Array | None
    position: Array | None
    solids: list[dict[str, Any]]

    @classmethod
    def of(cls, dataset: xarray.Dataset) -> Self:
        """The body of a dataset in memory; ``ValueError`` for an unreadable ``drawing``."""
        solids = scene_of(dataset).drawing
        meshes, points = body_meshes(solids), point_positions(solids)
        host = named_body(scene_of(dataset).host) if solids and solids[0].get("equivalent") else None
        if host is not None:  # known by its moments alone, but by its name as well
            meshes, solids = [ball(host.radius, host.radius, host.radius)], [_sphere(host)]
        reach = max(mesh.reach() for mesh in meshes)
        quaternion = values(dataset, "quaternion", 4)
        return cls(
            reach=reach,
            meshes=[mesh.scaled(1 / reach) for mesh in meshes],
            points=points / reach,
            quaternion=quaternion,
            attitude=None if quaternion is None else rotation_matrix(quaternion),
            position=values(dataset, "position", 3),
            solids=solids,
        )

    def stage(self, arrows: list[Arrow], trails: list[Trail], title: str = "") -> Stage:
        """A stage with the body at the origin, to scale."""
        return Stage(
            root="scene",
            title=title or ("Body in space" if self.attitude is not None else "Body axes"),
            unit=self.reach,
            meshes=self.meshes,
            points=self.points,
            axis_length=parts.AXIS_REACH,
            quaternion=None if self.quaternion is None else parts.viewer_quaternion(self.quaternion),
            arrows=arrows,
            trails=trails,
        )

    def enlarged(self, size: float, title: str, unit: float, path: Array, words: str) -> Stage:
        """A stage with the path (rows, 3) of the body, which is drawn with a reach of `size`."""
        return Stage(
            root="path",
            title=title,
            unit=unit,
            meshes=[mesh.scaled(size) for mesh in self.meshes],
            points=self.points * size,
            quaternion=None if self.quaternion is None else parts.viewer_quaternion(self.quaternion),
            translation=path,
            trails=[Trail("track", parts.TRACK, path, words=words)],
        )

    @property
    def thin_axis(self) -> Array | None:
        """Unit vector (3,), body axes, across a plate; None for bodies that aren't plates."""
        corners = np.concatenate([mesh.vertices for mesh in self.meshes])
        _, spread, axes = np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)
        return axes[2] if spread[2] < _FLAT * spread[1] else None


def _sphere(body: KnownBody) -> dict[str, Any]:
    return {"solid": "sphere", "dimensions": {"radius": body.radius}, "name": body.name.lower()}


def vectors_of(
    dataset: xarray.Dataset, subject: Subject, *, paths: bool = True
) -> tuple[list[Arrow], list[Trail], list[str]]:
    """Angular momentum and velocity, if wanted the paths of the latter's tip, and notes on their scales."""
    arrows: list[Arrow] = []
    trails: list[Trail] = []
    notes: list[str] = []
    attitude = subject.attitude
    momentum = values(dataset, "angular_momentum", 3)
    if momentum is not None and attitude is not None and parts.longest(momentum) > 0:
        factor = parts.ARROW_REACH / parts.longest(momentum)
        words = "angular momentum L"
        arrows.append(
            Arrow("angular_momentum", "L", parts.MOMENTUM, momentum * factor, False, words, label_at=1.09)
        )
        notes.append(f"{words} (yellow), space axes: 1 unit = {1 / factor:.6g} kg m²/s")
    rates = values(dataset, "angular_velocity", 3)
    if rates is not None and parts.longest(rates) > 0:
        factor = parts.ARROW_REACH / parts.longest(rates)
        in_body = rates * factor
        tip = in_body if attitude is None else np.einsum("tij,tj->ti", attitude, in_body)
        words, at = "angular velocity ω", 0.93 if arrows else 1.07
        arrows.append(
            Arrow("angular_velocity", "ω", parts.VELOCITY, tip, attitude is None, words, label_at=at)
        )
        notes.append(f"{words} (cyan): 1 unit = {1 / factor:.6g} rad/s")
        core = values(dataset, "core_angular_velocity", 3)
        if core is not None:
            shown = core * factor if attitude is None else np.einsum("tij,tj->ti", attitude, core * factor)
            words = "angular velocity of the core"
            arrows.append(
                Arrow("core_angular_velocity", "core", parts.OF_CORE, shown, attitude is None, words)
            )
            notes.append(f"{words} (orange), in the same unit")
        if paths:
            words = "polhode: ω's path in the body"
            trails.append(Trail("polhode", parts.POLHODE, in_body, in_body=True, words=words))
            notes.append("polhode (pink): the path of the tip of ω in body axes, carried by the body")
        if paths and attitude is not None:
            words = "herpolhode: ω's path in space"
            trails.append(Trail("herpolhode", parts.VELOCITY, tip, with_centre=True, words=words))
            notes.append("herpolhode (cyan): the path of the tip of ω in space axes")
    if trails:
        notes.append("trails: bright for the time just passed, dark for the whole run")
    return arrows, trails, notes


def source_arrows(dataset: xarray.Dataset, length: float) -> list[Arrow]:
    """Directions in space to attracting bodies, without those whose tide is a thousandth of the strongest."""
    pulling = sources.sources(dataset)
    strongest = max((one.tide for one in pulling), default=0.0)
    arrows = []
    for one in [*sources.point_masses(dataset), *(x for x in pulling if x.tide >= _WEAK * strongest)]:
        way = length * one.path / signals.norms(one.path)[:, None]
        name, color = called(one.body, one.name), color_of(one.body, parts.SOURCE)
        arrows.append(Arrow(one.key, f"to {name}", color, way, False, f"direction of {name}"))
    return arrows


def eye_at(
    elevation: float, azimuth: float, radius: float, target: Array | None = None, *, narrow: bool = False
) -> Camera:
    """A camera that sees a ball from an elevation and azimuth (rad), Z up; a narrow view from further off."""
    direction = direction_of(elevation, azimuth)
    target = np.zeros(3) if target is None else target
    distance = radius / np.sin(FIELD / 2) * (1.08 if narrow else 1.0)
    return Camera(target + distance * direction, target, np.array([0.0, 0.0, 1.0]))


def direction_of(elevation: float, azimuth: float) -> Array:
    """Unit vector (3,) of an elevation and azimuth (rad)."""
    flat = np.cos(elevation)
    return np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])


def camera(stage: Stage, *, narrow: bool = False, subject: Subject | None = None) -> Camera:
    """The stage's own camera, or one from which the leading arrow lies across the picture; further back in a
    narrow view, about as wide as high. A plate is seen so that its face shows most of the time.
    """
    if stage.camera is not None:
        if not narrow:
            return stage.camera
        back = stage.camera.target + 1.08 * (stage.camera.position - stage.camera.target)
        return Camera(back, stage.camera.target, stage.camera.up)
    target, radius = np.zeros(3), 1.12 * parts.ARROW_REACH if stage.arrows or stage.cones else 1.3
    if stage.translation is not None:
        low, high = np.nanmin(stage.translation, axis=0), np.nanmax(stage.translation, axis=0)
        target = (low + high) / 2
        margin = parts.ARROW_REACH if stage.arrows else 0.16
        radius = float(np.linalg.norm(high - low)) / 2 + margin
    elevation, azimuth = USUAL_VIEW
    if stage.translation is not None and not stage.arrows:
        elevation, azimuth = plane_view(stage.translation)
    space = [arrow for arrow in stage.arrows if not arrow.in_body] or stage.arrows
    if space:
        leading = np.nanmean(space[0].vectors, axis=0)
        if np.hypot(leading[0], leading[1]) > 0.3 * np.linalg.norm(leading):
            azimuth = np.arctan2(leading[1], leading[0]) - np.deg2rad(48.0)
    if subject is not None and subject.attitude is not None and subject.thin_axis is not None:
        elevation, azimuth = _facing(subject.attitude @ subject.thin_axis)
    return eye_at(elevation, azimuth, radius, target, narrow=narrow)


def _facing(normals: Array) -> tuple[float, float]:
    """Elevation and azimuth (rad) from which a plate with normals (rows, 3) shows its face most often."""
    normals = signals.finite_rows(normals)
    _, ways = np.linalg.eigh(normals.T @ normals)
    way = ways[:, -1] * (1.0 if ways[2, -1] >= 0 else -1.0)
    elevation = np.clip(np.arcsin(way[2]), np.deg2rad(20.0), np.deg2rad(42.0))
    return float(elevation), float(np.arctan2(way[1], way[0]) + np.deg2rad(20.0))


def plane_view(points: Array) -> tuple[float, float]:
    """Elevation and azimuth (radians) from which a path (points, 3) shows its plane, obliquely."""
    finite = signals.finite_rows(points)
    _, spread, axes = np.linalg.svd(finite - finite.mean(axis=0), full_matrices=False)
    if len(spread) < 3 or spread[1] < 0.05 * spread[0]:  # a point or a line lies in no one plane
        return USUAL_VIEW
    normal = axes[2] if axes[2, 2] >= 0 else -axes[2]
    elevation = np.clip(np.arcsin(normal[2]), np.deg2rad(20.0), np.deg2rad(55.0))
    tilted = np.hypot(normal[0], normal[1]) > 0.05
    azimuth = np.arctan2(normal[1], normal[0]) - np.deg2rad(30.0) if tilted else np.deg2rad(-55.0)
    return float(elevation), float(azimuth)


def with_track(subject: Subject, body: Stage, notes: list[str]) -> list[Stage]:
    """The body's stage, and a second one with its track if it moves by more than `NEAR` reaches: that can't
    be shown to its scale, so that the body stays at the centre of the first and is enlarged on the second.
    """
    position, reach = subject.position, subject.reach
    if position is None:
        return [body]
    extent = float(np.nanmax(np.linalg.norm(position - position[0], axis=1)))
    middle = (np.nanmin(position, axis=0) + np.nanmax(position, axis=0)) / 2
    # Far from the origin float32 would make the body jitter: then the picture has its own origin.
    distant = float(np.linalg.norm(middle)) > DISTANT * max(extent, reach)
    center = middle if distant else np.zeros(3)
    if distant:
        notes.append("the origin of the picture is at {:.9g}, {:.9g}, {:.9g} m".format(*center))
    near = extent <= NEAR * reach
    unit = reach if near else max(float(np.nanmax(np.abs(position - center))), reach)
    translation = (position - center) / unit
    if near:
        track = Trail("track", parts.TRACK, translation, words="track of the centre of mass")
        return [replace(body, translation=translation, trails=[*body.trails, track])]
    enlarged = TRACK_BODY * unit / reach
    notes.append(
        f"the body view follows the body; in the track view 1 unit = {unit:.6g} m "
        f"and the body is drawn {enlarged:.3g} times too large"
    )
    path = replace(
        subject.enlarged(TRACK_BODY, "Track in space", unit, translation, "track of the centre of mass"),
        axis_length=2 * TRACK_BODY,
        origin=not distant,
    )
    return [body, path]
