"""How sources are placed, as seen from the body: at rest, on prescribed orbits, by series, by a kernel, as
point masses, or as what the body flies by; and in which planes they move.

``rigidsim.model.frames.plane_of`` says which plane a load has. The mean ecliptic of date has its pole at
(P, -Q, sqrt(1 - P^2 - Q^2)) in the ecliptic and equinox of J2000, with P = sin(pi_A) sin(Pi_A) and
Q = sin(pi_A) cos(Pi_A) from Capitaine, Wallace & Chapront 2003 (A&A 412, 567: the ecliptic of IAU 2006).

Positions of Sun and Moon by series are heyoka's: the Sun from VSOP2013 (Simon et al. 2013, A&A 557, A49: the
heliocentric place of the barycentre of Earth and Moon, reversed: it stands for the Earth's, 4,670 km or 3e-5
of the distance away), the Moon from ELP2000 (Chapront-Touze & Chapront 1983), both in the mean ecliptic and
equinox of J2000, with time counted from J2000 (TDB). Terms below 1e-6 of the distance are left out. With the
barycentre the Sun's torque is right to 1e-4, the Moon's to some 3e-6. The series are explicit functions of
time in double precision, whatever the run's.

Sizes of what the body flies by follow from the Kepler orbit through the state at the start.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any, ClassVar

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError, Problem, ensure, required
from rigidsim.model.kinematics import Kinematics, seconds
from rigidsim.model.orbits import KeplerParts, Pull
from rigidsim.model.rotations import Symbolic, constant, length, unit
from rigidsim.scene.arithmetic import Vector, cross, minus, norm
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.kernels.reading import Ephemeris, RelativeEphemeris
from rigidsim.scene.orbit_tables import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.point_masses import GRAVITATIONAL_CONSTANT, PointMasses, closest, kepler_reach
from rigidsim.scene.registry import Setting
from rigidsim.scene.scene import Scene
from rigidsim.scene.space_axes import ECLIPTIC
from rigidsim.scene.swept import plain

_CENTURY = 36525 * 86400
_ARCSEC = ExactNumber(Fraction(1, 3600 * 180), pi_power=1)
_P = ("4.199094", "0.1939873", "-0.00022466", "-0.000000912", "0.0000000120")
_Q = ("-46.811015", "0.0510283", "0.00052413", "-0.000000646", "-0.0000000172")
"""Arcseconds, coefficients of ascending powers of centuries (TDB) from J2000, beginning with the first."""
_ECLIPTIC_DRIFT = 1e-12  # rad/s; 0.47 arcsec a year are 7e-14


@dataclass(frozen=True)
class OrbitPlane:
    """Plane of a load's source; all vectors are in space axes.

    Attributes:
        normal: unit normal about which the motion is direct (counterclockwise).
        at_start: approximate normal at the start (mpf), not of unit length unless it never turns.
        described: where angles are measured from it.
        called: its normal in a local frame; empty if the source doesn't stay in the plane.
        drift: bound of the rate (rad/s) at which the normal turns; None if unknown, 0 if it never does.
        rate: angular rate (mpf, rad/s) of the motion in the plane, or its mean; None if unknown.
        flown: whether it is the plane of the body's own flight.
        turning: rate of change of ``at_start`` (mpf, 1/s), from the body's acceleration at the start in space
            axes (m/s^2), which only flights ask for.
    """

    normal: Callable[[Kinematics], list[Symbolic]]
    at_start: Callable[[Scene], Vector]
    described: str
    called: str = ""
    drift: Any | None = None
    rate: Callable[[Scene], Any | None] = lambda _: None
    flown: bool = False
    turning: Callable[[Scene, Callable[[], Vector]], Vector] | None = None


def kepler_plane(orbit: KeplerOrbit) -> OrbitPlane:
    """Plane of a prescribed Kepler orbit, whose node may move."""

    def at_start(scene: Scene) -> Vector:
        turned = orbit.node_rate * scene.start
        return replace(orbit, ascending_node=orbit.ascending_node + turned).normal(scene.context)

    def turning(scene: Scene, _: Callable[[], Vector]) -> Vector:
        x, y, z = at_start(scene)
        return [-orbit.node_rate * y, orbit.node_rate * x, 0 * z]

    described = "plane of the source's orbit" + (", whose node moves" if orbit.node_rate != 0 else "")
    return OrbitPlane(
        lambda m: m.orbit(orbit).normal, at_start, described, "normal of its orbit",
        abs(orbit.node_rate), lambda _: abs(orbit.mean_motion), turning=turning,
    )  # fmt: skip


def table_plane(table: TabulatedOrbit) -> OrbitPlane:
    """Plane of a tabulated orbit."""
    return OrbitPlane(
        lambda m: m.table(table).normal, lambda scene: list(table.normal(scene.start)),
        "plane of the source's orbit, by its table", "normal of its orbit, by its table",
        table.normal_drift, lambda _: abs(table.mean_motion),
        turning=lambda scene, _: table.rate_of("normal", scene.start),
    )  # fmt: skip


def flight_plane(point: Vector) -> OrbitPlane:
    """Plane of the body's own flight about an attracting point (mpf, m): normal r x v."""

    def at_start(scene: Scene) -> Vector:
        if scene.position is None or scene.velocity is None:
            return [scene.context.zero, scene.context.zero, scene.context.one]
        return cross([x - a for x, a in zip(scene.position, point, strict=True)], scene.velocity)

    def rate(scene: Scene) -> Any | None:
        if scene.position is None:
            return None
        squared = sum((x - a) ** 2 for x, a in zip(scene.position, point, strict=True))
        return norm(scene.context, at_start(scene)) / squared

    return OrbitPlane(
        lambda m: unit(cross(m.offset_from(point), m.carried(m.velocity))), at_start,
        "osculating plane of the body's own orbit", "normal of the osculating orbit", rate=rate, flown=True,
        turning=lambda scene, acceleration: cross(minus(scene.position or [], point), acceleration()),
    )  # fmt: skip


def ecliptic_plane() -> OrbitPlane:
    """Mean ecliptic of date, in which the Sun of the analytic series moves except for perturbations."""

    def normal(m: Kinematics) -> list[Symbolic]:
        context = m.scene.context
        centuries = seconds(m, since=m.scene.epoch) * m.number(context.one / _CENTURY)

        def series(terms: tuple[str, ...]) -> Symbolic:
            total: Any = constant(0.0)
            for term in reversed(terms):
                total = (total + m.number(context.mpf(term) * _ARCSEC.at(context))) * centuries
            return total

        p, q = series(_P), series(_Q)
        return [p, -q, hy.sqrt(1.0 - p * p - q * q)]

    return OrbitPlane(
        normal, lambda scene: [scene.context.zero, scene.context.zero, scene.context.one],
        "mean ecliptic of date (IAU 2006)", drift=_ECLIPTIC_DRIFT,
    )  # fmt: skip


# --- places -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Circuit:
    """How a source goes round, as far as averages have to know.

    Attributes:
        motion: mean motion, rad/s; 0 at rest, or of one that isn't bound to the body.
        eccentricity: of its orbit, the largest if it varies.
        nearest: (a/r)^3 at the closest approach, a being ``Placement.distance``.
        slow_rate: bound of the rate of node and periapsis together, rad/s, or an estimate.
        uncertainty: of the mean motion, rad/s.
        passing_rate: angular rate at the closest approach, rad/s; None where the orbit gives it.
    """

    motion: float = 0.0
    eccentricity: float = 0.0
    nearest: float = 1.0
    slow_rate: float = 0.0
    uncertainty: float = 0.0
    passing_rate: float | None = None


@dataclass(frozen=True)
class SourceMotion:
    """How a source moves as seen from the body, space axes: in a unit of length (m, mpf), per internal unit
    of time; ``inverse`` is that unit over the distance.
    """

    place: list[Symbolic]
    velocity: list[Symbolic]
    acceleration: list[Symbolic]
    inverse: Symbolic
    unit: Any


@dataclass(frozen=True)
class SourcePlace:
    """Place of a source as seen from the body; its distance in m is ``unit`` (mpf) over ``inverse``.

    Attributes:
        line: unit vector towards it, space axes; away from it if ``outward``.
    """

    line: list[Symbolic]
    inverse: Symbolic
    unit: Any
    outward: bool = False

    @property
    def direction(self) -> list[Symbolic]:
        """Unit vector towards it."""
        return [-x for x in self.line] if self.outward else self.line

    @property
    def outwards(self) -> list[Symbolic]:
        """Unit vector away from it."""
        return self.line if self.outward else [-x for x in self.line]


class Placement:
    """How a source is placed; vectors in space axes.

    Attributes:
        name: name of the body that it is, where messages use one; empty for others.
        orbit, table: prescribed elements, whose states all loads on them share; None without.
        point: at which it rests while the body flies by it (mpf, m); None for others.
        flies: whether the body's own flight counts.
        rests: whether it never moves.
        dynamic: whether the motion itself changes its distance.
        moves: whether it moves without being on such an orbit, as a distant source.
        lunisolar: whether the mean elements of Sun and Moon are in its motion.
        wide: whether its expressions are too long to be unrolled.
        axes, epoch: what the space axes and time 0 are in it; None if it holds in any.
        plane: in which it moves, apart from the planes of ``orbit`` and ``table``; None without one.
        without_plane: why it has an orbit, but no known plane; empty if it has one.
        seconds_ahead: time of the scene's epoch in its own count.
        of_time: whether it is a series whose arguments are time.
        sights: bodies of a kernel that it is placed by, see ``SceneLoad``.
        falling: of one seen from an origin that the source accelerates, its place from there.
        untracked: why velocity and acceleration aren't known; empty if they are, by ``motion``.
        node_averaged: eccentricity and mean motion (rad/s) of an orbit averaged over its node, which has a
            plane but no place; None for others.
    """

    name: str = ""
    orbit: KeplerOrbit | None = None
    table: TabulatedOrbit | None = None
    point: Vector | None = None
    flies: ClassVar[bool] = False
    rests: ClassVar[bool] = False
    dynamic: ClassVar[bool] = False
    moves: ClassVar[bool] = False
    lunisolar: bool = False
    wide: bool = False
    axes: str | None = None
    epoch: Epoch | None = None
    plane: OrbitPlane | None = None
    without_plane: str = ""
    seconds_ahead: float = 0.0
    of_time: bool = False
    sights: tuple[tuple[RelativeEphemeris, int], ...] = ()
    falling: Placement | None = None
    untracked: str = "only its place is known"
    node_averaged: tuple[Any, Any] | None = None

    def elements(self) -> tuple[KeplerOrbit | None, TabulatedOrbit | None]:
        """The prescribed elements whose plane it moves in."""
        return self.orbit, self.table

    def node_factor(self, context: Any) -> Any:
        """What averaging over a node makes of the mean torque; 1 without one."""
        return context.one

    def seen(self, m: Kinematics) -> SourcePlace:
        """Where it is."""
        raise NotImplementedError

    def at_start(self, scene: Setting) -> Vector:
        """Place at the start, m (mpf)."""
        return self.motion_at_start(scene)[0]

    def nearest(self, scene: Setting) -> Any:
        """Least distance, m (mpf), for sizes of torques."""
        return self.distance(scene.context)

    def fastest_rate(self, scene: Setting) -> Any:
        """Largest rate at which its direction turns, rad/s (mpf)."""
        return scene.context.zero

    def pictured(self) -> dict[str, Any]:
        """What a timeline draws it by (``rigidsim.look.record``)."""
        return {}

    # --- of a distant source --------------------------------------------------------------------------------

    def distance(self, context: Any) -> Any:
        """A distance (mpf, m) of its order."""
        raise NotImplementedError

    def circuit(self, context: Any) -> Circuit:
        """How it goes round."""
        raise NotImplementedError

    def motion(self, m: Kinematics) -> SourceMotion:
        """Place, velocity and acceleration, where they are known."""
        raise NotImplementedError

    def motion_at_start(self, scene: Setting) -> tuple[Vector, Vector, Vector]:
        """The same at the start (mpf, SI)."""
        raise NotImplementedError

    def turning_at_start(self, scene: Setting) -> tuple[Vector, Vector]:
        """Place and velocity at the start as seen from the body (mpf, SI)."""
        place, velocity, _ = self.motion_at_start(scene)
        return place, velocity

    # --- of one that the body flies by ----------------------------------------------------------------------

    def velocity(self, m: Kinematics) -> list[Symbolic]:
        """Velocity of the body as seen from it, internal units of speed."""
        raise NotImplementedError

    def velocity_at_start(self, scene: Setting) -> Vector:
        """The same at the start (mpf, m/s)."""
        raise NotImplementedError

    def flight_bounds(self, scene: Scene, fed: Any) -> tuple[Any, Any] | None:
        """See ``Load``."""
        return None

    # --- of one of the point masses -------------------------------------------------------------------------

    def with_point_masses(self, masses: PointMasses) -> Placement:
        """The same where the point masses are elsewhere."""
        return self

    def reaction(self, m: Kinematics, pull: list[Symbolic], sign: int) -> list[Pull]:
        """Accelerations of point masses where it accelerates the body by ``sign`` times ``pull``."""
        return []


NOWHERE = Placement()
"""Of loads without a source at a known place."""


@dataclass(frozen=True)
class PlacedAtRest(Placement):
    """A source that never moves."""

    position: Vector  # m (mpf)
    rests = True
    untracked = ""

    def distance(self, context: Any) -> Any:
        return norm(context, self.position)

    def _direction(self, context: Any) -> Vector:
        length = norm(context, self.position)
        return [x / length for x in self.position]

    def seen(self, m: Kinematics) -> SourcePlace:
        context = m.scene.context
        return SourcePlace(m.fixed(self._direction(context)), hy.expression(1.0), self.distance(context))

    def motion(self, m: Kinematics) -> SourceMotion:
        place, zero = self.seen(m), [hy.expression(0.0)] * 3
        return SourceMotion(place.line, zero, zero, place.inverse, place.unit)

    def motion_at_start(self, scene: Setting) -> tuple[Vector, Vector, Vector]:
        return self.position, [scene.context.zero] * 3, [scene.context.zero] * 3

    def circuit(self, context: Any) -> Circuit:
        return Circuit()

    def pictured(self) -> dict[str, Any]:
        return {"position": [float(x) for x in self.position]}


@dataclass(frozen=True)
class PlacedOnOrbit(Placement):
    """A source on a prescribed Kepler orbit."""

    orbit: KeplerOrbit
    untracked = ""

    def distance(self, context: Any) -> Any:
        return self.orbit.semi_major_axis

    def nearest(self, scene: Setting) -> Any:
        return self.orbit.pericentre

    def seen(self, m: Kinematics) -> SourcePlace:
        place = m.orbit(self.orbit)
        inverse = hy.expression(1.0) if self.orbit.circular else place.inverse_distance
        return SourcePlace(place.direction, inverse, self.orbit.semi_major_axis)

    def at_start(self, scene: Setting) -> Vector:
        return self.orbit.place(scene.context, scene.start)

    def motion(self, m: Kinematics) -> SourceMotion:
        states = m.orbit(self.orbit)
        return SourceMotion(
            *m.carried(states.parts).motions(), states.inverse_distance, self.orbit.semi_major_axis
        )

    def motion_at_start(self, scene: Setting) -> tuple[Vector, Vector, Vector]:
        axis, found = self.orbit.semi_major_axis, KeplerParts.at(self.orbit, scene.context, scene.start)
        place, velocity, acceleration = ([axis * x for x in vector] for vector in found.motions())
        return place, velocity, acceleration

    def circuit(self, context: Any) -> Circuit:
        orbit, e = self.orbit, float(self.orbit.eccentricity)
        slow = abs(float(orbit.node_rate)) + abs(float(orbit.periapsis_rate))
        return Circuit(abs(float(orbit.mean_motion)), e, (1 - e) ** -3, slow)

    def fastest_rate(self, scene: Setting) -> Any:
        return self.orbit.fastest_rate(scene.context)

    def pictured(self) -> dict[str, Any]:
        names = [field.name for field in dataclasses.fields(self.orbit)]
        return {"orbit": {name: float(getattr(self.orbit, name)) for name in names}}


@dataclass(frozen=True)
class PlacedInPlane(Placement):
    """A source on an orbit in the moving plane of another one's, averaged over its node there.

    Attributes:
        reference: placement of the other one, on an orbit by elements or by a table.
        mean_motion: rad/s.
    """

    reference: Placement
    semi_major_axis: Any
    eccentricity: Any
    inclination: Any
    mean_motion: Any

    @property
    def plane(self) -> OrbitPlane:  # type: ignore[override]
        orbit, table = self.elements()
        return kepler_plane(required(orbit)) if table is None else table_plane(table)

    @property
    def node_averaged(self) -> tuple[Any, Any]:  # type: ignore[override]
        return self.eccentricity, self.mean_motion

    def elements(self) -> tuple[KeplerOrbit | None, TabulatedOrbit | None]:
        return self.reference.elements()

    def node_factor(self, context: Any) -> Any:
        """(3 cos^2 i - 1) / 2, of the mean of n n^T over the node along the plane's normal."""
        return 1 - 3 * context.sin(self.inclination) ** 2 / 2

    def distance(self, context: Any) -> Any:
        return self.semi_major_axis

    def nearest(self, scene: Setting) -> Any:
        return self.semi_major_axis * (1 - self.eccentricity)

    def at_start(self, scene: Setting) -> Vector:
        """A place at its distance, for sizes: its anomaly isn't known."""
        place = self.reference.at_start(scene)
        size = self.semi_major_axis / norm(scene.context, place)
        return [size * x for x in place]

    def seen(self, m: Kinematics) -> SourcePlace:
        what = 'an orbit with node = "averaged" has a plane, but no place that a full motion could follow'
        raise ConfigError(Problem("[[loads]] plane_of", what))

    def circuit(self, context: Any) -> Circuit:
        e, slow = float(self.eccentricity), self.reference.circuit(context).slow_rate
        return Circuit(float(self.mean_motion), e, (1 - e) ** -3, slow)


@dataclass(frozen=True)
class PlacedByTable(Placement):
    """A source on a tabulated orbit."""

    table: TabulatedOrbit
    untracked = "its orbit goes by a table, of whose elements no rates are carried"

    def distance(self, context: Any) -> Any:
        return self.table.semi_major_axis

    def nearest(self, scene: Setting) -> Any:
        return self.table.pericentre

    def seen(self, m: Kinematics) -> SourcePlace:
        place = m.table(self.table)
        return SourcePlace(place.direction, place.inverse_distance, self.table.semi_major_axis)

    def at_start(self, scene: Setting) -> Vector:
        return self.table.place(scene.start)

    def turning_at_start(self, scene: Setting) -> tuple[Vector, Vector]:
        return self.at_start(scene), self.table.rate_of("place", scene.start)

    def circuit(self, context: Any) -> Circuit:
        table = self.table
        slow = float(table.normal_drift + table.shape_drift)
        nearest = float(table.semi_major_axis / table.pericentre) ** 3
        return Circuit(float(table.mean_motion), float(table.largest_eccentricity), nearest, slow)

    def fastest_rate(self, scene: Setting) -> Any:
        return self.table.fastest_rate()


_THRESHOLD = 1e-6
_DAY = 86400.0
_MEAN = {"sun": (365.25636, 0.0167), "moon": (27.32166, 0.0549)}
"""Sidereal period (days) and eccentricity, used to judge whether averages over the Earth's spin apply."""
MEAN_DISTANCE = {"sun": 149597870700, "moon": 384400000}  # m


def source_position(body: str, seconds: Symbolic) -> tuple[list[Symbolic], Symbolic]:
    """Geocentric unit vector to the Sun ("sun") or the Moon ("moon"), space axes, and mean distance over
    distance, at a time in seconds since J2000, an expression.
    """
    if body == "sun":
        millennia = seconds * (1.0 / (_DAY * 365250.0))
        earth = hy.model.vsop2013_cartesian(3, time_expr=millennia, thresh=_THRESHOLD)
        position: list[Any] = [-x for x in earth[:3]]  # astronomical units
    else:
        centuries = seconds * (1.0 / (_DAY * 36525.0))
        kilometres = hy.model.elp2000_cartesian_e2000(time_expr=centuries, thresh=_THRESHOLD)
        position = [x * (1.0 / 384400.0) for x in kilometres]
    inverse = 1.0 / hy.sqrt(hy.sum([x * x for x in position]))
    return [x * inverse for x in position], inverse


@dataclass(frozen=True)
class PlacedBySeries(Placement):
    """The geocentric Sun ("sun") or Moon ("moon"); space axes are the mean ecliptic and equinox of J2000."""

    body: str
    epoch: Epoch | None  # date of the scene's time 0
    axes = ECLIPTIC
    moves: ClassVar[bool] = True
    lunisolar = True
    wide = True
    of_time = True
    untracked = "its place is an analytic series"

    @property
    def plane(self) -> OrbitPlane | None:  # type: ignore[override]
        return ecliptic_plane() if self.body == "sun" else None

    @property
    def without_plane(self) -> str:  # type: ignore[override]
        return "the series of the Moon alone names none" if self.body == "moon" else ""

    @property
    def seconds_ahead(self) -> float:  # type: ignore[override]
        return 0.0 if self.epoch is None else float(ExactNumber(self.epoch.since_j2000()))

    def distance(self, context: Any) -> Any:
        return context.mpf(MEAN_DISTANCE[self.body])

    def seen(self, m: Kinematics) -> SourcePlace:
        found = source_position(self.body, seconds(m, since=self.epoch))
        return SourcePlace(*found, self.distance(m.scene.context))

    def at_start(self, scene: Setting) -> Vector:
        """Place at the start, m, in double precision."""
        context = scene.context
        towards, nearness = source_position(self.body, hy.time)
        function = hy.cfunc([*towards, nearness], [], compact_mode=True)
        *direction, inverse = function([], time=float(plain(scene.start)) + self.seconds_ahead)
        far = self.distance(context) / context.mpf(inverse)
        return [far * context.mpf(x) for x in direction]

    def circuit(self, context: Any) -> Circuit:
        days, e = _MEAN[self.body]
        return Circuit(2 * math.pi / (days * _DAY), e, (1 - e) ** -3)

    def pictured(self) -> dict[str, Any]:
        return {"ephemeris": self.body}


_UNROLLED = 2
_ALMOST_PARABOLIC = 0.99  # the few thousand harmonics computed hardly differ at larger eccentricities


@dataclass(frozen=True)
class AmongMasses(Placement):
    """One of the point masses."""

    masses: PointMasses
    number: int  # its index among them
    dynamic: ClassVar[bool] = True

    @property
    def name(self) -> str:  # type: ignore[override]
        return self.masses.names[self.number]

    @property
    def wide(self) -> bool:  # type: ignore[override]
        """Whether there are three or more masses, whose equations take ten seconds to compile unrolled."""
        return len(self.masses.names) > _UNROLLED

    @property
    def plane(self) -> OrbitPlane:  # type: ignore[override]
        return OrbitPlane(
            lambda m: unit(cross(self.away(m), self.velocity(m))),
            lambda scene: cross([-x for x in self.at_start(scene)], self.velocity_at_start(scene)),
            "osculating plane of the source's orbit", "normal of the osculating orbit",
            rate=lambda scene: self.encounter(scene)[1],
            turning=lambda scene, flown: cross(
                [-x for x in self.at_start(scene)], self.acceleration_at_start(scene, flown)
            ),
        )  # fmt: skip

    def with_point_masses(self, masses: PointMasses) -> Placement:
        return replace(self, masses=masses)

    def away(self, m: Kinematics) -> list[Symbolic]:
        """Vector from it to the body, space axes, units of length."""
        raise NotImplementedError

    def acceleration_at_start(self, scene: Setting, flown: Callable[[], Vector]) -> Vector:
        """Acceleration of the body as seen from it (mpf, m/s^2); ``flown`` is the body's own in flight."""
        raise NotImplementedError

    def encounter(self, scene: Setting) -> tuple[Any, Any]:
        """Least distance (m), and the angular rate there (rad/s), of body and mass left to themselves."""
        raise NotImplementedError

    def nearest(self, scene: Setting) -> Any:
        return self.encounter(scene)[0]

    def fastest_rate(self, scene: Setting) -> Any:
        return self.encounter(scene)[1]


@dataclass(frozen=True)
class PlacedAsMass(AmongMasses):
    """A point mass seen from the one that the body is; averages judge it by its osculating orbit."""

    untracked = ""
    moves: ClassVar[bool] = True

    @property
    def host(self) -> int:
        """Index of the one that the body is."""
        return required(self.masses.host)

    @property
    def _attraction(self) -> Any:
        """Sum of both gravitational parameters, m^3/s^2 (mpf)."""
        return self.masses.strengths[self.host] + self.masses.strengths[self.number]

    def _relative(self, context: Any) -> tuple[Vector, Vector, Vector]:
        """Place, velocity and acceleration at the start, as seen from the body (mpf, SI)."""
        return self.masses.relative(self.host, self.number, context)

    def _ellipse(self, context: Any) -> tuple[Any, float] | None:
        """Semi-major axis (m, mpf) and eccentricity of one that is bound; None of others."""
        least, most = kepler_reach(context, *self._relative(context)[:2], self._attraction)
        return None if most is None else ((least + most) / 2, float((most - least) / (most + least)))

    def distance(self, context: Any) -> Any:
        """Semi-major axis at the start, or the least distance of one that isn't bound."""
        ellipse = self._ellipse(context)
        return self.masses.encounter(context, self.host, self.number)[0] if ellipse is None else ellipse[0]

    def encounter(self, scene: Setting) -> tuple[Any, Any]:
        return self.masses.encounter(scene.context, self.host, self.number)

    def away(self, m: Kinematics) -> list[Symbolic]:
        return m.carried(m.point_masses).between(self.number, self.host)

    def seen(self, m: Kinematics) -> SourcePlace:
        states, host = m.carried(m.point_masses), self.host
        inverse = states.inverse_distances[min(host, self.number), max(host, self.number)]
        context = m.scene.context
        line = [x * inverse for x in states.between(host, self.number)]
        return SourcePlace(line, inverse, context.ldexp(context.one, m.scaling.length))

    def motion(self, m: Kinematics) -> SourceMotion:
        """Under the mutual gravity of all as points."""
        found, place = m.carried(m.point_masses).relative(self.host, self.number), self.seen(m)
        return SourceMotion(*found, place.inverse, place.unit)

    def motion_at_start(self, scene: Setting) -> tuple[Vector, Vector, Vector]:
        return self._relative(scene.context)

    def velocity(self, m: Kinematics) -> list[Symbolic]:
        velocities = m.carried(m.point_masses).velocities
        return [a - b for a, b in zip(velocities[self.host], velocities[self.number], strict=True)]

    def velocity_at_start(self, scene: Setting) -> Vector:
        return [-v for v in self._relative(scene.context)[1]]

    def acceleration_at_start(self, scene: Setting, flown: Callable[[], Vector]) -> Vector:
        return [-a for a in self._relative(scene.context)[2]]

    def reaction(self, m: Kinematics, pull: list[Symbolic], sign: int) -> list[Pull]:
        one = m.scene.context.one
        ratio = self.masses.strengths[self.host] / self.masses.strengths[self.number]
        return [(self.host, sign * one, pull), (self.number, -sign * ratio, pull)]

    def circuit(self, context: Any) -> Circuit:
        least, rate = self.masses.encounter(context, self.host, self.number)
        if (ellipse := self._ellipse(context)) is None:
            return Circuit(passing_rate=float(rate))
        (axis, e), (place, _, drawn) = ellipse, self._relative(context)
        # what the others do to axis and eccentricity is of the size of their share in the acceleration
        mutual = self._attraction / norm(context, place) ** 3
        others = [a + mutual * x for a, x in zip(drawn, place, strict=True)]
        perturbed = float(norm(context, others) / (mutual * norm(context, place)))
        motion = float(context.sqrt(self._attraction / axis) / axis)
        closer = float(least / axis) * max(1 - 2 * perturbed, 0.5)
        e = min(e + 2 * perturbed, _ALMOST_PARABOLIC)
        doubt = perturbed * motion
        return Circuit(motion, e, closer**-3, doubt, doubt, float(rate))


_LUNISOLAR = frozenset({"sun", "earth", "moon", "earth_moon_barycenter"})
_BOTH, _PARTS = "earth_moon_barycenter", ("earth", "moon")
_SAMPLES = 4000  # over a run
_ROUNDS = 2  # of finer samples about the least distance
_WINDOW = 100 * 365.25 * 86400.0  # s, in which the mean motion is measured in a kernel
_TURN = 0.2  # of a block: samples by which the mean motion is followed
_LEAST_SHAPE = 0.01  # eccentricity or inclination (rad) from which apsides or nodes are reported


@dataclass(frozen=True)
class PlacedByKernel(Placement):
    """A body of the kernel, seen from the host."""

    ephemeris: Ephemeris
    sight: RelativeEphemeris
    untracked = ""
    moves: ClassVar[bool] = True
    wide = True  # unrolled, the polynomials take several times as long to compile
    without_plane = "positions of a kernel name none"

    @classmethod
    def of(cls, source: str, around: Setting) -> PlacedByKernel:
        """The body that the key ``source`` of a load names."""
        ephemeris = kernel_body(source, around)
        if not around.host:
            what = "the config doesn't name the body from which it is seen; name this body in "
            what += '[body] host, such as "moon"'
            if around.bodies is not None and around.bodies.host is not None:
                own = around.bodies.names[around.bodies.host]
                what = f'the body is "{own}", which is one of [[bodies]] and moves by itself; give orbit = '
                what += '{body = "..."} of another one, or a [body] host that is none of them'
            raise around.fault("source", f'given "{source}", but {what}')
        ensure(
            source != around.host,
            around.fault("source", f'given "{source}", which is the body itself; another one is allowed'),
        )
        return cls(ephemeris, ephemeris.sight(source, around.host))

    @property
    def name(self) -> str:  # type: ignore[override]
        return self.sight.source

    @property
    def axes(self) -> str:  # type: ignore[override]
        return self.ephemeris.axes

    @property
    def lunisolar(self) -> bool:  # type: ignore[override]
        return {self.sight.source, self.sight.host} <= _LUNISOLAR

    def distance(self, context: Any) -> Any:
        return context.ldexp(context.mpf(1000), self.sight.exponent)

    def seen(self, m: Kinematics) -> SourcePlace:
        vector = m.carried(m.sky).seen(self.sight)
        inverse = 1.0 / length(vector)
        return SourcePlace([x * inverse for x in vector], inverse, self.distance(m.scene.context))

    def motion(self, m: Kinematics) -> SourceMotion:
        """The derivatives come from the series; for what is recorded they have to be states."""
        sky = m.carried(m.sky)
        place, velocity, acceleration = (sky.seen(self.sight, order) for order in range(3))
        found = self.seen(m)
        return SourceMotion(place, velocity, acceleration, found.inverse, found.unit)

    def motion_at_start(self, scene: Setting) -> tuple[Vector, Vector, Vector]:
        found = (self.ephemeris.place(scene.context, self.sight, scene.start, order) for order in range(3))
        place, velocity, acceleration = found
        return place, velocity, acceleration

    @property
    def sights(self) -> tuple[tuple[RelativeEphemeris, int], ...]:  # type: ignore[override]
        return ((self.sight, 0),)

    def at_start(self, scene: Setting) -> Vector:
        return self.ephemeris.place(scene.context, self.sight, scene.start)

    # --- sizes, from samples in double precision ----------------------------------------------------------

    @cached_property
    def _reach(self) -> tuple[float, float, float]:
        """Least and largest distance (m) within the run, and the largest rate of the direction (rad/s)."""
        begin, end = (float(t) + float(self.ephemeris.ahead) for t in self.ephemeris.run)
        times = np.linspace(begin, end, _SAMPLES)
        far = np.linalg.norm(self.sight.sampled(times), axis=1)
        most = float(far.max())
        for _ in range(_ROUNDS):
            nearest, width = times[np.argmin(far)], times[1] - times[0]
            times = np.linspace(max(begin, nearest - width), min(end, nearest + width), _SAMPLES // 10)
            far = np.linalg.norm(self.sight.sampled(times), axis=1)
        least, when = float(far.min()), float(times[np.argmin(far)])
        step = 1e-3 * float(min(series.length for _, series in self.sight.links))
        when = min(max(when, float(self.sight.span[0]) + step), float(self.sight.span[1]) - step)
        before, after = self.sight.sampled(np.array([when - step, when + step]))
        turning = float(np.linalg.norm(np.cross(before, after))) / (2 * step * least**2)
        return 1000 * least, 1000 * most, turning

    def nearest(self, scene: Setting) -> Any:
        return scene.context.mpf(self._reach[0])

    def fastest_rate(self, scene: Setting) -> Any:
        return scene.context.mpf(self._reach[2])

    def circuit(self, context: Any) -> Circuit:
        """From the kernel's positions of up to a century about the start: apsides and nodes go round by the
        difference of the anomalistic and the draconic month to the sidereal one.
        """
        first, last = map(float, self.sight.span)
        begin = float(self.ephemeris.run[0]) + float(self.ephemeris.ahead)
        low, high = max(first, begin - _WINDOW / 2), min(last, begin + _WINDOW / 2)
        finest = float(min(series.length for _, series in self.sight.links)) * _TURN
        times = np.linspace(low, high, max(int((high - low) / finest), 2))
        places = self.sight.sampled(times)
        far = np.linalg.norm(places, axis=1)
        units = places / far[:, None]
        turned = 2 * np.arcsin(np.clip(np.linalg.norm(np.diff(units, axis=0), axis=1) / 2, 0, 1))
        e = float((far.max() - far.min()) / (far.max() + far.min()))
        motion = float(turned.sum()) / (high - low)
        normal = np.cross(units[:-1], units[1:]).sum(axis=0)
        latitude = units @ normal / np.linalg.norm(normal)
        nearer, above = np.diff(far) < 0, latitude > 0
        slow = 0.0
        if e > _LEAST_SHAPE:
            slow += abs(_rate(times[1:-1][nearer[:-1] & ~nearer[1:]], motion) - motion)
        if np.abs(latitude).max() > _LEAST_SHAPE:
            slow += abs(_rate(times[1:][above[1:] & ~above[:-1]], motion) - motion)
        return Circuit(motion, e, (2.0**self.sight.exponent / float(far.min())) ** 3, slow)

    def pictured(self) -> dict[str, Any]:
        return {"kernel": self.name}


def _rate(times: np.ndarray, otherwise: float) -> float:
    """Mean rate (rad/s) of what comes round at given times; none if they are too few."""
    return 2 * np.pi * (len(times) - 1) / float(times[-1] - times[0]) if len(times) > 2 else otherwise


def refuse_same_sources(loads: Iterable[Any], host: str | None) -> None:
    """Refuse loads of one kind (their keys) whose sources are, or contain, the same body of a kernel."""
    seen: set[tuple[str, str]] = set()
    for number, load in enumerate(loads, 1):
        name = getattr(load, "source", None)
        if name is None:
            continue
        where = f"[[loads]] number {number} source"
        ensure(
            (load.kind, name) not in seen,
            ConfigError(
                Problem(
                    where,
                    f'given "{name}", as in another {load.kind}, by which it acts twice; remove one of them',
                )
            ),
        )
        seen.add((load.kind, name))
        parts = [x for x in _PARTS if (load.kind, x) in seen or x == host]
        if (load.kind, _BOTH) in seen and parts:
            raise ConfigError(
                Problem(
                    where,
                    f'given "{name}", but the mass of "{_BOTH}" contains "{parts[0]}", a source or the body '
                    'as well; give "earth" and "moon", or one of them',
                )
            )


def kernel_body(source: str, around: Setting) -> Ephemeris:
    """The ephemeris that has a body which a load names; refused if none has."""
    if around.ephemeris is None:
        raise around.fault("source", f'given "{source}", but there is no [ephemeris]; add one with a kernel')
    around.ephemeris.check_body(source, lambda what: around.fault("source", what))
    return around.ephemeris


def refuse_series(around: Setting) -> None:
    """Refuse analytic series with a kernel whose axes they don't share."""
    ensure(
        around.ephemeris is None or around.axes is not None,
        around.fault(
            "ephemeris",
            'given with [ephemeris], whose axes are ICRF unless [frame] axes = "ecliptic J2000"; set '
            "that, or give source instead",
        ),
    )


class FlownBy(Placement):
    """A source that the body flies by."""

    flies: ClassVar[bool] = True
    dynamic: ClassVar[bool] = True

    def away(self, m: Kinematics) -> list[Symbolic]:
        """Vector from it to the body, space axes, units of length."""
        raise NotImplementedError

    def turning_at_start(self, scene: Setting) -> tuple[Vector, Vector]:
        return self.at_start(scene), [-v for v in self.velocity_at_start(scene)]

    def seen(self, m: Kinematics) -> SourcePlace:
        offset, context = self.away(m), m.scene.context
        inverse = 1.0 / length(offset)
        unit = context.ldexp(context.one, m.scaling.length)
        return SourcePlace([x * inverse for x in offset], inverse, unit, outward=True)


@dataclass(frozen=True)
class FlownAbout(FlownBy):
    """A point at rest with a gravitational parameter (mpf, m^3/s^2); None if it doesn't attract the body."""

    gravitational_parameter: Any
    point: Vector  # m (mpf)
    rests = True

    def away(self, m: Kinematics) -> list[Symbolic]:
        return m.offset_from(self.point)

    def at_start(self, scene: Setting) -> Vector:
        return [a - x for x, a in zip(scene.position or [], self.point, strict=True)]

    def velocity(self, m: Kinematics) -> list[Symbolic]:
        return list(m.carried(m.velocity))

    def velocity_at_start(self, scene: Setting) -> Vector:
        return scene.velocity or []

    def nearest(self, scene: Setting) -> Any:
        place = [-x for x in self.at_start(scene)]
        if self.gravitational_parameter is None:
            return norm(scene.context, place)
        return closest(scene.context, place, scene.velocity or [], self.gravitational_parameter)[0]

    def fastest_rate(self, scene: Setting) -> Any:
        """At the closest approach; the most that the speed allows at the start without attraction."""
        if self.gravitational_parameter is None:
            return norm(scene.context, scene.velocity or []) / self.nearest(scene)
        momentum = norm(scene.context, cross(self.at_start(scene), scene.velocity or []))
        return momentum / self.nearest(scene) ** 2

    def flight_bounds(self, scene: Scene, fed: Any) -> tuple[Any, Any]:
        context, strength, horizon = scene.context, self.gravitational_parameter, scene.duration
        distance = norm(context, self.at_start(scene))
        energy = norm(context, scene.velocity or []) ** 2 / 2 - strength / distance  # over mass
        swiftest = context.sqrt(2 * abs(energy + strength / self.nearest(scene)))
        if energy < 0:
            farthest = strength / -energy  # twice the semi-major axis
            reach = min(farthest, distance + swiftest * horizon) + fed * horizon
            return norm(context, self.point) + reach, swiftest + fed
        return norm(context, scene.position or []) + (swiftest + fed) * horizon, swiftest + fed

    def pictured(self) -> dict[str, Any]:
        return {"position": [float(x) for x in self.point]}


@dataclass(frozen=True)
class FlownByKernel(FlownBy):
    """A body of a kernel; from the origin, which it accelerates as well, it is at ``origin``."""

    origin: PlacedByKernel
    wide = True

    @property
    def axes(self) -> str:  # type: ignore[override]
        return self.origin.axes

    @property
    def sights(self) -> tuple[tuple[RelativeEphemeris, int], ...]:  # type: ignore[override]
        return ((self.origin.sight, 1),)

    @property
    def falling(self) -> Placement | None:  # type: ignore[override]
        """None without a host: nothing accelerates the solar system's barycentre."""
        return self.origin if self.origin.sight.host else None

    def away(self, m: Kinematics) -> list[Symbolic]:
        context = m.scene.context
        unit = m.scaled(self.origin.distance(context), -m.scaling.length)
        source = m.carried(m.sky).seen(self.origin.sight)
        return [x - unit * s for x, s in zip(m.carried(m.position), source, strict=True)]

    def velocity(self, m: Kinematics) -> list[Symbolic]:
        context, scaling = m.scene.context, m.scaling
        unit = m.scaled(self.origin.distance(context), -scaling.time - scaling.speed)
        moving = m.carried(m.sky).seen(self.origin.sight, 1)
        return [v - unit * x for v, x in zip(m.carried(m.velocity), moving, strict=True)]

    def at_start(self, scene: Setting) -> Vector:
        return [s - x for x, s in zip(scene.position or [], self.origin.at_start(scene), strict=True)]

    def velocity_at_start(self, scene: Setting) -> Vector:
        moving = self.origin.ephemeris.place(scene.context, self.origin.sight, scene.start, 1)
        return [v - x for v, x in zip(scene.velocity or [], moving, strict=True)]

    def nearest(self, scene: Setting) -> Any:
        """Its distance at the start."""
        return norm(scene.context, self.at_start(scene))

    def fastest_rate(self, scene: Setting) -> Any:
        return self.origin.fastest_rate(scene)

    def pictured(self) -> dict[str, Any]:
        return self.origin.pictured()


@dataclass(frozen=True)
class FlownByMass(FlownBy, AmongMasses):
    """One of the point masses, none of which is the body."""

    def away(self, m: Kinematics) -> list[Symbolic]:
        there = m.carried(m.point_masses).positions[self.number]
        return [x - a for x, a in zip(m.carried(m.position), there, strict=True)]

    def velocity(self, m: Kinematics) -> list[Symbolic]:
        there = m.carried(m.point_masses).velocities[self.number]
        return [x - a for x, a in zip(m.carried(m.velocity), there, strict=True)]

    def at_start(self, scene: Setting) -> Vector:
        there = self.masses.positions[self.number]
        return [a - x for x, a in zip(scene.position or [], there, strict=True)]

    def velocity_at_start(self, scene: Setting) -> Vector:
        there = self.masses.velocities[self.number]
        return [x - a for x, a in zip(scene.velocity or [], there, strict=True)]

    def acceleration_at_start(self, scene: Setting, flown: Callable[[], Vector]) -> Vector:
        return minus(flown(), self.masses.pulled(self.number, scene.context))

    def encounter(self, scene: Setting) -> tuple[Any, Any]:
        place, strength = [-x for x in self.at_start(scene)], self.masses.strengths[self.number]
        return closest(scene.context, place, self.velocity_at_start(scene), strength)

    def reaction(self, m: Kinematics, pull: list[Symbolic], sign: int) -> list[Pull]:
        own = m.scene.context.mpf(GRAVITATIONAL_CONSTANT) * m.carried(m.scene.body.mass)
        return [(self.number, -sign * own / self.masses.strengths[self.number], pull)]
