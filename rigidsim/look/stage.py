"""The three-dimensional scene as numbers: what is drawn, where, in which unit.

The viewer works in float32, so everything is brought to units of order one here, in float64:
lengths in units of the body's reach (largest distance of a drawn point from the reference point),
arrows by one constant factor each.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rigidsim.look.solids import Mesh, body_meshes, point_positions, rotation_matrix
from rigidsim.look.thinning import thinned_indices
from rigidsim.scene.records import dataclass

if TYPE_CHECKING:
    from rigidsim.look.rows import Table

Array = NDArray[np.float64]
Color = tuple[int, int, int]

ARROW_REACH = 1.6  # length of the longest arrow, in units of the body's reach
AXIS_REACH = 1.3  # of the body axes
NEAR = 6.0  # reaches: a body that moves further gets a track view of its own
DISTANT = 30.0  # extents from the origin, beyond which the picture has an origin of its own
TRACK_BODY = 0.08  # reach of the enlarged body in the track view
CURVE_POINTS = 4000  # of a whole polhode or track

MOMENTUM: Color = (255, 196, 40)
VELOCITY: Color = (90, 215, 235)
POLHODE: Color = (240, 100, 175)
TRACK: Color = (150, 205, 110)


@dataclass(frozen=True)
class Arrow:
    """A vector along time: (rows, 3) in stage units, fixed to space or to the body."""

    name: str
    label: str
    color: Color
    vectors: Array
    in_body: bool


@dataclass(frozen=True)
class Trail:
    """A moving point along time: (rows, 3) in stage units; `whole` (points, 3) is it, thinned.

    `line` and `whole_line` tell whether neighbours are close enough to be joined.
    """

    name: str
    color: Color
    points: Array
    line: bool
    whole: Array
    whole_line: bool
    in_body: bool = False
    with_centre: bool = False


@dataclass(frozen=True)
class Stage:
    """One scene to be drawn under the entity `root`.

    Attributes:
        unit: metres per unit of length.
        meshes: of the body, body axes, stage units.
        points: (P, 3) point masses of the body, to be joined to the reference point.
        axis_length: of the body axes.
        quaternion: (rows, 4) float32 [x, y, z, w] as the viewer wants it, or None: no attitude.
        translation: (rows, 3) of the reference point, or None: it stays at the origin.
        origin: whether the origin of space is in the picture and marked.
    """

    root: str
    title: str
    unit: float
    meshes: list[Mesh]
    points: Array
    axis_length: float
    quaternion: NDArray[np.float32] | None
    translation: Array | None
    arrows: list[Arrow]
    trails: list[Trail]
    origin: bool = False


def build_stages(dataset: Table) -> tuple[list[Stage], list[str]]:
    """Stages for a thinned dataset, and notes on their scales for the summary page.

    The first stage shows the body. A position that moves by more than `NEAR` reaches can't be shown
    to that scale: then the body stays at the centre of the first stage, and a second one shows the
    track with the body enlarged.

    Raises:
        ValueError: an unreadable `drawing`, see `solids.body_meshes`.
    """
    drawing = dataset.attrs.get("drawing")
    meshes = body_meshes(drawing)
    reach = max(mesh.reach() for mesh in meshes)
    quaternion = _values(dataset, "quaternion", 4)
    attitude = None if quaternion is None else rotation_matrix(quaternion)
    arrows, trails, notes = _vectors(dataset, attitude)
    notes.insert(0, f"lengths are in units of the body's reach: 1 unit = {reach:.6g} m")
    if attitude is None:
        notes.append("no attitude was recorded: the body is shown in its own axes and doesn't turn")

    position = _values(dataset, "position", 3)
    body = Stage(
        root="scene",
        title="Body in space" if attitude is not None else "Body axes",
        unit=reach,
        meshes=[mesh.scaled(1 / reach) for mesh in meshes],
        points=point_positions(drawing) / reach,
        axis_length=AXIS_REACH,
        quaternion=None if quaternion is None else _viewer_quaternion(quaternion),
        translation=None,
        arrows=arrows,
        trails=trails,
    )
    if position is None:
        return [body], notes

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
    track = _trail("track", TRACK, translation)
    if near:
        moving = replace(body, translation=translation, trails=[*body.trails, track])
        return [moving], notes
    enlarged = TRACK_BODY * unit / reach
    notes.append(
        f"the body view follows the body; in the track view 1 unit = {unit:.6g} m "
        f"and the body is drawn {enlarged:.3g} times too large"
    )
    path = Stage(
        root="path",
        title="Track in space",
        unit=unit,
        meshes=[mesh.scaled(TRACK_BODY / reach) for mesh in meshes],
        points=body.points * TRACK_BODY,
        axis_length=2 * TRACK_BODY,
        quaternion=body.quaternion,
        translation=translation,
        arrows=[],
        trails=[track],
        origin=not distant,
    )
    return [body, path], notes


def camera(stage: Stage, *, narrow: bool = False) -> tuple[Array, Array, Array]:
    """Eye, target and up (3,) each, so that the leading arrow lies across the picture.

    `narrow`: the view is about as wide as high, so the eye stands further back.
    """
    target, radius = np.zeros(3), ARROW_REACH
    if stage.translation is not None:
        low, high = np.nanmin(stage.translation, axis=0), np.nanmax(stage.translation, axis=0)
        target = (low + high) / 2
        margin = ARROW_REACH if stage.arrows else 2 * TRACK_BODY
        radius = float(np.linalg.norm(high - low)) / 2 + margin
    elevation, azimuth = np.deg2rad((24.0, -55.0))
    if stage.translation is not None and not stage.arrows:
        elevation, azimuth = plane_view(stage.translation)
    space = [arrow for arrow in stage.arrows if not arrow.in_body] or stage.arrows
    if space:
        mean = np.nanmean(space[0].vectors, axis=0)
        if np.hypot(mean[0], mean[1]) > 0.3 * np.linalg.norm(mean):
            azimuth = np.arctan2(mean[1], mean[0]) - np.deg2rad(48.0)
    direction = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    return (
        target + (2.9 if narrow else 2.25) * radius * direction,
        target,
        np.array([0.0, 0.0, 1.0]),
    )


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


def _vectors(dataset: Table, attitude: Array | None) -> tuple[list[Arrow], list[Trail], list[str]]:
    arrows: list[Arrow] = []
    trails: list[Trail] = []
    notes: list[str] = []
    momentum = _values(dataset, "angular_momentum", 3)
    if momentum is not None and attitude is not None and _longest(momentum) > 0:
        factor = ARROW_REACH / _longest(momentum)
        arrows.append(Arrow("angular_momentum", "L", MOMENTUM, momentum * factor, False))
        notes.append(f"angular momentum L (yellow), space axes: 1 unit = {1 / factor:.6g} kg m²/s")
    rates = _values(dataset, "angular_velocity", 3)
    if rates is not None and _longest(rates) > 0:
        factor = ARROW_REACH / _longest(rates)
        in_body = rates * factor
        tip = in_body if attitude is None else np.einsum("tij,tj->ti", attitude, in_body)
        arrows.append(Arrow("angular_velocity", "ω", VELOCITY, tip, attitude is None))
        trails.append(_trail("polhode", POLHODE, in_body, in_body=True))
        notes.append(f"angular velocity ω (cyan): 1 unit = {1 / factor:.6g} rad/s")
        notes.append("polhode (pink): the path of the tip of ω in body axes, carried by the body")
        if attitude is not None:
            trails.append(_trail("herpolhode", VELOCITY, tip, with_centre=True))
            notes.append("herpolhode (cyan): the path of the tip of ω in space axes")
    if trails:
        notes.append("tracks: bright for the time just passed, dark for the whole run")
    return arrows, trails, notes


def _trail(
    name: str, color: Color, points: Array, *, in_body: bool = False, with_centre: bool = False
) -> Trail:
    whole = points[thinned_indices(len(points), CURVE_POINTS)]
    whole = whole[np.isfinite(whole).all(axis=1)]
    return Trail(name, color, points, _joined(points), whole, _joined(whole), in_body, with_centre)


def _joined(points: Array) -> bool:
    """Whether samples are dense enough that joining them doesn't cut across the curve."""
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    chords = chords[np.isfinite(chords)]
    if not len(chords):
        return True
    radius = float(np.nanmax(np.linalg.norm(points - np.nanmean(points, axis=0), axis=1)))
    return float(np.percentile(chords, 95)) <= 0.35 * max(radius, 1e-6)


def _longest(vectors: Array) -> float:
    norms = np.linalg.norm(vectors, axis=1)
    return float(np.nanmax(norms)) if np.isfinite(norms).any() else 0.0


def _values(dataset: Table, name: str, width: int) -> Array | None:
    if name not in dataset or dataset[name].ndim != 2 or dataset[name].shape[1] != width:
        return None
    return np.asarray(dataset[name].values, dtype=np.float64)


def _viewer_quaternion(quaternion: Array) -> NDArray[np.float32]:
    # Normalised in float64 first: the viewer takes the float32 numbers as they are.
    unit = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    return np.ascontiguousarray(unit[:, [1, 2, 3, 0]], dtype=np.float32)
