"""Euler angles of any sequence, and two charts of one attitude: the requested sequence, and a partner whose
singularity is far from its own.

A sequence ijk is singular where body axis k lies along space axis i: its factor is f = sqrt(1 - R_ik^2),
|sin| of the middle angle for proper sequences (k = i) and |cos| for the others. The partner keeps i and j and
ends with another axis k': its factor is f' = sqrt(1 - R_ik'^2), and since the rows of R are unit vectors,
f^2 + f'^2 >= 1. Where one chart breaks down, the other is at its best. A proper sequence's partner is a
Tait-Bryan one (zxz: zxy), and the other way round (xyz: xyx).

Both begin with the same two turns, so that the way across depends on the second and third angle alone:
R_j(b) R_k(c) = R_i(d) R_j(b') R_k'(c') and a' = a + d.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import heyoka as hy

from rigidsim.model import rotations
from rigidsim.model.formulations.formulation import Formulation, ModelPlan, formulates
from rigidsim.model.load import Load
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.state_blocks import AttitudeStates
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import dot
from rigidsim.scene.choices import FORMULATIONS
from rigidsim.scene.rotations import AXES, is_proper, parity
from rigidsim.scene.scene import Scene

ANGLES = ["phi", "theta", "psi"]


@formulates(FORMULATIONS["euler_angles"])
class EulerAngles(Formulation):
    """The angles of one sequence, with the same motion in the partner sequence, unless this is that one."""

    def __init__(self, sequence: str, partner: EulerAngles | None = None) -> None:
        self.sequence, self.partner = sequence, partner

    @classmethod
    def of(cls, scene: Scene, loads: Sequence[Load]) -> EulerAngles:
        """See ``Formulation``: of the sequence in the config."""
        sequence = scene.config.integrator.euler_sequence
        return cls(sequence, cls(partner_sequence(sequence)))

    def attitude(self, plan: ModelPlan, rates: list[Symbolic], number: Rounder) -> AttitudeStates:
        return euler_states(plan.scene, rates, self.sequence)

    def asked_angles(self, attitude: AttitudeStates, branch: Symbolic) -> list[Symbolic]:
        return across(self.sequence, attitude.variables, hy, branch)


def euler_states(scene: Scene, rates: list[Symbolic], sequence: str) -> AttitudeStates:
    """The angles of a sequence: the requested one, or its partner."""
    asked = scene.config.integrator.euler_sequence
    angles = list(hy.make_vars(*ANGLES))
    derivatives, factor = rotations.euler_rates(sequence, angles, rates)
    matrix = attitude.rotation_matrix(scene.quaternion)
    start = scene.euler_angles or attitude.euler_from_matrix(scene.context, matrix, asked)
    initial = start if sequence == asked else attitude.euler_from_matrix(scene.context, matrix, sequence)
    quaternion = rotations.quaternion_from_euler(sequence, angles)
    if scene.euler_angles is None and _opposite(scene, start):
        quaternion = [-x for x in quaternion]  # in both charts: from one to the other its sign is kept
    return AttitudeStates(
        ANGLES,
        derivatives,
        list(initial),
        rotations.euler_matrix(sequence, angles),
        quaternion,
        "wrapping",
        angles=(0, 1, 2),
        singular_factor=factor,
        sequence=sequence,
        observables=("euler_angles",),
    )


def _opposite(scene: Scene, angles: list[Any]) -> bool:
    """Whether the quaternion of the requested sequence's angles is minus the scene's initial one."""
    made = attitude.quaternion_from_euler(scene.context, angles, scene.config.integrator.euler_sequence)
    return bool(dot(made, list(scene.quaternion)) < 0)


# --- the partner's chart ------------------------------------------------------------------------------------


def partner_sequence(sequence: str) -> str:
    """The sequence that a run changes to near the singularity of another; the relation is mutual."""
    first, second = sequence[0], sequence[1]
    last = (set(AXES) - {first, second}).pop() if is_proper(sequence) else first
    return first + second + last


def across(sequence: str, angles: list[Any], functions: Any, branch: Any = 1.0) -> list[Any]:
    """The same attitude in the partner's angles; the first isn't reduced to one turn.

    No digits are lost anywhere: small sines come from small sines. Every attitude has two triples of angles;
    exactly in the partner's singularity the outer ones are those that atan2(0, 0) = 0 gives.

    Args:
        angles: angles of ``sequence``, radians.
        functions: module that provides ``sin``, ``cos``, ``sqrt`` and ``atan2``: ``math`` or ``heyoka``.
        branch: +1 for a middle angle in [0, pi] or [-pi/2, pi/2], -1 for the other triple.
    """
    first, middle, last = angles
    sine, cosine, atan2 = functions.sin, functions.cos, functions.atan2
    sb, cb, sc, cc = sine(middle), cosine(middle), sine(last), cosine(last)
    signed = float(parity(AXES.index(sequence[0]), AXES.index(sequence[1]))) * branch
    if is_proper(sequence):
        size = functions.sqrt(cb * cb + (sb * sc) * (sb * sc))
        return [
            first + atan2(branch * sc, branch * (cb * cc)),
            atan2(sb * cc, branch * size),
            atan2(-(signed * (sb * sc)), branch * cb),
        ]
    size = functions.sqrt(sb * sb + (cb * sc) * (cb * sc))
    return [
        first + atan2(signed * sc, branch * (sb * cc)),
        atan2(branch * size, cb * cc),
        atan2(-(signed * (cb * sc)), branch * sb),
    ]


def pole_of_partner(sequence: str, angles: list[float], functions: Any) -> float:
    """R_ik' at these angles of ``sequence``, which is +1 or -1 in the partner's singularity, where only the
    sum (+1) or the difference (-1) of the partner's outer angles is defined.
    """
    _, middle, last = angles
    if not is_proper(sequence):
        return float(functions.cos(middle) * functions.cos(last))
    sign = parity(AXES.index(sequence[0]), AXES.index(sequence[1]))
    return float(sign * (functions.sin(middle) * functions.cos(last)))


def singular_factor(sequence: str, middle: float, functions: Any) -> float:
    """Factor that vanishes in the singularity; negative on the branch of the other triple."""
    return float(functions.sin(middle) if is_proper(sequence) else functions.cos(middle))
