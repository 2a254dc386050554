"""Expression trees of time, the state and parameters, and their values.

Numbers and parameters stay exact in sums, products, quotients and whole powers. Straight lines in time, such
as (t - 5000.1)/0.01, are found with exact constants.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.names import Readable

# Past any value that means something, and still quick to take the sine of: 5000 decimal digits fit.
_LARGEST_BITS = 20_000
_LARGEST_EXPONENTIAL = 13_862  # its exp is just below 2**_LARGEST_BITS
LARGEST_POWER = 64

_ONE_ARGUMENT = "sin cos tan asin acos atan sinh cosh tanh exp log sqrt erf sigmoid"
FUNCTIONS = {**dict.fromkeys(_ONE_ARGUMENT.split(), 1), "atan2": 2}
"""Every smooth function, with its number of arguments."""
PIECEWISE = {"abs": 1, "sign": 1, "min": 2, "max": 2, "step": 1, "pulse": 3, "wrap": 1}
"""Functions with kinks and jumps; ``rigidsim.scene.expressions.piecewise`` rewrites them."""
RESERVED = frozenset({*FUNCTIONS, *PIECEWISE, "pi", "e"})
"""Names that no parameter may have."""
ONE = ExactNumber(Fraction(1))


class ExpressionError(ValueError):
    """An expression, ``of``, that can't be read or has no value; the text shows the place, if it has one."""

    def __init__(self, what: str, text: str = "", position: int | None = None) -> None:
        self.of = text
        self.column = None if position is None else position + 1
        if position is not None:
            first = max(0, position - 60)
            shown = "".join(c if c.isprintable() else " " for c in text[first : position + 40])
            what = f"column {self.column}: {what}\n  {shown}\n  {' ' * (position - first)}^"
        super().__init__(what)


@dataclass(frozen=True)
class Constant:
    """A number, exact; ``span`` is its place in the text, as for every node."""

    value: ExactNumber
    span: tuple[int, int] = field(compare=False)


@dataclass(frozen=True)
class Name:
    """Time, a component of the state, or another value of the scene; ``of`` says what is known of it."""

    name: str
    span: tuple[int, int] = field(compare=False)
    of: Readable = field(compare=False)


@dataclass(frozen=True)
class Operation:
    """Sum or product (of two or more operands), quotient, power, negative, a smooth function or ``sign``."""

    operator: str
    operands: tuple[Node, ...]
    span: tuple[int, int] = field(compare=False)


Node = Constant | Name | Operation


@dataclass(frozen=True)
class Expression:
    """An expression as written and as parsed."""

    text: str
    root: Node

    def error(self, what: str, node: Node) -> ExpressionError:
        """An error about a part of the expression, whose place it shows."""
        part = self.text[slice(*node.span)]
        part = part if len(part) <= 60 else part[:57] + "..."
        return ExpressionError(f'{what} in "{part}"', self.text, node.span[0])


def _exact(operator: str, numbers: list[ExactNumber]) -> ExactNumber | None:
    """The exact result; None if it isn't a rational times a power of pi, or is too long."""
    if any(number.swept for number in numbers):
        from rigidsim.scene.tracing.arithmetic import exactly

        return exactly(operator, numbers)
    a, b = numbers[0], numbers[-1]
    x, y, pi_power = a.rational, b.rational, a.pi_power
    whole = operator == "power" and y.denominator == 1 and not b.pi_power and (x != 0 or y >= 0)
    if operator == "negative":
        x = -x
    elif operator == "sum" and (a.pi_power == b.pi_power or not x):
        x, pi_power = x + y, b.pi_power
    elif operator == "product":
        x, pi_power = x * y, a.pi_power + b.pi_power
    elif operator == "quotient" and y:
        x, pi_power = x / y, a.pi_power - b.pi_power
    elif whole and _bits(x) * abs(y) <= _LARGEST_BITS:
        x, pi_power = x ** int(y), a.pi_power * int(y)
    else:
        return None
    return ExactNumber(x, pi_power) if _bits(x) <= _LARGEST_BITS and abs(pi_power) <= 64 else None


def _bits(x: Fraction) -> int:
    return max(x.numerator.bit_length(), x.denominator.bit_length())


def operation(operator: str, operands: tuple[Node, ...], span: tuple[int, int]) -> Node:
    """The operation, or its exact value as a number; chains become one sum, or one product after a number."""
    numbers = [operand.value for operand in operands if isinstance(operand, Constant)]
    exact = _exact(operator, numbers) if len(numbers) == len(operands) else None
    if exact is not None:
        return Constant(exact, span)
    first, last = operands[0], operands[-1]
    inverse = _exact("quotient", [ONE, last.value]) if isinstance(last, Constant) else None
    if operator == "quotient" and inverse is not None:
        return operation("product", (Constant(inverse, last.span), first), span)
    if operator == "product" and isinstance(last, Constant):
        first, last = last, first
    if operator == "product" and isinstance(first, Constant):
        head, *tail = _chain(operator, last)
        front = _exact(operator, [first.value, head.value]) if isinstance(head, Constant) else None
        operands = (first, head, *tail) if front is None else (Constant(front, span), *tail)
    elif operator in ("sum", "product"):
        operands = (*_chain(operator, first), last)
    return Operation(operator, operands, span)


def _chain(operator: str, node: Node) -> tuple[Node, ...]:
    return node.operands if isinstance(node, Operation) and node.operator == operator else (node,)


def fold(expression: Expression, combine: Callable[[Node, list[Any]], Any]) -> Any:
    """Fold the tree without recursion: ``combine(node, results of its operands)`` from leaves to root."""
    results: list[Any] = []
    waiting: list[tuple[Node, bool]] = [(expression.root, False)]
    while waiting:
        node, ready = waiting.pop()
        operands = node.operands if isinstance(node, Operation) else ()
        if operands and not ready:
            waiting.append((node, True))
            waiting += [(operand, False) for operand in reversed(operands)]
        else:
            first = len(results) - len(operands)
            results[first:] = [combine(node, results[first:])]
    return results[0]


def nodes(expression: Expression) -> Iterator[Node]:
    """Every node, outer ones before inner ones."""
    waiting = [expression.root]
    while waiting:
        node = waiting.pop()
        waiting += node.operands if isinstance(node, Operation) else ()
        yield node


def operations(expression: Expression) -> Iterator[Operation]:
    """Every operation, outer ones before inner ones."""
    return (node for node in nodes(expression) if isinstance(node, Operation))


def placed_at(expression: Expression, span: tuple[int, int]) -> Node:
    """The tree of an expression, all of which stands at one place of another text."""

    def combine(node: Node, operands: list[Any]) -> Node:
        if isinstance(node, Operation):
            return Operation(node.operator, tuple(operands), span)
        return replace(node, span=span)

    found: Node = fold(expression, combine)
    return found


def names_used(expression: Expression) -> frozenset[str]:
    """Names of time and the state that the expression reads; parameters are already numbers."""
    return frozenset(node.name for node in nodes(expression) if isinstance(node, Name))


def readables(expression: Expression) -> list[Readable]:
    """What the names in the expression stand for, each once, in the order of its text."""
    return list({node.name: node.of for node in nodes(expression) if isinstance(node, Name)}.values())


def states_read(expression: Expression) -> frozenset[str]:
    """States without which the expression has no value, see ``Readable.states``."""
    return frozenset().union(*(readable.states for readable in readables(expression)))


def constant_value(expression: Expression, context: Any) -> Any:
    """The value (mpf) of an expression without names, see ``evaluate``; None if it contains a name."""
    return evaluate(expression, dict.fromkeys(names_used(expression)), context)


def never_below_zero(node: Node) -> bool:
    """Whether its form shows that a number isn't negative: sums, products and quotients of what isn't, even
    powers, and functions without negative values.
    """
    if isinstance(node, Constant):
        return node.value.sign >= 0
    if isinstance(node, Name):
        return False
    if node.operator == "power":
        base, exponent = node.operands
        value = exponent.value if isinstance(exponent, Constant) else None
        even = value is not None and not value.swept and not value.pi_power and value.rational % 2 == 0
        return even or never_below_zero(base)
    if node.operator in ("sum", "product", "quotient"):
        return all(map(never_below_zero, node.operands))
    return node.operator in ("exp", "cosh", "sqrt", "sigmoid")


def evaluate(expression: Expression, values: Mapping[str, Any], context: Any) -> Any:
    """The value (mpf) for values of the names; ``ExpressionError`` names a part without a finite one."""

    def combine(node: Node, operands: list[Any]) -> Any:
        if isinstance(node, Constant):
            return node.value.at(context)
        if isinstance(node, Name):
            value = values[node.name]
            return None if value is None else context.convert(value)
        return None if None in operands else operate(expression, node, operands, context)

    return fold(expression, combine)


def operate(expression: Expression, node: Operation, operands: list[Any], context: Any) -> Any:
    """Apply one operation to mpf operands; ``ExpressionError`` if it isn't finite, or exceeds 2**20000."""
    operator, first, last = node.operator, operands[0], operands[-1]
    refused, why = _REFUSED.get(operator, (None, ""))
    if refused and refused(first, last):
        raise expression.error(why, node)
    if operator == "sigmoid":
        small = context.exp(-abs(first))
        value = (1 if first >= 0 else small) / (1 + small)
    elif operator in _ARITHMETIC:
        value = _ARITHMETIC[operator](operands)
    else:
        value = getattr(context, operator)(*operands)
    if value and context.mag(value) > _LARGEST_BITS:
        raise expression.error(_TOO_LARGE, node)
    return value


_ARITHMETIC: dict[str, Callable[[list[Any]], Any]] = {
    "sum": lambda a: sum(a[1:], a[0]),
    "product": math.prod,
    "negative": lambda a: -a[0],
    "quotient": lambda a: a[0] / a[1],
    "power": lambda a: a[0] ** (int(a[1]) if a[1] == int(a[1]) else a[1]),
}
_TOO_LARGE = "a value beyond 1e6000"
_REFUSED: dict[str, tuple[Callable[[Any, Any], bool], str]] = {
    "quotient": (lambda x, y: y == 0, "division by zero"),
    "power": (
        lambda x, y: (x < 0 and y != int(y)) or (x == 0 and y < 0),
        "a power that isn't real and finite (of zero or of a negative number)",
    ),
    "log": (lambda x, _: x <= 0, "log needs a number above zero"),
    "sqrt": (lambda x, _: x < 0, "sqrt needs a number of at least zero"),
    "asin": (lambda x, _: abs(x) > 1, "an inverse sine or cosine needs a number from -1 to 1"),
    "acos": (lambda x, _: abs(x) > 1, "an inverse sine or cosine needs a number from -1 to 1"),
    "atan2": (lambda y, x: x == y == 0, "atan2 needs two numbers that aren't both zero"),
    "exp": (lambda x, _: x > _LARGEST_EXPONENTIAL, _TOO_LARGE),
    "sinh": (lambda x, _: abs(x) > _LARGEST_EXPONENTIAL, _TOO_LARGE),
    "cosh": (lambda x, _: abs(x) > _LARGEST_EXPONENTIAL, _TOO_LARGE),
}
"""Conditions under which an operation on its first and last operand has no real, finite value."""


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
