"""Numbers as they are written in a config, exact, with their units; and the doubles nearest to them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import mpmath

from rigidsim.scene.exact import ExactNumber, decimal_text, fraction_of, in_its_unit, with_unit


@dataclass(frozen=True)
class Written:
    """A number in the unit in which it is written; ``unit`` is empty if there is none."""

    number: ExactNumber
    unit: str = ""

    @classmethod
    def of(cls, value: Any) -> Written:
        """Read a TOML value as a number.

        Raises:
            ValueError: it is none.
        """
        return cls(*in_its_unit(value))

    @property
    def exact(self) -> ExactNumber:
        """The number in SI units.

        Raises:
            ValueError: no such unit.
        """
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
        return f'"{plain}"' if not _is_number(plain) else plain


def nearest_double(number: ExactNumber) -> float:
    """The double nearest to a number, for labels."""
    value = number.rational
    if number.pi_power:
        value = fraction_of(number.at(_labelling()))
    try:
        return value.numerator / value.denominator
    except OverflowError:
        return math.inf if value > 0 else -math.inf


@cache
def _labelling() -> Any:
    context = mpmath.MPContext()
    context.prec = 200
    return context


def _is_number(text: str) -> bool:
    return not any(sign in text for sign in "/*")
