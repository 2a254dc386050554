"""Dates of a scene's time zero: calendar dates in TDB, TT and UTC, exactly.

Days of TT and TDB have 86,400 s. Seconds of UTC are those of TAI, and some of its days have one more: the
table of leap seconds is IANA's (the package tzdata), made from the IERS's, and says until when it is known.
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
SCALES = ("TDB", "TT", "UTC")
_SECOND = 10**DIGITS  # in ticks
_DAY = 86400 * _SECOND
_FORM = re.compile(
    r"(\d{4}-\d\d-\d\d)(?:[T ](\d\d):(\d\d)(?::(\d\d)(?:\.(\d{1,14}))?)?)? +(" + "|".join(SCALES) + ")"
)
_WIDE = Context(prec=80, rounding=ROUND_HALF_EVEN)
_TT_MINUS_TAI = Fraction(32184, 1000)  # by definition
_JULIAN_DATE_OF_DAY_0 = Fraction(2 * 1721424 + 1, 2)  # 2451544.5 at 0 h of 2000-01-01, which is day 730120
_FIRST_OFFSET = 10  # TAI - UTC on 1972-01-01, before which seconds of UTC had other lengths


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
        ticks = int(_WIDE.scaleb(seconds, DIGITS).to_integral_value(context=_WIDE))
        uniform = self._uniform() + ticks
        if self.scale != "UTC":
            return _dated(self.scale, *divmod(uniform, _DAY))
        days, offsets, end = leap_seconds()
        begins = [day * _DAY + offset * _SECOND for day, offset in zip(days, offsets, strict=True)]
        found = bisect_right(begins, uniform) - 1
        if found < 0 or uniform >= end * _DAY + offsets[-1] * _SECOND:
            raise ValueError(_unknown())
        day, rest = divmod(uniform - offsets[found] * _SECOND, _DAY)
        if found + 1 < len(days) and day >= days[found + 1]:
            day, rest = day - 1, rest + _DAY
        return _dated(self.scale, day, rest)

    def uniform(self) -> "Epoch":
        """The same instant in a scale whose days all have 86,400 s: TT for UTC, otherwise its own."""
        if self.scale != "UTC":
            return self
        return Epoch("TT", *divmod(self._uniform() + int(_TT_MINUS_TAI * _SECOND), _DAY))

    def julian_date(self) -> Fraction:
        """The Julian date in ``uniform``'s scale, exactly."""
        uniform = self.uniform()
        return uniform.day + _JULIAN_DATE_OF_DAY_0 + Fraction(uniform.ticks, _DAY)

    def universal_date(self) -> Fraction:
        """The Julian date in UTC, as if its days all had 86,400 s; past the end of the table of leap seconds
        with its last offset. ``ValueError`` before 1972.
        """
        days, offsets, _ = leap_seconds()
        ticks = self._uniform() if self.scale == "UTC" else self._uniform() - int(_TT_MINUS_TAI * _SECOND)
        begins = [day * _DAY + offset * _SECOND for day, offset in zip(days, offsets, strict=True)]
        found = bisect_right(begins, ticks) - 1
        if found < 0:
            raise ValueError("UTC began in 1972")
        return _JULIAN_DATE_OF_DAY_0 + Fraction(ticks - offsets[found] * _SECOND, _DAY)

    def since_j2000(self) -> Fraction:
        """Seconds of TDB since J2000 (2000-01-01T12:00:00 TDB); for TT and UTC right to some 1e-5 s."""
        elapsed = Fraction(self._uniform() - J2000._uniform(), _SECOND)
        if self.scale == "TDB":
            return elapsed
        if self.scale == "UTC":  # the count was in TAI
            elapsed += _TT_MINUS_TAI
        return elapsed + Fraction(tdb_minus_tt(float(elapsed))).limit_denominator(10**9)

    def _uniform(self) -> int:
        """Ticks of a scale without leap seconds: TAI for UTC, otherwise its own."""
        total = self.day * _DAY + self.ticks
        if self.scale != "UTC":
            return total
        days, offsets, _ = leap_seconds()
        return total + offsets[bisect_right(days, self.day) - 1] * _SECOND


def _dated(scale: str, day: int, ticks: int) -> Epoch:
    if not 1 <= day <= date.max.toordinal():
        raise ValueError("only the years 1 to 9999 can be named")
    return Epoch(scale, day, ticks)


J2000 = Epoch("TDB", date(2000, 1, 1).toordinal(), 43200 * _SECOND)
"""The instant ``"J2000"``: 2000 January 1, 12 h TDB."""


def parse_epoch(text: str) -> Epoch:
    """Read an instant such as ``2029-04-13T21:46:00 TDB`` or ``J2000``; ``ValueError`` for anything else."""
    if text.strip() == "J2000":
        return J2000
    match = _FORM.fullmatch(text.strip())
    try:
        if match is None:
            raise ValueError
        day = date.fromisoformat(match[1]).toordinal()
        hour, minute, second = (int(part or 0) for part in match.group(2, 3, 4))
        if hour > 23 or minute > 59 or second > 60:
            raise ValueError
    except ValueError:
        raise ValueError(
            f'given "{text[:60]}"; a date and time with its scale ({", ".join(SCALES)}), such as '
            '"2029-04-13T21:46:00 TDB", or "J2000", is allowed'
        ) from None
    ticks = (hour * 3600 + minute * 60 + second) * _SECOND + int((match[5] or "").ljust(DIGITS, "0"))
    scale = match[6]
    if scale == "UTC":
        days, _, end = leap_seconds()
        if not days[0] <= day < end:
            raise ValueError(f'given "{text[:60]}"; {_unknown()}')
    longest = _SECOND if scale == "UTC" and day + 1 in leap_seconds()[0][1:] else 0
    if second == 60 and not (ticks >= _DAY and longest):
        raise ValueError(f'given "{text[:60]}"; there was no leap second then: seconds go up to 59')
    return Epoch(scale, day, ticks)


def _unknown() -> str:
    end = date.fromordinal(leap_seconds()[2])
    return (
        f"leap seconds of UTC are known from 1972-01-01 to {end} (by the package tzdata); write the epoch in "
        "TT or TDB"
    )


@lru_cache(maxsize=1)
def leap_seconds() -> tuple[list[int], list[int], int]:
    """Days (ordinals) from which TAI - UTC changes, its values in s, and the day until which they hold."""
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
