"""Loads: one class each, from the keys of a config to torque, force and potential.

Torques and forces are sums of terms, each a constant vector (mpf, worked out with guard bits) times an
expression of the state, so that constants are rounded once, with the inertia tensor's already in them.
Loads in a config, rigidsim's own and those you write in Python all derive from ``Load``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.kinematics import Kinematics, MassDistribution
from rigidsim.model.names import written
from rigidsim.model.placements import NOWHERE, OrbitPlane, Placement, SourcePlace
from rigidsim.model.rotations import Symbolic
from rigidsim.model.si import speaks_si
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.cautions import Caution
from rigidsim.scene.orbit_tables import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.registry import SceneLoad
from rigidsim.scene.scene import Scene
from rigidsim.scene.surfaces import narrow_parts, root_parts
from rigidsim.scene.validation_messages import shown

Term = tuple[Vector, Symbolic]
"""A constant vector (mpf) times an expression."""


STATES_READ = ("attitude", "vertical", "flight")
"""What a load can ask for in ``reads``."""


class Load(SceneLoad):
    """Base of all loads; the base does nothing, and each class defines its methods.

    A user-defined load takes the state in SI (``rigidsim.model.si.InSI``) and gives SI: torques in N m,
    potentials in J, powers in W. rigidsim's own loads are written in internal units.

    A load that carries angular momentum is a ``rigidsim.model.mechanics.Carrier``.

    Attributes:
        title: name used in reasons and messages.
        remark: further information for readers, in addition to the keys.
        reads: states that the load needs: "attitude", "vertical", "flight".
        conservative: whether it has a potential that doesn't depend on time.
        placement: how the source is placed.
        orbit, table: of the source; all loads on one orbit or table share its states.
        corotating_orbit: a circular orbit in a fixed plane, in whose frame the potential is constant, so that
            Jacobi's constant exists.
        plane: plane in which the source moves, or the body about the source, without an orbit or a point.
        without_plane: why the source has an orbit, but no known plane; empty with a plane.
        has_source: whether ``source_direction`` is known; nadir, roll and libration count from it.
        attracting_point: centre to which the force always points (mpf, m, space axes).
        gradient_source: the load itself, if it is the gravity gradient of a distant body.
        beside: the main load with the same source, which this load supplements.
        reacts: whether the source is one of the other point masses, and feels ``reaction``.
        seconds_ahead: lead of the load's time over the scene's, which increases rounding.
        of_time: whether the load is a series whose arguments are multiples of time.
        wide: whether the expressions are too long to be unrolled (series of thousands of terms).
        changes: description of a changed mass distribution, for refusals by features that need a constant
            one; see ``shape``.
        loose: whether a carrier doesn't turn with the body: ``exerted_torque`` is then its whole torque on
            the body, and -h' is this torque less h x w.
        unaveraged: why averages over the rotation refuse the load, and what to do instead.
    """

    title = "load"
    reads: frozenset[str] = frozenset()
    conservative = False
    remark: str = ""
    placement: Placement = NOWHERE
    orbit: KeplerOrbit | None = None
    table: TabulatedOrbit | None = None
    corotating_orbit: KeplerOrbit | None = None
    plane: OrbitPlane | None = None
    without_plane: str = ""
    has_source: bool = False
    attracting_point: Vector | None = None
    gradient_source: Any = None
    beside: Any = None
    reacts: bool = False
    seconds_ahead: float = 0.0
    of_time: bool = False
    wide: bool = False
    changes: str = ""
    loose: bool = False
    unaveraged: tuple[str, str] | None = None

    def __init_subclass__(cls) -> None:
        """Loads of users are in SI; rigidsim's loads are in internal units."""
        super().__init_subclass__()
        if not cls.__module__.startswith("rigidsim."):
            speaks_si(cls)

    def extra_states(self, m: Kinematics) -> StateBlock | None:
        """States in addition to the states of an ``orbit``; None if it has none."""
        return None

    def torque(self, m: Kinematics) -> list[Term]:
        """Torque about the reference point, body axes, N m (of rigidsim's own loads in internal units)."""
        return []

    def force(self, m: Kinematics) -> list[Term]:
        """Acceleration of the centre of mass, space axes, m/s^2 (of rigidsim's own in internal units)."""
        return []

    def potential(self, m: Kinematics) -> Symbolic | None:
        """Potential energy, J (of rigidsim's own in internal units): part of the total energy if
        ``conservative``, and of the canonical formulation's Hamiltonian in any case.
        """
        return None

    def narrow(self, m: Kinematics) -> list[Symbolic]:
        """Arguments around whose zeros it changes abruptly, such as (t - t0) / width of a pulse or a switch.

        They are dimensionless expressions of ``seconds(m)`` and the states. Steps chosen by the motion alone
        would pass over such a zero; with them they shorten on the way there.
        """
        return written(m, narrow_parts(*self.formulas()))

    def roots(self, m: Kinematics) -> list[Symbolic]:
        """Radicands in it that may touch zero, where no step may pass over the kink."""
        return written(m, root_parts(*self.formulas()))

    # --- its source -----------------------------------------------------------------------------------------

    def source_direction(self, m: Kinematics) -> list[Symbolic] | None:
        """Unit vector towards its source, body axes; None without one."""
        return None

    def source_place(self, m: Kinematics) -> SourcePlace:
        """Place of its source, where that is known (``LoadFields.placed_by``)."""
        raise NotImplementedError

    def source_at_start(self, scene: Scene) -> Vector:
        """The same at the start (mpf, m, space axes)."""
        raise NotImplementedError

    def motion_at_start(self, scene: Scene) -> Vector:
        """Velocity of the body at the start as seen from its source (mpf, m/s, space axes), in flight."""
        raise NotImplementedError

    def fixed_source(self, scene: Scene) -> tuple[Any, Vector] | None:
        """Of a source at rest in space 3 G M / R^3 (mpf, 1/s^2), and the unit vector to it in space axes."""
        return None

    def reaction(self, m: Kinematics) -> list[tuple[int, Any, list[Symbolic]]]:
        """Accelerations that the body causes on point masses, as ``PointMassStates.react`` takes them."""
        return []

    # --- axes that it knows ---------------------------------------------------------------------------------

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool | None:
        """Whether it has no torque about an axis of symmetry (mpf, body axes); None: its vectors show it."""
        return None

    def linear_potential(self, scene: Scene) -> tuple[Vector, Vector] | None:
        """Vectors a in body and f in space axes (mpf, SI) of a torque a x R^T f, of the potential
        -a . R^T f; None for any other.
        """
        return None

    def direction(self, scene: Scene) -> Vector | None:
        """Direction in space of its uniform field, or of its source at rest, by which axes are named."""
        found = self.linear_potential(scene) or self.fixed_source(scene)
        return None if found is None else found[1]

    # --- what it does to the body ---------------------------------------------------------------------------

    def shape(self, m: Kinematics) -> MassDistribution:
        """The mass distribution that the body has by it, if it ``changes`` that."""
        raise NotImplementedError

    def damping(self) -> Vector | None:
        """Coefficients c_i (mpf, kg m^2/s) of a torque -c_i w_i about the body axes; None for any other."""
        return None

    def lends(self, m: Kinematics) -> bool:
        """Whether a carrier's own energy changes by what its drive does alone: that work is a function of the
        state, and ``supplied_power`` only the drive's work on the body.
        """
        return False

    def endings(self, m: Kinematics) -> list[tuple[str, Symbolic]]:
        """Quantities of order one whose passing below zero ends the motion, each with the reason."""
        return []

    def range_ends(self, m: Kinematics) -> list[tuple[str, Symbolic]]:
        """Quantities of order one whose passing below zero leaves the range of a model, each with the
        reason.
        """
        return []

    def contacts(self, m: Kinematics) -> list[tuple[str, Symbolic]]:
        """Quantities of order one whose passing below zero means that bodies touch, each with the reason."""
        return []

    # --- its size, from which units and drift scales are chosen ---------------------------------------------

    def amplitude(self, scene: Scene) -> Any | None:
        """Largest change of the energy of rotation that it can cause (mpf, J); None if unknown: then it is
        estimated by trial (``rigidsim.model.load_estimate``).
        """
        return None

    def fastest_rate(self, scene: Scene) -> Any:
        """Fastest angular rate of its source as seen from the body (mpf, rad/s)."""
        return scene.context.zero

    def gyroscopic_momentum(self, scene: Scene) -> Vector | None:
        """Angular momentum that it carries at the start (mpf, kg m^2/s, body axes); None for none."""
        return None

    def flight_bounds(self, scene: Scene, fed: Any) -> tuple[Any, Any] | None:
        """Largest distance from the origin (m) and speed (m/s) of a body that flies under this load alone;
        None if it doesn't bound the flight. Loads of unknown size add ``fed`` (m/s) to the speed.
        """
        return None

    # --- for readers ----------------------------------------------------------------------------------------

    def cautions(self, fields: Any, where: str, scene: Scene) -> Iterator[Caution]:
        """Values of it that are allowed, but probably mean something else.

        Args:
            fields: its keys in the config, an instance of ``Fields``.
            where: its place in the config, for messages.
        """
        yield from ()


def own_loads(given: Iterable[Load] | None) -> tuple[Load, ...]:
    """Loads given from Python, refused where they are something else, or read what no motion has."""
    if given is None:
        return ()
    if isinstance(given, Load | str | Mapping) or not isinstance(given, Iterable):
        what = f"given {shown(given)}; a list of loads is allowed, such as loads=[Magnet()]"
        raise ConfigError(Problem("loads", what))
    found = tuple(given)
    problems = []
    for place, load in enumerate(found):
        if isinstance(load, type):
            what = f"given the class {load.__name__}; give an object of it: {load.__name__}(...)"
        elif not isinstance(load, Load):
            what = (
                f"given {shown(load)}; an object of a class derived from rigidsim.model.loads.Load is "
                "allowed (what [[loads]] has belongs in the config)"
            )
        elif not set(load.reads) <= set(STATES_READ):
            what = f"reads {shown(sorted(load.reads))}; allowed: {', '.join(STATES_READ)}"
        else:
            continue
        problems.append(Problem(f"loads[{place}]", what))
    if problems:
        raise ConfigError(problems)
    return found


def torque_terms(load: Load, m: Kinematics) -> list[Term]:
    """A load's torque, as ``Load.torque`` gives it; refused if that isn't terms."""
    return _checked(load, "torque", load.torque(m))


def force_terms(load: Load, m: Kinematics) -> list[Term]:
    """A load's force, as ``Load.force`` gives it; raises as ``torque_terms``."""
    return _checked(load, "force", load.force(m))


def _checked(load: Load, what: str, given: object) -> list[Term]:
    if isinstance(given, list | tuple) and all(_is_term(term) for term in given):
        return list(given)
    said = (
        f"its {what} is {shown(given)}; a list of terms is allowed, each a vector of three constants and an "
        "expression: [([1, 0, 0], m.matrix[0][2])]"
    )
    raise ConfigError(Problem(f"load {load.title}", said))


def _is_term(given: object) -> bool:
    return isinstance(given, list | tuple) and len(given) == 2 and np.shape(given[0]) == (3,)


def loads_of(scene: Scene) -> list[Load]:
    """The loads of a scene, as the mechanics knows them."""
    return [load for load in scene.loads if isinstance(load, Load)]
