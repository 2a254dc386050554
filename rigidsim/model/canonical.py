"""The canonical formulation: Euler angles and their conjugate momenta, from the Hamiltonian.

With w = K^-1 q' (K from ``euler_rates``) the momenta are p = K^-T I w, so that the body's angular momentum is
I w = K^T p and H = L . I^-1 L / 2 + U(q), of which heyoka derives Hamilton's equations (Goldstein, ch. 8).
It serves every load with a potential, one that moves with an orbit included.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model import rotations
from rigidsim.model.carriers import carried_beside
from rigidsim.model.formulations import AttitudeStates, euler_states
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.numbers import Rounder, ScaledNumbers
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Scaling
from rigidsim.scene import attitude as numeric
from rigidsim.scene.arithmetic import apply, dot, multiply, negligible
from rigidsim.scene.scene import Scene

MOMENTA = ["p_phi", "p_theta", "p_psi"]


@dataclass(frozen=True)
class CanonicalStates:
    """Angles, momenta, and the body rates as expressions of them.

    Attributes:
        attitude: states as in the Euler-angle formulation.
        rates: angular velocity, body axes, in units of 1/time.
        initial_momenta: canonical momenta at the start (mpf), internal units.
    """

    attitude: AttitudeStates
    rates: list[Symbolic]
    initial_momenta: list[Any]


def canonical_states(
    scene: Scene, scaling: Scaling, numbers: ScaledNumbers, number: Rounder
) -> CanonicalStates:
    """Set up the angles and momenta."""
    context, sequence = scene.context, scene.config.integrator.euler_sequence
    angles = list(hy.make_vars("phi", "theta", "psi"))
    momenta = list(hy.make_vars(*MOMENTA))
    columns = []
    for i in range(3):
        unit = [rotations.constant(float(i == j)) for j in range(3)]
        columns.append(rotations.euler_rates(sequence, angles, unit)[0])
    body = [hy.sum([k * p for k, p in zip(column, momenta, strict=True)]) for column in columns]
    largest = max(abs(x) for row in numbers.inverse_inertia for x in row)
    rates = []
    for row in numbers.inverse_inertia:
        tiny = largest * negligible(context)
        terms = [number(x) * m for x, m in zip(row, body, strict=True) if abs(x) > tiny]
        rates.append(hy.sum(terms) if terms else hy.expression(0.0))
    attitude = euler_states(scene, rates)
    return CanonicalStates(attitude, rates, _initial_momenta(scene, scaling, attitude.initial))


def _initial_momenta(scene: Scene, scaling: Scaling, angles: list[Any]) -> list[Any]:
    """Projections of the angular momentum on the three axes that the angles turn about."""
    context, sequence = scene.context, scene.config.integrator.euler_sequence
    body = apply(scene.body.inertia, scene.angular_velocity)
    momentum = apply(numeric.rotation_matrix(scene.quaternion), body)
    turned = numeric.rotation_matrix([context.one] + [context.zero] * 3)
    projections = []
    for angle, axis in zip(angles, sequence, strict=True):
        index = numeric.AXES.index(axis)
        direction = [row[index] for row in turned]
        projections.append(context.ldexp(dot(direction, momentum), -scaling.momentum))
        quaternion = numeric.quaternion_from_euler(context, [angle, context.zero, context.zero], axis * 3)
        turned = multiply(turned, numeric.rotation_matrix(quaternion))
    return projections


def hamilton_equations(m: Mechanics) -> list[Symbolic]:
    """Right-hand sides for the three angles, then the three momenta.

    Raises:
        ConfigError: a load without a potential.
    """
    if beside := carried_beside(m.loads):
        what = f'given "canonical", but {beside}; choose another formulation'
        raise ConfigError(Problem("[integrator] formulation", what))
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
    angles = list(hy.make_vars("phi", "theta", "psi"))
    momenta = list(hy.make_vars(*MOMENTA))
    # an orbit's phase and a position are no coordinates of the rotation: parameters take their place
    own = {"phi", "theta", "psi", *MOMENTA}
    foreign = [hy.make_vars(name) for name in hy.get_variables(hamiltonian) if name not in own]
    there = {x: hy.par[i] for i, x in enumerate(foreign)}
    back = {hy.par[i]: x for i, x in enumerate(foreign)}
    derived = hy.hamiltonian(hy.subs(hamiltonian, there), angles, momenta)
    return [hy.subs(right, back) for _, right in derived]
