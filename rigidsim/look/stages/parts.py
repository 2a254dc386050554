"""Stages and their parts: what is drawn, where, in which unit, as entities of the viewer.

The viewer works in float32, so everything is brought to units of order one here, in float64: lengths in units
of the body's reach (largest distance of a drawn point from the reference point) or of an orbit, arrows by one
constant factor each. A part has its path below the root of its stage, what holds for all times, and columns
of what changes.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
import xarray
from numpy.typing import NDArray

from rigidsim.look.curves import Plot
from rigidsim.look.signals import across, finite_rows, joined, norms, seconds, values
from rigidsim.look.solids import Array, Color, Mesh, sharp_edges
from rigidsim.look.thinning import thinned_indices

Rows = slice | NDArray[np.int64]
Columns = Iterable[rr.ComponentColumn]

SPACE, BODY, CENTRE = "", "body", "centre"
"""Where a part is attached: to space, to the body, to its reference point, or to a frame by its name."""

ARROW_REACH = 1.6  # length of the longest arrow, in units of the body's reach
AXIS_REACH = 1.15  # of the body axes
CURVE_POINTS = 4000  # of a whole polhode or track
NEAR = 0.35  # radii of a path between neighbours that are joined
SCENE_ROWS = 20_000  # above which arrows and trails are thinned, if their motion allows it
_LEAST_SECONDS, _MOST_SECONDS = 10.0, 60.0  # that playing a whole run takes
_TURN_SECONDS = 3.0  # per turn of the body, when the run has few enough turns for it
_STILL = 0.01  # of an arrow's length, by which it may move between rows that are drawn
_SMOOTH = 0.2  # of a trail's radius, between its corners: some thirty a turn
_DIM = 0.26  # of a trail's brightness: the whole curve
_EDGE: Color = (12, 14, 20)
_AXIS_COLORS = [(235, 70, 60), (90, 200, 90), (80, 130, 250)]

MOMENTUM: Color = (255, 196, 40)
VELOCITY: Color = (90, 215, 235)
OF_CORE: Color = (255, 150, 60)
POLHODE: Color = (240, 100, 175)
TRACK: Color = (150, 205, 110)
PULL: Color = (255, 120, 70)
SOURCE: Color = (255, 214, 110)
FAINT: Color = (120, 128, 142)
PALE: Color = (205, 210, 218)
FIGURE: Color = (120, 165, 255)


@dataclass(frozen=True)
class Part:
    """An entity of a stage.

    Attributes:
        path: below the stage's root.
        static: what holds for all times. columns: of given rows, what changes; None if nothing does.
        values: (rows, ...) of what changes, or of what stands, in units of the stage.
        words, color: in the legend, if there are words.
        stride: between rows that are drawn; only: the rows that are drawn, if not those.
        lasting: rows in the bright end of a trail; 0 for any other trail; None of anything else.
    """

    path: str
    static: Sequence[rr.AsComponents] = ()
    columns: Callable[[Rows], Columns] | None = None
    values: Array = field(default_factory=lambda: np.empty(0))
    words: str = ""
    color: Color = PALE
    stride: int = 1
    only: NDArray[np.int64] | None = None
    lasting: int | None = None

    @property
    def is_arrow(self) -> bool:
        """Whether it is an arrow that moves."""
        return self.columns is not None and isinstance(next(iter(self.static), None), rr.Arrows3D)

    def picked(self, rows: slice) -> Rows:
        """Which of some rows are drawn."""
        if self.only is not None:
            return self.only[(rows.start <= self.only) & (self.only < rows.stop)]
        return slice(-(-rows.start // self.stride) * self.stride, rows.stop, self.stride)


@dataclass(frozen=True)
class Camera:
    """The eye, what it looks at, and the upward direction, (3,) each, in the frame looked from."""

    position: Array
    target: Array
    up: Array


@dataclass(frozen=True)
class Stage:
    """One scene to be drawn under the entity `root`.

    Attributes:
        unit: metres per unit of length.
        size: reach of its body; 0 without one. track: (rows, 3) of that's reference point, if it moves.
        looked_from: frame that the camera is in; empty for space.
        flat: that frame is stretched along its x axis, as for an eye far away on it.
        camera: None for the one that suits arrows and track.
    """

    root: str
    title: str
    unit: float
    parts: list[Part]
    size: float = 0.0
    track: Array | None = None
    looked_from: str = ""
    flat: bool = False
    camera: Camera | None = None


@dataclass(frozen=True)
class Picture:
    """Everything in three dimensions that is drawn of a dataset: the kind of scene in words, the body's stage
    first, notes on scales for a page, and plots that show what is on the stage alone.
    """

    kind: str
    stages: list[Stage]
    notes: list[str] = field(default_factory=list)
    plots: list[Plot] = field(default_factory=list)


def points_wide(width: float) -> Any:
    """A radius in points of the screen."""
    return rr.Radius.ui_points(width)


def around(place: str, name: str) -> str:
    """Path of what stands around the body, in space or a frame."""
    return f"{place}/around/{name}".lstrip("/")


def moving(kind: Any, **arrays: Any) -> Callable[[Rows], Columns]:
    """Columns of an archetype whose components are the rows of arrays."""
    return lambda rows: kind.columns(**{key: value[rows] for key, value in arrays.items()})


def frame(name: str, *, quaternion: Array | None = None, **placed: Array | None) -> list[Part]:
    """A frame, the body or its reference point, by quaternions (rows, 4) w x y z of any norm, and its
    `translation` and `scale` (rows, 3), as far as they aren't None.
    """
    # in one call: apart, the viewer would see states that never were
    given = {key: value.astype(np.float32) for key, value in placed.items() if value is not None}
    if quaternion is not None:
        # x y z w, normalised in float64 first: the viewer takes the float32 numbers as they are
        unit = (quaternion / norms(quaternion)[:, None])[:, [1, 2, 3, 0]]
        given["quaternion"] = np.ascontiguousarray(unit, dtype=np.float32)
    last = next(reversed(given.values()), np.empty(0))
    return [Part(name, (), moving(rr.Transform3D, **given), np.asarray(last, float))] if given else []


def arrow(
    name: str, label: str, color: Color, vectors: Array, words: str = "", *,
    place: str = CENTRE, label_at: float = 1.07, radius: float = 0.024, ball: float = 0.0,
) -> Part:  # fmt: skip
    """A vector (rows, 3) along time, from the reference point, in space or body axes; the label stands at so
    many lengths, with a ball of some radius.
    """

    def columns(rows: Rows) -> Columns:
        drawn = vectors[rows].astype(np.float32)
        tip = rr.Points3D.columns(positions=drawn * np.float32(label_at)) if label else ()
        return [*rr.Arrows3D.columns(vectors=drawn), *tip]

    static: list[rr.AsComponents] = [rr.Arrows3D.from_fields(colors=[color], radii=[radius])]
    if label:  # of the same entity: a separate label would repeat every time
        named: dict[str, Any] = {"labels": [label], "show_labels": True}
        static.append(rr.Points3D.from_fields(colors=[color], radii=[ball], **named))
    stride = _stride_of(vectors, _STILL)
    return Part(f"{place}/{name}", static, columns, vectors, words, color, stride)


def trail(
    name: str, color: Color, points: Array, words: str = "", *,
    place: str = SPACE, head: bool = False, lasting: int = 0,
) -> list[Part]:  # fmt: skip
    """A point (rows, 3) that moves along time: its whole path, dark, with the time just passed bright; with
    `head` it is marked itself, and with `lasting` so many rows are drawn alone.
    """
    path = f"{place}/{name}".lstrip("/")
    whole = finite_rows(points[thinned_indices(len(points), CURVE_POINTS)])
    line = joined(points, NEAR)
    # a cloud of points needs no more of them
    stride = _stride_of(points - whole.mean(axis=0), _SMOOTH) if line else -(-len(points) // SCENE_ROWS)
    dots = moving(rr.Points3D, positions=points.astype(np.float32))

    def pieces(rows: Rows) -> Columns:
        return rr.LineStrips3D.columns(strips=_pieces(points, rows, stride))

    def style(kind: Any, size: float) -> list[rr.AsComponents]:
        return [kind.from_fields(colors=[color], radii=points_wide(size))]

    found = []
    if len(whole) > 1 and not lasting:
        dark = [tuple(round(_DIM * x + (1 - _DIM) * 20) for x in color)]
        drawn = (
            rr.LineStrips3D([whole], colors=dark, radii=points_wide(0.8))
            if joined(whole, NEAR)
            else rr.Points3D(whole, colors=dark, radii=points_wide(1.0))
        )
        found.append(Part(f"{path}/whole", [drawn]))
    kind, shown = (rr.LineStrips3D, pieces) if line else (rr.Points3D, dots)
    recent = Part(f"{path}/recent", style(kind, 1.8), shown, points, words, color, stride, lasting=lasting)
    return [*found, recent, *([Part(f"{path}/head", style(rr.Points3D, 4.5), dots)] if head else [])]


def _pieces(points: Array, rows: Rows, stride: int) -> pa.Array:
    """For each row, a strip from the point `stride` rows before; built at once in Arrow."""
    ends = np.arange(len(points))[rows]
    flat = points[np.maximum(ends[:, None] - [stride, 0], 0)].astype(np.float32).ravel()
    kind = rr.components.LineStrip3DBatch._ARROW_DATATYPE
    offsets = pa.array(np.arange(len(ends) + 1, dtype=np.int32) * 2)
    inner = pa.FixedSizeListArray.from_arrays(pa.array(flat), type=kind.value_type)
    return pa.ListArray.from_arrays(offsets, inner, type=kind)


def lines(
    name: str, color: Color, strips: Sequence[Array], words: str = "", *,
    place: str = SPACE, width: float = 1.2, strength: float = 1.0,
) -> Part:  # fmt: skip
    """Curves (points, 3) that don't change, `width` points of the screen wide, as one entity: the viewer is
    slowed by entities, not by strips.
    """
    drawn = rr.LineStrips3D(
        [strip.astype(np.float32) for strip in strips],
        colors=[(*color, round(255 * strength))],
        radii=points_wide(width / 2),
    )
    return Part(around(place, name), [drawn], None, np.concatenate(strips), words, color)


def spot(name: str, label: str, color: Color, at: Array, place: str = SPACE, size: float = 0.0) -> Part:
    """A labelled point (3,) that doesn't change; `size` points of the screen, 0 for the label alone."""
    radii = points_wide(size) if size else 0.0
    drawn = rr.Points3D([at], colors=[color], labels=[label], show_labels=True, radii=radii)
    return Part(around(place, name), [drawn])


def fixed_arrow(
    name: str, label: str, color: Color, start: Array, way: Sequence[float] | Array, words: str = "", *,
    place: str = SPACE, radius: float = 0.018,
) -> list[Part]:  # fmt: skip
    """An arrow that doesn't change, from a point (3,) along a vector (3,)."""
    along = np.asarray(way, dtype=float)
    drawn = rr.Arrows3D(vectors=[along], origins=[start], colors=[color], radii=radius)
    labelled = spot(f"{name}/label", label, color, start + 1.07 * along, place)
    return [Part(around(place, name), [drawn], None, along, words, color), labelled]


def solid(path: str, mesh: Mesh, *, clear: Color | None = None) -> Part:
    """A mesh, in units of the stage; with a colour a translucent one."""
    # without normals the viewer shows a mesh's own colours from all sides
    worn: dict[str, Any] = {"vertex_colors": np.repeat(mesh.colors, 3, axis=0)}
    if mesh.picture is not None:
        worn = {"albedo_texture": mesh.picture, "vertex_texcoords": mesh.places.reshape(-1, 2)}
    if clear is not None:
        worn = {"albedo_factor": (*clear, 70), "vertex_normals": mesh.normals.reshape(-1, 3)}
    drawn = rr.Mesh3D(vertex_positions=mesh.vertices.astype(np.float32), **worn)
    return Part(path, [drawn], None, mesh.vertices)


def body(meshes: Sequence[Mesh], masses: Array, axes: float) -> list[Part]:
    """Meshes with their edges, point masses (P, 3) joined to the reference point, and body axes of a length,
    with their names if they are longer than the body.
    """
    found = []
    for number, mesh in enumerate(meshes):
        path, edges = f"{BODY}/solids/{number}", sharp_edges(mesh).astype(np.float32)
        found.append(solid(path, mesh))
        if len(edges):
            drawn = rr.LineStrips3D(edges, colors=[_EDGE], radii=points_wide(0.9))
            found.append(Part(f"{path}/edges", [drawn]))
    if len(masses):
        width = 0.014 * (float(np.abs(masses).max()) or 1.0)
        sticks = np.stack([np.zeros_like(masses), masses], axis=1)
        drawn = rr.LineStrips3D(sticks, colors=[(190, 190, 190)], radii=width)
        found.append(Part(f"{BODY}/sticks", [drawn]))
    if axes:
        ends = np.eye(3) * axes
        shafts = rr.Arrows3D(vectors=ends, colors=_AXIS_COLORS, radii=0.011 * axes)
        found.append(Part(f"{BODY}/axes", [shafts]))
        # labels of arrows sit at their middle, inside the body: invisible points carry them
        names = rr.Points3D(ends * 1.07, colors=_AXIS_COLORS, radii=0.0, labels=list("xyz"), show_labels=True)
        found += [Part(f"{BODY}/axes/labels", [names])] if axes > 1 else []
    return found


def _stride_of(points: Array, share: float) -> int:
    """Stride between drawn rows: several in a long run whose points move by at most a share of their size."""
    if len(points) > SCENE_ROWS:
        for stride in (16, 4):
            if np.abs(points[stride:] - points[:-stride]).max() <= share * np.abs(points).max():
                return stride
    return 1


def screen_seconds(dataset: xarray.Dataset) -> float:
    """Seconds on the screen in which a run is played: some for each turn of its body, as far as known."""
    rates = values(dataset, "angular_velocity")
    turns = 0.0
    if rates is not None and np.isfinite(rates).any():
        turns = float(np.nanmean(norms(rates)) * np.ptp(seconds(dataset))) / (2 * np.pi)
    return min(max(_TURN_SECONDS * turns, _LEAST_SECONDS), _MOST_SECONDS)


def longest(vectors: Array) -> float:
    """The largest norm of vectors (rows, 3); 0 if none is finite."""
    found = norms(vectors)
    return float(found[np.isfinite(found)].max(initial=0.0))


def circle(radius: float, normal: Array, center: Array | None = None) -> Array:
    """Points (121, 3) of a circle about an axis."""
    first, second = across(normal / np.linalg.norm(normal))
    angle = np.linspace(0, 2 * np.pi, 121)[:, None]
    ring = radius * (np.cos(angle) * first + np.sin(angle) * second)
    return np.asarray(ring if center is None else ring + center)


def grid(
    name: str, center: Array, first: Array, second: Array, size: float, count: int, strength: float, *,
    round_: bool = False,
) -> Part:  # fmt: skip
    """Lines of a square or round grid along two unit vectors, so many to either side of its center."""
    strips = []
    for at in size * np.arange(-count, count + 1) / count:
        half = np.sqrt(size**2 - at**2) if round_ else size
        for u, v in ((first, second), (second, first)):
            strips.append(np.stack([center + at * u - half * v, center + at * u + half * v]))
    return lines(f"{name}/a0", FAINT, strips, width=0.7, strength=strength)
