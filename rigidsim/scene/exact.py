"""Exact numbers as written: a rational times a power of pi, rounded only when a run asks for it.

A config's ``0.1`` is one tenth until the moment that it becomes a coefficient or an initial value at the
working precision; binary floating point never stands in between.
"""

import re
from dataclasses import dataclass, field
from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, Inexact, InvalidOperation
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath

from rigidsim.errors import ensure
from rigidsim.scene import units
from rigidsim.scene.validation_messages import shown

# Far past any physical quantity and any precision, and still quick to expand into integers.
_LARGEST_DECIMAL_EXPONENT = 5000
_LONGEST_TEXT = 5000
_TOO_LONG = (
    f"digits and exponent of a number may make at most {_LARGEST_DECIMAL_EXPONENT}; write fewer digits"
)
_TOO_LONG += " or a larger unit"

_LONGEST_DECIMAL = 150  # digits of a decimal that is written out
_PLAIN_DIGITS = 18

_MOST_FACTORS = 20
_LARGEST_POWER_OF_PI = 64
_LARGEST_BITS = 150_000  # of a product; a single power may have as many

_DECIMAL = r"[+-]?(?:\d+(?:_\d+)*(?:\.(?:\d+(?:_\d+)*)?)?|\.\d+)(?:[eE][+-]?\d+)?"
_PI = r"[+-]?(?:pi(?![\w])|π)"
_FACTOR = rf"(?:{_DECIMAL}|{_PI})(?:\s*(?:\^|\*\*)\s*{_DECIMAL})?"
_NUMBER_AND_UNIT = re.compile(
    rf"\s*(?P<number>{_FACTOR}(?:(?:\s*[*/]\s*|\s*(?=pi|π)){_FACTOR})*)"
    r"(?:\s*\*\s*|\s*)(?P<unit>[^\d\s.].*)?"
)
_STEP = re.compile(
    rf"\s*(?P<operator>[*/]?)\s*(?:(?P<number>{_DECIMAL})|(?P<pi>{_PI}))"
    rf"(?:\s*(?:\^|\*\*)\s*(?P<exponent>{_DECIMAL}))?"
)


@dataclass(frozen=True)
class ExactNumber:
    """``rational * pi**pi_power`` in SI (angles in rad), and how it was written, which no comparison reads.

    Attributes:
        unit: the unit written after it; empty if none was.
        assumed: the unit that it has since none was written; empty for a plain number.
    """

    rational: Fraction
    pi_power: int = 0
    unit: str = field(default="", compare=False)
    assumed: str = field(default="", compare=False)

    @property
    def swept(self) -> bool:
        """Whether it stands for the numbers of all members of a sweep."""
        return False

    def at(self, context: Any) -> Any:
        """The value as an ``mpf`` of the given mpmath context, correct to its precision."""
        value = rounded(self.rational, context)
        return value * context.pi**self.pi_power if self.pi_power else value

    def fraction(self, context: Any) -> Fraction:
        """The value itself; for a multiple of pi, the nearest number of the context."""
        return self.rational if self.pi_power == 0 else fraction_of(self.at(context))

    def __float__(self) -> float:
        return float(self.at(for_doubles()))

    @property
    def alone(self) -> "ExactNumber":
        """The number without information on its unit."""
        return ExactNumber(self.rational, self.pi_power)

    @property
    def sign(self) -> int:
        """Sign: -1, 0 or 1."""
        return (self.rational > 0) - (self.rational < 0)

    @property
    def in_its_unit(self) -> "ExactNumber":
        """The number that stands before its unit."""
        factor, turns = units.to_si(self.unit) if self.unit else (1, 0)
        return ExactNumber(self.rational / factor, self.pi_power - turns)

    @property
    def text(self) -> str:
        """A TOML value that denotes it, in its unit."""
        number = self.in_its_unit
        plain = decimal_text(number.rational)
        if number.pi_power:
            plain = f"{plain}*pi" if number.pi_power == 1 else f"{plain}*pi^{number.pi_power}"
        if self.unit:
            return f'"{plain} {self.unit}"'
        return f'"{plain}"' if "/" in plain or "*" in plain else plain


ZERO = ExactNumber(Fraction(0))


@cache
def for_doubles() -> Any:
    """Context in which numbers are rounded to doubles; making one takes longer than reading a config."""
    context = mpmath.MPContext()
    context.prec = 120
    return context


def rounded(value: Fraction, context: Any) -> Any:
    """The nearest mpf of an mpmath context."""
    return context.mpf(value.numerator) / context.mpf(value.denominator)


def fraction_of(value: Any) -> Fraction:
    """The exact value of a finite mpf of any context."""
    sign, mantissa, exponent, _ = value._mpf_
    whole = -int(mantissa) if sign else int(mantissa)
    return Fraction(whole << exponent) if exponent >= 0 else Fraction(whole, 1 << -exponent)


def _rational(text: str | Decimal) -> Fraction:
    try:
        number = text if isinstance(text, Decimal) else Decimal(text.replace("_", ""))
    except InvalidOperation:  # an exponent past what Decimal itself holds
        raise ValueError(_TOO_LONG) from None
    ensure(number.is_finite(), ValueError("finite numbers are allowed"))
    length = abs(int(number.as_tuple().exponent)) + len(number.as_tuple().digits)
    ensure(not number or length <= _LARGEST_DECIMAL_EXPONENT, ValueError(_TOO_LONG))
    return Fraction(number)


def _power(base: Fraction, exponent: Fraction) -> Fraction:
    whole = exponent.denominator == 1 and abs(exponent) <= _LARGEST_DECIMAL_EXPONENT
    what = f"a power in a number needs a whole exponent of at most {_LARGEST_DECIMAL_EXPONENT}, as in 2^-20"
    ensure(whole, ValueError(what))
    what = "a power in a number needs a base between 1e-6 and 1e6, as in 2^-20"
    ensure(base and max(abs(base.numerator), base.denominator) <= 10**6, ValueError(what))
    return base ** int(exponent)


def _product(text: str) -> tuple[Fraction, int]:
    """The value of a text of factors, quotients and powers, as a rational times a power of pi."""
    rational, pi_power, begin, count = Fraction(1), 0, 0, 0
    while begin < len(text):
        step = _STEP.match(text, begin)
        assert step is not None  # the whole text is made of them
        begin, count = step.end(), count + 1
        exponent = Fraction(1) if step["exponent"] is None else _rational(step["exponent"])
        if step["pi"] is None:
            factor, turns = _rational(step["number"]), 0
            factor = factor if step["exponent"] is None else _power(factor, exponent)
        else:
            if exponent.denominator != 1 or abs(exponent) > _LARGEST_POWER_OF_PI:
                raise ValueError(f"a power of pi has a whole exponent of at most {_LARGEST_POWER_OF_PI}")
            factor, turns = Fraction(-1 if step["pi"].startswith("-") else 1), int(exponent)
        if step["operator"] == "/":
            ensure(factor, ValueError("a divisor other than zero is allowed"))
            factor, turns = 1 / factor, -turns
        rational, pi_power = rational * factor, pi_power + turns
        bits = max(rational.numerator.bit_length(), rational.denominator.bit_length())
        ensure(bits <= _LARGEST_BITS, ValueError(_TOO_LONG))
        few = count <= _MOST_FACTORS and abs(pi_power) <= _LARGEST_POWER_OF_PI
        ensure(few, ValueError(f"at most {_MOST_FACTORS} factors are allowed"))
    return rational, pi_power


def exact_decimal(value: Fraction) -> Decimal | None:
    """The same number as a decimal without zeros at its end; None for a fraction that isn't one."""
    digits = value.numerator.bit_length() + value.denominator.bit_length() + 1
    context = Context(prec=digits, Emin=MIN_EMIN, Emax=MAX_EMAX, traps=[Inexact])
    try:
        return context.divide(Decimal(value.numerator), Decimal(value.denominator)).normalize(context)
    except Inexact:
        return None


def decimal_text(value: Fraction) -> str:
    """A number as TOML text: a decimal of at most some hundred digits, otherwise ``p/q``, to be quoted."""
    number = exact_decimal(value)
    exponent = 0 if number is None else int(number.as_tuple().exponent)
    if number is None or -exponent > _LONGEST_DECIMAL:
        return f"{value.numerator}/{value.denominator}"
    short = -4 <= number.adjusted() <= _PLAIN_DIGITS if exponent < 0 else number.adjusted() < _PLAIN_DIGITS
    return f"{number:f}" if short else f"{number:e}".replace("e+", "e")


def example(unit: str) -> str:
    """An example of a number with this unit, for messages."""
    return {
        "": '"1/3"',
        "1": '"1/3"',
        "rad": '"23.44 deg"',
        "rad/s": '"7.292115e-5 rad/s"',
        "s": '"430 day"',
        "kg m^2": '"8.008e37 kg m^2"',
        "kg": '"5.97e24 kg"',
        "m": '"6378 km"',
    }.get(unit, f'"1.5 {unit}"')


def parse_number(value: Any, unit: str = "") -> ExactNumber:
    """Read a TOML value as an exact number.

    Args:
        value: an int, a Decimal (as the TOML reader yields), a float (taken as the exact binary number
            that it is), an ExactNumber, or a string such as ``"430 day"``, ``"1/3"``, ``"-3*pi/4"`` or
            ``"2^-20 kg m^2"``.
        unit: SI unit that bare numbers have and that a written unit must agree with; ``"1"`` for none, empty
            for any.

    Raises:
        ValueError: not a finite number, or a unit of another dimension; the text says what is allowed.
    """
    if isinstance(value, ExactNumber):
        return value
    assumed = "" if unit == "1" else unit
    if isinstance(value, bool) or not isinstance(value, int | float | Decimal | str):
        number = f"a number (in {unit})" if assumed else "a number"
        raise ValueError(f"given {shown(value)}; {number}, or a string such as {example(unit)}, is allowed")
    try:
        if isinstance(value, str):
            return _from_text(value, unit)
        rational = Fraction(value) if isinstance(value, int) else _rational(Decimal(value))
    except units.UnitError as error:
        such = f"; write for instance {example(unit)}" if unit else ""
        raise ValueError(f"given {shown(value)}: {error}{such}") from None
    except ValueError as error:
        raise ValueError(f"given {shown(value)}; {error}") from None
    return ExactNumber(rational, assumed=assumed)


def _from_text(text: str, unit: str) -> ExactNumber:
    if len(text) > _LONGEST_TEXT:
        raise ValueError(f"it has {len(text)} characters, and a number at most {_LONGEST_TEXT}")
    match = _NUMBER_AND_UNIT.fullmatch(text)
    if match is None:
        raise ValueError(
            "a number, or a string of a number and a unit, is allowed, such as 1.5, "
            f'"1/3", "2^-20", "pi/4" or {example(unit)}'
        )
    rational, pi_power = _product(match["number"])
    if match["unit"] is None:
        return ExactNumber(rational, pi_power, assumed="" if unit == "1" else unit)
    written = match["unit"].strip()
    factor, turns = units.conversion(written, unit) if unit else units.to_si(written)
    return ExactNumber(rational * factor, pi_power + turns, written)
