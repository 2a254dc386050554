"""The graph of operations behind a sweep's traced numbers, and the decisions made with them (see
``numbers``).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

FUNCTIONS = (
    "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "hypot", "exp", "log", "sinh", "cosh",
    "tanh", "asinh", "acosh", "atanh", "erf",
)  # fmt: skip
"""Functions of the context that the graph knows; any other use of a traced number is refused."""


class Untraceable(Exception):
    """Raised if something is asked of a traced number that the graph can't hold: its members are run one by
    one.
    """


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
        values: the representative's values, mpf.
        wholes, whole_values: the same for whole numbers: "exponent", "magnitude" of a node, "constant", and
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
    _columns: list[frozenset[int]] = field(default_factory=list)

    def node(self, operation: str, arguments: tuple[Any, ...], value: Any) -> int:
        """Number of a node, new or known."""
        key = (operation, tuple(a._mpf_ if hasattr(a, "_mpf_") else a for a in arguments))
        if key not in self._known:
            self._known[key] = len(self.nodes)
            self.nodes.append((operation, arguments))
            self.values.append(value)
        return self._known[key]

    def whole(self, operation: str, arguments: tuple[Any, ...], value: int) -> int:
        """Number of a node of a whole number, new or known."""
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

    def columns_of(self, node: int, *, whole: bool = False) -> frozenset[int]:
        """The columns that a node depends on."""
        for operation, arguments in self.nodes[len(self._columns) :]:
            self._columns.append(self._columns_read(operation, arguments))
        return self._columns_of_whole(node) if whole else self._columns[node]

    def _columns_read(self, operation: str, arguments: tuple[Any, ...]) -> frozenset[int]:
        if operation == "column":
            return frozenset(arguments)
        if operation == "constant":
            return frozenset()
        if operation == "power_of_two":
            return self._columns_of_whole(arguments[0])
        nodes = {"power": arguments[:1], "call": arguments[1:]}.get(operation, arguments)
        return frozenset().union(*(self._columns[node] for node in nodes))

    def _columns_of_whole(self, node: int) -> frozenset[int]:
        operation, arguments = self.wholes[node]
        if operation == "constant":
            return frozenset()
        if operation in ("exponent", "magnitude"):
            return self._columns[arguments[0]]
        return frozenset().union(*(self._columns_of_whole(a) for a in arguments))

    def decide(self, kind: str, left: int, right: int, outcome: bool, *, whole: bool = False) -> bool:
        """Note a decision of the representative."""
        self.guards.setdefault(Guard(kind, left, right, bool(outcome), whole))
        return bool(outcome)


class Node:
    """A number in a graph; any decision made with it is noted as a guard.

    Attributes:
        whole: whether it is one of the graph's whole numbers.
    """

    __slots__ = ("graph", "node")
    whole: bool

    def __init__(self, graph: Graph, node: int) -> None:
        self.graph, self.node = graph, node

    @property
    def value(self) -> Any:
        """The representative's value."""
        return self._values[self.node]

    @property
    def _values(self) -> Sequence[Any]:
        return self.graph.whole_values if self.whole else self.graph.values

    @abstractmethod
    def _other(self, other: Any) -> int:
        """Node of another number, which may be plain."""

    def _less(self, left: int, right: int) -> bool:
        outcome = self._values[left] < self._values[right]
        return self.graph.decide("<", left, right, outcome, whole=self.whole)

    def __hash__(self) -> int:
        return 0  # whether two are equal is always decided by a guard

    def __eq__(self, other: object) -> bool:
        if other is None or isinstance(other, str):
            return False
        there = self._other(other)
        if there == self.node:
            return True
        outcome = self._values[self.node] == self._values[there]
        return self.graph.decide("=", self.node, there, outcome, whole=self.whole)

    def __lt__(self, other: Any) -> bool:
        return self._less(self.node, self._other(other))

    def __gt__(self, other: Any) -> bool:
        return self._less(self._other(other), self.node)

    def __le__(self, other: Any) -> bool:
        return not self > other

    def __ge__(self, other: Any) -> bool:
        return not self < other

    def __bool__(self) -> bool:
        return self != 0
