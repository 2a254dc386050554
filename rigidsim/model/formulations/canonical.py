"""The canonical formulation: Euler angles and their conjugate momenta, from the Hamiltonian.

With w = K^-1 q' (K from ``euler_rates``) the momenta are p = K^-T I w, so that the body's angular momentum is
I w = K^T p and H = L . I^-1 L / 2 + U(q), of which heyoka derives Hamilton's equations (Goldstein, ch. 8).
It serves every load with a potential, one that moves with an orbit included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model import rotations
from rigidsim.model.carriers import carried_beside
from rigidsim.model.formulations.euler_angles import ANGLES, euler_states
from rigidsim.model.formulations.formulation import Formulation, ModelPlan, formulates
from rigidsim.model.inertia import ConstantInertia
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder, Scaling
from rigidsim.model.state_blocks import AttitudeStates, StateBlock
from rigidsim.scene import attitude as numeric
from rigidsim.scene.arithmetic import apply, dot, multiply
from rigidsim.scene.choices import FORMULATIONS
from rigidsim.scene.rotations import is_proper
from rigidsim.scene.scene import Scene

MOMENTA = ("p_phi", "p_theta", "p_psi")


@formulates(FORMULATIONS["canonical"])
class Canonical(Formulation):
    """Angles and momenta, of which the body rates are functions."""

    carries_rates = False

    def __init__(self, sequence: str) -> None:
        self.sequence = sequence

    @classmethod
    def of(cls, scene: Scene, loads: Sequence[Load]) -> Canonical:
        """See ``Formulation``: of the sequence in the config."""
        return cls(scene.config.integrator.euler_sequence)

    def rotation(self, plan: ModelPlan, number: Rounder) -> tuple[list[Symbolic], AttitudeStates]:
        angles, momenta = list(hy.make_vars(*ANGLES)), list(hy.make_vars(*MOMENTA))
        columns = []
        for i in range(3):
            unit = [rotations.constant(float(i == j)) for j in range(3)]
            columns.append(rotations.euler_rates(self.sequence, angles, unit)[0])
        body = [hy.sum([k * p for k, p in zip(column, momenta, strict=True)]) for column in columns]
        rates = ConstantInertia.of(plan.numbers, number, plan.scene.context).solved(body)
        return rates, replace(euler_states(plan.scene, rates, self.sequence), momenta=MOMENTA)

    def blocks(self, m: Mechanics, plan: ModelPlan) -> list[StateBlock]:
        attitude = m.carried(m.attitude)
        block = StateBlock(
            [*attitude.names, *MOMENTA],
            _hamilton_equations(m),
            [*attitude.initial, *_initial_momenta(plan.scene, plan.scaling, attitude.initial)],
            exponents=[0] * 3 + [m.scaling.momentum] * 3,
            why=plan.requirements.why["attitude"],
        )
        return [block]

    def check_start(self, scene: Scene, attitude: AttitudeStates | None) -> None:
        """Refuse a start at which canonical momenta of Euler angles don't exist."""
        assert attitude is not None
        context = scene.context
        middle = attitude.initial[1]
        factor = abs(context.sin(middle) if is_proper(self.sequence) else context.cos(middle))
        if factor < context.mpf(2) ** -20:
            raise ConfigError(
                Problem(
                    "[integrator] formulation",
                    f"the motion starts {context.nstr(factor, 3)} rad from the singularity of the sequence "
                    f"{self.sequence} (middle angle {context.nstr(middle, 8)} rad), where Euler angles have "
                    'no momenta; choose formulation = "euler_angles", which changes its sequence there, '
                    '"quaternion", or another euler_sequence',
                )
            )


def _initial_momenta(scene: Scene, scaling: Scaling, angles: list[Any]) -> list[Any]:
    """Projections of the angular momentum on the three axes that the angles turn about."""
    context, sequence = scene.context, scene.config.integrator.euler_sequence
    body = apply(scene.body.inertia, scene.angular_velocity)
    momentum = apply(numeric.rotation_matrix(scene.quaternion), body)
    turned = numeric.rotation_matrix([context.one] + [context.zero] * 3)
    projections = []
    for angle, axis in zip(angles, sequence, strict=True):
        index = "xyz".index(axis)
        direction = [row[index] for row in turned]
        projections.append(context.ldexp(dot(direction, momentum), -scaling.momentum))
        quaternion = numeric.quaternion_from_euler(context, [angle, context.zero, context.zero], axis * 3)
        turned = multiply(turned, numeric.rotation_matrix(quaternion))
    return projections


def _hamilton_equations(m: Mechanics) -> list[Symbolic]:
    """Right-hand sides of the three angles and momenta; refused for a load without a potential."""
    if beside := carried_beside(m.loads):
        raise ConfigError(
            Problem(
                "[integrator] formulation", f'given "canonical", but {beside}; choose another formulation'
            )
        )
    parts = [m.rotational_energy]
    for load in m.loads:
        if not load.torque(m):
            continue
        potential = load.potential(m)
        if potential is None:
            raise ConfigError(
                Problem(
                    "[integrator] formulation",
                    f'given "canonical", but {load.title} has no potential; choose another formulation',
                )
            )
        parts.append(potential)
    hamiltonian = hy.sum(parts)
    angles, momenta = list(hy.make_vars(*ANGLES)), list(hy.make_vars(*MOMENTA))
    # an orbit's phase and a position are no coordinates of the rotation: parameters take their place
    own = {*ANGLES, *MOMENTA}
    foreign = [hy.make_vars(name) for name in hy.get_variables(hamiltonian) if name not in own]
    there = {x: hy.par[i] for i, x in enumerate(foreign)}
    back = {hy.par[i]: x for i, x in enumerate(foreign)}
    derived = hy.hamiltonian(hy.subs(hamiltonian, there), angles, momenta)
    return [hy.subs(right, back) for _, right in derived]
