"""Dimensions of expressions, checked wherever units are written in them.

A bare number, and a parameter without a unit, is in SI of whatever dimension fits, so that nothing is known
of a product with it. Time and the state have their dimensions (angles have none). Sums are checked, arguments
of functions, and what a component is needed in; but only where a unit is written in one of the parts, so
that ``sin(t)``, which takes t in seconds, stays what it was.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from fractions import Fraction

from rigidsim.scene import units
from rigidsim.scene.exact import ExactNumber, Quantity
from rigidsim.scene.expressions.names import Readable

_WORD_OF_UNIT = re.compile(
    r"[ \t]*(?P<join>[*/]?)[ \t]*(?P<name>[A-Za-z][A-Za-z0-9_]*)"
    r"(?P<power>[ \t]*(?:\^|\*\*)[ \t]*-?[0-9]+(?![\d.]))?"
)


class DimensionError(ValueError):
    """Values of different dimensions where one is needed; the text says which."""


@dataclass(frozen=True)
class Measure:
    """What is known of a dimension: powers of base units (empty for a number or an angle, None if any is
    possible), and whether a unit was written in the value.
    """

    powers: units.Powers | None
    written: bool = False

    def times(self, other: Measure, power: int = 1) -> Measure:
        """Dimension of the product with a power (1 or -1) of another value."""
        written = self.written or other.written
        if self.powers is None or other.powers is None:
            return Measure(None, written)
        found = dict(self.powers)
        for base, exponent in other.powers:
            found[base] = found.get(base, Fraction(0)) + power * exponent
        return Measure(_sorted(found), written)

    def power(self, exponent: ExactNumber | None) -> Measure:
        """Dimension of a power; for an exponent that isn't rational, only that of a number stays known."""
        if not self.powers:
            return self
        if exponent is None or exponent.pi_power:
            return Measure(None, self.written)
        return Measure(_sorted({base: p * exponent.rational for base, p in self.powers}), self.written)

    def with_other(self, other: Measure) -> Measure:
        """Dimension of a sum or comparison; ``DimensionError`` if they differ and either has a unit."""
        written = self.written or other.written
        if self.powers is None or other.powers is None or self.powers == other.powers:
            return Measure(other.powers if self.powers is None else self.powers, written)
        if written:
            raise DimensionError(f"{self} and {other} can't be added or compared")
        return Measure(None)

    def __str__(self) -> str:
        if self.powers is None:
            return "a value of any dimension"
        return f'a value in "{units.unit_text(self.powers)}"' if self.powers else "a number or an angle"


NUMBER = Measure(())
ANY = Measure(None)


def of_name(readable: Readable) -> Measure:
    """Dimension of what a name stands for."""
    if readable.unit is None:
        return ANY
    if not readable.unit:
        return NUMBER
    return Measure(units.powers(readable.unit))


def of_number(number: ExactNumber) -> Measure:
    """Dimension of a constant: that of its unit, if it has one."""
    return of_unit(number.unit) if isinstance(number, Quantity) else ANY


def of_unit(unit: str) -> Measure:
    """Dimension of a value with this unit written after it."""
    return Measure(units.powers(unit), written=True)


def of_function(name: str, arguments: Sequence[Measure]) -> Measure:
    """Dimension of a function's value; ``DimensionError`` if it can't have such arguments."""
    common = arguments[0]
    for other in arguments[1:]:
        common = common.with_other(other)
    if name in ("abs", "min", "max"):
        return common
    if name == "sqrt":
        return common.power(ExactNumber(Fraction(1, 2)))
    if common.powers and common.written and name not in ("sign", "step", "pulse", "atan2"):
        raise DimensionError(
            f'"{name}" takes a number or an angle, given {common}; divide by '
            f'"(1 {units.unit_text(common.powers)})" if that is meant'
        )
    return Measure((), any(argument.written for argument in arguments))


def check_unit(measure: Measure, needed: str, *, read_too: bool = False) -> None:
    """Check that a value can have the required dimension; ``DimensionError`` otherwise.

    Args:
        read_too: also if its dimension is only that of what it reads.
    """
    known = measure.written or (read_too and bool(measure.powers))
    if known and measure.powers is not None and measure.powers != units.powers(needed):
        raise DimensionError(f'the expression is {measure}, where "{needed}" is needed')


def end_of_unit(text: str, position: int, names: Collection[str], parameters: Collection[str]) -> int:
    """Position at which a unit ends that begins after ``position``; ``position`` itself if there is none.

    Args:
        names: names of the state and of time, which are never units: t is no tonne.
        parameters: these and other names of the scene are units only within a text that can't be meant
            otherwise, as ``m`` in "9.81 m/s^2" and in "0.1 N m", since products have their sign.

    Raises:
        DimensionError: the text is ambiguous, like "5 N*m" if m is a parameter.
    """
    end, certain = position, False
    while (match := _WORD_OF_UNIT.match(text, end)) is not None:
        name, join = match["name"], match["join"]
        called = text[match.end() :].lstrip(" \t").startswith("(") and match["power"] is None
        if called or name in names or (join and end == position) or not units.is_unit(name):
            break
        if join and name in parameters:
            raise DimensionError(
                f'"{name}" is a name of this scene, and a unit as well; write the unit without "{join}", or '
                "parentheses around the number with its unit"
            )
        end, certain = match.end(), certain or name not in parameters
    return end if certain else position


def _sorted(powers: dict[str, Fraction]) -> units.Powers:
    return tuple(sorted((base, power) for base, power in powers.items() if power))
