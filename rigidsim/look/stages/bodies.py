"""A body as stages draw it: meshes in units of its reach, arrows and trails of its motion, the camera."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import xarray

from rigidsim.look import signals, sources
from rigidsim.look.record import called, color_of, named_body, scene_of
from rigidsim.look.signals import values
from rigidsim.look.solids import Mesh, ball, body_meshes, point_positions, rotation_matrix
from rigidsim.look.stages import parts
from rigidsim.look.stages.parts import BODY, CENTRE, Array, Camera, Part, Stage, arrow, trail

FIELD = np.deg2rad(55.0)  # field of view from bottom to top (rad), the viewer's own
USUAL_VIEW = (float(np.deg2rad(24.0)), float(np.deg2rad(-55.0)))
"""Elevation and azimuth (rad) of the eye where nothing asks for another."""
NEAR = 6.0  # reaches: a body that moves further gets a separate track view
ORIGIN = "origin"
DISTANT = 30.0  # extents from the origin, beyond which the picture has a separate origin
_WEAK = 1e-3  # of the strongest tide
_SUN, _MOON = 0.11, 0.07  # radii of the balls that stand for sources, in radii of the globe
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
            sphere = {"solid": "sphere", "dimensions": {"radius": host.radius}, "name": host.name.lower()}
            meshes, solids = [ball(host.radius, host.radius, host.radius)], [sphere]
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

    def stage(
        self, shown: list[Part], title: str = "", *, root: str = "scene", size: float = 1.0,
        unit: float = 0.0, track: Array | None = None, axes: float = parts.AXIS_REACH, **more: Any,
    ) -> Stage:  # fmt: skip
        """A stage with the body, at the origin or on its track (rows, 3), to scale or with a reach of `size`
        in a unit of so many metres, and other parts; the rest is as of ``parts.Stage``.
        """
        placed = parts.frame(BODY, translation=track, quaternion=self.quaternion)
        if track is not None and any(part.path.startswith(CENTRE) for part in shown):
            placed += parts.frame(CENTRE, translation=track)
        drawn = parts.body([mesh.scaled(size) for mesh in self.meshes], size * self.points, axes)
        title = title or ("Body in space" if self.attitude is not None else "Body axes")
        whole = [*drawn, *placed, *shown]
        return Stage(root, title, unit or self.reach, whole, size if self.meshes else 0.0, track, **more)

    def enlarged(self, shown: list[Part], title: str, size: float, words: str, **more: Any) -> Stage:
        """A stage with the track of the body, which is drawn with a reach of `size`, and other parts."""
        drawn = [*trail("track", parts.TRACK, more["track"], words), *shown]
        return self.stage(drawn, title, root="path", size=size, **more)

    @property
    def thin_axis(self) -> Array | None:
        """Unit vector (3,), body axes, across a plate; None for bodies that aren't plates."""
        corners = np.concatenate([mesh.vertices for mesh in self.meshes])
        _, spread, axes = np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)
        return axes[2] if spread[2] < _FLAT * spread[1] else None


def vectors_of(
    dataset: xarray.Dataset, subject: Subject, *, paths: bool = True, longer: tuple[float, float] = (1.0, 1.0)
) -> tuple[list[Part], list[str]]:
    """Angular momentum and velocity, `longer` than others by these factors, if wanted the paths of the
    latter's tip, and notes on their scales.
    """
    shown, notes, attitude = list[Part](), list[str](), subject.attitude
    place = BODY if attitude is None else CENTRE

    def put(note: str, *drawn: Part) -> None:
        shown.extend(drawn)
        notes.append(note)

    def placed(vectors: Array) -> Array:
        return vectors if attitude is None else np.einsum("tij,tj->ti", attitude, vectors)

    momentum = values(dataset, "angular_momentum", 3)
    if momentum is not None and attitude is not None and parts.longest(momentum) > 0:
        words, factor = "angular momentum L", parts.ARROW_REACH / parts.longest(momentum)
        tip = longer[0] * factor * momentum
        drawn = arrow("angular_momentum", "L", parts.MOMENTUM, tip, words, label_at=1.09)
        put(f"{words} (yellow), space axes: 1 unit = {1 / factor:.6g} kg m²/s", drawn)
    rates = values(dataset, "angular_velocity", 3)
    if rates is None or not parts.longest(rates) > 0:
        return shown, notes
    words, factor = "angular velocity ω", parts.ARROW_REACH / parts.longest(rates)
    tip, at = placed(factor * rates), 0.93 if shown else 1.07
    drawn = arrow("angular_velocity", "ω", parts.VELOCITY, longer[1] * tip, words, place=place, label_at=at)
    put(f"{words} (cyan): 1 unit = {1 / factor:.6g} rad/s", drawn)
    core = values(dataset, "core_angular_velocity", 3)
    if core is not None:
        words = "angular velocity of the core"
        drawn = arrow(
            "core_angular_velocity", "core", parts.OF_CORE, placed(factor * core), words, place=place
        )
        put(f"{words} (orange), in the same unit", drawn)
    if not paths:
        return shown, notes
    in_body = trail("polhode", parts.POLHODE, factor * rates, "polhode: ω's path in the body", place=BODY)
    put("polhode (pink): the path of the tip of ω in body axes, carried by the body", *in_body)
    if attitude is not None:
        in_space = trail("herpolhode", parts.VELOCITY, tip, "herpolhode: ω's path in space", place=CENTRE)
        put("herpolhode (cyan): the path of the tip of ω in space axes", *in_space)
    notes.append("trails: bright for the time just passed, dark for the whole run")
    return shown, notes


def source_arrows(dataset: xarray.Dataset, length: float, *, balls: bool = False) -> list[Part]:
    """Directions in space to attracting bodies, without those whose tide is a thousandth of the strongest;
    with `balls` at the tips, the Sun's the larger, not to scale.
    """
    pulling = sources.sources(dataset)
    strongest = max((one.tide for one in pulling), default=0.0)
    arrows = []
    for one in [*sources.point_masses(dataset), *(x for x in pulling if x.tide >= _WEAK * strongest)]:
        way = length * one.path / signals.norms(one.path)[:, None]
        name, color = called(one.body, one.name), color_of(one.body, parts.SOURCE)
        ball = {"the Sun": _SUN}.get(name, _MOON) if balls else 0.0
        words, at = f"direction of {name}", 1.05 if balls else 1.07
        arrows.append(arrow(one.key, f"to {name}", color, way, words, label_at=at, ball=ball))
    return arrows


def eye_at(elevation: float, azimuth: float, radius: float, target: Array | None = None) -> Camera:
    """A camera that sees a ball from an elevation and azimuth (rad), Z up."""
    target = np.zeros(3) if target is None else target
    place = target + radius / np.sin(FIELD / 2) * direction_of(elevation, azimuth)
    return Camera(place, target, np.array([0.0, 0.0, 1.0]))


def direction_of(elevation: float, azimuth: float) -> Array:
    """Unit vector (3,) of an elevation and azimuth (rad)."""
    flat = np.cos(elevation)
    return np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])


def suited_camera(stage: Stage, subject: Subject) -> Camera:
    """One from which the leading arrow lies across the picture, and the face of a plate shows most of the
    time.
    """
    arrows = [part for part in stage.parts if part.is_arrow]
    target, radius = np.zeros(3), 1.12 * parts.ARROW_REACH if arrows else 1.3
    elevation, azimuth = USUAL_VIEW
    if stage.track is not None:
        low, high = np.nanmin(stage.track, axis=0), np.nanmax(stage.track, axis=0)
        target = (low + high) / 2
        radius = float(np.linalg.norm(high - low)) / 2 + (parts.ARROW_REACH if arrows else 0.16)
        elevation, azimuth = USUAL_VIEW if arrows else plane_view(stage.track)
    space = [part for part in arrows if not part.path.startswith(BODY)] or arrows
    if space:
        leading = np.nanmean(space[0].values, axis=0)
        if np.hypot(leading[0], leading[1]) > 0.3 * np.linalg.norm(leading):
            azimuth = np.arctan2(leading[1], leading[0]) - np.deg2rad(48.0)
    if subject.attitude is not None and subject.thin_axis is not None:
        elevation, azimuth = _facing(subject.attitude @ subject.thin_axis)
    return eye_at(elevation, azimuth, radius, target)


def _facing(normals: Array) -> tuple[float, float]:
    """Elevation and azimuth (rad) from which a plate with normals (rows, 3) shows its face most often."""
    normals = signals.finite_rows(normals)
    _, ways = np.linalg.eigh(normals.T @ normals)
    return _onto(ways[:, -1], 42.0, 20.0)


def plane_view(points: Array) -> tuple[float, float]:
    """Elevation and azimuth (radians) from which a path (points, 3) shows its plane, obliquely."""
    finite = signals.finite_rows(points)
    _, spread, axes = np.linalg.svd(finite - finite.mean(axis=0), full_matrices=False)
    if len(spread) < 3 or spread[1] < 0.05 * spread[0]:  # a point or a line lies in no one plane
        return USUAL_VIEW
    elevation, azimuth = _onto(axes[2], 55.0, -30.0)
    return elevation, azimuth if np.hypot(axes[2, 0], axes[2, 1]) > 0.05 else USUAL_VIEW[1]


def _onto(normal: Array, highest: float, beside: float) -> tuple[float, float]:
    """Elevation, at most so many degrees, and azimuth (rad) of a view onto a plane, beside its normal."""
    normal = normal if normal[2] >= 0 else -normal
    elevation = np.clip(np.arcsin(normal[2]), np.deg2rad(20.0), np.deg2rad(highest))
    return float(elevation), float(np.arctan2(normal[1], normal[0]) + np.deg2rad(beside))


def with_track(subject: Subject, shown: list[Part], notes: list[str]) -> list[Stage]:
    """The body's stage, and a second one with its track if it moves by more than `NEAR` reaches: that can't
    be shown to its scale, so that the body stays at the centre of the first and is enlarged on the second.
    """
    position, reach = subject.position, subject.reach
    if position is None:
        return [subject.stage(shown)]
    extent = float(np.nanmax(np.linalg.norm(position - position[0], axis=1)))
    middle = (np.nanmin(position, axis=0) + np.nanmax(position, axis=0)) / 2
    # Far from the origin float32 would make the body jitter: then the picture has its own origin.
    distant = float(np.linalg.norm(middle)) > DISTANT * max(extent, reach)
    center = middle if distant else np.zeros(3)
    if distant:
        notes.append("the origin of the picture is at {:.9g}, {:.9g}, {:.9g} m".format(*center))
    near, words = extent <= NEAR * reach, "track of the centre of mass"
    unit = reach if near else max(float(np.nanmax(np.abs(position - center))), reach)
    track = (position - center) / unit
    if near:
        return [subject.stage([*shown, *trail("track", parts.TRACK, track, words)], track=track)]
    enlarged = TRACK_BODY * unit / reach
    notes.append(
        f"the body view follows the body; in the track view 1 unit = {unit:.6g} m "
        f"and the body is drawn {enlarged:.3g} times too large"
    )
    origin = [] if distant else [parts.spot(ORIGIN, ORIGIN, (230, 230, 230), np.zeros(3), size=5.0)]
    size, more = TRACK_BODY, {"unit": unit, "track": track, "axes": 2 * TRACK_BODY}
    return [subject.stage(shown), subject.enlarged(origin, "Track in space", size, words, **more)]
