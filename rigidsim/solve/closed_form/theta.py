"""Theta series next to the real axis, in whichever of their two nomes converges at once.

A motion in elliptic functions is a handful of quotients of theta functions theta_j(z), where z runs along a
line parallel to the real axis. With the nome q = exp(-pi K'/K) the series are trigonometric; towards the
separatrix, where q goes to 1, Jacobi's imaginary transformation (DLMF 20.7.30-33) turns them into hyperbolic
ones in the nome q' = exp(-pi K/K'). The smaller of the two is at most exp(-pi): six terms give a double.
All numbers are made in mpmath; an ``Arithmetic`` (see ``arithmetic``) evaluates them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rigidsim.solve.closed_form.arithmetic import Arithmetic, Pair


@dataclass(frozen=True)
class Lattice:
    """The two quarter periods of a parameter m.

    Attributes:
        context: mpmath context of all numbers.
        m, complement: parameter and 1 - m, each with all its digits.
        quarter: K; infinite on the separatrix (m = 1).
        other: K', the quarter period of ``complement``; infinite for m = 0.
    """

    context: Any
    m: Any
    complement: Any
    quarter: Any
    other: Any

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
    """F(phi, m) for phi in [0, pi/2] from sin^2, cos^2 and 1 - m sin^2, each given with all its digits
    (Carlson; DLMF 19.25.5).
    """
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

    Attributes:
        kind: 1 to 4.
        hyperbolic: whether the series is hyperbolic.
        per_turn: the variable z over the number of turns x / 2K, or over x itself on the separatrix.
        orders: k_n.
        weights: a_n, b_n; without the power of the nome where hyperbolic.
        logs: logarithm of that power.
        sizes: binary logarithm of a bound of each term.
    """

    context: Any
    kind: int
    hyperbolic: bool
    per_turn: Any
    orders: tuple[int, ...]
    weights: tuple[tuple[Any, Any], ...]
    logs: tuple[Any, ...]
    sizes: tuple[float, ...]

    def terms(self, bits: int) -> int:
        """Number of terms above 2^-bits."""
        return max(1, sum(size > -bits for size in self.sizes))

    def at(self, arithmetic: Arithmetic, z: Any) -> Pair:
        """Value at z, times exp(-abs(z)) if hyperbolic."""
        number, real, imaginary = arithmetic.number, None, None
        size = abs(z)
        for n in range(self.terms(arithmetic.bits + 8)):
            a, b = (number(x) for x in self.weights[n])
            k = self.orders[n]
            if self.hyperbolic:
                grown = arithmetic.exp(number(self.logs[n]) + (k - 1) * size)
                shrunk = arithmetic.exp(number(self.logs[n]) - (k + 1) * size)
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
        for k, (a, b), log in zip(self.orders, self.weights, self.logs, strict=True):
            if self.hyperbolic:
                even, odd, sign = context.cosh(k * z), context.sinh(k * z), 1
                a, b = a * context.exp(log), b * context.exp(log)
            else:
                even, odd, sign = context.cos(k * z), context.sin(k * z), -1
            total += context.mpc(a * even, b * odd)
            derivative += k * context.mpc(sign * a * odd, b * even)
        return total, derivative


def theta(lattice: Lattice, kind: int, shift: Any, *, tau_factor: int = 1) -> Theta:
    """theta_kind(v + i shift
    q), or if the lattice's series are hyperbolic, theta_kind(shift + i y
    q').

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
    orders, weights, logs, sizes = [], [], [], []
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
        orders.append(k)
        weights.append((scale * a, scale * b))
        logs.append(exponent)
        sizes.append(bits)
    return Theta(
        context, kind, hyperbolic, per_turn, tuple(orders), tuple(weights), tuple(logs), tuple(sizes)
    )


def _weights(context: Any, kind: int, k: int, shift: Any, *, hyperbolic: bool) -> tuple[Any, Any]:
    """Weights of C(k z) in the real part and of S(k z) in the imaginary part."""
    if hyperbolic:  # sine or cosine of k (shift + i y)
        if kind == 1:
            return context.sin(k * shift), context.cos(k * shift)
        return context.cos(k * shift), -context.sin(k * shift)
    if kind == 1:  # -i sin(k (v + i shift))
        return context.sinh(k * shift), -context.cosh(k * shift)
    return context.cosh(k * shift), -context.sinh(k * shift)
