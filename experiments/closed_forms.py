"""Exact solutions in elliptic integrals, in the current mpmath precision.

Free asymmetric top: Whittaker, Analytical Dynamics, section 69; Landau & Lifshitz, Mechanics, section 37.
Heavy symmetric top: Whittaker, section 71; Landau & Lifshitz, section 35, problem 1. K(m), Pi(n, m) have the
parameter m = k^2, and Pi the sign of mpmath: 1 / (1 - n sin^2).
"""

from __future__ import annotations

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
        """Period of the body rates: 4 K / p."""
        return 2 * self.flip

    @property
    def precession(self) -> Any:
        """Mean rate at which axis 3 goes round L in space."""
        n = self.i3 * (self.i2 - self.i1) / (self.i1 * (self.i2 - self.i3))
        ratio = mpmath.ellippi(n, self.m) / mpmath.ellipk(self.m)
        return self.momentum * (1 / self.i3 + (1 / self.i1 - 1 / self.i3) * ratio)


def free_top(moments: Sequence[Any], rates: Sequence[Any]) -> FreeTop:
    """The motion that starts with these rates (principal axes)."""
    square = mpmath.fsum((i * w) ** 2 for i, w in zip(moments, rates, strict=True))
    twice = mpmath.fsum(i * w * w for i, w in zip(moments, rates, strict=True))
    small, middle, large = sorted(moments)
    beyond = square - twice * middle  # positive: L circles the axis of the largest moment
    i1, i3 = (small, large) if beyond > 0 else (large, small)
    scale = (square - twice * i1) * (i3 - middle)
    m = (square - twice * i3) * (i1 - middle) / scale
    complement = beyond * (i3 - i1) / scale
    p = mpmath.sqrt(scale / (i1 * middle * i3))
    return FreeTop(i1, middle, i3, mpmath.sqrt(square), p, m, complement)


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
        """Period of the tilt: 2 K / p."""
        return 2 * mpmath.ellipk(self.m) / self.p

    @property
    def precession(self) -> Any:
        """Mean rate of phi, the azimuth; phi' = (L_z - L_3 u) / (A (1 - u^2)) over one nutation."""
        k = mpmath.ellipk(self.m)
        swing = self.u2 - self.u1
        up = mpmath.ellippi(swing / (1 - self.u1), self.m) / (1 - self.u1)
        down = mpmath.ellippi(-swing / (1 + self.u1), self.m) / (1 + self.u1)
        return ((self.vertical - self.axial) * up + (self.vertical + self.axial) * down) / (2 * self.a * k)


def heavy_top(a: Any, c: Any, mu: Any, theta: Any, rates: Sequence[Any]) -> HeavyTop:
    """The motion that starts at tilt ``theta`` (phi = psi = 0) with these body rates.

    Args:
        a, c: moments across and along the axis, about the tip.
        mu: mass * gravity * distance of the centre of mass.
        theta: initial tilt, rad.
        rates: initial angular velocity, body axes; with psi = 0 these are theta', phi' sin(theta), w3.
    """
    u = mpmath.cos(theta)
    axial = c * rates[2]
    vertical = a * rates[1] * mpmath.sin(theta) + axial * u
    energy = a * (rates[0] ** 2 + rates[1] ** 2) / 2 + mu * u
    with mpmath.extradps(mpmath.mp.dps):  # double roots keep half the digits
        u1, u2, u3 = _roots(
            -energy / mu - axial**2 / (2 * a * mu),
            -1 + vertical * axial / (a * mu),
            energy / mu - vertical**2 / (2 * a * mu),
        )
    return HeavyTop(a, axial, vertical, u1, u2, u3, mpmath.sqrt(mu * (u3 - u1) / (2 * a)))


def _roots(b: Any, c: Any, d: Any) -> list[Any]:
    """Ascending roots of x^3 + b x^2 + c x + d, all real (Viete)."""
    radius = mpmath.sqrt(max(b * b / 9 - c / 3, mpmath.mpf(0)))
    half = (b * c / 3 - d) / 2 - b**3 / 27
    cosine = half / radius**3 if radius else mpmath.mpf(0)
    angle = mpmath.acos(max(min(cosine, mpmath.mpf(1)), mpmath.mpf(-1))) / 3
    return sorted(2 * radius * mpmath.cos(angle - 2 * mpmath.pi * k / 3) - b / 3 for k in range(3))
