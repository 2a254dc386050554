"""A placement: how a distant source is placed, as seen from the body; the protocol of all ways.

``rest``, ``prescribed_orbit``, ``series``, ``point_mass`` and ``kernel_body`` have one class each.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.orbit_planes import OrbitPlane
from rigidsim.model.orbits.point_mass_states import PointMassPair
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.kernels.reading import Sight
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
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


class Placement(ABC):
    """How a source is placed; vectors in space axes.

    Attributes:
        name: name of the body that it is, where messages tell it by one; empty for others.
        orbit, table: prescribed elements, whose states all loads on them share; None without.
        pair: the point mass that it is, and the one that the body is; None for others.
        moves: whether it moves without being on such an orbit.
        lunisolar: whether the mean elements of Sun and Moon are in its motion.
        wide: whether its expressions are too long to be unrolled.
        axes, epoch: what the space axes and time 0 are in it; None if it holds in any.
        plane: in which it moves, beside those of ``orbit`` and ``table``; None without one.
        without_plane: why it has an orbit, but no known plane; empty if it has one.
        seconds_ahead: time of the scene's epoch in the count of its own.
        of_time: whether it is a series whose arguments are time.
        sights: bodies of a kernel that it is placed by, see ``SceneLoad``.
        untracked: why velocity and acceleration aren't known; empty if they are, by ``motion``.
        without_elements: why it has no ellipse to average over, and what to do; None if it has one, or rests.
    """

    name: str = ""
    orbit: KeplerOrbit | None = None
    table: TabulatedOrbit | None = None
    pair: PointMassPair | None = None
    moves: ClassVar[bool] = False
    lunisolar: bool = False
    wide: bool = False
    axes: str | None = None
    epoch: Epoch | None = None
    plane: OrbitPlane | None = None
    without_plane: str = ""
    seconds_ahead: float = 0.0
    of_time: bool = False
    untracked: str = "only its place is known"
    without_elements: tuple[str, str] | None = None
    sights: tuple[tuple[Sight, int], ...] = ()

    @abstractmethod
    def distance(self, context: Any) -> Any:
        """A distance (mpf, m) of its order: the unit of what ``seen`` gives."""

    @abstractmethod
    def seen(self, m: Kinematics) -> tuple[list[Symbolic], Symbolic | None]:
        """Unit vector towards it; ``distance`` over its own, None if that is one."""

    @abstractmethod
    def at_start(self, scene: Scene) -> Vector:
        """Place at the start, m (mpf)."""

    @abstractmethod
    def circuit(self, context: Any) -> Circuit:
        """How it goes round."""

    def motion(self, m: Kinematics) -> SourceMotion:
        """Place, velocity and acceleration, where they are known."""
        raise NotImplementedError

    def motion_at_start(self, scene: Scene) -> tuple[Vector, Vector, Vector]:
        """The same at the start (mpf, SI)."""
        raise NotImplementedError

    def nearest(self, context: Any) -> Any:
        """Least distance, m (mpf), for sizes of torques."""
        return self.distance(context)

    def fastest_rate(self, context: Any) -> Any:
        """Largest rate at which what carries it turns, rad/s (mpf)."""
        return context.zero

    def rests(self) -> Vector | None:
        """Its place if it never moves, m (mpf)."""
        return None

    def pictured(self) -> dict[str, Any]:
        """What a timeline draws it by (``rigidsim.look.record``)."""
        return {}
