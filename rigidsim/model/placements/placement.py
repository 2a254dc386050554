"""A placement: how a source is placed, as seen from the body.

Distant ones are at rest, on prescribed orbits, by series, bodies of a kernel, or point masses; ``flight`` has
the places of sources that the body itself flies by.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.orbit_planes import OrbitPlane
from rigidsim.model.orbits.point_mass_states import Pull
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.kernels.reading import Sight
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.point_masses import PointMasses
from rigidsim.scene.registry import Setting
from rigidsim.scene.scene import Scene


@dataclass(frozen=True)
class Circuit:
    """How a source goes round, as far as averages have to know.

    Attributes:
        motion: mean motion, rad/s; 0 at rest, or of one that isn't bound to the body.
        eccentricity: of its orbit, the largest if it varies.
        nearest: (a/r)^3 at the closest approach, a being ``Placement.distance``.
        slow_rate: bound of the rate of node and periapsis together, rad/s, or an estimate.
        uncertainty: of the mean motion, rad/s.
        passing_rate: angular rate at the closest approach, rad/s; None where the orbit tells it.
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
    sights: tuple[tuple[Sight, int], ...] = ()
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

    def among(self, masses: PointMasses) -> Placement:
        """The same where the point masses are elsewhere."""
        return self

    def reaction(self, m: Kinematics, pull: list[Symbolic], sign: int) -> list[Pull]:
        """Accelerations of point masses where it accelerates the body by ``sign`` times ``pull``."""
        return []


NOWHERE = Placement()
"""Of loads without a source at a known place."""
