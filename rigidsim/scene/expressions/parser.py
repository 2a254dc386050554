"""Expressions of time, the state and parameters as a user writes them: ``k*sin(t)^2 - wx/2``.

Text is read by the parser below and by nothing else: Python never sees it.

    sum      = product {("+" | "-") product}
    product  = signed {("*" | "/") signed}
    signed   = ("+" | "-") signed | power
    power    = primary [("^" | "**") signed]          right-associative: -x^2 is -(x^2), 2^3^2 is 2^9
    primary  = number [unit] | name | function "(" sum {"," sum} ")" | "(" sum ")"
    unit     = name ["^" integer] {["*" | "/"] name ["^" integer]}    as far as these are names of units

Numbers, parameters and their sums, products, quotients and whole powers stay exact.

Dimensions are checked wherever units are written. A bare number, and a parameter without a unit, is in SI of
whatever dimension fits, so that nothing is known of a product with it. Time and the state have their
dimensions (angles have none). Sums are checked, arguments of functions, and what a component is needed in;
but only where a unit is written in one of the parts, so that ``sin(t)``, which takes t in seconds, stays
what it was.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NoReturn

from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.exact import ExactNumber, Powers, is_unit, parse_number, powers, unit_text
from rigidsim.scene.expressions.names import BODY_NAMES, Readable
from rigidsim.scene.expressions.tree import (
    FUNCTIONS,
    PIECEWISE,
    RESERVED,
    Constant,
    Expression,
    ExpressionError,
    Name,
    Operation,
    Place,
    constant_value,
    fold,
    nodes,
    placed,
    written_out,
)
from rigidsim.scene.validation_messages import nearest

LONGEST_TEXT = 2000
DEEPEST_NESTING = 64
MOST_NODES = 5000
LARGEST_POWER = 64
_FUNCTIONS = {**FUNCTIONS, **PIECEWISE}
_INSTEAD = {"ln": "; write log(...)", "pow": "; write x^2", "sgn": "; write sign(...)"}
_INSTEAD |= {"heaviside": "; write step(...)", "mod": "; write wrap(...), which takes off full turns"}
_JUMPS = ("sign", "step", "pulse")
_USAGE = {"atan2": "y, x", "min": "a, b", "max": "a, b", "pulse": "x, begin, end"}
_BINDS = {"+": 1, "-": 1, "*": 2, "/": 2, "^": 4, "**": 4}
_SIGN_BINDS = 3
_OPERATORS = {"+": "sum", "-": "sum", "*": "product", "/": "quotient", "^": "power", "**": "power"}
_COMPARISON = (
    "an expression is one value, without comparisons; an event takes the difference of both sides, and "
    "step(t - 10), pulse(t, 10, 12), sign, min and max switch"
)
_HINTS = {
    "=": "an expression is one value, without assignments; write only the right-hand side of the =",
    ".": "a point is part of a number only; names have no attributes",
    "_": "names begin with a letter",
    "°": "write deg, as in 90 deg",
    **dict.fromkeys("<>!", _COMPARISON),
}
_NUMBER = r"(?:[0-9]+(?:_[0-9]+)*\.?(?:[0-9]+(?:_[0-9]+)*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_TOKEN = re.compile(
    rf"(?P<number>{_NUMBER})|(?P<name>[A-Za-z][A-Za-z0-9_]*)|(?P<sign>\*\*|[-+*/^(),])|(?P<end>\Z)"
)
_PARENTHESES = 'a number with a unit needs parentheses next to "/" and "^"'
_CHECKING = context_for("quadruple")


def parse_expression(
    text: str,
    names: Mapping[str, Readable],
    *,
    parameters: Mapping[str, ExactNumber] | None = None,
    jumps: bool = True,
    unit: str | None = None,
    read_too: bool = False,
    where: str = "",
) -> Expression:
    """Parse an expression.

    Args:
        text: of at most ``LONGEST_TEXT`` characters (which bounds the tree as well); lines are joined.
        names: names of time and the state that are allowed here; ``Names`` say what would bring others.
        parameters: named constants, which enter as exact numbers.
        jumps: whether piecewise constant functions are allowed.
        unit: SI unit of the value; None for any.
        read_too: whether it is checked where no unit is written, too: against the units of what is read.
        where: the key of the config at which it stands, for messages about its parts.

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
    text = " ".join(text.split()) if "\n" in text else text  # columns count within one line
    if not text.strip(" \t"):
        raise ExpressionError("an empty expression; write a number or a formula such as k*sin(t)^2")
    read = _Parser(text, names, parameters, jumps, where).all()
    found, measure = fold(read, _constant, _named, _operated)
    constant_value(found, _CHECKING)
    if unit is not None:
        _check_unit(measure, unit, read_too=read_too)
    return replace(found, place=Place(text, 0, len(text), where))  # type: ignore[type-var]


# --- what is read, in smooth functions and signs, its constants folded, with its dimension ------------------

_Meant = tuple[Expression, "Measure"]


def _constant(node: Constant) -> _Meant:
    measure = Measure(powers(node.value.unit), written=True) if node.value.unit else ANY
    return replace(node, value=node.value.alone), measure


def _named(node: Name) -> _Meant:
    unit = node.of.unit
    meant: Expression = node
    if node.of.formula:
        meant = placed(parse_expression(node.of.formula, node.of.parts), node.place, anew=True)
    return meant, ANY if unit is None else Measure(powers(unit)) if unit else NUMBER


def _operated(node: Operation, meant: list[_Meant]) -> _Meant:
    operands = [operand for operand, _ in meant]
    last = operands[-1] if operands else node
    if node.operator == "quotient" and constant_value(last, _CHECKING) == 0:
        raise last.error(f"division by the zero in {last.quoted}")
    measure = _measure_of_operation(node, [measure for _, measure in meant], last)
    if node.operator == "power":
        value = constant_value(last, _CHECKING)
        if value is None:
            raise last.error("an exponent must be constant; write exp(y*log(x)) for x^y")
        if abs(value) > LARGEST_POWER:
            raise last.error(f"the exponent {last.quoted} is beyond 64; -64 to 64 are allowed")
    found = placed(written_out(node.operator, *operands), node.place)
    repeating = node.operator == "power" or node.operator in _FUNCTIONS
    if repeating and sum(1 for _ in nodes(found)) > MOST_NODES:
        raise node.error("too many piecewise functions within one another; write fewer")
    return found, measure


class _Parser:
    """Recursive descent with one token of lookahead: its ``kind``, ``token`` (text) and ``start``."""

    def __init__(
        self,
        text: str,
        names: Mapping[str, Readable],
        parameters: Mapping[str, ExactNumber],
        jumps: bool,
        where: str,
    ) -> None:
        self.text, self.names, self.parameters, self.jumps, self.where = text, names, parameters, jumps, where
        self.constants = {**parameters, "pi": ExactNumber(Fraction(1), 1)}
        self.others = {*parameters, *names} - set(BODY_NAMES)
        self.known = [*names, *self.constants, "e"]
        self.depth = self.start = self.end = 0
        self.kind = self.token = ""
        self.enclosed: Expression | None = None  # what stands in the last parentheses
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
            if unit not in self.known and is_unit(unit):
                hint = f'; a space separates a unit, as in "{match[0]} {unit}"'
            self.fail(f'"{run[0]}" is no number, such as 2, 0.5 or 1e-3{hint}')
        return passed

    def unknown_character(self, rest: str) -> NoReturn:
        shown = f'"{rest[0]}"'
        if not (rest[0].isascii() and rest[0].isprintable()):
            shown = f"U+{ord(rest[0]):04X} ({unicodedata.name(rest[0], 'a control character').lower()})"
        hint = _HINTS.get(rest[0], "allowed: numbers, names, functions and + - * / ^ ( ) ,")
        self.fail(f"unknown character {shown}; {_COMPARISON if rest.startswith('==') else hint}")

    def node(self, operator: str, start: int, *operands: Expression) -> Operation:
        return Operation(operator, operands, self.place(start))

    def place(self, start: int) -> Place:
        """The place of what was read last."""
        return Place(self.text, start, self.end, self.where)

    def at(self, *signs: str) -> bool:
        return self.kind == "sign" and self.token in signs

    def deeper(self, weakest: int) -> Expression:
        """Parse an expression one level down."""
        self.depth += 1
        if self.depth > DEEPEST_NESTING:
            self.fail(f"nested too deeply; at most {DEEPEST_NESTING} levels are allowed")
        node = self.binary(weakest)
        self.depth -= 1
        return node

    def all(self) -> Expression:
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
            return f' ("{name}" is no unit here, but a name of this scene)' if is_unit(name) else ""
        if is_unit(name):
            return f"; a unit follows a number, as in 2 {name}"
        return f'; no unit is called "{name}"'

    def binary(self, weakest: int) -> Expression:
        """Parse operands joined by operators that bind more strongly than ``weakest``."""
        start = self.start
        if self.at("+", "-"):
            sign, left = self.advance(), self.deeper(_SIGN_BINDS)
            left = self.node("negative", start, left) if sign == "-" else left
        else:
            left = self.primary()
        while self.at(*_BINDS) and _BINDS[self.token] > weakest:
            at, sign = self.start, self.advance()
            power = _OPERATORS[sign] == "power"
            if power and self.is_bare(left):
                self.fail(f"{_PARENTHESES}: (2 s)^3", at)
            right = self.deeper(_SIGN_BINDS) if power else self.binary(_BINDS[sign])
            if sign == "/" and self.is_bare(right):
                self.fail(f"{_PARENTHESES}: 1/(2 s) or (1/2)*(1 s)", at)
            if sign == "-":
                right = Operation("negative", (right,), right.place)
            left = self.node(_OPERATORS[sign], start, left, right)
        return left

    def is_bare(self, node: Expression) -> bool:
        """Whether it is a number with a unit without parentheses around it."""
        while isinstance(node, Operation) and node.operator == "negative":
            node = node.operands[0]
        number = isinstance(node, Constant) and node is not self.enclosed and bool(node.value.unit)
        return number and node.text[0] in "0123456789."

    def primary(self) -> Expression:
        start = self.start
        if self.at("("):
            (self.enclosed,) = self.arguments()
            return self.enclosed
        if self.kind == "number":
            return self.quantity(start)
        if self.kind != "name":
            self.fail(f'a number, a name or "(" is missing before {self.token or "the end"}')
        name = self.advance()
        if name in _FUNCTIONS or self.at("("):
            return self.call(name, start)
        place = self.place(start)
        if name in self.names:
            readable = self.names[name]
            if readable.jumps and not self.jumps:
                self.fail(f'"{name}" jumps, and a jump crosses zero nowhere; {readable.jumps}', start)
            return Name(readable.name, readable, place)
        if (number := self.constants.get(name)) is not None:
            return Constant(number, place)
        if name == "e":
            return self.node("e", start)
        near = nearest(name, self.known) or nearest(name.lower(), self.known)
        near = self.about_units(name) if is_unit(name) else near
        allowed = "; ".join([", ".join(self.known), *getattr(self.names, "elsewhere", ())])
        self.fail(f'unknown name "{name}"{near}; allowed: {allowed}', start)

    def quantity(self, start: int) -> Expression:
        """Parse a number and the unit after it."""
        token = self.advance()
        try:
            end = _end_of_unit(self.text, self.end, BODY_NAMES, self.others)
            unit = self.text[self.start : end] if self.kind == "name" else ""
            value = parse_number(" ".join([token, *unit.split()]))
        except ValueError as error:
            self.fail(str(error), start)
        if unit:
            self.token, self.kind = unit, "unit"
            self.advance()
        return Constant(value, self.place(start))

    def call(self, name: str, start: int) -> Expression:
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
        return self.node(name, start, *arguments)

    def arguments(self, count: int = 1, usage: str = "it takes one value in parentheses") -> list[Expression]:
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


# --- dimensions ---------------------------------------------------------------------------------------------

_WORD_OF_UNIT = re.compile(
    r"[ \t]*(?P<join>[*/]?)[ \t]*(?P<name>[A-Za-z][A-Za-z0-9_]*)"
    r"(?P<power>[ \t]*(?:\^|\*\*)[ \t]*-?[0-9]+(?![\d.]))?"
)


@dataclass(frozen=True)
class Measure:
    """What is known of a dimension: powers of base units (empty for a number or an angle, None if any is
    possible), and whether a unit was written in the value.
    """

    powers: Powers | None
    written: bool = False

    def times(self, other: Measure, power: Fraction | int = 1) -> Measure:
        """Dimension of the product with a power of another value."""
        written = self.written or other.written
        if self.powers is None or other.powers is None:
            return Measure(None, written)
        found = dict(self.powers)
        for base, exponent in other.powers:
            found[base] = found.get(base, Fraction(0)) + power * exponent
        return Measure(tuple(sorted((base, n) for base, n in found.items() if n)), written)

    def power(self, exponent: ExactNumber | None) -> Measure:
        """Dimension of a power; for an exponent that isn't rational, only a number's stays known."""
        if not self.powers:
            return self
        if exponent is None or exponent.pi_power:
            return Measure(None, self.written)
        return Measure((), self.written).times(self, exponent.rational)

    def __str__(self) -> str:
        if self.powers is None:
            return "a value of any dimension"
        return f'a value in "{unit_text(self.powers)}"' if self.powers else "a number or an angle"


NUMBER, ANY = Measure(()), Measure(None)


def _measure_of_operation(node: Operation, operands: Sequence[Measure], last: Expression | None) -> Measure:
    """Dimension of an operation as it is written.

    Args:
        last: its last operand with constants folded.

    Raises:
        ExpressionError: values of different dimensions where one is needed.
    """
    if not operands:
        return ANY
    name, first, *others = node.operator, *operands
    if name in ("product", "quotient"):
        return first.times(others[0], 1 if name == "product" else -1)
    if name in ("negative", "abs"):
        return first
    if name == "power":
        if others[0].powers and others[0].written:
            raise node.operands[1].error("an exponent is a number, without a unit")
        return first.power(last.value if isinstance(last, Constant) else None)
    if name == "sqrt":
        return first.power(ExactNumber(Fraction(1, 2)))
    common = first
    for other, operand in zip(others, node.operands[1:], strict=True):
        common = _common(common, other, operand if name == "sum" else node)
    if name in ("sum", "min", "max"):
        return common
    if common.powers and common.written and name not in ("sign", "step", "pulse", "atan2"):
        raise node.error(
            f'"{name}" takes a number or an angle, given {common}; divide by '
            f'"(1 {unit_text(common.powers)})" if that is meant'
        )
    return Measure((), any(operand.written for operand in operands))


def _check_unit(found: Measure, needed: str, *, read_too: bool = False) -> None:
    """Check that a value can have the required dimension; ``ExpressionError`` otherwise.

    Args:
        read_too: also if its dimension is only the dimension of what it reads.
    """
    known = found.written or (read_too and bool(found.powers))
    if known and found.powers is not None and found.powers != powers(needed):
        raise ExpressionError(f'the expression is {found}, where "{needed}" is needed')


def _common(a: Measure, b: Measure, where: Expression) -> Measure:
    """Dimension of a sum or comparison; refused if they differ and either has a unit."""
    written = a.written or b.written
    if a.powers is None or b.powers is None or a.powers == b.powers:
        return Measure(b.powers if a.powers is None else a.powers, written)
    if written:
        raise where.error(f"{a} and {b} can't be added or compared")
    return Measure(None)


def _end_of_unit(text: str, position: int, names: Collection[str], parameters: Collection[str]) -> int:
    """Position at which a unit ends that begins after ``position``; ``position`` itself if there is none.

    Args:
        names: names of the state and of time, which are never units: t is no tonne.
        parameters: these and other names of the scene are units only within a text that can't be meant
            otherwise, as ``m`` in "9.81 m/s^2" and in "0.1 N m", since products have their sign.

    Raises:
        ValueError: the text is ambiguous, like "5 N*m" if m is a parameter.
    """
    end, certain = position, False
    while (match := _WORD_OF_UNIT.match(text, end)) is not None:
        name, join = match["name"], match["join"]
        called = text[match.end() :].lstrip(" \t").startswith("(") and match["power"] is None
        if called or name in names or (join and end == position) or not is_unit(name):
            break
        if join and name in parameters:
            raise ValueError(
                f'"{name}" is a name of this scene, and a unit as well; write the unit without "{join}", or '
                "parentheses around the number with its unit"
            )
        end, certain = match.end(), certain or name not in parameters
    return end if certain else position
