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
from rigidsim.model.formulations.formulation import Formulation, ModelPlan
from rigidsim.model.load import Load
from rigidsim.model.rotations import Symbolic, SymbolicMatrix
from rigidsim.model.scaling import Rounder
from rigidsim.model.state_blocks import AttitudeStates, OrbitalFrame, StateBlock
from rigidsim.model.two_part import as_factor
from rigidsim.scene import attitude
from rigidsim.scene.choices import DEFAULT_FORMULATION, FORMULATIONS
from rigidsim.scene.expressions.names import PLACES
from rigidsim.scene.expressions.tree import states_read
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene


class OrbitalQuaternion(Formulation):
    """The quaternion relative to the frame of an orbit; a quaternion to whoever asks."""

    variables = FORMULATIONS[DEFAULT_FORMULATION]
    why = "relative to the frame that turns with the orbit, where the gradient takes a third fewer products"

    def __init__(self, orbit: KeplerOrbit) -> None:
        self._orbit = orbit

    @classmethod
    def if_cheaper(cls, scene: Scene, loads: Sequence[Load]) -> OrbitalQuaternion | None:
        """The formulation where it saves products: on a circle in a fixed plane, if the load on it is the
        only one that reads the attitude; None elsewhere.
        """
        readers = [load for load in loads if {"attitude", "vertical"} & load.reads and not _rides_along(load)]
        if scene.torque_arm is not None or len(readers) != 1 or _reads_places(scene):
            return None
        orbit = readers[0].corotating_orbit
        return None if orbit is None else cls(orbit)

    def attitude(self, plan: ModelPlan, rates: list[Symbolic], number: Rounder) -> AttitudeStates:
        scene, orbit = plan.scene, self._orbit
        context, tag = scene.context, plan.orbit_tags[orbit]
        names, pair = ["pw", "px", "py", "pz"], [f"cos_half_anomaly{tag}", f"sin_half_anomaly{tag}"]
        p, (c, s) = list(hy.make_vars(*names)), hy.make_vars(*pair)
        unit = context.ldexp(context.one, plan.scaling.time)
        half_motion = as_factor(number(orbit.mean_motion * unit / 2))
        w, x, y, z = p
        turning = rotations.quaternion_kinematics(p, rates)
        derivatives = [a + half_motion * b for a, b in zip(turning, [z, y, -x, -w], strict=True)]
        half = orbit.eccentric_anomaly(context, scene.start) / 2  # that the frame has turned by at the start
        cosine, sine = context.cos(half), context.sin(half)
        plane = _plane(context, orbit)
        before, *v = attitude.product(plane, [cosine, context.zero, context.zero, sine])
        initial = attitude.product([before, *(-x for x in v)], list(scene.quaternion))
        turned = [-(half_motion * s), half_motion * c]
        states = StateBlock(pair, turned, [cosine, sine], [hy.sqrt(c * c + s * s)])
        relative = rotations.quaternion_matrix(p)
        matrix, quaternion = _in_space(plane, [c, s], relative, p, number)
        norm = hy.sqrt(hy.sum([component * component for component in p]))
        return AttitudeStates(
            names,
            derivatives,
            initial,
            matrix,
            quaternion,
            "state",
            defect=("quaternion_norm", "norm of the attitude quaternion", norm),
            orbital=OrbitalFrame(direction=relative[0], normal=relative[2], states=states),
            chord=2.0,
        )


def _rides_along(load: Load) -> bool:
    """Whether it acts beside another load, and rests in the same frame."""
    return load.beside is not None and load.corotating_orbit is not None


def _reads_places(scene: Scene) -> bool:
    """Whether an expression takes the orbit as it is in space."""
    return PLACES in states_read(*scene.formulas())


def _in_space(
    plane: list[Any], half: list[Symbolic], relative: SymbolicMatrix, p: list[Symbolic], number: Rounder
) -> tuple[SymbolicMatrix, list[Symbolic]]:
    """R and the quaternion in space, for those relative to the orbital frame, from the quaternion of the
    orbit's plane, and cosine and sine of half the angle that the frame has turned by.
    """
    c, s = half
    w, x, y, z = p
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


def _turn(context: Any, angle: Any, axis: int) -> list[Any]:
    """Quaternion of a turn about axis 1 or 3; exact for no turn."""
    if angle == 0:
        return [context.one, context.zero, context.zero, context.zero]
    turn = [context.cos(angle / 2)] + [context.zero] * 3
    turn[axis] = context.sin(angle / 2)
    return turn
