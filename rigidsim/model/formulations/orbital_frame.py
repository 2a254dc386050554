"""The attitude on a circular orbit, carried relative to the frame that turns with the orbit.

Axes of the orbital frame: x towards the attracting body, z along the orbit's normal. In it the torque of a
gravity gradient needs one row of the relative rotation matrix and nothing of the orbit, so that the
equations don't depend on time and have a third fewer products than with the attitude in space
(Hughes, Spacecraft Attitude Dynamics, 1986, ch. 9). With q = o p, o' = n o (0, e_z) / 2 and
q' = q (0, w) / 2, the relative quaternion obeys

    p' = p (0, w) / 2 - n (0, e_z) p / 2.

The orbit's half angle is carried as its cosine and sine, which feed nothing but what is recorded.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import heyoka as hy

from rigidsim.model import rotations
from rigidsim.model.capabilities import corotating_orbit_of
from rigidsim.model.load import Load
from rigidsim.model.numbers import Rounder
from rigidsim.model.rotations import Symbolic, SymbolicMatrix
from rigidsim.model.state_blocks import AttitudeStates, OrbitalFrame, StateBlock
from rigidsim.model.two_part import as_factor
from rigidsim.scene import attitude
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene


def corotating_orbit(scene: Scene, loads: Sequence[Load]) -> KeplerOrbit | None:
    """Orbit in whose frame a quaternion is best carried: a circle in a fixed plane, if the load on it is the
    only one that reads the attitude; None otherwise.
    """
    readers = [load for load in loads if {"attitude", "vertical"} & load.reads]
    if scene.torque_arm is not None or len(readers) != 1:
        return None
    return corotating_orbit_of(readers[0])


def orbital_states(
    scene: Scene,
    rates: list[Symbolic],
    orbit: KeplerOrbit,
    tag: str,
    time_unit: Any,
    number: Rounder,
) -> AttitudeStates:
    """Four states of the relative quaternion, and the orbit's half angle as states of the load.

    Args:
        rates: angular velocity, body axes, 1 / ``time_unit``.
        orbit: see ``corotating_orbit``.
        tag: suffix that makes the names of the orbit's states unique.
        time_unit: internal unit of time, seconds (mpf).
    """
    names = ["pw", "px", "py", "pz"]
    p = list(hy.make_vars(*names))
    half_motion = as_factor(number(orbit.mean_motion * time_unit / 2))
    w, x, y, z = p
    carried_along = [z, y, -x, -w]
    derivatives = [
        turning + half_motion * along
        for turning, along in zip(rotations.quaternion_kinematics(p, rates), carried_along, strict=True)
    ]
    initial = relative_attitude(scene, orbit)
    orbital = half_turn(scene, orbit, tag, time_unit, number)
    relative = rotations.quaternion_matrix(p)
    matrix, quaternion = in_space(scene, orbit, orbital.variables, relative, p, number)
    return AttitudeStates(
        names,
        derivatives,
        initial,
        matrix,
        quaternion,
        "state",
        defect=(
            "quaternion_norm",
            "norm of the attitude quaternion",
            hy.sqrt(hy.sum([component * component for component in p])),
        ),
        orbital=OrbitalFrame(direction=relative[0], normal=relative[2], states=orbital),
        chord=2.0,
    )


def relative_attitude(scene: Scene, orbit: KeplerOrbit) -> list[Any]:
    """The initial quaternion from body axes to the orbital frame (mpf)."""
    context = scene.context
    cosine, sine = _start(scene, orbit)
    w, *v = attitude.product(_plane(context, orbit), [cosine, context.zero, context.zero, sine])
    return attitude.product([w, *(-x for x in v)], list(scene.quaternion))


def half_turn(scene: Scene, orbit: KeplerOrbit, tag: str, time_unit: Any, number: Rounder) -> StateBlock:
    """Cosine and sine of half the angle that the orbital frame has turned by."""
    half_motion = as_factor(number(orbit.mean_motion * time_unit / 2))
    pair = [f"cos_half_anomaly{tag}", f"sin_half_anomaly{tag}"]
    c, s = hy.make_vars(*pair)
    initial = list(_start(scene, orbit))
    return StateBlock(pair, [-(half_motion * s), half_motion * c], initial, [hy.sqrt(c * c + s * s)])


def in_space(
    scene: Scene,
    orbit: KeplerOrbit,
    half: Sequence[Symbolic],
    relative: SymbolicMatrix,
    quaternion: list[Symbolic],
    number: Rounder,
) -> tuple[SymbolicMatrix, list[Symbolic]]:
    """From the orbital frame to space: R, and the quaternion.

    Args:
        half: cosine and sine of half the angle that the orbital frame has turned by.
        relative, quaternion: attitude relative to the orbital frame.
    """
    plane = _plane(scene.context, orbit)
    c, s = half
    w, x, y, z = quaternion
    zero = rotations.constant(0.0)
    turned = [
        hy.sum([c * w, -(s * z)]),
        hy.sum([c * x, -(s * y)]),
        hy.sum([c * y, s * x]),
        hy.sum([c * z, s * w]),
    ]
    in_plane = rotations.quaternion_product([as_factor(number(x)) for x in plane], turned)
    cosine2, sine2 = c * c - s * s, 2.0 * (s * c)
    along = [[cosine2, -sine2, zero], [sine2, cosine2, zero], [zero, zero, rotations.constant(1.0)]]
    tilt = [[as_factor(number(x)) for x in row] for row in attitude.rotation_matrix(plane)]
    return rotations.multiply(tilt, rotations.multiply(along, relative)), in_plane


def _plane(context: Any, orbit: KeplerOrbit) -> list[Any]:
    """Quaternion of the orbit's plane, from orbital to space axes."""
    return attitude.product(_turn(context, orbit.ascending_node, 3), _turn(context, orbit.inclination, 1))


def _start(scene: Scene, orbit: KeplerOrbit) -> tuple[Any, Any]:
    """Cosine and sine of half the orbital frame's angle at the start (mpf)."""
    half = orbit.eccentric_anomaly(scene.context, scene.start) / 2
    return scene.context.cos(half), scene.context.sin(half)


def _turn(context: Any, angle: Any, axis: int) -> list[Any]:
    """Quaternion of a turn about axis 1 or 3; exact for no turn."""
    if angle == 0:
        return [context.one, context.zero, context.zero, context.zero]
    turn = [context.cos(angle / 2)] + [context.zero] * 3
    turn[axis] = context.sin(angle / 2)
    return turn
