"""Strands: functions ``C exp(i rate t) theta_j(z + shift) / theta(z)``, of which motions are woven.

The components of the attitude's spinor and the transverse rate of a heavy top are such functions (Whittaker,
Analytical Dynamics, section 71), entire in the numerator: a passage through a pole of the Euler angles is
not special for them. Per half period 2K of the elliptic functions the phase makes one step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from rigidsim.solve.closed_form.arithmetic import Arithmetic, Pair
from rigidsim.solve.closed_form.theta import Lattice, Theta, theta


@dataclass(frozen=True)
class Argument:
    """The argument u = speed t + start of elliptic functions of a lattice.

    Attributes:
        speed: per unit of time.
        start: value at t = 0, with abs(start) at most 2K.
    """

    lattice: Lattice
    speed: Any
    start: Any

    @property
    def turn_rate(self) -> Any:
        """Half periods 2K per unit of time (the plain speed on the separatrix)."""
        return self.speed / (2 * self.lattice.quarter) if self.lattice.periodic else self.speed

    def reduced(self, arithmetic: Arithmetic, time: Any) -> Pair:
        """Number of half periods 2K elapsed, and the rest in units of 2K, within +-1/2 (on the separatrix
        zero, and u itself).
        """
        if self.lattice.periodic:
            start = self.start / (2 * self.lattice.quarter)
            return arithmetic.reduced(time, self.turn_rate, start)
        count, rest = arithmetic.reduced(time, self.turn_rate, self.start)
        return count * 0, count + rest


@dataclass(frozen=True)
class Quotient:
    """Quotient ``amplitude * above / below``, the latter real on the line of motion; they share the
    variable.
    """

    above: Theta
    below: Theta
    amplitude: Any

    def at(self, arithmetic: Arithmetic, z: Any) -> Pair:
        """Real and imaginary part."""
        real, imaginary = self.above.at(arithmetic, z)
        scale = arithmetic.number(self.amplitude) / self.below.at(arithmetic, z)[0]
        return real * scale, imaginary * scale

    def value(self, z: Any) -> tuple[Any, Any]:
        """Value and derivative with respect to z, complex mpf."""
        above, above_slope = self.above.value(z)
        below, below_slope = self.below.value(z)
        change = above_slope * below - above * below_slope
        return self.amplitude * above / below, self.amplitude * change / below**2


@dataclass(frozen=True)
class Strand:
    """A quotient with a growing phase: times ``exp(i (rate t + step n + offset))`` after n half periods.

    Attributes:
        rate: rate of the phase, rad per unit of time.
        step: step of the phase per half period, rad.
        offset: phase at t = 0 apart from the quotient's own, rad.
    """

    quotient: Quotient
    rate: Any
    step: Any
    offset: Any

    def at(self, arithmetic: Arithmetic, time: Any, count: Any, rest: Any) -> Pair:
        """Real and imaginary part at a time whose argument is ``count, rest`` (see ``Argument``)."""
        value = self.quotient.at(arithmetic, arithmetic.number(self.quotient.above.per_turn) * rest)
        return turn(arithmetic, value, arithmetic.angle(time, self.rate, count, self.step, self.offset))

    def slope(self, argument: Argument, rest: Any) -> tuple[Any, Any]:
        """Value and time derivative (complex mpf) where ``rate t + step n + offset`` is zero."""
        per_turn = self.quotient.above.per_turn
        value, change = self.quotient.value(per_turn * rest)
        turning = per_turn.context.mpc(0, self.rate) * value
        return value, change * per_turn * argument.turn_rate + turning

    def shifted(self, angle: Any) -> Strand:
        """The strand with a constant added to its phase."""
        return replace(self, offset=self.offset + angle)


def turn(arithmetic: Arithmetic, value: Pair, angle: Any) -> Pair:
    """Multiply by exp(i angle)."""
    c, s = arithmetic.cos(angle), arithmetic.sin(angle)
    return value[0] * c - value[1] * s, value[0] * s + value[1] * c


def phase_slope(theta: Theta, z: Any) -> Any:
    """Derivative of the phase of a theta function along its line."""
    value, slope = theta.value(z)
    return (slope / value).imag


@dataclass(frozen=True)
class Jacobi:
    """Jacobi's three functions on a lattice.

    Attributes:
        cn, sn, dn: within half a period 2K; cn and dn are the real part of theirs, sn the imaginary one.
    """

    cn: Quotient
    sn: Quotient
    dn: Quotient

    def at(self, arithmetic: Arithmetic, count: Any, rest: Any) -> tuple[Any, Any, Any]:
        """cn, sn and dn after ``count`` half periods (see ``Argument.reduced``)."""
        z = arithmetic.number(self.cn.above.per_turn) * rest
        cn, sn, dn = (f.at(arithmetic, z) for f in (self.cn, self.sn, self.dn))
        sign = 1 - 2 * (count - 2 * arithmetic.floor(count / 2))  # each half period reverses cn and sn
        return sign * cn[0], sign * sn[1], dn[0]


def jacobi(lattice: Lattice) -> Jacobi:
    """Jacobi's functions, normalised by cn = dn = d sn/du = 1 at u = 0."""
    zero = lattice.context.zero
    kinds, below = ((2, 1, 3), 4) if lattice.circular else ((4, 1, 3), 2)
    denominator = theta(lattice, below, zero)
    start = denominator.value(zero)[0].real
    functions = []
    for kind in kinds:
        above = theta(lattice, kind, zero)
        value, slope = above.value(zero)
        size = value.real
        if kind == 1:
            size = slope.imag * above.per_turn / (2 * lattice.quarter if lattice.periodic else 1)
        functions.append(Quotient(above, denominator, start / size))
    return Jacobi(*functions)
