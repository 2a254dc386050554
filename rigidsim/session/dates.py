"""Dates of samples and events, if time 0 of the scene is known: year, Julian date, calendar date.

A Julian date is worked out from the exact rational time of a sample and kept in two doubles: right to 2^-104
of its size, some 1e-20 s. Blocks are cut at multiples of a fixed count of samples, so that bits depend on the
sample alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from fractions import Fraction
from functools import cached_property

import numpy as np

from rigidsim.scene.epochs import J2000, Epoch, leap_seconds, parse_epoch
from rigidsim.scene.sample_times import SampleTimes
from rigidsim.store.variables import Variable

DAY = 86400
_YEAR = 365.25
_J2000 = float(J2000.julian_date())
_BLOCK = 1 << 16
_SPARE = 17  # bits taken by products with an index within a block
# What xarray turns into datetime64[ns] without the package cftime.
_FIRST_DATE, _LAST_DATE = parse_epoch("1678-01-01 TT").day, parse_epoch("2262-01-01 TT").day

Columns = dict[str, list[np.ndarray]]
"""Parts of each variable by name, (rows,) float64."""
Parts = tuple[float, float, float]


@dataclass(frozen=True)
class Dates:
    """Coordinates besides ``time`` for a scene whose time 0 is known."""

    epoch: Epoch
    samples: SampleTimes

    @property
    def scale(self) -> str:
        """Time scale of years and Julian dates: TDB for an epoch in TDB, otherwise TT."""
        return self.epoch.uniform().scale

    @cached_property
    def has_dates(self) -> bool:
        """Whether all samples lie where readers have dates (1678 to 2261) and, in UTC, from 1972 to the last
        day for which it is known.
        """
        ends = [self.samples.begin, self.samples.exact_last]
        days: list[Fraction] = [Fraction(self.epoch.day), *(self.epoch.uniform().day + t / DAY for t in ends)]
        if not _FIRST_DATE <= min(days) <= max(days) < _LAST_DATE:
            return False
        if self.epoch.scale != "UTC":
            return True
        if self.epoch.day < leap_seconds()[0][0]:
            return False
        last = date.fromordinal(leap_seconds()[2] - 1)
        known = [parse_epoch(f"{day} UTC").julian_date() for day in ("1972-01-01", last)]
        zero = self.epoch.julian_date()
        return known[0] <= zero + min(ends) / DAY and zero + max(ends) / DAY < known[1]

    @property
    def variables(self) -> list[Variable]:
        """The variables ``year`` and ``julian_date``, and ``date`` if every sample has one."""
        scale = {"time_scale": self.scale}
        found = [
            Variable(
                "year",
                (),
                {"units": "julian_year", "long_name": f"Julian year, {self.scale}", **scale}
                | {"definition": "2000 + (julian_date - 2451545) / 365.25"},
            ),
            Variable(
                "julian_date",
                (),
                {"units": "d", "long_name": f"Julian date, {self.scale}", **scale, "significant_bits": 106},
                2,
            ),
        ]
        if self.has_dates:
            attributes = {
                "units": f"seconds since {self._reference[0]}",
                "calendar": "proleptic_gregorian",
                "standard_name": "time",
                "long_name": f"date, {self.epoch.scale}",
                "time_scale": self.epoch.scale,
            }
            if self.epoch.scale == "UTC":
                attributes["comment"] = "leap seconds aren't counted; samples within one have no date"
            found.append(Variable("date", (), attributes))
        return found

    def of_samples(self, first: int, count: int) -> Columns:
        """Dates of samples first ... first+count-1."""
        times = self.samples.times
        if times is not None:
            return self.of_times(times[first : first + count])
        blocks = range(first // _BLOCK, (first + max(count, 1) - 1) // _BLOCK + 1)
        pieces = [self._grid(block, first, first + count) for block in blocks]
        return self._columns(*(np.concatenate([piece[i] for piece in pieces]) for i in range(3)))

    def of_times(self, times: Sequence[Fraction]) -> Columns:
        """Dates of any times of the scene, s."""
        zero = self.epoch.julian_date()
        dates = [zero + time / DAY for time in times]
        high = np.array([float(date) for date in dates])
        low = np.array(
            [float(date - Fraction(near)) for date, near in zip(dates, high.tolist(), strict=True)]
        )
        return self._columns(high, low, np.array([float(time) for time in times]))

    def _grid(self, block: int, first: int, stop: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Julian dates in two doubles and times (s) of the requested samples of one block."""
        origin = block * _BLOCK
        index = np.arange(max(first - origin, 0), min(stop - origin, _BLOCK), dtype=np.float64)
        begin = self.samples.begin + origin * self.samples.step
        days, seconds = _parts(self.epoch.julian_date() + begin / DAY), _parts(begin)
        high, low = _line(days, self._steps[0], index)
        return high, low, np.add(*_line(seconds, self._steps[1], index))

    @cached_property
    def _steps(self) -> tuple[Parts, Parts]:
        """Sampling interval in days and in seconds; products of two parts with an index are exact."""
        step = self.samples.step
        return _parts(step / DAY, _SPARE), _parts(step, _SPARE)

    def _columns(self, high: np.ndarray, low: np.ndarray, seconds: np.ndarray) -> Columns:
        year = 2000 + ((high - _J2000) + low) / _YEAR
        found = {"year": [year], "julian_date": [high, low]}
        if self.has_dates:
            found["date"] = [self._date(seconds)]
        return found

    @cached_property
    def _reference(self) -> tuple[str, float]:
        """A date and time without fractions to count from, and the seconds from it to time 0."""
        second = 10**14
        whole = min(self.epoch.ticks // second, DAY - 1)
        start = Epoch(self.epoch.scale, self.epoch.day, whole * second)
        return start.calendar().replace("T", " "), float(Fraction(self.epoch.ticks, second) - whole)

    def _date(self, seconds: np.ndarray) -> np.ndarray:
        """Dates from seconds since the reference, none of them a leap second; NaT within one."""
        dates = seconds + self._reference[1]
        if self.epoch.scale != "UTC":
            return dates
        for at, more in self._leaps:
            dates[seconds >= at] -= more
            dates[(seconds >= at - more) & (seconds < at)] = np.nan
        return dates

    @cached_property
    def _leaps(self) -> list[tuple[float, int]]:
        """Times (s) after time 0 from which UTC has counted another second, or one less, with the count."""
        days, offsets, _ = leap_seconds()
        later = [k for k in range(1, len(days)) if days[k] > self.epoch.day]
        zero = self.epoch.julian_date()
        begins = [float((Epoch("UTC", days[k], 0).julian_date() - zero) * DAY) for k in later]
        return [(at, offsets[k] - offsets[k - 1]) for at, k in zip(begins, later, strict=True)]


def _line(base: Parts, step: Parts, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """base + index * step in two doubles, to 2^-104 of the larger part; the index has at most 16 bits."""
    (a0, a1, a2), (b0, b1, b2) = base, step
    high, rest = _sum(a0, index * b0)
    middle, rest_of_middle = _sum(a1, index * b1)
    low, rest_of_low = _sum(rest, middle)
    high, low = _sum(high, low)  # before: the second is up to 2^-36 of the first, whose bits it shares
    return _sum(high, low + ((rest_of_middle + rest_of_low) + (a2 + index * b2)))


def _parts(value: Fraction, spare: int = 0) -> Parts:
    """Three doubles whose sum is close to a value, the first two with ``spare`` low bits zero."""
    parts = []
    for bits in (spare, spare, 0):
        part = float(value)
        if bits and part:
            unit = Fraction(2) ** (int(np.frexp(part)[1]) - 53 + bits)
            part = float(round(value / unit) * unit)
        parts.append(part)
        value -= Fraction(part)
    return parts[0], parts[1], parts[2]


def _sum(a: float | np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rounded sum and its rounding error (Knuth 1969, section 4.2.2, theorem B)."""
    total = a + b
    of_b = total - a
    return total, (a - (total - of_b)) + (b - of_b)
