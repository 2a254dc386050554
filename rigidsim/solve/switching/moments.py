"""Moments at which surfaces that depend on time alone are crossed, in two numbers.

The engine finds them to one number's precision, which would make a pulse of 1 ms late in a run longer or
shorter by a part in a thousand million. Here they are worked out from the expressions as written.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rigidsim.model.system import System
from rigidsim.model.two_part_time import exactly, in_two_numbers
from rigidsim.scene.expressions.lines import as_line
from rigidsim.scene.expressions.tree import Expression, ExpressionError, evaluate, names_used
from rigidsim.solve.precision import Precision, Scalar

_AROUND = 2.0**6  # roundings of a time, around which its zero is first looked for
_WIDER, _MOST_WIDER = 2.0**4, 6
_MOST_PARTS = 500  # of an interval that shrinks to the arithmetic's precision


@dataclass(frozen=True)
class Moments:
    """The moments of one surface.

    Attributes:
        expression: its argument.
        zero: the only one, s (mpf), if the argument is a line in time; None otherwise.
        of_time: whether the argument depends on time alone.
    """

    system: System
    precision: Precision
    expression: Expression
    zero: Any | None
    of_time: bool

    @property
    def at_known_time(self) -> bool:
        """Whether the argument is a line in time, whose values have hardly any rounding."""
        return self.zero is not None

    def near(self, time: Scalar) -> tuple[Scalar, Scalar] | None:
        """The moment in two numbers (internal units) next to one found in one number; None if the surface
        depends on the state too, or isn't crossed there.
        """
        if not self.of_time:
            return None
        context, exponent = self.system.scene.context, self.system.scaling.time
        zero = self.zero
        if zero is None:
            rounding = context.mpf(float(self.precision.epsilon)) * max(abs(float(time)), 1.0)
            about, unit = exactly(time, context), context.ldexp(context.one, exponent)
            zero = _zero(self._value, about * unit, rounding * unit * _AROUND, context)
        if zero is None:
            return None
        return in_two_numbers(context.ldexp(zero, -exponent), self.precision.number, context)

    def _value(self, time: Any) -> Any:
        return evaluate(self.expression, {"t": time}, self.system.scene.context)


def moments_of(system: System, precision: Precision) -> list[Moments]:
    """The moments of each surface of a system."""
    found = []
    for surface in system.plan.surfaces.found:
        of_time = names_used(surface.expression) == {"t"}
        line = as_line(surface.expression, system.scene.context) if system.clocked and of_time else None
        zero = None if line is None else line.zero
        found.append(Moments(system, precision, surface.expression, zero, of_time))
    return found


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
