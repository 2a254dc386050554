"""Formulations of the attitude: quaternion, Euler angles of any sequence, or rotation matrix.

Each formulation provides its states, their kinematic equations for given body rates, R, and the quaternion
and Euler angles as expressions of its states.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import heyoka as hy

from rigidsim.model import rotations
from rigidsim.model.body import BODY
from rigidsim.model.rotations import Symbolic, SymbolicMatrix
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import dot
from rigidsim.scene.scene import Scene


@dataclass(frozen=True)
class OrbitalFrame:
    """Quantities of the orbital frame, for an attitude carried relative to a circular orbit
    (``rigidsim.model.frames.orbital``).

    Attributes:
        direction: unit vector towards the attracting body, body axes.
        normal: unit normal of the orbit, body axes.
        states: states of the orbit itself, from which the attitude in space follows.
    """

    direction: list[Symbolic]
    normal: list[Symbolic]
    states: StateBlock


@dataclass(frozen=True)
class AttitudeStates:
    """The part of a system of equations that carries the attitude.

    Attributes:
        kind: name of the formulation.
        names: names of the states.
        derivatives: right-hand sides, in the same order.
        initial: initial values (mpf).
        matrix: R, body to space, as expressions of the states.
        quaternion: [w, x, y, z] as expressions; see ``quaternion_sign``.
        quaternion_sign: how it is made continuous: "state" (it is one), "wrapping" (it changes sign with
            each full turn of an angle) or "nearest" (the sign nearest to the sample before).
        angles: indices in ``names`` of states that are angles and grow without bound.
        defect: name, long name and expression of what should stay constant by construction, or None.
        singular_factor: expression that vanishes where the formulation is singular, or None.
        angle_unit: binary exponent of the unit in which such angles are carried, rad.
        orbital: the orbital frame, if the states are the attitude relative to it; else None.
    """

    kind: str
    names: list[str]
    derivatives: list[Symbolic]
    initial: list[Any]
    matrix: SymbolicMatrix
    quaternion: list[Symbolic]
    quaternion_sign: str
    angles: tuple[int, ...] = ()
    defect: tuple[str, str, Symbolic] | None = None
    singular_factor: Symbolic | None = None
    sequence: str = field(default="")
    orbital: OrbitalFrame | None = None
    angle_unit: int = 0

    @property
    def variables(self) -> list[Symbolic]:
        """The states as heyoka variables."""
        return list(hy.make_vars(*self.names))


def quaternion_kinematics(q: list[Symbolic], rates: list[Symbolic]) -> list[Symbolic]:
    """q (0, w) / 2 for a quaternion [w, x, y, z] and rates in body axes."""
    w, x, y, z = q
    p, r, s = rates
    return [
        0.5 * (-x * p - y * r - z * s),
        0.5 * (w * p + y * s - z * r),
        0.5 * (w * r + z * p - x * s),
        0.5 * (w * s + x * r - y * p),
    ]


def quaternion_states(scene: Scene, rates: list[Symbolic]) -> AttitudeStates:
    """Four states, no singularity: q' = q (0, w) / 2 (the cheapest and the default)."""
    names = BODY.quaternion
    q = list(hy.make_vars(*names))
    derivatives = quaternion_kinematics(q, rates)
    squared = hy.sum([c * c for c in q])
    return AttitudeStates(
        "quaternion",
        names,
        derivatives,
        list(scene.quaternion),
        rotations.quaternion_matrix(q),
        q,
        "state",
        defect=("quaternion_norm", "norm of the attitude quaternion", hy.sqrt(squared)),
    )


def euler_states(scene: Scene, rates: list[Symbolic], sequence: str | None = None) -> AttitudeStates:
    """Three angles; singular where the middle one makes the outer axes parallel.

    Args:
        sequence: a sequence other than the scene's (its partner, see ``rigidsim.model.euler_charts``).
    """
    asked = scene.config.integrator.euler_sequence
    sequence = sequence or asked
    names = ["phi", "theta", "psi"]
    angles = list(hy.make_vars(*names))
    derivatives, factor = rotations.euler_rates(sequence, angles, rates)
    matrix = attitude.rotation_matrix(scene.quaternion)
    start = scene.euler_angles or attitude.euler_from_matrix(scene.context, matrix, asked)
    initial = start if sequence == asked else attitude.euler_from_matrix(scene.context, matrix, sequence)
    quaternion = rotations.quaternion_from_euler(sequence, angles)
    if scene.euler_angles is None and _opposite(scene, start):
        quaternion = [-x for x in quaternion]  # in both charts: from one to the other its sign is kept
    return AttitudeStates(
        "euler_angles",
        names,
        derivatives,
        list(initial),
        rotations.euler_matrix(sequence, angles),
        quaternion,
        "wrapping",
        angles=(0, 1, 2),
        singular_factor=factor,
        sequence=sequence,
    )


def _opposite(scene: Scene, angles: list[Any]) -> bool:
    """Whether the quaternion of the requested sequence's angles is minus the scene's initial one."""
    made = attitude.quaternion_from_euler(scene.context, angles, scene.config.integrator.euler_sequence)
    return bool(dot(made, list(scene.quaternion)) < 0)


def matrix_states(scene: Scene, rates: list[Symbolic]) -> AttitudeStates:
    """Nine direction cosines: R' = R [w]x."""
    names = [f"r{i}{j}" for i in "123" for j in "123"]
    flat = list(hy.make_vars(*names))
    r = [flat[0:3], flat[3:6], flat[6:9]]
    p, q, s = rates
    derivatives = []
    for a, b, c in r:
        derivatives += [b * s - c * q, c * p - a * s, a * q - b * p]
    defects = []
    for i in range(3):
        for j in range(i + 1):
            product = hy.sum([r[i][m] * r[j][m] for m in range(3)])
            difference = product - 1.0 if i == j else product
            defects.append(difference * difference)
    initial = attitude.rotation_matrix(scene.quaternion)
    return AttitudeStates(
        "rotation_matrix",
        names,
        derivatives,
        [x for row in initial for x in row],
        r,
        rotations.quaternion_from_matrix(r),
        "nearest",
        defect=(
            "orthogonality_defect",
            "deviation of R from orthogonality, root of the summed squares of R R^T - 1",
            hy.sqrt(hy.sum(defects)),
        ),
    )


BUILDERS = {
    "quaternion": quaternion_states,
    "euler_angles": euler_states,
    "rotation_matrix": matrix_states,
}
"""The formulations that carry an attitude, by the name that a config uses."""
