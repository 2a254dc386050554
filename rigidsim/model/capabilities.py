# ruff: noqa: D102 (what a method gives is told by its protocol)
"""What a load may be able to do in addition to torque, force and potential, one small protocol each.

A load has a capability if it has its members; there is nothing to inherit or register. Who asks looks for it
(``having``), and decides what a load without it means. Sizes from which scales are chosen are
``rigidsim.model.scaling.Sized``, ``Swift`` and ``BoundsFlight``; a load that carries angular momentum is a
``rigidsim.model.carriers.Carrier``. A member is None where a load of the kind doesn't have it after all.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar, runtime_checkable

from rigidsim.model.gradient import GradientSource
from rigidsim.model.inertia import MassDistribution
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.orbit_planes import FlightPlane, KeplerPlane, OrbitPlane, TablePlane
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene

C = TypeVar("C")


def having(capability: type[C], loads: Iterable[object]) -> list[C]:
    """The loads that have a capability."""
    return [load for load in loads if isinstance(load, capability)]


# --- a source ---------------------------------------------------------------------------------------------


@runtime_checkable
class OnOrbit(Protocol):
    """Its source moves on a prescribed orbit; all loads on one orbit share its states."""

    orbit: KeplerOrbit | None


@runtime_checkable
class OnTable(Protocol):
    """Its source moves on a tabulated orbit, whose states are shared likewise."""

    table: TabulatedOrbit | None


@runtime_checkable
class Corotating(Protocol):
    """Its potential rests in the frame of a circular orbit in a fixed plane: there is Jacobi's constant."""

    corotating_orbit: KeplerOrbit | None


@runtime_checkable
class Sourced(Protocol):
    """If ``has_source``, the unit vector towards its source is known (body axes); nadir, roll and libration
    count from it.
    """

    has_source: bool

    def source_direction(self, m: Kinematics) -> list[Symbolic] | None: ...


@dataclass(frozen=True)
class SourcePlace:
    """Place of a source as seen from the body: unit vector towards it, space axes; its distance in m is
    ``unit`` (mpf) over ``inverse``.
    """

    direction: list[Symbolic]
    inverse: Symbolic
    unit: Any


@runtime_checkable
class Placed(Protocol):
    """The place of its source is known, as expressions, and at the start (mpf, m, space axes)."""

    def source_place(self, m: Kinematics) -> SourcePlace: ...

    def source_at_start(self, scene: Scene) -> Vector: ...


@runtime_checkable
class Magnetic(Protocol):
    """Its magnetic field where the body is: T, body axes, and at the start (mpf, T, space axes)."""

    def flux_density(self, m: Kinematics) -> list[Symbolic]: ...

    def flux_density_at_start(self, scene: Scene) -> Vector: ...

    def same_field(self, other: object) -> bool: ...


@runtime_checkable
class FlownAbout(Placed, Protocol):
    """A body in flight moves about its source: velocity as seen from there, space axes, in units of speed,
    and at the start (mpf, m/s).
    """

    def motion(self, m: Kinematics) -> list[Symbolic]: ...

    def motion_at_start(self, scene: Scene) -> Vector: ...


@runtime_checkable
class InPlane(Protocol):
    """Its source moves in a plane, or the body about its source, other than by an orbit or a point."""

    plane: OrbitPlane | None


@runtime_checkable
class WithoutPlane(Protocol):
    """Why its source has an orbit, but no known plane; empty if it has one."""

    without_plane: str


@runtime_checkable
class Attracting(Protocol):
    """Its force always points to a centre (mpf, m, space axes)."""

    attracting_point: Vector


@runtime_checkable
class AboutLine(Protocol):
    """Point (mpf, m) and unit vector, space axes, of a line about which its force and torque leave the whole
    angular momentum; None without one.
    """

    def symmetry_line(self) -> tuple[Vector, Vector] | None: ...


@runtime_checkable
class AtRest(Protocol):
    """Its source is at rest in space: 3 G M / R^3 (mpf, 1/s^2), and the unit vector to it in space axes."""

    def fixed_source(self, scene: Scene) -> tuple[Any, Vector] | None: ...


@runtime_checkable
class GradientAlone(Protocol):
    """It is nothing but the gravity gradient of a distant body; None if that one isn't at a known place."""

    gradient_source: GradientSource | None


@runtime_checkable
class Reacting(Protocol):
    """Its source is one of the point masses besides the body: accelerations that the body causes on them, as
    ``PointMassStates.react`` takes them.
    """

    def reaction(self, m: Kinematics) -> list[tuple[int, Any, list[Symbolic]]]: ...


@runtime_checkable
class Ahead(Protocol):
    """The time that it counts in is ahead of the scene's, which rounds it more; ``of_time`` is True for
    series, whose arguments are multiples of time.
    """

    seconds_ahead: float
    of_time: bool


# --- axes and planes that it leaves alone -----------------------------------------------------------------


@runtime_checkable
class KeepsAxial(Protocol):
    """Whether it has no torque about an axis of symmetry (mpf, body axes); otherwise its vectors tell."""

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool: ...


@runtime_checkable
class KeepsPlane(Protocol):
    """Whether its torque stays along a principal axis about which alone the body turns (unit, mpf), ``axis``
    in body and ``normal`` in space axes.
    """

    def keeps_plane(self, scene: Scene, axis: Vector, normal: Vector) -> bool: ...


@runtime_checkable
class TurnsAbout(Protocol):
    """Whether it may have a torque about a unit axis in space (mpf); not asked if its potential decides."""

    def turns_about(self, m: Kinematics, axis: Vector) -> bool: ...


@runtime_checkable
class Spares(Protocol):
    """A unit axis in space (mpf) about which it has no torque; None without one."""

    def spared_axis(self, scene: Scene) -> Vector | None: ...


@runtime_checkable
class LinearPotential(Protocol):
    """Vectors a in body and f in space axes (mpf, SI) of a torque a x R^T f, of the potential -a . R^T f."""

    def linear_potential(self, scene: Scene) -> tuple[Vector, Vector] | None: ...


# --- what it does to the body ------------------------------------------------------------------------------


@runtime_checkable
class Reshaping(Protocol):
    """It changes the body's mass distribution; ``changes`` says so, for what can't do with that."""

    changes: str

    def shape(self, m: Kinematics) -> MassDistribution: ...


@runtime_checkable
class Ending(Protocol):
    """Quantities of order one whose passing below zero ends the motion, each with the reason."""

    def endings(self, m: Kinematics) -> list[tuple[str, Symbolic]]: ...


@runtime_checkable
class Ranged(Protocol):
    """Quantities of order one whose passing below zero leaves the range of a model, each with the reason."""

    def range_ends(self, m: Kinematics) -> list[tuple[str, Symbolic]]: ...


@runtime_checkable
class Beside(Protocol):
    """It acts with another load, on the same source, which the other load places."""

    beside: Any


@runtime_checkable
class Unaveraged(Protocol):
    """Why no average over the rotation takes it, and what to do with it instead."""

    unaveraged: tuple[str, str]


# --- how it acts ------------------------------------------------------------------------------------------


@runtime_checkable
class Damping(Protocol):
    """Coefficients c_i (mpf, kg m^2/s) of a torque -c_i w_i about the body axes."""

    def damping(self) -> Vector | None: ...


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
