"""Free rotation over which torques are averaged: its mean inertia tensor, and its amplitudes.

A free body's angular momentum L is fixed in space while the body turns about it. One of its principal axes,
the one that L circles in the body, precesses about L at the mean rate g and nods with the polhode's period
2 pi / l (``Wobble`` has both rates). With I3 the moment of that axis, I2 the intermediate moment and I1 the
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

**One turn of the wobble**, in double precision: what averaging over it removes. At the amplitude f the body's
principal axes follow from a frame with z along the angular momentum by R_z(g t) R_z(phase) R_x(nodding)
R_z(own). With theta = l t, any function of f is a sum of harmonics c_j exp(i j theta). One that precesses i
times is a sum of c_j exp i(i g t + j l t), of which an average keeps i = j = 0; the rest has the integral
over time c_j exp i(i g t + j l t) / (i (i g + j l)).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

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


_MEANS = 40  # arithmetic-geometric means; each squares the remainder


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
        # this term is neglected, and terms that are smaller by its square
        if power * square < epsilon * parameter / 4:
            return count
    return _MEANS


def parameter_of(ratio: float, axial: float, transverse: float) -> float:
    """k^2 at amplitudes P and Q."""
    return (1 - ratio) * (transverse / axial) ** 2 if ratio != 1 else 0.0


def along_polhode(
    ratio: float, axial: float, transverse: float, angle: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Momentum along the principal axes, (3, n), and dn, (n,), at amplitudes f."""
    cosine, sine = np.cos(angle), np.sin(angle)
    delta = np.sqrt(1 - parameter_of(ratio, axial, transverse) * sine**2)
    return np.array([math.sqrt(ratio) * transverse * cosine, transverse * sine, axial * delta]), delta


# --- one turn of the wobble ---------------------------------------------------------------------------------

_POINTS = 256
ORDERS = np.fft.fftfreq(_POINTS, 1 / _POINTS)
"""j of the harmonics."""
_LEAST = 1e-12  # of the largest harmonic, which rounding leaves


class Wobble:
    """A free rotation of amplitudes P (``axial``) and Q (``transverse``) from f = ``amplitude`` on.

    Attributes:
        amplitudes: f at equal steps of time, the present one first.
        momentum: along the principal axes, (3, points).
        size: of the momentum.
        parameter: k^2.
        rates: g and l; l is signed.
        turns: rotations from the principal axes to a frame that precesses at g, (points, 3, 3).
    """

    def __init__(
        self, moments: Sequence[Any], axial: float, transverse: float, amplitude: float = 0.0
    ) -> None:
        first, second, third = (float(x) for x in moments)
        ratio = first * (second - third) / (second * (first - third)) if first != second else 1.0
        self.moments, root = np.array([first, second, third]), math.sqrt(ratio)
        self.parameter = parameter_of(ratio, axial, transverse)
        self.size = math.hypot(axial, root * transverse)
        means = _means(self.parameter)
        self._theta = _wobbled(amplitude, means)
        self.amplitudes = _amplitudes(self._theta + 2 * np.pi * np.arange(_POINTS) / _POINTS, means)
        cosine, sine, sign = np.cos(self.amplitudes), np.sin(self.amplitudes), math.copysign(1.0, transverse)
        self.momentum, _ = along_polhode(ratio, axial, transverse, self.amplitudes)
        # f' = pace dn, of which 1 / dn has the mean 2 K / pi
        wobble = axial * (third - second) / (root * second * third) * means[-1][0]
        squares = ratio * cosine**2, sine**2
        rate = self.size * (squares[0] / first + squares[1] / second) / (squares[0] + squares[1])
        self.rates = float(rate.mean()), wobble
        parts = np.fft.fft(rate) / np.where(ORDERS == 0, 1.0, 1j * ORDERS * wobble if wobble else math.inf)
        phase = np.fft.ifft(np.where(ORDERS == 0, 0.0, parts)).real
        nodding = np.arctan2(np.hypot(*self.momentum[:2]), self.momentum[2])
        own = np.arctan2(sign * root * cosine, sign * sine)
        self.turns = _about_z(phase) @ _about_x(nodding) @ _about_z(own)

    @classmethod
    def of(cls, motion: FreeMotion, direction: Vector | None = None) -> "Wobble":
        """The wobble of a free motion, SI, from where the momentum has this direction (unit, body axes)."""
        first, transverse, axial = (float(motion.momentum * x) for x in motion.amplitudes)
        amplitude = 0.0
        if direction is not None and transverse != 0:
            along = [float(dot(axis, direction)) for axis in motion.axes[:2]]
            amplitude = math.atan2(along[1], along[0] * transverse / first)
        return cls(motion.moments, axial, transverse, amplitude)

    @property
    def excess(self) -> float:
        """See ``FreeMotion``."""
        squares = (self.momentum**2).mean(axis=1) / self.size**2
        return float(3 * self.moments @ squares - self.moments.sum()) / 2

    def removed(self, values: np.ndarray, order: int, scale: float, least: float = 0.0) -> Any:
        """At the present f, the integral over time without a mean of rates (.., points) that precess so many
        times, in the frame that precesses. Harmonics that are rounding of a scale are left out, and those
        whose frequencies are below ``least`` times their sizes.
        """
        parts, frequencies = np.fft.fft(values) / _POINTS, order * self.rates[0] + ORDERS * self.rates[1]
        sizes = np.abs(parts)
        moving = (np.abs(frequencies) > least * sizes) & (sizes > _LEAST * scale) & (frequencies != 0)
        return np.where(moving, parts / np.where(moving, 1j * frequencies, 1.0), 0.0).sum(axis=-1)

    def precessed(self, matrix: np.ndarray) -> float:
        """Angle of precession of a rotation from the principal axes to a frame with z along the momentum."""
        turned = matrix @ self.turns[0].T
        return math.atan2(turned[1, 0] - turned[0, 1], turned[0, 0] + turned[1, 1])

    # --- the inertia tensor ---------------------------------------------------------------------------------

    @cached_property
    def tensor(self) -> np.ndarray:
        """T_zz - tr T / 3, T_xz + i T_yz and (T_xx - T_yy) / 2 + i T_xy, which precess 0, 1 and 2 times."""
        excess = self.moments - self.moments.min()  # a sphere's part is constant
        t = np.einsum("nab,b,ncb->acn", self.turns, excess, self.turns)
        parts = [t[2, 2] - excess.sum() / 3 + 0j, t[0, 2] + 1j * t[1, 2]]
        return np.array([*parts, (t[0, 0] - t[1, 1]) / 2 + 1j * t[0, 1]])

    def strong(self, weak: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Sizes, i, j and i g + j l of the tensor's harmonics that averaging removes, (harmonics,), as far as
        they are larger than a part of the largest moment.
        """
        sizes = np.abs(np.fft.fft(self.tensor) / _POINTS)
        sizes[0, 0] = 0.0
        i, j = np.nonzero(sizes > weak * self.moments.max())
        return sizes[i, j], i, ORDERS[j], i * self.rates[0] + ORDERS[j] * self.rates[1]

    def removed_tensor(self, precession: float) -> np.ndarray:
        """Integral over time of the tensor's part that averaging removes, (3, 3), in the momentum's frame."""
        scale = float(np.ptp(self.moments))
        parts = [self.removed(self.tensor[i], i, scale) * np.exp(1j * i * precession) for i in range(3)]
        axial, once, twice = parts[0].real, parts[1], parts[2]
        return np.array(
            [
                [-axial / 2 + twice.real, twice.imag, once.real],
                [twice.imag, -axial / 2 - twice.real, once.imag],
                [once.real, once.imag, axial],
            ]
        )


def _means(parameter: float) -> list[tuple[float, float]]:
    """Arithmetic-geometric means of 1 and k' (Abramowitz & Stegun 16.4)."""
    found = [(1.0, math.sqrt(1 - parameter))]
    while abs(found[-1][0] - found[-1][1]) > 1e-16 * found[-1][0] and len(found) < 40:
        a, b = found[-1]
        found.append(((a + b) / 2, math.sqrt(a * b)))
    return found


def _amplitudes(theta: np.ndarray, means: list[tuple[float, float]]) -> np.ndarray:
    """Jacobi's amplitude of 2 K theta / pi, by descending transformations of Landen."""
    phase = 2.0 ** (len(means) - 1) * theta
    for a, b in reversed(means[:-1]):
        phase = (phase + np.arcsin(np.clip((a - b) / (a + b) * np.sin(phase), -1, 1))) / 2
    return phase


def _wobbled(amplitude: float, means: list[tuple[float, float]]) -> float:
    """The inverse, pi F(amplitude) / (2 K)."""
    for a, b in means[:-1]:
        turned = math.remainder(amplitude, 2 * math.pi)
        amplitude += math.atan2(b * math.sin(turned), a * math.cos(turned)) + amplitude - turned
    return amplitude / 2.0 ** (len(means) - 1)


def _about_z(angle: np.ndarray) -> np.ndarray:
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.moveaxis(np.array([[c, -s, zero], [s, c, zero], [zero, zero, one]]), 2, 0)


def _about_x(angle: np.ndarray) -> np.ndarray:
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.moveaxis(np.array([[one, zero, zero], [zero, c, -s], [zero, s, c]]), 2, 0)
