"""Stages as rerun entities: static parts, and columns of what changes.

Meshes are given no normals: the viewer then shows their own colours from all sides, and edges tell the faces
apart.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr

from rigidsim.look.signals import joined
from rigidsim.look.solids import Array, Mesh, ball
from rigidsim.look.stages.parts import BODY, NEAR, Arrow, Color, Cone, Line, Shell, Stage, Trail
from rigidsim.look.symbols import graticule, sharp_edges

Columns = Iterable[rr.ComponentColumn]

_STRETCH = 25.0  # of a frame along the line of sight: perspective is a 25th of what it was
_EDGE: Color = (12, 14, 20)
_AXIS_COLORS = [(235, 70, 60), (90, 200, 90), (80, 130, 250)]
_CLEAR = 46  # of 255: of a cone, through which labels are read
_DIM = 0.26  # of a trail's brightness: the whole curve


def trail_path(stage: Stage, trail: Trail) -> str:
    """Entity of a trail: attached to the body, to its reference point or to space."""
    place = "/body" if trail.in_body else "/centre" if trail.with_centre else ""
    return f"/{stage.root}{place}/{trail.name}"


def draw_static(recording: rr.RecordingStream, stages: Sequence[Stage]) -> None:
    """Bodies, axes, styles and whole curves: logged once, valid for all times."""
    for stage in stages:
        root = f"/{stage.root}"
        recording.log(root, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        if stage.turns_with:
            turning = rr.Transform3D.from_fields(parent_frame=f"tf#/{stage.turns_with}/{BODY}")
            recording.log(f"{root}/{BODY}", turning, static=True)
        for number, mesh in enumerate(stage.meshes):
            _draw_mesh(recording, f"{root}/body/solids/{number}", mesh)
        if len(stage.points):
            sticks = np.stack([np.zeros_like(stage.points), stage.points], axis=1)
            width = 0.014 * (float(np.abs(stage.points).max()) or 1.0)
            drawn = rr.LineStrips3D(sticks, colors=[(190, 190, 190)], radii=width)
            recording.log(f"{root}/body/sticks", drawn, static=True)
        if stage.axis_length:
            _draw_axes(recording, stage)
        for arrow in stage.arrows:
            colors = [arrow.color]
            style: list[rr.AsComponents] = [rr.Arrows3D.from_fields(colors=colors, radii=[arrow.radius])]
            if arrow.label:  # at its tip, of the same entity: an entity of its own would repeat every time
                words: dict[str, Any] = {"labels": [arrow.label], "show_labels": True}
                style.append(rr.Points3D.from_fields(colors=colors, radii=[0.0], **words))
            recording.log(_arrow_path(stage, arrow), *style, static=True)
        for trail in stage.trails:
            _draw_trail_static(recording, trail_path(stage, trail), trail)
        for cone in stage.cones:
            _draw_cone_static(recording, _cone_path(stage, cone), cone)
        _draw_surroundings(recording, stage)


def _draw_mesh(recording: rr.RecordingStream, path: str, mesh: Mesh, edges: bool = True) -> None:
    worn: dict[str, Any] = {"vertex_colors": mesh.colors}
    if mesh.picture is not None:
        worn = {"albedo_texture": mesh.picture, "vertex_texcoords": mesh.places}
    surface = rr.Mesh3D(
        vertex_positions=mesh.vertices.astype(np.float32), triangle_indices=mesh.triangles, **worn
    )
    recording.log(path, surface, static=True)
    sharp = sharp_edges(mesh) if edges else np.empty((0, 2, 3))
    if len(sharp):
        strips = rr.LineStrips3D(sharp.astype(np.float32), colors=[_EDGE], radii=rr.Radius.ui_points(0.9))
        recording.log(f"{path}/edges", strips, static=True)


def _draw_axes(recording: rr.RecordingStream, stage: Stage) -> None:
    length = stage.axis_length
    axes = rr.Arrows3D(vectors=np.eye(3) * length, colors=_AXIS_COLORS, radii=0.011 * length)
    recording.log(f"/{stage.root}/body/axes", axes, static=True)
    if stage.arrows or stage.frames:
        # Labels of arrows sit at their middle, inside the body: invisible points carry them.
        words: dict[str, Any] = {"labels": ["x", "y", "z"], "show_labels": True}
        labels = rr.Points3D(np.eye(3) * length * 1.07, colors=_AXIS_COLORS, radii=0.0, **words)
        recording.log(f"/{stage.root}/body/axes/labels", labels, static=True)


def _draw_surroundings(recording: rr.RecordingStream, stage: Stage) -> None:
    root = f"/{stage.root}"

    def at(place: str, name: str) -> str:
        return f"{root}/{place}/around/{name}" if place else f"{root}/around/{name}"

    for solid in stage.solids:
        _draw_mesh(recording, at(solid.place, solid.name), solid.mesh, edges=False)
    # Lines of one kind together: the viewer is slowed by entities, not by strips.
    together: dict[tuple[object, ...], list[Line]] = {}
    for line in stage.lines:
        folder = line.name.partition("/")[0]
        key = (line.place, folder, line.color, line.width, line.strength)
        together.setdefault(key, []).append(line)
    for lines in together.values():
        first = lines[0]
        strips = rr.LineStrips3D(
            [line.points.astype(np.float32) for line in lines],
            colors=[(*first.color, round(255 * first.strength))],
            radii=rr.Radius.ui_points(first.width / 2),
        )
        recording.log(at(first.place, first.name), strips, static=True)
    for vector in stage.vectors:
        path = at(vector.place, vector.name)
        arrow = rr.Arrows3D(
            vectors=[vector.along], origins=[vector.start], colors=[vector.color], radii=vector.radius
        )
        recording.log(path, arrow, static=True)
        tip = vector.start + 1.07 * vector.along
        _draw_label(recording, f"{path}/label", vector.label, vector.color, tip)
    for spot in stage.spots:
        _draw_label(recording, at(spot.place, spot.name), spot.label, spot.color, spot.position, spot.size)
    for shell in stage.shells:
        _draw_shell(recording, at(shell.place, shell.name), shell)
    if stage.origin:
        _draw_label(recording, f"{root}/origin", "origin", (230, 230, 230), np.zeros(3), 5.0)


def _draw_shell(recording: rr.RecordingStream, path: str, shell: Shell) -> None:
    """A translucent ellipsoid with its meridians and parallels."""
    turn = rr.Transform3D(quaternion=rr.Quaternion(xyzw=shell.quaternion))
    recording.log(path, turn, static=True)
    surface = ball(*shell.half_sizes)
    mesh = rr.Mesh3D(
        vertex_positions=surface.vertices.astype(np.float32),
        triangle_indices=surface.triangles,
        vertex_normals=surface.normals.astype(np.float32),
        albedo_factor=(*shell.color, 70),
    )
    recording.log(f"{path}/surface", mesh, static=True)
    rings = [line.astype(np.float32) for line in graticule(shell.half_sizes, lift=1.0)]
    lines = rr.LineStrips3D(rings, colors=[(*shell.color, 130)], radii=rr.Radius.ui_points(0.5))
    recording.log(f"{path}/lines", lines, static=True)


def _draw_label(
    recording: rr.RecordingStream, path: str, label: str, color: Color, place: Any, size: float = 0.0
) -> None:
    radius = rr.Radius.ui_points(size) if size else 0.0
    point = rr.Points3D([place], colors=[color], labels=[label], show_labels=True, radii=radius)
    recording.log(path, point, static=True)


def _draw_trail_static(recording: rr.RecordingStream, path: str, trail: Trail) -> None:
    dark = tuple(round(_DIM * x + (1 - _DIM) * 20) for x in trail.color)
    if len(trail.whole) > 1 and not trail.lasting:
        whole = (
            rr.LineStrips3D([trail.whole], colors=[dark], radii=rr.Radius.ui_points(0.8))
            if joined(trail.whole, NEAR)
            else rr.Points3D(trail.whole, colors=[dark], radii=rr.Radius.ui_points(1.0))
        )
        recording.log(f"{path}/whole", whole, static=True)
    styles: list[tuple[str, Any, float]] = [("recent", rr.LineStrips3D if trail.line else rr.Points3D, 1.8)]
    if trail.head:
        styles.append(("head", rr.Points3D, 4.5))
    for name, kind, size in styles:
        style = kind.from_fields(colors=[trail.color], radii=rr.Radius.ui_points(size))
        recording.log(f"{path}/{name}", style, static=True)


def _draw_cone_static(recording: rr.RecordingStream, path: str, cone: Cone) -> None:
    count = cone.rim.shape[1]
    sides = []
    for number, _ in enumerate(cone.rims):
        corners = 1 + number * count + np.arange(count, dtype=np.uint32)  # 0 is the apex
        sides.append(np.stack([np.zeros_like(corners), corners, np.roll(corners, -1)], axis=1))
    surface = rr.Mesh3D.from_fields(
        triangle_indices=np.concatenate(sides), albedo_factor=(*cone.color, _CLEAR)
    )
    recording.log(f"{path}/surface", surface, static=True)
    edge = rr.LineStrips3D.from_fields(colors=[cone.color], radii=rr.Radius.ui_points(0.9))
    recording.log(f"{path}/rim", edge, static=True)


def _cone_columns(cone: Cone, path: str, rows: slice) -> Iterable[tuple[str, slice, Columns]]:
    rims = np.stack([rim[rows] for rim in cone.rims], axis=1).astype(np.float32)  # (rows, sides, corners, 3)
    count, sides, corners, _ = rims.shape
    vertices = np.zeros((count, 1 + sides * corners, 3), dtype=np.float32)
    vertices[:, 1:] = rims.reshape(count, -1, 3)
    surface = rr.Mesh3D.columns(vertex_positions=vertices.reshape(-1, 3))
    yield f"{path}/surface", rows, surface.partition([vertices.shape[1]] * count)
    closed = np.concatenate([rims, rims[:, :, :1]], axis=2).reshape(count * sides, corners + 1, 3)
    edges = rr.LineStrips3D.columns(strips=list(closed))
    yield f"{path}/rim", rows, edges.partition([sides] * count)


def stage_columns(stage: Stage, rows: slice) -> Iterable[tuple[str, slice, Columns]]:
    """Entities of a stage with their rows (of the run) and columns, for the rows of one chunk."""
    root = f"/{stage.root}"
    # Translation and rotation in one call: apart, the viewer would see states that never were.
    transform: dict[str, Any] = {}
    if stage.translation is not None:
        transform["translation"] = stage.translation[rows].astype(np.float32)
        centre = rr.Transform3D.columns(translation=transform["translation"])
        if any(trail.with_centre for trail in stage.trails) or stage.arrows:
            yield f"{root}/centre", rows, centre
    if stage.quaternion is not None and not stage.turns_with:
        transform["quaternion"] = stage.quaternion[rows]
    if transform:
        yield f"{root}/body", rows, rr.Transform3D.columns(**transform)
    for name, turning in stage.frames.items():
        placed: dict[str, Any] = {"quaternion": turning[rows]}
        if stage.flat and name == stage.looked_from:
            placed["scale"] = np.tile(
                np.array([_STRETCH, 1.0, 1.0], dtype=np.float32), (len(turning[rows]), 1)
            )
        yield f"{root}/{name}", rows, rr.Transform3D.columns(**placed)
    for arrow in stage.arrows:
        picked = _every(rows, arrow.stride)
        vectors = arrow.vectors[picked].astype(np.float32)
        columns = [*rr.Arrows3D.columns(vectors=vectors)]
        if arrow.label:
            columns += rr.Points3D.columns(positions=vectors * np.float32(arrow.label_at))
        yield _arrow_path(stage, arrow), picked, columns
    for trail in stage.trails:
        path, stride = trail_path(stage, trail), trail.stride
        picked = _every(rows, stride)
        if trail.head:
            head = trail.points[rows].astype(np.float32)
            yield f"{path}/head", rows, rr.Points3D.columns(positions=head)
        if not trail.line:
            points = trail.points[picked].astype(np.float32)
            yield f"{path}/recent", picked, rr.Points3D.columns(positions=points)
            continue
        strips = _pieces(trail.points, picked, stride)
        yield f"{path}/recent", picked, rr.LineStrips3D.columns(strips=strips)
    for cone in stage.cones:
        yield from _cone_columns(cone, _cone_path(stage, cone), rows)


def _every(rows: slice, stride: int) -> slice:
    return slice(-(-rows.start // stride) * stride, rows.stop, stride)


def _pieces(points: Array, rows: slice, stride: int) -> pa.Array:
    """For each row, a strip from the point `stride` rows before; built at once in Arrow."""
    ends = np.arange(rows.start, rows.stop, rows.step or 1)
    flat = points[np.maximum(ends[:, None] - [stride, 0], 0)].astype(np.float32).ravel()
    kind = rr.components.LineStrip3DBatch._ARROW_DATATYPE
    offsets = pa.array(np.arange(len(ends) + 1, dtype=np.int32) * 2)
    inner = pa.FixedSizeListArray.from_arrays(pa.array(flat), type=kind.value_type)
    return pa.ListArray.from_arrays(offsets, inner, type=kind)


def _arrow_path(stage: Stage, arrow: Arrow) -> str:
    return f"/{stage.root}/{BODY if arrow.in_body else 'centre'}/{arrow.name}"


def _cone_path(stage: Stage, cone: Cone) -> str:
    return f"/{stage.root}/{BODY}/{cone.name}"
