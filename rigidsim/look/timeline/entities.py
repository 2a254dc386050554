"""Stages, plots, plane figures, states, the legend and the clock as rerun entities: static parts, and columns
of what changes.

Meshes are given no normals: the viewer then shows their own colours from all sides, and edges separate
the faces.
"""

from collections.abc import Iterable, Sequence
from itertools import cycle
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr

from rigidsim.look.paths import Path
from rigidsim.look.plots import Plot, screen
from rigidsim.look.signals import joined
from rigidsim.look.solids import Array, Color, Mesh, sharp_edges
from rigidsim.look.stages.parts import BODY, NEAR, Arrow, Cone, Line, Stage, Trail, Vector
from rigidsim.look.states import States

Columns = Iterable[rr.ComponentColumn]

_STRETCH = 25.0  # of a frame along the line of sight: perspective is a 25th of what it was
_EDGE: Color = (12, 14, 20)
_AXIS_COLORS = [(235, 70, 60), (90, 200, 90), (80, 130, 250)]
_CLEAR = 46  # of 255: of a cone, through which labels are read
_DIM = 0.26  # of a trail's brightness: the whole curve
CLOCK_ROWS = 2000  # largest number of rows of the clock on the screen
_INK: Color = (205, 210, 218)
_FAINT: Color = (90, 96, 108)
LEGEND_COLUMNS = 3
LEGEND_LINE = 0.78
"""Height of a line of the legend, which is 30 units wide: about 24 of 950 points of the screen."""


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
                style.append(rr.Points3D.from_fields(colors=colors, radii=[arrow.ball], **words))
            recording.log(_arrow_path(stage, arrow), *style, static=True)
        for trail in stage.trails:
            _draw_trail_static(recording, trail_path(stage, trail), trail)
        for cone in stage.cones:
            _draw_cone_static(recording, _cone_path(stage, cone), cone)
        _draw_surroundings(recording, stage)


def _draw_mesh(
    recording: rr.RecordingStream, path: str, mesh: Mesh, *, edges: bool = True, clear: Color | None = None
) -> None:
    worn: dict[str, Any] = {"vertex_colors": mesh.colors}
    if mesh.picture is not None:
        worn = {"albedo_texture": mesh.picture, "vertex_texcoords": mesh.places}
    if clear is not None:
        worn = {"albedo_factor": (*clear, 70), "vertex_normals": mesh.normals.astype(np.float32)}
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
        _draw_mesh(recording, at(solid.place, solid.name), solid.mesh, edges=False, clear=solid.clear)
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
    if stage.origin:
        _draw_label(recording, f"{root}/origin", "origin", (230, 230, 230), np.zeros(3), 5.0)


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


def plot_path(plot: Plot) -> str:
    """Entity of a plot."""
    return "/plots/" + rr.escape_entity_path_part(plot.name)


def draw_plots(recording: rr.RecordingStream, plots: Sequence[Plot], ends: list[rr.TimeColumn]) -> None:
    """Names and colours of the curves, and lines for values that hold for the whole run, at its ends."""
    for plot in plots:
        style: dict[str, Any] = {
            "names": [label or plot.title for label in plot.labels],
            "colors": [screen(hue) for hue, _ in zip(cycle(plot.hues), plot.labels, strict=False)],
            "widths": [1.5] * len(plot.labels),
        }
        look = (
            rr.SeriesLines(**style, aggregation_policy=aggregation(plot))
            if plot.error is None
            else rr.Measurements.from_fields(**style)
        )
        recording.log(plot_path(plot), look, static=True)
        for number, (label, value) in enumerate(plot.levels.items()):
            path = f"{plot_path(plot)}/level{number}"
            line = rr.SeriesLines(names=[label], colors=[screen("grey")], widths=[1.0])
            recording.log(path, line, static=True)
            scalars = [np.log10(value) if plot.log else value] * 2
            recording.send_columns(path, indexes=ends, columns=rr.Scalars.columns(scalars=scalars))


def draw_plot_rows(
    recording: rr.RecordingStream, plots: Sequence[Plot], times: list[rr.TimeColumn], rows: slice
) -> None:
    """The curves, for the rows of one chunk."""
    for plot in plots:
        values = shown_values(plot)[rows]
        columns: Any = rr.Scalars.columns(scalars=values)
        if plot.error is not None:  # a band of their uncertainty: the viewer draws the root of a variance
            count = values.shape[1]
            variances = np.repeat(plot.error[rows] ** 2, count)
            columns = rr.Measurements.columns(values=values.ravel(), variances=variances)
            columns = columns.partition([count] * len(values))
        recording.send_columns(plot_path(plot), indexes=times, columns=columns)


def shown_values(plot: Plot) -> Array:
    """Values as the viewer shows them: of what has a logarithmic axis the logarithms, and gaps for zeros."""
    if not plot.log:
        return plot.values
    return np.log10(plot.values, where=plot.values > 0, out=np.full_like(plot.values, np.nan))


def aggregation(plot: Plot) -> rr.components.AggregationPolicy:
    """What the viewer draws of rows that fall into one pixel: the extremes, as an average would show a fast
    rotation with a vanishing amplitude; of a drift only the largest counts.
    """
    policies = rr.components.AggregationPolicy
    return policies.Max if plot.place == "drift" else policies.MinMax


def draw_paths(recording: rr.RecordingStream, paths: Sequence[Path]) -> None:
    """Draw the static parts of plane figures: the whole path, circles, axes."""
    angle = np.linspace(0, 2 * np.pi, 121)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for path in paths:

        def log(name: str, part: rr.AsComponents, entity: str = f"/planes/{path.name}") -> None:
            recording.log(f"{entity}/{name}", part, static=True)

        finite = flipped(path.points[np.isfinite(path.points).all(axis=1)])
        whole = finite[:: max(len(finite) // 4000, 1)]
        bright = screen(path.hue)
        dim: Color = tuple(round(0.5 * x) for x in bright)  # type: ignore[assignment]
        if len(whole) > 1 and path.moves and not path.sparse and joined(whole, NEAR):
            log("whole", _faint([whole], color=dim, width=0.9, order=1.0))
        else:
            log("whole", rr.Points2D(whole, colors=[dim if path.moves else bright], radii=_points(1.6)))
        reach = path.reach
        power = 10.0 ** np.floor(np.log10(reach))
        step = next(s for s in (5, 2, 1, 0.5) if s * power <= 0.75 * reach) * power
        ends = [(1.1 * reach, 0), (0, -1.1 * reach)]
        log("axes", _faint([[(-x, -y), (x, y)] for x, y in ends]))
        log("axes/names", _texts(ends, list(path.labels)))
        for number in (1, 2):
            radius, at = number * step, 0.9 - 0.35 * (number % 2)  # neighbours' labels lie apart
            log(f"rings/{number}", _faint([radius * circle]))
            label = f"{radius:.3g} {path.unit}".strip()
            log(f"rings/{number}/label", _texts([(radius * np.cos(at), radius * np.sin(at))], [label]))
        if path.moves:
            log("now", rr.Points2D.from_fields(colors=[bright], radii=_points(5.0), draw_order=3.0))


def _points(size: float) -> Any:
    return rr.Radius.ui_points(size)


def _faint(strips: Any, *, color: Color = _FAINT, width: float = 0.5, order: float = -1.0) -> rr.LineStrips2D:
    return rr.LineStrips2D(strips, colors=[color], radii=_points(width), draw_order=order)


def _texts(places: Any, labels: list[str]) -> rr.Points2D:
    return rr.Points2D(places, labels=labels, colors=[_INK], radii=0.0, show_labels=True)


def draw_path_rows(
    recording: rr.RecordingStream, paths: Sequence[Path], times: list[rr.TimeColumn], rows: slice
) -> None:
    """The moving points of plane figures."""
    for path in paths:
        if path.moves:
            columns = rr.Points2D.columns(positions=flipped(path.points[rows]).astype(np.float32))
            recording.send_columns(f"/planes/{path.name}/now", indexes=times, columns=columns)


def flipped(points: Array) -> Array:
    """Plane points for the viewer, whose second axis points down."""
    return points * np.array([1.0, -1.0])


def legend_of(stages: Sequence[Stage]) -> list[tuple[str, Color]]:
    """Meaning of each colour, once."""
    found: dict[str, Color] = {}
    for stage in stages:
        parts: list[Arrow | Vector | Trail | Line | Cone]
        parts = [*stage.arrows, *stage.vectors, *stage.trails, *stage.lines, *stage.cones]
        for part in parts:
            if part.words:
                found.setdefault(part.words, part.color)
    return list(found.items())


def draw_legend(
    recording: rr.RecordingStream,
    entries: Sequence[tuple[str, Color]],
    clock: list[str],
    times: list[rr.TimeColumn],
) -> None:
    """Draw the legend as a plane figure, 30 units wide and one per line; first the scene's time in words, for
    some of the rows.
    """
    if entries:
        words = [f"■ {words}" for words, _ in entries]
        places = [_legend_place(number + 1) for number in range(len(entries))]
        colors = [color for _, color in entries]
        text = rr.Points2D(places, labels=words, colors=colors, radii=0.0, show_labels=True)
        recording.log("/legend/words", text, static=True)
    style = rr.Points2D.from_fields(colors=[_INK], radii=[0.0], show_labels=True)
    recording.log("/legend/clock", style, static=True)
    columns = rr.Points2D.columns(positions=[_legend_place(0)] * len(clock), labels=clock)
    recording.send_columns("/legend/clock", indexes=times, columns=columns)


def _legend_place(number: int) -> tuple[float, float]:
    width = 30.0 / LEGEND_COLUMNS
    return width * (number % LEGEND_COLUMNS + 0.5), LEGEND_LINE * (number // LEGEND_COLUMNS + 0.06)


def draw_states(recording: rr.RecordingStream, lane: States, times: list[rr.TimeColumn]) -> None:
    """Draw a lane of states over time."""
    path = f"/states/{rr.escape_entity_path_part(lane.name)}"
    values = sorted(set(lane.values))
    colors = [lane.colors[value] for value in values]
    recording.log(path, rr.StateConfiguration(values=values, labels=values, colors=colors), static=True)
    recording.send_columns(path, indexes=times, columns=rr.StateChange.columns(state=lane.values))
