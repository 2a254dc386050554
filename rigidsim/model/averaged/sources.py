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

To second order the mean turns by <DF u> besides, with F what is left of s' and u the nutation. Both have
potentials, h = k s . (Q - <Q>) s / 2 and H = k s . J s / 2 with s' = grad h x s, so that it is grad K x s,

    K = <s . (grad h x grad H)> / 2 = (k^2 / 4) z (c0 (x^2 - y^2) + c1 (x^2 + y^2)),

x, y, z being the parts of s along P, T and n, c0 = <(a/r)^3 C> and c1 = <(a/r)^3 cos(2 f) C> over
n (1 - e^2)^(3/2): c1 = -(1/4 + e^2/6) (1 - e^2)^(-3) / n. For the Earth and the Sun it is 6e-6 of the
precession. An orbit by a table has the same terms with its instantaneous axis, eccentricity and plane; what
goes round with its pericentre is periodic, and left out of the second order.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import heyoka as hy
import numpy as np

from rigidsim.errors import required
from rigidsim.model.load import Load
from rigidsim.model.loads.gravity import Attraction
from rigidsim.model.orbits import ElementStates
from rigidsim.model.placements import Circuit
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.two_part import as_factor, rounded
from rigidsim.scene.arithmetic import Vector, cross, dot, eccentric_anomaly, norm
from rigidsim.scene.kepler import eccentric_anomalies, plane_vectors, turned
from rigidsim.scene.orbit_tables.pieces import AXIS
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
    """The place of an eccentric anomaly, by elements q and p of ``rigidsim.scene.orbit_tables.pieces``."""
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
