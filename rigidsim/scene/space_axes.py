"""Named space axes: the equator and the ecliptic of J2000, and the turn between them.

**The Earth's axes** at a date: where its pole and its prime meridian are in the axes of J2000.

The pole is the mean one of date by the precession of IAU 2006 (Capitaine et al. 2003, A&A 412, 567, eqs. 40
and 42), and the Earth turns by its rotation angle (Capitaine et al. 2000, A&A 355, 398). UT1 is taken as UTC,
which is within 0.9 s, 14 arcsec. Nutation (up to 17 arcsec) and polar motion (0.3 arcsec) are left out, too:
altogether the axes are right to a hundredth of a degree, as near the epoch as their pole may be held fixed
(20 arcsec a year).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from types import ModuleType
from typing import Any, Literal

from rigidsim.scene.arithmetic import Matrix, Vector
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import ExactNumber, rounded

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


# --- the Earth's axes ---------------------------------------------------------------------------------------

_J2000 = 2451545  # Julian date
_CENTURY = 36525  # days
# arcsec, in powers of centuries since J2000
_ZETA = ("2.650545", "2306.083227", "0.2988499", "0.01801828")
_Z = ("-2.650545", "2306.077181", "1.0927348", "0.01826837")
_THETA = ("0", "2004.191903", "-0.4294934", "-0.04182264")
_PAST_ANGLE = ("0.014506", "4612.156534", "1.3915817", "-0.00000044")
"""By which mean sidereal time at Greenwich is ahead of the rotation angle."""
_ANGLE, _TURNS = Fraction("0.7790572732640"), Fraction("1.00273781191135448")
"""Rotation angle at J2000, and turns a day of UT1."""


def rotation_rate(context: Any) -> Any:
    """The rate of the rotation angle, rad/s (mpf)."""
    return 2 * context.pi * rounded(_TURNS / 86400, context)


def earth_axes(epoch: Epoch, axes: str, context: Any) -> Matrix:
    """Unit vectors (mpf) towards longitude 0 and 90 deg east on the equator, and to the north pole.

    Args:
        epoch: the date.
        axes: name of the space axes that they are in; EME2000, ICRF and GCRF are taken as the same
            (they are 0.02 arcsec apart).

    Raises:
        ValueError: a date before 1960, when UTC began.
    """
    days = epoch.universal_date() - _J2000
    centuries = (epoch.uniform().julian_date() - _J2000) / _CENTURY

    def angle(coefficients: Sequence[str]) -> Any:
        total = sum((Fraction(x) * centuries**n for n, x in enumerate(coefficients)), Fraction(0))
        return rounded(total / (3600 * 180), context) * context.pi

    turned = (_ANGLE + _TURNS * days) % 1
    meridian = 2 * context.pi * rounded(turned, context) + angle(_PAST_ANGLE) - angle(_Z)
    matrix = [[context.mpf(i == k) for k in range(3)] for i in range(3)]
    for about, by in ((2, -angle(_ZETA)), (1, angle(_THETA)), (2, meridian)):
        matrix = _turned(matrix, about, by, context)
    if axes != ECLIPTIC:
        return matrix
    return [to_ecliptic(row, obliquity(context)) for row in matrix]


def _turned(matrix: Matrix, about: int, angle: Any, context: Any) -> Matrix:
    """Axes (rows) turned by an angle about one of them."""
    first, second = (about + 1) % 3, (about + 2) % 3
    c, s = context.cos(angle), context.sin(angle)
    found = list(matrix)
    pairs = list(zip(matrix[first], matrix[second], strict=True))
    found[first] = [c * a + s * b for a, b in pairs]
    found[second] = [c * b - s * a for a, b in pairs]
    return found
