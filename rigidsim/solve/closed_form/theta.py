"""Theta series next to the real axis, in whichever of their two nomes converges at once.

A motion in elliptic functions is a handful of quotients of theta functions theta_j(z), where z runs along a
line parallel to the real axis. With the nome q = exp(-pi K'/K) the series are trigonometric; towards the
separatrix, where q goes to 1, Jacobi's imaginary transformation (DLMF 20.7.30-33) turns them into hyperbolic
ones in the nome q' = exp(-pi K/K'). The smaller of the two is at most exp(-pi): six terms give a double.
All numbers are made in mpmath; an ``Arithmetic`` (see ``arithmetic``) evaluates them.

Strands are functions ``C exp(i rate t) theta_j(z + shift) / theta(z)``, of which motions are woven: the
components of the attitude's spinor and the transverse rate of a heavy top (Whittaker, Analytical Dynamics,
section 71), entire in the numerator: a passage through a pole of the Euler angles is not special for them.
Per half period 2K of the elliptic functions the phase makes one step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from rigidsim.solve.closed_form.arithmetic import Arithmetic, Pair


@dataclass(frozen=True)
class Lattice:
    """The two quarter periods of a parameter m."""

    context: Any
    m: Any  # and 1 - m, each with all its digits
    complement: Any
    quarter: Any  # K; infinite on the separatrix (m = 1)
    other: Any  # K', the quarter period of ``complement``; infinite for m = 0

    @property
    def circular(self) -> bool:
        """Whether the series in q (trigonometric) are the ones that converge faster."""
        return bool(self.m <= self.complement)

    @property
    def periodic(self) -> bool:
        """Whether the functions are periodic, which they aren't on the separatrix."""
        return bool(self.complement != 0)

    @property
    def nome(self) -> Any:
        """Nome q, or q' if the series are hyperbolic."""
        if self.circular:
            return self.context.exp(-self.context.pi * self.other / self.quarter)
        return self.context.exp(-self.context.pi * self.quarter / self.other)


def lattice(context: Any, m: Any, complement: Any) -> Lattice:
    """Quarter periods by arithmetic-geometric means (DLMF 19.8.5)."""
    half_pi = context.pi / 2
    quarter = half_pi / context.agm(1, context.sqrt(complement)) if complement != 0 else context.inf
    other = half_pi / context.agm(1, context.sqrt(m)) if m != 0 else context.inf
    return Lattice(context, m, complement, quarter, other)


def first_kind(context: Any, sine_squared: Any, cosine_squared: Any, delta_squared: Any) -> Any:
    """F(phi, m) from sin^2, cos^2 and 1 - m sin^2, each with all its digits (Carlson; DLMF 19.25.5)."""
    if sine_squared == 0:
        return context.zero
    return context.sqrt(sine_squared) * context.elliprf(cosine_squared, delta_squared, 1)


@dataclass(frozen=True)
class Theta:
    """A theta function along a line: real part ``sum a_n C(k_n z)``, imaginary part ``sum b_n S(k_n z)``.

    C and S are cosine and sine of the real variable z, with the shift of the line as a constant imaginary
    part of the argument; or cosh and sinh of a variable along the imaginary axis, with the shift as a
    constant real part. The factor 2 nome^(1/4) of theta_1 and theta_2 is left out, and so is a factor of i
    in the trigonometric theta_1.
    """

    context: Any
    kind: int
    hyperbolic: bool
    per_turn: Any  # the variable z over the number of turns x / 2K, or over x itself on the separatrix
    # k_n, a_n, b_n (where hyperbolic without the power of the nome, whose logarithm follows), and the binary
    # logarithm of a bound of each term
    terms: tuple[tuple[int, Any, Any, Any, float], ...]

    def at(self, arithmetic: Arithmetic, z: Any) -> Pair:
        """Value at z, times exp(-abs(z)) if hyperbolic."""
        number, real, imaginary = arithmetic.number, None, None
        size, least = abs(z), -arithmetic.bits - 8
        count = max(1, sum(bound > least for *_, bound in self.terms))
        for k, a, b, log, _ in self.terms[:count]:
            a, b = number(a), number(b)
            if self.hyperbolic:
                grown = arithmetic.exp(number(log) + (k - 1) * size)
                shrunk = arithmetic.exp(number(log) - (k + 1) * size)
                even = (grown + shrunk) / 2
                # sinh keeps its digits next to zero; exp(-k - 1) - exp(k - 1) would not
                odd = arithmetic.sinh_scaled(k, z, grown, shrunk)
            else:
                even, odd = arithmetic.cos(k * z), arithmetic.sin(k * z)
            real = a * even if real is None else real + a * even
            imaginary = b * odd if imaginary is None else imaginary + b * odd
        return real, imaginary

    def value(self, z: Any) -> tuple[Any, Any]:
        """Value and derivative with respect to z in mpmath, complex, not scaled."""
        context = self.context
        total = derivative = context.mpc(0)
        for k, a, b, log, _ in self.terms:
            if self.hyperbolic:
                even, odd, sign = context.cosh(k * z), context.sinh(k * z), 1
                a, b = a * context.exp(log), b * context.exp(log)
            else:
                even, odd, sign = context.cos(k * z), context.sin(k * z), -1
            total += context.mpc(a * even, b * odd)
            derivative += k * context.mpc(sign * a * odd, b * even)
        return total, derivative


def theta(lattice: Lattice, kind: int, shift: Any, *, tau_factor: int = 1) -> Theta:
    """theta_kind(v + i shift | q), or if the lattice's series are hyperbolic, theta_kind(shift + i y | q').

    Args:
        shift: constant part of the argument, within half a period of the lattice.
        tau_factor: 2 for a lattice with the same real period and twice the imaginary one (q^2, q'^(1/2)).
    """
    context = lattice.context
    hyperbolic = not lattice.circular
    nome = lattice.nome
    if hyperbolic:
        log = -context.pi * lattice.quarter / (lattice.other * tau_factor) if nome else context.ninf
        # z = pi x / (2 K' tau_factor); log nome is -pi K / (K' tau_factor) and a turn 2 K
        per_turn = -log if nome else context.pi / (2 * lattice.other * tau_factor)
        reach = -log / 2 if nome else context.zero
    else:
        log = context.log(nome) * tau_factor if nome else context.ninf
        per_turn, reach = context.pi, abs(shift)
    odd_orders = kind in (1, 2)
    terms: list[tuple[int, Any, Any, Any, float]] = []
    for n in range(10_000):
        k = 2 * n + 1 if odd_orders else 2 * n
        power = n * (n + 1) if odd_orders else n * n
        exponent = power * log if n else context.zero
        size = exponent + (max(k - 1, 0) if hyperbolic else k) * reach
        bits = float(size / context.log(2)) if n else 0.0
        if bits < -context.prec or (n and not nome):
            break
        sign = -1 if n % 2 and kind in (1, 4) else 1
        scale = sign * (1 if k == 0 or odd_orders else 2)
        a, b = _weights(context, kind, k, shift, hyperbolic=hyperbolic)
        if not hyperbolic:
            a, b = a * context.exp(exponent), b * context.exp(exponent)
        terms.append((k, scale * a, scale * b, exponent, bits))
    return Theta(context, kind, hyperbolic, per_turn, tuple(terms))


def _weights(context: Any, kind: int, k: int, shift: Any, *, hyperbolic: bool) -> tuple[Any, Any]:
    """Weights of C(k z) in the real part and of S(k z) in the imaginary part."""
    if hyperbolic:  # sine or cosine of k (shift + i y)
        if kind == 1:
            return context.sin(k * shift), context.cos(k * shift)
        return context.cos(k * shift), -context.sin(k * shift)
    if kind == 1:  # -i sin(k (v + i shift))
        return context.sinh(k * shift), -context.cosh(k * shift)
    return context.cosh(k * shift), -context.sinh(k * shift)


@dataclass(frozen=True)
class Argument:
    """The argument u = speed t + start of elliptic functions of a lattice, abs(start) at most 2K."""

    lattice: Lattice
    speed: Any
    start: Any

    @property
    def turn_rate(self) -> Any:
        """Half periods 2K per unit of time (the plain speed on the separatrix)."""
        return self.speed / (2 * self.lattice.quarter) if self.lattice.periodic else self.speed

    def reduced(self, arithmetic: Arithmetic, time: Any) -> Pair:
        """Half periods 2K elapsed, and the rest in units of 2K, +-1/2 (on the separatrix zero, and u)."""
        if self.lattice.periodic:
            start = self.start / (2 * self.lattice.quarter)
            return arithmetic.reduced(time, self.turn_rate, start)
        count, rest = arithmetic.reduced(time, self.turn_rate, self.start)
        return count * 0, count + rest


@dataclass(frozen=True)
class Quotient:
    """Quotient ``amplitude * above / below`` in one variable; below is real on the line of motion."""

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
    """A quotient with a growing phase: times ``exp(i (rate t + step n + offset))`` after n half periods."""

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
    """Jacobi's functions within half a period 2K: the real parts of cn and dn, the imaginary one of sn."""

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
