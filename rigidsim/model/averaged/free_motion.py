"""Free rotation over which torques are averaged: its mean inertia tensor, and its amplitudes.

A free body's angular momentum L is fixed in space while the body turns about it. One of its principal axes,
the one that L circles in the body, precesses about L at the mean rate g and nods with the polhode's period
2 pi / l (``wobble`` has both rates). With I3 the moment of that axis, I2 the intermediate moment and I1 the
remaining one,

    m = L / |L| = (M1 cn u, M2 sn u, M3 dn u),  u = p (t - t0),  parameter k^2

in the body (Landau & Lifshitz, Mechanics, section 37), and

    <cn^2> = (E - k'^2 K) / (k^2 K),   <sn^2> = (K - E) / (k^2 K),   <dn^2> = E / K,
    l = pi p / (2 K),   g = L / I3 + L (1/I1 - 1/I3) Pi(n, k^2) / K,   n = I3 (I2 - I1) / (I1 (I2 - I3)).

Averaged over both angles the tensor is axisymmetric about L, so that the torque of a distant body is that of
an axisymmetric one whose C - A is (3 <m . I m> - tr I) / 2 (Chernousko 1963; Cochran 1972).

Two amplitudes describe all polhodes about one principal axis: the momentum of a free body is

    L1 = sqrt(r) Q cos f,   L2 = Q sin f,   L3 = P dn,   dn^2 = 1 - k^2 sin^2 f,
    r = I1 (I2 - I3) / (I2 (I1 - I3)),   k^2 = (1 - r) (Q / P)^2,   f' = P dn (I3 - I2) / (sqrt(r) I2 I3),

where f is the amplitude of Jacobi's functions (Landau & Lifshitz, Mechanics, section 37) and P and Q, the
largest components along the third and the second axis, are constant. They are functions of the energy and
the size of the momentum alone; under a torque N in the body

    Q' = N1 cos f / sqrt(r) + N2 sin f,     P' = N3 dn + (1 - r) (Q / P) N2 sin f.

Nothing is singular in a rotation about the third axis (Q = 0), nor for a symmetric body (r = 1, k = 0). A
mean over time is one over f with the weight 1 / dn.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

from rigidsim.scene.arithmetic import Matrix, Vector, cross, dot, negligible
from rigidsim.scene.bodies.body import RigidBody


class Separatrix(Exception):
    """Raised if the body turns about its intermediate axis, or on the separatrix through it."""


@dataclass(frozen=True)
class FreeMotion:
    """A free rotation; numbers are mpf, SI."""

    momentum: Any
    moments: Vector
    axes: Matrix  # the axes of these moments: unit, right-handed, body axes, with L . third positive
    parameter: Any  # k^2; 0 for a symmetric body, and for a rotation about a principal axis
    squares: Vector  # means of the squared components of m along the axes
    amplitudes: Vector  # |M1|, |M2|, |M3|
    symmetric: bool  # whether the first two moments are equal

    @property
    def excess(self) -> Any:
        """(3 <m . I m> - tr I) / 2, in place of C - A of an axisymmetric body in principal rotation."""
        mean = dot(self.moments, self.squares)
        return (3 * mean - sum(self.moments[1:], self.moments[0])) / 2

    def tilt(self, context: Any) -> Any:
        """Largest angle between L and the third axis, rad."""
        first, second, third = self.amplitudes
        return context.atan2(max(first, second), third)

    @property
    def transverse(self) -> Any:
        """Moment that sets how far the third axis stands off from L under a steady torque N.

        The offset is that moment times (s x N) / L^2 (see ``offset``), for rotations near that axis. The
        moment is A for a symmetric body; otherwise it follows from I1 w1' = (I2 - I3) w2 w3 + N1 and so on,
        with a torque that turns backwards in the body, averaged over the turn.
        """
        a, b, c = self.moments
        if a == b:
            return a
        return (4 * a * b - c * (a + b)) / (2 * (a + b - c))


def free_motion(context: Any, body: RigidBody, momentum: Vector, size: Any = None) -> FreeMotion:
    """The free motion of a body, perhaps with another size of the momentum in the same direction in the body;
    Separatrix if L circles neither axis of extreme moment.
    """
    tiny = negligible(context)
    length = context.sqrt(dot(momentum, momentum))
    moments, axes, symmetric = _ordered(context, body, momentum, length)
    if dot(axes[2], momentum) < 0:  # half a turn about the second
        axes = [[-x for x in axes[0]], axes[1], [-x for x in axes[2]]]
    parts = [dot(axis, momentum) / length for axis in axes]
    size = length if size is None else size
    first, second, third = moments
    if symmetric:
        across = context.sqrt(parts[0] ** 2 + parts[1] ** 2)
        squares, amplitudes = [across**2 / 2, across**2 / 2, parts[2] ** 2], [across, across, parts[2]]
        return FreeMotion(size, [first, first, third], axes, context.zero, squares, amplitudes, True)
    # (L^2 - 2 E I) / L^2 for the moments of the third and the first axis
    of_third = sum(x * x * (1 - third / i) for x, i in zip(parts[:2], moments[:2], strict=True))
    of_first = sum(x * x * (1 - first / i) for x, i in zip(parts[1:], moments[1:], strict=True))
    parameter = of_third * (first - second) / (of_first * (third - second))
    if not parameter < 1 - tiny:
        raise Separatrix
    amplitudes = [
        context.sqrt(abs(of_third * first / (first - third))),
        context.sqrt(abs(of_third * second / (second - third))),
        context.sqrt(abs(of_first * third / (third - first))),
    ]
    sines = mean_square_sine(parameter, context.sqrt, _MEANS)
    means = 1 - sines, sines, 1 - parameter * sines  # of cn^2, sn^2, dn^2
    squares = [a * a * x for a, x in zip(amplitudes, means, strict=True)]
    return FreeMotion(size, moments, axes, parameter, squares, amplitudes, symmetric)


def _ordered(context: Any, body: RigidBody, momentum: Vector, length: Any) -> tuple[Vector, Matrix, bool]:
    """Moments and axes, the circled axis last, and whether the body is symmetric about it."""
    tiny = max(body.principal_moments) * negligible(context)
    order = sorted(range(3), key=lambda i: body.principal_moments[i])
    moments = [body.principal_moments[i] for i in order]
    axes = [list(body.principal_axes[i]) for i in order]
    least, middle, most = moments
    if middle - least <= tiny:
        picked = (0, 1, 2)
    elif most - middle <= tiny:
        picked = (1, 2, 0)
    else:
        along = [dot(axis, momentum) / length for axis in axes]
        # the sign of L^2 - 2 E I2 decides which axis is circled
        beyond = along[0] ** 2 * (1 - middle / least) + along[2] ** 2 * (1 - middle / most)
        if abs(beyond) <= negligible(context):
            raise Separatrix
        picked = (0, 1, 2) if beyond > 0 else (2, 1, 0)
    symmetric = middle - least <= tiny or most - middle <= tiny
    chosen = [axes[i] for i in picked]
    if dot(cross(chosen[0], chosen[1]), chosen[2]) < 0:
        chosen[0] = [-x for x in chosen[0]]
    return [moments[i] for i in picked], chosen, symmetric


_MEANS = 40  # arithmetic-geometric means; each squares what is left
_STRIPS = 64  # of complex amplitudes, over which the bound of a sum's error is made small


@dataclass(frozen=True)
class Polhodes:
    """All polhodes of a body about one axis; r is ``ratio``, sqrt(r) ``root``; numbers are mpf, SI."""

    moments: Vector
    axes: Matrix
    ratio: Any
    root: Any

    @classmethod
    def of(cls, context: Any, motion: FreeMotion) -> Self:
        """The family to which a free motion's polhode belongs."""
        first, second, third = motion.moments
        ratio = context.one
        if not motion.symmetric:
            ratio = first * (second - third) / (second * (first - third))
        return cls(motion.moments, motion.axes, ratio, context.sqrt(ratio))

    @property
    def symmetric(self) -> bool:
        """Whether the first two moments are equal."""
        return bool(self.ratio == 1)

    def energy(self, axial: Any, transverse: Any) -> Any:
        """Energy of rotation, J, of amplitudes P and Q."""
        first, _, third = self.moments
        return (self.ratio * transverse * transverse / first + axial * axial / third) / 2

    def momentum(self, context: Any, axial: Any, transverse: Any, cosine: Any, sine: Any) -> Vector:
        """Angular momentum where f has this cosine and sine, body axes, kg m^2/s."""
        squared = axial * axial - (1 - self.ratio) * (transverse * sine) ** 2
        third = context.sqrt(squared) * (1 if axial >= 0 else -1)
        parts = [self.root * transverse * cosine, transverse * sine, third]
        return [sum(p * axis[i] for p, axis in zip(parts, self.axes, strict=True)) for i in range(3)]


def mean_square_sine(parameter: Any, root: Callable[[Any], Any], means: int) -> Any:
    """<sin^2 f> = (K - E) / (k^2 K) by so many arithmetic-geometric means (Abramowitz & Stegun 17.6), free of
    their cancellation: 1/2 (1 + sum of 2^n c_n^2 / k^2); k^2 is a number, an array or an expression.
    """
    smaller = root(1.0 - parameter)
    greater = 0.5 * (1.0 + smaller)
    # c_1 = k^2 / (4 a_1); shares are c_n^2 / k^2
    share = parameter / (16.0 * (greater * greater))
    square = parameter * share
    total, power = 1.0 + 2.0 * share, 2.0
    a, b = greater, root(smaller)
    for _ in range(means - 1):
        a, b = 0.5 * (a + b), root(a * b)
        inverse = 1.0 / (16.0 * (a * a))
        share, square, power = share * square * inverse, square * square * inverse, 2 * power
        total = total + power * share
    return 0.5 * total


def means_needed(parameter: float, epsilon: float) -> int:
    """How many means ``mean_square_sine`` takes for an error below epsilon, up to a parameter below 1."""
    if parameter <= 0:
        return 1
    smaller = math.sqrt(1.0 - parameter)
    a, b = (1.0 + smaller) / 2, math.sqrt(smaller)
    square, power = (parameter / (4 * a)) ** 2, 2.0
    for count in range(1, _MEANS):
        a, b = (a + b) / 2, math.sqrt(a * b)
        square, power = square * square / (16 * a * a), 2 * power
        # what is left out is this term and terms that are smaller by its square
        if power * square < epsilon * parameter / 4:
            return count
    return _MEANS


def nodes_needed(parameter: float, epsilon: float) -> int:
    """Nodes over a turn of f for which sums with the weight 1 / dn err by less than epsilon.

    The trapezoidal sum over n nodes of a function that is analytic and at most M for abs(Im f) < b errs by
    2 M / (e^(n b) - 1) (Trefethen & Weideman 2014, SIAM Review 56, theorem 3.2). Here cosh b < 1 / k, and
    M = (1 - k^2 cosh^2 b)^(-1/2); a torque that isn't smooth needs more (``DrivingTorques.nodes``).
    """
    if parameter <= 0:
        return 1
    widest = math.acosh(1 / math.sqrt(parameter))
    fewest = math.inf
    for strip in range(1, _STRIPS):
        width = min(widest, 40.0) * strip / _STRIPS
        largest = (1 - parameter * math.cosh(width) ** 2) ** -0.5
        fewest = min(fewest, math.log1p(2 * largest / epsilon) / width)
    return math.ceil(fewest)
