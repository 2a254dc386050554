"""SI prefixes with which values read well."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_PREFIXES = {0: "", -3: "m", -6: "µ", -9: "n", -12: "p", -15: "f", 3: "k", 6: "M", 9: "G", 12: "T"}


def largest(values: Array) -> float:
    """Largest magnitude of all finite values; 0 if there are none."""
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max(initial=0.0))


def si_scale(values: Array, unit: str) -> tuple[float, str]:
    """Divisor and prefixed unit for values of a plain SI unit such as m or rad/s."""
    size = largest(values)
    if size == 0 or 0.1 <= size < 1e3:
        return 1.0, unit
    exponent = 3 * math.floor(math.log10(size) / 3 + 1e-9)
    if exponent in _PREFIXES:
        return 10.0**exponent, _PREFIXES[exponent] + unit
    return 10.0**exponent, f"1e{exponent} {unit}"
