"""Readable numbers: a span of time in the unit that suits it, fs to Gyr, an instant as a date, angles, and SI
units with prefixes. Datasets hold rad and plain SI.

A config's ``[time] unit`` and ``epoch`` are stored in the dataset's attributes ``time_unit`` and
``epoch``; without a unit the span chooses one.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from rigidsim.scene.epochs import J2000, Epoch, parse_epoch
from rigidsim.scene.exact import time_unit

DAY = 86400.0
YEAR = 365.25 * DAY
"""Julian year, s: the unit ``yr`` of configs."""
_J2000_YEAR = 2000.0
ASTRONOMICAL_UNIT = 149597870700.0  # m
_LONG = ((1e9 * YEAR, "Gyr"), (1e6 * YEAR, "Myr"), (1e3 * YEAR, "kyr"))
_CALENDAR = ((YEAR, "yr"), (DAY, "d"), (3600.0, "h"), (60.0, "min"))
_SHORT = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"), (1e-12, "ps"), (1e-15, "fs"))
_MOST_ANGLE = 20.0  # rad in a unit of time, beyond which a rate doesn't read as an angle
_CLOSE = 1 + 1e-9  # a span this near below a unit counts as one


@dataclass(frozen=True)
class TimeUnit:
    """A unit of time: its symbol, as written after a number, and its length in s."""

    symbol: str
    seconds: float


def unit_for(span: float) -> TimeUnit:
    """The unit in which a span (s, of either sign) reads as a number of about 1 to 1000.

    Each of min, h, d and yr is used from two of them on: 90 s reads better than 1.5 min.
    """
    size = abs(span) * _CLOSE
    if not math.isfinite(size) or size == 0:
        return TimeUnit("s", 1.0)
    for factor, units in ((1.0, _LONG), (2.0, _CALENDAR), (1.0, _SHORT)):
        for seconds, symbol in units:
            if size >= factor * seconds:
                return TimeUnit(symbol, seconds)
    exponent = max(3 * math.floor(math.log10(size) / 3), -300)  # whose power isn't zero
    return TimeUnit(f"1e{exponent} s", 10.0**exponent)


def named_unit(name: str) -> TimeUnit:
    """The unit of a name in a config, such as ``day``; ``ValueError`` for others."""
    return TimeUnit(name, float(time_unit(name)))


def unit_of(attributes: Mapping[str, Any], span: float) -> TimeUnit:
    """The unit that a run's attributes ask for, or otherwise the one that suits a span (s)."""
    name = str(attributes.get("time_unit") or "")
    try:
        return named_unit(name) if name else unit_for(span)
    except ValueError:  # of a dataset that was tampered with
        return unit_for(span)


def epoch_of(attributes: Mapping[str, Any]) -> Epoch | None:
    """Date of time 0, if a run's attributes give it; else None."""
    try:
        return parse_epoch(str(attributes.get("epoch") or ""))
    except ValueError:
        return None


def number_text(value: float, digits: int = 3) -> str:
    """A number to so many digits, without an exponent if that is short: ``999.7`` gives ``1000``."""
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e" in text and 1 <= abs(value) < 1e6 else text


def span_text(seconds: float, digits: int = 3, unit: TimeUnit | None = None) -> str:
    """A time span in the unit that suits it, or in a given one: ``304 d``, ``25.8 kyr``, ``4.2 µs``."""
    unit = unit or unit_for(seconds)
    return f"{number_text(seconds / unit.seconds, digits)} {unit.symbol}"


def period_text(seconds: float, attributes: Mapping[str, Any], digits: int = 5) -> str:
    """A time span in the unit that a run's attributes ask for, if it counts 1 to 10,000 of these."""
    unit = unit_of(attributes, seconds)
    return span_text(seconds, digits, unit if 1 <= abs(seconds) / unit.seconds < 1e4 else None)


def value_text(value: Any, unit: str, digits: int = 4) -> str:
    """A number with its unit."""
    return f"{number_text(float(value), digits)} {unit}"


def length_text(length: float) -> str:
    """A length in m, km or au."""
    size, unit = next(
        (size, unit)
        for least, size, unit in ((1e10, ASTRONOMICAL_UNIT, "au"), (1e4, 1e3, "km"), (0.0, 1.0, "m"))
        if length >= least
    )
    return value_text(length / size, unit)


def instant_text(epoch: Epoch, seconds: float, span: float) -> str:
    """Date and time some seconds after an epoch, to about a thousandth of a span (s).

    A day, a minute, a second, or decimals of one, in the epoch's scale; times of the day are rounded, dates
    are not. If UTC isn't known, TT is used; outside the years 1 to 9999 a Julian year is given.
    """
    step = abs(span) * 1e-3 * _CLOSE or 1e-6
    decimals = min(max(math.ceil(-math.log10(step)), 0), 9)
    half = 0.0 if step >= DAY else 30.0 if step >= 60 else 0.5 * 10.0**-decimals
    for scale in (epoch, epoch.uniform()):
        try:
            then = scale.after(Decimal(seconds) + Decimal(half))
        except (ValueError, OverflowError):  # the latter of an infinite time
            continue
        text = then.calendar()
        if step >= DAY:
            text = text[:10]
        elif step >= 60:
            text = text[:16]
        else:
            text = text[:19] + (f".{text[20:].ljust(decimals, '0')[:decimals]}" if decimals else "")
        return f"{text} {then.scale}"
    uniform = epoch.uniform()
    return f"year {number_text(julian_year(epoch) + seconds / YEAR, 9)} {uniform.scale}"


def bytes_text(count: float) -> str:
    """A number of bytes in a unit that suits it."""
    for unit, factor in (("EB", 1e18), ("PB", 1e15), ("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= factor:
            return f"{count / factor:.3g} {unit}"
    return f"{count:.0f} B"


@dataclass(frozen=True)
class TimeWords:
    """Wording of the times of one run: their unit, the date of time 0 if known, and the run's length, s."""

    unit: TimeUnit
    epoch: Epoch | None
    span: float

    @classmethod
    def of(cls, attributes: Mapping[str, Any], start: float, end: float) -> Self:
        """Wording for a run from ``start`` to ``end`` (s) whose attributes may have a unit and an epoch."""
        largest = max(abs(start), abs(end))
        suiting = unit_for(largest)
        if 1.0 < suiting.seconds < DAY:  # 5000 s rather than 83.3333333 min
            suiting = TimeUnit("s", 1.0)
        asked = str(attributes.get("time_unit") or "")
        unit = unit_of(attributes, largest) if asked else suiting
        return cls(unit, epoch_of(attributes), abs(end - start))

    def short(self, seconds: float) -> str:
        """A time of the scene to six digits, like ``304.2 d``."""
        return span_text(seconds, 6, self.unit)

    def coarse(self, seconds: Sequence[float]) -> list[str]:
        """Times of the scene to a thousandth of its span: ``3.50 s``, and with an epoch the date alone."""
        if self.epoch is not None:
            return [instant_text(self.epoch, one, self.span) for one in seconds]
        step = 1e-3 * self.span / self.unit.seconds * _CLOSE
        decimals = min(max(math.ceil(-math.log10(step)), 0), 9) if step > 0 else 3
        scale, after = self.unit.seconds, f" {self.unit.symbol}"
        return [f"{one / scale:.{decimals}f}{after}" for one in seconds]

    def moment(self, seconds: float, digits: int = 9) -> str:
        """A time of the scene: ``304.2 d``, and with an epoch ``304.2 d (2029-04-13 TDB)``."""
        text = span_text(seconds, digits, self.unit)
        return text if self.epoch is None else f"{text} ({instant_text(self.epoch, seconds, self.span)})"


def julian_year(epoch: Epoch) -> float:
    """Julian year in TDB for an epoch in TDB, otherwise in TT: 2000 at J2000, one more every 365.25 days."""
    uniform = epoch.uniform()
    return _J2000_YEAR + float(uniform.julian_date() - J2000.julian_date()) / 365.25


Array = NDArray[np.float64]


@dataclass(frozen=True)
class AngleUnit:
    """A unit of angle: its name in ``--angle-unit`` and names of columns, its symbol after a number, and how
    many make a full turn; None for the radian, which doesn't divide one.
    """

    name: str
    symbol: str
    per_turn: int | None

    @property
    def per_radian(self) -> float:
        """Factor from rad."""
        return 1.0 if self.per_turn is None else self.per_turn / (2 * math.pi)


ANGLE_UNITS: dict[str, AngleUnit] = {
    unit.name: unit
    for unit in (
        AngleUnit("rad", "rad", None),
        AngleUnit("turns", "turns", 1),
        AngleUnit("deg", "°", 360),
        AngleUnit("arcsec", "″", 360 * 3600),
        AngleUnit("mas", "mas", 360 * 3600 * 1000),
    )
}
"""Units by name, the largest first."""

_MANY_TURNS = 20 * math.pi
_SMALL = math.radians(0.1)  # 6'
_TINY = math.radians(0.1 / 3600)
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_PREFIXED = ("rad/s", "m", "m/s")
_PREFIXES = {0: "", -3: "m", -6: "µ", -9: "n", -12: "p", -15: "f", 3: "k", 6: "M", 9: "G", 12: "T"}


def angle_unit(size: float) -> AngleUnit:
    """The unit in which angles of a size (rad; the largest of a column, or its range) read best.

    Turns from ten of them on, degrees down to a tenth of one, arcseconds down to a tenth, below that
    milliarcseconds; degrees for zero and for what isn't finite.
    """
    size = abs(size)
    if not math.isfinite(size) or size == 0:
        return ANGLE_UNITS["deg"]
    if size >= _MANY_TURNS:
        return ANGLE_UNITS["turns"]
    if size >= _SMALL:
        return ANGLE_UNITS["deg"]
    return ANGLE_UNITS["arcsec" if size >= _TINY else "mas"]


def largest(values: Array) -> float:
    """Largest magnitude of all finite values; 0 if there are none."""
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def scaled(values: Array, unit: str, attributes: Mapping[str, Any] | None = None) -> tuple[float, str]:
    """Divisor and name of the unit in which values read best: prefixes for rates and lengths, degrees,
    arcseconds, mas and less for angles, and with a run's attributes its unit of time: for times, and for
    rates, which are then angles a year or a day, if these are below `_MOST_ANGLE`.
    """
    unit, size = pretty_unit(unit), largest(values)
    if unit == "rad":
        return _angle_scale(size)
    if attributes is not None and unit in ("s", "rad/s"):
        time = unit_of(attributes, size if unit == "s" else 0.0)
        if unit == "s":
            return time.seconds, time.symbol
        for per in (time, TimeUnit("day", DAY)) if time.seconds >= DAY else ():
            if size * per.seconds <= _MOST_ANGLE:
                divisor, name = _angle_scale(size * per.seconds)
                return divisor / per.seconds, f"{name}/{per.symbol}"
    if unit not in _PREFIXED or size == 0 or 0.1 <= size < 1e3:
        return 1.0, unit
    exponent = 3 * math.floor(math.log10(size) / 3 + 1e-9)
    return 10.0**exponent, _PREFIXES.get(exponent, f"1e{exponent} ") + unit


def _angle_scale(size: float) -> tuple[float, str]:
    """Divisor and unit for angles in rad: deg, arcsec and mas as in tables, and µas and less below."""
    unit = angle_unit(min(size, 1.0))  # not in turns
    if unit.name != "mas" or size * unit.per_radian >= 0.1:
        return 1 / unit.per_radian, unit.name
    exponent = 3 * math.floor(math.log10(size * unit.per_radian) / 3 + 1e-9)
    return 10.0**exponent / unit.per_radian, {-3: "µas", -6: "nas"}.get(exponent, f"1e{exponent} mas")


def pretty_unit(unit: str) -> str:
    """A unit as people write it: `kg m2 s-1` (UDUNITS) and `kg m^2/s` both give `kg m²/s`."""
    parts: tuple[list[str], list[str]] = [], []
    for n, part in enumerate(unit.split("/")):
        for base, power in re.findall(r"([^\W\d_]+|1)\^?(-?\d+)?", part):
            exponent = int(power or 1) * (-1 if n else 1)
            digits = str(abs(exponent)).translate(_SUPERSCRIPTS) if abs(exponent) != 1 else ""
            if base != "1":
                parts[exponent < 0].append(base + digits)
    above, below = parts
    return "/".join([" ".join(above) or ("1" if below else ""), *below])


def with_unit(text: str, unit: str) -> str:
    """A name and a unit of ``scaled``; without a unit the name alone."""
    return f"{text} [{unit}]" if unit else text


def angle_text(value: float, digits: int = 4, *, like: float | None = None) -> str:
    """An angle in rad with its unit, or another's unit: ``206.3 mas``, ``23.44°``."""
    divisor, unit = _angle_scale(abs(value if like is None else like))
    symbol = ANGLE_UNITS[unit].symbol if unit in ANGLE_UNITS else unit
    return f"{typeset(value / divisor, digits)}{'' if symbol in '°″' else ' '}{symbol}"


def turning_text(rate: float) -> str:
    """A rate (rad/s) as turns per unit of time, chosen so that the number isn't tiny: ``0.6702 turns/s``."""
    unit = unit_for(40 * math.pi / rate if rate else 0.0)
    return f"{typeset(rate * unit.seconds / (2 * math.pi))} turns/{unit.symbol}"


def typeset(value: float, digits: int = 4) -> str:
    """A number as ``number_text``, with a true minus sign."""
    return number_text(value, digits).replace("-", "−")
