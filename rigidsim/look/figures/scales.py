"""The unit in which an axis reads well: prefixes of SI units, and deg to microarcseconds for angles."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rigidsim.look.angle_units import ANGLE_UNITS, angle_unit

Array = NDArray[np.float64]

_PREFIXES = {0: "", -3: "m", -6: "µ", -9: "n", -12: "p", -15: "f", 3: "k", 6: "M", 9: "G", 12: "T"}
_MAS = math.pi / 180 / 3600e3


def largest(values: Array) -> float:
    """Largest magnitude of all finite values, 0 where there are none."""
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


def angle_scale(values: Array) -> tuple[float, str]:
    """Divisor and unit for angles in rad: deg, arcsec and mas as in tables, and µas and less below."""
    unit, size = angle_unit(largest(values)), largest(values)
    if unit.name == "turns":
        unit = ANGLE_UNITS["deg"]
    if 0 < size < 0.1 * _MAS:
        exponent = 3 * math.floor(math.log10(size / _MAS) / 3 + 1e-9)
        return _MAS * 10.0**exponent, {-3: "µas", -6: "nas"}.get(exponent, f"1e{exponent} mas")
    return 1 / unit.per_radian, unit.name


def angle_text(value: float, digits: int = 4) -> str:
    """An angle in rad with its unit: ``206.3 mas``, ``23.44°``."""
    scale, unit = angle_scale(np.array([value]))
    text = number(value / scale, digits)
    symbol = ANGLE_UNITS[unit].symbol if unit in ANGLE_UNITS else unit
    return f"{text}{'' if symbol in '°″' else ' '}{symbol}"


def number(value: float, digits: int = 4) -> str:
    """A number to so many digits, with a true minus sign and no exponent where that is short."""
    text = f"{value:.{digits}g}"
    if "e" in text and 1e-4 <= abs(value) < 1e6:
        text = f"{value:.0f}"
    return text.replace("-", "−")
