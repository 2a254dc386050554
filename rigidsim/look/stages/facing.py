"""Stage of a globe as its source sees it, as the Moon from the Earth: librations are the wobble of its disc.

The frame turns with the direction to the source, and the mean figure axis is up. It is stretched along the
line of sight, so that the eye sees all that is seen from far away, to the limb.
"""

from dataclasses import dataclass, replace

import numpy as np
import xarray

from rigidsim.look import librations, surroundings
from rigidsim.look.solids import Array
from rigidsim.look.stages import parts
from rigidsim.look.stages.bodies import FIELD, Subject
from rigidsim.look.stages.parts import BODY, Camera, Line, Plane, Spot, Stage, Trail
from rigidsim.look.stages.precession import plane_of
from rigidsim.scene.rotations import quaternion_of

EYE = "eye"
_LIFT = 1.012  # of the point under the source, in radii
_MARK = 0.03  # radius of the ring about longitude and latitude zero
_LOOPS = 3  # of its path that are shown bright
_WINDOW = 8  # times as many are shown of its coordinates
_LAST = 0.1  # of a run, in which a body must face its source for this stage


@dataclass(frozen=True)
class Facing:
    """A stage, a plane and variables of their own for plots; of a body that doesn't always face its source
    the stage alone.
    """

    stage: Stage
    plane: Plane | None
    derived: dict[str, xarray.DataArray]
    note: str


def facing(dataset: xarray.Dataset, subject: Subject, figure: Array) -> Facing | None:
    """Those of a globe that faces its strongest source at the end of the run; None for others."""
    found = librations.seen(dataset)
    if found is None or not np.isfinite(found.directions).all():
        return None
    rows = len(found.directions)
    if not found.stays(slice(-max(round(_LAST * rows), 2), None)):
        return None
    source = surroundings.called(found.body, found.name)
    point = f"sub-{found.body.name if found.body else 'source'} point"
    coordinates = found.coordinates(figure)
    stage = _stage(subject, found.directions, figure, source, point, _loop(coordinates[:, 1]))
    seen_as = f"seen from the direction of {source}, from far away, the mean figure axis upwards"
    note = f"{stage.title}: {seen_as}; nothing is exaggerated"
    if subject.attitude is None:
        note += "; no attitude was recorded, so that the figure axis stays upright"
    if not found.stays():
        return Facing(stage, None, {}, note)
    names = ("longitude", "latitude")
    plane = plane_of("sub_source_point", point[:1].upper() + point[1:], parts.SOURCE, coordinates, names)
    key, loop = point.replace(" ", "_"), _loop(coordinates[:, 1])
    derived = {key: angles(dataset, coordinates, names, loop)}
    physical = librations.librations(dataset)
    if physical is not None:
        columns = {"longitude": physical.longitude, "inclination": physical.inclination}
        columns["node × sin(inclination)"] = physical.node
        known = {word: angle for word, angle in columns.items() if angle is not None}
        table = np.stack(list(known.values()), axis=1)
        derived["physical_librations"] = angles(dataset, table, tuple(known), loop)
    return Facing(stage, plane, derived, note)


def _stage(
    subject: Subject, directions: Array, figure: Array, source: str, point: str, lasting: int
) -> Stage:
    attitude = subject.attitude
    toward = directions if attitude is None else np.einsum("tij,tj->ti", attitude, directions)
    up = figure if attitude is None else np.nanmean(attitude @ figure, axis=0)
    north = up - (toward @ up)[:, None] * toward
    north /= np.linalg.norm(north, axis=1, keepdims=True)
    frame = np.stack([toward, np.cross(north, toward), north], axis=2)
    track = Trail(
        "sub_source", parts.SOURCE, _LIFT * directions, in_body=True, words=point, head=True, lasting=lasting
    )
    upright = np.array([[0.0, 0.0, 1.03], [0.0, 0.0, 1.13]])
    limb = parts.circle(1.0, np.array([1.0, 0.0, 0.0]))
    words = "longitude and latitude zero"
    zero = np.eye(3)[(int(np.abs(figure).argmax()) + 1) % 3]
    stage = subject.stage([], [track], f"Seen from {source}")
    return replace(
        stage,
        root="face",
        turns_with="scene" if stage.quaternion is not None else "",
        axis_length=0.0,
        lines=[
            Line("limb", parts.FAINT, limb, EYE, 1.4, 0.8),
            Line("upright", parts.FAINT, upright, EYE, 2.0),
            Line("zero", parts.PALE, parts.circle(_MARK, zero, _LIFT * zero), BODY, 2.0, 1.0, words),
        ],
        spots=[
            Spot("north", "mean north", parts.FAINT, np.array([0.0, 0.0, 1.22]), EYE),
        ],
        frames={EYE: parts.viewer_quaternion(quaternion_of(frame))},
        looked_from=EYE,
        flat=True,
        camera=Camera(np.array([1.3 / np.tan(FIELD / 2), 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 1.0])),
    )


def _loop(latitude: Array) -> int:
    """Rows in some loops of a path that crosses the equator to and fro; 0 if it has few loops."""
    swing = latitude - np.mean(latitude)
    crossings = int(np.count_nonzero(swing[1:] * swing[:-1] < 0))
    return round(2 * _LOOPS * len(latitude) / crossings) if crossings > 8 * _LOOPS else 0


def angles(dataset: xarray.Dataset, table: Array, names: tuple[str, ...], loop: int = 0) -> xarray.DataArray:
    """A variable of angles (rows, n), rad, with these names; of a path of so many rows in some loops, plots
    show a window.
    """
    across = f"of_{'_'.join(names)}"
    coordinates = {"time": dataset["time"], across: list(names)}
    attributes = {"units": "rad", **({"shown_rows": _WINDOW * loop} if loop else {})}
    return xarray.DataArray(table, coordinates, ("time", across), attrs=attributes)
