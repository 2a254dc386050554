"""Parts of an expression that are straight lines in time, such as (t - 5000.1)/0.01, with exact constants."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rigidsim.scene.expressions.tree import Constant, Expression, Name, Node, Operation, fold, operate


@dataclass(frozen=True)
class LineInTime:
    """``slope * t + offset`` (mpf, t in s); the slope isn't zero."""

    slope: Any
    offset: Any

    @property
    def zero(self) -> Any:
        """The time at which it vanishes, s."""
        return -self.offset / self.slope


def line_of(operator: str, operands: Sequence[Any]) -> Any | None:
    """An operation on lines and numbers (mpf): a line, a number, or None if it is neither."""
    lines = [x for x in operands if isinstance(x, LineInTime)]
    numbers = [x for x in operands if not isinstance(x, LineInTime)]
    if operator == "sum":
        slope = sum((x.slope for x in lines[1:]), lines[0].slope)
        offset = sum((x.offset for x in lines[1:]), lines[0].offset)
        offset = sum(numbers, offset)
        return LineInTime(slope, offset) if slope != 0 else offset
    first = operands[0]
    if operator == "negative":
        return LineInTime(-first.slope, -first.offset)
    if operator == "quotient" and not isinstance(operands[1], LineInTime) and operands[1] != 0:
        return LineInTime(first.slope / operands[1], first.offset / operands[1])
    if operator == "product" and len(lines) == 1:
        factor = math.prod(numbers)
        line = lines[0]
        return LineInTime(factor * line.slope, factor * line.offset) if factor != 0 else factor
    return None


def lines_in(expression: Expression, context: Any) -> list[LineInTime]:
    """The longest lines in an expression; ``ExpressionError`` for a constant part without a finite value."""
    found: list[LineInTime] = []
    whole = _folded(expression, context, found)
    return [whole] if isinstance(whole, LineInTime) else found


def as_line(expression: Expression, context: Any) -> LineInTime | None:
    """The line that an expression is as a whole; None if it is none."""
    whole = _folded(expression, context, [])
    return whole if isinstance(whole, LineInTime) else None


def _folded(expression: Expression, context: Any, found: list[LineInTime]) -> Any:
    """A number, a line, or None for anything else, whose lines are added to those found."""

    def combine(node: Node, operands: list[Any]) -> Any:
        if isinstance(node, Constant):
            return node.value.at(context)
        if isinstance(node, Name):
            return LineInTime(context.one, context.zero) if node.name == "t" else None
        assert isinstance(node, Operation)
        lines = [x for x in operands if isinstance(x, LineInTime)]
        if None not in operands:
            whole = (
                line_of(node.operator, operands) if lines else operate(expression, node, operands, context)
            )
            if whole is not None:
                return whole
        found.extend(lines)
        return None

    return fold(expression, combine)
