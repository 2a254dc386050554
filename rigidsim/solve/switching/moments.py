"""Moments at which surfaces that depend on time alone are crossed, in two numbers.

The engine finds them to one number's precision, which would make a pulse of 1 ms late in a run longer or
shorter by a part in a thousand million. Here they are worked out from the expressions as written.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rigidsim.model.system import System
from rigidsim.model.two_part_time import exactly, in_two_numbers
from rigidsim.scene.expressions.lines import as_line, lines_in
from rigidsim.scene.expressions.piecewise import on_sides
from rigidsim.scene.expressions.tree import Expression, ExpressionError, evaluate, names_used
from rigidsim.solve.precision import Precision, Scalar

_WIDER, _MOST_WIDER = 2.0**2, 14  # from one rounding of a time on, around which its zero is looked for
_MOST_PARTS = 500  # of an interval that shrinks to the arithmetic's precision


class Moments:
    """The moments of one surface.

    Attributes:
        of_time: whether its argument depends on time alone.
        at_known_time: whether the argument is a line in time, whose values have hardly any rounding.
    """

    def __init__(self, system: System, precision: Precision, expression: Expression) -> None:
        self._system, self._precision, self._expression = system, precision, expression
        self.of_time = names_used(expression) == {"t"}
        known = system.clocked and self.of_time
        self.at_known_time = known and as_line(expression, system.scene.context) is not None
        self._from = self._moments_of_lines() if known and not self.at_known_time else None
        self._zeros: dict[tuple[int, ...], tuple[Expression, Any]] = {}

    def rounded_from(self, time: Scalar) -> float:
        """The span of time (internal units) to which the argument's rounding is relative: from the farthest
        moment at which a line within it vanishes, or from the clock's zero if the equations see one number.
        """
        rounding = float(self._precision.epsilon) * abs(float(time))
        if self.at_known_time:
            return rounding
        if self._from is None:
            return abs(float(time))
        return max((abs(float(time - moment)) for moment in self._from), default=0.0) + rounding

    def near(self, time: Scalar, modes: Sequence[int]) -> tuple[Scalar, Scalar] | None:
        """The moment in two numbers (internal units) next to one found in one number; None if the surface
        depends on the state too, or isn't crossed there.

        Args:
            modes: the sides of all surfaces on which the motion is.
        """
        if not self.of_time:
            return None
        context, exponent = self._system.scene.context, self._system.scaling.time
        expression, zero = self._on(modes)
        if zero is None:
            rounding = context.mpf(float(self._precision.epsilon)) * max(abs(float(time)), 1.0)
            about, unit = exactly(time, context), context.ldexp(context.one, exponent)
            zero = _zero(
                lambda t: evaluate(expression, {"t": t}, context), about * unit, rounding * unit, context
            )
        if zero is None:
            return None
        return in_two_numbers(context.ldexp(zero, -exponent), self._precision.number, context)

    def _on(self, modes: Sequence[int]) -> tuple[Expression, Any]:
        """The argument on these sides of the surfaces within it, and its zero (s, mpf) if that is a line."""
        sides = tuple(modes)
        if sides not in self._zeros:
            found = on_sides(self._expression, self._system.plan.surfaces.places, sides)
            line = as_line(found, self._system.scene.context) if self._system.clocked else None
            self._zeros[sides] = found, None if line is None else line.zero
        return self._zeros[sides]

    def _moments_of_lines(self) -> list[Scalar]:
        scene, exponent = self._system.scene, self._system.scaling.time
        zeros = [line.zero for line in lines_in(self._expression, scene.context)]
        return [self._precision.number(scene.context.ldexp(zero, -exponent)) for zero in zeros]


def moments_of(system: System, precision: Precision) -> list[Moments]:
    """The moments of each surface of a system."""
    return [Moments(system, precision, surface.expression) for surface in system.plan.surfaces.found]


def between(begin: tuple[Scalar, Scalar], end: tuple[Scalar, Scalar]) -> Scalar:
    """From one time in two numbers to another."""
    return (end[0] - begin[0]) - begin[1] + end[1]


def _zero(function: Callable[[Any], Any], about: Any, width: Any, context: Any) -> Any | None:
    """A zero of a function near a number, to the precision of the arithmetic; None if there is none.

    Regula falsi with halved ordinates (Dowell & Jarratt 1971, BIT 11, 168).
    """
    try:
        for _ in range(_MOST_WIDER):
            a, b = about - width, about + width
            u, v = function(a), function(b)
            if u * v <= 0:
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
