"""Expressions of time, the state and parameters: an algebra with exact constants, and their values.

Expressions are added, multiplied and so on as numbers are: ``sign(u)*u``. Numbers and parameters stay exact
in sums, products, quotients and whole powers. Whoever wants something of an expression folds it: its value
(``evaluate``), its bounds, its dimension, equations for heyoka, or the straight lines in time within it, such
as (t - 5000.1)/0.01, which are found with exact constants.

Every kink or jump lies where an argument u passes zero, and ``sign(u)`` is all that is piecewise about it. On
either side of u = 0 a sign is a constant, so that both sides are smooth: see ``rigidsim.scene.surfaces``.
What hides a kink is written out likewise: an even root of an even power is one of abs, and the inverse of a
sine or cosine of x is a triangle wave.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial, reduce
from operator import mul
from typing import Any, TypeVar

from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.names import Readable

T = TypeVar("T")

# Past any value that means something, and still quick to take the sine of: 5000 decimal digits fit.
_LARGEST_BITS = 20_000
_LARGEST_EXPONENTIAL = 13_862  # its exp is just below 2**_LARGEST_BITS

_ONE_ARGUMENT = "sin cos tan asin acos atan sinh cosh tanh exp log sqrt erf sigmoid"
FUNCTIONS = {**dict.fromkeys(_ONE_ARGUMENT.split(), 1), "atan2": 2}
"""Every smooth function, with its number of arguments."""
PIECEWISE = {"abs": 1, "sign": 1, "min": 2, "max": 2, "step": 1, "pulse": 3, "wrap": 1}
"""Functions with kinks and jumps; ``written_out`` rewrites them."""
RESERVED = frozenset({*FUNCTIONS, *PIECEWISE, "pi", "e"})
"""Names that no parameter may have."""


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
class Place:
    """Where something is written: from ``start`` to ``end`` of a text, at ``where`` of the config."""

    source: str
    start: int
    end: int
    where: str = ""


class Expression:
    """A constant, a name or an operation; equal ones are written at any place."""

    place: Place | None
    operands: tuple[Expression, ...] = ()

    @property
    def text(self) -> str:
        """As it is written; empty if it isn't."""
        return "" if self.place is None else self.place.source[self.place.start : self.place.end]

    @property
    def where(self) -> str:
        """The key of the config at which it stands, for messages."""
        return "" if self.place is None else self.place.where

    def error(self, what: str) -> ExpressionError:
        """An error about it, which shows its place."""
        return ExpressionError(what, *(() if self.place is None else (self.place.source, self.place.start)))

    @property
    def quoted(self) -> str:
        """Its text for a message."""
        return f'"{self.text if len(self.text) <= 60 else self.text[:57] + "..."}"'

    def __neg__(self) -> Expression:
        return operation("negative", self)

    def __add__(self, other: Operand) -> Expression:
        return operation("sum", self, constant(other))

    def __radd__(self, other: Operand) -> Expression:
        return operation("sum", constant(other), self)

    def __sub__(self, other: Operand) -> Expression:
        return self + -constant(other)

    def __rsub__(self, other: Operand) -> Expression:
        return constant(other) + -self

    def __mul__(self, other: Operand) -> Expression:
        return operation("product", self, constant(other))

    def __rmul__(self, other: Operand) -> Expression:
        return operation("product", constant(other), self)

    def __truediv__(self, other: Operand) -> Expression:
        return operation("quotient", self, constant(other))

    def __pow__(self, other: Operand) -> Expression:
        return operation("power", self, constant(other))


@dataclass(frozen=True)
class Constant(Expression):
    """A number, exact."""

    value: ExactNumber
    place: Place | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Name(Expression):
    """Time, a component of the state, or another value of the scene; ``of`` says what is known of it."""

    name: str
    of: Readable = field(compare=False)
    place: Place | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Operation(Expression):
    """Sum or product (of two or more operands), quotient, power, negative, a smooth function or ``sign``."""

    operator: str
    operands: tuple[Expression, ...]
    place: Place | None = field(default=None, compare=False)


Operand = Expression | ExactNumber | Fraction | int


def constant(value: Operand) -> Expression:
    """A number as an expression; an expression itself."""
    if isinstance(value, Expression):
        return value
    return Constant(value if isinstance(value, ExactNumber) else ExactNumber(Fraction(value)))


def rational_value(expression: Expression) -> Fraction | None:
    """The value of a rational constant; None for anything else."""
    number = expression.value if isinstance(expression, Constant) else None
    return None if number is None or number.pi_power else number.rational


def placed(expression: Expression, place: Place | None, *, anew: bool = False) -> Expression:
    """The expression with a place for all parts that have none; ``anew``: for all parts."""
    if expression.place is not None and not anew:
        return expression
    if isinstance(expression, Operation):
        operands = tuple(placed(operand, place, anew=anew) for operand in expression.operands)
        return Operation(expression.operator, operands, place)
    return replace(expression, place=place)  # type: ignore[type-var]


def _exact(operator: str, numbers: Sequence[ExactNumber]) -> ExactNumber | None:
    """The exact result; None if it isn't a rational times a power of pi, or is too long."""
    if any(number.swept for number in numbers):
        from rigidsim.scene.swept import exactly

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


def operation(operator: str, *operands: Expression) -> Expression:
    """The operation, or its exact value as a number; chains become one sum, or one product after a number."""
    numbers = [operand.value for operand in operands if isinstance(operand, Constant)]
    exact = _exact(operator, numbers) if len(numbers) == len(operands) else None
    if exact is not None:
        return Constant(exact)
    first, last = operands[0], operands[-1]
    if operator == "quotient" and isinstance(last, Constant):
        inverse = _exact(operator, [ExactNumber(Fraction(1)), last.value])
        if inverse is not None:
            return operation("product", Constant(inverse), first)
    if operator == "product" and isinstance(last, Constant):
        first, last = last, first
    if operator == "product" and isinstance(first, Constant):
        head, *tail = _chain(operator, last)
        front = _exact(operator, [first.value, head.value]) if isinstance(head, Constant) else None
        operands = (first, head, *tail) if front is None else (Constant(front), *tail)
    elif operator in ("sum", "product"):
        operands = (*_chain(operator, first), last)
    return Operation(operator, operands)


def _chain(operator: str, node: Expression) -> tuple[Expression, ...]:
    return node.operands if isinstance(node, Operation) and node.operator == operator else (node,)


# --- folding ------------------------------------------------------------------------------------------------


def fold(
    expression: Expression,
    of_constant: Callable[[Constant], T],
    of_name: Callable[[Name], T],
    of_operation: Callable[[Operation, list[T]], T],
) -> T:
    """Fold an expression from its leaves to its root, without recursion.

    Args:
        of_operation: of an operation and the results for its operands.
    """
    results: list[T] = []
    waiting: list[tuple[Expression, bool]] = [(expression, False)]
    while waiting:
        node, ready = waiting.pop()
        if isinstance(node, Constant):
            results.append(of_constant(node))
        elif isinstance(node, Name):
            results.append(of_name(node))
        elif isinstance(node, Operation) and ready:
            first = len(results) - len(node.operands)
            results[first:] = [of_operation(node, results[first:])]
        else:
            waiting.append((node, True))
            waiting += [(operand, False) for operand in reversed(node.operands)]
    return results[0]


def nodes(expression: Expression) -> Iterator[Expression]:
    """Every part of an expression, outer ones before inner ones."""
    waiting = [expression]
    while waiting:
        node = waiting.pop()
        waiting += node.operands
        yield node


def operations(expression: Expression) -> Iterator[Operation]:
    """Every operation, outer ones before inner ones."""
    return (node for node in nodes(expression) if isinstance(node, Operation))


def readables(*expressions: Expression) -> list[Readable]:
    """What the names in expressions stand for, each once."""
    each = (node for expression in expressions for node in nodes(expression) if isinstance(node, Name))
    return list({node.name: node.of for node in each}.values())


def names_used(*expressions: Expression) -> frozenset[str]:
    """Names of time and the state that expressions read; parameters are already numbers."""
    return frozenset(readable.name for readable in readables(*expressions))


def states_read(*expressions: Expression) -> frozenset[str]:
    """States without which expressions have no value, see ``Readable.states``."""
    return frozenset().union(*(readable.states for readable in readables(*expressions)))


# --- values -------------------------------------------------------------------------------------------------


def evaluate(expression: Expression, values: Mapping[str, Any], context: Any) -> Any:
    """The value (mpf) for values of the names; ``ExpressionError`` names a part without a finite one.

    None where the value of a name that it takes is None.
    """

    def named(node: Name) -> Any:
        value = values[node.name]
        return None if value is None else context.convert(value)

    def operated(node: Operation, operands: list[Any]) -> Any:
        return None if None in operands else operate(node, operands, context)

    return fold(expression, lambda node: node.value.at(context), named, operated)


def constant_value(expression: Expression, context: Any) -> Any:
    """The value (mpf) of an expression without names, see ``evaluate``; None if it contains a name."""
    return evaluate(expression, dict.fromkeys(names_used(expression)), context)


def operate(node: Operation, operands: Sequence[Any], context: Any) -> Any:
    """Apply one operation to mpf operands; ``ExpressionError`` if it isn't finite, or exceeds 2**20000."""
    operator, first, last = node.operator, operands[0], operands[-1]
    refused, why = _REFUSED.get(operator, (None, ""))
    if refused and refused(first, last):
        raise node.error(f"{why} in {node.quoted}")
    if operator == "sigmoid":
        small = context.exp(-abs(first))
        value = (1 if first >= 0 else small) / (1 + small)
    elif operator in _ARITHMETIC:
        value = _ARITHMETIC[operator](operands)
    else:
        value = getattr(context, operator)(*operands)
    if value and context.mag(value) > _LARGEST_BITS:
        raise node.error(f"{_TOO_LARGE} in {node.quoted}")
    return value


_ARITHMETIC: dict[str, Callable[[Sequence[Any]], Any]] = {
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


# --- bounds -------------------------------------------------------------------------------------------------

Interval = tuple[float, float]
_INF = math.inf
_RANGES: Mapping[str, Interval] = {
    **dict.fromkeys(("sin", "cos", "sign", "tanh", "erf"), (-1.0, 1.0)),
    **{"sigmoid": (0.0, 1.0), "exp": (0.0, _INF), "sqrt": (0.0, _INF), "cosh": (1.0, _INF)},
    **{"atan": (-2.0, 2.0), "asin": (-2.0, 2.0), "acos": (0.0, 4.0), "atan2": (-4.0, 4.0)},
}
"""Of functions whose values don't go everywhere."""


def bounds(expression: Expression, *, always: bool = True) -> Interval:
    """Bounds of the value, in interval arithmetic.

    Args:
        always: over any number of turns of angles, and for all members of a sweep; otherwise within one turn,
            and for the representative member.
    """

    def of_constant(node: Constant) -> Interval:
        if always and node.value.swept:
            return (0.0, _INF) if node.value.sign >= 0 else (-_INF, 0.0)
        return (float(node.value), float(node.value))

    def of_name(node: Name) -> Interval:
        most = _INF if always and node.of.turns else node.of.bound
        return -most, most

    def of_operation(node: Operation, operands: list[Interval]) -> Interval:
        (low, high), last = operands[0], operands[-1]
        if node.operator == "sum":
            lows, highs = zip(*operands, strict=True)
            return -_INF if -_INF in lows else sum(lows), _INF if _INF in highs else sum(highs)
        if node.operator == "negative":
            return -high, -low
        if node.operator == "product":
            return reduce(_product, operands)
        if node.operator == "quotient" and last[0] >= 0:
            return _product((low, high), (_raised(last[1], -1), _raised(last[0], -1)))
        if node.operator == "power":
            return _power((low, high), node.operands[1])
        return _RANGES.get(node.operator, (-_INF, _INF))

    return fold(expression, of_constant, of_name, of_operation)


def _product(a: Interval, b: Interval) -> Interval:
    ends = [x * y if x and y else 0.0 for x in a for y in b]
    return min(ends), max(ends)


def _power(base: Interval, exponent: Expression) -> Interval:
    """Of a power that is real: its base isn't negative, unless the exponent is whole."""
    value = exponent.value if isinstance(exponent, Constant) else None
    if value is None or value.swept or value.pi_power or value.rational.denominator != 1:
        base = max(base[0], 0.0), max(base[1], 0.0)
    elif value.rational % 2 == 0:
        low, high = sorted(map(abs, base))
        base = (low if base[0] * base[1] > 0 else 0.0), high
    if value is None or (base[0] < 0 and value.sign < 0):
        return 0.0 if base[0] >= 0 else -_INF, _INF
    return _raised(base[value.sign < 0], float(value)), _raised(base[value.sign >= 0], float(value))


def _raised(x: float, exponent: float) -> float:
    try:
        return x**exponent
    except ZeroDivisionError:
        return _INF
    except OverflowError:
        return math.copysign(_INF, x)


# --- straight lines in time ---------------------------------------------------------------------------------


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
    first, last = operands[0], operands[-1]
    if operator == "sum":
        slope = sum((x.slope for x in lines[1:]), lines[0].slope)
        offset = sum(numbers, sum((x.offset for x in lines[1:]), lines[0].offset))
        return LineInTime(slope, offset) if slope != 0 else offset
    if operator == "negative":
        return LineInTime(-first.slope, -first.offset)
    if operator == "quotient" and not isinstance(last, LineInTime) and last != 0:
        return LineInTime(first.slope / last, first.offset / last)
    if operator == "product" and len(lines) == 1:
        factor, line = math.prod(numbers), lines[0]
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

    def of_operation(node: Operation, operands: list[Any]) -> Any:
        lines = [x for x in operands if isinstance(x, LineInTime)]
        whole = None
        if None not in operands:
            whole = line_of(node.operator, operands) if lines else operate(node, operands, context)
        if whole is None:
            found.extend(lines)
        return whole

    time = LineInTime(context.one, context.zero)
    at = lambda node: node.value.at(context)  # noqa: E731
    return fold(expression, at, lambda node: time if node.name == "t" else None, of_operation)


# --- kinks and jumps, rewritten in smooth functions and signs -----------------------------------------------


_HALF = Fraction(1, 2)
_QUARTER = constant(ExactNumber(_HALF, 1))
"""A quarter of a turn, rad."""


def written_out(operator: str, *operands: Expression) -> Expression:
    """An operation or function of the grammar in smooth functions and signs."""
    return _WAYS.get(operator, partial(operation, operator))(*operands)


def sign(u: Expression) -> Expression:  # noqa: D103
    return Operation("sign", (u,))


def _step(u: Expression) -> Expression:
    return _HALF * (1 + sign(u))


def _abs(u: Expression) -> Expression:
    while isinstance(u, Operation) and u.operator == "negative":
        (u,) = u.operands
    return sign(u) * u


def _max(a: Expression, b: Expression) -> Expression:
    over = _step(a - b)
    return over * a + (1 - over) * b


def _min(a: Expression, b: Expression) -> Expression:
    over = _step(a - b)
    return (1 - over) * a + over * b


def _wrap(x: Expression) -> Expression:
    """x less full turns, in (-pi, pi]: twice the angle of its half, turned to a positive cosine."""
    cosine, sine = (operation(name, _HALF * x) for name in ("cos", "sin"))
    side = sign(cosine)
    return 2 * operation("atan2", side * sine, side * cosine)


def _atan2(y: Expression, x: Expression) -> Expression:
    """From the quarter turn, which it passes smoothly, on either side of y = 0."""
    if isinstance(y, Constant):
        return operation("atan2", y, x)
    return sign(y) * (_QUARTER - operation("atan2", x, sign(y) * y))


def _inverse(name: str, u: Expression) -> Expression:
    """asin or acos: of a sine or cosine a triangle wave."""
    if not isinstance(u, Operation) or u.operator not in ("sin", "cos"):
        return operation(name, u)
    (x,) = u.operands
    wave = _abs(_wrap(x - _QUARTER if u.operator == "sin" else x))
    return _QUARTER - wave if name == "asin" else wave


def _sqrt(u: Expression) -> Expression:
    found = _of_power(u, constant(_HALF))
    same = isinstance(found, Operation) and found.operator == "power" and found.operands[0] == u
    return operation("sqrt", u) if same or isinstance(found, Constant) else found


def _of_power(base: Expression, exponent: Expression) -> Expression:
    """Even roots of even powers are taken of the absolute value."""
    rest = rational_value(exponent)
    if rest is None or isinstance(base, Constant):
        return base**exponent
    root = base
    while rest.denominator % 2 == 0 and (inner := _square_root(root)) is not None:
        root, rest = inner, 2 * rest
    if root is base:
        return base**exponent
    if (rest.numerator % 2 or rest.denominator != 1) and _square_root(root) is None:
        root = _abs(root)
    return root if rest == 1 else root ** constant(rest)


def _square_root(node: Expression) -> Expression | None:
    """That whose square this is by its form, up to sign; None if it isn't a square."""
    if isinstance(node, Constant):
        return operation("sqrt", node) if node.value.sign >= 0 else None
    if not isinstance(node, Operation):
        return None
    if node.operator == "power":
        base, exponent = node.operands
        rational = rational_value(exponent)
        if rational is None or rational % 2 != 0:
            return None
        return base if rational == 2 else base ** (rational / 2)
    if node.operator == "quotient":
        above, below = map(_square_root, node.operands)
        return None if above is None or below is None else Operation("quotient", (above, below))
    if node.operator != "product":
        return None
    roots, waiting = [], list(node.operands)
    while waiting:
        factor = waiting.pop(0)
        root = _square_root(factor)
        if root is None:
            if factor not in waiting:
                return None
            waiting.remove(factor)
            root = factor
        roots.append(root)
    return reduce(mul, roots)


_WAYS: Mapping[str, Callable[..., Expression]] = {
    **{
        "abs": _abs,
        "sign": sign,
        "step": _step,
        "max": _max,
        "min": _min,
        "pulse": lambda x, begin, end: _step(x - begin) * _step(end - x),
        "wrap": _wrap,
    },
    **{"atan2": _atan2, "asin": partial(_inverse, "asin"), "acos": partial(_inverse, "acos")},
    **{"sqrt": _sqrt, "power": _of_power, "e": lambda: operation("exp", constant(1))},
}


def on_sides(
    expression: Expression, places: Mapping[Expression, tuple[int, int]], sides: Sequence[int]
) -> Expression:
    """An expression with every sign in it replaced by its value: of the argument's surface, whose index and
    ratio ``places`` gives; a sign stays where ``sides`` has neither 1 nor -1.
    """

    def of_operation(node: Operation, operands: list[Expression]) -> Expression:
        if node.operator == "sign" and node.operands[0] in places:
            index, ratio = places[node.operands[0]]
            if abs(sides[index]) == 1:
                return placed(constant(ratio * sides[index]), node.place)
        if len(operands) > 2:  # a chain, made two by two
            found = reduce(lambda a, b: operation(node.operator, a, b), operands)
        else:
            found = operation(node.operator, *operands)
        return placed(found, node.place)

    return fold(expression, lambda node: node, lambda node: node, of_operation)
