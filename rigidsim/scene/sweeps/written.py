"""Values of a sweep's axes as they are written in a config: exact numbers with their units, or anything else.

A value is the same number whatever else the axis holds, so that its values identify a member: an axis that
is prolonged keeps those that it had.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Self

import mpmath

from rigidsim.scene.exact import ExactNumber, decimal_text, in_its_unit, with_unit
from rigidsim.scene.validation_messages import shown

DIGITS = 40
"""Significant decimal digits of values that aren't rational: of logspace, and on a sphere."""


@dataclass(frozen=True)
class Written:
    """A number in the unit in which it is written; ``unit`` is empty if there is none."""

    number: ExactNumber
    unit: str = ""

    @classmethod
    def of(cls, value: Any) -> Self:
        """Read a TOML value as a number; ValueError if it is none."""
        return cls(*in_its_unit(value))

    @property
    def exact(self) -> ExactNumber:
        """The number in SI units; ValueError for an unknown unit."""
        return with_unit(self.number, self.unit, self.unit) if self.unit else self.number

    @property
    def text(self) -> str:
        """The number as written in a config."""
        plain = decimal_text(self.number.rational)
        if self.number.pi_power:
            power = "" if self.number.pi_power == 1 else f"^{self.number.pi_power}"
            plain = f"{plain}*pi{power}"
        if self.unit:
            return f'"{plain} {self.unit}"'
        return f'"{plain}"' if "/" in plain or "*" in plain else plain


def long_context() -> Any:
    """A context in which values that aren't rational are worked out, before they are ``rounded``."""
    context = mpmath.MPContext()
    context.dps = DIGITS + 20
    return context


def rounded(value: Fraction) -> Fraction:
    """The nearest number of ``DIGITS`` decimal digits."""
    if not value:
        return value
    size = abs(value)
    magnitude = math.floor(math.log10(size.numerator) - math.log10(size.denominator))
    scale = Fraction(10) ** (DIGITS - 1 - magnitude)
    return round(value * scale) / scale


Entry = tuple[Written, ...]


@dataclass(frozen=True)
class AxisValues:
    """Values of an axis: by their index, either the numbers of each, or the TOML text of what is none."""

    count: int
    components: int  # of each value; 0 for plain numbers, and for values that aren't numbers
    entry: Callable[[int], Entry] | None
    word: Callable[[int], str] | None = None

    def text(self, index: int) -> str:
        """A value as written in a config, which identifies it."""
        if self.entry is None:
            assert self.word is not None
            return self.word(index)
        texts = [number.text for number in self.entry(index)]
        return f"[{', '.join(texts)}]" if self.components else texts[0]


Rational = tuple[Fraction, int, str]
"""A rational number with its power of pi and its unit."""


def alike(*given: Any) -> tuple[Rational, ...]:
    """Numbers in a common unit, times a common power of pi; ValueError if there is none."""
    written = [Written.of(value) for value in given]
    in_one_unit = f"given {' and '.join(map(shown, given))}; write both in one unit"
    if len({w.unit for w in written}) > 1 or len({w.number.pi_power for w in written if w.number.sign}) > 1:
        if not all(w.unit for w in written if w.number.sign):
            raise ValueError(in_one_unit)
        written = [Written(w.exact) for w in written]
    turns = {w.number.pi_power for w in written if w.number.sign}
    if len(turns) > 1:
        raise ValueError(in_one_unit)
    power = turns.pop() if turns else 0
    return tuple((w.number.rational, power, w.unit) for w in written)
