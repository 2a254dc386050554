"""Switching surfaces of a scene, on which the argument of a ``sign`` in one of its expressions vanishes.

Surfaces are the same whatever the formulation and the precision; arguments in a constant ratio share one.

Parts of an expression may change abruptly, too, and no step must pass over them.

A pulse such as ``exp(-((t-50)/0.01)^2)`` or a switch such as ``tanh((t-5)/0.001)`` is flat almost everywhere:
its Taylor series show nothing of what comes, and a step chosen by them passes over it. The change
happens where the function's argument is of order one, and the argument itself isn't flat: see
``rigidsim.model.step_limiter``. A root of something that touches zero, such as a vanishing norm, likewise
continues smoothly along the wrong branch.

What happens abruptly at a time has to be known to more digits than one number holds: a double gives times
around 5000 s to 1e-12 s, and a pulse between times rounded so, or a spike whose argument (t - 5000.3)/0.01 is
worked out from such a time, gives another impulse than the one that was written.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rigidsim.scene.arithmetic import GUARD_BITS, negligible
from rigidsim.scene.expressions.names import PROVIDERS
from rigidsim.scene.expressions.tree import (
    Constant,
    Expression,
    ExpressionError,
    LineInTime,
    bounds,
    constant,
    evaluate,
    lines_in,
    names_used,
    nodes,
    on_sides,
    operations,
    placed,
    rational_value,
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
    its own surface lies: ``max(t - 5, 0) - 1`` and ``max(t - 8, 0) - 1`` are equal before 5. At four states
    in place of all, 6 of 40 random sums of nested maxima had arguments taken for others.
    """
    found: dict[Expression, tuple[int, int]] = {}
    known: list[list[Any]] = []
    generator = random.Random(1)
    drawn = [[generator.choice((1, -1)) for _ in arguments] for _ in states]
    agreement = negligible(context)

    inner_first = sorted(arguments.items(), key=lambda item: sum(1 for _ in nodes(item[1].expression)))
    with context.workprec(context.prec + GUARD_BITS):
        for node, surface in inner_first:
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


# --- parts that may change abruptly -------------------------------------------------------------------------

WIDE = 4.0
"""Bound within which an argument can't run through a function's whole transition."""
_FLAT = frozenset({"exp", "sinh", "cosh", "tanh", "erf", "sigmoid", "atan"})
"""Functions that become flat towards an end."""
_STEEP_POWER = 8  # higher ones vanish to an order near the Taylor method's
_LATE = 64
"""Ratio of a time to the width of what happens then from which a rounded time counts: below it the error, a
part in 2^46 of the impulse in double precision, is no more than the rounding of some steps.
"""


def narrow_parts(*expressions: Expression) -> list[Expression]:
    """Arguments of flat functions, denominators, bases of negative or high powers, if they leave ``WIDE``."""
    found: dict[Expression, None] = {}
    for node in (node for expression in expressions for node in operations(expression)):
        part: Expression | None = None
        if node.operator in _FLAT:
            part = node.operands[0]
        elif node.operator == "quotient":
            part = node.operands[1]
        elif node.operator == "power":
            base, power = node.operands
            low, high = bounds(power, always=False)
            if max(-low, high) > _STEEP_POWER and isinstance(power, Constant):
                part = placed(power * base, base.place)  # flat to a part in n of the base
            elif not isinstance(power, Constant) or power.value.sign < 0:
                part = base
        if part is not None and not isinstance(part, Constant):
            low, high = bounds(part, always=False)
            if max(-low, high) > WIDE:
                found[part] = None
    return list(found)


def root_parts(*expressions: Expression) -> list[Expression]:
    """Radicands that may touch zero, where the root has a kink; not those that are positive by their form."""
    found: dict[Expression, None] = {}
    for node in (node for expression in expressions for node in operations(expression)):
        part: Expression | None = None
        if node.operator == "sqrt":
            part = node.operands[0]
        elif node.operator == "power":
            base, power = node.operands
            exponent = rational_value(power)
            part = base if exponent is None or exponent.denominator != 1 else None
        elif node.operator in ("asin", "acos"):
            (x,) = node.operands
            part = placed(1 - x ** constant(2), x.place)
        if part is not None and not isinstance(part, Constant) and not bounds(part)[0] > 0:
            found[part] = None
    return list(found)


def happens_at_a_moment(scene: Scene) -> bool:
    """Whether a load or a state switches at a time, or changes late and within a short while."""
    acting = scene.acting_formulas()
    switching = (_within(line, scene) for x in acting for line in _of_switches(x, scene.context))
    return any(switching) or any(_late(part, scene) for part in narrow_parts(*acting))


def acts_at_moments_alone(scene: Scene) -> bool:
    """Whether loads depend on time by distances from moments alone, which no rounding of time disturbs."""
    each = [load.formulas() for load in scene.loads]
    each += [[state.derivative] for state in scene.states if "t" in names_used(state.derivative)]
    for formulas in each:
        lines = [line for expression in formulas for line in lines_in(expression, scene.context)]
        if not formulas or any(line.offset == 0 for line in lines):
            return False
    return True


def _of_switches(expression: Expression, context: Any) -> list[LineInTime]:
    """Lines in the arguments of signs, which don't pass through zero at t = 0."""
    found = []
    for node in operations(expression):
        if node.operator == "sign":
            found += lines_in(node.operands[0], context)
    return [line for line in found if line.offset != 0]


def _within(line: LineInTime, scene: Scene) -> bool:
    return bool(min(scene.start, scene.end) < line.zero < max(scene.start, scene.end))


def _late(part: Expression, scene: Scene) -> bool:
    """Whether a part that turns a function on or off does so within a small share of the time until then."""
    context = scene.context
    for line in lines_in(part, context):
        if line.offset == 0 or not _within(line, scene):
            continue
        if names_used(part) != {"t"}:
            if abs(line.offset) > _LATE:
                return True
            continue
        after = line.zero * (1 + context.one / _LATE)
        try:
            there, beside = (evaluate(part, {"t": then}, context) for then in (line.zero, after))
        except ExpressionError:  # a pole
            return True
        if abs(beside - there) > max(abs(there), 1):
            return True
    return False
