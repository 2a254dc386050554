"""Panels of figures: what one needs of a dataset, how it is drawn, and units in which its axes read well."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes

from rigidsim.look import signals
from rigidsim.look.solids import Array
from rigidsim.scene import readable
from rigidsim.scene.epochs import J2000
from rigidsim.scene.readable import ANGLE_UNITS, YEAR, TimeUnit, angle_unit

Find = Callable[[xarray.Dataset], Any]
Draw = Callable[[Axes, xarray.Dataset, Any], None]


@dataclass(frozen=True)
class Panel:
    """A panel: `find` gives what it draws of a dataset in memory, or None; `draw_found` draws that on axes,
    with title, labels and units. One that `begins` shows only the start if the whole would be a solid band.
    """

    find: Find
    draw_found: Draw
    begins: bool = False

    def shows(self, rows: xarray.Dataset) -> bool:
        """Whether a dataset (in memory) has something for it."""
        return self.find(rows) is not None

    def draw(self, axes: Axes, rows: xarray.Dataset) -> None:
        """Draw what a dataset that it shows has for it."""
        self.draw_found(axes, rows, self.find(rows))


def panel(find: Find, *, begins: bool = False) -> Callable[[Draw], Panel]:
    """Declare a panel: the function below draws what ``find`` finds. See ``Panel``."""
    return lambda draw: Panel(find, draw, begins)


def recorded(*names: str) -> Find:
    """The first of these variables that was recorded along time."""

    def find(dataset: xarray.Dataset) -> Any:
        tables = (signals.values(dataset, name) for name in names)
        return next((table for table in tables if table is not None), None)

    return find


_MAS = math.pi / 180 / 3600e3


def angle_scale(values: Array) -> tuple[float, str]:
    """Divisor and unit for angles in rad: deg, arcsec and mas as in tables, and µas and less below."""
    unit, size = angle_unit(readable.largest(values)), readable.largest(values)
    if unit.name == "turns":
        unit = ANGLE_UNITS["deg"]
    if 0 < size < 0.1 * _MAS:
        exponent = 3 * math.floor(math.log10(size / _MAS) / 3 + 1e-9)
        return _MAS * 10.0**exponent, {-3: "µas", -6: "nas"}.get(exponent, f"1e{exponent} mas")
    return 1 / unit.per_radian, unit.name


def angle_text(value: float, digits: int = 4, *, like: float | None = None) -> str:
    """An angle in rad with its unit, or that of another: ``206.3 mas``, ``23.44°``."""
    scale, unit = angle_scale(np.array([value if like is None else like]))
    text = number(value / scale, digits)
    symbol = ANGLE_UNITS[unit].symbol if unit in ANGLE_UNITS else unit
    return f"{text}{'' if symbol in '°″' else ' '}{symbol}"


def number(value: float, digits: int = 4) -> str:
    """A number to so many digits, with a true minus sign and no exponent where that is short."""
    text = f"{value:.{digits}g}"
    if "e" in text and 1e-4 <= abs(value) < 1e6:
        text = f"{value:.0f}"
    return text.replace("-", "−")


def clock(dataset: xarray.Dataset) -> tuple[Array, TimeUnit, str]:
    """Sample times as an axis shows them, their unit, and its label: years of the calendar, or time."""
    seconds = signals.seconds(dataset)
    unit = readable.unit_of(dataset.attrs, max(abs(float(seconds[0])), abs(float(seconds[-1]))))
    time, epoch = seconds / unit.seconds, readable.epoch_of(dataset.attrs)
    if epoch is None:
        return time, unit, f"time [{unit.symbol}]"
    if unit.seconds == YEAR:
        return readable.julian_year(epoch) + time, unit, f"year ({epoch.uniform().scale})"
    return time, unit, f"time since {'J2000' if epoch == J2000 else epoch} [{unit.symbol}]"
