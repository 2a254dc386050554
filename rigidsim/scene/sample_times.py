"""``[time]``: the sample times of a scene, a grid or a list, kept exactly as written."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, partial
from itertools import pairwise
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Discriminator, Field, StrictInt, StrictStr, Tag

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.exact import ZERO, rounded
from rigidsim.scene.fields import (
    NAME_OR_VECTOR,
    Beside,
    ConfigTable,
    Instant,
    Positive,
    Rule,
    Second,
    TimeUnitName,
    one_of,
)

_MOST_SAMPLES = 10**12
_BITS, _MOST_BITS = 53, 1000  # of a significand, and of a denominator above which doubles lose digits


class Time(ConfigTable):
    """``[time]``: where the samples lie; one of ``samples``, ``every`` and ``times``; what time 0 is, and
    the unit that times are shown in.
    """

    rules: ClassVar[tuple[Rule, ...]] = (
        one_of("samples", "every", "times", least=0, why="--set time.KEY= removes one"),
    )

    start: Second = ZERO
    """start of the run, to which [initial] refers"""
    end: Second | None = Field(None, examples=[1000.0, "10 yr"])
    """end of the run; with samples or every. Before start, the run goes backwards in time"""
    samples: StrictInt | None = Field(None, examples=[10001])
    """number of samples, equally spaced from start to end, both included"""
    every: Positive[Second] | None = Field(None, examples=[0.1, "1 day"])
    """interval between samples, instead of samples; above zero, backwards too"""
    times: (
        Annotated[
            Annotated[StrictStr, Beside("times"), Tag(NAME_OR_VECTOR[0])]
            | Annotated[list[Second], Tag(NAME_OR_VECTOR[1])],
            Discriminator(lambda given: NAME_OR_VECTOR[0 if isinstance(given, str) else 1]),
        ]
        | None
    ) = Field(None, examples=[[0, 1, 10, 100], "theirs.csv"])
    """sample times from start on, instead of end; or a CSV file next to the config with a column t or time"""
    epoch: Instant | None = Field(None, examples=["J2000", "2029-04-13T21:46:00 TDB"])
    """date of time 0, in TDB, TT, TAI, GPS or UTC; 2029-04-13T21:46:00Z, with or without quotes, is UTC"""
    unit: TimeUnitName | None = Field(None, examples=["day"])
    """unit in which times are displayed, such as day, yr or kyr; bare numbers in the config remain seconds"""


@dataclass(frozen=True)
class SampleTimes:
    """Exact sample times, s: ``begin + i * step``, or a list (with step zero) of times from ``begin`` on:
    they descend if the run goes backwards.
    """

    begin: Fraction
    step: Fraction
    times: tuple[Fraction, ...] | None
    count: int
    context: Any

    @classmethod
    def listed(cls, begin: Fraction, times: Sequence[Fraction], context: Any) -> SampleTimes:
        """Sample times given as a list."""
        return cls(begin, Fraction(0), tuple(times), len(times), context)

    @property
    def exact_last(self) -> Fraction:
        """Time of the last sample."""
        return self.times[-1] if self.times is not None else self.begin + self.step * (self.count - 1)

    @property
    def direction(self) -> int:
        """1 for a run that goes forwards in time, -1 for one that goes backwards."""
        return -1 if self.exact_last < self.begin else 1

    @property
    def start(self) -> Any:
        """Start of the motion (mpf), s."""
        return rounded(self.begin, self.context)

    @property
    def last(self) -> Any:
        """Time of the last sample (mpf)."""
        return rounded(self.exact_last, self.context)

    @cached_property
    def doubles(self) -> np.ndarray:
        """The doubles nearest to the times of a list."""
        assert self.times is not None
        return _doubles(self.times)

    @cached_property
    def largest_spacing(self) -> float:
        """Largest spacing of neighbouring samples, s."""
        if self.times is None:
            return abs(float(self.step))
        if all(map(_is_double, self.times)):  # of which a difference is rounded once, too
            return float(np.abs(np.diff(self.doubles)).max(initial=0.0))
        return max((abs(float(b - a)) for a, b in pairwise(self.times)), default=0.0)


def _is_double(time: Fraction) -> bool:
    whole = time.denominator
    return (
        whole & (whole - 1) == 0 and time.numerator.bit_length() <= _BITS and whole.bit_length() < _MOST_BITS
    )


def _doubles(times: Sequence[Fraction]) -> np.ndarray:
    """The doubles nearest to times, those beyond all doubles infinite."""
    return np.array(list(map(_double, times)))


def _double(time: Fraction) -> float:
    try:
        return time.numerator / time.denominator
    except OverflowError:
        return math.copysign(math.inf, time)


def _listed(table: Time, context: Any, texts: Mapping[str, str]) -> list[Fraction]:
    """Times of an array, or of the table of that name."""
    given = table.times
    assert given is not None
    if not isinstance(given, str):
        return [time.fraction(context) for time in given]
    from rigidsim.scene.text_tables import text_of, times_in  # which few configs need

    text = text_of(texts, given, partial(_fail, "times"))
    try:
        return times_in(text, context, table.epoch)
    except ValueError as error:
        raise _fail("times", f'given "{given}": {error}') from None


def sample_times(table: Time, context: Any, texts: Mapping[str, str]) -> tuple[Any, Any, SampleTimes]:
    """Start and end of the motion (s, mpf) and the sample times from a config's ``[time]``.

    Args:
        texts: of tables, by name.
    """

    def shortly(time: Fraction, digits: int = 12) -> str:
        return str(context.nstr(rounded(time, context), digits))

    start = table.start.fraction(context)
    if table.times is not None:
        times = _listed(table, context, texts)
        if not times:
            raise _fail("times", "given an empty array; at least one time is needed")
        end = table.end.fraction(context) if table.end is not None else times[-1]
        way, order = (-1, "decrease") if end < start else (1, "increase")
        whole = [start, *times, end]
        doubles = way * _doubles(whole)
        # rounding to doubles keeps order, so that only equal ones need a closer look
        for i in np.flatnonzero(~(doubles[1:] > doubles[:-1])).tolist():
            a, b = whole[i], whole[i + 1]
            if way * b < way * a or (a == b and 0 < i < len(times)):
                what = f"{shortly(b)} s after {shortly(a)} s; times must {order}, from start to end"
                raise _fail(f"times[{min(i, len(times) - 1)}]", f"given {what}")
        return rounded(start, context), rounded(end, context), SampleTimes.listed(start, times, context)
    if table.end is None:
        raise _fail("end", "missing; it must be given, unless times are")
    end = table.end.fraction(context)
    if end == start:
        what = f"given {shortly(end)} s, which is start; a later time, or an earlier one, is allowed"
        raise _fail("end", what)
    if table.every is not None:
        step = table.every.fraction(context)
        irrational = any(t is not None and t.pi_power for t in (table.start, table.end, table.every))
        slack = Fraction(1, 2**100) if irrational else 0  # an end on the grid is a sample, rounded or not
        intervals = math.floor(abs(end - start) / step + slack)
        step = step if end > start else -step
    else:
        intervals = 1000 if table.samples is None else table.samples - 1
        step = (end - start) / (intervals or 1)
    if not 1 <= intervals < _MOST_SAMPLES:
        key, count = "samples" if table.every is None else "every", shortly(Fraction(intervals + 1), 8)
        raise _fail(key, f"makes {count} samples of the run; 2 (at start and end) to 1e12 are allowed")
    samples = SampleTimes(start, step, None, intervals + 1, context)
    return rounded(start, context), rounded(end, context), samples


def _fail(key: str, text: str) -> ConfigError:
    return ConfigError(Problem(f"[time] {key}", text))
