"""Loads: one class each, from the keys of a config to torque, force and potential.

Torques and forces are sums of terms, each a constant vector (mpf, worked out with guard bits) times an
expression of the state, so that constants are rounded once, with those of the inertia tensor already in them.
Loads in a config, rigidsim's own and those you write in Python all derive from ``Load``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.gradient_source import GradientSource
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.orbit_planes import FlightPlane, KeplerPlane, OrbitPlane, TablePlane
from rigidsim.model.rotations import Symbolic
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.arithmetic import Vector, cross, dot, negligible, norm
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.registry import SceneLoad
from rigidsim.scene.scene import Scene
from rigidsim.scene.validation_messages import shown
from rigidsim.store.summary_parts import Caution

Term = tuple[Vector, Symbolic]
"""A constant vector (mpf) times an expression."""


STATES_READ = ("attitude", "vertical", "flight")
"""What a load can ask for in ``reads``."""


class Load(SceneLoad):
    """Base of all loads; the defaults are those of a load that does nothing and whose size is unknown.

    Attributes:
        title: name used in reasons and messages.
        reads: states that it must find: "attitude", "vertical", "flight".
        conservative: whether it has a potential that doesn't depend on time.
        wide: whether its expressions are too long to be unrolled (series of thousands of terms).
        about_vertical: whether it may have a torque about the direction of gravity.
        orbit: the prescribed orbit that its source moves on; all loads on one orbit share its states.
        table: the tabulated orbit of its source; loads on it share its states likewise.
        corotating_orbit: a circular orbit in a fixed plane in whose frame its potential rests: then there is
            Jacobi's constant.
        masses_beside: whether its source is one of the point masses besides the body.
        has_source: whether the direction to its source is known, from which nadir, roll and libration count.
        gradient_alone: whether it is just the gravity gradient of a distant body; ``gradient_source`` tells
            where that body is, if this one is at a known place.
        attracting_point: centre (mpf, m, space axes) to which its force always points, or None.
        without_plane: why its source has an orbit, but no known ``plane``.
        seconds_ahead: by how much the time that it counts in is ahead of the scene's, which rounds it more.
    """

    title = "load"
    reads: frozenset[str] = frozenset()
    conservative = False
    wide = False
    about_vertical = True
    orbit: KeplerOrbit | None = None
    table: TabulatedOrbit | None = None
    corotating_orbit: KeplerOrbit | None = None
    has_source: bool = False
    masses_beside: bool = False
    gradient_alone: bool = False
    gradient_source: GradientSource | None = None
    attracting_point: Vector | None = None
    without_plane: str = ""
    seconds_ahead: float = 0.0

    @property
    def plane(self) -> OrbitPlane | None:
        """Plane in which its source moves, or the body about its source; None if there is none."""
        if self.orbit is not None:
            return KeplerPlane(self.orbit)
        if self.table is not None:
            return TablePlane(self.table)
        return None if self.attracting_point is None else FlightPlane(self.attracting_point)

    # --- equations ---------------------------------------------------------------------------------------

    def extra_states(self, m: Kinematics) -> StateBlock | None:
        """States of its own besides those of ``orbit``; None if it has none."""
        return None

    def torque(self, m: Kinematics) -> list[Term]:
        """Torque about the reference point, body axes, in internal units of energy."""
        return []

    def force(self, m: Kinematics) -> list[Term]:
        """Acceleration of the centre of mass, space axes, in internal units of speed over time."""
        return []

    def reaction(self, m: Kinematics) -> list[tuple[int, Any, list[Symbolic]]]:
        """Accelerations that the body causes on the point masses besides it, as ``PointMassStates.react``
        takes them.
        """
        return []

    def potential(self, m: Kinematics) -> Symbolic | None:
        """Potential energy in internal units: part of the total energy if ``conservative``, and of the
        canonical formulation's Hamiltonian in any case.
        """
        return None

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool:
        """Whether it has no torque about a symmetry axis of the body (mpf, body axes)."""
        context = m.scene.context
        tiny = negligible(context)
        none = (hy.expression(0.0), hy.expression(m.number(context.zero)))  # zeros of two types aren't equal
        return all(
            abs(dot(vector, axis)) <= tiny * norm(context, vector)
            for vector, expression in self.torque(m)
            if expression not in none
        )

    def keeps_plane(self, scene: Scene, axis: Vector, normal: Vector) -> bool:
        """Whether its torque stays along a principal axis about which alone the body turns.

        Args:
            axis: the principal axis, unit, body axes (mpf).
            normal: the same in space axes.
        """
        return False

    def turns_about(self, m: Kinematics, axis: Vector) -> bool:
        """Whether it may have a torque about a unit axis in space (mpf); not called if ``linear_potential``
        or ``fixed_source`` says more.
        """
        up = m.numbers.up
        return self.about_vertical or up is None or norm(m.scene.context, cross(up, axis)) != 0

    def linear_potential(self, scene: Scene) -> tuple[Vector, Vector] | None:
        """Vectors a in body and f in space axes (mpf, SI) of a torque a x R^T f, potential -a . R^T f."""
        return None

    def fixed_source(self, scene: Scene) -> tuple[Any, Vector] | None:
        """3 G M / R^3 (mpf, 1/s^2) and unit vector (space axes) of a source at rest in space; None
        otherwise.
        """
        return None

    def source_direction(self, m: Kinematics) -> list[Symbolic] | None:
        """Unit vector towards its source, body axes, if it ``has_source``."""
        return None

    def damping(self) -> Vector | None:
        """Coefficients c_i (mpf, kg m^2/s) of a torque -c_i w_i about the body axes; None if it isn't a
        damping.
        """
        return None

    def narrow(self, m: Kinematics) -> list[Symbolic]:
        """Arguments around whose zeros the load changes abruptly, such as (t - t0) / width of a pulse or a
        switch.

        They are dimensionless expressions of ``seconds(m)`` and the states. Steps chosen by the motion alone
        would pass over such a zero; with them they shorten on the way there.
        """
        return []

    def roots(self, m: Kinematics) -> list[Symbolic]:
        """Radicands that may touch zero, where no step may pass over the kink."""
        return []

    # --- estimates, from which units and the scales of drifts are chosen ---------------------------------

    def amplitude(self, scene: Scene) -> Any | None:
        """Largest change of the energy of rotation that it can cause (mpf, J).

        None if unknown: it is then estimated by trial (``rigidsim.model.load_estimate``).
        """
        return None

    def fastest_rate(self, scene: Scene) -> Any:
        """Fastest angular rate of its source as seen from the body (mpf, rad/s)."""
        return scene.context.zero

    def flight_bounds(self, scene: Scene, fed: Any) -> tuple[Any, Any] | None:
        """Largest distance from the origin (m) and speed (m/s) of a body that flies under this load alone.

        Args:
            fed: speed that loads of unknown size are estimated to add, m/s.

        Returns:
            None if it doesn't bound the flight.
        """
        return None

    # --- description -----------------------------------------------------------------------------------

    described = "a load given from Python"

    def told(self, scene: Scene) -> str:
        """What it is in a reader's terms, in one sentence for ``check``, ``plan`` and ``info``: sizes at the
        start with their units, and known bodies by name.
        """
        purpose = ((self.Fields or type(self)).__doc__ or "given from Python").partition("\n")[0]
        return f"{self.title}: {purpose}"

    def cautions(self, fields: Any, where: str, scene: Scene) -> Iterator[Caution]:
        """Values of it that are allowed, but probably mean something else.

        Args:
            fields: its keys in the config, an instance of ``Fields``.
            where: its place in the config, for messages.
        """
        yield from ()


def own_loads(given: Iterable[Load] | None) -> tuple[Load, ...]:
    """Loads given from Python.

    Raises:
        ConfigError: something else than loads was given, or one reads what no motion has.
    """
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
    """A load's torque, as ``Load.torque`` gives it.

    Raises:
        ConfigError: the load gave something else than terms.
    """
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
