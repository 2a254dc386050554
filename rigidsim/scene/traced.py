"""Numbers that remember how they were worked out, so that one scene stands for all members of a sweep.

A traced number has the value of one member, the representative, and a node in a graph of operations that
begins with the swept numbers. Scene and model are worked out with it as with any other number. Whatever they
decide by it (a comparison, a value taken as a float) is noted as a guard. Members that decide everywhere as
the representative does have its equations, and their coefficients follow from the graph; others don't, and
are traced again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from rigidsim.scene.exact import ExactNumber

FUNCTIONS = (
    "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "hypot", "exp", "log", "sinh", "cosh",
    "tanh", "asinh", "acosh", "atanh", "erf",
)  # fmt: skip
"""Of the context, which the graph knows; whatever else is made of a traced number is refused."""


class Untraceable(Exception):
    """Something was asked of a traced number that the graph can't hold: its members are run one by one."""


@dataclass(frozen=True)
class Guard:
    """A decision: whether the left node is less than ("<") or equal to ("=") the right one.

    Attributes:
        whole: whether the nodes are those of whole numbers.
    """

    kind: str
    left: int
    right: int
    outcome: bool
    whole: bool = False


@dataclass
class Graph:
    """Operations on the swept numbers, each once, in an order in which they can be worked out.

    Attributes:
        context: mpmath context of the scene, in which the representative is worked out.
        nodes: (operation, arguments): "column" (its number), "constant" (an mpf), "power_of_two" (a whole
            node), or a function of nodes.
        values: the representative's, mpf.
        wholes, whole_values: the same of whole numbers: "exponent" and "magnitude" of a node, "constant", and
            sums, products, negatives and absolute values of whole nodes.
        guards: decisions so far, each once.
    """

    context: Any
    nodes: list[tuple[str, tuple[Any, ...]]] = field(default_factory=list)
    values: list[Any] = field(default_factory=list)
    wholes: list[tuple[str, tuple[Any, ...]]] = field(default_factory=list)
    whole_values: list[int] = field(default_factory=list)
    guards: dict[Guard, None] = field(default_factory=dict)
    _known: dict[Any, int] = field(default_factory=dict)

    def node(self, operation: str, arguments: tuple[Any, ...], value: Any) -> int:
        """Number of a node, which is new or known."""
        key = (operation, tuple(a._mpf_ if hasattr(a, "_mpf_") else a for a in arguments))
        if key not in self._known:
            self._known[key] = len(self.nodes)
            self.nodes.append((operation, arguments))
            self.values.append(value)
        return self._known[key]

    def whole(self, operation: str, arguments: tuple[Any, ...], value: int) -> int:
        """The same of whole numbers."""
        key = ("whole", operation, arguments)
        if key not in self._known:
            self._known[key] = len(self.wholes)
            self.wholes.append((operation, arguments))
            self.whole_values.append(value)
        return self._known[key]

    def constant(self, value: Any) -> int:
        """Node of a plain number."""
        value = self.context.convert(value) if not isinstance(value, Fraction) else self._fraction(value)
        return self.node("constant", (value,), value)

    def _fraction(self, value: Fraction) -> Any:
        return self.context.mpf(value.numerator) / self.context.mpf(value.denominator)

    def decide(self, kind: str, left: int, right: int, outcome: bool, *, whole: bool = False) -> bool:
        """Note a decision of the representative."""
        self.guards.setdefault(Guard(kind, left, right, bool(outcome), whole))
        return bool(outcome)

    def column(self, number: int, exact: ExactNumber) -> TracedExact:
        """A swept number; ``exact`` is the representative's."""
        return TracedExact(self, self.node("column", (number,), exact.at(self.context)), exact)


class Traced:
    """A number of a graph; see the module."""

    __slots__ = ("graph", "node")

    def __init__(self, graph: Graph, node: int) -> None:
        self.graph, self.node = graph, node

    @property
    def value(self) -> Any:
        """The representative's (mpf)."""
        return self.graph.values[self.node]

    def _other(self, other: Any) -> int:
        if isinstance(other, Traced):
            return other.node
        return self.graph.constant(other)

    def _made(self, operation: str, arguments: tuple[int, ...], value: Any) -> Traced:
        return Traced(self.graph, self.graph.node(operation, arguments, value))

    def __add__(self, other: Any) -> Any:
        if not isinstance(other, Traced) and other == 0:
            return self
        there = self._other(other)
        for this, that in ((self.node, there), (there, self.node)):
            if self.graph.nodes[this] == ("negative", (that,)):
                return self.graph.context.zero
        return self._made("add", (self.node, there), self.value + self.graph.values[there])

    __radd__ = __add__

    def __neg__(self) -> Any:
        return self._made("negative", (self.node,), -self.value)

    def __pos__(self) -> Any:
        return self

    def __sub__(self, other: Any) -> Any:
        if not isinstance(other, Traced) and other == 0:
            return self
        there = self._other(other)
        if there == self.node:
            return self.graph.context.zero
        return self._made("subtract", (self.node, there), self.value - self.graph.values[there])

    def __rsub__(self, other: Any) -> Any:
        if other == 0:
            return -self
        there = self._other(other)
        return self._made("subtract", (there, self.node), self.graph.values[there] - self.value)

    def __mul__(self, other: Any) -> Any:
        if not isinstance(other, Traced):
            if other == 0:
                return self.graph.context.zero
            if other == 1:
                return self
            if other == -1:
                return -self
        there = self._other(other)
        return self._made("multiply", (self.node, there), self.value * self.graph.values[there])

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        if not isinstance(other, Traced) and other == 1:
            return self
        there = self._other(other)
        for this, that, ratio in ((self.node, there, 1), (there, self.node, 1)):
            if this == that and self != 0:
                return self.graph.context.mpf(ratio)
            if self.graph.nodes[this] == ("negative", (that,)) and self != 0:
                return self.graph.context.mpf(-ratio)
        return self._made("divide", (self.node, there), self.value / self.graph.values[there])

    def __rtruediv__(self, other: Any) -> Any:
        there = self._other(other)
        if other == 0 and self != 0:
            return self.graph.context.zero
        return self._made("divide", (there, self.node), self.graph.values[there] / self.value)

    def __pow__(self, exponent: Any) -> Any:
        if isinstance(exponent, Traced):
            if exponent != int(exponent.value):
                raise Untraceable("a fractional power")
            exponent = int(exponent.value)
        if exponent != int(exponent):
            if exponent == 0.5:
                return _sqrt(self)
            raise Untraceable("a fractional power")
        exponent = int(exponent)
        if exponent < 0:
            return 1 / self ** (-exponent)
        return self._made("power", (self.node, exponent), self.value**exponent)

    def __rpow__(self, base: Any) -> Any:
        raise Untraceable("a swept power")

    def __abs__(self) -> Any:
        return self._made("absolute", (self.node,), abs(self.value))

    # --- decisions ------------------------------------------------------------------------------------------

    def __hash__(self) -> int:
        return 0  # whether two are equal is always decided by a guard

    def __eq__(self, other: object) -> bool:
        if other is None or isinstance(other, str):
            return False
        there = self._other(other)
        if there == self.node:
            return True
        return self.graph.decide("=", self.node, there, self.value == self.graph.values[there])

    def __lt__(self, other: Any) -> bool:
        there = self._other(other)
        return self.graph.decide("<", self.node, there, self.value < self.graph.values[there])

    def __gt__(self, other: Any) -> bool:
        there = self._other(other)
        return self.graph.decide("<", there, self.node, self.graph.values[there] < self.value)

    def __le__(self, other: Any) -> bool:
        return not self > other

    def __ge__(self, other: Any) -> bool:
        return not self < other

    def __bool__(self) -> bool:
        return self != 0

    def __float__(self) -> float:
        return float(self._decided())

    def __int__(self) -> int:
        return int(self._decided())

    def _decided(self) -> Any:
        """The value itself, of the representative and of members that have the same."""
        self.graph.decide("=", self.node, self.graph.constant(self.value), outcome=True)
        return self.value


class TracedWhole:
    """A whole number that depends on traced ones, such as the binary exponent of a unit."""

    __slots__ = ("graph", "node")

    def __init__(self, graph: Graph, node: int) -> None:
        self.graph, self.node = graph, node

    @property
    def value(self) -> int:
        """The representative's."""
        return self.graph.whole_values[self.node]

    def _other(self, other: Any) -> int:
        if isinstance(other, TracedWhole):
            return other.node
        return self.graph.whole("constant", (int(other),), int(other))

    def _made(self, operation: str, arguments: tuple[int, ...], value: int) -> TracedWhole:
        return TracedWhole(self.graph, self.graph.whole(operation, arguments, value))

    def __add__(self, other: Any) -> TracedWhole:
        if not isinstance(other, TracedWhole) and other == 0:
            return self
        there = self._other(other)
        return self._made("add", (self.node, there), self.value + self.graph.whole_values[there])

    __radd__ = __add__

    def __neg__(self) -> TracedWhole:
        return self._made("negative", (self.node,), -self.value)

    def __sub__(self, other: Any) -> TracedWhole:
        return self + (-other)

    def __rsub__(self, other: Any) -> TracedWhole:
        return -self + other

    def __mul__(self, other: Any) -> TracedWhole:
        there = self._other(other)
        return self._made("multiply", (self.node, there), self.value * self.graph.whole_values[there])

    __rmul__ = __mul__

    def __abs__(self) -> TracedWhole:
        return self._made("absolute", (self.node,), abs(self.value))

    def __hash__(self) -> int:
        return 0

    def __eq__(self, other: object) -> bool:
        there = self._other(other)
        return self._decide("=", self.node, there, self.value == self.graph.whole_values[there])

    def __lt__(self, other: Any) -> bool:
        there = self._other(other)
        return self._decide("<", self.node, there, self.value < self.graph.whole_values[there])

    def __gt__(self, other: Any) -> bool:
        there = self._other(other)
        return self._decide("<", there, self.node, self.graph.whole_values[there] < self.value)

    def __le__(self, other: Any) -> bool:
        return not self > other

    def __ge__(self, other: Any) -> bool:
        return not self < other

    def __bool__(self) -> bool:
        return self != 0

    def _decide(self, kind: str, left: int, right: int, outcome: bool) -> bool:
        return self.graph.decide(kind, left, right, outcome, whole=True)

    def __index__(self) -> int:
        self._decide("=", self.node, self._other(self.value), True)
        return self.value

    __int__ = __index__

    def __float__(self) -> float:
        return float(self.__index__())


class TracedExact(ExactNumber):
    """A swept number as it stands in a config.

    Args:
        exact: the representative's.
    """

    def __init__(self, graph: Graph, node: int, exact: ExactNumber) -> None:
        for name, value in (("graph", graph), ("node", node), ("exact", exact)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "assumed", exact.assumed)

    graph: Graph
    node: int
    exact: ExactNumber

    def at(self, context: Any) -> Any:
        """A traced number in the graph's context, the representative's value in any other."""
        return self._traced() if isinstance(context, TracingContext) else self.exact.at(context)

    @property
    def rational(self) -> Fraction:
        """The representative's, and that of members that have the same."""
        self._traced()._decided()
        return self.exact.rational

    @property
    def pi_power(self) -> int:
        """The same for all members."""
        return self.exact.pi_power

    def fraction(self, context: Any) -> Fraction:
        """As ``rational``."""
        self._traced()._decided()
        return self.exact.fraction(context)

    def __float__(self) -> float:
        return float(self.exact)

    @property
    def alone(self) -> ExactNumber:
        """Itself."""
        return self

    def _traced(self) -> Traced:
        return Traced(self.graph, self.node)

    @property
    def sign(self) -> int:
        """Decided by a guard."""
        number = self._traced()
        return 0 if number == 0 else (1 if number > 0 else -1)

    def __hash__(self) -> int:
        return 0

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ExactNumber):
            return False
        there = other._traced() if isinstance(other, TracedExact) else other.at(self.graph.context)
        return self._traced() == there


def exactly(operator: str, numbers: Sequence[ExactNumber]) -> ExactNumber | None:
    """What an expression makes of numbers of which some are swept; None where that isn't a rational times a
    power of pi.
    """
    swept = next(n for n in numbers if isinstance(n, TracedExact))
    graph = swept.graph
    a, b = numbers[0], numbers[-1]
    x, y = (n._traced() if isinstance(n, TracedExact) else n.at(graph.context) for n in (a, b))
    plain = [n.exact if isinstance(n, TracedExact) else n for n in (a, b)]
    p, q, turns = plain[0].rational, plain[1].rational, a.pi_power
    made: Any
    if operator == "negative":
        p, made = -p, -x
    elif operator == "sum" and a.pi_power == b.pi_power:
        p, made = p + q, x + y
    elif operator == "product":
        p, turns, made = p * q, turns + b.pi_power, x * y
    elif operator == "quotient" and y != 0:
        p, turns, made = p / q, turns - b.pi_power, x / y
    elif operator == "power" and isinstance(a, TracedExact) and not isinstance(b, TracedExact):
        if q.denominator != 1 or b.pi_power or abs(q) > 64 or (q < 0 and x == 0):
            return None
        p, turns, made = p ** int(q), turns * int(q), x ** int(q)
    else:
        return None
    found = ExactNumber(p, turns)
    return TracedExact(graph, made.node, found) if isinstance(made, Traced) else found


class TracingContext:
    """An mpmath context whose functions take traced numbers as well."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self._plain = graph.context

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._plain, name)
        if not callable(found) or name in ("zero", "one", "pi", "inf", "nan", "eps"):
            return found
        if name == "sqrt":
            return lambda value: _sqrt(value) if isinstance(value, Traced) else found(value)
        if name in FUNCTIONS:
            return lambda *values: self._function(name, found, values)

        def guarded(*arguments: Any, **options: Any) -> Any:
            if any(isinstance(a, Traced | TracedWhole) for a in arguments):
                raise Untraceable(name)
            return found(*arguments, **options)

        return guarded

    def _function(self, name: str, plain: Any, values: tuple[Any, ...]) -> Any:
        if not any(isinstance(v, Traced) for v in values):
            return plain(*values)
        nodes = tuple(v.node if isinstance(v, Traced) else self.graph.constant(v) for v in values)
        result = plain(*(self.graph.values[n] for n in nodes))
        if not isinstance(result, self._plain.mpf):
            raise Untraceable(f"{name} of a number outside its range")
        return Traced(self.graph, self.graph.node(name, nodes, result))

    def mpf(self, value: Any) -> Any:
        """As mpmath's."""
        return value if isinstance(value, Traced) else self._plain.mpf(value)

    convert = mpf

    def nstr(self, value: Any, *arguments: Any, **options: Any) -> str:
        """For messages: of the representative."""
        return str(self._plain.nstr(plain(value), *arguments, **options))

    def ldexp(self, value: Any, exponent: Any) -> Any:
        """``value * 2**exponent``."""
        if isinstance(exponent, TracedWhole):
            power = self._plain.ldexp(1, exponent.value)
            return value * Traced(self.graph, self.graph.node("power_of_two", (exponent.node,), power))
        if isinstance(value, Traced):
            return value * self._plain.ldexp(1, exponent)
        return self._plain.ldexp(value, exponent)

    def mag(self, value: Any) -> Any:
        """Binary magnitude: used for limits alone, which the representative keeps."""
        return self._plain.mag(plain(value))

    def isint(self, value: Any) -> bool:
        """Whether a number is whole, which is decided for one value at a time."""
        return bool(self._plain.isint(value._decided() if isinstance(value, Traced) else value))


def _sqrt(x: Traced) -> Traced:
    operation, arguments = x.graph.nodes[x.node]
    square = (
        arguments[1] == 2 if operation == "power" else operation == "multiply" and len(set(arguments)) == 1
    )
    if square:  # whose root is exact
        base = Traced(x.graph, arguments[0])
        return base if base >= 0 else -base
    return Traced(x.graph, x.graph.node("sqrt", (x.node,), x.graph.context.sqrt(x.value)))


def plain(value: Any) -> Any:
    """The number itself for pictures and messages, where a traced one may be: the representative's."""
    return value.value if isinstance(value, Traced | TracedWhole) else value


def binary_exponent(value: Traced) -> TracedWhole:
    """The smallest e with abs(value) <= 2**e, of a number that isn't zero."""
    mantissa, power = value.graph.context.frexp(abs(value.value))
    exponent = int(power) - 1 if mantissa == 0.5 else int(power)
    return TracedWhole(value.graph, value.graph.whole("exponent", (value.node,), exponent))


def binary_magnitude(context: Any, value: Any) -> int:
    """The smallest e with abs(value) < 2**e, of a number that isn't zero."""
    power = int(context.frexp(abs(plain(value)))[1])
    if not isinstance(value, Traced):
        return power
    return TracedWhole(value.graph, value.graph.whole("magnitude", (value.node,), power))  # type: ignore


def called(function: Callable[..., Any], context: Any, *values: Any) -> Any:
    """``function(context, *values)`` as one operation, within which nothing is decided for other members."""
    traced = next((x for x in values if isinstance(x, Traced)), None)
    if traced is None:
        return function(context, *values)
    graph = traced.graph
    nodes = tuple(x.node if isinstance(x, Traced) else graph.constant(x) for x in values)
    result = function(graph.context, *(graph.values[n] for n in nodes))
    return Traced(graph, graph.node("call", (function, *nodes), result))


def largest_of(values: Sequence[Any]) -> Any:
    """The maximum, without deciding which of them it is."""
    return _extreme("maximum", values)


def smallest_of(values: Sequence[Any]) -> Any:
    """The minimum, without deciding which of them it is."""
    return _extreme("minimum", values)


def _extreme(operation: str, values: Sequence[Any]) -> Any:
    found = values[0]
    for value in values[1:]:
        traced = next((x for x in (found, value) if isinstance(x, Traced)), None)
        choose = max if operation == "maximum" else min
        if traced is None:
            found = choose(found, value)
            continue
        graph = traced.graph
        nodes = tuple(x.node if isinstance(x, Traced) else graph.constant(x) for x in (found, value))
        if nodes[0] != nodes[1]:
            result = choose(graph.values[nodes[0]], graph.values[nodes[1]])
            found = Traced(graph, graph.node(operation, nodes, result))
    return found
