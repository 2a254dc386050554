"""Growth of errors along a motion: power of time or exponential, and when digits are gone."""

from __future__ import annotations

import math

import numpy as np

UNCERTAIN = 1e-2
"""Error (rad, or relative to the rates) above which a result counts as lost."""


def power_of_time(times: np.ndarray, errors: np.ndarray) -> float:
    """Power of time with which errors grew over the last three quarters."""
    largest = np.maximum.accumulate(errors)
    early = int(np.searchsorted(times, times[-1] / 4))
    if not (0 < largest[early] < math.inf and times[early] < times[-1] and largest[-1] < math.inf):
        return math.inf if largest[-1] > 0 else 0.0
    return float(math.log(largest[-1] / largest[early]) / math.log(times[-1] / times[early]))


def exponential_growth(
    times: np.ndarray, errors: np.ndarray, exponent: int, stable: float, least: float
) -> tuple[float, float | None]:
    """Rate of exponential growth, 1/s, and when digits are gone, seconds after the start; 0 and None if
    growth isn't exponential.

    Args:
        times: times since the start, internal units, whose binary exponent is ``exponent``.
        errors: rad, or relative.
        stable: power of time with which errors of stable motions grow.
        least: power of time up to which growth doesn't count as exponential.
    """
    largest = np.maximum.accumulate(errors)
    gone = int(np.searchsorted(largest, UNCERTAIN))
    last = min(gone, len(times) - 1)
    if last < 2 or power_of_time(times[: last + 1], largest[: last + 1]) < least:
        return 0.0, None
    early = int(np.searchsorted(times, times[last] / 4))
    if not largest[early] > 0:  # errors begin where a load does: they have not grown from anything
        return 0.0, None
    span = math.ldexp(float(times[last] - times[early]), exponent)
    ratio = min(largest[last], 1e300) / largest[early]
    rate = (math.log(ratio) - stable * math.log(times[last] / times[early])) / span
    seconds = math.ldexp(float(times[last]), exponent)
    if rate > 0 and gone >= len(times):
        seconds += math.log(UNCERTAIN / largest[last]) / rate
    return max(rate, 0.0), seconds
