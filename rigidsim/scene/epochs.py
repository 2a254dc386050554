"""Dates of a scene's time zero: calendar dates in TDB, TT, TAI, GPS time and UTC, exactly.

Days of all but UTC have 86,400 s; TT, TAI and GPS time are a constant apart. Since 1972 UTC has the seconds
of TAI, and some of its days have one more: the table of leap seconds is IANA's (the package tzdata), made
from the IERS's, and says until when it is known. From 1960 to 1971 UTC drifted against TAI and stepped by
parts of a second: the table is the IERS's, as in SOFA's and ERFA's ``dat``.
"""

import math
import re
from bisect import bisect_right
from dataclasses import dataclass
from datetime import date, datetime
from decimal import ROUND_HALF_EVEN, Context, Decimal
from fractions import Fraction
from functools import lru_cache
from importlib.resources import files

DIGITS = 14
"""Decimals of a second that an instant resolves."""
SCALES = ("TDB", "TT", "TAI", "GPS", "UTC")
_SECOND = 10**DIGITS  # in ticks
_DAY = 86400 * _SECOND
_FORM = re.compile(
    r"(\d{4})-(?:(\d\d)-(\d\d)|(\d{3}))"
    r"(?:[Tt ](\d\d):(\d\d)(?::(\d\d)(?:\.(\d{1,14}))?)?)?([Zz]|[+-]\d\d:\d\d)?"
    rf"(?: +({'|'.join(SCALES)}))?"
)
A_DATE = re.compile(r"\d{4}-\d\d")
"""Beginning of a date, and of no number."""
_WIDE = Context(prec=80, rounding=ROUND_HALF_EVEN)
_TT_MINUS_TAI = 32184 * 10 ** (DIGITS - 3)  # ticks, by definition
_TT_MINUS = {"TT": 0, "TAI": _TT_MINUS_TAI, "GPS": _TT_MINUS_TAI + 19 * _SECOND}
_JULIAN_DATE_OF_DAY_0 = Fraction(2 * 1721424 + 1, 2)  # 2451544.5 at 0 h of 2000-01-01, which is day 730120
_MJD_OF_DAY_0 = 678576  # ordinal of 1858-11-17
_FIRST_OFFSET = 10  # TAI - UTC on 1972-01-01
_DRIFTING = (  # TAI - UTC = value + (MJD - reference) * pace, s, the MJD with its fraction, from a date on
    ((1960, 1, 1), "1.417818", 37300, "0.001296"),
    ((1961, 1, 1), "1.422818", 37300, "0.001296"),
    ((1961, 8, 1), "1.372818", 37300, "0.001296"),
    ((1962, 1, 1), "1.845858", 37665, "0.0011232"),
    ((1963, 11, 1), "1.945858", 37665, "0.0011232"),
    ((1964, 1, 1), "3.24013", 38761, "0.001296"),
    ((1964, 4, 1), "3.34013", 38761, "0.001296"),
    ((1964, 9, 1), "3.44013", 38761, "0.001296"),
    ((1965, 1, 1), "3.54013", 38761, "0.001296"),
    ((1965, 3, 1), "3.64013", 38761, "0.001296"),
    ((1965, 7, 1), "3.74013", 38761, "0.001296"),
    ((1965, 9, 1), "3.84013", 38761, "0.001296"),
    ((1966, 1, 1), "4.31317", 39126, "0.002592"),
    ((1968, 2, 1), "4.21317", 39126, "0.002592"),
)


@dataclass(frozen=True)
class Epoch:
    """An instant: ordinal of its day, and ticks of 1e-14 s in it (of a leap second from 86,400 s on)."""

    scale: str
    day: int
    ticks: int

    def __str__(self) -> str:
        return f"{self.calendar()} {self.scale}"

    def calendar(self) -> str:
        """Date and time, ``YYYY-MM-DDThh:mm:ss.d``, in its scale."""
        whole, fraction = divmod(self.ticks, _SECOND)
        minutes = min(whole // 60, 24 * 60 - 1)  # a leap second is the 60th of the last minute
        clock = f"{minutes // 60:02}:{minutes % 60:02}:{whole - 60 * minutes:02}"
        digits = f"{fraction:0{DIGITS}}".rstrip("0")
        return f"{date.fromordinal(self.day)}T{clock}{'.' if digits else ''}{digits}"

    def after(self, seconds: Decimal) -> "Epoch":
        """The instant some seconds later, to 1e-14 s; ``ValueError`` past years 1 to 9999 or known UTC."""
        count = self._count() + int(_WIDE.scaleb(seconds, DIGITS).to_integral_value(context=_WIDE))
        if self.scale != "UTC":
            return _dated(self.scale, *divmod(int(count) - _TT_MINUS.get(self.scale, 0), _DAY))
        era = _era_at(count)
        if era is None or count >= _count_of_utc(leap_seconds()[2], 0):
            raise ValueError(_unknown())
        day, rest = divmod(round(era.ticks_at(count)), _DAY)
        following = next((other.day for other in _eras() if other.day > era.day), None)
        if following is not None and day >= following:
            day, rest = day - 1, rest + _DAY
        return _dated("UTC", day, rest)

    def in_scale(self, scale: str) -> "Epoch":
        """The same instant in another scale: exactly, or to some 1e-5 s from TDB or into it."""
        found = Epoch(scale, self.day, self.ticks % _DAY)
        for _ in range(3):  # seconds of TDB and others differ by 1e-8 at most
            found = found.after(_decimal(self.since(found)))
        return found

    def uniform(self) -> "Epoch":
        """The same instant in TDB or TT, whose days all have 86,400 s: in TDB if that is its scale."""
        return self if self.scale in ("TDB", "TT") else Epoch("TT", *divmod(round(self._count()), _DAY))

    def julian_date(self) -> Fraction:
        """The Julian date in ``uniform``'s scale, exactly."""
        return _JULIAN_DATE_OF_DAY_0 + Fraction(self._count()) / _DAY

    def universal_date(self) -> Fraction:
        """The Julian date in UTC, as if its days all had 86,400 s; past the end of the table of leap seconds
        with its last offset, and of TDB as if it were TT. ``ValueError`` before 1960.
        """
        count = self._count()
        if (era := _era_at(count)) is None:
            raise ValueError("UTC began in 1960")
        return _JULIAN_DATE_OF_DAY_0 + Fraction(era.ticks_at(count)) / _DAY

    def since_j2000(self) -> Fraction:
        """Seconds of TDB since J2000 (2000-01-01T12:00:00 TDB); exact for TDB, else right to some 1e-5 s."""
        elapsed = Fraction(self._count() - J2000._count()) / _SECOND
        if self.scale == "TDB":
            return elapsed
        return elapsed + Fraction(tdb_minus_tt(float(elapsed))).limit_denominator(10**9)

    def since(self, zero: "Epoch") -> Fraction:
        """Seconds from another instant to this one: exact, or in TDB where one of the two is."""
        if (self.scale == "TDB") == (zero.scale == "TDB"):
            return Fraction(self._count() - zero._count()) / _SECOND
        return self.since_j2000() - zero.since_j2000()

    def _count(self) -> int | Fraction:
        """Ticks of TDB if that is its scale, otherwise of TT."""
        if self.scale == "UTC":
            return _count_of_utc(self.day, self.ticks)
        return self.day * _DAY + self.ticks + _TT_MINUS.get(self.scale, 0)


def _decimal(value: Fraction) -> Decimal:
    return _WIDE.divide(Decimal(value.numerator), Decimal(value.denominator))


def _dated(scale: str, day: int, ticks: int) -> Epoch:
    if not 1 <= day <= date.max.toordinal():
        raise ValueError("only the years 1 to 9999 can be named")
    return Epoch(scale, day, ticks)


@dataclass(frozen=True)
class _Era:
    """Days of UTC from ``day`` (ordinal) on whose seconds have one length, and are never stepped.

    Attributes:
        begin: ticks of TT then. pace: ticks of TT in one of UTC.
    """

    day: int
    begin: int
    pace: int | Fraction

    def count(self, ticks: int) -> int | Fraction:
        """Ticks of TT of a moment, ticks of UTC."""
        return self.begin + (ticks - self.day * _DAY) * self.pace

    def ticks_at(self, count: int | Fraction) -> int | Fraction:
        """The inverse."""
        since = count - self.begin
        return self.day * _DAY + (since if self.pace == 1 else since / self.pace)


@lru_cache(maxsize=1)
def _eras() -> tuple[_Era, ...]:
    found = []
    for begin, value, reference, pace in _DRIFTING:
        day, by_day = date(*begin).toordinal(), Fraction(pace)
        offset = (Fraction(value) + (day - _MJD_OF_DAY_0 - reference) * by_day) * _SECOND
        found.append(_Era(day, day * _DAY + int(offset) + _TT_MINUS_TAI, 1 + by_day / 86400))
    days, offsets, _ = leap_seconds()
    since_1972 = zip(days, offsets, strict=True)
    return (*found, *(_Era(day, day * _DAY + more * _SECOND + _TT_MINUS_TAI, 1) for day, more in since_1972))


def _era_at(count: int | Fraction) -> _Era | None:
    """The era of a moment (ticks of TT); None before the first."""
    at = bisect_right(_eras(), count, key=lambda era: era.begin)
    return _eras()[at - 1] if at else None


def _era_of(day: int) -> _Era:
    """The era of a day of UTC; ``ValueError`` before 1960."""
    at = bisect_right(_eras(), day, key=lambda era: era.day)
    if not at:
        raise ValueError(_unknown())
    return _eras()[at - 1]


def _count_of_utc(day: int, ticks: int) -> int | Fraction:
    """Ticks of TT of a moment of UTC; ``ValueError`` before 1960."""
    return _era_of(day).count(day * _DAY + ticks)


J2000 = Epoch("TDB", date(2000, 1, 1).toordinal(), 43200 * _SECOND)
"""The instant ``"J2000"``: 2000 January 1, 12 h TDB."""
UTC_BEGIN = date(*_DRIFTING[0][0]).toordinal()
"""The first day of UTC."""


def parse_epoch(text: str, scale: str = "") -> Epoch:
    """Read an instant such as ``2029-04-13T21:46:00 TDB``, ``2024-061T12:00:00Z`` or ``J2000``.

    Args:
        scale: of dates that don't name theirs; ``Z`` and ``+01:00`` name UTC.

    Raises:
        ValueError: it is anything else, or names another scale.
    """
    if text.strip() == "J2000":
        return J2000
    match = _FORM.fullmatch(text.strip())
    shown = f'given "{text.strip()[:60]}"'
    try:
        if match is None:
            raise ValueError
        year, month, number, of_year, hour, minute, second = (int(x) if x else 0 for x in match.groups()[:7])
        day = date(year, month or 1, number or 1).toordinal() + max(of_year - 1, 0)
        if hour > 23 or minute > 59 or second > 60 or date.fromordinal(day).year != year or match[4] == "000":
            raise ValueError
    except (ValueError, OverflowError):
        raise ValueError(_allowed(shown, scale)) from None
    zone = match[9] or ""
    named = {x for x in (match[10], "UTC" if zone else "", scale) if x}
    if len(named) > 1:
        raise ValueError(f"{shown}, where the scale is {scale or match[10]}; name one scale only")
    if not named:
        scales = ", ".join(SCALES)
        raise ValueError(
            f'{shown}, without its time scale; write it behind the date, as "{text.strip()[:60]} TDB" '
            f"({scales}), or Z for UTC"
        )
    minutes = hour * 60 + minute
    if zone not in ("", "Z", "z"):
        minutes -= (int(zone[1:3]) * 60 + int(zone[4:])) * (-1 if zone[0] == "-" else 1)
    day, minutes = day + minutes // 1440, minutes % 1440
    ticks = (minutes * 60 + second) * _SECOND + int((match[8] or "").ljust(DIGITS, "0"))
    found = _dated(named.pop(), day, ticks)
    length: int | Fraction = _DAY
    if found.scale == "UTC":
        if not UTC_BEGIN <= day < leap_seconds()[2]:
            raise ValueError(f"{shown}; {_unknown()}")
        length = _era_of(day).ticks_at(_count_of_utc(day + 1, 0)) - day * _DAY
    if (second == 60 and ticks < _DAY) or ticks >= length:
        last = f"that day of UTC ended at 23:59:{float(length / _SECOND) - 86340:.9g}"
        why = "seconds go up to 59" if length == _DAY else last
        raise ValueError(f"{shown}; there was no leap second then: {why}")
    return found


def _allowed(shown: str, scale: str) -> str:
    if scale:
        return f"{shown}; a date such as 2029-04-13T21:46:00, 2029-103T21:46:00 or 2029-04-13 is allowed"
    return (
        f"{shown}; a date and time with its scale ({', '.join(SCALES)}, or Z for UTC), such as "
        '"2029-04-13T21:46:00 TDB" or "2029-04-13T21:46:00Z", or "J2000", is allowed'
    )


def _unknown() -> str:
    end = date.fromordinal(leap_seconds()[2])
    return (
        f"UTC is known from 1960-01-01 to {end} (its leap seconds by the package tzdata); write the "
        "date in TT, TAI or TDB"
    )


@lru_cache(maxsize=1)
def leap_seconds() -> tuple[list[int], list[int], int]:
    """Days (ordinals) since 1972 from which TAI - UTC changes, its values in s, and the day until which they
    hold.
    """
    text = (files("tzdata") / "zoneinfo" / "leapseconds").read_text(encoding="ascii")
    days, offsets = [date(1972, 1, 1).toordinal()], [_FIRST_OFFSET]
    for words in (line.split() for line in text.splitlines() if line.startswith("Leap")):
        last = datetime.strptime(" ".join(words[1:4]), "%Y %b %d").date()
        days.append(last.toordinal() + 1)
        offsets.append(offsets[-1] + (1 if words[5] == "+" else -1))
    match = re.search(r"^#expires \d+ \((\d{4}-\d\d-\d\d)", text, re.MULTILINE)
    assert match is not None
    return days, offsets, date.fromisoformat(match[1]).toordinal()


def tdb_minus_tt(seconds: float) -> float:
    """TDB - TT at the centre of the Earth, s, for ``seconds`` of TT since J2000.

    Kaplan 2005, USNO Circular 179, eq. 2.6; within 1e-5 s of the full series (ERFA's ``dtdb``) from 1600 to
    2200.
    """
    t = seconds / (86400 * 36525)
    terms = [
        (0.001657, 628.3076, 6.2401), (0.000022, 575.3385, 4.2970), (0.000014, 1256.6152, 6.1969),
        (0.000005, 606.9777, 4.0212), (0.000005, 52.9691, 0.4444), (0.000002, 21.3299, 5.5431),
        (0.000010 * t, 628.3076, 4.2490),
    ]  # fmt: skip
    return math.fsum(size * math.sin(rate * t + phase) for size, rate, phase in terms)
