"""Users' expressions in heyoka's terms: what names stand for, and constants rounded once.

Time and the body's own names are provided here; others where the things are that they speak of, see
``rigidsim.scene.expressions.names``.

heyoka's own treatment of expressions, and what is done about it here:

- ``x / c`` becomes ``(1/c) * x`` with a reciprocal taken in the working precision: constants are divided
  and reduced in the scene's arithmetic before they get there.
- The Taylor series of ``x**n`` divides by x for every n but 2, so a state that passes through zero ends as
  NaN: whole powers are products of squares.
- ``x**0.5`` and the other fractional powers have no series at zero; what is a square there is rewritten with
  a sign (``rigidsim.scene.expressions.tree``).
- The step is chosen from the series' last terms. They vanish at x = 0 for powers above the method's order
  (20 in double, less with a loose tolerance), and far from a short pulse in t: both can be stepped over.
"""

from __future__ import annotations

import operator
import random
from collections.abc import Collection, Iterable, Mapping
from itertools import accumulate
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics, angles_of_matrix, starts_near_pole
from rigidsim.model.rotations import Symbolic, euler_from_matrix, quaternion_from_matrix
from rigidsim.model.scaling import Rounder
from rigidsim.model.two_part import TwoPartTime, rounded
from rigidsim.scene import attitude
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
from rigidsim.scene.expressions.tree import (
    Constant,
    Expression,
    LineInTime,
    Name,
    Operation,
    evaluate,
    fold,
    line_of,
    names_used,
    operate,
)
from rigidsim.scene.scene import Scene, start_values
from rigidsim.scene.schema import Config
from rigidsim.scene.surfaces import random_states, value_at

_ROUNDING = 2.0**-16  # of a quantity's size, by which it may be negative where it ends at zero
_NO_SIDES: Mapping[Expression, Any] = {}
_LINEAR = ("sum", "negative", "product", "quotient")


def to_heyoka(
    expression: Expression,
    variables: Mapping[str, Any],
    number: Rounder,
    context: Any,
    sides: Mapping[Expression, Any] = _NO_SIDES,
) -> Any:
    """Convert an expression to heyoka's variables; constant parts are worked out in ``context``.

    Args:
        variables: a heyoka expression for every name used; ``t`` is heyoka's time unless it is given here, as
            an expression or as a ``TwoPartTime``.
        sides: for the signs of arguments that are switching surfaces; signs of others are found wherever the
            expression is evaluated, which is right for values alone: a series would go on past the jump.

    Raises:
        ExpressionError: a constant has no finite value, or lies beyond the range of the numbers.
    """

    clock = variables.get("t")

    def literal(node: Expression, value: Any) -> Any:
        """A constant (mpf) or a line in time as an expression; an expression is returned unchanged."""
        if isinstance(value, hy.expression):
            return value
        if isinstance(value, LineInTime):
            assert isinstance(clock, TwoPartTime)
            return clock.expression(value, number, context)
        try:
            return hy.expression(rounded(number(value)))
        except OverflowError:
            what = f"a constant that the working precision can't hold ({context.nstr(value, 6)}: write 0, "
            raise node.error(f"{what}another unit, or another precision) in {node.quoted}") from None

    def of_constant(node: Constant) -> Any:
        return node.value.at(context)

    def of_name(node: Name) -> Any:
        if node.name == "t" and isinstance(clock, TwoPartTime):
            return LineInTime(context.one, context.zero)
        return hy.time if node.name == "t" and "t" not in variables else variables[node.name]

    def of_operation(node: Operation, operands: list[Any]) -> Any:
        """An mpf as long as all operands are constant, a line in time, or an expression."""
        if any(isinstance(operand, LineInTime) for operand in operands):
            operands = _with_lines(node, operands)
            if len(operands) == 1 and node.operator in _LINEAR:
                return operands[0]
            if node.operator == "tanh":  # its own series loses digits on the way from -1, as e^2u
                twice = LineInTime(2 * operands[0].slope, 2 * operands[0].offset)
                return 2.0 * hy.sigmoid(literal(node, twice)) - 1.0
            operands = [literal(node, x) if isinstance(x, LineInTime) else x for x in operands]
        if not any(isinstance(operand, hy.expression) for operand in operands):
            return operate(node, operands, context)
        if node.operator == "sign":
            side = sides.get(node.operands[0])
            return hy.select(hy.gte(operands[0], 0.0), 1.0, -1.0) if side is None else side
        if node.operator == "quotient" and not isinstance(operands[1], hy.expression):
            inverse = operate(node, [context.one, operands[1]], context)
            return operands[0] * literal(node, inverse)
        if node.operator == "power":
            exponent = operands[1]
            if context.isint(exponent):
                return whole_power(operands[0], int(exponent))
            return operands[0] ** literal(node, exponent)
        operands, named = [literal(node, x) for x in _in_range(node, operands, number)], node.operator
        if named in ("sum", "product"):
            return hy.sum(operands) if named == "sum" else hy.prod(operands)
        own: dict[str, Any] = {"negative": operator.neg, "quotient": operator.truediv}
        return (own.get(named) or getattr(hy, named))(*operands)

    return literal(expression, fold(expression, of_constant, of_name, of_operation))


def _in_range(node: Operation, operands: list[Any], number: Rounder) -> list[Any]:
    """Operands with the numbers among them joined into one, if heyoka would leave the range on its way."""
    plain = [x for x in operands if not isinstance(x, hy.expression)]
    join = {"sum": operator.add, "product": operator.mul}.get(node.operator)
    if join is None or len(plain) < 2:
        return operands
    partial = [*accumulate(plain, join)]
    try:
        for x in partial:
            number(x)
    except OverflowError:
        return [partial[-1], *(x for x in operands if isinstance(x, hy.expression))]
    return operands


def _with_lines(node: Operation, operands: list[Any]) -> list[Any]:
    """Operands with the lines and numbers among them joined into one, if the operation leaves them a line."""
    plain = [x for x in operands if not isinstance(x, hy.expression)]
    if node.operator not in _LINEAR or (len(plain) < len(operands) and node.operator != "sum"):
        return operands
    joined = line_of(node.operator, plain)
    return operands if joined is None else [joined, *(x for x in operands if isinstance(x, hy.expression))]


def whole_power(base: Any, exponent: int) -> Any:
    """``base**exponent`` as a product of squares, whose Taylor series is regular at base = 0 too."""
    if exponent < 0:
        return 1.0 / whole_power(base, -exponent)
    factors = []
    square = base
    while exponent:
        if exponent & 1:
            factors.append(square)
        exponent >>= 1
        if exponent:
            square = square**2.0
    return hy.prod(factors) if factors else hy.expression(1.0)


# --- what names stand for -----------------------------------------------------------------------------------

TANGENT = "tangent_"
"""Prefix of the names of a tangent vector's states."""


def plain_angles(m: Kinematics) -> list[Symbolic]:
    """Euler angles of the scene's sequence within one turn, rad."""
    sequence = m.scene.config.integrator.euler_sequence
    if m.attitude is not None and m.attitude.sequence == sequence:
        return m.attitude.variables
    if starts_near_pole(m.scene):
        return angles_of_matrix(m, differentiable=True)
    return euler_from_matrix(sequence, m.matrix)


def carries_sign(m: Kinematics) -> bool:
    """Whether the quaternion's sign is a parameter: it matters, and the formulation loses it."""
    return m.surfaces.signed and m.attitude is not None and m.attitude.quaternion_sign != "state"


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
        """Names of a flight only where the body has one."""
        return (x for x in BODY_NAMES.values() if _flies(config) or "flight" not in x.states)

    def elsewhere(self, config: Config) -> str:
        """Hints at names of a flight."""
        return "" if _flies(config) else self.brings

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """As the scene says."""
        angles = scene.euler_angles
        if angles is None:
            matrix = attitude.rotation_matrix(scene.quaternion)
            sequence = scene.config.integrator.euler_sequence
            angles = attitude.euler_from_matrix(scene.context, matrix, sequence)
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
        """Expressions of the states.

        Parameters ``par[..]`` stand for what the state alone doesn't give: after the sides of the surfaces,
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
