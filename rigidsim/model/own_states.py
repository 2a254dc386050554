"""``[[states]]`` in the equations: what reads them, their blocks, units and recorded variables.

A user-defined state is carried in a unit of 2^n of its SI unit. Step control is relative to the largest
state, and absolute below 1: one that grew far beyond 1 would loosen the steps of all others. Its size is
estimated from its initial value, and from its derivative at the start and in a few states like it; the length
of the run doesn't enter, so that a run can be prolonged.
"""

from __future__ import annotations

import random
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.names import in_si, written
from rigidsim.model.scaling import Scaling, exponent
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.expressions.names import BODY_NAMES, RATE_NAMES, NameProvider, Readable, provides
from rigidsim.scene.expressions.tree import Expression, ExpressionError, evaluate, names_used
from rigidsim.scene.scene import Scene, start_values
from rigidsim.scene.schema import Config
from rigidsim.scene.surfaces import changes, narrow_parts, random_states

_TO_AND_FRO, _ONWARD = 6, 10
"""Binary exponents of the units of time over which a state adds up its derivative if nothing brings it back:
10 turns if that has both signs, 160 if it has one. A state that adds up for longer, or less, loses
little: steps in double precision cut off a fiftieth of an epsilon.
"""
_ALIKE = 8  # states like the start
_LATEST = 8.0  # binary exponent of the units of time until which functions of time are looked at
_SMALL = -20  # binary exponent of a small part, in difference quotients
_NEWTON = 40  # iterations, each of which halves the distance to a double zero
_TINY, _HUGE = -200, 200  # binary exponents of values without meaning: a spike's flank, a pole
_MOST_GROWTH = 100  # bits


@provides
class OwnStateNames(NameProvider):
    """User-defined states by their names."""

    brings = "your own with [[states]]"

    def names(self, config: Config) -> Iterable[Readable]:
        """All of the config, whether they are carried or not."""
        for _, _, x in config.every_state:
            yield Readable(x.name, "" if x.unit == "1" else x.unit, frozenset({x.name}))

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """As given."""
        return {x.name: x.initial for x in scene.states}

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        """The states themselves."""
        own = [x.name for x in m.scene.states if x.name in names]
        return {name: in_si(m, hy.make_vars(name), m.scaling.own.get(name, 0)) for name in own}


def own_blocks(m: Kinematics) -> list[StateBlock]:
    """A block for each user-defined state."""
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
    """Refuse a user-defined state with the name of another state of the equations.

    Raises:
        ConfigError: says which.
    """
    names = [name for block in blocks for name in block.names]
    for where, number, table in scene.config.every_state:
        ensure(
            names.count(table.name) <= 1,
            ConfigError(
                Problem(
                    f"[[{where}]] number {number + 1} name",
                    f'given "{table.name}", which another state of the motion is called already; rename it',
                )
            ),
        )


def refuse_odd_states(scene: Scene) -> None:
    """Refuse a derivative that differs between q and -q, as loads that do are refused.

    Raises:
        ConfigError: says what to write instead.
    """
    opposite = {name: lambda x: -x for name, readable in BODY_NAMES.items() if readable.changes_sign}
    reading = [state for state in scene.states if names_used(state.derivative) & set(opposite)]
    states = random_states(scene) if reading else []
    for state in reading:
        ensure(
            not changes(state.derivative, states, opposite, scene.context),
            ConfigError(
                Problem(
                    state.derivative.where,
                    "changes with the sign of the quaternion, while q and -q are the same attitude; use "
                    "products such as qw*qx, or write the jump: sign(qw)*qx",
                )
            ),
        )


# --- units --------------------------------------------------------------------------------------------------


def own_units(scene: Scene, scaling: Scaling, like: Mapping[str, int] | None = None) -> dict[str, int]:
    """Binary exponents of the units of user-defined states, from the sizes that they are expected to reach,
    and from initial values, which keep their digits in single precision.

    Args:
        like: units of the same scene in plain numbers.
    """
    context, found = scene.context, {}
    if like is None:
        sizes = _sizes(scene, scaling)
    else:
        sizes = {name: context.ldexp(context.one, unit) for name, unit in like.items()}
    for state in scene.states:
        start = abs(state.initial)
        unit = exponent(context, context.maximum([start, sizes[state.name]]))
        # a start that follows from others may be their rounding, whose digits mean nothing
        given = start != 0 and state.begins is None
        found[state.name] = min(unit, exponent(context, start) + _MOST_GROWTH) if given else unit
    return found


def _sizes(scene: Scene, scaling: Scaling) -> dict[str, Any]:
    """About the largest values (mpf, SI) that user-defined states reach; 0 where they are unknown.

    What drives a state, its derivative where it is zero itself, acts for as long as the state takes to come
    back, or for 10 to 160 turns. One that follows others has its size from theirs.
    """
    context, known = scene.context, {x.name: abs(x.initial) for x in scene.states}
    states = _alike(scene, scaling)
    unit = context.ldexp(context.one, scaling.time)
    brief, long = (context.ldexp(unit, e) for e in (_TO_AND_FRO, _ONWARD))
    for _ in scene.states:
        begin, *others = (
            {**values, **{name: x if not n else x * known[name] for name, x in parts.items()}}
            for n, (values, parts) in enumerate(states)
        )
        sizes = {}
        for x in scene.states:
            times = [{**begin, "t": time} for time in _moments(scene, x.derivative, begin, unit)]
            for longest in (brief, long):
                found = [driven(scene, x.name, given, known, longest) for given in (begin, *times, *others)]
                if min(found) < 0 < max(found):
                    break
            ends = [abs(end) for end in found]
            usual = sorted(end for end in ends[-len(others) :] if end != 0)
            first = ends[: -len(others)]
            sizes[x.name] = context.maximum([abs(x.initial), *first, *usual[len(usual) // 2 :][:1]])
        if sizes == known:
            break
        known = sizes
    return known


def _alike(scene: Scene, scaling: Scaling) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Values of all names and of user-defined states: at the start, and as parts of their sizes at any
    attitude, rates as large as they become, and times that don't depend on the run's end.
    """
    context, generator = scene.context, random.Random(0)
    fastest = [context.ldexp(context.one, e - scaling.time) for e in scaling.rates]
    unit = context.ldexp(context.one, scaling.time)
    found = [(start_values(scene), {x.name: x.initial for x in scene.states})]
    for values in random_states(scene)[:_ALIKE]:
        values["t"] = scene.start + scaling.direction * unit * context.mpf(
            2.0 ** generator.uniform(0.0, _LATEST)
        )
        for name, rate in zip(RATE_NAMES, fastest, strict=True):
            values[name] = rate * context.mpf(generator.uniform(-1, 1))
        parts = {x.name: context.mpf(generator.uniform(-1, 1)) for x in scene.states}
        found.append((values, parts))
    return found


def _moments(scene: Scene, expression: Expression, start: Mapping[str, Any], unit: Any) -> list[Any]:
    """Times (mpf, s) at which arguments of spikes and the like are zero, by Newton's method."""
    context, found = scene.context, []
    step = context.ldexp(unit, 2 * _SMALL)
    for part in narrow_parts(expression):
        if names_used(part) != {"t"}:
            continue
        time = start["t"]
        for _ in range(_NEWTON):
            value, beyond = (_value(part, {"t": x}, context) for x in (time, time + step))
            if value == beyond:
                break
            time -= step * value / (beyond - value)
        found.append(time)
    return found


def driven(scene: Scene, name: str, values: Mapping[str, Any], sizes: Mapping[str, Any], longest: Any) -> Any:
    """To where a state is driven from zero while all others keep some values (mpf, SI).

    Args:
        values: of all names.
        sizes: of user-defined states.
        longest: time that it has, if it doesn't come back before, s.
    """
    context, slopes = scene.context, {x.name: x.derivative for x in scene.states}
    here = {**values, name: context.zero}

    def change(of: str, by: str) -> Any:
        """Partial derivative of one state's slope by another state."""
        if by not in names_used(slopes[of]):
            return context.zero
        step = context.ldexp(sizes[by] or context.one, _SMALL)
        there = {**here, by: here[by] + step}
        return (_value(slopes[of], there, context) - _value(slopes[of], here, context)) / step

    rate = context.maximum(
        abs(change(name, name)) if x == name else context.sqrt(abs(change(name, x) * change(x, name)))
        for x in slopes
    )
    found = _value(slopes[name], here, context) * (longest if rate * longest < 1 else 1 / rate)
    return found if found and _TINY < context.mag(found) < _HUGE else context.zero


def _value(expression: Expression, values: Mapping[str, Any], context: Any) -> Any:
    """Value of an expression, 0 where it has none."""
    try:
        return evaluate(expression, values, context)
    except ExpressionError:
        return context.zero
