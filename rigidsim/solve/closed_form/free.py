"""Free rotation: rates and attitude of any body without torque, from any start.

With L3 > 0 the component of the angular momentum L along the axis that it circles, the attitude relative to
L is the spinor alpha = cos(theta/2) exp(i s/2), beta = (L2 - i L1) / (2 L conj(alpha)), where cos(theta) =
L3/L and the sum s of precession and spin obeys

    s' = (2 E + L w3) / (L + L3).

No term vanishes or cancels anywhere along the motion: abs(alpha) >= sqrt(1/2). The rates are Jacobi's
(Whittaker, Analytical Dynamics, section 69; Landau & Lifshitz, Mechanics, section 37), and the integral of
the third kind in s is, up to a term linear in time, the phase of a theta function with twice the imaginary
period, theta_4(v - i omega | q^2), whose zeros stay away from the line of motion (compare van Zon & Schofield
2007, J. Comput. Phys. 225, 145: precession and spin one by one, which jump where L passes close to axis 3).
"""

from dataclasses import dataclass
from typing import Any

from rigidsim.scene.arithmetic import Matrix, Vector, dot
from rigidsim.solve.closed_form.arithmetic import Arithmetic, Motion, NoClosedForm, right_handed
from rigidsim.solve.closed_form.theta import (
    Argument,
    Jacobi,
    Lattice,
    Theta,
    first_kind,
    jacobi,
    lattice,
    phase_slope,
    theta,
    turn,
)


@dataclass(frozen=True)
class SymmetricFree(Motion):
    """Free motion with two equal moments (a sphere, a rod), or of any body about a principal axis."""

    tilt_cosine: Any
    tilt_sine: Any
    transverse: Any  # rate across axis 3
    axial: Any  # w3
    sum_rate: Any  # s'
    spin_rate: Any  # and initial value of the transverse rate's angle: w2 + i w1 ~ exp(i angle)
    spin: Any

    title = "free body with two equal moments, or in rotation about a principal axis: circular functions"

    def at(self, arithmetic: Arithmetic, time: Any) -> tuple[list[Any], list[Any]]:
        number = arithmetic.number
        zero = self.spin * 0
        count = arithmetic.elapsed(time) * 0
        half = arithmetic.angle(time, self.sum_rate / 2, count, zero, zero)
        spin = arithmetic.angle(time, self.spin_rate, count, zero, self.spin)
        cosine, sine = number(self.tilt_cosine), number(self.tilt_sine)
        c, s = arithmetic.cos(spin), arithmetic.sin(spin)
        alpha = cosine * arithmetic.cos(half), cosine * arithmetic.sin(half)
        beta = turn(arithmetic, (sine * c, -sine * s), half)
        across = number(self.transverse)
        rates = [across * s, across * c, number(self.axial) + count]
        return rates, [alpha[0], beta[0], beta[1], alpha[1]]


@dataclass(frozen=True)
class AsymmetricFree(Motion):
    """Free motion with three different moments: w = (W1 cn, W2 sn, W3 dn)(u), L circling axis 3."""

    argument: Argument
    amplitudes: tuple[Any, Any, Any]  # W1, W2, W3
    leans: tuple[Any, Any, Any]  # amplitudes of L1 / 2L, L2 / 2L and L3 / L
    functions: Jacobi
    phase: Theta  # theta function with the phase of alpha, of another variable
    rate: Any  # mean rate of s/2 and its change per half period, as in ``Strand``
    step: Any
    momentum: Any
    moments: tuple[Any, Any, Any]  # I1, I2, I3; I2 lies between the others

    title = "free asymmetric body: Jacobi elliptic functions"

    @property
    def lattice(self) -> Lattice:
        """Lattice of the elliptic functions."""
        return self.argument.lattice

    @property
    def period(self) -> Any:
        """Period of the body rates, 4 K / p; infinite on the separatrix."""
        return 4 * self.lattice.quarter / self.argument.speed

    @property
    def precession(self) -> Any:
        """Mean rate of axis 3 about L.

        Precession and spin add up to s, and the spin of L about axis 3 makes one turn per period: backwards
        where I3 is the largest.
        """
        sense = 1 if self.moments[2] > self.moments[0] else -1
        return 2 * self.rate + (2 * self.step + sense * self.lattice.context.pi) * self.argument.turn_rate

    def at(self, arithmetic: Arithmetic, time: Any) -> tuple[list[Any], list[Any]]:
        number = arithmetic.number
        count, rest = self.argument.reduced(arithmetic, time)
        cn, sn, dn = self.functions.at(arithmetic, count, rest)
        w1, w2, w3 = (number(x) for x in self.amplitudes)
        rates = [w1 * cn, w2 * sn, w3 * dn]
        l1, l2, l3 = (number(x) for x in self.leans)
        real, imaginary = self.phase.at(arithmetic, number(self.phase.per_turn) * rest)
        size = arithmetic.sqrt(real * real + imaginary * imaginary)
        angle = arithmetic.angle(time, self.rate, count, self.step, self.rate * 0)
        unit = turn(arithmetic, (real / size, imaginary / size), angle)
        modulus = arithmetic.sqrt((1 + l3 * dn) / 2)
        x, y = l2 * sn / modulus, -l1 * cn / modulus
        beta = x * unit[0] - y * unit[1], x * unit[1] + y * unit[0]
        return rates, [modulus * unit[0], beta[0], beta[1], modulus * unit[1]]


def spinning(context: Any, axes: Matrix, spin: Any) -> SymmetricFree:
    """Rotation about the third of three right-handed axes with a constant rate (a top asleep, say)."""
    if spin < 0:
        axes, spin = [axes[1], axes[0], [-x for x in axes[2]]], -spin
    zero = context.zero
    return SymmetricFree(axes, context.one, zero, zero, spin, spin, zero, zero)


def free_motion(context: Any, moments: Vector, axes: Matrix, rates: Vector, tiny: Any) -> Motion:
    """The free motion of a body, of which one moment may be zero (a rod's), whose axis then keeps its rate.

    Args:
        context: mpmath context to work in, with at least twice the digits wanted.
        tiny: relative size below which a difference of moments, or a component of L, is rounding.

    Raises:
        NoClosedForm: one moment is zero, and the others differ.
    """
    components = [dot(axis, rates) for axis in axes]
    momenta = [m * w for m, w in zip(moments, components, strict=True)]
    size = context.sqrt(dot(momenta, momenta))
    largest = max(moments)
    alike = [abs(moments[(i + 1) % 3] - moments[(i + 2) % 3]) <= tiny * largest for i in range(3)]
    strong = max(range(3), key=lambda i: abs(momenta[i]))
    if size == 0:
        return spinning(context, axes, context.zero)
    if all(abs(x) <= tiny * size for i, x in enumerate(momenta) if i != strong) and min(moments) > 0:
        frame = [axes[(strong + 1) % 3], axes[(strong + 2) % 3], axes[strong]]
        return spinning(context, frame, components[strong])
    if all(alike):
        return _symmetric(context, moments, axes, components, strong)
    if any(alike):
        return _symmetric(context, moments, axes, components, alike.index(True))
    if min(moments) == 0:
        raise NoClosedForm(
            "a body without inertia about one axis, whose other two moments differ, has no closed form",
        )
    return _asymmetric(context, moments, axes, components, tiny)


def _symmetric(context: Any, moments: Vector, axes: Matrix, rates: Vector, k: int) -> SymmetricFree:
    i, j = (k + 1) % 3, (k + 2) % 3
    # a rod carries no momentum along its axis, but its axis keeps the rate that it was given
    sign = -1 if rates[k] < 0 else 1
    frame = right_handed([axes[i], axes[j], [sign * x for x in axes[k]]])
    moment = (moments[i] + moments[j]) / 2
    w1, w2, w3 = rates[i], rates[j] * sign, rates[k] * sign
    across, along = moment * context.hypot(w1, w2), moments[k] * w3
    size = context.hypot(across, along)
    twice_energy = moment * (w1**2 + w2**2) + moments[k] * w3**2
    cosine = context.sqrt((1 + along / size) / 2)
    return SymmetricFree(
        frame,
        cosine,
        across / size / (2 * cosine),
        across / moment,
        w3,
        (twice_energy + size * w3) / (size + along),
        w3 - along / moment,
        context.atan2(w1, w2),
    )


def _asymmetric(context: Any, moments: Vector, axes: Matrix, rates: Vector, tiny: Any) -> AsymmetricFree:
    order = sorted(range(3), key=lambda i: moments[i])
    squares = [(moments[i] * rates[i]) ** 2 for i in order]
    low, middle, high = (moments[i] for i in order)
    # L^2 - 2 E I2, without the term that cancels: positive where L circles the axis of the largest moment
    beyond, other = squares[2] * (1 - middle / high), squares[0] * (middle / low - 1)
    # on the separatrix itself, up to the rounding of the scene's numbers
    beyond = beyond - other if abs(beyond - other) > tiny * beyond else context.zero
    if beyond < 0:
        order.reverse()
    i1, i2, i3 = (moments[i] for i in order)
    sense = 1 if i3 > i1 else -1
    signs = [-1 if moments[i] * rates[i] < 0 else 1 for i in order]
    frame = right_handed([[signs[n] * x for x in axes[i]] for n, i in enumerate(order)], flip=1)
    # the sign of the middle axis follows from the other two
    w1, w3 = abs(rates[order[0]]), abs(rates[order[2]])
    w2 = rates[order[1]] * (1 if dot(frame[1], axes[order[1]]) > 0 else -1)
    l1, l2, l3 = i1 * w1, i2 * w2, i3 * w3
    size = context.sqrt(l1**2 + l2**2 + l3**2)
    # abs(L^2 - 2 E I3) and abs(L^2 - 2 E I1), as sums of terms of one sign
    about_3 = abs(l1**2 * (1 - i3 / i1) + l2**2 * (1 - i3 / i2))
    about_1 = abs(l2**2 * (1 - i1 / i2) + l3**2 * (1 - i1 / i3))
    scale = about_1 * abs(i3 - i2)
    grid = lattice(context, about_3 * abs(i1 - i2) / scale, abs(beyond) * abs(i3 - i1) / scale)
    speed = context.sqrt(scale / (i1 * i2 * i3))
    top1 = context.sqrt(i1 * about_3 / abs(i1 - i3))
    top2 = context.sqrt(i2 * about_3 / abs(i2 - i3))
    top3 = context.sqrt(i3 * about_1 / abs(i3 - i1))
    start = first_kind(context, (l2 / top2) ** 2, (l1 / top1) ** 2, (l3 / top3) ** 2)
    if l2 * sense < 0:
        start = -start
    argument = Argument(grid, speed, start)
    # where 1 + cos(theta) vanishes: at u = i (2 K' + w), sn(w | 1 - m) = top1 / top2
    cosine_squared = i3 * (i1 - i2) / (i2 * (i1 - i3))
    w = sense * first_kind(
        context,
        i1 * (i2 - i3) / (i2 * (i1 - i3)),
        cosine_squared,
        cosine_squared * (size / top3) ** 2,
    )
    half_line = context.pi * w / (2 * grid.quarter if grid.circular else 4 * grid.other)
    if grid.circular:
        phase, step = theta(grid, 4, -half_line, tau_factor=2), context.zero
    else:
        phase, step = theta(grid, 2, half_line, tau_factor=2), -2 * half_line
    # at u = 0, where L2 = 0
    twice_energy = top1**2 / i1 + top3**2 / i3
    sum_rate = (twice_energy + size * top3 / i3) / (size + top3)
    rate = sum_rate / 2 - phase.per_turn * argument.turn_rate * phase_slope(phase, context.zero)
    return AsymmetricFree(
        frame,
        argument,
        (top1 / i1, sense * top2 / i2, top3 / i3),
        (top1 / (2 * size), sense * top2 / (2 * size), top3 / size),
        jacobi(grid),
        phase,
        rate,
        step,
        size,
        (i1, i2, i3),
    )
