"""Periods and precession of rigid bodies in closed form, in the current mpmath precision.

Free asymmetric top: Whittaker, Analytical Dynamics, section 69; Landau & Lifshitz, Mechanics, section 37.
Heavy symmetric top: Whittaker, section 71; Landau & Lifshitz, section 35, problem 1. The motions themselves
are rigidsim's (``rigidsim.solve.closed_form``); here are
the numbers that studies hold against published ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mpmath

from rigidsim.solve.closed_form import free, heavy


@dataclass(frozen=True)
class FreeTop:
    """An asymmetric top without torque.

    Attributes:
        i1, i2, i3: principal moments; L circles axis 3, the largest or smallest; axis 2 is the middle one.
        momentum: abs(L).
        p: rate of the elliptic functions' argument.
        m: their parameter, below 1; the separatrix is at 1.
        complement: 1 - m, with all its digits next to the separatrix.
        period: of the body rates, 4 K / p.
        precession: mean rate at which axis 3 goes round L in space.
    """

    i1: Any
    i2: Any
    i3: Any
    momentum: Any
    p: Any
    m: Any
    complement: Any
    period: Any
    precession: Any

    @property
    def flip(self) -> Any:
        """Time between two reversals of the rate about the middle axis: 2 K / p."""
        return self.period / 2


def free_top(moments: Sequence[Any], rates: Sequence[Any]) -> FreeTop:
    """The motion that starts with these rates (principal axes).

    Raises:
        ValueError: two moments are equal, or the body spins about a principal axis: no elliptic function.
    """
    context = mpmath.mp
    axes = [[context.mpf(i == j) for j in range(3)] for i in range(3)]
    motion = free.free_motion(
        context, [context.mpf(m) for m in moments], axes, [context.mpf(w) for w in rates], context.eps
    )
    if not isinstance(motion, free.AsymmetricFree):
        raise ValueError(f"given moments {moments}, rates {rates}; an asymmetric motion is needed")
    grid = motion.lattice
    i1, i2, i3 = motion.moments
    speed = motion.argument.speed
    return FreeTop(
        i1, i2, i3, motion.momentum, speed, grid.m, grid.complement, motion.period, motion.precession
    )


@dataclass(frozen=True)
class HeavyTop:
    """A symmetric top on a fixed tip under gravity; u = cos(tilt).

    Attributes:
        a: moment across the axis, about the tip.
        axial, vertical: components of L along the top's axis and along the vertical.
        u1, u2, u3: roots of u'^2 = f(u): the tilt swings between u1 <= u2, and u3 >= 1.
        p: rate of the elliptic functions' argument.
        nutation: period of the tilt, 2 K / p.
        precession: mean rate of phi, the azimuth.
    """

    a: Any
    axial: Any
    vertical: Any
    u1: Any
    u2: Any
    u3: Any
    p: Any
    nutation: Any
    precession: Any

    @property
    def m(self) -> Any:
        """Parameter of the elliptic functions."""
        return (self.u2 - self.u1) / (self.u3 - self.u1)


def heavy_top(a: Any, c: Any, mu: Any, theta: Any, rates: Sequence[Any]) -> HeavyTop:
    """The motion that starts at tilt ``theta`` (phi = psi = 0) with these body rates.

    Args:
        a, c: moments across and along the axis, about the tip.
        mu: mass * gravity * distance of the centre of mass.
        theta: initial tilt, rad.
        rates: initial angular velocity, body axes; with psi = 0 these are theta', phi' sin(theta), w3.
    """
    context = mpmath.mp
    with context.extradps(context.dps):  # double roots keep half the digits
        w = [context.mpf(x) for x in rates]
        up = [context.zero, context.sin(theta), context.cos(theta)]
        axes = [[context.mpf(i == j) for j in range(3)] for i in range(3)]
        top = heavy.heavy_motion(context, axes, (a, c), mu, w, up)
        axial = c * w[2]
        vertical = a * w[1] * up[1] + axial * up[2]
        return HeavyTop(a, axial, vertical, *top.roots, top.argument.speed, top.nutation, top.precession)
