"""Assembly of a system's states, block by block: equations, initial values, and the reason for each block."""

from __future__ import annotations

from dataclasses import replace

import heyoka as hy

from rigidsim.model.body import BODY
from rigidsim.model.canonical import MOMENTA, CanonicalStates, canonical_states, hamilton_equations
from rigidsim.model.capabilities import Reacting, having, orbit_of, table_of
from rigidsim.model.equations import (
    flight_equations,
    rate_equations,
    vertical_equations,
    vertical_from_attitude,
)
from rigidsim.model.formulations import BUILDERS, AttitudeStates, euler_states
from rigidsim.model.frames.orbital import orbital_states
from rigidsim.model.kinematics import in_common_unit
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.model_plan import ModelPlan
from rigidsim.model.needs import work_is_needed
from rigidsim.model.numbers import Rounder
from rigidsim.model.observables.mechanical import WORK
from rigidsim.model.planar import SPIN, PlanarStates, planar_states, spin_equation
from rigidsim.model.rotations import Symbolic
from rigidsim.model.state_blocks import StateBlock, joined
from rigidsim.model.step_limiter import PACE, arguments, pace_derivative, roots
from rigidsim.model.tangents import GROWTH, tangent_block
from rigidsim.scene import attitude as numeric
from rigidsim.scene.arithmetic import apply, transpose
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit

RATES, VERTICAL, POSITION, VELOCITY = BODY.rates, BODY.vertical, BODY.position, BODY.velocity


def assemble_states(
    plan: ModelPlan, number: Rounder, sequence: str | None = None
) -> tuple[Mechanics, list[StateBlock]]:
    """The mechanical quantities of a scene, and the blocks of its states in the order of the system.

    Args:
        number: rounds an mpf once to the working precision's scalar.
        sequence: sequence of the Euler angles that are states, if it isn't the scene's.

    Raises:
        ConfigError: a load without a potential in the canonical formulation.
    """
    requirements, numbers = plan.requirements, plan.numbers
    if plan.average is not None:
        from rigidsim.model.averaged.states import averaged_states

        return averaged_states(
            plan.scene,
            plan.average,
            plan.loads,
            plan.scaling,
            numbers,
            plan.orbit_tags,
            plan.tables,
            number,
        )
    canonical = None
    if requirements.canonical:
        canonical = canonical_states(plan.scene, plan.scaling, numbers, number)
    planar = None
    if plan.plane is not None:
        planar = planar_states(plan.scene, plan.plane, plan.scaling.time, number)
    of_states = canonical or planar
    rate_states = of_states.rates if of_states else list(hy.make_vars(*RATES))
    rates = in_common_unit(rate_states, numbers.rate_units, number)
    attitude = of_states.attitude if of_states else _attitude(plan, rates, number, sequence)
    vertical = None
    if attitude is not None and numbers.arm is not None:
        vertical = vertical_from_attitude(attitude.matrix, numbers, number)
    elif requirements.vertical:
        vertical = list(hy.make_vars(*VERTICAL))
    flies = requirements.flight
    m = Mechanics(
        plan.scene,
        plan.scaling,
        numbers,
        rate_states,
        attitude,
        vertical,
        list(hy.make_vars(*POSITION)) if flies else None,
        list(hy.make_vars(*VELOCITY)) if flies else None,
        number,
        plan.orbit_tags,
        plan.surfaces,
        plan.tables,
        plan.clocked,
        loads=list(plan.loads),
    )
    if canonical is not None:
        blocks = [_canonical_block(m, canonical, plan)]
    elif planar is not None:
        blocks = [_planar_block(m, planar, plan)]
    else:
        blocks = _rotation_blocks(m, plan)
    if flies:
        blocks.append(_flight_block(m, plan))
    blocks += _point_mass_blocks(m)
    blocks += _load_blocks(m)
    if work_is_needed(m):
        blocks.append(_work_block(m))
    blocks += _pace_block(m, joined(blocks))
    if GROWTH in (requirements.record or ()):
        blocks.append(tangent_block(m, blocks))
    return m, blocks


def _attitude(
    plan: ModelPlan, rates: list[Symbolic], number: Rounder, sequence: str | None
) -> AttitudeStates | None:
    """Attitude states of a formulation that carries an attitude besides the rates; None if none is
    carried.
    """
    scene, formulation = plan.scene, plan.requirements.formulation
    if formulation == "rates":
        return None
    if formulation == "euler_angles":
        return euler_states(scene, rates, sequence)
    if plan.frame_orbit is not None:
        unit = scene.context.ldexp(scene.context.one, plan.scaling.time)
        return orbital_states(scene, rates, plan.frame_orbit, plan.orbit_tags[plan.frame_orbit], unit, number)
    return BUILDERS[formulation](scene, rates)


def _canonical_block(m: Mechanics, states: CanonicalStates, plan: ModelPlan) -> StateBlock:
    return StateBlock(
        [*states.attitude.names, *MOMENTA],
        hamilton_equations(m),
        [*states.attitude.initial, *states.initial_momenta],
        exponents=[0] * 3 + [m.scaling.momentum] * 3,
        why=plan.requirements.why["attitude"],
    )


def _planar_block(m: Mechanics, states: PlanarStates, plan: ModelPlan) -> StateBlock:
    assert plan.plane is not None
    return StateBlock(
        [*states.attitude.names, SPIN],
        [
            *states.attitude.derivatives,
            spin_equation(plan.plane, m.numbers, m.torque, m.number, m.scene.context),
        ],
        [*states.attitude.initial, states.initial_spin],
        exponents=[states.attitude.angle_unit, -m.scaling.time],
        why=plan.requirements.why["attitude"],
    )


def _rotation_blocks(m: Mechanics, plan: ModelPlan) -> list[StateBlock]:
    """Body rates, and the attitude or the vertical."""
    scene, scaling, why = m.scene, m.scaling, plan.requirements.why
    initial = [
        scene.context.ldexp(w, scaling.time - e)
        for w, e in zip(scene.angular_velocity, scaling.rates, strict=True)
    ]
    exponents = [e - scaling.time for e in scaling.rates]
    turning = rate_equations(m, [*m.torque, *m.inner_torque])
    blocks = [StateBlock(RATES, turning, initial, exponents=exponents, why=why["rates"])]
    if m.attitude is not None:
        reason = why["attitude"]
        if m.attitude.orbital is not None:
            reason += "; relative to the frame that turns with the orbit, where the gradient takes a third "
            reason += "fewer products"
        blocks.append(StateBlock(m.attitude.names, m.attitude.derivatives, m.attitude.initial, why=reason))
    elif plan.requirements.vertical:
        assert m.numbers.up is not None
        seen = apply(transpose(numeric.rotation_matrix(scene.quaternion)), m.numbers.up)
        turning = vertical_equations(m.carried(m.vertical), m.rates)
        blocks.append(StateBlock(VERTICAL, turning, seen, why=why["vertical"]))
    return blocks


def _flight_block(m: Mechanics, plan: ModelPlan) -> StateBlock:
    context, scaling = m.scene.context, m.scaling
    x_rates, v_rates = flight_equations(m, m.force)
    initial = [context.ldexp(x, -scaling.length) for x in m.carried(m.scene.position)]
    initial += [context.ldexp(v, -scaling.speed) for v in m.carried(m.scene.velocity)]
    return StateBlock(
        [*POSITION, *VELOCITY],
        [*x_rates, *v_rates],
        initial,
        exponents=[scaling.length] * 3 + [scaling.speed] * 3,
        why=plan.requirements.why["flight"],
    )


def _point_mass_blocks(m: Mechanics) -> list[StateBlock]:
    """States of the point masses besides the body, and the forces that the body exerts on them."""
    states = m.point_masses
    if states is None:
        return []
    states.react([part for load in having(Reacting, m.loads) for part in load.reaction(m)])
    return [states.block()]


def _load_blocks(m: Mechanics) -> list[StateBlock]:
    """Orbits, each once for all loads on it, and any other states that loads bring."""
    blocks: list[StateBlock] = []
    placed: dict[KeplerOrbit, list[str]] = {}
    carried: set[TabulatedOrbit] = set()
    for load in m.loads:
        if (orbit := orbit_of(load)) is not None:
            placed.setdefault(orbit, []).append(load.title)
    for load in m.loads:
        if (orbit := orbit_of(load)) is not None and orbit in placed:
            titles = ", ".join(dict.fromkeys(placed.pop(orbit)))
            block = m.orbit_block(orbit)
            blocks.append(replace(block, why=block.why or f"{titles}: where its source is"))
        if (table := table_of(load)) is not None and table not in carried:
            carried.add(table)
            block = m.table(table).block
            blocks.append(replace(block, why=f'{load.title}: where its source is, by "{table.name}"'))
        own = load.extra_states(m)
        if own is not None:
            blocks.append(replace(own, why=own.why or f"{load.title}: where its source is"))
    return blocks


def _work_block(m: Mechanics) -> StateBlock:
    why = "work of the loads without a potential, to check the energy"
    return StateBlock([WORK], [m.carried(m.power)], [m.scene.context.zero], exponents=[m.work_unit], why=why)


def _pace_block(m: Mechanics, before: StateBlock) -> list[StateBlock]:
    """The state that keeps steps from passing over a pulse or a switch; none if the loads have neither."""
    watched, rooted = arguments(m), roots(m)
    if not (watched or rooted):
        return []
    carried = dict(zip(before.names, before.derivatives, strict=True))
    titles = ", ".join(dict.fromkeys(title for title, _ in [*watched, *rooted]))
    derivative = pace_derivative([u for _, u in watched], [v for _, v in rooted], carried)
    what = " or ".join(["what is narrow"] * bool(watched) + ["a root of zero"] * bool(rooted))
    why = f"{titles}: no step may pass over {what} in it"
    return [StateBlock([PACE], [derivative], [m.scene.context.zero], why=why)]
