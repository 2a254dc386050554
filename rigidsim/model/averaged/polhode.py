"""Polhodes about one principal axis, by two amplitudes of the angular momentum, and means over them.

With the moments I1, I2, I3 as in ``free_motion``, the momentum of a free body has the components

    L1 = sqrt(r) Q cos f,   L2 = Q sin f,   L3 = P dn,   dn^2 = 1 - k^2 sin^2 f,
    r = I1 (I2 - I3) / (I2 (I1 - I3)),   k^2 = (1 - r) (Q / P)^2,   f' = P dn (I3 - I2) / (sqrt(r) I2 I3),

where f is the amplitude of Jacobi's functions (Landau & Lifshitz, Mechanics, section 37) and P and Q, the
largest components along the third and the second axis, are constant. They are functions of the energy and
the size of the momentum alone; under a torque N in the body

    Q' = N1 cos f / sqrt(r) + N2 sin f,     P' = N3 dn + (1 - r) (Q / P) N2 sin f.

Nothing is singular in a rotation about the third axis (Q = 0), nor for a symmetric body (r = 1, k = 0). A
mean over time is one over f with the weight 1 / dn.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rigidsim.model.averaged.free_motion import FreeMotion
from rigidsim.scene.arithmetic import Matrix, Vector

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
    def of(cls, context: Any, motion: FreeMotion) -> Polhodes:
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

    def size(self, context: Any, axial: Any, transverse: Any) -> Any:
        """Size of the momentum, kg m^2/s, of amplitudes P and Q."""
        return context.sqrt(self.ratio * transverse * transverse + axial * axial)

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
