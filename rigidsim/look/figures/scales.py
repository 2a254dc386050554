"""Readable units of axes: time, prefixed SI units, and deg to microarcseconds for angles."""

import math
from dataclasses import dataclass

import numpy as np
import xarray

from rigidsim.look.solids import Array
from rigidsim.scene.epochs import J2000
from rigidsim.scene.readable import (
    ANGLE_UNITS,
    YEAR,
    TimeUnit,
    angle_unit,
    epoch_of,
    julian_year,
    largest,
    si_scale,
    unit_of,
)

__all__ = ["TimeAxis", "angle_scale", "angle_text", "number", "si_scale", "time_axis_of"]


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


@dataclass(frozen=True)
class TimeAxis:
    """Times along an axis: their unit, its label, and the number that stands for time 0."""

    unit: TimeUnit
    label: str
    origin: float = 0.0

    def numbers(self, seconds: Array) -> Array:
        """Numbers along the axis for times of the scene, s."""
        return np.asarray(self.origin + np.asarray(seconds) / self.unit.seconds, dtype=np.float64)


def time_axis_of(dataset: xarray.Dataset) -> TimeAxis:
    """The axis for a dataset's times: years of the calendar, time since the epoch, or time alone."""
    ends = [float(dataset["time"][i]) for i in (0, -1)] if dataset.sizes["time"] else [0.0]
    unit = unit_of(dataset.attrs, max(map(abs, ends)))
    epoch = epoch_of(dataset.attrs)
    if epoch is None:
        return TimeAxis(unit, f"time [{unit.symbol}]")
    if unit.seconds == YEAR:
        return TimeAxis(unit, f"year ({epoch.uniform().scale})", julian_year(epoch))
    since = "J2000" if epoch == J2000 else str(epoch)
    return TimeAxis(unit, f"time since {since} [{unit.symbol}]")
