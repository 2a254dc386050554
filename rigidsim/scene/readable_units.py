"""Units in which numbers read well: of angles, and SI units with prefixes. Datasets hold rad and plain SI."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AngleUnit:
    """A unit of angle.

    Attributes:
        name: as ``--angle-unit`` takes it, and as it appears in column names.
        symbol: as written after a number.
        per_turn: how many make a full turn; None for the radian, which doesn't divide one.
    """

    name: str
    symbol: str
    per_turn: int | None

    @property
    def per_radian(self) -> float:
        """Factor from rad."""
        return 1.0 if self.per_turn is None else self.per_turn / (2 * math.pi)


ANGLE_UNITS: dict[str, AngleUnit] = {
    unit.name: unit
    for unit in (
        AngleUnit("rad", "rad", None),
        AngleUnit("turns", "turns", 1),
        AngleUnit("deg", "°", 360),
        AngleUnit("arcsec", "″", 360 * 3600),
        AngleUnit("mas", "mas", 360 * 3600 * 1000),
    )
}
"""Units by name, the largest first."""

_MANY_TURNS = 20 * math.pi
_SMALL = math.radians(0.1)  # 6'
_TINY = math.radians(0.1 / 3600)
_PREFIXES = {0: "", -3: "m", -6: "µ", -9: "n", -12: "p", -15: "f", 3: "k", 6: "M", 9: "G", 12: "T"}


def angle_unit(size: float) -> AngleUnit:
    """The unit in which angles of a size (rad; the largest of a column, or its range) read best.

    Turns from ten of them on, degrees down to a tenth of one, arcseconds down to a tenth, below that
    milliarcseconds; degrees for zero and for what isn't finite.
    """
    size = abs(size)
    if not math.isfinite(size) or size == 0:
        return ANGLE_UNITS["deg"]
    if size >= _MANY_TURNS:
        return ANGLE_UNITS["turns"]
    if size >= _SMALL:
        return ANGLE_UNITS["deg"]
    return ANGLE_UNITS["arcsec" if size >= _TINY else "mas"]


def largest(values: Array) -> float:
    """Largest magnitude of all finite values; 0 if there are none."""
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def si_scale(values: Array, unit: str) -> tuple[float, str]:
    """Divisor and prefixed unit for values of a plain SI unit such as m or rad/s."""
    size = largest(values)
    if size == 0 or 0.1 <= size < 1e3:
        return 1.0, unit
    exponent = 3 * math.floor(math.log10(size) / 3 + 1e-9)
    if exponent in _PREFIXES:
        return 10.0**exponent, _PREFIXES[exponent] + unit
    return 10.0**exponent, f"1e{exponent} {unit}"
