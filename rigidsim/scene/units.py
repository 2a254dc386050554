"""Units that a config may use: exact rational factors to SI, powers of pi, and dimensions.

Each unit has its own list of prefixes, so that no name means two things: ``min`` is a minute, and ``cd`` no
hundredth of a day. Pi stays a power until a run fills it in at its own precision. Everything is defined from
SI by exact decimals, except the atomic mass constant (CODATA 2022, measured) and the sidereal day.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import TypeAlias

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


def _read(text: str, known: Mapping[str, _Unit]) -> _Unit:
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
            raise _unknown(word, known)
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


def _unknown(word: str, known: Mapping[str, _Unit]) -> _Unknown:
    if _OFFSET.fullmatch(word):
        return _Unknown(
            f'"{word}" has an offset, which no unit may have; write the temperature in kelvin, "K"'
        )
    if word in _INSTEAD:
        near = f'; did you mean "{_INSTEAD[word]}"?'
    elif _RUN_TOGETHER.fullmatch(word) and len(word) < _LONGEST:
        near = f'; did you mean "{" ".join(re.findall("kg|.", word))}"?'
    else:
        names = [name for name in known if len(name) > 1]
        near = nearest(word, names) or nearest(word.lower(), names)
    return _Unknown(f'unknown unit "{word}"{near}')


class _Unknown(UnitError):
    """A name that no unit has; its text lacks the units that there are."""


@lru_cache(maxsize=512)
def _unit(text: str, expected: str = "") -> _Unit:
    """A unit by its text; an error lists the units of the dimension that is expected."""
    try:
        return _read(text, _known())
    except _Unknown as error:
        raise UnitError(f"{error}; {_units_for(expected) if expected else known_units()}") from None


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


def known_units() -> str:
    """A line that lists the units, for error messages."""
    return f"known units: {' '.join(line.split()[0] for line in _TABLE)}, with SI prefixes, * / ^"


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
