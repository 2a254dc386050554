"""What names in expressions stand for: time and the body's own, and the way from any name to heyoka.

Other names are provided where the things are that they speak of, see ``rigidsim.scene.expressions.names``.
"""

from __future__ import annotations

import random
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import heyoka as hy

from rigidsim.model.heyoka_expressions import carries_sign, plain_angles, to_heyoka
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.rotations import Symbolic, quaternion_from_matrix
from rigidsim.model.two_part import TwoPartTime
from rigidsim.scene.attitude import euler_from_matrix, rotation_matrix
from rigidsim.scene.expressions.names import (
    BODY_NAMES,
    EULER_NAMES,
    POSITION_NAMES,
    PROVIDERS,
    QUATERNION_NAMES,
    RATE_NAMES,
    VELOCITY_NAMES,
    NameProvider,
    Readable,
)
from rigidsim.scene.expressions.tree import Expression, evaluate, names_used
from rigidsim.scene.initial_values import start_values
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.surfaces import random_states, value_at

_ROUNDING = 2.0**-16  # of a quantity's size, by which it may be negative where it ends at zero


def _state_names(m: Kinematics, names: Collection[str], *, clocked: bool) -> dict[str, Any]:
    """Expressions in SI units for the names that a user's expression reads; a ``TwoPartTime`` where the time
    takes two numbers, and ``clocked``.
    """
    found: dict[str, Any] = {}
    for provider in PROVIDERS:
        found |= provider.expressions(m, names)
    if clocked and m.clocked and "t" in names:
        place = len(m.surfaces.found) + len(m.surfaces.turning) + carries_sign(m)
        context = m.scene.context
        found["t"] = TwoPartTime(context.ldexp(context.one, m.scaling.time), hy.par[place])
    return {name: found[name] for name in names}


def written(m: Kinematics, expressions: Iterable[Expression], *, clocked: bool = True) -> list[Symbolic]:
    """A user's expressions in heyoka's terms, SI; the time takes two numbers where it needs them and
    ``clocked``.
    """
    context = m.scene.context
    found = []
    for x in expressions:
        names = names_used(x)
        guess = m.guess() if names else None
        known = {} if guess is not None else _state_names(m, names, clocked=clocked)
        found.append(guess if guess is not None else to_heyoka(x, known, m.number, context, m.sides))
    return found


def above_zero(m: Kinematics, expression: Expression) -> Symbolic:
    """An expression over its size at the start, or else at random states, plus a rounding by which it may be
    negative where it ends at zero.
    """
    context, values = m.scene.context, start_values(m.scene)
    size = evaluate(expression, values, context)
    if size == 0:
        found = (value_at(expression, state, context) for state in random_states(m.scene))
        size = context.maximum([context.zero, *(abs(x) for x in found if x is not None)]) or context.one
    return m.number(1 / size) * written(m, [expression])[0] + _ROUNDING


def in_si(m: Kinematics, expression: Symbolic, exponent: int) -> Symbolic:
    """An expression in a unit of 2^exponent, as one in SI."""
    context = m.scene.context
    return expression if exponent == 0 else m.number(context.ldexp(context.one, exponent)) * expression


class BodyNames(NameProvider):
    """Time, and the body's rates, attitude and flight."""

    brings = "x, y, z, vx, vy, vz with a position or velocity in [initial]"

    def names(self, config: Config) -> Iterable[Readable]:
        """Those of a flight only where the body has one."""
        return (x for x in BODY_NAMES.values() if _flies(config) or "flight" not in x.states)

    def elsewhere(self, config: Config) -> str:
        """Those of a flight."""
        return "" if _flies(config) else self.brings

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """As the scene says."""
        angles = scene.euler_angles
        if angles is None:
            matrix = rotation_matrix(scene.quaternion)
            sequence = scene.config.integrator.euler_sequence
            angles = euler_from_matrix(scene.context, matrix, sequence)
        found = {"t": scene.start}
        found |= zip(RATE_NAMES, scene.angular_velocity, strict=True)
        found |= zip((*QUATERNION_NAMES, *EULER_NAMES), [*scene.quaternion, *angles], strict=True)
        if scene.position is not None and scene.velocity is not None:
            flight = [*scene.position, *scene.velocity]
            found |= zip((*POSITION_NAMES, *VELOCITY_NAMES), flight, strict=True)
        return found

    def at_random(
        self, scene: Scene, start: Mapping[str, Any], generator: random.Random
    ) -> Mapping[str, Any]:
        """Any attitude at any time of the run, rates and flight about as large as at the start."""
        draw, context = generator.uniform, scene.context
        rates = max((abs(w) for w in scene.angular_velocity), default=context.zero) or context.one
        q = [context.mpf(generator.gauss(0, 1)) for _ in range(4)]
        size = context.sqrt(sum(x * x for x in q))
        state = {"t": scene.start + (scene.end - scene.start) * context.mpf(generator.random())}
        state |= {name: rates * context.mpf(draw(-1, 1)) for name in RATE_NAMES}
        state |= {name: x / size for name, x in zip(QUATERNION_NAMES, q, strict=True)}
        state |= {name: context.mpf(draw(-3, 3)) for name in EULER_NAMES}
        flight = {name: start[name] for name in (*POSITION_NAMES, *VELOCITY_NAMES) if name in start}
        return {**state, **super().at_random(scene, flight, generator)}

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        """Those of the states.

        Parameters ``par[..]`` stand for what the state alone doesn't tell: after the sides of the surfaces,
        the full turns of angles, then the sign of the quaternion, then the second number of the time.
        """
        scaling = m.scaling
        found: dict[str, Any] = {"t": in_si(m, hy.time, scaling.time)}
        for name, state, e in zip(RATE_NAMES, m.rate_states, scaling.rates, strict=True):
            found[name] = in_si(m, state, e - scaling.time)
        if m.attitude is not None and set(names) & {*QUATERNION_NAMES, *EULER_NAMES}:
            quaternion = m.attitude.quaternion
            if m.attitude.quaternion_sign == "nearest" and m.surfaces.found:
                quaternion = quaternion_from_matrix(m.matrix, differentiable=True)
            if carries_sign(m):
                sign = hy.par[len(m.surfaces.found) + len(m.surfaces.turning)]
                quaternion = [sign * x for x in quaternion]
            found |= zip(QUATERNION_NAMES, quaternion, strict=True)
            found |= zip(EULER_NAMES, plain_angles(m), strict=True)
            turn = m.number(2 * m.scene.context.pi)
            for number, name in enumerate(m.surfaces.turning, start=len(m.surfaces.found)):
                found[name] = found[name] + turn * hy.par[number]
        if m.position is not None and m.velocity is not None:
            lengths = [in_si(m, x, scaling.length) for x in m.position]
            found |= zip(POSITION_NAMES, lengths, strict=True)
            found |= zip(VELOCITY_NAMES, [in_si(m, v, scaling.speed) for v in m.velocity], strict=True)
        return found


def _flies(config: Config) -> bool:
    return config.initial.flies


PROVIDERS.insert(0, BodyNames())  # the first, whoever else is loaded before
