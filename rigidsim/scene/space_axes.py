"""Named space axes: the equator and the ecliptic of J2000, and the turn between them."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from types import ModuleType
from typing import Any, Literal

from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.exact import ExactNumber

SpaceAxes = Literal["EME2000", "ICRF", "GCRF", "ecliptic J2000"]
ECLIPTIC: SpaceAxes = "ecliptic J2000"
"""Mean ecliptic and equinox of J2000: the axes of the ephemerides."""
EQUATOR: SpaceAxes = "EME2000"
"""Mean equator and equinox of J2000: the ecliptic's, turned about their common X axis, the equinox."""
ICRF: SpaceAxes = "ICRF"
CELESTIAL = (ICRF, "GCRF")
"""Axes of one orientation, 0.02 arcsec from the axes ``EQUATOR``."""
OBLIQUITY = ExactNumber(Fraction(84381406, 1000 * 3600 * 180), pi_power=1)
"""Angle (rad) from the equator to the ecliptic of J2000, 84381.406 arcsec: IAU 2006 (resolution B1, the P03
precession of Capitaine et al. 2003, A&A 412, 567).
"""


def obliquity(functions: Any, part: int = 1) -> tuple[Any, Any]:
    """Cosine and sine of the obliquity, or of a part of it, by an mpmath context's functions or numpy's."""
    angle = (float(OBLIQUITY) if isinstance(functions, ModuleType) else OBLIQUITY.at(functions)) / part
    return functions.cos(angle), functions.sin(angle)


def to_ecliptic(vector: Sequence[Any], turn: tuple[Any, Any]) -> Vector:
    """Coordinates along the ecliptic's axes of a vector along the equator's; ``turn`` as of ``obliquity``."""
    (x, y, z), (c, s) = vector, turn
    return [x, c * y + s * z, c * z - s * y]


def to_equator(vector: Sequence[Any], turn: tuple[Any, Any]) -> Vector:
    """The inverse."""
    (x, y, z), (c, s) = vector, turn
    return [x, c * y - s * z, s * y + c * z]


def from_equator(axes: str | None, functions: Any) -> Vector:
    """Quaternion that takes coordinates along the equator's axes to those along other axes."""
    c, s = obliquity(functions, 2)
    if axes != ECLIPTIC:
        c, s = 0 * c + 1, 0 * s
    return [c, -s, 0 * c, 0 * c]
