"""Units of angle for tables, figures and exports; datasets hold rad."""

from __future__ import annotations

import math
from dataclasses import dataclass


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
