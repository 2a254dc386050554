"""Stage of a globe as its source sees it, as the Moon from the Earth: librations are the wobble of its disc.

The frame turns with the direction to the source, and the mean figure axis is up. It is stretched along the
line of sight, so that the eye sees all that is seen from far away, to the limb.
"""

from dataclasses import replace

import numpy as np
import xarray

from rigidsim.look import sources
from rigidsim.look.curves import loop_rows
from rigidsim.look.record import called
from rigidsim.look.solids import Array
from rigidsim.look.stages import parts
from rigidsim.look.stages.bodies import FIELD, Subject
from rigidsim.look.stages.parts import BODY, Camera, Line, Spot, Stage, Trail
from rigidsim.scene.rotations import quaternion_of

EYE = "eye"
_LIFT = 1.012  # of the point under the source, in radii
_MARK = 0.03  # radius of the ring about longitude and latitude zero


def facing(dataset: xarray.Dataset, subject: Subject, figure: Array) -> tuple[Stage, str] | None:
    """Stage and note of a globe that faces its strongest source at the end of the run; None for others."""
    found = sources.seen(dataset)
    if found is None or not np.isfinite(found.directions).all() or not found.stays(found.last):
        return None
    source = called(found.body, found.name)
    point = f"sub-{found.body.name if found.body else 'source'} point"
    loop = loop_rows(found.coordinates(figure)[:, 1])
    stage = _stage(subject, found.directions, figure, source, point, loop)
    seen_as = f"seen from the direction of {source}, from far away, the mean figure axis upwards"
    note = f"{stage.title}: {seen_as}; nothing is exaggerated"
    if subject.attitude is None:
        note += "; no attitude was recorded, so that the figure axis stays upright"
    return stage, note


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
