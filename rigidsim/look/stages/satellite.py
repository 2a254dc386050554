"""Stage of a satellite on a prescribed orbit: the body in its local frame, above its planet, and the
orbit.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rigidsim.look import signals, surroundings
from rigidsim.look.solids import rotation_matrix
from rigidsim.look.stages.bodies import FIELD, Subject, column
from rigidsim.look.stages.orbits import FORWARD, NORMAL, ORBIT_BODY, horizon, local_frame, orbit_stage
from rigidsim.look.stages.parts import (
    FIGURE,
    SOURCE,
    Array,
    Camera,
    MovingFrame,
    Picture,
    Stage,
    Vector,
    quaternion_of,
    trail,
    viewer_quaternion,
)

if TYPE_CHECKING:
    from rigidsim.look.rows import Table

_LARGE = 1e5  # m: a larger body is a planet, and what pulls it is far away
_LEADING = ("libration", "roll_pitch_yaw", "angular_velocity")


def picture(dataset: Table, subject: Subject) -> Picture | None:
    """Picture of a small body with a single source on an orbit, its attitude known in space or in the local
    frame; None for others.
    """
    listed = [one for one in surroundings.told(dataset, "source") if "orbit" in one]
    if len(listed) != 1 or subject.position is not None or _body_size(subject) > _LARGE:
        return None
    orbit = listed[0]["orbit"]
    source = surroundings.kepler_path(orbit, signals.seconds(dataset))
    # The normal of the satellite's orbit: as seen from the planet it goes about it in the same sense.
    local = local_frame(-source, surroundings.orbit_normal(orbit))
    quaternion = subject.quaternion
    if quaternion is None:
        angles = column(dataset, "roll_pitch_yaw", 3)
        if angles is None or not np.isfinite(angles).all():
            return None
        quaternion = quaternion_of(local @ _turned(angles))
    planet = surroundings.globe_of(listed[0])
    known = replace(subject, quaternion=quaternion, attitude=rotation_matrix(quaternion))
    notes = ["in the local frame the planet's surface is drawn near the body, and not to scale"]
    close = _in_local_frame(dataset, known, local, planet)
    orbiting = orbit_stage(known, quaternion, -source, planet)
    notes.append(
        f"in the view of the orbit 1 unit = {orbiting.unit:.6g} m; the body is drawn "
        f"{ORBIT_BODY * orbiting.unit / subject.reach:.3g} times too large"
    )
    return Picture("satellite on its orbit", [close, orbiting], [], _LEADING, notes)


def _body_size(subject: Subject) -> float:
    return subject.reach if not subject.solids or not subject.solids[0].get("equivalent") else 0.0


def _turned(angles: Array) -> Array:
    """Rotations (rows, 3, 3) from body axes to the local frame for roll, pitch and yaw (rows, 3), 3-2-1."""
    cos, sin = np.cos(angles), np.sin(angles)
    zero, one = np.zeros(len(angles)), np.ones(len(angles))

    def matrix(*entries: Array) -> Array:
        return np.stack(entries, axis=1).reshape(-1, 3, 3)

    roll = matrix(one, zero, zero, zero, cos[:, 0], -sin[:, 0], zero, sin[:, 0], cos[:, 0])
    pitch = matrix(cos[:, 1], zero, sin[:, 1], zero, one, zero, -sin[:, 1], zero, cos[:, 1])
    yaw = matrix(cos[:, 2], -sin[:, 2], zero, sin[:, 2], cos[:, 2], zero, zero, zero, one)
    return np.asarray(yaw @ pitch @ roll)


def _in_local_frame(
    dataset: Table, subject: Subject, local: Array, planet: surroundings.Globe | None
) -> Stage:
    attitude = subject.attitude
    assert attitude is not None
    relative = np.einsum("tji,tjk->tik", local, attitude)
    axis = _lowest_axis(dataset, relative)
    # in space, as all moving parts are; the view looks from the local frame
    tip = 1.3 * np.einsum("tij,tj->ti", relative, np.broadcast_to(axis, (len(relative), 3)))
    stage = subject.stage([], [], "Body in the local frame")
    solids, lines = horizon(planet, "local")
    name = surroundings.called(planet, "source")
    zero = np.zeros(3)
    stage.vectors.extend(
        [
            Vector(
                "nadir",
                f"to {name}",
                SOURCE,
                zero,
                np.array([0, 0, 1.75]),
                "local",
                f"nadir: to {name}",
            ),
            Vector("forward", "forward", FORWARD, zero, np.array([1.75, 0, 0]), "local", "along the orbit"),
            Vector("normal", "normal", NORMAL, zero, np.array([0, -1.6, 0]), "local", "the orbit's normal"),
        ]
    )
    stage.trails.append(
        replace(
            trail(
                "local/axis_trace", FIGURE, tip, words="trace of the body axis that points down", head=True
            ),
        )
    )
    eye = np.array([2.0, -4.3, -1.35])
    eye = eye / np.linalg.norm(eye) * 2.15 / np.sin(FIELD / 2)
    center = np.array([0.0, 0.0, 0.35])
    return replace(
        stage,
        solids=solids,
        lines=lines,
        frames=[MovingFrame("local", viewer_quaternion(quaternion_of(local)))],
        looked_from="local",
        camera=Camera(center + eye, center, np.array([0.0, 0.0, -1.0])),
    )


def _lowest_axis(dataset: Table, relative: Array) -> Array:
    """Principal axis (3,), body axes, that points to the planet on average, or nearest to that."""
    axes = signals.principal_axes(dataset)
    down = np.nanmean(relative[:, 2, :], axis=0)
    along = axes @ down
    k = int(np.abs(along).argmax())
    return np.asarray(axes[k] * (1.0 if along[k] >= 0 else -1.0))
