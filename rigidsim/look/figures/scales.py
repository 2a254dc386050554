"""Readable units of axes: prefixed SI units, and deg to microarcseconds for angles."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rigidsim.look.angle_units import ANGLE_UNITS, angle_unit
from rigidsim.look.si_prefixes import largest, si_scale

__all__ = ["angle_scale", "angle_text", "largest", "number", "si_scale"]

Array = NDArray[np.float64]

_MAS = math.pi / 180 / 3600e3


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
