"""Swept numbers as written in a config, and in expressions (see ``numbers``)."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.tracing.context import TracingContext
from rigidsim.scene.tracing.graph import Graph
from rigidsim.scene.tracing.numbers import Traced


class TracedExact(ExactNumber):
    """A swept number as written in a config.

    Args:
        exact: the representative's number.
    """

    def __init__(self, graph: Graph, node: int, exact: ExactNumber) -> None:
        for name, value in (("graph", graph), ("node", node), ("exact", exact)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "assumed", exact.assumed)

    graph: Graph
    node: int
    exact: ExactNumber

    @property
    def swept(self) -> bool:
        """True."""
        return True

    def at(self, context: Any) -> Any:
        """A traced number in the graph's context, the representative's value in any other."""
        return self._traced() if isinstance(context, TracingContext) else self.exact.at(context)

    @property
    def rational(self) -> Fraction:
        """The representative's value, and that of members that share it."""
        self._traced()._decided()
        return self.exact.rational

    @property
    def pi_power(self) -> int:
        """Power of pi, the same for all members."""
        return self.exact.pi_power

    def fraction(self, context: Any) -> Fraction:
        """See ``rational``."""
        self._traced()._decided()
        return self.exact.fraction(context)

    def __float__(self) -> float:
        return float(self.exact)

    @property
    def alone(self) -> ExactNumber:
        """The number itself."""
        return self

    def _traced(self) -> Traced:
        return Traced(self.graph, self.node)

    @property
    def sign(self) -> int:
        """Sign, decided by a guard."""
        number = self._traced()
        return 0 if number == 0 else (1 if number > 0 else -1)

    def __hash__(self) -> int:
        return 0

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ExactNumber):
            return False
        there = other._traced() if isinstance(other, TracedExact) else other.at(self.graph.context)
        return self._traced() == there


def swept_number(graph: Graph, number: int, exact: ExactNumber) -> TracedExact:
    """The swept number of a column; ``exact`` is the representative's."""
    return TracedExact(graph, graph.node("column", (number,), exact.at(graph.context)), exact)


def exactly(operator: str, numbers: Sequence[ExactNumber]) -> ExactNumber | None:
    """Result of an operation on numbers of which some are swept; None if it isn't a rational times a power of
    pi.
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
