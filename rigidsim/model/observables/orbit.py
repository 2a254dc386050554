"""Attitude relative to an orbit: roll, pitch and yaw, libration, and the direction of the source.

With c the direction to the source and o the orbit's normal in body axes, and R the matrix whose rows are the
local frame's axes in body axes,

    R = Rz(yaw) Ry(pitch) Rx(roll),   roll = atan2(c_y, c_z),   pitch = -asin(c_x),   yaw = atan2(-o_x, x_x)

with x = c x o. On a circular orbit a satellite at rest in the local frame has all three zero.

Libration of the long axis l (the principal axis of smallest moment): in the plane atan2(l . x, l . c),
positive forward, and out of it asin(l . o), positive to the normal's side. (Hughes, Spacecraft Attitude
Dynamics, 1986, ch. 9; Beletskii, Motion of an Artificial Satellite about its Center of Mass, 1966, ch. 2.)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import heyoka as hy

from rigidsim.model.frames import local_frame, moves_slowly_in_orbit
from rigidsim.model.loads.surface_load import Drag
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import BODY, Angle, Observable, continuous_angles, register_all
from rigidsim.model.rotations import Symbolic, along
from rigidsim.model.sources import RELATIVE_NAMES, FlightNames, flown_about
from rigidsim.scene.frame import unique_axis


def roll_pitch_yaw(m: Mechanics) -> list[Angle]:
    """3-2-1 angles from the local frame to body axes."""
    frame = local_frame(m)
    c, o = frame.down, frame.normal
    level = hy.sqrt(c[1] * c[1] + c[2] * c[2])
    return [Angle(c[1], c[2]), Angle(-c[0], level), Angle(-o[0], frame.forward[0])]


def libration(m: Mechanics) -> list[Angle]:
    """Libration angles of the long axis, in the orbit's plane and out of it."""
    frame = local_frame(m)
    axis = m.fixed(m.carried(unique_axis(m.scene.body, m.scene.context, largest=False)))
    x, z = along(axis, frame.forward), along(axis, frame.down)
    return [Angle(x, z), Angle(along(axis, frame.normal), hy.sqrt(x * x + z * z))]


def _no_long_axis(m: Mechanics) -> str | None:
    if unique_axis(m.scene.body, m.scene.context, largest=False) is not None:
        return None
    return "the body has no single axis of smallest moment, whose libration it would be"


def _attributes(convention: str) -> Callable[[Mechanics], Mapping[str, str]]:
    return lambda m: {"convention": convention, "local_frame": local_frame(m).described}


def air_velocity(m: Mechanics) -> list[Symbolic]:
    """Velocity relative to the air that turns with the body flown about, body axes, m/s."""
    found = FlightNames().expressions(m, RELATIVE_NAMES)
    return [found[name] for name in RELATIVE_NAMES]


def _no_air(m: Mechanics) -> str | None:
    if flown_about(m.scene.config) is not None:
        return None
    return "the body flies about nothing whose air it would meet; give a central_gravity, or leave it out"


def _dragged(m: Mechanics) -> bool:
    return any(isinstance(load, Drag) for load in m.loads)


_NEEDS = ("attitude", "source")

register_all(
    continuous_angles(
        "roll_pitch_yaw", ("roll_pitch_yaw_component",), "roll, pitch and yaw", roll_pitch_yaw,
        frame="local frame to body axes", needs=_NEEDS, by_default=moves_slowly_in_orbit,
        attributes=_attributes(
            "3-2-1 (yaw about z, pitch about y, roll about x) from the local frame (z to the source, y "
            "against the orbit's normal) to body axes; turns counted; roll and yaw are NaN where pitch is a "
            "quarter turn"
        ),
    ),
    continuous_angles(
        "libration", ("libration_angle",), "libration of the axis of smallest moment", libration,
        frame="local frame", needs=_NEEDS, absent=_no_long_axis,
        attributes=_attributes(
            "angles of the axis of smallest moment from the direction to the source: in the orbit's plane, "
            "positive forward, turns counted; out of it, positive towards the orbit's normal"
        ),
    ),
    Observable(
        "nadir", BODY, "1", "direction to the source", lambda m: local_frame(m).down,
        frame="body axes", needs=_NEEDS, by_default=moves_slowly_in_orbit,
        attributes=_attributes("unit vector"),
    ),
    Observable(
        "air_velocity", BODY, "m s-1", "velocity relative to the air", air_velocity,
        lambda m: [0, 0, 0], "body axes", ("attitude", "flight"), by_default=_dragged, absent=_no_air,
        attributes=lambda m: {
            "convention": "of the centre of mass, in air that turns at the atmosphere_rate of the load flown "
            "about; the air comes from this direction"
        },
    ),
)  # fmt: skip


# --- the angle that a resonance keeps, in motions averaged over rotation and orbit --------------------------


def _no_resonance(m: Mechanics) -> str | None:
    if m.commensurable_angle is not None:
        return None
    return (
        'is of [model] level = "orbit_averaged" where the body is in resonance with its source; leave it out'
    )


RESONANT_ANGLE = continuous_angles(
    "resonant_angle", (), "angle that the rotation keeps with the orbit",
    lambda m: [Angle(*m.carried(m.commensurable_angle))], needs=("attitude",),
    by_default=lambda m: m.commensurable_angle is not None, absent=_no_resonance,
    attributes=lambda m: {
        "convention": "about the angular momentum, at the pericentre: from the direction of the pericentre "
        "to the axis of least moment; 0 or pi where that points at the source there"
    },
)  # fmt: skip
