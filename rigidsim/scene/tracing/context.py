"""Arithmetic of a scene that is worked out for all members of a sweep at once (see ``numbers``)."""

from collections.abc import Iterable
from functools import reduce
from typing import Any

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
