"""The Earth's pole of date as an expression of time: IAU 1976 precession with the 18.6-year term of nutation.

Precession by Lieske's angles (Lieske et al. 1977, A&A 58, 1); nutation by the largest term of IAU 1980 in
longitude and obliquity, with its values of J2000, in axes that have turned by zeta only: 0.02 arcsec within
a century of J2000, where all other terms are worth up to 1.5 arcsec. In axes of the ecliptic of J2000 it is
turned by the obliquity there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics, seconds
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.space_axes import ECLIPTIC, obliquity, to_ecliptic

_CENTURY = 86400 * 36525  # s
_ARCSEC = 3600 * 180
# arcsec, in powers of centuries since J2000
_ZETA = ("0", "2306.2181", "0.30188", "0.017998")
_THETA = ("0", "2004.3109", "-0.42665", "-0.041833")
_NODE = ("450160.280", "-6962890.539")
"""Mean longitude of the Moon's ascending node."""
_IN_LONGITUDE, _IN_OBLIQUITY, _OBLIQUITY = "-17.1996", "9.2025", "84381.448"


def earth_pole(m: Kinematics, epoch: Epoch, axes: str) -> list[Symbolic]:
    """Unit vector (to 1e-9) along the Earth's axis of figure, in the scene's space axes.

    Args:
        epoch: date of the scene's time 0.
        axes: name of the space axes.
    """
    context = m.scene.context
    unit = m.number(context.one / _CENTURY)
    centuries = unit * seconds(m, since=epoch)

    def arcsec(text: str) -> Any:
        return context.mpf(text) * context.pi / _ARCSEC

    def angle(coefficients: Sequence[str]) -> Symbolic:
        numbers = [m.number(arcsec(x)) for x in coefficients]
        total = hy.expression(numbers[-1])
        for x in reversed(numbers[:-1]):
            total = x + centuries * total
        return total

    zeta, theta, node = map(angle, (_ZETA, _THETA, _NODE))
    (c1, s1), (c2, s2) = ((hy.cos(x), hy.sin(x)) for x in (zeta, theta))
    x = m.number(arcsec(_IN_LONGITUDE) * context.sin(arcsec(_OBLIQUITY))) * hy.sin(node)
    y = m.number(arcsec(_IN_OBLIQUITY)) * hy.cos(node)
    along, across = c1 * x + s1 * y, c1 * y - s1 * x
    radial = c2 * along + s2
    equator = [c1 * radial + s1 * across, c1 * across - s1 * radial, c2 - s2 * along]
    if axes != ECLIPTIC:
        return equator
    c, s = map(m.number, obliquity(context))
    return to_ecliptic(equator, (c, s))
