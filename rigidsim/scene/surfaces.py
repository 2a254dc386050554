"""Switching surfaces of a scene, on which the argument of a ``sign`` in one of its expressions vanishes.

Surfaces are the same whatever the formulation and the precision; arguments in a constant ratio share one.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rigidsim.scene.arithmetic import GUARD_BITS, negligible
from rigidsim.scene.expressions.names import PROVIDERS
from rigidsim.scene.expressions.piecewise import on_sides
from rigidsim.scene.expressions.tree import (
    Expression,
    ExpressionError,
    evaluate,
    names_used,
    nodes,
    operations,
    readables,
)
from rigidsim.scene.scene import Scene

_STATES = 4  # states at which expressions are compared; two that agree at all of them count as equal
_TRIALS = 32  # attempts: some expressions have no value everywhere
_BITS = 60  # of agreement, far fewer than the scene's arithmetic has

PLATES = "[body] surfaces"
"""How the place of a surface begins that is a plate of the body, and no expression of the user's."""


@dataclass(frozen=True)
class Surface:
    """Where ``expression`` is zero: the function with the kink or jump as written, and its place."""

    expression: Expression
    text: str

    @property
    def where(self) -> str:
        """Its key in the config."""
        return self.expression.where

    @property
    def remedy(self) -> str:
        """What makes it smooth."""
        if self.where.startswith(PLATES):
            return "take a sphere in place of the plate"
        return "make the change smooth, for instance tanh(u/width) in place of sign(u)"


@dataclass(frozen=True)
class Surfaces:
    """All surfaces of a scene, in the order of the config.

    Attributes:
        places: for each argument of a sign, the index of its surface, and the sign (1 or -1) of their ratio.
        turning: Euler angles whose full turns matter to some expression.
        signed: whether the sign of the quaternion matters to some expression.
    """

    found: tuple[Surface, ...] = ()
    places: Mapping[Expression, tuple[int, int]] = field(default_factory=dict)
    turning: tuple[str, ...] = ()
    signed: bool = False

    @property
    def parameters(self) -> int:
        """Number of parameters that give sides, turns and the sign, at most."""
        return len(self.found) + len(self.turning) + self.signed


def surfaces_of(scene: Scene) -> Surfaces:
    """Find the surfaces in the loads and events of a scene."""
    expressions = scene.formulas()
    arguments: dict[Expression, Surface] = {}
    for expression in expressions:
        for node in operations(expression):
            if node.operator == "sign" and names_used(node.operands[0]):
                arguments.setdefault(node.operands[0], Surface(node.operands[0], node.text))
    read = {readable.name: readable for readable in readables(*expressions)}
    if not arguments and not any("attitude" in readable.states for readable in read.values()):
        return Surfaces()
    states = random_states(scene)
    context = scene.context
    found: list[Surface] = []
    places: dict[Expression, tuple[int, int]] = {}
    first: dict[int, tuple[int, int]] = {}  # of each kind: its place
    kinds = _kinds(arguments, states, context)
    for argument, surface in arguments.items():
        kind, sign = kinds[argument]
        if kind not in first:
            first[kind] = len(found), sign
            found.append(surface)
        places[argument] = first[kind][0], sign * first[kind][1]
    parts = [*expressions, *(s.expression for s in found)]
    turn = 2 * context.pi
    turning = tuple(
        name
        for name, readable in sorted(read.items())
        if readable.turns
        and any(changes(part, states, {name: lambda x: x + turn}, context) for part in parts)
    )
    opposite = {name: lambda x: -x for name, readable in read.items() if readable.changes_sign}
    signed = any(changes(part, states, opposite, context) for part in parts)
    return Surfaces(tuple(found), places, turning, signed)


def random_states(scene: Scene) -> list[dict[str, Any]]:
    """Values (mpf, SI) of all names at random states similar to the start, always the same ones."""
    generator = random.Random(0)
    starts = [(provider, provider.at_start(scene)) for provider in PROVIDERS]
    states = []
    for _ in range(_TRIALS):
        state: dict[str, Any] = {}
        for provider, start in starts:
            state |= provider.at_random(scene, start, generator)
        states.append(state)
    return states


def changes(
    expression: Expression, states: Sequence[Mapping[str, Any]], moved: Mapping[str, Any], context: Any
) -> bool:
    """Whether an expression changes when values are changed by functions, ``moved``, of those names."""
    if not names_used(expression) & set(moved):
        return False
    compared = 0
    for state in states:
        other = {**state, **{name: move(state[name]) for name, move in moved.items()}}
        before, after = value_at(expression, state, context), value_at(expression, other, context)
        if before is None or after is None:
            continue
        if abs(before - after) > context.ldexp(abs(before) + abs(after), -_BITS):
            return True
        compared += 1
        if compared == _STATES:
            break
    return False


def _kinds(
    arguments: Mapping[Expression, Surface], states: Sequence[Mapping[str, Any]], context: Any
) -> dict[Expression, tuple[int, int]]:
    """The kind of each argument, a number that those in a constant ratio share, and the ratio's sign.

    They are compared in all digits of the scene, and a sign within them has both values at random, wherever
    its own surface lies: ``max(t - 5, 0) - 1`` and ``max(t - 8, 0) - 1`` are equal before 5.
    """
    found: dict[Expression, tuple[int, int]] = {}
    known: list[list[Any]] = []
    generator = random.Random(1)
    drawn = [[generator.choice((1, -1)) for _ in arguments] for _ in states]
    agreement = negligible(context)

    def inner_first(item: tuple[Expression, Surface]) -> int:
        return sum(1 for _ in nodes(item[1].expression))

    with context.workprec(context.prec + GUARD_BITS):
        for node, surface in sorted(arguments.items(), key=inner_first):
            parts = [on_sides(surface.expression, found, sides) for sides in drawn]
            values = [value_at(part, state, context) for part, state in zip(parts, states, strict=True)]
            for index, others in enumerate(known):
                sign = _ratio(values, others, agreement)
                if sign:
                    found[node] = index, sign
                    break
            else:
                found[node] = len(known), 1
                known.append(values)
    return found


def value_at(expression: Expression, state: Mapping[str, Any], context: Any) -> Any | None:
    """The value of an expression (mpf); None where it has none."""
    try:
        return evaluate(expression, state, context)
    except ExpressionError:
        return None


def _ratio(values: Sequence[Any], others: Sequence[Any], agreement: Any) -> int:
    """Sign of the constant ratio of two rows of values; 0 if the ratio isn't constant."""
    pairs = [(a, b) for a, b in zip(values, others, strict=True) if a is not None and b is not None]
    pairs = [(a, b) for a, b in pairs if a != 0 or b != 0]
    if len(pairs) < _STATES or any(b == 0 or a == 0 for a, b in pairs):
        return 0
    first = pairs[0][0] / pairs[0][1]
    if any(abs(a / b - first) > agreement * abs(first) for a, b in pairs[1:]):
        return 0
    return 1 if first > 0 else -1
