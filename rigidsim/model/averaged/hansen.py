"""Hansen coefficients: harmonics in the mean anomaly of the tide along a Kepler orbit.

    X_k^{-3,m}(e) = <(a/r)^3 exp i (m f - k M)> = (1/2 pi) integral of cos(m f - k M) / (1 - e cos E)^2 dE

over a turn of the eccentric anomaly E (Hansen 1855; Plummer 1918, section 44). X_{2p}^{-3,2} is H(p, e) of
Goldreich & Peale 1966 (Astronomical Journal 71, 425). The integrand is periodic and analytic, so that the
trapezoidal rule converges geometrically.
"""

from __future__ import annotations

from typing import Any

_FIRST, _MOST = 32, 1 << 16  # points


def hansen(context: Any, eccentricity: Any, multiple: int, order: int) -> Any:
    """X_k^{-3,m} (mpf), to the context's precision.

    Args:
        eccentricity: 0 to below 1 (mpf).
        multiple: k.
        order: m.
    """
    if eccentricity == 0:
        return context.one if multiple == order else context.zero
    points = _FIRST
    before = _sum(context, eccentricity, multiple, order, points, 0)
    while points < _MOST:
        found = (before + _sum(context, eccentricity, multiple, order, points, 1)) / 2
        points *= 2
        if abs(found - before) <= context.ldexp(1, 8 - context.prec):
            return found
        before = found
    return before


def _sum(context: Any, e: Any, multiple: int, order: int, points: int, half: int) -> Any:
    """Mean over equally spaced points, or over the midpoints between them."""
    root, total = context.sqrt(1 - e * e), context.zero
    for i in range(points):
        anomaly = 2 * context.pi * (2 * i + half) / (2 * points)
        c, s = context.cos(anomaly), context.sin(anomaly)
        radius = 1 - e * c
        true = context.atan2(root * s, c - e)
        total += context.cos(order * true - multiple * (anomaly - e * s)) / radius**2
    return total / points
