"""Arithmetic of a scene that is worked out for all members of a sweep at once (see ``numbers``), and swept
numbers as written in a config, and in expressions.
"""

import operator
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from functools import reduce
from typing import Any

from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.tracing.numbers import Graph, Traced, TracedExponent, Untraceable, plain, root

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
        """The representative's value, and that of members that share it."""
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
