"""Evaluation of a graph of traced numbers for many members at once, in the scene's own arithmetic.

heyoka's arrays of multiprecision numbers (MPFR) round sums, products, quotients and roots as mpmath does, so
that each member's numbers are those of its own build in every bit. Other functions are mpmath's own, once for
each of the values that they are taken of.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import heyoka as hy
import numpy as np
from mpmath.libmp import from_man_exp

from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.tracing.numbers import BINARY, Graph, Guard

_CONTEXT = context_for("double")
_BITS = _CONTEXT.prec
_FAILURES = (ZeroDivisionError, ValueError, OverflowError, TypeError)
"""Errors of mpmath for numbers outside the range of an operation; the member's own build reports them."""

Reals = Any  # an array of hy.real, (members,), or one hy.real for all members


def real_of(number: ExactNumber) -> hy.real:
    """An exact number, rounded as ``ExactNumber.at`` does."""
    if number.pi_power:
        return _real(number.at(_CONTEXT))
    return hy.real(number.rational.numerator, _BITS) / hy.real(number.rational.denominator, _BITS)


def _real(value: Any) -> hy.real:
    """The same number as an mpf; nan if it isn't a real number, or is far outside a double's range."""
    if not hasattr(value, "_mpf_"):  # complex
        return hy.real(math.nan, _BITS)
    sign, mantissa, exponent, _ = value._mpf_
    if not mantissa and exponent:  # mpmath's codes of infinities and nan
        return hy.real(math.nan, _BITS)
    whole = hy.real(int(-mantissa if sign else mantissa), _BITS)
    return whole * hy.real(math.ldexp(1.0, exponent), _BITS)


def _mpf(value: hy.real) -> Any:
    """The same number as an mpf of the scene's context.

    Raises:
        ValueError, OverflowError: it isn't finite, or is far outside a double's range.
    """
    places = _BITS - math.frexp(float(value))[1]
    whole = int(value * hy.real(math.ldexp(1.0, places), _BITS))
    return _CONTEXT.make_mpf(from_man_exp(whole, -places))


def _reals(values: np.ndarray) -> Reals:
    return values.astype(hy.real) * hy.real(1.0, _BITS)  # an array of doubles has their precision alone


class Replay:
    """A graph's numbers for some members; nan where an operation has no result.

    Args:
        columns: for each column of the graph the members' swept numbers, reals (members,).
    """

    def __init__(self, graph: Graph, columns: Sequence[np.ndarray], count: int) -> None:
        self._graph, self._columns, self._count = graph, columns, count
        self._numbers: dict[int, Reals] = {}

    def of(self, which: np.ndarray) -> Replay:
        """The numbers of some of the members."""
        found = Replay(
            self._graph, [column[which] for column in self._columns], len(np.arange(self._count)[which])
        )
        found._numbers = {node: x[which] if np.ndim(x) else x for node, x in self._numbers.items()}
        return found

    def agreeing(self, guards: Sequence[Guard]) -> np.ndarray:
        """Mask of the members that make all decisions as the representative does, (members,)."""
        found = np.ones(self._count, dtype=bool)
        for guard in guards:
            left, right = self.number(guard.left), self.number(guard.right)
            decided = left < right if guard.kind == "<" else left == right
            found &= (decided == guard.outcome) & np.isfinite(left) & np.isfinite(right)
            if not found.any():
                break
        return found

    def doubles(self, node: int) -> np.ndarray:
        """A number rounded once, (members,); nan if it is outside a double's range."""
        exact = np.broadcast_to(self.number(node), self._count)
        with np.errstate(all="ignore"):
            found = exact.astype(np.float64) + 0.0  # zero without a sign
        found[(np.abs(found) < np.finfo(float).tiny) & (exact != hy.real(0.0, _BITS))] = np.nan
        found[np.isinf(found)] = np.nan
        return found

    def number(self, node: int) -> Reals:
        """A number of the graph."""
        if node not in self._numbers:
            with np.errstate(all="ignore"):
                self._numbers[node] = self._worked_out(*self._graph.nodes[node])
        return self._numbers[node]

    def _worked_out(self, operation: str, arguments: tuple[Any, ...]) -> Reals:
        if operation == "constant":
            return _real(arguments[0])
        if operation == "column":
            return self._columns[arguments[0]]
        if operation == "power":
            base, power = arguments
            if power == 2:
                return self.number(base) * self.number(base)
            return self._one_by_one(lambda x: x**power, base)
        if operation == "call":
            function, *nodes = arguments
            return self._one_by_one(lambda *values: function(_CONTEXT, *values), *nodes)
        values = [self.number(node) for node in arguments]
        if operation in BINARY:
            found = BINARY[operation](*values)
            if operation == "divide":
                found[np.broadcast_to(values[1] == hy.real(0.0, _BITS), self._count)] = hy.real(
                    math.nan, _BITS
                )
            return found
        if operation in _OF_ARRAYS:
            return _OF_ARRAYS[operation](*values)
        return self._one_by_one(getattr(_CONTEXT, operation), *arguments)

    def _one_by_one(self, function: Callable[..., Any], *nodes: int) -> Reals:
        """A function that arrays lack, once for each of the values that members have."""
        values = [np.broadcast_to(self.number(node), self._count).tolist() for node in nodes]
        known: dict[tuple[str, ...], hy.real] = {}
        found = np.empty(self._count, dtype=hy.real)
        for member, given in enumerate(zip(*values, strict=True)):
            key = tuple(map(str, given))
            if key not in known:
                try:
                    known[key] = _real(function(*map(_mpf, given)))
                except _FAILURES:
                    known[key] = hy.real(math.nan, _BITS)
            found[member] = known[key]
        return found


def _exponent(value: Reals) -> Reals:
    """The smallest e with abs(value) < 2**e."""
    size = np.abs(value)
    doubles = size.astype(np.float64)
    exponents = np.frexp(doubles)[1]
    # a number just below a power of two is rounded to it
    exponents -= size < _reals(np.ldexp(1.0, exponents - 1))
    return _reals(np.where((doubles > 0) & np.isfinite(doubles), exponents, np.nan))


def _power_of_two(exponent: Reals) -> Reals:
    doubles = exponent.astype(np.float64)
    return _reals(np.where(np.isfinite(doubles), np.ldexp(1.0, doubles.astype(np.int64)), np.nan))


_OF_ARRAYS: dict[str, Callable[..., Reals]] = {
    "maximum": np.maximum,
    "minimum": np.minimum,
    "negative": lambda x: -x,
    "absolute": np.abs,
    "sqrt": np.sqrt,
    "exponent": _exponent,
    "power_of_two": _power_of_two,
}
