"""Periods and precession of rigid bodies by elliptic integrals, in the current mpmath precision.

Free asymmetric top: Whittaker, Analytical Dynamics, section 69; Landau & Lifshitz, Mechanics, section 37.
Heavy symmetric top: Whittaker, section 71; Landau & Lifshitz, section 35, problem 1. Nothing of rigidsim is
used.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mpmath


@dataclass(frozen=True)
class FreeTop:
    """An asymmetric top without torque.

    Attributes:
        i1, i2, i3: principal moments; L circles axis 3, the largest or smallest; axis 2 is the middle one.
        momentum: abs(L).
        p: rate of the elliptic functions' argument.
        m: their parameter, below 1; the separatrix is at 1.
        complement: 1 - m, with all its digits next to the separatrix.
    """

    i1: Any
    i2: Any
    i3: Any
    momentum: Any
    p: Any
    m: Any
    complement: Any

    @property
    def flip(self) -> Any:
        """Time between two reversals of the rate about the middle axis: 2 K / p."""
        return 2 * mpmath.ellipk(self.m) / self.p

    @property
    def period(self) -> Any:
        """Of the body rates, 4 K / p."""
        return 2 * self.flip

    @property
    def precession(self) -> Any:
        """Mean rate at which axis 3 goes round L in space: L/I3 + L (1/I1 - 1/I3) Pi(n; k) / K."""
        n = self.i3 * (self.i2 - self.i1) / (self.i1 * (self.i2 - self.i3))
        share = mpmath.ellippi(n, self.m) / mpmath.ellipk(self.m)
        return self.momentum * (1 / self.i3 + (1 / self.i1 - 1 / self.i3) * share)


def free_top(moments: Sequence[Any], rates: Sequence[Any]) -> FreeTop:
    """The motion that starts with these rates (principal axes), of a body of three different moments."""
    pairs = sorted(zip(map(mpmath.mpf, moments), map(mpmath.mpf, rates), strict=True))
    with mpmath.extradps(mpmath.mp.dps):  # for small differences next to the separatrix
        twice = sum(i * w * w for i, w in pairs)
        square = sum((i * w) ** 2 for i, w in pairs)
        if square < twice * pairs[1][0]:
            pairs.reverse()
        i1, i2, i3 = (i for i, _ in pairs)
        scale = (square - twice * i1) * (i3 - i2)
        m = (square - twice * i3) * (i1 - i2) / scale
        complement = (square - twice * i2) * (i3 - i1) / scale
        return FreeTop(i1, i2, i3, mpmath.sqrt(square), mpmath.sqrt(scale / (i1 * i2 * i3)), m, complement)


@dataclass(frozen=True)
class HeavyTop:
    """A symmetric top on a fixed tip under gravity; u = cos(tilt).

    Attributes:
        a: moment across the axis, about the tip.
        axial, vertical: components of L along the top's axis and along the vertical.
        u1, u2, u3: roots of u'^2 = f(u): the tilt swings between u1 <= u2, and u3 >= 1.
        p: rate of the elliptic functions' argument.
    """

    a: Any
    axial: Any
    vertical: Any
    u1: Any
    u2: Any
    u3: Any
    p: Any

    @property
    def m(self) -> Any:
        """Parameter of the elliptic functions."""
        return (self.u2 - self.u1) / (self.u3 - self.u1)

    @property
    def nutation(self) -> Any:
        """Period of the tilt, 2 K / p."""
        return 2 * mpmath.ellipk(self.m) / self.p

    def _means(self) -> tuple[Any, Any]:
        """Of the parts of A phi' = (L_Z - L_z u)/(1 - u^2) with 1 - u and with 1 + u below."""
        swing, k = self.u2 - self.u1, mpmath.ellipk(self.m)
        below = mpmath.ellippi(swing / (1 - self.u1), self.m) / (k * (1 - self.u1))
        above = mpmath.ellippi(-swing / (1 + self.u1), self.m) / (k * (1 + self.u1))
        return (self.vertical - self.axial) / 2 * below, (self.vertical + self.axial) / 2 * above

    @property
    def precession(self) -> Any:
        """Mean rate of phi, the azimuth."""
        return sum(self._means()) / self.a

    @property
    def turning(self) -> Any:
        """Mean of phi' u, by which the rate about the top's axis exceeds that of psi."""
        below, above = self._means()
        return (self.axial + below - above) / self.a


def heavy_top(a: Any, c: Any, mu: Any, theta: Any, rates: Sequence[Any]) -> HeavyTop:
    """The motion that starts at tilt ``theta`` (phi = psi = 0) with these body rates.

    Args:
        a, c: moments across and along the axis, about the tip.
        mu: mass * gravity * distance of the centre of mass.
        theta: initial tilt, rad.
        rates: initial angular velocity, body axes; with psi = 0 these are theta', phi' sin(theta), w3.
    """
    with mpmath.extradps(mpmath.mp.dps):  # double roots keep half the digits
        w1, w2, w3 = map(mpmath.mpf, rates)
        axial, u = c * w3, mpmath.cos(theta)
        vertical = a * w2 * mpmath.sin(theta) + axial * u
        energy = a * (w1**2 + w2**2) / 2 + mu * u
        # A u'^2 = 2 (E - mu u)(1 - u^2) - (L_Z - L_z u)^2/A = 2 mu (u^3 + b u^2 + c1 u + d), roots by Viete
        b = -(energy + axial**2 / (2 * a)) / mu
        c1, d = vertical * axial / (a * mu) - 1, (energy - vertical**2 / (2 * a)) / mu
        p, q = c1 - b**2 / 3, 2 * b**3 / 27 - b * c1 / 3 + d
        size = mpmath.sqrt(-p / 3)
        angle = mpmath.acos(max(-1, min(1, -q / (2 * size**3)))) / 3
        u1, u2, u3 = sorted(2 * size * mpmath.cos(angle + 2 * mpmath.pi * k / 3) - b / 3 for k in range(3))
        return HeavyTop(a, axial, vertical, u1, u2, u3, mpmath.sqrt(mu * (u3 - u1) / (2 * a)))
