"""Parts of a stage as numbers: what is drawn, where, in which unit.

The viewer works in float32, so everything is brought to units of order one here, in float64: lengths in units
of the body's reach (largest distance of a drawn point from the reference point) or of an orbit, arrows by one
constant factor each.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import xarray
from numpy.typing import NDArray

from rigidsim.look.plots import Plot
from rigidsim.look.signals import across, finite_rows, joined, norms, seconds, values
from rigidsim.look.solids import Array, Color, Mesh
from rigidsim.look.thinning import thinned_indices

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
class Arrow:
    """A vector along time: (rows, 3) in stage units, from the reference point, fixed to space or the body.
    Those with `words` are in the legend; the label stands at so many lengths, with a ball of some radius.
    """

    name: str
    label: str
    color: Color
    vectors: Array
    in_body: bool
    words: str = ""
    label_at: float = 1.07
    radius: float = 0.024
    ball: float = 0.0

    @cached_property
    def stride(self) -> int:
        """Stride between drawn rows."""
        return _stride_of(self.vectors, _STILL)


@dataclass(frozen=True)
class Trail:
    """A moving point along time: (rows, 3) in stage units; with `head` it is marked itself."""

    name: str
    color: Color
    points: Array
    in_body: bool = False
    with_centre: bool = False
    words: str = ""
    head: bool = False
    lasting: int = 0  # rows in its bright part, of one that isn't drawn whole; 0 for those of any other

    @cached_property
    def whole(self) -> Array:
        """Its thinned path (points, 3)."""
        return finite_rows(self.points[thinned_indices(len(self.points), CURVE_POINTS)])

    @cached_property
    def line(self) -> bool:
        """Whether neighbours are close enough to be joined."""
        return joined(self.points, NEAR)

    @cached_property
    def stride(self) -> int:
        """Stride between the ends of its pieces; a cloud of points needs no more of them."""
        if self.line:
            return _stride_of(self.points - self.whole.mean(axis=0), _SMOOTH)
        return -(-len(self.points) // SCENE_ROWS)


@dataclass(frozen=True)
class Line:
    """A curve (points, 3) that doesn't change, in units of the stage, `width` points of the screen wide."""

    name: str
    color: Color
    points: Array
    place: str = SPACE
    width: float = 1.2
    strength: float = 1.0
    words: str = ""


@dataclass(frozen=True)
class Spot:
    """A labelled point (3,) that doesn't change; `size` points of the screen, 0 for the label alone."""

    name: str
    label: str
    color: Color
    position: Array
    place: str = SPACE
    size: float = 0.0


@dataclass(frozen=True)
class Vector:
    """An arrow that doesn't change, from `start` (3,) along `along` (3,), in units of the stage."""

    name: str
    label: str
    color: Color
    start: Array
    along: Array
    place: str = SPACE
    words: str = ""
    radius: float = 0.018


@dataclass(frozen=True)
class Solid:
    """A mesh placed on the stage, in its units; with a colour a translucent one."""

    name: str
    mesh: Mesh
    place: str = SPACE
    clear: Color | None = None


@dataclass(frozen=True)
class Cone:
    """A translucent cone along time, from the reference point to the corners (rows, corners, 3) of its rim,
    stage units, body axes; the body carries it. A double one has another to the other side; one whose rim is
    at the reference point isn't seen.
    """

    name: str
    color: Color
    rim: Array
    words: str
    double: bool = True

    @property
    def rims(self) -> list[Array]:
        """Its rim, and of a double cone the other side's rim."""
        return [self.rim, -self.rim] if self.double else [self.rim]


@dataclass(frozen=True)
class Camera:
    """The eye, what it looks at, and the upward direction, (3,) each, in the frame looked from."""

    position: Array
    target: Array
    up: Array


@dataclass(frozen=True)
class Stage:
    """One scene to be drawn under the entity `root`."""

    root: str
    title: str
    unit: float  # metres per unit of length
    meshes: list[Mesh] = field(default_factory=list)  # of the body, body axes, stage units
    points: Array = field(default_factory=lambda: np.zeros((0, 3)))  # masses, joined to the reference point
    axis_length: float = 0.0  # of the body axes; 0 for none
    quaternion: NDArray[np.float32] | None = None  # (rows, 4) x y z w; None: no attitude
    translation: Array | None = None  # (rows, 3), of the reference point; None: it stays at the origin
    arrows: list[Arrow] = field(default_factory=list)
    trails: list[Trail] = field(default_factory=list)
    origin: bool = False  # whether the origin of space is in the picture and marked
    lines: list[Line] = field(default_factory=list)
    spots: list[Spot] = field(default_factory=list)
    vectors: list[Vector] = field(default_factory=list)
    solids: list[Solid] = field(default_factory=list)
    cones: list[Cone] = field(default_factory=list)
    frames: dict[str, NDArray[np.float32]] = field(default_factory=dict)  # quaternions of others, by name
    looked_from: str = ""  # frame that the camera is in; empty for space
    flat: bool = False  # that frame is stretched along its x axis, as for an eye far away on it
    turns_with: str = ""  # root of a stage whose body turns alike about the same point (written once)
    camera: Camera | None = None  # None for the one that suits arrows and path


@dataclass(frozen=True)
class Picture:
    """Everything in three dimensions that is drawn of a dataset: the kind of scene in words, the body's stage
    first, notes on scales for a page, and plots that show what is on the stage alone.
    """

    kind: str
    stages: list[Stage]
    notes: list[str] = field(default_factory=list)
    plots: list[Plot] = field(default_factory=list)


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


def viewer_quaternion(quaternion: Array) -> NDArray[np.float32]:
    """Quaternions (rows, 4) w x y z of any norm in the viewer's form: x y z w, unit, float32."""
    # Normalised in float64 first: the viewer takes the float32 numbers as they are.
    unit = quaternion / np.sqrt(np.einsum("ij,ij->i", quaternion, quaternion))[:, None]
    return np.ascontiguousarray(unit[:, [1, 2, 3, 0]], dtype=np.float32)


def circle(radius: float, normal: Array, center: Array | None = None) -> Array:
    """Points (121, 3) of a circle about an axis."""
    first, second = across(normal / np.linalg.norm(normal))
    angle = np.linspace(0, 2 * np.pi, 121)[:, None]
    ring = radius * (np.cos(angle) * first + np.sin(angle) * second)
    return np.asarray(ring if center is None else ring + center)


def grid(
    name: str,
    center: Array,
    first: Array,
    second: Array,
    size: float,
    count: int,
    strength: float,
    *,
    round_: bool = False,
) -> list[Line]:
    """Lines of a square or round grid along two unit vectors, so many to either side of its center."""
    lines = []
    for k in range(-count, count + 1):
        at = size * k / count
        half = np.sqrt(size**2 - at**2) if round_ else size
        for letter, u, v in (("a", first, second), ("b", second, first)):
            ends = np.stack([center + at * u - half * v, center + at * u + half * v])
            lines.append(Line(f"{name}/{letter}{k + count}", FAINT, ends, SPACE, 0.7, strength))
    return lines
