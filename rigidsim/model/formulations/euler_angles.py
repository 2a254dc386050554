"""Euler angles of any sequence: three angles, singular where the middle one makes the outer axes parallel.

Near that singularity a run goes on in a partner sequence (``rigidsim.model.euler_charts``).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import heyoka as hy

from rigidsim.model import rotations
from rigidsim.model.euler_charts import across, partner_sequence
from rigidsim.model.formulations.formulation import Formulation, ModelPlan, Rounding, formulates
from rigidsim.model.load import Load
from rigidsim.model.numbers import Rounder
from rigidsim.model.rotations import Symbolic
from rigidsim.model.state_blocks import AttitudeStates
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import dot
from rigidsim.scene.formulations import FORMULATIONS
from rigidsim.scene.scene import Scene

ANGLES = ["phi", "theta", "psi"]


@formulates(FORMULATIONS["euler_angles"])
class EulerAngles(Formulation):
    """The angles of one sequence.

    Args:
        sequence: sequence of the angles that are states.
        partner: the same motion in the partner sequence; None if this is the partner.
    """

    rounding = Rounding.ANGLES

    def __init__(self, sequence: str, partner: EulerAngles | None = None) -> None:
        self.sequence, self.partner = sequence, partner

    @classmethod
    def of(cls, scene: Scene, loads: Sequence[Load]) -> EulerAngles:
        """See ``Formulation``: of the sequence in the config."""
        sequence = scene.config.integrator.euler_sequence
        return cls(sequence, cls(partner_sequence(sequence)))

    def attitude(self, plan: ModelPlan, rates: list[Symbolic], number: Rounder) -> AttitudeStates:
        """See ``Formulation``."""
        return euler_states(plan.scene, rates, self.sequence)

    def asked_angles(self, attitude: AttitudeStates, branch: Symbolic) -> list[Symbolic]:
        """See ``Formulation``."""
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
