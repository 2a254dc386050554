"""What a load may be able to do beside its torque, force and potential, one small protocol each.

A load has a capability if it has its members; there is nothing to inherit or register. Who asks looks for it
(``having``), and decides what a load without it means. Sizes from which scales are chosen are
``rigidsim.model.scaling.Sized``, ``Swift`` and ``BoundsFlight``; a load that carries angular momentum is a
``rigidsim.model.carriers.Carrier``.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol, TypeVar, runtime_checkable

from rigidsim.model.gradient import GradientSource
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.orbit_planes import FlightPlane, KeplerPlane, OrbitPlane, TablePlane
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene

C = TypeVar("C")


def having(capability: type[C], loads: Iterable[object]) -> list[C]:
    """Those of the loads that have a capability."""
    return [load for load in loads if isinstance(load, capability)]


# --- a source ---------------------------------------------------------------------------------------------


@runtime_checkable
class OnOrbit(Protocol):
    """The prescribed orbit that its source moves on, or None; all loads on one orbit share its states."""

    orbit: KeplerOrbit | None


@runtime_checkable
class OnTable(Protocol):
    """The tabulated orbit of its source, or None; loads on it share its states likewise."""

    table: TabulatedOrbit | None


@runtime_checkable
class Corotating(Protocol):
    """A circular orbit in a fixed plane in whose frame its potential rests, or None: then there is Jacobi's
    constant.
    """

    corotating_orbit: KeplerOrbit | None


@runtime_checkable
class Sourced(Protocol):
    """A source whose direction is known if ``has_source``; nadir, roll and libration count from it."""

    has_source: bool

    def source_direction(self, m: Kinematics) -> list[Symbolic] | None:
        """Unit vector towards the source, body axes."""


@runtime_checkable
class InPlane(Protocol):
    """Plane in which its source moves, or the body about its source, where that isn't the one of ``orbit``,
    ``table`` or ``attracting_point``.
    """

    plane: OrbitPlane | None


@runtime_checkable
class WithoutPlane(Protocol):
    """Why its source has an orbit, but no known plane; empty if it has one."""

    without_plane: str


@runtime_checkable
class Attracting(Protocol):
    """Centre (mpf, m, space axes) to which its force always points."""

    attracting_point: Vector


@runtime_checkable
class AtRest(Protocol):
    """A source at rest in space."""

    def fixed_source(self, scene: Scene) -> tuple[Any, Vector] | None:
        """3 G M / R^3 (mpf, 1/s^2) and unit vector (space axes); None if it moves after all."""


@runtime_checkable
class GradientAlone(Protocol):
    """Nothing but the gravity gradient of a distant body; None if that one isn't at a known place."""

    gradient_source: GradientSource | None


@runtime_checkable
class Reacting(Protocol):
    """A source that is one of the point masses besides the body, and may feel it."""

    def reaction(self, m: Kinematics) -> list[tuple[int, Any, list[Symbolic]]]:
        """Accelerations that the body causes on them, as ``PointMassStates.react`` takes them."""


@runtime_checkable
class Ahead(Protocol):
    """By how many seconds the time that it counts in is ahead of the scene's, which rounds it more."""

    seconds_ahead: float


# --- axes and planes that it leaves alone -----------------------------------------------------------------


@runtime_checkable
class KeepsAxial(Protocol):
    """It knows whether it has a torque about a symmetry axis; of others the vectors of the torque tell."""

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool:
        """Whether it has none about this axis of symmetry (mpf, body axes)."""


@runtime_checkable
class KeepsPlane(Protocol):
    """Its torque may stay along a principal axis about which alone the body turns."""

    def keeps_plane(self, scene: Scene, axis: Vector, normal: Vector) -> bool:
        """Whether it does along a unit ``axis`` in body axes (mpf), which is ``normal`` in space axes."""


@runtime_checkable
class TurnsAbout(Protocol):
    """It knows about which axes in space it has a torque; not asked where its potential tells more."""

    def turns_about(self, m: Kinematics, axis: Vector) -> bool:
        """Whether it may have one about a unit axis (mpf)."""


@runtime_checkable
class LinearPotential(Protocol):
    """A torque a x R^T f, of the potential -a . R^T f."""

    def linear_potential(self, scene: Scene) -> tuple[Vector, Vector] | None:
        """Vectors a in body and f in space axes (mpf, SI); None if it isn't so in this scene."""


# --- how it acts ------------------------------------------------------------------------------------------


@runtime_checkable
class Damping(Protocol):
    """A torque -c_i w_i about the body axes."""

    def damping(self) -> Vector | None:
        """The coefficients c_i (mpf, kg m^2/s); None if it isn't one after all."""


@runtime_checkable
class Narrow(Protocol):
    """It changes abruptly where one of some arguments vanishes, such as (t - t0) / width of a pulse.

    They are dimensionless expressions of ``seconds(m)`` and the states. Steps chosen by the motion alone
    would pass over such a zero; with them they shorten on the way there.
    """

    def narrow(self, m: Kinematics) -> list[Symbolic]:
        """The arguments."""


@runtime_checkable
class Rooted(Protocol):
    """Roots in it have radicands that may touch zero, where no step may pass over the kink."""

    def roots(self, m: Kinematics) -> list[Symbolic]:
        """The radicands."""


@runtime_checkable
class Lengthy(Protocol):
    """``wide`` is True for expressions too long to be unrolled (series of thousands of terms)."""

    wide: bool


# --- answers for all loads --------------------------------------------------------------------------------


def orbit_of(load: object) -> KeplerOrbit | None:
    """The orbit of ``OnOrbit``; None for other loads."""
    return load.orbit if isinstance(load, OnOrbit) else None


def table_of(load: object) -> TabulatedOrbit | None:
    """The table of ``OnTable``; None for other loads."""
    return load.table if isinstance(load, OnTable) else None


def corotating_orbit_of(load: object) -> KeplerOrbit | None:
    """The orbit of ``Corotating``; None for other loads."""
    return load.corotating_orbit if isinstance(load, Corotating) else None


def gradient_source_of(load: object) -> GradientSource | None:
    """The source of ``GradientAlone``; None for other loads."""
    return load.gradient_source if isinstance(load, GradientAlone) else None


def linear_potential_of(load: object, scene: Scene) -> tuple[Vector, Vector] | None:
    """The vectors of ``LinearPotential``; None for other loads."""
    return load.linear_potential(scene) if isinstance(load, LinearPotential) else None


def fixed_source_of(load: object, scene: Scene) -> tuple[Any, Vector] | None:
    """The source of ``AtRest``; None for other loads."""
    return load.fixed_source(scene) if isinstance(load, AtRest) else None


def has_source(load: object) -> bool:
    """Whether the direction to its source is known."""
    return isinstance(load, Sourced) and load.has_source


def is_wide(load: object) -> bool:
    """Whether its expressions are too long to be unrolled."""
    return isinstance(load, Lengthy) and load.wide


def plane_of(load: object) -> OrbitPlane | None:
    """Plane in which its source moves, or the body about its source; None if there is none."""
    if isinstance(load, InPlane) and load.plane is not None:
        return load.plane
    if (orbit := orbit_of(load)) is not None:
        return KeplerPlane(orbit)
    if (table := table_of(load)) is not None:
        return TablePlane(table)
    return FlightPlane(load.attracting_point) if isinstance(load, Attracting) else None
