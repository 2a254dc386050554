"""Whole numbers that depend on traced ones: binary exponents and magnitudes (see ``numbers``)."""

from __future__ import annotations

from typing import Any

from rigidsim.scene.tracing.graph import Node
from rigidsim.scene.tracing.numbers import Traced


class TracedWhole(Node):
    """A whole number that depends on traced ones, such as the binary exponent of a unit."""

    __slots__ = ()
    whole = True

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

    def __index__(self) -> int:
        self.graph.decide("=", self.node, self._other(self.value), outcome=True, whole=True)
        return self.value

    __int__ = __index__

    def __float__(self) -> float:
        return float(self.__index__())


def binary_exponent(value: Traced) -> TracedWhole:
    """The smallest e with abs(value) <= 2**e; the value must not be zero."""
    mantissa, power = value.graph.context.frexp(abs(value.value))
    exponent = int(power) - 1 if mantissa == 0.5 else int(power)
    return TracedWhole(value.graph, value.graph.whole("exponent", (value.node,), exponent))


def binary_magnitude(context: Any, value: Any) -> int:
    """The smallest e with abs(value) < 2**e; the value must not be zero."""
    power = int(context.frexp(abs(value.value if isinstance(value, Traced) else value))[1])
    if not isinstance(value, Traced):
        return power
    return TracedWhole(value.graph, value.graph.whole("magnitude", (value.node,), power))  # type: ignore
