"""States that follow the body rates as they are: the quaternion, nine direction cosines, and the rates alone.

The quaternion has four states, no singularity, and is the cheapest and the default. The rates alone are for
what needs no attitude; with the vertical in body axes, if a torque reads that.
"""

from __future__ import annotations

import math

import heyoka as hy

from rigidsim.model import rotations
from rigidsim.model.formulations.formulation import Formulation, ModelPlan, formulates, rate_block
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.state_blocks import BODY, AttitudeStates, StateBlock
from rigidsim.scene.arithmetic import apply, cross, transpose
from rigidsim.scene.attitude import rotation_matrix
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


@formulates(FORMULATIONS["rotation_matrix"])
class RotationMatrix(Formulation):
    """The rotation matrix, body to space axes, row by row."""

    def attitude(self, plan: ModelPlan, rates: list[Symbolic], number: Rounder) -> AttitudeStates:
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
        defect = (
            "orthogonality_defect",
            "deviation of R from orthogonality, root of the summed squares of R R^T - 1",
            hy.sqrt(hy.sum(defects)),
        )
        return AttitudeStates(
            names,
            derivatives,
            [x for row in rotation_matrix(plan.scene.quaternion) for x in row],
            r,
            rotations.quaternion_from_matrix(r),
            "nearest",
            defect=defect,
            chord=math.sqrt(0.5),
            observables=("rotation_matrix",),
        )


@formulates(FORMULATIONS["rates"])
class Rates(Formulation):
    """Euler's equations, and Poisson's for the vertical."""

    twin = "rates"

    def attitude(self, plan: ModelPlan, rates: list[Symbolic], number: Rounder) -> None:
        return None

    def blocks(self, m: Mechanics, plan: ModelPlan) -> list[StateBlock]:
        why = plan.requirements.why
        blocks = [rate_block(m, why["rates"])]
        if plan.requirements.vertical:
            assert m.numbers.up is not None
            seen = apply(transpose(rotation_matrix(m.scene.quaternion)), m.numbers.up)
            turning = cross(m.carried(m.vertical), m.rates)  # Poisson's g' = g x w
            blocks.append(StateBlock(BODY.vertical, turning, seen, why=why["vertical"]))
        return blocks
