"""The attitude quaternion: four states, no singularity; the cheapest, and the default."""

from __future__ import annotations

import heyoka as hy

from rigidsim.model import rotations
from rigidsim.model.formulations.formulation import Formulation, ModelPlan, formulates
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.state_blocks import BODY, AttitudeStates
from rigidsim.scene.choices import DEFAULT_FORMULATION, FORMULATIONS
from rigidsim.scene.scene import Scene


@formulates(FORMULATIONS[DEFAULT_FORMULATION])
class Quaternion(Formulation):
    """q' = q (0, w) / 2."""

    def attitude(self, plan: ModelPlan, rates: list[Symbolic], number: Rounder) -> AttitudeStates:
        return quaternion_states(plan.scene, rates)


def quaternion_states(scene: Scene, rates: list[Symbolic]) -> AttitudeStates:
    """The quaternion in space axes, for rates (body axes) in units of 1/time."""
    names = BODY.quaternion
    q = list(hy.make_vars(*names))
    squared = hy.sum([c * c for c in q])
    return AttitudeStates(
        names,
        rotations.quaternion_kinematics(q, rates),
        list(scene.quaternion),
        rotations.quaternion_matrix(q),
        q,
        "state",
        defect=("quaternion_norm", "norm of the attitude quaternion", hy.sqrt(squared)),
        chord=2.0,
    )
