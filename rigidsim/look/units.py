"""Units in which people read numbers of a dataset: one rule for axes, keys, tables and pages."""

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray

from rigidsim.look.solids import Array
from rigidsim.scene import readable
from rigidsim.scene.epochs import J2000
from rigidsim.scene.readable import ANGLE_UNITS, DAY, YEAR, TimeUnit, angle_unit, unit_for

_MAS = math.pi / 180 / 3600e3
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_PREFIXED = ("rad/s", "m", "m/s")
_SOME_MINUTES = 300.0  # s, up to which a clock counts seconds


def pretty_unit(unit: str) -> str:
    """A unit as people write it: `kg m2 s-1` (UDUNITS) and `kg m^2/s` both give `kg m²/s`."""
    above: list[str] = []
    below: list[str] = []
    top, *bottom = unit.split("/")
    for part in (top, *bottom):
        for base, power in re.findall(r"([^\W\d_]+|1)\^?(-?\d+)?", part):
            exponent = int(power or 1) * (1 if part is top else -1)
            digits = str(abs(exponent)).translate(_SUPERSCRIPTS) if abs(exponent) != 1 else ""
            if base != "1":
                (above if exponent > 0 else below).append(base + digits)
    numerator = " ".join(above) or ("1" if below else "")
    return "/".join([numerator, *below])


def with_unit(text: str, unit: str) -> str:
    """A name and a unit of ``scaled``; without a unit the name alone."""
    return f"{text} [{unit}]" if unit else text


def scaled(values: Array, unit: str, attributes: Mapping[str, Any] | None = None) -> tuple[float, str]:
    """Divisor and name of the unit in which values read best: prefixes for rates and lengths, degrees,
    arcseconds, mas and less for angles, and with a run's attributes its unit of time: for times, and for
    rates, which are then angles a day or a year.
    """
    unit = pretty_unit(unit)
    if unit == "rad":
        return angle_scale(values)
    if attributes is not None and unit in ("s", "rad/s"):
        size = readable.largest(values)
        time = readable.unit_of(attributes, size if unit == "s" else 0.0)
        if unit == "s":
            return time.seconds, time.symbol
        if time.seconds >= DAY:
            divisor, name = angle_scale(values * time.seconds)
            return divisor / time.seconds, f"{name}/{time.symbol}"
    return readable.si_scale(values, unit) if unit in _PREFIXED else (1.0, unit)


def angle_scale(values: Array) -> tuple[float, str]:
    """Divisor and unit for angles in rad: deg, arcsec and mas as in tables, and µas and less below."""
    size = readable.largest(values)
    unit = angle_unit(size)
    if unit.name == "turns":
        unit = ANGLE_UNITS["deg"]
    if 0 < size < 0.1 * _MAS:
        exponent = 3 * math.floor(math.log10(size / _MAS) / 3 + 1e-9)
        return _MAS * 10.0**exponent, {-3: "µas", -6: "nas"}.get(exponent, f"1e{exponent} mas")
    return 1 / unit.per_radian, unit.name


def angle_text(value: float, digits: int = 4, *, like: float | None = None) -> str:
    """An angle in rad with its unit, or another's unit: ``206.3 mas``, ``23.44°``."""
    divisor, unit = angle_scale(np.array([value if like is None else like]))
    symbol = ANGLE_UNITS[unit].symbol if unit in ANGLE_UNITS else unit
    return f"{number(value / divisor, digits)}{'' if symbol in '°″' else ' '}{symbol}"


def turning_text(rate: float) -> str:
    """A rate (rad/s) as turns per unit of time, chosen so that the number isn't tiny: ``0.6702 turns/s``."""
    unit = unit_for(40 * math.pi / rate if rate else 0.0)
    return f"{number(rate * unit.seconds / (2 * math.pi))} turns/{unit.symbol}"


def number(value: float, digits: int = 4) -> str:
    """A number to so many digits, with a true minus sign and no exponent where that is short."""
    text = f"{value:.{digits}g}"
    if "e" in text and 1e-4 <= abs(value) < 1e6:
        text = f"{value:.0f}"
    return text.replace("-", "−")


def clock(dataset: xarray.Dataset) -> tuple[Array, TimeUnit, str]:
    """Sample times as an axis shows them, their unit, and its label: years of the calendar, or time, in
    seconds up to five minutes unless the config has a unit.
    """
    seconds = np.asarray(dataset["time"].values, dtype=np.float64)
    span = max(abs(float(seconds[0])), abs(float(seconds[-1])))
    unit = readable.unit_of(dataset.attrs, span if span > _SOME_MINUTES else min(span, 1.0))
    time, epoch = seconds / unit.seconds, readable.epoch_of(dataset.attrs)
    if epoch is None:
        return time, unit, f"time [{unit.symbol}]"
    if unit.seconds == YEAR:
        return readable.julian_year(epoch) + time, unit, f"year ({epoch.uniform().scale})"
    return time, unit, f"time since {'J2000' if epoch == J2000 else epoch} [{unit.symbol}]"
