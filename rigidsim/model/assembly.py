"""Assembly of a system's states, block by block: equations, initial values, and the reason for each block."""

from __future__ import annotations

from dataclasses import replace

import heyoka as hy

from rigidsim.model.formulations.formulation import Formulation, ModelPlan
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.mechanical import WORK
from rigidsim.model.observables.observable import carries_work
from rigidsim.model.own_states import own_blocks, refuse_taken_names
from rigidsim.model.scaling import Rounder
from rigidsim.model.state_blocks import BODY, StateBlock, joined
from rigidsim.model.step_limiter import pace_block
from rigidsim.model.tangents import GROWTH, tangent_block
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit


def assemble_states(
    plan: ModelPlan, formulation: Formulation, number: Rounder
) -> tuple[Mechanics, list[StateBlock]]:
    """The mechanical quantities of a scene, and its blocks of states in the order of the system."""
    assembled = formulation.assembled(plan, number)
    if assembled is not None:
        return assembled
    requirements, numbers = plan.requirements, plan.numbers
    rates, attitude = formulation.rotation(plan, number)
    flies = requirements.flight
    m = Mechanics.built(
        plan.scene, plan.scaling, numbers, rates, attitude, number,
        vertical=requirements.vertical, flies=flies, loads=list(plan.loads), orbit_tags=plan.orbit_tags,
        surfaces=plan.surfaces, tables=plan.tables, clocked=plan.clocked,
    )  # fmt: skip
    if m.slip is not None and m.attitude is not None and formulation.carries_rates:  # turns by what takes it
        m = replace(m, attitude=formulation.attitude(plan, m.rates, number))
    blocks = formulation.blocks(m, plan)
    if flies:
        blocks.append(_flight_block(m, plan))
    if m.point_masses is not None:  # which feel the forces that the body exerts on them
        pulls = [part for load in m.loads for part in load.reaction(m)]
        blocks.append(m.point_masses.block(pulls))
    blocks += _load_blocks(m)
    blocks += own_blocks(m)
    if carries_work(m):
        why, unit = "work of the loads without a potential, to check the energy", [m.work_unit]
        blocks.append(
            StateBlock([WORK], [m.carried(m.power)], [m.scene.context.zero], exponents=unit, why=why)
        )
    blocks += pace_block(m, joined(blocks))
    if GROWTH in (requirements.record or ()):
        blocks.append(tangent_block(m, blocks))
    refuse_taken_names(m.scene, blocks)
    return m, blocks


def _flight_block(m: Mechanics, plan: ModelPlan) -> StateBlock:
    """x' = v and v' = force over mass, in the units of position and speed."""
    context, scaling = m.scene.context, m.scaling
    ratio = m.number(context.ldexp(context.one, scaling.speed + scaling.time - scaling.length))
    accelerations = [hy.sum([m.number(v[i]) * x for v, x in m.force if v[i] != 0]) for i in range(3)]
    initial = [context.ldexp(x, -scaling.length) for x in m.carried(m.scene.position)]
    initial += [context.ldexp(v, -scaling.speed) for v in m.carried(m.scene.velocity)]
    return StateBlock(
        [*BODY.position, *BODY.velocity],
        [*(ratio * v for v in m.carried(m.velocity)), *accelerations],
        initial,
        exponents=[scaling.length] * 3 + [scaling.speed] * 3,
        why=plan.requirements.why["flight"],
    )


def _load_blocks(m: Mechanics) -> list[StateBlock]:
    """Orbits, each once for all loads on it, and any other states that loads bring."""
    blocks: list[StateBlock] = [] if m.sky is None else [m.sky.block()]
    carried: set[KeplerOrbit | TabulatedOrbit] = set()
    for load in m.loads:
        if (orbit := load.orbit) is not None and orbit not in carried:
            carried.add(orbit)
            titles = ", ".join(dict.fromkeys(x.title for x in m.loads if x.orbit == orbit))
            block = m.orbit(orbit).block
            blocks.append(replace(block, why=block.why or f"{titles}: where its source is"))
        if (table := load.table) is not None and table not in carried:
            carried.add(table)
            block = m.table(table).block
            blocks.append(replace(block, why=f'{load.title}: where its source is, by "{table.name}"'))
        own = load.extra_states(m)
        if own is not None:
            blocks.append(replace(own, why=own.why or f"{load.title}: where its source is"))
    return blocks
