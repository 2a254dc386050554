"""Stage of any other scene: the body with its momentum and angular velocity, and its track if it moves
far.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rigidsim.look.stages.bodies import Subject, source_arrows, vectors_of
from rigidsim.look.stages.parts import ARROW_REACH, TRACK, Picture, Stage, trail

if TYPE_CHECKING:
    from rigidsim.look.rows import Table

NEAR = 6.0  # reaches: a body that moves further gets a track view of its own
DISTANT = 30.0  # extents from the origin, beyond which the picture has an origin of its own
TRACK_BODY = 0.08  # reach of the enlarged body in the track view


def picture(dataset: Table, subject: Subject) -> Picture:
    """Picture of any scene."""
    arrows, trails, notes = vectors_of(dataset, subject)
    if subject.attitude is None:
        notes.append("no attitude was recorded: the body is shown in its own axes and doesn't turn")
    else:
        arrows += source_arrows(dataset, subject, 0.95 * ARROW_REACH)
    stages = with_track(subject, subject.stage(arrows, trails), notes)
    return Picture("motion of a rigid body", stages, [], ("angular_velocity",), notes)


def with_track(subject: Subject, body: Stage, notes: list[str]) -> list[Stage]:
    """The body's stage, and a second one with its track if it moves far.

    A position that moves by more than `NEAR` reaches can't be shown to the scale of the body: then the body
    stays at the centre of the first stage, and is enlarged on the second.
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
    track = trail("track", TRACK, translation, words="track of the centre of mass")
    if near:
        return [replace(body, translation=translation, trails=[*body.trails, track])]
    enlarged = TRACK_BODY * unit / reach
    notes.append(
        f"the body view follows the body; in the track view 1 unit = {unit:.6g} m "
        f"and the body is drawn {enlarged:.3g} times too large"
    )
    path = Stage(
        root="path",
        title="Track in space",
        unit=unit,
        meshes=[mesh.scaled(TRACK_BODY) for mesh in body.meshes],
        points=body.points * TRACK_BODY,
        axis_length=2 * TRACK_BODY,
        quaternion=body.quaternion,
        translation=translation,
        arrows=[],
        trails=[track],
        origin=not distant,
    )
    return [body, path]
