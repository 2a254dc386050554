"""Arithmetic of a scene that is worked out for all members of a sweep at once (see ``numbers``)."""

from __future__ import annotations

from typing import Any

from rigidsim.scene.tracing.graph import FUNCTIONS, Graph, Untraceable
from rigidsim.scene.tracing.numbers import Traced, root
from rigidsim.scene.tracing.whole import TracedWhole


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
            return lambda value: root(value) if isinstance(value, Traced) else found(value)
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
        """See mpmath."""
        return value if isinstance(value, Traced) else self._plain.mpf(value)

    convert = mpf

    def nstr(self, value: Any, *arguments: Any, **options: Any) -> str:
        """The representative's number as text, for messages."""
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
        """Binary magnitude; used only for limits, for which the representative's is taken."""
        return self._plain.mag(plain(value))

    def isint(self, value: Any) -> bool:
        """Whether a number is whole, decided for the representative's value."""
        return bool(self._plain.isint(value._decided() if isinstance(value, Traced) else value))


def plain(value: Any) -> Any:
    """The plain number of one that may be traced, for pictures and messages: the representative's."""
    return value.value if isinstance(value, Traced | TracedWhole) else value
