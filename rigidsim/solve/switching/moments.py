"""Moments at which surfaces that depend on time alone are crossed, in two numbers.

The engine finds them to one number's precision, which would make a pulse of 1 ms late in a run longer or
shorter by a part in a thousand million. Here they are worked out from the expressions as written.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from rigidsim.model.system import System
from rigidsim.model.two_part import exactly, in_two_numbers
from rigidsim.scene.expressions.piecewise import on_sides
from rigidsim.scene.expressions.tree import (
    Expression,
    ExpressionError,
    as_line,
    evaluate,
    lines_in,
    names_used,
)
from rigidsim.solve.precision import Precision, Scalar

_WIDER, _MOST_WIDER = 2.0**2, 14  # from one rounding of a time on, around which its zero is looked for
_MOST_PARTS = 500  # of an interval that shrinks to the arithmetic's precision


class Moments:
    """The moments of one surface, ``of_time`` if its argument depends on time alone; ``at_known_time`` if
    that is a line in time, whose values have hardly any rounding.
    """

    def __init__(self, system: System, precision: Precision, place: int) -> None:
        expression = system.plan.surfaces.found[place].expression
        self._system, self._precision, self._expression, self._place = system, precision, expression, place
        self._context, self._epsilon = system.scene.context, float(precision.epsilon)
        self.of_time = of_time(system, place)
        known = system.clocked and self.of_time
        self.at_known_time = known and as_line(expression, self._context) is not None
        lines = lines_in(expression, self._context) if known and not self.at_known_time else []
        self._middles = sorted(system.scaling.internal(line.zero, self._context) for line in lines)
        self._from = [precision.number(middle) for middle in self._middles]
        self._zeros: dict[tuple[int, ...], tuple[Expression, Any]] = {}

    @property
    def may_hide(self) -> bool:
        """Whether ``hidden`` may find anything."""
        return bool(self._from)

    def rounded_from(self, time: Scalar) -> float:
        """The span of time (internal units) to which the argument's rounding is relative: from the farthest
        moment at which a line within it vanishes, or from the clock's zero if the equations see one number.
        """
        if not self.at_known_time and not self._from:
            return abs(float(time))
        rounding = self._epsilon * abs(float(time))
        if self.at_known_time:
            return rounding
        return max(abs(float(time - moment)) for moment in self._from) + rounding

    def all_rounded_from(self, times: np.ndarray) -> np.ndarray:
        """The same of times (n,), float64."""
        if not self.at_known_time and not self._from:
            return np.abs(times.astype(np.float64))
        return np.array([self.rounded_from(time) for time in times])

    def near(self, time: Scalar, modes: Sequence[int]) -> tuple[Scalar, Scalar] | None:
        """The moment in two numbers next to one in one; None if the state matters or none is there."""
        found = self._exactly_near(time, modes)
        return None if found is None else in_two_numbers(found, self._precision.number, self._context)

    def left_out(self, time: tuple[Scalar, Scalar], modes: Sequence[int]) -> float:
        """How far two numbers are from the moment next to them; 0 if it isn't known."""
        found = self._exactly_near(time[0], modes)
        if found is None:
            return 0.0
        return abs(float(found - exactly(time[0], self._context) - exactly(time[1], self._context)))

    def hidden(self, begin: Scalar, end: Scalar, modes: Sequence[int]) -> Scalar | None:
        """The middle of something between two times, where the argument isn't on the motion's side: it may be
        too narrow for a step's polynomials, as 1 - ((t - 5000)/1e-9)^2 is.
        """
        for number, middle in zip(self._from, self._middles, strict=True):
            if not begin < number < end:
                continue
            expression, zero = self._on(modes)
            if zero is not None:  # a straight line hides nothing
                return None
            try:
                value = self._value(expression, middle)
            except ExpressionError:
                continue
            if value * modes[self._place] < 0:
                return number
        return None

    def _exactly_near(self, time: Scalar, modes: Sequence[int]) -> Any | None:
        if not self.of_time:
            return None
        context = self._context
        expression, zero = self._on(modes)
        if zero is not None:
            return zero
        rounding = context.mpf(float(self._precision.epsilon)) * max(abs(float(time)), 1.0)
        function: Callable[[Any], Any] = lambda t: self._value(expression, t)  # noqa: E731
        about = exactly(time, context)
        return _zero(function, about, rounding, self._middles, modes[self._place], context)

    def _value(self, expression: Expression, time: Any) -> Any:
        scaling = self._system.scaling
        unit = self._context.ldexp(scaling.direction * self._context.one, scaling.time)
        return evaluate(expression, {"t": time * unit}, self._context)

    def _on(self, modes: Sequence[int]) -> tuple[Expression, Any]:
        """The argument on these sides of the surfaces within it, and its zero (mpf) if it is a line."""
        sides = tuple(modes)
        if sides not in self._zeros:
            found = on_sides(self._expression, self._system.plan.surfaces.places, sides)
            line = as_line(found, self._context) if self._system.clocked else None
            zero = None if line is None else self._system.scaling.internal(line.zero, self._context)
            self._zeros[sides] = found, zero
        return self._zeros[sides]


def of_time(system: System, place: int) -> bool:
    """Whether the argument of a surface depends on time alone."""
    return names_used(system.plan.surfaces.found[place].expression) == {"t"}


def moments_of(system: System, precision: Precision) -> list[Moments]:
    """The moments of each surface of a system."""
    return [Moments(system, precision, place) for place in range(len(system.surfaces))]


def between(begin: tuple[Scalar, Scalar], end: tuple[Scalar, Scalar]) -> Scalar:
    """From one time in two numbers to another."""
    return (end[0] - begin[0]) - begin[1] + end[1]


def _zero(
    function: Callable[[Any], Any], about: Any, width: Any, middles: Sequence[Any], side: int, context: Any
) -> Any | None:
    """A zero of a function near a number, to the precision of the arithmetic; None if there is none.

    Regula falsi with halved ordinates (Dowell & Jarratt 1971, BIT 11, 168). Zeros are looked for between the
    middles of narrow things, too; of two as near it is that before which the function has the sign ``side``.
    """
    try:
        for _ in range(_MOST_WIDER):
            a, b = about - width, about + width
            points = [a, *(x for x in middles if a < x < b), b]
            values = [function(x) for x in points]
            changes = [n for n in range(1, len(points)) if values[n - 1] * values[n] <= 0]
            if changes:
                n = next((n for n in changes if side * values[n - 1] >= 0), changes[0])
                (a, b), (u, v) = points[n - 1 : n + 1], values[n - 1 : n + 1]
                break
            width *= _WIDER
        else:
            return None
        for _ in range(_MOST_PARTS):
            if u == v or abs(b - a) <= context.ldexp(abs(b), 4 - context.prec):
                break
            c = b - v * (b - a) / (v - u)
            w = function(c)
            if w == 0:
                return c
            if w * v < 0:
                a, u = b, v
            else:
                u = u / 2
            b, v = c, w
    except ExpressionError:  # undefined beside its zero
        return None
    return b
