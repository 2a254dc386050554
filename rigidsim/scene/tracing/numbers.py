"""Numbers that remember how they were worked out, so that one scene stands for all members of a sweep.

A traced number has the value of one member, the representative, and a node in a graph of operations that
begins with the swept numbers. Scene and model are worked out with it as with any other number. Whatever they
decide by it (a comparison, a value taken as a float) is noted as a guard. Members that decide everywhere as
the representative does have its equations, and their coefficients follow from the graph; others don't, and
are traced again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rigidsim.scene.tracing.graph import Node, Untraceable


class Traced(Node):
    """A real number in a graph; see the module."""

    __slots__ = ()
    whole = False

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
                return root(self)
            raise Untraceable("a fractional power")
        exponent = int(exponent)
        if exponent < 0:
            return 1 / self ** (-exponent)
        return self._made("power", (self.node, exponent), self.value**exponent)

    def __rpow__(self, base: Any) -> Any:
        raise Untraceable("a swept power")

    def __abs__(self) -> Any:
        return self._made("absolute", (self.node,), abs(self.value))

    def __float__(self) -> float:
        return float(self._decided())

    def __int__(self) -> int:
        return int(self._decided())

    def _decided(self) -> Any:
        """The value itself, which restricts members to those that share it."""
        self.graph.decide("=", self.node, self.graph.constant(self.value), outcome=True)
        return self.value


def root(x: Traced) -> Traced:
    """Square root."""
    operation, arguments = x.graph.nodes[x.node]
    square = (
        arguments[1] == 2 if operation == "power" else operation == "multiply" and len(set(arguments)) == 1
    )
    if square:  # its root is exact
        base = Traced(x.graph, arguments[0])
        return base if base >= 0 else -base
    return Traced(x.graph, x.graph.node("sqrt", (x.node,), x.graph.context.sqrt(x.value)))


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
