"""Conversion of float64 seconds to the viewer's integer timelines.

rerun keeps times as int64 nanoseconds. A float given to it is truncated, steps below 1 ns vanish
and beyond 292 years it wraps, so the integers are built and checked here. Where nanoseconds don't
fit, the timeline is a plain sequence whose name says its unit.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigidsim.scene.readable import DAY, YEAR

_LARGEST = 2.0**62  # int64 with room for differences and for the viewer's own sentinels
_LARGEST_NANOSECONDS = 9.2e18  # 291.5 years, just below 2**63 ns
_UNITS = {0: "s", -3: "ms", -6: "µs", -9: "ns", -12: "ps", -15: "fs", -18: "as"}
_WHOLE = (("yr", YEAR), ("d", DAY))
_EXACT = 4 * np.finfo(np.float64).eps
_RESOLUTION = 1e-3  # of the smallest step: what a tick of the timeline may be at most


@dataclass(frozen=True)
class Clock:
    """Times of the rows as integers (rows,) of a viewer timeline: a duration in nanoseconds, or a sequence of
    another tick, which the timeline's name says.
    """

    name: str
    ticks: NDArray[np.int64]
    seconds_per_tick: float
    duration: bool


def build_clock(seconds: NDArray[np.float64]) -> Clock:
    """The clock for sample times `seconds` (rows,).

    Nanoseconds are taken when the run stays within 291 years and either every time is a whole
    number of nanoseconds or the smallest step has at least 1000 of them. Otherwise, where every time is a
    whole number of years or days, the tick is that: the viewer's axes are read then. Else it is the power of
    1000 seconds that resolves the smallest step to 1e-3, or as close to that as 62 bits allow.

    Raises:
        ValueError: a time that isn't finite.
    """
    times = np.asarray(seconds, dtype=np.float64)
    if not np.isfinite(times).all():
        raise ValueError("time: every sample time must be finite")
    largest = float(np.abs(times).max(initial=0.0))
    steps = np.abs(np.diff(times))
    steps = steps[steps > 0]
    smallest = float(steps.min()) if len(steps) else max(largest, 1.0)

    if largest < _LARGEST_NANOSECONDS * 1e-9 and smallest >= 1e-9 * (1 - 1e-6):
        # Whole seconds apart, so that t*1e9 isn't rounded to float64 once more beyond 104 days.
        floor = np.floor(times)
        part = np.rint((times - floor) * 1e9)
        ticks = floor.astype(np.int64) * 1_000_000_000 + part.astype(np.int64)
        exact = bool((np.abs(ticks * 1e-9 - times) <= _EXACT * np.abs(times)).all())
        if smallest * _RESOLUTION >= 1e-9 or exact:
            return Clock("time", ticks, 1e-9, True)

    for symbol, unit in _WHOLE:
        whole = np.rint(times / unit)
        exact = bool((np.abs(times - whole * unit) <= _EXACT * np.abs(times)).all())
        if exact and unit <= smallest and largest / unit < 2.0**53:
            return Clock(f"time [{symbol}]", whole.astype(np.int64), unit, False)
    exponent = 3 * math.floor(math.log10(smallest * _RESOLUTION * (1 + 1e-9)) / 3)
    while largest / 10.0**exponent > _LARGEST:
        exponent += 3
    # Powers of ten to 22 are exact in float64, their reciprocals aren't: multiply or divide.
    scaled = times * 10.0**-exponent if exponent < 0 else times / 10.0**exponent
    name = f"time [{_UNITS.get(exponent, f'1e{exponent} s')}]"
    return Clock(name, np.rint(scaled).astype(np.int64), 10.0**exponent, False)
