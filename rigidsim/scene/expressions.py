"""Expressions of time, the state and parameters as a user writes them: ``k*sin(t)^2 - wx/2``.

Text is read by the parser below and by nothing else: Python never sees it.

    sum      = product {("+" | "-") product}
    product  = signed {("*" | "/") signed}
    signed   = ("+" | "-") signed | power
    power    = primary [("^" | "**") signed]          right-associative: -x^2 is -(x^2), 2^3^2 is 2^9
    primary  = number | name | function "(" sum {"," sum} ")" | "(" sum ")"

Numbers, parameters and what sums, products, quotients and whole powers make of them stay exact.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, NoReturn

from rigidsim.scene.context import context_for
from rigidsim.scene.exact import ExactNumber, parse_number
from rigidsim.scene.messages import nearest

LONGEST_TEXT = 2000
DEEPEST_NESTING = 64
LARGEST_POWER = 64
# Past any value that means something, and still quick to take the sine of: 5000 decimal digits fit.
_LARGEST_BITS = 20_000
_LARGEST_EXPONENTIAL = 13_862  # its exp is just below 2**_LARGEST_BITS

_ONE_ARGUMENT = "sin cos tan asin acos atan sinh cosh tanh exp log sqrt erf sigmoid"
FUNCTIONS = {**dict.fromkeys(_ONE_ARGUMENT.split(), 1), "atan2": 2}
"""Every function and the number of its arguments."""
RESERVED = frozenset({*FUNCTIONS, "pi", "e"})
"""Names that no parameter may have."""
_INSTEAD = {"abs": "; write sqrt((...)^2)", "ln": "; write log(...)", "pow": "; write x^2"}
_BINDS = {"+": 1, "-": 1, "*": 2, "/": 2, "^": 4, "**": 4}
_SIGN_BINDS = 3
_OPERATORS = {"+": "sum", "-": "sum", "*": "product", "/": "quotient"}
_COMPARISON = "an expression is one value, without comparisons; an event takes the difference of both sides"
_HINTS = {
    "=": "an expression is one value, without assignments; write only what stands right of the =",
    ".": "a point is part of a number only; names have no attributes",
    "_": "names begin with a letter",
    **dict.fromkeys("<>!", _COMPARISON),
}
_NUMBER = r"(?:[0-9]+(?:_[0-9]+)*\.?(?:[0-9]+(?:_[0-9]+)*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_TOKEN = re.compile(
    rf"(?P<number>{_NUMBER})|(?P<name>[A-Za-z][A-Za-z0-9_]*)|(?P<sign>\*\*|[-+*/^(),])|(?P<end>\Z)"
)
ONE = ExactNumber(Fraction(1))
_CHECKING = context_for("quadruple")


class ExpressionError(ValueError):
    """An expression that can't be read or has no value; the text shows the place.

    Attributes:
        column: of the place, counted from 1; None where the error has no place in the text.
    """

    def __init__(self, what: str, text: str = "", position: int | None = None) -> None:
        self.column = None if position is None else position + 1
        if position is not None:
            first = max(0, position - 60)
            shown = "".join(c if c.isprintable() else " " for c in text[first : position + 40])
            what = f"column {self.column}: {what}\n  {shown}\n  {' ' * (position - first)}^"
        super().__init__(what)


@dataclass(frozen=True)
class Number:
    """A number, exact; ``span`` is its place in the text, as for every node."""

    value: ExactNumber
    span: tuple[int, int] = field(compare=False)


@dataclass(frozen=True)
class Name:
    """Time or a component of the state."""

    name: str
    span: tuple[int, int] = field(compare=False)


@dataclass(frozen=True)
class Operation:
    """sum or product (of two or more operands), quotient, power, negative, or a function."""

    operator: str
    operands: tuple[Node, ...]
    span: tuple[int, int] = field(compare=False)


Node = Number | Name | Operation


@dataclass(frozen=True)
class Expression:
    """An expression as written and as understood."""

    text: str
    root: Node

    def error(self, what: str, node: Node) -> ExpressionError:
        """An error about a part of the expression, which it names."""
        part = self.text[slice(*node.span)]
        part = part if len(part) <= 60 else part[:57] + "..."
        return ExpressionError(f'{what} in "{part}"', self.text, node.span[0])


def parse_expression(
    text: str, names: Collection[str], *, parameters: Mapping[str, ExactNumber] | None = None
) -> Expression:
    """Read an expression.

    Args:
        text: one line of at most ``LONGEST_TEXT`` characters (which bounds the tree as well).
        names: of time and the state, as far as they are allowed here.
        parameters: named constants; they enter as exact numbers.

    Raises:
        ExpressionError: with what was given, what is allowed, and a caret under the place. Constant parts
            without a finite value (``1/0``, ``log(-1)``) are found here, others by ``evaluate``.
    """
    parameters = parameters or {}
    for name in parameters:
        if name in names or name in RESERVED:
            raise ExpressionError(
                f'the parameter "{name}" has the name of a variable, a function or a constant; rename it'
            )
    if len(text) > LONGEST_TEXT:
        raise ExpressionError(f"an expression of {len(text)} characters; at most {LONGEST_TEXT} are allowed")
    if not text.strip(" \t"):
        raise ExpressionError("an empty expression; write a number or a formula such as k*sin(t)^2")
    expression = Expression(text, _Parser(text, names, parameters).all())
    constant_value(expression, _CHECKING)
    return expression


class _Parser:
    """Recursive descent over one token of lookahead: its ``kind``, ``token`` (text) and ``start``."""

    def __init__(self, text: str, names: Collection[str], parameters: Mapping[str, ExactNumber]) -> None:
        self.text, self.names = text, names
        self.constants = {**parameters, "pi": ExactNumber(Fraction(1), 1)}
        self.known = [*names, *self.constants, "e"]
        self.depth = self.start = self.end = 0
        self.kind = self.token = ""
        self.advance()

    def fail(self, what: str, position: int | None = None) -> NoReturn:
        raise ExpressionError(what, self.text, self.start if position is None else position)

    def advance(self) -> str:
        """Pass a token; ``end`` is where it ended."""
        passed, self.end = self.token, self.start + len(self.token)
        rest = self.text[self.end :].lstrip(" \t")
        self.start = len(self.text) - len(rest)
        match = _TOKEN.match(rest)
        if match is None:
            self.unknown_character(rest)
        self.kind, self.token = match.lastgroup or "", match[0]
        run = re.match(r"[\w.]*", rest)
        if self.kind == "number" and run and run.end() > match.end():
            self.fail(f'"{run[0]}" is no number, such as 2, 0.5 or 1e-3; a product has its *, as in 2*t')
        return passed

    def unknown_character(self, rest: str) -> NoReturn:
        shown = f'"{rest[0]}"'
        if not (rest[0].isascii() and rest[0].isprintable()):
            shown = f"U+{ord(rest[0]):04X} ({unicodedata.name(rest[0], 'a control character').lower()})"
        hint = _HINTS.get(rest[0], "allowed: numbers, names, functions and + - * / ^ ( ) ,")
        self.fail(f"unknown character {shown}; {_COMPARISON if rest.startswith('==') else hint}")

    def constant(self, node: Node) -> Any:
        return constant_value(Expression(self.text, node), _CHECKING)

    def at(self, *signs: str) -> bool:
        return self.kind == "sign" and self.token in signs

    def deeper(self, weakest: int) -> Node:
        """An expression one level down."""
        self.depth += 1
        if self.depth > DEEPEST_NESTING:
            self.fail(f"nested too deeply; at most {DEEPEST_NESTING} levels are allowed")
        node = self.binary(weakest)
        self.depth -= 1
        return node

    def all(self) -> Node:
        root = self.binary(0)
        if self.at(")"):
            self.fail('a ")" without its "("; leave it out')
        if self.at(","):
            self.fail("a comma stands only between the arguments of a function; the decimal sign is a point")
        if self.kind != "end":
            self.fail(f'an operator is missing before "{self.token}"; a product has its *, as in 2*t')
        return root

    def binary(self, weakest: int) -> Node:
        """Operands and the signs that bind more strongly than ``weakest``."""
        start = self.start
        if self.at("+", "-"):
            sign, left = self.advance(), self.deeper(_SIGN_BINDS)
            left = _operation("negative", (left,), (start, self.end)) if sign == "-" else left
        else:
            left = self.primary()
        while self.at(*_BINDS) and _BINDS[self.token] > weakest:
            sign = self.advance()
            if sign in ("^", "**"):
                operator, right = "power", self.exponent()
            else:
                operator, right = _OPERATORS[sign], self.binary(_BINDS[sign])
                right = _operation("negative", (right,), right.span) if sign == "-" else right
                if sign == "/" and self.constant(right) == 0:
                    raise Expression(self.text, right).error("division by the zero", right)
            left = _operation(operator, (left, right), (start, self.end))
        return left

    def exponent(self) -> Node:
        start, exponent = self.start, self.deeper(_SIGN_BINDS)
        value = self.constant(exponent)
        if value is None:
            self.fail("an exponent must be constant; write exp(y*log(x)) for x^y", start)
        if abs(value) > LARGEST_POWER:
            self.fail(
                f'the exponent "{self.text[start : self.end]}" is beyond 64; -64 to 64 are allowed', start
            )
        return exponent

    def primary(self) -> Node:
        start = self.start
        if self.at("("):
            return self.arguments()[0]
        if self.kind == "number":
            try:
                value = parse_number(self.token, "1")
            except ValueError as error:
                self.fail(str(error))
            self.advance()
            return Number(value, (start, self.end))
        if self.kind != "name":
            self.fail(f'a number, a name or "(" is missing before {self.token or "the end"}')
        name = self.advance()
        if name in FUNCTIONS or self.at("("):
            return self.call(name, start)
        span = (start, self.end)
        if name in self.names:
            return Name(name, span)
        if name in self.constants:
            return Number(self.constants[name], span)
        if name == "e":
            return Operation("exp", (Number(ONE, span),), span)
        near = nearest(name, self.known) or nearest(name.lower(), self.known)
        self.fail(f'unknown name "{name}"{near}; allowed: {", ".join(self.known)}', start)

    def call(self, name: str, start: int) -> Node:
        if name in self.known:
            self.fail(f'"{name}" is no function; a product has its *, as in {name}*(...)', start)
        if name not in FUNCTIONS:
            near = _INSTEAD.get(name) or nearest(name, FUNCTIONS)
            self.fail(f'unknown function "{name}"{near}; allowed: {", ".join(FUNCTIONS)}', start)
        usage = f"write {name}({'y, x' if FUNCTIONS[name] == 2 else 'x'})"
        if not self.at("("):
            self.fail(f'the function "{name}" has its arguments in parentheses; {usage}', start)
        arguments = self.arguments(FUNCTIONS[name], f'"{name}" takes {FUNCTIONS[name]}; {usage}')
        return Operation(name, tuple(arguments), (start, self.end))

    def arguments(self, count: int = 1, usage: str = "one value stands in parentheses") -> list[Node]:
        """What stands in parentheses."""
        opened = self.start
        self.advance()
        found = [] if self.at(")") else [self.deeper(0)]
        while self.at(","):
            self.advance()
            found.append(self.deeper(0))
        if not self.at(")"):
            self.fail(f'a ")" is missing for the "(" in column {opened + 1}')
        if len(found) != count:
            self.fail(f"given {len(found)} arguments; {usage}", opened)
        self.advance()
        return found


def _exact(operator: str, numbers: list[ExactNumber]) -> ExactNumber | None:
    """The exact result; None where it isn't a rational times a power of pi, or is too long."""
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


def _operation(operator: str, operands: tuple[Node, ...], span: tuple[int, int]) -> Node:
    """The operation, or the number that it exactly is; chains are one sum, or one product after a number."""
    numbers = [operand.value for operand in operands if isinstance(operand, Number)]
    exact = _exact(operator, numbers) if len(numbers) == len(operands) else None
    if exact is not None:
        return Number(exact, span)
    first, last = operands[0], operands[-1]
    inverse = _exact("quotient", [ONE, last.value]) if isinstance(last, Number) else None
    if operator == "quotient" and inverse is not None:
        return _operation("product", (Number(inverse, last.span), first), span)
    if operator == "product" and isinstance(last, Number):
        first, last = last, first
    if operator == "product" and isinstance(first, Number):
        head, *tail = _chain(operator, last)
        front = _exact(operator, [first.value, head.value]) if isinstance(head, Number) else None
        operands = (first, head, *tail) if front is None else (Number(front, span), *tail)
    elif operator in ("sum", "product"):
        operands = (*_chain(operator, first), last)
    return Operation(operator, operands, span)


def _chain(operator: str, node: Node) -> tuple[Node, ...]:
    return node.operands if isinstance(node, Operation) and node.operator == operator else (node,)


def fold(expression: Expression, combine: Callable[[Node, list[Any]], Any]) -> Any:
    """``combine(node, its operands' results)`` at the root; operands go first, nothing recurses."""
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


def names_used(expression: Expression) -> frozenset[str]:
    """Names of time and the state that the expression reads; parameters are numbers by now."""
    found: set[str] = set()
    fold(expression, lambda node, _: found.add(node.name) if isinstance(node, Name) else None)
    return frozenset(found)


def constant_value(expression: Expression, context: Any) -> Any:
    """The value of an expression without names, as mpf; None where a name occurs.

    Raises:
        ExpressionError: a constant part has no finite value.
    """
    return evaluate(expression, dict.fromkeys(names_used(expression)), context)


def evaluate(expression: Expression, values: Mapping[str, Any], context: Any) -> Any:
    """The value where the names have these values (mpf), as an mpf of the context.

    Raises:
        ExpressionError: no finite value; the text names the part at fault.
    """

    def combine(node: Node, operands: list[Any]) -> Any:
        if isinstance(node, Number):
            return node.value.at(context)
        if isinstance(node, Name):
            value = values[node.name]
            return None if value is None else context.convert(value)
        return None if None in operands else operate(expression, node, operands, context)

    return fold(expression, combine)


def operate(expression: Expression, node: Operation, operands: list[Any], context: Any) -> Any:
    """One operation on mpf operands.

    Raises:
        ExpressionError: no finite value, or one beyond 2**20000.
    """
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
"""Where an operation on its first and last operand has no real, finite value."""
