"""Expressions of time, the state and parameters as a user writes them: ``k*sin(t)^2 - wx/2``.

Text is read by the parser below and by nothing else: Python never sees it.

    sum      = product {("+" | "-") product}
    product  = signed {("*" | "/") signed}
    signed   = ("+" | "-") signed | power
    power    = primary [("^" | "**") signed]          right-associative: -x^2 is -(x^2), 2^3^2 is 2^9
    primary  = number [unit] | name | function "(" sum {"," sum} ")" | "(" sum ")"
    unit     = name ["^" integer] {["*" | "/"] name ["^" integer]}    as far as these are names of units

Numbers, parameters and their sums, products, quotients and whole powers stay exact; units are checked.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NoReturn

from rigidsim.scene import units
from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.exact import ExactNumber, parse_number, with_unit
from rigidsim.scene.expressions import dimensions
from rigidsim.scene.expressions.dimensions import ANY, DimensionError, Measure, end_of_unit
from rigidsim.scene.expressions.names import BODY_NAMES, Readable
from rigidsim.scene.expressions.piecewise import power, written_out
from rigidsim.scene.expressions.tree import (
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
    placed_at,
)
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
_COMPARISON = (
    "an expression is one value, without comparisons; an event takes the difference of both sides, and "
    "step(t - 10), pulse(t, 10, 12), sign, min and max switch"
)
_HINTS = {
    "=": "an expression is one value, without assignments; write only what stands right of the =",
    ".": "a point is part of a number only; names have no attributes",
    "_": "names begin with a letter",
    "°": "write deg, as in 90 deg",
    **dict.fromkeys("<>!", _COMPARISON),
}
_NUMBER = r"(?:[0-9]+(?:_[0-9]+)*\.?(?:[0-9]+(?:_[0-9]+)*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_TOKEN = re.compile(
    rf"(?P<number>{_NUMBER})|(?P<name>[A-Za-z][A-Za-z0-9_]*)|(?P<sign>\*\*|[-+*/^(),])|(?P<end>\Z)"
)
_PARENTHESES = 'a number with a unit stands in parentheses beside "/" and "^"'
_CHECKING = context_for("quadruple")


@dataclass(frozen=True)
class _Parsed:
    """A parsed expression; ``bare`` is a number with a unit without parentheses around it."""

    node: Node
    measure: Measure = ANY
    bare: bool = False


def parse_expression(
    text: str,
    names: Mapping[str, Readable],
    *,
    parameters: Mapping[str, ExactNumber] | None = None,
    jumps: bool = True,
    unit: str | None = None,
    read_too: bool = False,
) -> Expression:
    """Parse an expression.

    Args:
        text: of at most ``LONGEST_TEXT`` characters (which bounds the tree as well); lines are joined.
        names: those of time and the state that are allowed here; ``Names`` say what would bring others.
        parameters: named constants, which enter as exact numbers.
        jumps: whether piecewise constant functions are allowed.
        unit: SI unit of the value; None for any.
        read_too: whether it is checked where no unit is written, too: against the units of what is read.

    Raises:
        ExpressionError: with what was given, what is allowed, and a caret under the place. Constant parts
            without a finite value (``1/0``, ``log(-1)``) are found here, others by ``evaluate``.
    """
    parameters = parameters or {}
    for name in parameters:
        if name in names or name in RESERVED:
            what = f'the parameter "{name}" has the name of a variable, a function or a constant; rename it'
            raise ExpressionError(what)
    if len(text) > LONGEST_TEXT:
        raise ExpressionError(f"an expression of {len(text)} characters; at most {LONGEST_TEXT} are allowed")
    text = " ".join(text.split()) if "\n" in text else text  # columns are those of one line
    if not text.strip(" \t"):
        raise ExpressionError("an empty expression; write a number or a formula such as k*sin(t)^2")
    whole = _Parser(text, names, parameters, jumps).all()
    expression = Expression(text, whole.node)
    constant_value(expression, _CHECKING)
    try:
        if unit is not None:
            dimensions.check_unit(whole.measure, unit, read_too=read_too)
    except DimensionError as error:
        raise ExpressionError(str(error)) from None
    return expression


class _Parser:
    """Recursive descent with one token of lookahead: its ``kind``, ``token`` (text) and ``start``."""

    def __init__(
        self, text: str, names: Mapping[str, Readable], parameters: Mapping[str, ExactNumber], jumps: bool
    ) -> None:
        self.text, self.names, self.parameters, self.jumps = text, names, parameters, jumps
        self.constants = {**parameters, "pi": ExactNumber(Fraction(1), 1)}
        self.others = {*parameters, *names} - set(BODY_NAMES)
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
            unit, hint = run[0][match.end() :], "; a product has its *, as in 2*t"
            if unit not in self.known and units.is_unit(unit):
                hint = f'; a unit stands apart, as in "{match[0]} {unit}"'
            self.fail(f'"{run[0]}" is no number, such as 2, 0.5 or 1e-3{hint}')
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

    def measured(self, position: int, of: Callable[[], Any]) -> Any:
        """Result of a dimension check; an error is given its place in the text."""
        try:
            return of()
        except DimensionError as error:
            self.fail(str(error), position)

    def deeper(self, weakest: int) -> _Parsed:
        """Parse an expression one level down."""
        self.depth += 1
        if self.depth > DEEPEST_NESTING:
            self.fail(f"nested too deeply; at most {DEEPEST_NESTING} levels are allowed")
        node = self.binary(weakest)
        self.depth -= 1
        return node

    def all(self) -> _Parsed:
        root = self.binary(0)
        if self.at(")"):
            self.fail('a ")" without its "("; leave it out')
        if self.at(","):
            self.fail("a comma stands only between the arguments of a function; the decimal sign is a point")
        if self.kind != "end":
            hint = self.about_units(self.token) if self.kind == "name" else ""
            self.fail(f'an operator is missing before "{self.token}"; a product has its *, as in 2*t{hint}')
        return root

    def about_units(self, name: str) -> str:
        """Why a name that could be a unit isn't one here."""
        if name in self.known:
            return f' ("{name}" is no unit here, but a name of this scene)' if units.is_unit(name) else ""
        if units.is_unit(name):
            return f"; a unit stands behind a number, as in 2 {name}"
        return f'; no unit is called "{name}"'

    def binary(self, weakest: int) -> _Parsed:
        """Parse operands joined by operators that bind more strongly than ``weakest``."""
        start = self.start
        if self.at("+", "-"):
            sign, left = self.advance(), self.deeper(_SIGN_BINDS)
            if sign == "-":
                node = operation("negative", (left.node,), (start, self.end))
                left = _Parsed(node, left.measure, left.bare)
        else:
            left = self.primary()
        while self.at(*_BINDS) and _BINDS[self.token] > weakest:
            sign, at = self.token, self.start
            self.advance()
            if sign in ("^", "**"):
                if left.bare:
                    self.fail(f"{_PARENTHESES}: (2 s)^3", at)
                exponent = self.exponent()
                value = exponent.value if isinstance(exponent, Constant) else None
                node = self.bounded(power(left.node, exponent, (start, self.end)), start)
                left = _Parsed(node, left.measure.power(value))
                continue
            right, first = self.binary(_BINDS[sign]), left
            node, span = right.node, (start, self.end)
            if sign in ("+", "-"):
                node = operation("negative", (node,), node.span) if sign == "-" else node
                measure = self.measured(at, lambda a=first, b=right: a.measure.with_other(b.measure))  # type: ignore
            else:
                measure = first.measure.times(right.measure, -1 if sign == "/" else 1)
            if sign == "/" and right.bare:
                self.fail(f"{_PARENTHESES}: 1/(2 s) or (1/2)*(1 s)", at)
            if sign == "/" and self.constant(node) == 0:
                raise Expression(self.text, node).error("division by the zero", node)
            left = _Parsed(operation(_OPERATORS[sign], (left.node, node), span), measure)
        return left

    def exponent(self) -> Node:
        start, exponent = self.start, self.deeper(_SIGN_BINDS)
        if exponent.bare or (exponent.measure.powers and exponent.measure.written):
            self.fail(f"{_PARENTHESES}, and an exponent has none: (2 s)^3", start)
        value = self.constant(exponent.node)
        if value is None:
            self.fail("an exponent must be constant; write exp(y*log(x)) for x^y", start)
        if abs(value) > LARGEST_POWER:
            self.fail(
                f'the exponent "{self.text[start : self.end]}" is beyond 64; -64 to 64 are allowed', start
            )
        return exponent.node

    def primary(self) -> _Parsed:
        start = self.start
        if self.at("("):
            inside = self.arguments()[0]
            return _Parsed(inside.node, inside.measure)
        if self.kind == "number":
            return self.quantity(start)
        if self.kind != "name":
            self.fail(f'a number, a name or "(" is missing before {self.token or "the end"}')
        name = self.advance()
        if name in _FUNCTIONS or self.at("("):
            return self.call(name, start)
        span = (start, self.end)
        if name in self.names:
            readable = self.names[name]
            if readable.jumps and not self.jumps:
                self.fail(f'"{name}" jumps, and a jump crosses zero nowhere; {readable.jumps}', start)
            written = readable.formula and placed_at(parse_expression(readable.formula, readable.parts), span)
            return _Parsed(written or Name(readable.name, span, readable), dimensions.of_name(readable))
        if (number := self.constants.get(name)) is not None:
            return _Parsed(Constant(number.alone, span), dimensions.of_number(number))
        if name == "e":
            return _Parsed(Operation("exp", (Constant(ONE, span),), span))
        near = nearest(name, self.known) or nearest(name.lower(), self.known)
        near = self.about_units(name) if units.is_unit(name) else near
        allowed = "; ".join([", ".join(self.known), *getattr(self.names, "elsewhere", ())])
        self.fail(f'unknown name "{name}"{near}; allowed: {allowed}', start)

    def quantity(self, start: int) -> _Parsed:
        """Parse a number and the unit after it."""
        try:
            value = parse_number(self.token, "1")
        except ValueError as error:
            self.fail(str(error))
        self.advance()
        end = self.measured(start, lambda: end_of_unit(self.text, self.end, BODY_NAMES, self.others))
        unit = self.text[self.start : end]
        if self.kind != "name" or not unit:
            return _Parsed(Constant(value, (start, self.end)))
        try:
            number = with_unit(value, unit, self.text[start : self.start + len(unit)])
        except ValueError as error:
            self.fail(str(error), start)
        self.token, self.kind = unit, "unit"
        self.advance()
        return _Parsed(Constant(number.alone, (start, self.end)), dimensions.of_unit(unit), bare=True)

    def call(self, name: str, start: int) -> _Parsed:
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
        measure = self.measured(start, lambda: dimensions.of_function(name, [x.measure for x in arguments]))
        nodes = [argument.node for argument in arguments]
        return _Parsed(self.bounded(written_out(name, nodes, (start, self.end)), start), measure)

    def bounded(self, node: Node, start: int) -> Node:
        """The node, unless it is too large: piecewise functions repeat their arguments."""
        waiting, count = [node], 0
        while waiting:
            inner = waiting.pop()
            waiting += inner.operands if isinstance(inner, Operation) else ()
            count += 1
            if count > MOST_NODES:
                self.fail("too many piecewise functions within one another; write fewer", start)
        return node

    def arguments(self, count: int = 1, usage: str = "one value stands in parentheses") -> list[_Parsed]:
        """Parse the arguments in parentheses."""
        opened = self.start
        self.advance()
        found = [] if self.at(")") else [self.deeper(0)]
        while self.at(","):
            self.advance()
            found.append(self.deeper(0))
        if not self.at(")"):
            hint = self.about_units(self.token) if self.kind == "name" else ""
            self.fail(f'a ")" is missing for the "(" in column {opened + 1}{hint}')
        if len(found) != count:
            self.fail(f"given {len(found)} arguments; {usage}", opened)
        self.advance()
        return found
