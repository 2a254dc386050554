"""Moments at which surfaces that depend on time alone are crossed, in two numbers, and the sides between.

The engine finds zeros to one number's precision, which would make a pulse of 1 ms late in a run longer or
shorter by a part in a thousand million. Arguments that are lines in time on each side of what is piecewise in
them have zeros that are known as written: steps end there, and the sides between are known from the start.
Other functions of time may be too narrow for a step's polynomials, as 1 - ((t - 5000)/1e-9)^2 is; steps also
end where the lines within them vanish, and where they do themselves near there.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from itertools import pairwise, product
from typing import Any

import numpy as np

from rigidsim.model.system import System
from rigidsim.model.two_part import exactly, in_two_numbers
from rigidsim.scene.expressions.tree import (
    Expression,
    ExpressionError,
    LineInTime,
    as_line,
    evaluate,
    lines_in,
    names_used,
    on_sides,
    operations,
)
from rigidsim.solve.precision import Precision, Scalar

_MOST_WITHIN = 6  # signs in the argument of another
_NEAR = 8.0  # value of a line up to which a function of it may change within less than a step


class Moments:
    """Of a system's surfaces.

    Attributes:
        timed: numbers of the surfaces whose sides are known at all times.
        knots: times (two numbers, ascending) at which steps end.
    """

    def __init__(self, system: System, precision: Precision) -> None:
        self._system, self._context, found = system, system.scene.context, system.plan.surfaces.found
        self._epsilon = float(precision.epsilon)
        lines: dict[int, list[Any]] = {}
        zeros: set[Any] = set()
        self.timed = []
        for j, surface in enumerate(found):
            if names_used(surface.expression) != {"t"}:
                continue
            known = self._zeros(surface.expression)
            if known is not None:
                self.timed.append(j)
            elif system.clocked:
                within = lines_in(surface.expression, self._context)
                known = lines[j] = [line.zero for line in within]
                zeros.update(x for line in within for x in self._zeros_near(surface.expression, line))
            zeros.update(known or ())
        scaling, one = system.scaling, self._context.one
        self._exact = sorted(scaling.internal(zero, self._context) for zero in zeros)
        self.knots = [in_two_numbers(zero, precision.number, self._context) for zero in self._exact]
        middles = [a + (b - a) / 2 for a, b in pairwise(self._exact)]
        if zeros:
            middles = [self._exact[0] - one, *middles, self._exact[-1] + one]
        unit = self._context.ldexp(scaling.direction * one, scaling.time)
        self._sides = [
            [self._side(found[j].expression, middle * unit) for j in self.timed]
            for middle in middles or [one]
        ]
        self._lines = {
            j: np.array([float(scaling.internal(zero, self._context)) for zero in known])
            for j, known in lines.items()
        }

    def may_mistake(self, j: int) -> bool:
        """Whether the engine may find a zero of a surface where none is: of a narrow function of time."""
        return j in self._lines

    def sides(self, time: tuple[Scalar, Scalar]) -> dict[int, int]:
        """Sides of the surfaces that are known, of steps that begin at a time."""
        return dict(zip(self.timed, self._sides[bisect_right(self.knots, time)], strict=True))

    def following(self, time: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar] | None:
        """The next knot after a time; None after the last one."""
        place = bisect_right(self.knots, time)
        return self.knots[place] if place < len(self.knots) else None

    def passed(self, knot: tuple[Scalar, Scalar]) -> Iterator[tuple[float, dict[int, int], dict[int, int]]]:
        """The moments that two numbers make one: how far they are from each, and the sides on both sides."""
        for place in range(bisect_left(self.knots, knot), bisect_right(self.knots, knot)):
            exact, context = self._exact[place], self._context
            off = abs(float(exact - exactly(knot[0], context) - exactly(knot[1], context)))
            before, after = self._sides[place : place + 2]
            yield off, dict(zip(self.timed, before, strict=True)), dict(zip(self.timed, after, strict=True))

    def spans(self, times: np.ndarray) -> np.ndarray:
        """Spans of time (surfaces, n) to which the rounding of arguments is relative: of those in which the
        time takes two numbers from the nearest zero of a line, of others from the clock's zero.
        """
        plain = np.abs(times.astype(np.float64))
        found = np.tile(plain, (len(self._system.surfaces), 1))
        for j, zeros in self._lines.items():
            if len(zeros):
                apart = np.abs(times.astype(np.float64)[:, None] - zeros).min(axis=1)
                found[j] = apart + self._epsilon * plain
        return found

    def _zeros(self, expression: Expression) -> list[Any] | None:
        """Zeros (s, mpf) on any sides of an argument that is a line or constant on each, as are all arguments
        of signs within it; None for others.
        """
        surfaces, context = self._system.plan.surfaces, self._context
        signs = [node.operands[0] for node in operations(expression) if node.operator == "sign"]
        within = sorted({surfaces.places[u][0] for u in signs})
        if len(within) > _MOST_WITHIN or any(self._zeros(u) is None for u in signs):
            return None
        found, sides = [], [1] * len(surfaces.found)
        for chosen in product((1, -1), repeat=len(within)):
            for j, side in zip(within, chosen, strict=True):
                sides[j] = side
            here = on_sides(expression, surfaces.places, sides)
            line = as_line(here, context)
            if line is None and names_used(here):
                return None
            found += [] if line is None else [line.zero]
        return found

    def _zeros_near(self, expression: Expression, line: LineInTime) -> Iterator[Any]:
        """Zeros (s, mpf) of a function of time where a line within it is small."""

        def value(time: Any) -> Any:
            try:
                return evaluate(expression, {"t": time}, self._context)
            except ExpressionError:  # undefined there
                return self._context.one

        times = [(k - line.offset) / line.slope for k in np.arange(-_NEAR, _NEAR, 1 / 8).tolist()]
        for a, b in pairwise(times):
            if value(a) * value(b) < 0:
                yield self._context.findroot(value, (a, b), solver="illinois", verify=False)

    def _side(self, expression: Expression, time: Any) -> int:
        return -1 if evaluate(expression, {"t": time}, self._context) < 0 else 1


def between(begin: tuple[Scalar, Scalar], end: tuple[Scalar, Scalar]) -> Scalar:
    """From one time in two numbers to another."""
    return (end[0] - begin[0]) - begin[1] + end[1]
