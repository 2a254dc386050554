"""Stages to rerun entities: what never changes, and the columns of what does.

Imports rerun when it is loaded, so load it only where a timeline is written.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from rigidsim.look.plots import Plot
from rigidsim.look.stage import Color, Stage, Trail

PIXELS = 500  # about the width of a plot
LABEL_REACH = 1.07  # of a label, in lengths of its arrow
_AXIS_COLORS = [(235, 70, 60), (90, 200, 90), (80, 130, 250)]


def plot_path(plot: Plot, name: str) -> str:
    """Entity of one variable in one plot."""
    folder = "/plots/drift/" if plot.place == "drift" else "/plots/"
    return folder + rr.escape_entity_path_part(name)


def trail_path(stage: Stage, trail: Trail) -> str:
    """Entity of a trail: attached to the body, to its reference point or to space."""
    place = "/body" if trail.in_body else "/centre" if trail.with_centre else ""
    return f"/{stage.root}{place}/{trail.name}"


def draw_static(recording: rr.RecordingStream, stages: Sequence[Stage]) -> None:
    """Bodies, axes, styles and whole curves: logged once, valid for all times."""
    for stage in stages:
        root = f"/{stage.root}"
        recording.log(root, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for number, mesh in enumerate(stage.meshes):
            recording.log(
                f"{root}/body/solids/{number}",
                rr.Mesh3D(
                    vertex_positions=mesh.vertices.astype(np.float32),
                    triangle_indices=mesh.triangles,
                    vertex_normals=mesh.normals.astype(np.float32),
                    vertex_colors=mesh.colors,
                ),
                static=True,
            )
        if len(stage.points):
            sticks = np.stack([np.zeros_like(stage.points), stage.points], axis=1)
            recording.log(
                f"{root}/body/sticks",
                rr.LineStrips3D(sticks, colors=[(190, 190, 190)], radii=0.012 * stage.axis_length),
                static=True,
            )
        recording.log(
            f"{root}/body/axes",
            rr.Arrows3D(
                vectors=np.eye(3) * stage.axis_length,
                colors=_AXIS_COLORS,
                radii=0.011 * stage.axis_length,
            ),
            static=True,
        )
        if stage.arrows:
            # Labels of arrows sit at their middle, inside the body: invisible points carry them.
            recording.log(
                f"{root}/body/axes/labels",
                rr.Points3D(
                    np.eye(3) * stage.axis_length * LABEL_REACH,
                    colors=_AXIS_COLORS,
                    labels=["x", "y", "z"],
                    show_labels=True,
                    radii=0.0,
                ),
                static=True,
            )
        for arrow in stage.arrows:
            path = _arrow_path(stage, arrow.name, arrow.in_body)
            recording.log(path, rr.Arrows3D.from_fields(colors=[arrow.color], radii=[0.024]), static=True)
            label = rr.Points3D.from_fields(
                colors=[arrow.color], labels=[arrow.label], show_labels=True, radii=[0.0]
            )
            recording.log(f"{path}/label", label, static=True)
        for trail in stage.trails:
            _draw_trail_static(recording, trail_path(stage, trail), trail)
        if stage.origin:
            recording.log(
                f"{root}/origin",
                rr.Points3D(
                    [(0.0, 0.0, 0.0)],
                    colors=[(230, 230, 230)],
                    radii=rr.Radius.ui_points(5.0),
                    labels=["origin"],
                ),
                static=True,
            )


def draw_rows(
    recording: rr.RecordingStream,
    stages: Sequence[Stage],
    plots: Sequence[Plot],
    times: list[rr.TimeColumn],
    rows: slice,
) -> None:
    """Everything that changes, for the rows of one chunk."""
    for stage in stages:
        for path, columns in _stage_columns(stage, rows):
            recording.send_columns(path, indexes=times, columns=columns)
    for plot in plots:
        for series in plot.series:
            recording.send_columns(
                plot_path(plot, series.name),
                indexes=times,
                columns=rr.Scalars.columns(scalars=series.values[rows]),
            )


def draw_plot_styles(recording: rr.RecordingStream, plots: Sequence[Plot]) -> None:
    """Names and colours of the curves."""
    for plot in plots:
        for series in plot.series:
            recording.log(
                plot_path(plot, series.name),
                rr.SeriesLines(
                    names=series.labels,
                    colors=series.colors,
                    widths=[1.5] * len(series.labels),
                    aggregation_policy=_aggregation(plot, series.values),
                ),
                static=True,
            )


def _aggregation(plot: Plot, values: NDArray[np.float64]) -> rr.components.AggregationPolicy:
    """What the viewer draws of the rows that fall into one pixel.

    Its default is their average, which is smooth, but shows a fast rotation with a vanishing
    amplitude: then the extremes are drawn. Of a drift only the largest is of interest.
    """
    if plot.place == "drift":
        return rr.components.AggregationPolicy.Max
    step = max(len(values) // PIXELS, 1)
    change = np.abs(values[step:] - values[:-step]) if len(values) > step else np.zeros(1)
    range_ = np.nanmax(values) - np.nanmin(values) if np.isfinite(values).any() else 0.0
    smooth = not np.isfinite(change).any() or np.nanmax(change) <= 0.1 * range_
    policies = rr.components.AggregationPolicy
    return policies.Average if smooth else policies.MinMax


def _stage_columns(stage: Stage, rows: slice) -> Iterable[tuple[str, Iterable[rr.ComponentColumn]]]:
    root = f"/{stage.root}"
    # Translation and rotation in one call: apart, the viewer would see states that never were.
    transform: dict[str, Any] = {}
    if stage.translation is not None:
        transform["translation"] = stage.translation[rows].astype(np.float32)
        centre = rr.Transform3D.columns(translation=transform["translation"])
        if any(trail.with_centre for trail in stage.trails) or stage.arrows:
            yield f"{root}/centre", centre
    if stage.quaternion is not None:
        transform["quaternion"] = stage.quaternion[rows]
    if transform:
        yield f"{root}/body", rr.Transform3D.columns(**transform)
    for arrow in stage.arrows:
        path = _arrow_path(stage, arrow.name, arrow.in_body)
        vectors = arrow.vectors[rows].astype(np.float32)
        yield path, rr.Arrows3D.columns(vectors=vectors)
        tips = vectors * np.float32(LABEL_REACH)
        yield f"{path}/label", rr.Points3D.columns(positions=tips)
    for trail in stage.trails:
        path = trail_path(stage, trail) + "/recent"
        if trail.line:
            yield path, rr.LineStrips3D.columns(strips=_segments(trail.points, rows))
        else:
            points = trail.points[rows].astype(np.float32)
            yield path, rr.Points3D.columns(positions=points)


def _segments(points: NDArray[np.float64], rows: slice) -> pa.Array:
    """One strip of two points per row, from the row before; made in Arrow, not row by row."""
    stop = points[rows]
    start = (
        points[max(rows.start - 1, 0) : rows.stop - 1]
        if rows.start
        else np.vstack([points[:1], points[: rows.stop - 1]])
    )
    flat = np.stack([start, stop], axis=1).astype(np.float32).ravel()
    kind = rr.components.LineStrip3DBatch._ARROW_DATATYPE
    offsets = pa.array(np.arange(len(stop) + 1, dtype=np.int32) * 2)
    inner = pa.FixedSizeListArray.from_arrays(pa.array(flat), type=kind.value_type)
    return pa.ListArray.from_arrays(offsets, inner, type=kind)


def _draw_trail_static(recording: rr.RecordingStream, path: str, trail: Trail) -> None:
    dark: Color = tuple(int(0.42 * part) for part in trail.color)  # type: ignore[assignment]
    if len(trail.whole) > 1:
        whole = (
            rr.LineStrips3D([trail.whole], colors=[dark], radii=rr.Radius.ui_points(1.0))
            if trail.whole_line
            else rr.Points3D(trail.whole, colors=[dark], radii=rr.Radius.ui_points(1.2))
        )
        recording.log(f"{path}/whole", whole, static=True)
    style = (
        rr.LineStrips3D.from_fields(colors=[trail.color], radii=rr.Radius.ui_points(2.2))
        if trail.line
        else rr.Points3D.from_fields(colors=[trail.color], radii=rr.Radius.ui_points(2.0))
    )
    recording.log(f"{path}/recent", style, static=True)


def _arrow_path(stage: Stage, name: str, in_body: bool) -> str:
    return f"/{stage.root}/{'body' if in_body else 'centre'}/{name}"
