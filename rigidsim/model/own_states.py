"""``[[states]]`` in the equations: what reads them, their blocks, units and recorded variables.

A state of one's own is carried in a unit of 2^n of its SI unit. Step control is relative to the largest
state, and absolute below 1: one that grew far beyond 1 would loosen the steps of all others. Its size is
estimated by following the motion roughly, for some hundred steps at most.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.names import in_si, written
from rigidsim.model.scaling import exponent
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.expressions.names import BODY_NAMES, NameProvider, Readable, provides
from rigidsim.scene.expressions.tree import evaluate, names_used
from rigidsim.scene.initial_values import start_values
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.surfaces import changes, random_states
from rigidsim.scene.transitions import narrow_parts, root_parts

_MARGIN = 1.0625
"""Over the largest value seen, so that one that tends to a power of two keeps its unit."""
_TRIAL_STEPS = 300
_TRIAL_TOLERANCE = 1e-6
_MOST_GROWTH = 100  # bits
_STALLED = 0.01  # of the time of a trial in the second half of its steps: near a pole they tell nothing
_GROWS = 1.5  # from the first half of a trial to the second: as much again for each half that follows


@provides
class OwnStateNames(NameProvider):
    """States of one's own by their names."""

    brings = "your own with [[states]]"

    def names(self, config: Config) -> Iterable[Readable]:
        """All of the config, whether they are carried or not."""
        for x in config.states:
            yield Readable(x.name, "" if x.unit == "1" else x.unit, frozenset({x.name}))

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """As given."""
        return {x.name: x.initial for x in scene.states}

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        """The states themselves."""
        own = [x.name for x in m.scene.states if x.name in names]
        return {name: in_si(m, hy.make_vars(name), m.scaling.own.get(name, 0)) for name in own}


def own_blocks(m: Kinematics) -> list[StateBlock]:
    """A block for each state of one's own."""
    context, blocks = m.scene.context, []
    for state in m.scene.states:
        unit = m.scaling.own.get(state.name, 0)
        (rate,) = written(m, [state.derivative])
        ratio = context.ldexp(context.one, m.scaling.time - unit)
        rate = hy.expression(rate) if ratio == 1 else m.number(ratio) * rate
        start = context.ldexp(state.initial, -unit)
        blocks.append(StateBlock([state.name], [rate], [start], exponents=[unit], why=state.why))
    return blocks


def refuse_taken_names(scene: Scene, blocks: Iterable[StateBlock]) -> None:
    """Refuse a state of one's own with the name of another state of the equations.

    Raises:
        ConfigError: says which.
    """
    names = [name for block in blocks for name in block.names]
    for number, table in enumerate(scene.config.states, start=1):
        if names.count(table.name) > 1:
            what = f'given "{table.name}", which another state of the motion is called already; rename it'
            raise ConfigError(Problem(f"[[states]] number {number} name", what))


def refuse_odd_states(scene: Scene) -> None:
    """Refuse a derivative that differs between q and -q, as loads that do are refused.

    Raises:
        ConfigError: says what to write instead.
    """
    opposite = {name: lambda x: -x for name, readable in BODY_NAMES.items() if readable.changes_sign}
    reading = [state for state in scene.states if names_used(state.derivative) & set(opposite)]
    states = random_states(scene) if reading else []
    for state in reading:
        if changes(state.derivative, states, opposite, scene.context):
            what = (
                "changes with the sign of the quaternion, while q and -q are the same attitude; use products "
            )
            raise ConfigError(
                Problem(state.where, what + "such as qw*qx, or say where it jumps: sign(qw)*qx")
            )


def narrow_arguments(m: Kinematics) -> list[tuple[str, Any]]:
    """(description, argument) of what is narrow in derivatives, as ``capabilities.Narrow`` has of loads."""
    return [
        (f"state {state.name}", u)
        for state in m.scene.states
        for u in written(m, narrow_parts(state.derivative))
    ]


def radicands(m: Kinematics) -> list[tuple[str, Any]]:
    """(description, radicand) of roots in derivatives, as ``capabilities.Rooted`` has of loads."""
    states = m.scene.states
    return [(f"state {state.name}", u) for state in states for u in written(m, root_parts(state.derivative))]


# --- units --------------------------------------------------------------------------------------------------


def first_units(scene: Scene, time: int) -> dict[str, int]:
    """Exponents by initial values, and by derivatives at the start over a unit of time."""
    context, values = scene.context, start_values(scene)
    unit = context.ldexp(context.one, time)
    return units_along(
        scene, {x.name: abs(evaluate(x.derivative, values, context)) * unit for x in scene.states}
    )


def units_along(scene: Scene, sizes: Mapping[str, Any]) -> dict[str, int]:
    """Exponents by sizes (mpf, SI), and by initial values, which keep their digits in single precision."""
    context, found = scene.context, {}
    for state in scene.states:
        start = abs(state.initial)
        unit = exponent(context, context.maximum([start, sizes[state.name]]))
        found[state.name] = unit if start == 0 else min(unit, exponent(context, start) + _MOST_GROWTH)
    return found


def sizes_along(
    scene: Scene, units: Mapping[str, int], blocks: Iterable[StateBlock], begin: float, end: float
) -> dict[str, Any]:
    """About the largest values (mpf, SI) that the states reach, by a rough integration of the equations in
    double precision: those that still grow at its end are taken to go on as they did, and those of a motion
    that breaks down on the way to have their first ones.

    Args:
        begin, end: of the run, internal units.
    """
    whole = list(blocks)
    names = [name for block in whole for name in block.names]
    equations = [pair for block in whole for pair in zip(block.variables, block.derivatives, strict=True)]
    start = [float(x) for block in whole for x in block.initial]
    engine = hy.taylor_adaptive(
        equations, start, time=begin, tol=_TRIAL_TOLERANCE, compact_mode=True, opt_level=0
    )
    places = [names.index(state.name) for state in scene.states]
    times, values = [begin], [np.abs(engine.state[places])]
    for _ in range(_TRIAL_STEPS):
        outcome, _ = engine.step(max_delta_t=end - engine.time)
        if outcome not in (hy.taylor_outcome.success, hy.taylor_outcome.time_limit):
            break
        times.append(engine.time)
        values.append(np.abs(engine.state[places]))
        if engine.time >= end:
            break
    moments, sizes = np.array(times), np.array(values)
    slow = moments[-1] - moments[len(moments) // 2] < _STALLED * (moments[-1] - moments[0])
    if moments[-1] < end and (slow or outcome == hy.taylor_outcome.err_nf_state):
        return {name: scene.context.ldexp(1, unit) for name, unit in units.items()}
    early = moments <= (moments[0] + moments[-1]) / 2
    first, last = sizes[early].max(axis=0), sizes.max(axis=0)
    halves = 2 * (end - moments[-1]) / max(moments[-1] - moments[0], 1e-300)
    reached = np.where(last > _GROWS * first, last + (last - first) * halves, last)
    found = dict(units)
    for state, size in zip(scene.states, reached, strict=True):
        if 0 < size < math.inf:
            found[state.name] += math.frexp(_MARGIN * float(size))[1]
    return {name: scene.context.ldexp(1, unit) for name, unit in found.items()}
