"""Parts of an expression that may change abruptly, which a step must not pass over.

A pulse such as ``exp(-((t-50)/0.01)^2)`` or a switch such as ``tanh((t-5)/0.001)`` is flat almost everywhere:
its Taylor series tell nothing of what comes, and a step chosen by them passes over it. The change
happens where the function's argument is of order one, and the argument itself isn't flat: see
``rigidsim.model.step_limiter``. A root of something that touches zero, such as a vanishing norm, likewise
continues smoothly along the wrong branch.

What happens abruptly at a time has to be known to more digits than one number holds: a double tells times
around 5000 s to 1e-12 s, and a pulse between times rounded so, or a spike whose argument (t - 5000.3)/0.01 is
worked out from such a time, gives another impulse than the one that was written.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.tree import (
    Constant,
    Expression,
    ExpressionError,
    LineInTime,
    Node,
    Operation,
    evaluate,
    fold,
    lines_in,
    names_used,
    operation,
    operations,
)
from rigidsim.scene.scene import Scene

WIDE = 4.0
"""Bound within which an argument can't run through a function's whole transition."""
_FLAT = frozenset({"exp", "sinh", "cosh", "tanh", "erf", "sigmoid", "atan"})
"""Functions that become flat towards an end."""
_STEEP_POWER = 8  # higher ones vanish to an order near that of the Taylor method
_LATE = 64
"""Ratio of a time to the width of what happens then from which a rounded time counts: below it the error, a
part in 2^46 of the impulse in double precision, is no more than that of some steps.
"""
_BOUNDED: Mapping[str, float] = {
    "sin": 1, "cos": 1, "sign": 1, "tanh": 1, "erf": 1, "sigmoid": 1,
    "atan": 2, "asin": 2, "acos": 4, "atan2": 4,
}  # fmt: skip


def narrow_parts(expression: Expression) -> list[Expression]:
    """Arguments of flat functions, denominators, bases of negative or high powers, if they leave ``WIDE``."""
    found: dict[Node, None] = {}
    for node in operations(expression):
        part: Node | None = None
        if node.operator in _FLAT:
            part = node.operands[0]
        elif node.operator == "quotient":
            part = node.operands[1]
        elif node.operator == "power":
            base, power = node.operands
            exponent = abs(_bound(Expression(expression.text, power), signed=True))
            if exponent > _STEEP_POWER and isinstance(power, Constant):  # flat to a part in n of the base
                part = operation("product", (power, base), base.span)
            elif not isinstance(power, Constant) or power.value.sign < 0:
                part = base
        if part is not None and _bound(Expression(expression.text, part)) > WIDE:
            found[part] = None
    return [Expression(expression.text, part) for part in found if not _constant(part)]


def root_parts(expression: Expression) -> list[Expression]:
    """Radicands that may touch zero, where the root has a kink; not those that are positive by their form."""
    found: dict[Node, None] = {}
    for node in operations(expression):
        part: Node | None = None
        if node.operator == "sqrt":
            part = node.operands[0]
        elif node.operator == "power":
            base, power = node.operands
            whole = isinstance(power, Constant) and not power.value.pi_power
            if not (whole and power.value.rational.denominator == 1):  # type: ignore[union-attr]
                part = base
        elif node.operator in ("asin", "acos"):
            (x,) = node.operands
            two, one = (Constant(ExactNumber(Fraction(n)), x.span) for n in (2, 1))
            square = operation("power", (x, two), x.span)
            part = operation("sum", (one, operation("negative", (square,), x.span)), x.span)
        if part is not None and not _least(Expression(expression.text, part)) > 0:
            found[part] = None
    return [Expression(expression.text, part) for part in found if not _constant(part)]


def _least(expression: Expression) -> float:
    """Lower bound of the value; -infinity if there is none."""

    def combine(node: Node, operands: list[Any]) -> float:
        if isinstance(node, Constant):
            return float(node.value)
        if not isinstance(node, Operation):
            return -math.inf if node.of.turns else -node.of.bound
        if node.operator == "sum":
            return float(sum(operands))
        if node.operator in ("exp", "sqrt", "sigmoid"):
            return 0.0
        if node.operator in ("product", "quotient") and min(operands) >= 0:
            return 0.0 if node.operator == "quotient" or 0 in operands else math.prod(operands)
        if node.operator == "power" and isinstance(node.operands[1], Constant):
            exponent = node.operands[1].value
            even = not exponent.pi_power and exponent.rational % 2 == 0
            return 0.0 if even or operands[0] >= 0 else -math.inf
        return -_BOUNDED.get(node.operator, math.inf)

    return float(fold(expression, combine))


def _constant(node: Node) -> bool:
    return isinstance(node, Constant)


def _bound(expression: Expression, *, signed: bool = False) -> float:
    """Upper bound of the absolute value, or of the value itself if ``signed``; infinite if there is none."""

    def combine(node: Node, operands: list[Any]) -> float:
        if isinstance(node, Constant):
            value = float(node.value)
            return value if signed else abs(value)
        if not isinstance(node, Operation):
            return node.of.bound
        if node.operator in _BOUNDED:
            return _BOUNDED[node.operator]
        if node.operator == "sum":
            return float(sum(operands))
        if node.operator == "negative":
            return float(-operands[0] if signed else operands[0])
        if node.operator == "product":
            return 0.0 if 0 in operands else math.prod(operands)
        if node.operator == "power" and isinstance(node.operands[1], Constant):
            exponent = float(node.operands[1].value)
            return operands[0] ** exponent if exponent > 0 and operands[0] < 1e4 else math.inf
        return math.inf

    return float(fold(expression, combine))


def happens_at_a_moment(scene: Scene) -> bool:
    """Whether a load or a state switches at a time, or changes late and within a short while."""
    for _, expression in scene.acting_formulas():
        if any(_within(line, scene) for line in _of_switches(expression, scene.context)):
            return True
        if any(_late(part, scene) for part in narrow_parts(expression)):
            return True
    return False


def acts_at_moments_alone(scene: Scene) -> bool:
    """Whether loads depend on time by distances from moments alone, which no rounding of time disturbs."""
    each = [list(load.formulas()) for load in scene.loads]
    each += [
        [(state.where, state.derivative)] for state in scene.states if "t" in names_used(state.derivative)
    ]
    for formulas in each:
        lines = [line for _, expression in formulas for line in lines_in(expression, scene.context)]
        if not formulas or any(line.offset == 0 for line in lines):
            return False
    return True


def _of_switches(expression: Expression, context: Any) -> list[LineInTime]:
    """Lines in the arguments of signs, which don't pass through zero at t = 0."""
    found = []
    for node in operations(expression):
        if node.operator == "sign":
            found += lines_in(Expression(expression.text, node.operands[0]), context)
    return [line for line in found if line.offset != 0]


def _within(line: LineInTime, scene: Scene) -> bool:
    return bool(scene.start < line.zero < scene.end)


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
