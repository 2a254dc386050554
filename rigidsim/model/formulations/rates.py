"""Body rates alone, for what needs no attitude; with the vertical in body axes, if a torque reads that."""

from __future__ import annotations

from rigidsim.model.formulations.formulation import Formulation, ModelPlan, formulates, rate_block
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.state_blocks import BODY, StateBlock
from rigidsim.scene.arithmetic import apply, cross, transpose
from rigidsim.scene.attitude import rotation_matrix
from rigidsim.scene.choices import FORMULATIONS


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
