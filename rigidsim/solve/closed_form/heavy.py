"""The heavy symmetric top: a fixed point on its axis, a uniform field; rates and attitude from any start.

u = cos(tilt) swings between two roots u1 <= u2 of the cubic u'^2 = (2 mu / A) (u - u1) (u2 - u) (u3 - u), as
u = u1 + (u2 - u1) sn^2 (Whittaker, Analytical Dynamics, section 71; Landau & Lifshitz, Mechanics, section
35). The spinor of the attitude, alpha = cos(theta/2) exp(i (phi + psi)/2) and beta = sin(theta/2) exp(i (phi
- psi)/2), and the rate across the axis, W = w1 + i w2, are each of the form

    abs(f)^2 ~ abs(u - v),  arg(f)' = c + g / (2 A abs(u - v)),  v = -1, 1 and the height E / mu of rest,

so that each is a quotient of theta functions times exp(i kappa t) (Klein; Lawden, Elliptic Functions and
Applications, chapter 5), with no integral of the third kind left, and nothing singular on the vertical.
"""

from dataclasses import dataclass, replace
from typing import Any

from rigidsim.scene.arithmetic import Matrix, Vector, cross, dot
from rigidsim.solve.closed_form.arithmetic import Arithmetic, Motion
from rigidsim.solve.closed_form.theta import (
    Argument,
    Quotient,
    Strand,
    Theta,
    first_kind,
    lattice,
    phase_slope,
    theta,
)


@dataclass(frozen=True)
class HeavyTop(Motion):
    """A top that nutates, precesses regularly, swings as a pendulum, or any mixture."""

    argument: Argument  # argument of the elliptic functions; half a period 2K is one nutation
    roots: tuple[Any, Any, Any]  # u1 <= u2 <= 1 <= u3 of the cubic
    alpha: Strand  # and beta: spinor of the attitude (axis 3 along the top's axis, space Z against gravity)
    beta: Strand
    across: Strand  # w1 + i w2
    axial: Any

    title = "heavy symmetric top: Jacobi elliptic functions"

    @property
    def nutation(self) -> Any:
        """Period of the tilt; infinite on the separatrix."""
        return 2 * self.argument.lattice.quarter / self.argument.speed

    @property
    def precession(self) -> Any:
        """Mean rate of the azimuth phi (which jumps by half a turn, either way, through the vertical)."""
        a, b = self.alpha, self.beta
        if not self.argument.lattice.periodic:
            return a.rate + b.rate
        return a.rate + b.rate + (a.step + b.step) * self.argument.turn_rate

    def at(self, arithmetic: Arithmetic, time: Any) -> tuple[list[Any], list[Any]]:
        count, rest = self.argument.reduced(arithmetic, time)
        a, b, w = (f.at(arithmetic, time, count, rest) for f in (self.alpha, self.beta, self.across))
        rates = [w[0], w[1], arithmetic.number(self.axial) + 0 * rest]
        return rates, [a[0], b[0], b[1], a[1]]


@dataclass(frozen=True)
class _Cubic:
    """Quantities shared by the three strands."""

    argument: Argument
    a: Any
    u1: Any
    u2: Any
    u3: Any


def heavy_motion(
    context: Any,
    axes: Matrix,
    moments: tuple[Any, Any],
    pull: Any,
    rates: Vector,
    vertical: Vector,
) -> HeavyTop:
    """The motion of a heavy symmetric top that isn't at rest on the vertical.

    Args:
        context: mpmath context to work in, with twice the digits wanted (double roots lose half).
        axes: right-handed, body axes; the third from the fixed point to the centre of mass.
        moments: across and along the axis, about the fixed point; the second may be zero (see
            ``free_motion``).
        pull: M g l > 0, in units that agree with the units of moments and rates.
        vertical: unit vector against gravity at the start, body axes.
    """
    a, c = moments
    w1, w2, w3 = (dot(axis, rates) for axis in axes)
    g1, g2, g3 = (dot(axis, vertical) for axis in axes)
    length = context.sqrt(g1**2 + g2**2 + g3**2)
    g1, g2, u = g1 / length, g2 / length, g3 / length
    axial = c * w3
    upright = a * (g1 * w1 + g2 * w2) + axial * u
    height = a * (w1**2 + w2**2) / (2 * pull) + u  # E / mu, without the energy of the spin
    u1, u2, u3 = _roots(
        context,
        -height - axial**2 / (2 * a * pull),
        -1 + upright * axial / (a * pull),
        height - upright**2 / (2 * a * pull),
    )
    one = context.one
    u1, u2, u3 = max(u1, -one), min(max(u2, -one), one), max(u3, one)
    # the start is on the motion: rounding must not put it outside
    u1, u2 = min(u1, u), max(u2, u)
    grid = lattice(context, (u2 - u1) / (u3 - u1), (u3 - u2) / (u3 - u1))
    speed = context.sqrt(pull * (u3 - u1) / (2 * a))
    start = context.zero
    if u2 > u1:
        start = first_kind(context, (u - u1) / (u2 - u1), (u2 - u) / (u2 - u1), (u3 - u) / (u3 - u1))
    if g1 * w2 - g2 * w1 < 0:
        start = -start
    cubic = _Cubic(Argument(grid, speed, start), a, u1, u2, u3)
    excess = (w3 - axial / a) / 2  # excess of the spin over a sphere's
    alpha = _rising(cubic, excess, upright + axial)
    beta = _falling(cubic, one, one / 2, -excess, upright - axial)
    turning = -2 * excess - axial / (2 * a)
    across = _falling(cubic, height, pull / a * 2, turning, -(upright - axial * height))
    across = _joined(context, cubic, alpha, beta, across)
    top = HeavyTop(axes, cubic.argument, (u1, u2, u3), alpha, beta, across, w3)
    return _placed(context, top, (w1, w2), (g1, g2))


def _roots(context: Any, b: Any, c: Any, d: Any) -> list[Any]:
    """Ascending roots of x^3 + b x^2 + c x + d, all real (Viete)."""
    radius = context.sqrt(max(b * b / 9 - c / 3, context.zero))
    half = (b * c / 3 - d) / 2 - b**3 / 27
    cosine = half / radius**3 if radius else context.zero
    angle = context.acos(max(min(cosine, context.one), -context.one)) / 3
    return sorted(2 * radius * context.cos(angle - 2 * context.pi * k / 3) - b / 3 for k in range(3))


def _strand(cubic: _Cubic, above: Theta, step: Any, match: tuple[Any, Any], *, at_top: bool) -> Strand:
    """A strand with modulus and rate of phase matched where u = u1, or u = u2 (``at_top``)."""
    modulus, phase_rate = match
    grid = cubic.argument.lattice
    context = grid.context
    below = theta(grid, 4 if grid.circular else 2, context.zero)
    if at_top and not grid.periodic:  # u = u2 is reached after infinite time: the quotient goes to a constant
        return Strand(Quotient(above, below, modulus), phase_rate, step, context.zero)
    z = above.per_turn / 2 if at_top else context.zero
    rate = phase_rate - above.per_turn * cubic.argument.turn_rate * phase_slope(above, z)
    found = abs(above.value(z)[0]) / below.value(z)[0].real
    return Strand(Quotient(above, below, modulus / found), rate, step, context.zero)


def _line(
    cubic: _Cubic,
    kinds: tuple[int, int, int],
    sign: int,
    near: tuple[Any, Any, Any],
    far: tuple[Any, Any, Any],
) -> tuple[Theta, Any]:
    """The numerator and its phase step per half period, from where it vanishes.

    Args:
        kinds: kinds of theta function with a zero next to the line, next to the other edge of the strip, and
            in the complementary nome.
        sign: sign of the zero's imaginary part.
        near, far: sin^2, cos^2 and delta^2 of the amplitude of the zero's distance from the line, and of its
            distance from the edge i K'; the first is needed unless u1 = u2, the second unless u2 = u3.
    """
    grid = cubic.argument.lattice
    context = grid.context
    if grid.circular:
        per_length = context.pi / (2 * grid.quarter)
        edge = first_kind(context, *far)
        if not context.isinf(edge) and 2 * edge < grid.other:
            return theta(grid, kinds[1], sign * per_length * edge), context.zero
        return theta(grid, kinds[0], -sign * per_length * first_kind(context, *near)), sign * context.pi
    shift = sign * context.pi / (2 * grid.other) * first_kind(context, *near)
    return theta(grid, kinds[2], shift), sign * context.pi - 2 * shift


def _rising(cubic: _Cubic, constant: Any, strength: Any) -> Strand:
    """Strand with abs(f)^2 = (1 + u) / 2, arg(f)' = constant + strength / (2 A (1 + u)): alpha."""
    context, u1, u2, u3 = cubic.argument.lattice.context, cubic.u1, cubic.u2, cubic.u3
    near = ((1 + u1) / (1 + u2), (u2 - u1) / (1 + u2), (u2 - u1) * (1 + u3) / ((u3 - u1) * (1 + u2)))
    far = ((u3 - u1) / (1 + u3), (1 + u1) / (1 + u3), (1 + u2) / (1 + u3))
    above, step = _line(cubic, (1, 4, 1), -1 if strength < 0 else 1, near, far)
    match = context.sqrt((1 + u2) / 2), constant + strength / (2 * cubic.a * (1 + u2))
    return _strand(cubic, above, step, match, at_top=True)


def _falling(cubic: _Cubic, zero: Any, weight: Any, constant: Any, strength: Any) -> Strand:
    """Strand with abs(f)^2 = weight (zero - u), arg(f)' = constant + strength / (2 A (zero - u))."""
    context, u1, u2, u3 = cubic.argument.lattice.context, cubic.u1, cubic.u2, cubic.u3
    zero = min(max(zero, u2), u3)
    gap = u3 - u2
    # on the separatrix zero = u2 = u3: the function decays alike wherever its zero is
    rise, fall = ((zero - u2) / gap, (u3 - zero) / gap) if gap != 0 else (context.zero, context.one)
    near = (
        rise * (u3 - u1) / (zero - u1),
        fall * (u2 - u1) / (zero - u1),
        (u2 - u1) / (zero - u1),
    )
    far = (fall, rise, (zero - u1) / (u3 - u1))
    above, step = _line(cubic, (2, 3, 4), -1 if strength < 0 else 1, near, far)
    match = context.sqrt(weight * (zero - u1)), constant + strength / (2 * cubic.a * (zero - u1))
    return _strand(cubic, above, step, match, at_top=False)


def _joined(context: Any, cubic: _Cubic, alpha: Strand, beta: Strand, across: Strand) -> Strand:
    """``across`` in phase with the attitude: w1 + i w2 = 2 (conj(alpha) beta' - conj(alpha)' beta), taken
    where u = u1, since there it is largest.
    """
    time = -cubic.argument.start / cubic.argument.speed
    a, a_slope = (x * context.expj(alpha.rate * time) for x in alpha.slope(cubic.argument, context.zero))
    b, b_slope = (x * context.expj(beta.rate * time) for x in beta.slope(cubic.argument, context.zero))
    wanted = 2 * (context.conj(a) * b_slope - context.conj(a_slope) * b)
    found = across.slope(cubic.argument, context.zero)[0] * context.expj(across.rate * time)
    return across.shifted(context.arg(wanted / found))


def _placed(context: Any, top: HeavyTop, rates: tuple[Any, Any], level: tuple[Any, Any]) -> HeavyTop:
    """The top turned about its axis to these transverse rates or vertical: the larger, as one may vanish."""
    rest = top.argument.start * top.argument.turn_rate / top.argument.speed
    a, b, w = (
        f.slope(top.argument, rest)[0] * context.expj(f.offset) for f in (top.alpha, top.beta, top.across)
    )
    if context.hypot(*level) * top.argument.speed >= context.hypot(*rates):
        spin = context.arg(context.mpc(level[1], level[0]) / (2 * a * context.conj(b)))
    else:
        spin = -context.arg(context.mpc(*rates) / w)
    return replace(
        top,
        alpha=top.alpha.shifted(spin / 2),
        beta=top.beta.shifted(-spin / 2),
        across=top.across.shifted(-spin),
    )


def perpendicular_axes(context: Any, axis: Vector) -> Matrix:
    """A right-handed frame whose third axis is ``axis`` (a unit vector)."""
    least = min(range(3), key=lambda i: abs(axis[i]))
    other = [context.one if i == least else context.zero for i in range(3)]
    first = cross(other, axis)
    length = context.sqrt(dot(first, first))
    first = [x / length for x in first]
    return [first, cross(axis, first), axis]
