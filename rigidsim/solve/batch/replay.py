"""Evaluation of a graph of traced numbers for many members at once.

Everything is worked out in two doubles with a bound of its error (``double_double``). Where that leaves open
how a number is rounded or which way a decision falls, the same operations are done for that member in the
scene's own arithmetic, so that the result is that of the member's own build, always.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from rigidsim.scene.tracing.graph import Graph, Guard
from rigidsim.solve.batch import double_double as dd
from rigidsim.solve.batch.double_double import Doubled
from rigidsim.solve.batch.exact_doubles import Distinct, Swept, in_two_parts, parts_of
from rigidsim.solve.precision import precision_of

_FAILURES = (ZeroDivisionError, ValueError, OverflowError, TypeError)
"""Errors of mpmath for numbers outside the range of an operation; the member's own build reports them."""
_BINARY: dict[str, Callable[[Doubled, Doubled], Doubled]] = {
    "add": dd.add,
    "subtract": dd.subtract,
    "multiply": dd.multiply,
    "divide": dd.divide,
}


class Replay:
    """A graph's numbers for some members.

    Args:
        swept: for each column of the graph, the numbers of all members of the sweep.
        members: indices of the members.
        columns: what depends on one column alone, for each of its values.
    """

    def __init__(
        self,
        graph: Graph,
        swept: Sequence[Swept] | Mapping[int, Swept],
        members: np.ndarray,
        columns: ColumnReplays | None = None,
    ) -> None:
        self._graph, self._swept, self._count = graph, swept, len(members)
        self._members = members
        self._columns = columns
        self._numbers: dict[int, Doubled] = {}
        self._wholes: dict[int, np.ndarray] = {}
        self._doubles: dict[int, np.ndarray] = {}
        self._exact: dict[tuple[int, int], Any] = {}
        self._double = precision_of("double")

    def agreeing(self, guards: Sequence[Guard]) -> np.ndarray:
        """Mask of the members that make all decisions as the representative does, (members,)."""
        found = np.ones(self._count, dtype=bool)
        for guard in guards:
            found &= self.decided(guard) == guard.outcome
            if not found.any():
                break
        return found

    def doubles(self, node: int) -> np.ndarray:
        """A number rounded once, (members,); nan if it is outside a double's range."""
        if node not in self._doubles:
            found = self._by_value((node,))
            self._doubles[node] = self._rounded(node) if found is None else found[0].doubles(node)[found[1]]
        return self._doubles[node]

    def _rounded(self, node: int) -> np.ndarray:
        with np.errstate(all="ignore"):
            high, certain = dd.nearest_double(self.number(node))
        values = np.array(np.broadcast_to(high, self._count))
        for member in np.flatnonzero(~np.broadcast_to(certain, self._count)).tolist():
            try:
                values[member] = self._double.number(self._exactly(node, member))
            except _FAILURES:
                values[member] = np.nan
        return values

    def whole_numbers(self, node: int) -> np.ndarray:
        """Whole numbers, shape (members,)."""
        return np.array(np.broadcast_to(self._whole(node), self._count))

    def _by_value(self, nodes: Sequence[int], *, whole: bool = False) -> tuple[Replay, np.ndarray] | None:
        """The replay over the values of the one column that nodes depend on, and which of them each member
        has; None where there is no such column, or its values aren't kept.
        """
        if self._columns is None:
            return None
        columns = frozenset().union(*(self._graph.columns_of(node, whole=whole) for node in nodes))
        if len(columns) != 1:
            return None
        (column,) = columns
        swept = self._swept[column]
        if not swept.distinct.kept:
            return None
        return self._columns.of(column, swept.distinct), swept.index[self._members]

    # --- decisions ------------------------------------------------------------------------------------------

    def decided(self, guard: Guard) -> np.ndarray:
        """The decision of each member, (members,)."""
        by_value = self._by_value((guard.left, guard.right), whole=guard.whole)
        if by_value is not None:
            decided: np.ndarray = by_value[0].decided(guard)[by_value[1]]
            return decided
        if guard.whole:
            left, right = self._whole(guard.left), self._whole(guard.right)
            return np.broadcast_to(left < right if guard.kind == "<" else left == right, self._count)
        with np.errstate(all="ignore"):
            sign, certain = dd.sign_of(dd.subtract(self.number(guard.left), self.number(guard.right)))
        wanted = -1 if guard.kind == "<" else 0
        found = np.array(np.broadcast_to(sign == wanted, self._count))
        for member in np.flatnonzero(~np.broadcast_to(certain, self._count)).tolist():
            try:
                left, right = (self._exactly(n, member) for n in (guard.left, guard.right))
                found[member] = left < right if guard.kind == "<" else left == right
            except _FAILURES:
                found[member] = not guard.outcome
        return found

    # --- numbers --------------------------------------------------------------------------------------------

    def number(self, node: int) -> Doubled:
        """A number in two doubles, (members,), or one for all."""
        if node not in self._numbers:
            operation, arguments = self._graph.nodes[node]
            found = None if operation == "column" else self._by_value((node,))
            if found is None:
                self._numbers[node] = self._worked_out(node, operation, arguments)
            else:
                self._numbers[node] = found[0].number(node).at(found[1])
        return self._numbers[node]

    def _worked_out(self, node: int, operation: str, arguments: tuple[Any, ...]) -> Doubled:
        if operation == "constant":
            return in_two_parts(arguments[0])
        if operation == "column":
            column = self._swept[arguments[0]]
            return column.distinct.doubled.at(column.index[self._members])
        if operation == "power_of_two":
            return Doubled(np.ldexp(1.0, self._whole(arguments[0])), 0.0, 0.0)
        if operation == "power":
            return self._power(self.number(arguments[0]), arguments[1])
        if operation == "multiply":
            for a, b in (arguments, arguments[::-1]):
                if _is_power_of_two(self._graph, b):
                    return dd.scale(self.number(a), self.number(b).high)
        if operation in _BINARY:
            return _BINARY[operation](self.number(arguments[0]), self.number(arguments[1]))
        if operation == "negative":
            return dd.negative(self.number(arguments[0]))
        if operation == "absolute":
            return dd.absolute(self.number(arguments[0]))
        if operation in ("maximum", "minimum"):
            pair = (self.number(a) for a in arguments)
            return dd.extreme(*pair, largest=operation == "maximum")
        if operation == "sqrt":
            return dd.root(self.number(arguments[0]))
        return self._one_by_one(node)

    def _power(self, base: Doubled, exponent: int) -> Doubled:
        found: Doubled | None = None
        while exponent:
            if exponent & 1:
                found = base if found is None else dd.multiply(found, base)
            exponent >>= 1
            if exponent:
                base = dd.multiply(base, base)
        return Doubled(1.0, 0.0, 0.0) if found is None else found

    def _one_by_one(self, node: int) -> Doubled:
        """An operation that arrays lack, such as a sine, once for each combination of the columns that it
        reads.
        """
        columns = sorted(self._graph.columns_of(node))
        codes = np.zeros(self._count, dtype=np.int64)
        for column in columns:
            swept = self._swept[column]
            codes = codes * len(swept.distinct.values) + swept.index[self._members]
            _, codes = np.unique(codes, return_inverse=True)
        _, first = np.unique(codes, return_index=True)
        parts = []
        for member in first:
            try:
                parts.append(parts_of(self._exactly(node, int(member))))
            except _FAILURES:
                parts.append((np.nan, np.nan, np.inf))
        high, low, error = (np.array(x)[codes] for x in zip(*parts, strict=True))
        return Doubled(high, low, error)

    def _whole(self, node: int) -> np.ndarray:
        if node not in self._wholes:
            found = self._by_value((node,), whole=True)
            if found is None:
                self._wholes[node] = self._whole_worked_out(*self._graph.wholes[node])
            else:
                self._wholes[node] = found[0].whole_numbers(node)[found[1]]
        return self._wholes[node]

    def _whole_worked_out(self, operation: str, arguments: tuple[int, ...]) -> np.ndarray:
        if operation == "constant":
            return np.asarray(arguments[0])
        if operation in ("exponent", "magnitude"):
            return self._exponents(arguments[0], above=operation == "magnitude")
        first = self._whole(arguments[0])
        if operation == "negative":
            return -first
        if operation == "absolute":
            return np.abs(first)
        return first + self._whole(arguments[1]) if operation == "add" else first * self._whole(arguments[1])

    def _exponents(self, node: int, *, above: bool) -> np.ndarray:
        """The smallest e with abs(x) <= 2**e, or with ``above``, abs(x) < 2**e."""
        with np.errstate(all="ignore"):
            number = dd.absolute(self.number(node))
            mantissa, exponent = np.frexp(number.high)
        boundary = mantissa == 0.5  # where the second part tells
        sure = np.isfinite(number.high) & np.isfinite(number.error) & (number.high > 0)
        small = (number.error == 0) | (np.abs(number.low) > 2 * number.error)
        certain = sure & (~boundary | small) & (number.error < number.high * 2.0**-60)
        below = (number.low < 0) if above else (number.low <= 0)
        exponent = np.array(np.broadcast_to(exponent - (boundary & below), self._count), dtype=np.int64)
        for member in np.flatnonzero(~np.broadcast_to(certain, self._count)).tolist():
            try:
                mantissa, power = self._graph.context.frexp(abs(self._exactly(node, member)))
                exponent[member] = int(power) - (mantissa == 0.5 and not above)
            except _FAILURES:
                exponent[member] = -(2**40)  # agrees with no other
        return exponent

    # --- one member -----------------------------------------------------------------------------------------

    def _exactly(self, node: int, member: int) -> Any:
        """A member's number (mpf) exactly as its own build would have it."""
        if (node, member) not in self._exact:
            operation, arguments = self._graph.nodes[node]
            self._exact[node, member] = self._exact_result(operation, arguments, member)
        return self._exact[node, member]

    def _exact_result(self, operation: str, arguments: tuple[Any, ...], member: int) -> Any:
        context = self._graph.context
        if operation == "constant":
            return arguments[0]
        if operation == "column":
            return self._swept[arguments[0]].of(int(self._members[member])).at(context)
        if operation == "power_of_two":
            return context.ldexp(1, int(np.broadcast_to(self._whole(arguments[0]), self._count)[member]))
        if operation == "power":
            return self._exactly(arguments[0], member) ** arguments[1]
        if operation == "call":
            return arguments[0](context, *(self._exactly(a, member) for a in arguments[1:]))
        values = [self._exactly(a, member) for a in arguments]
        if operation in _EXACT:
            return _EXACT[operation](*values)
        found = getattr(context, operation)(*values)
        if not isinstance(found, context.mpf):
            raise ValueError(f"{operation} of a number outside its range")
        return found


class ColumnReplays:
    """Replays of a graph over the values of one column each, for what depends on that column alone: in a
    sweep over a product of axes members share them.
    """

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._held: dict[int, tuple[Distinct, Replay]] = {}

    def of(self, column: int, distinct: Distinct) -> Replay:
        """The replay over a column's values."""
        held = self._held.get(column)
        if held is None or held[0] is not distinct:
            every = np.arange(len(distinct.values))
            held = distinct, Replay(self._graph, {column: Swept(distinct, every)}, every)
            self._held[column] = held
        return held[1]


_EXACT: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "negative": lambda a: -a,
    "absolute": abs,
    "maximum": max,
    "minimum": min,
}


def _is_power_of_two(graph: Graph, node: int) -> bool:
    operation, arguments = graph.nodes[node]
    if operation == "constant":
        mantissa, _ = graph.context.frexp(abs(arguments[0]))
        return bool(mantissa == 0.5 and arguments[0] > 0)
    return operation == "power_of_two"
