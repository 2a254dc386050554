"""Units that a config may use, as definitions for pint with exact rational factors.

Pi is a unit of its own here ("pi"), not a number: a conversion from degrees yields a rational factor and
a power of pi, and pi itself is filled in later at the run's own precision. Everything is defined from SI
by exact decimals, except the atomic mass constant (CODATA 2022, measured) and the sidereal day.
"""

import re
from fractions import Fraction
from functools import lru_cache
from typing import Any, TypeAlias

from rigidsim.scene.validation_messages import nearest, shown

_DEFINITIONS = """
yocto- = 1e-24 = y-
zepto- = 1e-21 = z-
atto- = 1e-18 = a-
femto- = 1e-15 = f-
pico- = 1e-12 = p-
nano- = 1e-9 = n-
micro- = 1e-6 = µ- = μ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-
tera- = 1e12 = T-
peta- = 1e15 = P-
exa- = 1e18 = E-
meter = [length] = m = metre
kilogram = [mass] = kg
second = [time] = s = sec
gram = 1e-3 * kilogram = g
pi = [circle_constant] = π
radian = [] = rad
degree = pi / 180 * radian = deg = °
arcminute = degree / 60 = arcmin
arcsecond = degree / 3600 = arcsec
milliarcsecond = degree / 3600000 = mas
turn = 2 * pi * radian = rev = revolution = cycle
revolutions_per_minute = 2 * pi * radian / minute = rpm
minute = 60 * second = min
hour = 3600 * second = h = hr
day = 86400 * second = d
year = 31557600 * second = yr = a = julian_year
century = 3155760000 * second = cy
sidereal_day = 86164.0905 * second
angstrom = 1e-10 * meter = Å
astronomical_unit = 149597870700 * meter = au
tonne = 1000 * kilogram = t
dalton = 1.66053906892e-27 * kilogram = Da = u
newton = kilogram * meter / second ** 2 = N
joule = newton * meter = J
watt = joule / second = W
hertz = 1 / second = Hz
ampere = [current] = A
coulomb = ampere * second = C
volt = watt / ampere = V
siemens = ampere / volt = S
weber = volt * second = Wb
tesla = weber / meter ** 2 = T
gauss = 1e-4 * tesla
standard_gravity = 9.80665 * meter / second ** 2 = g0
""".strip().splitlines()

_UNIT_TEXT = re.compile(r"[\w°µμÅπ*/^ ().·-]{1,60}")
_LARGEST_EXPONENT = 12
# a number raised to a power, as in m^2^9 or 9^9, and rows of superscripts: towers that would take for ever
_TOWER = re.compile(
    r"(?<!\w)\d[\d.]*(?:[eE][+-]?\d+)?[\s)]*(?:\^|\*\*)|[\u00b2\u00b3\u00b9\u2070-\u2079]{2,}"
)
_HERTZ = re.compile(r"Hz|hertz")
_NUMBER = re.compile(r"(?<![\w.])\.?\d")


class UnitError(ValueError):
    """Raised if a unit is unknown, malformed, or of another dimension than the key requires."""


def _pint() -> Any:
    import pint  # takes longer to load than a tiny run; only configs that write units pay for it

    return pint


@lru_cache(maxsize=1)
def _registry() -> Any:
    registry: Any = _pint().UnitRegistry(None, non_int_type=Fraction)
    registry.load_definitions(_DEFINITIONS)
    return registry


@lru_cache(maxsize=512)
def _to_si(text: str) -> tuple[Fraction, int, dict[str, Fraction]]:
    """Factor, power of pi and dimensions of a unit."""
    exponents = [int(digits) for digits in re.findall(r"\d+", text)]
    before = [text[: number.start()].rstrip(" (+-") for number in _NUMBER.finditer(text)]
    factors = any(not start.endswith(("^", "**")) for start in before)  # a unit has numbers only as exponents
    unusual = not _UNIT_TEXT.fullmatch(text) or _TOWER.search(text) or factors
    if unusual or any(e > _LARGEST_EXPONENT for e in exponents):
        raise UnitError(f"{shown(text)} is not a unit")
    try:
        unit = _registry().parse_units(text.replace("·", "*"))
        if any(abs(power) > _LARGEST_EXPONENT for power in unit._units.values()):  # such as m^1e9
            raise UnitError(f"{shown(text)} is not a unit")
        quantity = _registry().Quantity(Fraction(1), unit).to_root_units()
    except _pint().UndefinedUnitError as error:
        names = [n for parts in _units() for n in parts if re.fullmatch(r"[A-Za-z_]{2,}", n)]
        near = nearest(str(error.args[0]).lower(), names)
        raise UnitError(f'unknown unit "{error.args[0]}"{near}; {known_units()}') from None
    except Exception:  # pint and its tokenizer raise many kinds on malformed text
        raise UnitError(f"{shown(text)} is not a unit") from None
    powers = {str(name): Fraction(power) for name, power in quantity._units.items()}
    pi_power = powers.pop("pi", Fraction(0))
    powers.pop("radian", None)
    if pi_power.denominator != 1:
        raise UnitError(f'"{text}" takes a root of an angle')
    return Fraction(quantity.magnitude), int(pi_power), powers


Powers: TypeAlias = tuple[tuple[str, Fraction], ...]
"""A dimension: exponents of base units, sorted by their names."""
_SHORT = {"meter": "m", "kilogram": "kg", "second": "s", "ampere": "A"}
_FAMILIAR = ("N m", "N", "N m s", "N/m", "N s", "W", "T", "A m^2", "V", "C")


def powers(text: str) -> Powers:
    """The dimension of a unit; empty for angles."""
    return tuple(sorted(_to_si(text)[2].items()))


def to_si(text: str) -> tuple[Fraction, int]:
    """Exact factor from a unit to SI, as ``rational * pi**power``."""
    return _to_si(text)[:2]


def is_unit(text: str) -> bool:
    """Whether a text is a unit."""
    try:
        _to_si(text)
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
            _SHORT.get(base, base) + ("" if abs(power) == 1 else f"^{abs(power)}")
            for base, power in dimension
            if (power > 0) is above
        )
        for above in (True, False)
    )
    if not under:
        return over
    return f"{over or '1'}/{under if ' ' not in under else f'({under})'}"


def _units() -> list[list[str]]:
    """Names of each unit, and its definition in the second place; without prefixes and pi."""
    lines = [[part.strip() for part in line.split("=")] for line in _DEFINITIONS]
    return [parts for parts in lines if not parts[0].endswith("-") and parts[0] != "pi"]


def known_units() -> str:
    """A line that lists the units, for error messages."""
    names = [parts[2] if len(parts) > 2 else parts[0] for parts in _units()]
    return "known units: " + " ".join(names) + ", with SI prefixes, * / ^"


def conversion(text: str, expected: str) -> tuple[Fraction, int]:
    """Factor (rational, power of pi) to the SI unit ``expected``; ``UnitError`` for another dimension."""
    factor, pi_power, dimensions = _to_si(text)
    if expected == "rad/s" and _HERTZ.search(text):
        raise UnitError(f'"{text}" may count turns or radians; write "turn/s" (or "rpm", "deg/s") or "rad/s"')
    wanted_factor, _, wanted = _to_si(expected) if expected != "1" else (Fraction(1), 0, {})
    if dimensions != wanted and expected == "1":
        raise UnitError(f'"{text}" is a unit, where only a number without one is allowed')
    if dimensions != wanted:
        raise UnitError(f'"{text}" is not a unit of the dimension asked for, which is {expected}')
    return factor / wanted_factor, pi_power


def time_unit(name: str) -> Fraction:
    """Length in seconds of a unit of time, such as ``day`` or ``kyr``; ``UnitError`` for others."""
    if not re.fullmatch(r"[^\W\d]+", name):
        raise UnitError(f'"{name[:40]}" is not the name of a unit of time')
    factor, pi_power = conversion(name, "s")
    if pi_power:
        raise UnitError(f'"{name}" is not a unit of time')
    return factor
