"""Numbers that remember how they were worked out, so that one scene stands for all members of a sweep.

A traced number has the value of one member, the representative, and a node in a graph of operations that
begins with the swept numbers. Scene and model are worked out with it as with any other number. Whatever they
decide by it (a comparison, a value taken as a float) is noted as a guard. Members that decide everywhere as
the representative does have its equations, and their coefficients follow from the graph; others don't, and
are traced again.
"""

import operator
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import reduce
from typing import Any, Self

from rigidsim.scene.exact import ExactNumber


class Untraceable(Exception):
    """Raised if something is asked of a traced number that the graph can't hold: its members are run one by
    one.
    """


@dataclass(frozen=True)
class Guard:
    """A decision: whether the left node is less than ("<") or equal to ("=") the right one."""

    kind: str
    left: int
    right: int
    outcome: bool


@dataclass
class Graph:
    """Operations on the swept numbers, each once, in an order in which they can be worked out.

    Nodes are (operation, arguments): "column" (its number), "constant" (an mpf), or an operation on nodes of
    ``Traced`` or ``TracingContext``.
    """

    context: Any  # mpmath context of the scene, in which the representative is worked out
    nodes: list[tuple[str, tuple[Any, ...]]] = field(default_factory=list)
    values: list[Any] = field(default_factory=list)  # the representative's, mpf
    guards: dict[Guard, None] = field(default_factory=dict)  # decisions so far, each once
    _known: dict[Any, int] = field(default_factory=dict)

    def made(self, operation: str, arguments: tuple[Any, ...], value: Any) -> "Traced":
        """The number of a node, new or known."""
        key = (operation, tuple(a._mpf_ if hasattr(a, "_mpf_") else a for a in arguments))
        if key not in self._known:
            self._known[key] = len(self.nodes)
            self.nodes.append((operation, arguments))
            self.values.append(value)
        return Traced(self, self._known[key])

    def node(self, value: Any) -> int:
        """Node of a number, traced or plain."""
        if isinstance(value, Traced):
            return value.node
        if isinstance(value, Fraction):
            value = self.context.mpf(value.numerator) / self.context.mpf(value.denominator)
        try:
            value = self.context.convert(value)
        except TypeError:
            raise Untraceable(f"arithmetic with a {type(value).__name__}") from None
        return self.made("constant", (value,), value).node

    def decide(self, kind: str, left: int, right: int) -> bool:
        """Compare two nodes of the representative, and note the outcome."""
        one, other = self.values[left], self.values[right]
        outcome = bool(one < other if kind == "<" else one == other)
        self.guards.setdefault(Guard(kind, left, right, outcome))
        return outcome


class Traced:
    """A number in a graph; any decision made with it is noted as a guard."""

    __slots__ = ("graph", "node")

    def __init__(self, graph: Graph, node: int) -> None:
        self.graph, self.node = graph, node

    @property
    def value(self) -> Any:
        """The representative's value."""
        return self.graph.values[self.node]

    def decided(self) -> Any:
        """The value itself, which restricts members to those that share it."""
        self.graph.decide("=", self.node, self.graph.node(self.value))
        return self.value

    def _is_negative_of(self, node: int) -> bool:
        nodes = self.graph.nodes
        return nodes[self.node] == ("negative", (node,)) or nodes[node] == ("negative", (self.node,))

    def _made(self, operation: str, arguments: tuple[Any, ...], value: Any) -> Self:
        return type(self)(self.graph, self.graph.made(operation, arguments, value).node)

    def _with(self, operation: str, left: int, right: int) -> Self:
        value = BINARY[operation](self.graph.values[left], self.graph.values[right])
        return self._made(operation, (left, right), value)

    def __add__(self, other: Any) -> Any:
        if not isinstance(other, Traced) and other == 0:
            return self
        there = self.graph.node(other)
        if self._is_negative_of(there):
            return self.graph.context.zero
        return self._with("add", self.node, there)

    __radd__ = __add__

    def __neg__(self) -> Any:
        return self._made("negative", (self.node,), -self.value)

    def __pos__(self) -> Any:
        return self

    def __sub__(self, other: Any) -> Any:
        if not isinstance(other, Traced) and other == 0:
            return self
        there = self.graph.node(other)
        return self.graph.context.zero if there == self.node else self._with("subtract", self.node, there)

    def __rsub__(self, other: Any) -> Any:
        return -self if other == 0 else self._with("subtract", self.graph.node(other), self.node)

    def __mul__(self, other: Any) -> Any:
        if not isinstance(other, Traced):
            if other == 0:
                return self.graph.context.zero
            if other == 1:
                return self
            if other == -1:
                return -self
        return self._with("multiply", self.node, self.graph.node(other))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        if not isinstance(other, Traced) and other == 1:
            return self
        there = self.graph.node(other)
        for ratio, found in ((1, there == self.node), (-1, self._is_negative_of(there))):
            if found and self != 0:
                return self.graph.context.mpf(ratio)
        return self._with("divide", self.node, there)

    def __rtruediv__(self, other: Any) -> Any:
        if other == 0 and self != 0:
            return self.graph.context.zero
        return self._with("divide", self.graph.node(other), self.node)

    def __pow__(self, exponent: Any) -> Any:
        if isinstance(exponent, Traced):
            exponent = exponent.decided()
        if exponent == 0.5:
            return root(self)
        if exponent != int(exponent):
            raise Untraceable("a fractional power")
        exponent = int(exponent)
        if exponent < 0:
            return 1 / self ** (-exponent)
        return self.graph.made("power", (self.node, exponent), self.value**exponent)

    def __rpow__(self, base: Any) -> Any:
        raise Untraceable("a swept power")

    def __abs__(self) -> Any:
        return self._made("absolute", (self.node,), abs(self.value))

    def __float__(self) -> float:
        return float(self.decided())

    def __int__(self) -> int:
        return int(self.decided())

    def __hash__(self) -> int:
        return 0  # whether two are equal is always decided by a guard

    def __eq__(self, other: object) -> bool:
        if other is None or isinstance(other, str):
            return False
        there = self.graph.node(other)
        return there == self.node or self.graph.decide("=", self.node, there)

    def __lt__(self, other: Any) -> bool:
        return self.graph.decide("<", self.node, self.graph.node(other))

    def __gt__(self, other: Any) -> bool:
        return self.graph.decide("<", self.graph.node(other), self.node)

    def __le__(self, other: Any) -> bool:
        return not self > other

    def __ge__(self, other: Any) -> bool:
        return not self < other

    def __bool__(self) -> bool:
        return self != 0

    def __getattr__(self, name: str) -> Any:
        """What numbers have besides; dunder names are asked for by way of trial."""
        if name.startswith("_"):
            raise AttributeError(name)
        raise Untraceable(name)

    def _refused(self, *_: Any) -> Any:
        raise Untraceable("an operation that the graph doesn't know")

    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __divmod__ = __rdivmod__ = _refused
    __round__ = __trunc__ = __floor__ = __ceil__ = __index__ = __complex__ = __format__ = _refused


BINARY: dict[str, Callable[[Any, Any], Any]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
}


class TracedExponent(Traced):
    """A binary exponent, or what is made of some. Nothing is left out where units cancel, so that a family's
    coefficients are parameters whatever the units of the member that represents it.
    """

    __slots__ = ()

    def __add__(self, other: Any) -> Any:
        if not isinstance(other, Traced) and other == 0:
            return self
        return self._with("add", self.node, self.graph.node(other))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self + (-other)

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    def __mul__(self, other: Any) -> Any:
        return self._with("multiply", self.node, self.graph.node(other))

    __rmul__ = __mul__


def root(x: Traced) -> Traced:
    """Square root."""
    operation, arguments = x.graph.nodes[x.node]
    square = (
        arguments[1] == 2 if operation == "power" else operation == "multiply" and len(set(arguments)) == 1
    )
    if square:  # its root is exact
        base = Traced(x.graph, arguments[0])
        return base if base >= 0 else -base
    return x.graph.made("sqrt", (x.node,), x.graph.context.sqrt(x.value))


def called(function: Callable[..., Any], context: Any, *values: Any) -> Any:
    """``function(context, *values)`` as one operation, within which nothing is decided for other members."""
    traced = next((x for x in values if isinstance(x, Traced)), None)
    if traced is None:
        return function(context, *values)
    graph = traced.graph
    nodes = tuple(graph.node(x) for x in values)
    return graph.made("call", (function, *nodes), function(graph.context, *(graph.values[n] for n in nodes)))


def plain(value: Any) -> Any:
    """The plain number of one that may be traced, for pictures and messages: the representative's."""
    return value.value if isinstance(value, Traced) else value


# --- the arithmetic of a scene, and swept numbers as written ------------------------------------------------

_FUNCTIONS = (
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "hypot", "exp", "log", "sinh", "cosh", "tanh",
    "asinh", "acosh", "atanh", "erf",
)  # fmt: skip
"""Functions that the graph knows besides square roots; any other use of a traced number is refused."""


class TracingContext:
    """An mpmath context whose functions take traced numbers as well."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self._plain = graph.context

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._plain, name)
        if not callable(found) or name in ("zero", "one", "pi", "inf", "nan", "eps"):
            return found

        def function(*values: Any, **options: Any) -> Any:
            if not any(isinstance(v, Traced) for v in values):
                return found(*values, **options)
            if name not in _FUNCTIONS:
                raise Untraceable(name)
            nodes = tuple(map(self.graph.node, values))
            result = found(*(self.graph.values[n] for n in nodes))
            if not isinstance(result, self._plain.mpf):
                raise Untraceable(f"{name} of a number outside its range")
            return self.graph.made(name, nodes, result)

        return function

    def sqrt(self, value: Any) -> Any:
        """Square root."""
        return root(value) if isinstance(value, Traced) else self._plain.sqrt(value)

    def maximum(self, values: Iterable[Any]) -> Any:
        """The largest number, without deciding which of them it is."""
        return reduce(lambda a, b: self._extreme("maximum", a, b), values)

    def minimum(self, values: Iterable[Any]) -> Any:
        """The smallest number, without deciding which of them it is."""
        return reduce(lambda a, b: self._extreme("minimum", a, b), values)

    def _extreme(self, operation: str, a: Any, b: Any) -> Any:
        choose = max if operation == "maximum" else min
        if not isinstance(a, Traced) and not isinstance(b, Traced):
            return choose(a, b)
        nodes = self.graph.node(a), self.graph.node(b)
        if nodes[0] == nodes[1]:
            return a
        return self.graph.made(operation, nodes, choose(*(self.graph.values[n] for n in nodes)))

    def mpf(self, value: Any) -> Any:
        """See mpmath."""
        return value if isinstance(value, Traced) else self._plain.mpf(value)

    convert = mpf

    def nstr(self, value: Any, *arguments: Any, **options: Any) -> str:
        """The representative's number as text, for messages."""
        return str(self._plain.nstr(plain(value), *arguments, **options))

    def ldexp(self, value: Any, exponent: Any) -> Any:
        """``value * 2**exponent``."""
        if isinstance(exponent, Traced):
            power = self._plain.ldexp(1, int(exponent.value))
            return value * self.graph.made("power_of_two", (exponent.node,), power)
        if isinstance(value, Traced):
            return value * self._plain.ldexp(1, int(exponent))
        return self._plain.ldexp(value, int(exponent))

    def frexp(self, value: Any) -> tuple[Any, Any]:
        """``(m, e)`` of ``value = m * 2**e`` with m from 0.5 to below 1 in size; no zero is allowed."""
        if not isinstance(value, Traced):
            mantissa, whole = self._plain.frexp(value)
            return mantissa, whole
        power = self._plain.mpf(int(self._plain.frexp(value.value)[1]))
        exponent = TracedExponent(self.graph, self.graph.made("exponent", (value.node,), power).node)
        return self.ldexp(value, -exponent), exponent

    def mag(self, value: Any) -> Any:
        """Binary magnitude; used only for limits, for which the representative's is taken."""
        return self._plain.mag(plain(value))

    def isint(self, value: Any) -> bool:
        """Whether a number is whole, decided for the representative's value."""
        return bool(self._plain.isint(value.decided() if isinstance(value, Traced) else value))


class TracedExact(ExactNumber):
    """A swept number as written in a config; ``exact`` is the representative's."""

    def __init__(self, traced: Traced, exact: ExactNumber) -> None:
        for name, value in (("traced", traced), ("exact", exact), ("assumed", exact.assumed)):
            object.__setattr__(self, name, value)

    traced: Traced
    exact: ExactNumber

    @property
    def swept(self) -> bool:
        """True."""
        return True

    def at(self, context: Any) -> Any:
        """A traced number in the graph's context, the representative's value in any other."""
        return self.traced if isinstance(context, TracingContext) else self.exact.at(context)

    @property
    def rational(self) -> Fraction:
        """The representative's value, also for members that share it."""
        self.traced.decided()
        return self.exact.rational

    @property
    def pi_power(self) -> int:
        """Power of pi, the same for all members."""
        return self.exact.pi_power

    def fraction(self, context: Any) -> Fraction:
        """See ``rational``."""
        self.traced.decided()
        return self.exact.fraction(context)

    def __float__(self) -> float:
        return float(self.exact)

    @property
    def alone(self) -> ExactNumber:
        """The number itself."""
        return self

    @property
    def sign(self) -> int:
        """Sign, decided by a guard."""
        return 0 if self.traced == 0 else (1 if self.traced > 0 else -1)

    def __hash__(self) -> int:
        return 0

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ExactNumber) and self.traced == _number(other, self.traced.graph)


def swept_number(graph: Graph, column: int, exact: ExactNumber) -> TracedExact:
    """The swept number of a column; ``exact`` is the representative's."""
    return TracedExact(graph.made("column", (column,), exact.at(graph.context)), exact)


def _number(number: ExactNumber, graph: Graph) -> Any:
    return number.traced if isinstance(number, TracedExact) else number.at(graph.context)


_OPERATORS: dict[str, Callable[[Any, Any], Any]] = {
    "negative": lambda x, _: -x,
    "sum": operator.add,
    "product": operator.mul,
    "quotient": operator.truediv,
    "power": operator.pow,
}


def exactly(name: str, numbers: Sequence[ExactNumber]) -> ExactNumber | None:
    """Result of an operation on numbers of which some are swept; None if it isn't a rational times a power of
    pi.
    """
    graph = next(n.traced.graph for n in numbers if isinstance(n, TracedExact))
    a, b = numbers[0], numbers[-1]
    x, y = _number(a, graph), _number(b, graph)
    p, q = (n.exact.rational if isinstance(n, TracedExact) else n.rational for n in (a, b))
    if name == "power":
        whole = not isinstance(b, TracedExact) and q.denominator == 1 and not b.pi_power and abs(q) <= 64
        if not whole or (q < 0 and x == 0):
            return None
    elif (name == "sum" and a.pi_power != b.pi_power) or (name == "quotient" and y == 0):
        return None
    turns = {
        "product": a.pi_power + b.pi_power,
        "quotient": a.pi_power - b.pi_power,
        "power": a.pi_power * int(q),
    }
    combined = _OPERATORS.get(name)
    if combined is None:
        return None
    made, found = combined(x, y), ExactNumber(combined(p, q), turns.get(name, a.pi_power))
    return TracedExact(made, found) if isinstance(made, Traced) else found
