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

import re
import unicodedata
from collections.abc import Collection, Mapping
from fractions import Fraction
from typing import Any, NoReturn

from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.exact import ExactNumber, parse_number
from rigidsim.scene.expressions import (
    FUNCTIONS,
    LARGEST_POWER,
    ONE,
    PIECEWISE,
    RESERVED,
    Constant,
    Expression,
    ExpressionError,
    Name,
    Node,
    Operation,
    constant_value,
    operation,
)
from rigidsim.scene.piecewise import power, written_out
from rigidsim.scene.validation_messages import nearest

LONGEST_TEXT = 2000
DEEPEST_NESTING = 64
MOST_NODES = 5000
_FUNCTIONS = {**FUNCTIONS, **PIECEWISE}
_INSTEAD = {"ln": "; write log(...)", "pow": "; write x^2", "sgn": "; write sign(...)"}
_INSTEAD |= {"heaviside": "; write step(...)", "mod": "; write wrap(...), which takes off full turns"}
_JUMPS = ("sign", "step", "pulse")
_USAGE = {"atan2": "y, x", "min": "a, b", "max": "a, b", "pulse": "x, begin, end"}
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
_CHECKING = context_for("quadruple")


def parse_expression(
    text: str,
    names: Collection[str],
    *,
    parameters: Mapping[str, ExactNumber] | None = None,
    jumps: bool = True,
) -> Expression:
    """Read an expression.

    Args:
        text: one line of at most ``LONGEST_TEXT`` characters (which bounds the tree as well).
        names: of time and the state, as far as they are allowed here.
        parameters: named constants; they enter as exact numbers.
        jumps: whether functions that are constant but for jumps are allowed.

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
    expression = Expression(text, _Parser(text, names, parameters, jumps).all())
    constant_value(expression, _CHECKING)
    return expression


class _Parser:
    """Recursive descent over one token of lookahead: its ``kind``, ``token`` (text) and ``start``."""

    def __init__(
        self, text: str, names: Collection[str], parameters: Mapping[str, ExactNumber], jumps: bool
    ) -> None:
        self.text, self.names, self.jumps = text, names, jumps
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
            left = operation("negative", (left,), (start, self.end)) if sign == "-" else left
        else:
            left = self.primary()
        while self.at(*_BINDS) and _BINDS[self.token] > weakest:
            sign = self.advance()
            if sign in ("^", "**"):
                exponent = self.exponent()
                left = self.bounded(power(left, exponent, (start, self.end)), start)
                continue
            right = self.binary(_BINDS[sign])
            right = operation("negative", (right,), right.span) if sign == "-" else right
            if sign == "/" and self.constant(right) == 0:
                raise Expression(self.text, right).error("division by the zero", right)
            left = operation(_OPERATORS[sign], (left, right), (start, self.end))
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
            return Constant(value, (start, self.end))
        if self.kind != "name":
            self.fail(f'a number, a name or "(" is missing before {self.token or "the end"}')
        name = self.advance()
        if name in _FUNCTIONS or self.at("("):
            return self.call(name, start)
        span = (start, self.end)
        if name in self.names:
            return Name(name, span)
        if name in self.constants:
            return Constant(self.constants[name], span)
        if name == "e":
            return Operation("exp", (Constant(ONE, span),), span)
        near = nearest(name, self.known) or nearest(name.lower(), self.known)
        self.fail(f'unknown name "{name}"{near}; allowed: {", ".join(self.known)}', start)

    def call(self, name: str, start: int) -> Node:
        if name in self.known:
            self.fail(f'"{name}" is no function; a product has its *, as in {name}*(...)', start)
        if name not in _FUNCTIONS:
            near = _INSTEAD.get(name) or nearest(name, _FUNCTIONS)
            self.fail(f'unknown function "{name}"{near}; allowed: {", ".join(_FUNCTIONS)}', start)
        if name in _JUMPS and not self.jumps:
            self.fail(f'"{name}" jumps, and a jump crosses zero nowhere; write its argument instead', start)
        usage = f"write {name}({_USAGE.get(name, 'x')})"
        if not self.at("("):
            self.fail(f'the function "{name}" has its arguments in parentheses; {usage}', start)
        arguments = self.arguments(_FUNCTIONS[name], f'"{name}" takes {_FUNCTIONS[name]}; {usage}')
        return self.bounded(written_out(name, arguments, (start, self.end)), start)

    def bounded(self, node: Node, start: int) -> Node:
        """A node that isn't too large: arguments of piecewise functions are written out several times."""
        waiting, count = [node], 0
        while waiting:
            inner = waiting.pop()
            waiting += inner.operands if isinstance(inner, Operation) else ()
            count += 1
            if count > MOST_NODES:
                self.fail("too many piecewise functions within one another; write fewer", start)
        return node

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
