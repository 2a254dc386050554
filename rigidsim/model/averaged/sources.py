"""Sources of averaged torques: on Kepler or tabulated orbits, at fixed positions, from an ephemeris, or point
masses; the torque of a source averaged over its orbit, and the terms removed, to first order.

With k = 3 (G M / a^3) (excess / L) the direction s of the momentum changes as

    s' = k (a/r)^3 (s . r) (r x s) = k (Q s) x s,   Q = (a/r)^3 r r^T,

whose mean over the mean anomaly is (1 - e^2)^(-3/2) (1 - n n^T) / 2 for a normal n, so that

    s' = -(k/2) (1 - e^2)^(-3/2) (n . s) (n x s)

(Ward 1974; Laskar & Robutel 1993). What is left has the integral J over time, without a mean: with the true
anomaly f, the mean anomaly M, P and T the unit vectors to pericentre and across, since (a/r)^3 dM =
(1 - e^2)^(-3/2) (1 + e cos f) df,

    2 n J (1 - e^2)^(3/2) = (f - M + e sin f) (P P^T + T T^T) + S (P P^T - T T^T) + C (P T^T + T P^T),
    S = sin(2 f) / 2 + e sin(f) / 2 + e sin(3 f) / 6,
    C = -cos(2 f) / 2 - e cos(f) / 2 - e cos(3 f) / 6, less its mean,

with <cos k f> = (-b)^k (1 + k sqrt(1 - e^2)), b = e / (1 + sqrt(1 - e^2)). The nutation with the orbit's
period is k (J s) x s then, and s is the mean direction (the first order of Kinoshita 1977).

To second order the mean turns by <DF u> besides, with F the rest of s' and u the nutation. Both have
potentials, h = k s . (Q - <Q>) s / 2 and H = k s . J s / 2 with s' = grad h x s, so that it is grad K x s,

    K = <s . (grad h x grad H)> / 2 = (k^2 / 4) z (c0 (x^2 - y^2) + c1 (x^2 + y^2)),

x, y, z being the parts of s along P, T and n, c0 = <(a/r)^3 C> and c1 = <(a/r)^3 cos(2 f) C> over
n (1 - e^2)^(3/2): c1 = -(1/4 + e^2/6) (1 - e^2)^(-3) / n. For the Earth and the Sun it is 6e-6 of the
precession. An orbit by a table has the same terms with its instantaneous axis, eccentricity and plane; what
goes round with its pericentre is periodic, and left out of the second order.

**Spin-orbit resonance**: p turns of the body to one revolution of its source, 2 p = k a whole number.

**Sums over the anomaly** are what averaging over the orbit removes, and what it leaves behind to second
order. In the frame of the resonance (body axes turned back by p M about the momentum) the rates of attitude
and momentum are periodic in M at fixed slow states x, x' = f(x, M). With u the integral over time of what
isn't their mean, the motion is x + u to first order, and x' = <f(x + u, M)> to second (Bogoliubov &
Mitropolsky 1961). The frame's rate W is along body axes and its u a rotation vector, so that <u x du/dt> / 2
adds to it. The sums are in double precision: they correct initial states and slow rates.

The second order is the torque of a potential K of the frame against the orbit. Of its harmonics those that
don't vanish with the eccentricity are

    K = sum k_j x^j (j = 1..4) + Re(z^2) (k_5 + k_6 x + k_7 x^2) + k_8 Re(z^4),
    x = n . c,   z = (P - i T) . (a + i b) / 2,

n, P, T being the orbit's normal, pericentre and across, and a, b, c the principal axes brought to the
momentum by the shortest turn; the k_j come from a fit over all orientations. For whole p the rest is e^2
times as large, for half-integers e times.

**The mean.** The body turns nearly about its axis of largest moment. Turned back by p times the mean anomaly
M about the momentum L s, its principal axes a, b, c move slowly, and with P and T the directions of the
orbit's pericentre and across, averaged over M,

    U = (3 G M / 2 a^3) sum over i = a, b, c of I_i <(a/r)^3 (i . r)^2>,
    <(a/r)^3 (i . r)^2> = X_0^0 m^2 (P_s^2 + T_s^2) / 2
        + ((X_0^0 + X_k^2) S^2 + (X_0^0 - X_k^2) D^2 + (X_0^0 + X_k^-2) S'^2 + (X_0^0 - X_k^-2) D'^2) / 8
        + X_k^0 (S S' + D D') / 4
        + m (P_s ((Y_0 + Y_2) S + (Y_0 + Y_-2) S') + T_s ((Y_0 - Y_2) D + (Y_0 - Y_-2) D')) / 2,
    S, S' = E_P +- G_T,   D, D' = E_T -+ G_P,   m = i . s,   P_s = P . s,   T_s = T . s,
    E_P = P . (i - m s),   G_P = P . (s x i),   and so for T,

with Hansen's coefficients X_k^m = X_k^{-3,m}(e), and Y_m = X_p^{-3,m}(e) for whole p and 0 elsewhere: the
whole mean at fixed a, b, c and s, at any obliquity and eccentricity. For c along s and about the orbit's
normal it is the potential of Goldreich & Peale 1966; with a moving node it has Colombo's top and Cassini's
states (Colombo 1966; Peale 1969, Astronomical Journal 74, 483) besides. The terms in Y are constant in the
body, and for a nearly spherical one, whose free wobble is as slow, bend c away from s by some 3 e times the
obliquity.
"""

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import heyoka as hy
import numpy as np

from rigidsim.errors import required
from rigidsim.model.averaged.free_motion import FreeMotion
from rigidsim.model.load import Load
from rigidsim.model.loads.gravity import Attraction
from rigidsim.model.orbits import ElementStates
from rigidsim.model.placements import Circuit
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.two_part import as_factor, rounded
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import (
    Matrix,
    Vector,
    apply,
    cross,
    dot,
    eccentric_anomaly,
    hansen,
    multiply,
    norm,
    transpose,
)
from rigidsim.scene.kepler import eccentric_anomalies, plane_vectors, turned
from rigidsim.scene.orbit_tables import AXIS
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene

_POINTS = 4096


@dataclass(frozen=True)
class OrbitPlace:
    """Position on an orbit by the eccentric anomaly and the unit vectors P and T, numbers or expressions."""

    cosine: Any
    sine: Any
    pericentre: Vector
    across: Vector

    def seen(self, e: Any = None, root: Any = None) -> tuple[list[Symbolic], Symbolic]:
        """Direction, and semi-major axis over distance, for e and sqrt(1 - e^2); for a circle without."""
        x, y, inverse = self.cosine, self.sine, hy.expression(1.0)
        if e is not None:
            inverse = 1.0 / (1.0 - e * x)
            x, y = (x - e) * inverse, root * y * inverse
        return [x * p + y * t for p, t in zip(self.pericentre, self.across, strict=True)], inverse


@dataclass(frozen=True)
class Ellipse:
    """Shape (e, e^2, sqrt(1 - e^2), whether e is known to be 0) and mean motion; mpf or expressions."""

    eccentricity: Any
    square: Any
    root: Any
    motion: Any
    circular: bool

    @classmethod
    def of(cls, context: Any, orbit: KeplerOrbit) -> Self:
        """The ellipse of an orbit with constant elements (mpf, rad/s)."""
        e = orbit.eccentricity
        return cls(e, e * e, context.sqrt(1 - e * e), orbit.mean_motion, orbit.circular)

    @property
    def secular_factor(self) -> Any:
        """Factor (1 - e^2)^(-3/2) / 2 of the secular torque."""
        return 1 / (2 * (1 - self.square) * self.root)

    @property
    def across(self) -> Any:
        """-n c1, the second-order coefficient of the module's formula."""
        rest = 1 - self.square
        return (0.25 + self.square / 6) / (rest * rest * rest)


def steady(eccentricity: float) -> float:
    """n c0 (see ``Ellipse.across``), by the trapezoidal rule over the eccentric anomaly."""
    e, root = eccentricity, math.sqrt(1 - eccentricity**2)
    anomaly = 2 * np.pi * np.arange(_POINTS) / _POINTS
    radius = 1 - e * np.cos(anomaly)
    f = np.arctan2(root * np.sin(anomaly) / radius, (np.cos(anomaly) - e) / radius)
    weight = radius / _POINTS  # dM
    across = -np.cos(2 * f) / 2 - e * np.cos(f) / 2 - e * np.cos(3 * f) / 6
    across = (across - (weight * across).sum()) / root**3
    return float((weight * radius**-3.0 * across).sum())


def nutation(
    functions: Any, ellipse: Ellipse, place: OrbitPlace, size: Any, s: Vector, number: Any
) -> Vector:
    """Nutation k (J s) x s for a size k / (2 n) (1 - e^2)^(-3/2), by functions of heyoka or of mpmath;
    ``number`` makes the ellipse's values factors.
    """
    e, root = ellipse.eccentricity, ellipse.root
    b = e / (1 + root)
    once, twice, thrice = ((-b) ** k * (1 + k * root) for k in (1, 2, 3))  # means of cos(k f)
    mean = -(twice / 2 + e * once / 2 + e * thrice / 6)
    c, sn = place.cosine, place.sine
    # the true minus the eccentric anomaly, then the true anomaly
    ahead = 0 if ellipse.circular else 2 * functions.atan2(number(b) * sn, 1 - number(b) * c)
    inverse = 1 if ellipse.circular else 1 / (1 - number(e) * c)
    cf = c if ellipse.circular else (c - number(e)) * inverse
    sf = sn if ellipse.circular else number(root) * sn * inverse
    c2, s2 = cf * cf - sf * sf, 2 * sf * cf
    odd, even = 0.5 * s2, -(0.5 * c2) - number(mean)
    equation = None
    if not ellipse.circular:
        c3, s3 = c2 * cf - s2 * sf, s2 * cf + c2 * sf
        odd = odd + number(e / 2) * sf + number(e / 6) * s3
        even = even - number(e / 2) * cf - number(e / 6) * c3
        # f - M + e sin f
        equation = ahead + number(e) * sn + number(e) * sf
    along, beside = dot(place.pericentre, s), dot(place.across, s)
    first = odd * along + even * beside
    second = even * along - odd * beside
    if equation is not None:
        first, second = first + equation * along, second + equation * beside
    tensor = [first * p + second * t for p, t in zip(place.pericentre, place.across, strict=True)]
    return [size * x for x in cross(tensor, s)]


def place_by_elements(
    functions: Any, elements: Mapping[str, Any], anomaly: Any, periapsis: Any
) -> OrbitPlace:
    """The place of an eccentric anomaly, by elements q and p of ``rigidsim.scene.orbit_tables``."""
    q, p = elements["q"], elements["p"]
    chi, product = functions.sqrt(1.0 - p * p - q * q), 2 * p * q
    axes = [1 - 2 * p * p, product, -2 * p * chi], [product, 1 - 2 * q * q, 2 * q * chi]
    turn = functions.cos(periapsis), functions.sin(periapsis)
    return OrbitPlace(functions.cos(anomaly), functions.sin(anomaly), *turned(axes, turn))


@dataclass(frozen=True)
class OrbitTerms:
    """An orbit as an average over it uses it: numbers (mpf) if it is prescribed, expressions if tabulated.

    Attributes:
        ellipse: of the moment, its mean motion per internal unit of time.
        place: of the source; None if the mean longitude isn't carried.
        cubed: (mean axis / axis)^3.
        apsides: P and T of a fixed ellipse; None of one whose pericentre moves, where the terms that go round
            with it are periodic, and of a circle.
    """

    ellipse: Ellipse
    normal: list[Symbolic]
    place: OrbitPlace | None
    cubed: Any
    number: Rounder
    apsides: tuple[list[Symbolic], list[Symbolic]] | None = None

    @classmethod
    def of_elements(cls, states: ElementStates, number: Rounder) -> Self:
        """Terms of a tabulated orbit."""
        value = {name: rounded(x) for name, x in states.values.items()}
        k, h, axis, place = value["k"], value["h"], value[AXIS], None
        square = k * k + h * h
        eccentricity, root = hy.sqrt(square), hy.sqrt(1.0 - square)
        if states.mean_longitude is not None:
            periapsis = hy.atan2(h, k)
            anomaly = hy.kepE(eccentricity, states.mean_longitude - periapsis)
            place = place_by_elements(hy, value, anomaly, periapsis)
        ellipse = Ellipse(eccentricity, square, root, rounded(states.pace), False)
        return cls(ellipse, states.normal, place, 1.0 / (axis * axis * axis), number)

    def _times(self, size: Any, value: Any = 1) -> Symbolic:
        """A number times a value, which is rounded with it if it is a number, too."""
        if isinstance(value, hy.expression):
            return as_factor(self.number(size)) * value
        return as_factor(self.number(size * value))

    def secular(
        self, rate: Any, s: list[Symbolic], *, second: bool, growth: Symbolic | None = None
    ) -> list[Symbolic]:
        """Vector whose product with s is s', to first or second order; k (mpf) is that at the mean axis, and
        grows by a factor to first order.
        """
        normal, ellipse = self.normal, self.ellipse
        z = dot(normal, s)
        factor = self._times(-rate, ellipse.secular_factor * self.cubed) * z
        if growth is not None:
            factor = factor * growth
        if second:  # (k^2 / 4) c1 (1 - 3 z^2)
            across = ellipse.across * (self.cubed * self.cubed) / ellipse.motion
            factor = factor + self._times(rate * rate / 4, across) * (3.0 * (z * z) - 1.0)
        found = [factor * x for x in normal]
        if not second or self.apsides is None:
            return found
        p, t = self.apsides
        x, y = dot(p, s), dot(t, s)
        more = self._times(rate * rate / 4, steady(float(ellipse.eccentricity)) / ellipse.motion)
        towards = zip(found, normal, p, t, strict=True)
        return [g + more * ((x * x - y * y) * n + 2.0 * (z * (x * a - y * b))) for g, n, a, b in towards]

    def nutation(self, rate: Any, s: list[Symbolic]) -> list[Symbolic]:
        """See the function ``nutation``; ``rate`` as above."""
        root, place = self.ellipse.root, required(self.place)
        size = self._times(rate / 2, self.cubed / (self.ellipse.motion * (root * root * root)))
        given = isinstance(root, hy.expression)
        return nutation(hy, self.ellipse, place, size, s, (lambda x: x) if given else self.number)


# --- sources ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Source(Circuit):
    """The source of one gravity gradient; a point mass is judged by its osculating orbit of the start."""

    number: int  # position of its ``[[loads]]`` table, from 1
    of: Attraction
    strength: Any  # 3 G M / a^3 (mpf, 1/s^2), a being ``Placement.distance``

    @classmethod
    def at_start(cls, context: Any, number: int, source: Attraction) -> Self:
        """The source as it moves at the start."""
        size = 3 * source.gravitational_parameter / source.placement.distance(context) ** 3
        circuit = vars(source.placement.circuit(context))
        return cls(number=number, of=source, strength=size, **circuit)

    @property
    def name(self) -> str:
        """What messages call it."""
        name = self.of.placement.name
        return f'number {self.number} ("{name}")' if name else f"number {self.number}"

    @property
    def has_elements(self) -> bool:
        """Whether the source has an orbit to average over."""
        return self.of.orbit is not None or self.of.table is not None

    @property
    def harmonics(self) -> np.ndarray:
        """Sizes (Frobenius norms) of the harmonics k >= 0 of (a/r)^3 r r^T in the mean motion."""
        if self.motion == 0:
            return np.ones(1)
        e, points = self.eccentricity, 512 if self.eccentricity < 0.6 else 4096
        anomaly = eccentric_anomalies(2 * np.pi * np.arange(points) / points, e)
        x, y = np.cos(anomaly) - e, math.sqrt(1 - e * e) * np.sin(anomaly)
        place = np.array([x, y])
        parts = np.fft.fft(place[:, None] * place[None, :] * (x * x + y * y) ** -2.5) / points
        return np.asarray(np.linalg.norm(parts, axis=(0, 1))[: points // 2])

    def strength_at(self, context: Any, time: Any) -> Any:
        """3 G M / a^3 (mpf, 1/s^2) at a time."""
        if self.of.table is None:
            return self.strength
        axis = self.of.table.at(time)[AXIS] / self.of.table.semi_major_axis
        return self.strength if axis == 1 else self.strength / axis**3

    def ellipse(self, context: Any, time: Any) -> Ellipse:
        """Shape and mean motion of the source's orbit at a time, numbers (mpf)."""
        if self.of.table is not None:
            found = self.of.table.at(time)
            square = found["k"] ** 2 + found["h"] ** 2
            root = context.sqrt(1 - square)
            return Ellipse(context.sqrt(square), square, root, self.of.table.motion(found[AXIS]), False)
        return Ellipse.of(context, required(self.of.orbit))

    def secular_strength(self, context: Any) -> Any:
        """3 G M / (2 a^3) (1 - e^2)^(-3/2) (mpf, 1/s^2) of an orbit, the largest in a table."""
        if self.of.table is not None:
            rest = 1 - self.of.table.largest_eccentricity**2
            size = self.strength * (self.of.table.semi_major_axis / self.of.table.smallest_axis) ** 3
            return size / (2 * rest * context.sqrt(rest))
        return self.strength * Ellipse.of(context, required(self.of.orbit)).secular_factor

    def normal(self, context: Any, time: Any) -> Vector:
        """Unit normal of the orbit's plane, space axes; at time zero if the node moves uniformly."""
        if self.of.table is not None:
            return self.of.table.normal(time)
        return required(self.of.orbit).normal(context)

    def place(self, context: Any, time: Any) -> OrbitPlace:
        """Position on the orbit at a time, numbers (mpf)."""
        if self.of.table is not None:
            found = self.of.table.at(time)
            ellipse, longitude = self.ellipse(context, time), self.of.table.starting_longitude(time)
            periapsis = context.atan2(found["h"], found["k"])
            anomaly = eccentric_anomaly(context, longitude - periapsis, ellipse.eccentricity)
            return place_by_elements(context, found, anomaly, periapsis)
        orbit = required(self.of.orbit)
        anomaly = orbit.eccentric_anomaly(context, time)
        angles = (
            orbit.inclination,
            orbit.ascending_node + orbit.node_rate * time,
            orbit.periapsis + orbit.periapsis_rate * time,
        )
        tilt, node, periapsis = ((context.cos(x), context.sin(x)) for x in angles)
        return OrbitPlace(context.cos(anomaly), context.sin(anomaly), *plane_vectors(tilt, node, periapsis))

    def pull_at_start(self, scene: Scene) -> np.ndarray | None:
        """(a/r)^3 r r^T, (3, 3), where the run begins; None for a series of time."""
        placement, context, time = self.of.placement, scene.context, scene.start
        if placement.of_time:
            return None
        if not self.has_elements:
            place = placement.at_start(scene)
            length = norm(context, place)
            direction = np.array([float(x / length) for x in place])
            return np.outer(direction, direction) * float(placement.distance(context) / length) ** 3
        e, at = float(self.ellipse(context, time).eccentricity), self.place(context, time)
        c, s = float(at.cosine), float(at.sine)
        x, y = c - e, math.sqrt(1 - e * e) * s
        radius = math.hypot(x, y)
        along, across = (np.array(vector, dtype=float) for vector in (at.pericentre, at.across))
        direction = (x * along + y * across) / radius
        scale = float(self.strength_at(context, time) / self.strength)
        return np.outer(direction, direction) * scale / radius**3


def sources_of(scene: Scene, loads: Sequence[Load]) -> list[Source]:
    """Sources of all gravity gradients of a scene, with their strengths."""
    found = [(number, load.gradient_source) for number, load in enumerate(loads, start=1)]
    return [Source.at_start(scene.context, n, source) for n, source in found if source is not None]


def unit(context: Any, vector: Vector) -> Vector:
    """The vector divided by its length."""
    length = norm(context, vector)
    return [x / length for x in vector]


_POINTS_PER_TURN = ((0.3, 64), (0.6, 256), (1.0, 8192))
"""Points per turn up to an eccentricity; harmonics beyond are below double precision up to 0.6."""

_TILTS, _PHASES = 6, 8  # a quadrature over orientations that is exact for harmonics of fourth degree
_STEP = 1e-20  # of derivatives in the complex plane
_MOST_POINTS = 256  # per turn, for the second order


@dataclass(frozen=True)
class AnomalySums:
    """Sums over the orbits after which a motion in resonance repeats: one, or two for odd multiples.

    Units: mean motion and largest moment are 1.
    """

    moments: np.ndarray  # (3,), the largest, 1, last
    strength: float  # 3 G M / (a^3 n^2)
    eccentricity: float
    multiple: int  # k = 2 p
    most: int = 1 << 30  # points per turn; as many as are enough

    @cached_property
    def points(self) -> int:
        """Points per turn."""
        return min(self.most, next(count for most, count in _POINTS_PER_TURN if self.eccentricity < most))

    @property
    def turns(self) -> int:
        """Number of orbits."""
        return 1 + self.multiple % 2

    @cached_property
    def mean(self) -> np.ndarray:
        """Mean anomalies, (n,)."""
        count = self.turns * self.points
        return np.asarray(2 * np.pi * np.arange(count) / self.points)

    @cached_property
    def place(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position along P and T, and distance, over a, (n, 1)."""
        e, anomaly = self.eccentricity, eccentric_anomalies(self.mean, self.eccentricity)
        x, y = np.cos(anomaly) - e, math.sqrt(1 - e * e) * np.sin(anomaly)
        return x[:, None], y[:, None], np.hypot(x, y)[:, None]

    def seen(self, along: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Places of the source (.., n, 3) for P and T (.., 3)."""
        x, y, _ = self.place
        return np.asarray(x * along[..., None, :] + y * across[..., None, :])

    def rates(self, source: np.ndarray, momentum: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """W, its periodic part alone, and the torque, all (.., n, 3) along the frame's axes."""
        size = np.linalg.norm(momentum, axis=-1, keepdims=True)
        about = momentum / size
        body = self._turned(source, about, -1.0)
        torque = self.strength / self.place[2] ** 5 * np.cross(body, self.moments * body)
        periodic = np.cross(about, self._turned(torque, about, 1.0) - torque) / size
        return momentum / self.moments - self.multiple / 2 * about + periodic, periodic, torque

    def _turned(self, vectors: np.ndarray, about: np.ndarray, sign: float) -> np.ndarray:
        angle = sign * self.multiple / 2 * self.mean[:, None]
        along = (vectors * about).sum(axis=-1, keepdims=True) * about
        return np.asarray(
            along + np.cos(angle) * (vectors - along) + np.sin(angle) * np.cross(about, vectors)
        )

    def integral(self, values: np.ndarray) -> np.ndarray:
        """Integral over time of (.., n, 3) less the mean, with zero mean."""
        order = np.fft.fftfreq(values.shape[-2], 1 / values.shape[-2])[:, None] / self.turns
        order[0] = 1.0
        waves = np.fft.fft(values, axis=-2)
        waves[..., 0, :] = 0.0
        return np.asarray(np.fft.ifft(waves / (1j * order), axis=-2).real)

    def removed(
        self, along: np.ndarray, across: np.ndarray, momentum: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """u at all anomalies: of the momentum, and a rotation vector of the frame, (.., n, 3).

        The angle about the largest moment's axis follows the momentum along it.
        """
        held = np.broadcast_to(momentum[..., None, :], (*momentum.shape[:-1], len(self.mean), 3))
        _, periodic, torque = self.rates(self.seen(along, across), held)
        added = self.integral(torque)
        turn = self.integral(periodic)
        turn[..., 2] += self.integral(added)[..., 2] / self.moments[2]
        return added, turn

    def at(self, anomaly: float, values: np.ndarray) -> np.ndarray:
        """Trigonometric interpolation of values (n, 3) to a mean anomaly, (3,)."""
        order = np.fft.fftfreq(len(values), 1 / len(values))[:, None] / self.turns
        waves = np.fft.fft(values, axis=0) / len(values)
        return np.asarray((waves * np.exp(1j * order * anomaly)).sum(axis=0).real)

    def second_order(self) -> np.ndarray:
        """Coefficients k_1 .. k_8 of K, (8,)."""
        along, across = _orientations()
        momentum = np.zeros((len(along), 3))
        momentum[:, 2] = self.multiple / 2
        added, turn = self.removed(along, across, momentum)
        source, held = self.seen(along, across), np.broadcast_to(momentum[:, None, :], added.shape)
        before = self._total(source, held)
        moved = np.einsum("...ji,...j->...i", _rotations(turn), source)
        after = self._total(moved, held + added, turn)
        torques = _torques(_terms, along, across)
        columns = torques.reshape(-1, torques.shape[-1])
        return np.asarray(np.linalg.lstsq(columns, (after - before).ravel(), rcond=None)[0])

    def _total(self, source: np.ndarray, momentum: np.ndarray, turn: np.ndarray | None = None) -> np.ndarray:
        """Mean rate (.., 3) of the momentum in space, axes of the mean frame."""
        rates, _, torque = self.rates(source, momentum)
        change = (np.cross(momentum, momentum / self.moments) + torque).mean(axis=-2)
        turning = rates.mean(axis=-2)
        if turn is not None:
            turning = turning + np.cross(turn, rates - turning[..., None, :]).mean(axis=-2) / 2
        return np.asarray(np.cross(turning, momentum.mean(axis=-2)) + change)


@functools.cache
def second_order(
    moments: tuple[float, ...], strength: float, eccentricity: float, multiple: int
) -> tuple[float, ...]:
    """Coefficients of K for a body and an orbit, in the units of ``AnomalySums``."""
    sums = AnomalySums(np.array(moments), strength, eccentricity, multiple, _MOST_POINTS)
    return tuple(sums.second_order().tolist())


def _terms(along: np.ndarray, across: np.ndarray) -> list[np.ndarray]:
    """The eight terms of K from the components of P and T along a, b, c."""
    (pa, pb, _), (ta, tb, _) = along, across
    x = pa * tb - pb * ta
    c, s = 0.5 * (pa + tb), 0.5 * (pb - ta)
    once = c * c - s * s
    skew = 2.0 * (c * s)
    squared = x * x
    powers = [x, squared, x * squared, squared * squared]
    return [*powers, once, x * once, squared * once, once * once - skew * skew]


def _torques(terms: Callable[[Any, Any], list[Any]], along: np.ndarray, across: np.ndarray) -> np.ndarray:
    """(orientations, 3, terms): P x dK/dP + T x dK/dT of each term, by derivatives in the complex plane."""
    found = []
    for axis in np.eye(3):
        step = 1j * _STEP
        moved = (v.T + step * np.cross(axis, v).T for v in (along, across))
        found.append(np.array(terms(*moved)).imag / _STEP)
    return np.moveaxis(np.array(found), (0, 1, 2), (1, 2, 0))


def _orientations() -> tuple[np.ndarray, np.ndarray]:
    """P and T, (orientations, 3), over all orientations of the frame."""
    tilts = np.arccos(np.polynomial.legendre.leggauss(_TILTS)[0])
    phases = 2 * np.pi * np.arange(_PHASES) / _PHASES
    angles = [g.ravel() for g in np.meshgrid(phases, tilts, phases + 0.1, indexing="ij")]
    matrices = _about_axis(angles[0], 2) @ _about_axis(angles[1], 0) @ _about_axis(angles[2], 2)
    return matrices[:, 0], matrices[:, 1]


def _about_axis(angle: np.ndarray, axis: int) -> np.ndarray:
    vectors = np.zeros((len(angle), 3))
    vectors[:, axis] = angle
    return _rotations(vectors)


def _rotations(vectors: np.ndarray) -> np.ndarray:
    """Rotation matrices (.., 3, 3) of rotation vectors."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    skew = np.zeros((*vectors.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        skew[..., i, j], skew[..., j, i] = -vectors[..., k], vectors[..., k]
    once, twice = np.sinc(angle / np.pi), np.sinc(angle / (2 * np.pi)) ** 2 / 2
    return np.asarray(np.eye(3) + once * skew + twice * (skew @ skew))


_ROUNDS = 4  # iterations of the start; each gains a factor of the nutation's size


# --- the resonance ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SlowStart:
    """Initial state of a resonant average; mpf."""

    quaternion: Vector  # attitude of the axes a, b, c, to space axes
    momentum: Vector  # along them beyond the momentum at exactly p turns a revolution about c, kg m^2/s


@dataclass(frozen=True)
class Resonance:
    """A spin-orbit resonance of a body with one of its sources, of the multiple k = 2 p."""

    motion: FreeMotion
    source: Source
    multiple: int
    context: Any

    @property
    def orbit(self) -> KeplerOrbit:
        """The source's orbit."""
        return required(self.source.of.orbit)

    @property
    def name(self) -> str:
        """Name of the resonance, turns to revolutions, such as "3:2"."""
        return f"{self.multiple}:2" if self.multiple % 2 else f"{self.multiple // 2}:1"

    @cached_property
    def coefficients(self) -> tuple[Any, ...]:
        """Hansen coefficients X_0, X_2, X_-2 (mpf)."""
        return self._hansen(self.multiple)

    @cached_property
    def of_wobble(self) -> tuple[Any, ...]:
        """Hansen coefficients Y_0, Y_2, Y_-2 (mpf)."""
        return (self.context.zero,) * 3 if self.multiple % 2 else self._hansen(self.multiple // 2)

    def _hansen(self, order: int) -> tuple[Any, ...]:
        return tuple(hansen(self.context, self.orbit.eccentricity, order, m) for m in (0, 2, -2))

    @cached_property
    def second_order(self) -> Vector:
        """Coefficients of the second order's potential, J (mpf); see ``anomaly_sums``."""
        largest, rate = self.motion.moments[2], self.orbit.mean_motion
        unit = largest * rate * rate
        found = second_order(self._ratios, *self._drive, self.multiple)
        return [unit * self.context.mpf(k) for k in found]

    @property
    def _ratios(self) -> tuple[float, ...]:
        return tuple(float(x / self.motion.moments[2]) for x in self.motion.moments)

    @property
    def _drive(self) -> tuple[float, float]:
        """3 G M / (a^3 n^2), and the eccentricity."""
        strength = float(self.source.strength / self.orbit.mean_motion**2)
        return strength, float(self.orbit.eccentricity)

    @cached_property
    def strength(self) -> Any:
        """Strength (3 G M / 2 a^3) (B - A) / 2, J (mpf)."""
        least, middle, _ = self.motion.moments
        return self.source.strength * (middle - least) / 4

    @property
    def pace(self) -> Any:
        """Rotation rate p n, rad/s (mpf)."""
        return self.multiple * self.orbit.mean_motion / 2

    @property
    def libration_rate(self) -> float:
        """Rate of small librations in longitude at small obliquity, n sqrt(3 H (B - A) / C), rad/s."""
        zero, plus, minus = (abs(float(x)) for x in self.coefficients)
        return math.sqrt(4 * float(self.strength) * max(zero, plus, minus) / float(self.motion.moments[2]))

    def with_source_in(self, sources: Sequence[Source]) -> Self:
        """The same resonance with the same one of these sources."""
        (source,) = (x for x in sources if x.number == self.source.number)
        return replace(self, source=source)

    # --- between the full motion and the slow one ---------------------------------------------------------

    def anomaly(self, time: Any) -> Any:
        """Mean anomaly M, rad (mpf)."""
        return self.orbit.mean_anomaly + self.orbit.mean_motion * time

    def whole(self, slow: SlowStart) -> Vector:
        """Angular momentum along a, b, c, kg m^2/s (mpf)."""
        first, second, third = slow.momentum
        return [first, second, third + self.pace * self.motion.moments[2]]

    def start(self, scene: Scene) -> SlowStart:
        """The slow motion at the scene's start, without the terms that go round with the orbit."""
        context, body = self.context, scene.body
        matrix = attitude.rotation_matrix(scene.quaternion)
        momentum = apply(matrix, apply(body.inertia, scene.angular_velocity))
        principal = multiply(matrix, transpose(self.motion.axes))
        about = [x / norm(context, momentum) for x in momentum]
        frame = multiply(_about(context, about, -self._angle(scene.start)), principal)
        inside = apply(transpose(frame), momentum)
        slow = self._slow(frame, inside)
        for _ in range(_ROUNDS):
            added, turn = self._left_out(slow, scene.start)
            mean = multiply(frame, _turned(context, [-x for x in turn]))
            slow = self._slow(mean, [x - y for x, y in zip(inside, added, strict=True)])
        return slow

    def osculating(self, slow: SlowStart, scene: Scene, time: Any) -> tuple[Vector, Vector]:
        """Quaternion and angular velocity (body axes, rad/s) of the full motion at a time in seconds."""
        context = self.context
        added, turn = self._left_out(slow, time)
        frame = multiply(attitude.rotation_matrix(slow.quaternion), _turned(context, turn))
        momentum = [x + y for x, y in zip(self.whole(slow), added, strict=True)]
        about = apply(frame, momentum)
        about = [x / norm(context, about) for x in about]
        principal = multiply(_about(context, about, self._angle(time)), frame)
        matrix = multiply(principal, self.motion.axes)
        rates = [x / moment for x, moment in zip(momentum, self.motion.moments, strict=True)]
        velocity = apply(transpose(self.motion.axes), rates)
        return attitude.unit_quaternion(context, attitude.quaternion_from_matrix(context, matrix)), velocity

    def _angle(self, time: Any) -> Any:
        """Angle p M by which the frame is turned back."""
        return self.multiple * self.anomaly(time) / 2

    def _slow(self, frame: Matrix, momentum: Vector) -> SlowStart:
        context = self.context
        quaternion = attitude.unit_quaternion(context, attitude.quaternion_from_matrix(context, frame))
        first, second, third = momentum
        return SlowStart(quaternion, [first, second, third - self.pace * self.motion.moments[2]])

    def _left_out(self, slow: SlowStart, time: Any) -> tuple[Vector, Vector]:
        """Terms that go round with the orbit, along a, b, c: of the momentum (kg m^2/s), and the rotation
        vector (rad) of the frame; mpf.
        """
        context = self.context
        unit = self.motion.moments[2] * self.orbit.mean_motion
        place = self.source.place(context, time)
        back = transpose(attitude.rotation_matrix(slow.quaternion))
        along, across = (np.array(apply(back, v), dtype=float) for v in (place.pericentre, place.across))
        momentum = np.array([x / unit for x in self.whole(slow)], dtype=float)
        sums = AnomalySums(np.array(self._ratios), *self._drive, self.multiple)
        anomaly = float(self.anomaly(time) % (2 * context.pi * sums.turns))
        added, turn = (sums.at(anomaly, x) for x in sums.removed(along, across, momentum))
        return [unit * context.mpf(float(x)) for x in added], [context.mpf(float(x)) for x in turn]


def _turned(context: Any, vector: Vector) -> Matrix:
    """Rotation matrix (mpf) of a rotation vector."""
    angle = norm(context, vector)
    if angle == 0:
        return attitude.rotation_matrix([context.one, *([context.zero] * 3)])
    return _about(context, [x / angle for x in vector], angle)


def _about(context: Any, axis: Vector, angle: Any) -> Matrix:
    """Rotation matrix (mpf) about a unit axis."""
    s = context.sin(angle / 2)
    return attitude.rotation_matrix([context.cos(angle / 2), *(s * x for x in axis)])
