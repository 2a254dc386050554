"""How sources are placed, as seen from the body: at rest, on prescribed orbits, by series, or as point
masses.

Bodies of a kernel are in ``kernel_body``, sources that the body itself flies by in ``flight``.

Positions of Sun and Moon by series are heyoka's: the Sun from VSOP2013 (Simon et al. 2013, A&A 557, A49: the
heliocentric place of the barycentre of Earth and Moon, reversed: it stands for the Earth's, 4,670 km or 3e-5
of the distance away), the Moon from ELP2000 (Chapront-Touze & Chapront 1983), both in the mean ecliptic and
equinox of J2000, with time counted from J2000 (TDB). Terms below 1e-6 of the distance are left out. With the
barycentre the Sun's torque is right to 1e-4, the Moon's to some 3e-6. The series are explicit functions of
time in double precision, whatever the run's.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import heyoka as hy

from rigidsim.model.kinematics import Kinematics, seconds
from rigidsim.model.orbit_planes import OrbitPlane, ecliptic_plane
from rigidsim.model.orbits.point_mass_states import PointMassPair, Pull
from rigidsim.model.orbits.prescribed import KeplerParts
from rigidsim.model.rotations import Symbolic, unit
from rigidsim.scene.arithmetic import Vector, cross, norm
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.kernels.reading import RelativeEphemeris
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.point_masses import PointMasses
from rigidsim.scene.registry import Setting
from rigidsim.scene.scene import Scene
from rigidsim.scene.space_axes import ECLIPTIC
from rigidsim.scene.tracing import plain


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
        without_elements: why it has no ellipse to average over, and what to do; None if it has one, or rests.
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
    without_elements: tuple[str, str] | None = None

    def seen(self, m: Kinematics) -> SourcePlace:
        """Where it is."""
        raise NotImplementedError

    def at_start(self, scene: Setting) -> Vector:
        """Place at the start, m (mpf)."""
        raise NotImplementedError

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

    def motion_at_start(self, scene: Scene) -> tuple[Vector, Vector, Vector]:
        """The same at the start (mpf, SI)."""
        raise NotImplementedError

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

    def at_start(self, scene: Setting) -> Vector:
        return self.position

    def motion(self, m: Kinematics) -> SourceMotion:
        place, zero = self.seen(m), [hy.expression(0.0)] * 3
        return SourceMotion(place.line, zero, zero, place.inverse, place.unit)

    def motion_at_start(self, scene: Scene) -> tuple[Vector, Vector, Vector]:
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
        assert states.parts is not None
        return SourceMotion(*states.parts.motions(), states.inverse_distance, self.orbit.semi_major_axis)

    def motion_at_start(self, scene: Scene) -> tuple[Vector, Vector, Vector]:
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
    without_elements = (
        "the source of an ephemeris has no elements to average over",
        'choose "spin_averaged", or give it an orbit with a node_rate',
    )

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
        )  # fmt: skip

    def with_point_masses(self, masses: PointMasses) -> Placement:
        return replace(self, masses=masses)

    def away(self, m: Kinematics) -> list[Symbolic]:
        """Vector from it to the body, space axes, units of length."""
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
    def pair(self) -> PointMassPair:
        """It, and the one that the body is."""
        return PointMassPair(self.masses, self.number)

    @property
    def without_elements(self) -> tuple[str, str]:  # type: ignore[override]
        return (
            f'the orbit of the point mass "{self.name}" is integrated, so that there is no ellipse to '
            "average over"
        ), (
            'choose "spin_averaged", or write the elements of the orbit into a table (orbit = {table = '
            '"elements.csv"})'
        )

    def distance(self, context: Any) -> Any:
        """Semi-major axis at the start, or the least distance of one that isn't bound."""
        ellipse = self.pair.ellipse(context)
        return self.pair.encounter(context)[0] if ellipse is None else ellipse[0]

    def encounter(self, scene: Setting) -> tuple[Any, Any]:
        return self.pair.encounter(scene.context)

    def away(self, m: Kinematics) -> list[Symbolic]:
        return m.carried(m.point_masses).between(self.number, self.pair.host)

    def seen(self, m: Kinematics) -> SourcePlace:
        states, host = m.carried(m.point_masses), self.pair.host
        inverse = states.inverse_distances[min(host, self.number), max(host, self.number)]
        context = m.scene.context
        line = [x * inverse for x in states.between(host, self.number)]
        return SourcePlace(line, inverse, context.ldexp(context.one, m.scaling.length))

    def at_start(self, scene: Setting) -> Vector:
        return self.pair.place

    def motion(self, m: Kinematics) -> SourceMotion:
        """Under the mutual gravity of all as points."""
        found, place = m.carried(m.point_masses).relative(self.pair.host, self.number), self.seen(m)
        return SourceMotion(*found, place.inverse, place.unit)

    def motion_at_start(self, scene: Scene) -> tuple[Vector, Vector, Vector]:
        return self.masses.relative(self.pair.host, self.number, scene.context)

    def velocity(self, m: Kinematics) -> list[Symbolic]:
        velocities = m.carried(m.point_masses).velocities
        return [a - b for a, b in zip(velocities[self.pair.host], velocities[self.number], strict=True)]

    def velocity_at_start(self, scene: Setting) -> Vector:
        velocities = self.masses.velocities
        return [a - b for a, b in zip(velocities[self.pair.host], velocities[self.number], strict=True)]

    def reaction(self, m: Kinematics, pull: list[Symbolic], sign: int) -> list[Pull]:
        one, ratio = (
            m.scene.context.one,
            self.masses.strengths[self.pair.host] / self.masses.strengths[self.number],
        )
        return [(self.pair.host, sign * one, pull), (self.number, -sign * ratio, pull)]

    def circuit(self, context: Any) -> Circuit:
        least, rate = self.pair.encounter(context)
        if (ellipse := self.pair.ellipse(context)) is None:
            return Circuit(passing_rate=float(rate))
        # what the others do to axis and eccentricity is of the size of their share in the acceleration
        perturbed, (axis, e, motion) = self.pair.perturbation(context), ellipse
        closer = float(least / axis) * max(1 - 2 * perturbed, 0.5)
        e = min(e + 2 * perturbed, _ALMOST_PARABOLIC)
        doubt = perturbed * motion
        return Circuit(motion, e, closer**-3, doubt, doubt, float(rate))
