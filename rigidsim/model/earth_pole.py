"""The Earth's pole of date as an expression of time: IAU 1976 precession with the 18.6-year term of nutation.

Precession by Lieske's angles (Lieske et al. 1977, A&A 58, 1), nutation by the largest term of IAU 1980 in
longitude and obliquity (Wahr 1981): within 1.5 arcsec of the pole of IAU 1980 in all. In axes of the
ecliptic of J2000 it is turned by the obliquity there.
"""

from __future__ import annotations

from collections.abc import Sequence

import heyoka as hy

from rigidsim.model.kinematics import Kinematics, seconds
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.frame import ECLIPTIC, OBLIQUITY

_CENTURY = 86400 * 36525  # s
_ARCSEC = 3600 * 180
# arcsec, in powers of centuries since J2000
_ZETA = ("0", "2306.2181", "0.30188", "0.017998")
_Z = ("0", "2306.2181", "1.09468", "0.018203")
_THETA = ("0", "2004.3109", "-0.42665", "-0.041833")
_NODE = ("450160.280", "-6962890.539", "7.455", "0.008")
"""Mean longitude of the Moon's ascending node."""
_IN_LONGITUDE = ("-17.1996", "-0.01742")
_IN_OBLIQUITY = ("9.2025", "0.00089")
_MEAN_OBLIQUITY = ("84381.448", "-46.8150")


def earth_pole(m: Kinematics, epoch: Epoch, axes: str) -> list[Symbolic]:
    """Unit vector (to 1e-9) along the Earth's axis of figure, in the scene's space axes.

    Args:
        epoch: date of the scene's time 0.
        axes: name of the space axes.
    """
    context = m.scene.context
    unit = m.number(context.one / _CENTURY)
    centuries = unit * seconds(m, since=epoch)

    def angle(coefficients: Sequence[str]) -> Symbolic:
        numbers = [m.number(context.mpf(x) * context.pi / _ARCSEC) for x in coefficients]
        total = hy.expression(numbers[-1])
        for x in reversed(numbers[:-1]):
            total = x + centuries * total
        return total

    zeta, z, theta, node, tilt = map(angle, (_ZETA, _Z, _THETA, _NODE, _MEAN_OBLIQUITY))
    (c1, s1), (c2, s2), (c3, s3) = ((hy.cos(x), hy.sin(x)) for x in (zeta, z, theta))
    x = angle(_IN_LONGITUDE) * hy.sin(node) * hy.sin(tilt)
    y = angle(_IN_OBLIQUITY) * hy.cos(node)
    along = c2 * x + s2 * y  # the mean axes of date are turned by z about their pole
    across = c2 * y - s2 * x
    radial = c3 * along + s3
    equator = [c1 * radial + s1 * across, c1 * across - s1 * radial, c3 - s3 * along]
    if axes != ECLIPTIC:
        return equator
    c, s = (m.number(f(OBLIQUITY.at(context))) for f in (context.cos, context.sin))
    x, y, z = equator
    return [x, c * y + s * z, c * z - s * y]
