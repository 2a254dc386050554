"""Parts of an expression that may change abruptly, which a step must not pass over.

A pulse such as ``exp(-((t-50)/0.01)^2)`` or a switch such as ``tanh((t-5)/0.001)`` is flat almost everywhere:
its Taylor series tell nothing of what comes, and a step chosen by them passes over it. The change
happens where the function's argument is of order one, and the argument itself isn't flat: see
``rigidsim.model.step_limiter``. A root of something that touches zero, such as a vanishing norm, likewise
continues smoothly along the wrong branch.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any

from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.tree import Constant, Expression, Node, Operation, fold, operation

WIDE = 4.0
"""Bound within which an argument can't run through a function's whole transition."""
_FLAT = frozenset({"exp", "sinh", "cosh", "tanh", "erf", "sigmoid", "atan"})
"""Functions that become flat towards an end."""
_STEEP_POWER = 8  # higher ones vanish to an order near that of the Taylor method
_BOUNDED: Mapping[str, float] = {
    "sin": 1, "cos": 1, "sign": 1, "tanh": 1, "erf": 1, "sigmoid": 1,
    "atan": 2, "asin": 2, "acos": 4, "atan2": 4,
    "qw": 1, "qx": 1, "qy": 1, "qz": 1, "phi": 4, "theta": 4, "psi": 4,
}  # fmt: skip


def operations(expression: Expression) -> Iterator[Operation]:
    """Every operation, outer ones before inner ones."""
    waiting = [expression.root]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Operation):
            waiting += node.operands
            yield node


def narrow_parts(expression: Expression) -> list[Expression]:
    """Arguments of flat functions, denominators, and bases of negative or high powers, each once.

    Constants are left out, and anything that can't leave ``WIDE``, such as a sine.
    """
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
    """Radicands that may touch zero, each once: there the root has a kink, though no power shows it.

    Sums of squares and a positive number, or anything else positive by its form, are left out.
    """
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
            return -_BOUNDED.get(node.name, math.inf)
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
            return _BOUNDED.get(node.name, math.inf)
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
