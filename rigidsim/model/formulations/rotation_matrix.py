"""Nine direction cosines: R' = R [w]x."""

from __future__ import annotations

import math

import heyoka as hy

from rigidsim.model import rotations
from rigidsim.model.formulations.formulation import Formulation, ModelPlan, formulates
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.state_blocks import AttitudeStates
from rigidsim.scene.attitude import rotation_matrix
from rigidsim.scene.choices import FORMULATIONS


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
