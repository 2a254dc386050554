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
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.tree import Constant, Expression, ExpressionError, Name, Operation

_WORD_OF_UNIT = re.compile(
    r"[ \t]*(?P<join>[*/]?)[ \t]*(?P<name>[A-Za-z][A-Za-z0-9_]*)"
    r"(?P<power>[ \t]*(?:\^|\*\*)[ \t]*-?[0-9]+(?![\d.]))?"
)


@dataclass(frozen=True)
class Measure:
    """What is known of a dimension: powers of base units (empty for a number or an angle, None if any is
    possible), and whether a unit was written in the value.
    """

    powers: units.Powers | None
    written: bool = False

    def times(self, other: Measure, power: Fraction | int = 1) -> Measure:
        """Dimension of the product with a power of another value."""
        written = self.written or other.written
        if self.powers is None or other.powers is None:
            return Measure(None, written)
        found = dict(self.powers)
        for base, exponent in other.powers:
            found[base] = found.get(base, Fraction(0)) + power * exponent
        return Measure(tuple(sorted((base, n) for base, n in found.items() if n)), written)

    def power(self, exponent: ExactNumber | None) -> Measure:
        """Dimension of a power; for an exponent that isn't rational, only that of a number stays known."""
        if not self.powers:
            return self
        if exponent is None or exponent.pi_power:
            return Measure(None, self.written)
        return Measure((), self.written).times(self, exponent.rational)

    def __str__(self) -> str:
        if self.powers is None:
            return "a value of any dimension"
        return f'a value in "{units.unit_text(self.powers)}"' if self.powers else "a number or an angle"


NUMBER, ANY = Measure(()), Measure(None)


def of_constant(node: Constant) -> Measure:
    """Dimension of a number: the dimension of its unit, if it has one."""
    unit = node.value.unit
    return Measure(units.powers(unit), written=True) if unit else ANY


def of_name(node: Name) -> Measure:
    """Dimension of what a name stands for."""
    unit = node.of.unit
    return ANY if unit is None else Measure(units.powers(unit)) if unit else NUMBER


def of_operation(node: Operation, operands: Sequence[Measure], last: Expression | None) -> Measure:
    """Dimension of an operation as it is written.

    Args:
        last: its last operand with constants folded.

    Raises:
        ExpressionError: values of different dimensions where one is needed.
    """
    if not operands:
        return ANY
    name, first, *others = node.operator, *operands
    if name in ("product", "quotient"):
        return first.times(others[0], 1 if name == "product" else -1)
    if name in ("negative", "abs"):
        return first
    if name == "power":
        if others[0].powers and others[0].written:
            raise node.operands[1].error("an exponent is a number, without a unit")
        return first.power(last.value if isinstance(last, Constant) else None)
    if name == "sqrt":
        return first.power(ExactNumber(Fraction(1, 2)))
    common = first
    for other, operand in zip(others, node.operands[1:], strict=True):
        common = _common(common, other, operand if name == "sum" else node)
    if name in ("sum", "min", "max"):
        return common
    if common.powers and common.written and name not in ("sign", "step", "pulse", "atan2"):
        raise node.error(
            f'"{name}" takes a number or an angle, given {common}; divide by '
            f'"(1 {units.unit_text(common.powers)})" if that is meant'
        )
    return Measure((), any(operand.written for operand in operands))


def check_unit(found: Measure, needed: str, *, read_too: bool = False) -> None:
    """Check that a value can have the required dimension; ``ExpressionError`` otherwise.

    Args:
        read_too: also if its dimension is only that of what it reads.
    """
    known = found.written or (read_too and bool(found.powers))
    if known and found.powers is not None and found.powers != units.powers(needed):
        raise ExpressionError(f'the expression is {found}, where "{needed}" is needed')


def _common(a: Measure, b: Measure, where: Expression) -> Measure:
    """Dimension of a sum or comparison; refused if they differ and either has a unit."""
    written = a.written or b.written
    if a.powers is None or b.powers is None or a.powers == b.powers:
        return Measure(b.powers if a.powers is None else a.powers, written)
    if written:
        raise where.error(f"{a} and {b} can't be added or compared")
    return Measure(None)


def end_of_unit(text: str, position: int, names: Collection[str], parameters: Collection[str]) -> int:
    """Position at which a unit ends that begins after ``position``; ``position`` itself if there is none.

    Args:
        names: names of the state and of time, which are never units: t is no tonne.
        parameters: these and other names of the scene are units only within a text that can't be meant
            otherwise, as ``m`` in "9.81 m/s^2" and in "0.1 N m", since products have their sign.

    Raises:
        ValueError: the text is ambiguous, like "5 N*m" if m is a parameter.
    """
    end, certain = position, False
    while (match := _WORD_OF_UNIT.match(text, end)) is not None:
        name, join = match["name"], match["join"]
        called = text[match.end() :].lstrip(" \t").startswith("(") and match["power"] is None
        if called or name in names or (join and end == position) or not units.is_unit(name):
            break
        if join and name in parameters:
            raise ValueError(
                f'"{name}" is a name of this scene, and a unit as well; write the unit without "{join}", or '
                "parentheses around the number with its unit"
            )
        end, certain = match.end(), certain or name not in parameters
    return end if certain else position
