"""Exact numbers as written: a rational times a power of pi, rounded only when a run asks for it.

A config's ``0.1`` is one tenth until the moment that it becomes a coefficient or an initial value at the
working precision; binary floating point never stands in between.

Units have exact rational factors to SI, powers of pi, and dimensions. Each has its own list of prefixes, so
that no name means two things: ``min`` is a minute, and ``cd`` no hundredth of a day. Everything is defined
from SI by exact decimals, except the atomic mass constant (CODATA 2022, measured) and the sidereal day.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, Inexact, InvalidOperation
from fractions import Fraction
from functools import cache, lru_cache
from typing import Any, TypeAlias

import mpmath

from rigidsim.errors import ensure
from rigidsim.scene.validation_messages import nearest, shown

_TABLE = """
m | metre meter | f p n u m c d k M G T
kg | kilogram
s sec | second sec | f p n u m k M G T
A | ampere | p n u m k M
K | kelvin | n u m k
rad | radian rad | p n u m
g | gram | n u m k | 1e-3 kg
t | tonne | k M G | 1000 kg
Da u | dalton | k M | 1.66053906892e-27 kg
deg ° | degree deg | n u m | 1/180 pi rad
arcmin | arcminute | | 1/10800 pi rad
arcsec | arcsecond | n u m | 1/648000 pi rad
mas | | | 1/648000000 pi rad
uas µas μas | | | 1/648000000000 pi rad
turn rev cycle | turn rev revolution cycle | | 2 pi rad
min | minute min | | 60 s
h hr | hour hr | | 3600 s
d | day | | 86400 s
yr | year yr julian_year | k M G | 31557600 s
a | | | 31557600 s
cy century centuries | | | 3155760000 s
sidereal_day | sidereal_day | | 86164.0905 s
rpm revolutions_per_minute | | | 1/30 pi rad/s
Å | angstrom | | 1e-10 m
au | astronomical_unit | | 149597870700 m
N | newton | p n u m k M G | 1 kg m/s^2
J | joule | p n u m k M G T | 1 N m
W | watt | p n u m k M G T | 1 J/s
Pa | pascal | n u m h k M G | 1 N/m^2
bar | bar | u m k | 100000 Pa
atm | | | 101325 Pa
Hz | hertz | n u m k M G T | 1 s^-1
C | coulomb | p n u m k | 1 A s
V | volt | n u m k M | 1 W/A
ohm Ω | ohm | u m k M | 1 V/A
S | siemens | n u m k M | 1 A/V
Wb | weber | n u m | 1 V s
T | tesla | f p n u m | 1 Wb/m^2
gauss | gauss | u m k | 1e-4 T
g0 | standard_gravity | n u m | 9.80665 m/s^2
in inch inches | | | 0.0254 m
ft foot feet | | | 0.3048 m
mi | mile | | 1609.344 m
nmi | nautical_mile | | 1852 m
lb lbm | pound lb | | 0.45359237 kg
lbf | pound_force | | 4.4482216152605 N
slug | slug | | 1 lbf s^2/ft
psi | | | 1 lbf/in^2
""".strip().splitlines()
"""Symbols, which take short prefixes; words, which take long prefixes and a plural; prefixes;
and the value of a unit outside the base.
"""
_PREFIXES = {
    "f": ("femto", -15), "p": ("pico", -12), "n": ("nano", -9), "u": ("micro", -6), "m": ("milli", -3),
    "c": ("centi", -2), "d": ("deci", -1), "h": ("hecto", 2), "k": ("kilo", 3), "M": ("mega", 6),
    "G": ("giga", 9), "T": ("tera", 12),
}  # fmt: skip
_INSTEAD = {"Ma": "Myr", "ka": "kyr", "Ga": "Gyr", "as": "arcsec", "G": "gauss", "cd": "day", "amu": "Da"}
_OFFSET = re.compile(r"(deg|°)[CF]|celsius|fahrenheit", re.IGNORECASE)
_RUN_TOGETHER = re.compile(r"(?:kg|[NmsJWATV])+")

_TOKEN = re.compile(
    r"\s*(?:(?P<sign>/|\*(?!\*)|·|\.|per\b)|(?P<name>[^\W\d⁰¹²³⁴-⁹][^\W⁰¹²³⁴-⁹]*|°)|"
    r"(?P<parenthesis>[()])|(?P<one>1)(?=\s*/)|(?P<raised>⁻?[⁰¹²³⁴-⁹])|"
    r"(?:\^|\*\*)\s*(?P<power>[+-]?\d{1,3}|\([+-]?\d{1,3}\))(?!\.?\d))"
)
_RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789", "()")
_LONGEST, _LARGEST_EXPONENT, _LARGEST_POWER, _DEEPEST = 60, 12, 60, 2
_HERTZ = re.compile(r"Hz|hertz")

Powers: TypeAlias = tuple[tuple[str, Fraction], ...]
"""A dimension: exponents of base units, sorted by their names."""
_BASE = {"m": "meter", "kg": "kilogram", "s": "second", "A": "ampere", "K": "kelvin", "rad": "radian"}
_SYMBOLS = {name: symbol for symbol, name in _BASE.items()}
_FAMILIAR = ("N m", "N", "N m s", "N/m", "N s", "W", "T", "A m^2", "V", "C")


class UnitError(ValueError):
    """Raised if a unit is unknown, malformed, or of another dimension than the key requires."""


@dataclass(frozen=True)
class _Unit:
    """``rational * pi**pi_power`` times powers of base units, of which "radian" is one."""

    rational: Fraction
    pi_power: int
    bases: Mapping[str, int]

    def times(self, other: _Unit, power: int = 1) -> _Unit:
        """The product with a power of another unit."""
        bases = {b: self.bases.get(b, 0) + power * other.bases.get(b, 0) for b in {*self.bases, *other.bases}}
        return _Unit(
            self.rational * other.rational**power,
            self.pi_power + power * other.pi_power,
            {base: exponent for base, exponent in bases.items() if exponent},
        )

    @property
    def angle(self) -> int:
        """Power of an angle, which has no dimension."""
        return self.bases.get("radian", 0)

    @property
    def powers(self) -> Powers:
        """The dimension."""
        return tuple(sorted((b, Fraction(power)) for b, power in self.bases.items() if b != "radian"))


_NUMBER = _Unit(Fraction(1), 0, {})


@lru_cache(maxsize=1)
def _known() -> dict[str, _Unit]:
    """Every name of a unit."""
    found: dict[str, _Unit] = {}
    for line in _TABLE:
        symbols, words, prefixes, value = ([part.split() for part in line.split("|")] + [[], []])[:4]
        if value:
            factor, *rest = value
            turns = rest.count("pi")
            unit = _Unit(Fraction(factor), turns, {}).times(_read(" ".join(rest[turns:]), found))
        else:
            unit = _Unit(Fraction(1), 0, {_BASE[symbols[0]]: 1})
        found |= dict.fromkeys([*symbols, *words, *(f"{word}s" for word in words)], unit)
        for prefix in prefixes:
            long, exponent = _PREFIXES[prefix]
            larger = _Unit(unit.rational * Fraction(10) ** exponent, unit.pi_power, unit.bases)
            shorts = ("u", "µ", "μ") if prefix == "u" else (prefix,)
            names = [short + symbol for short in shorts for symbol in symbols]
            names += [long + word + plural for word in words for plural in ("", "s")]
            found |= dict.fromkeys(names, larger)
    return found


def _read(text: str, known: Mapping[str, _Unit], expected: str = "") -> _Unit:
    """A product of units, read from left to right: ``N/m s`` is N s/m."""
    malformed = UnitError(f"{shown(text)} is not a unit")
    tokens: list[tuple[str, str]] = []
    end = 0
    while end < len(text.rstrip()):
        match = _TOKEN.match(text, end)
        if match is None or match.lastgroup is None or len(text) > _LONGEST:
            raise malformed
        tokens.append((match.lastgroup, match[match.lastgroup]))
        end = match.end()
    tokens.reverse()

    def product(depth: int) -> _Unit:
        total, begun = _NUMBER, False
        if tokens and tokens[-1][0] == "one":
            tokens.pop()
        while tokens and tokens[-1][1] != ")":
            over = tokens[-1][1] in ("/", "per")
            if over or (begun and tokens[-1][0] == "sign"):
                tokens.pop()
            total, begun = total.times(factor(depth), -1 if over else 1), True
        if not begun or any(abs(exponent) > _LARGEST_POWER for exponent in total.bases.values()):
            raise malformed
        return total

    def factor(depth: int) -> _Unit:
        kind, word = tokens.pop() if tokens else ("", "")
        if word == "(" and depth < _DEEPEST:
            found = product(depth + 1)
            if not tokens or tokens.pop()[1] != ")":
                raise malformed
        elif kind != "name":
            raise malformed
        elif word not in known:
            raise _unknown(word, known, expected)
        else:
            found = known[word]
        if tokens and tokens[-1][0] in ("power", "raised"):
            exponent = int(tokens.pop()[1].translate(_RAISED))
            if abs(exponent) > _LARGEST_EXPONENT:
                raise malformed
            found = _NUMBER.times(found, exponent)
        return found

    whole = product(0)
    if tokens:
        raise malformed
    return whole


def _unknown(word: str, known: Mapping[str, _Unit], expected: str) -> UnitError:
    every = f"known units: {' '.join(line.split()[0] for line in _TABLE)}, with SI prefixes, * / ^"
    listed = _units_for(expected) if expected else every
    if _OFFSET.fullmatch(word):
        what = f'"{word}" has an offset, which no unit may have; write the temperature in kelvin, "K"'
        return UnitError(f"{what}; {listed}")
    if word in _INSTEAD:
        near = f'; did you mean "{_INSTEAD[word]}"?'
    elif _RUN_TOGETHER.fullmatch(word) and len(word) < _LONGEST:
        near = f'; did you mean "{" ".join(re.findall("kg|.", word))}"?'
    else:
        names = [name for name in known if len(name) > 1]
        near = nearest(word, names) or nearest(word.lower(), names)
    return UnitError(f'unknown unit "{word}"{near}; {listed}')


@lru_cache(maxsize=512)
def _unit(text: str, expected: str = "") -> _Unit:
    """A unit by its text; an error lists the units of the dimension that is expected."""
    return _read(text, _known(), expected)


def _units_for(expected: str) -> str:
    """The units of which a value with the SI unit ``expected`` may be made."""
    known = _known()
    parts = {}
    for name in (expected, *re.findall("[A-Za-z]+", expected)):
        bases = _unit(name).bases if name != "1" else {}
        same = [line.split()[0] for line in _TABLE if known[line.split()[0]].bases == bases]
        if bases and same:
            parts[name] = f"for {name}: {' '.join(same)}"
    return f"units {'; '.join(parts.values())}; with SI prefixes" if parts else "a number has no unit"


def powers(text: str) -> Powers:
    """The dimension of a unit; empty for angles."""
    return _unit(text).powers


def to_si(text: str) -> tuple[Fraction, int]:
    """Exact factor from a unit to SI, as ``rational * pi**power``."""
    unit = _unit(text)
    return unit.rational, unit.pi_power


def is_unit(text: str) -> bool:
    """Whether a text is a unit."""
    try:
        _unit(text)
    except UnitError:
        return False
    return True


def unit_text(dimension: Powers) -> str:
    """SI unit of a dimension as people write it: ``N m``, ``m/s``, ``kg m^2``."""
    for name in _FAMILIAR:
        if powers(name) == dimension:
            return name
    over, under = (
        " ".join(
            _SYMBOLS.get(base, base) + ("" if abs(power) == 1 else f"^{abs(power)}")
            for base, power in dimension
            if (power > 0) is above
        )
        for above in (True, False)
    )
    if not under:
        return over
    return f"{over or '1'}/{under if ' ' not in under else f'({under})'}"


def conversion(text: str, expected: str) -> tuple[Fraction, int]:
    """Factor (rational, power of pi) to the SI unit ``expected``, "1" for a number.

    Raises:
        UnitError: for another dimension, or for an angle where a number or a time is asked for: 5 deg is no
            eccentricity.
    """
    unit, wanted = _unit(text, expected), _unit(expected) if expected != "1" else _NUMBER
    if expected == "rad/s" and _HERTZ.search(text):
        raise UnitError(f'"{text}" may count turns or radians; write "turn/s" (or "rpm", "deg/s") or "rad/s"')
    mechanical = len(set(wanted.bases) - {"second", "radian"}) > 0  # N m/rad is a torque as good as N m
    if unit.powers == wanted.powers and (mechanical or unit.angle in (0, wanted.angle)):
        return unit.rational / wanted.rational, unit.pi_power - wanted.pi_power
    if expected == "1":
        raise UnitError(f'"{text}" is a unit, where only a number without one is allowed')
    if unit.powers == wanted.powers:
        raise UnitError(f'"{text}" counts angles, where {expected} is asked for')
    raise UnitError(
        f'"{text}" is not a unit of the dimension asked for, which is {expected}; {_units_for(expected)}'
    )


def time_unit(name: str) -> Fraction:
    """Length in seconds of a unit of time, such as ``day`` or ``kyr``; ``UnitError`` for others."""
    if not re.fullmatch(r"[^\W\d]+", name):
        raise UnitError(f'"{name[:40]}" is not the name of a unit of time')
    return conversion(name, "s")[0]


# --- exact numbers ------------------------------------------------------------------------------------------


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
    def alone(self) -> ExactNumber:
        """The number without information on its unit."""
        return ExactNumber(self.rational, self.pi_power)

    @property
    def sign(self) -> int:
        """Sign: -1, 0 or 1."""
        return (self.rational > 0) - (self.rational < 0)

    @property
    def in_its_unit(self) -> ExactNumber:
        """The number that stands before its unit."""
        factor, turns = to_si(self.unit) if self.unit else (1, 0)
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
    except UnitError as error:
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
    factor, turns = conversion(written, unit) if unit else to_si(written)
    return ExactNumber(rational * factor, pi_power + turns, written)
