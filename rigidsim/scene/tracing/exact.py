"""Swept numbers as written in a config, and in expressions (see ``numbers``)."""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.tracing.context import TracingContext
from rigidsim.scene.tracing.numbers import Graph, Traced


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


def exactly(operator: str, numbers: Sequence[ExactNumber]) -> ExactNumber | None:
    """Result of an operation on numbers of which some are swept; None if it isn't a rational times a power of
    pi.
    """
    graph = next(n.traced.graph for n in numbers if isinstance(n, TracedExact))
    a, b = numbers[0], numbers[-1]
    x, y = _number(a, graph), _number(b, graph)
    p, q = (n.exact.rational if isinstance(n, TracedExact) else n.rational for n in (a, b))
    turns, made = a.pi_power, x
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
    return TracedExact(made, found) if isinstance(made, Traced) else found
