"""Loads: one class each, from the keys of a config to torque, force and potential.

Torques and forces are sums of terms, each a constant vector (mpf, worked out with guard bits) times an
expression of the state, so that constants are rounded once, with those of the inertia tensor already in them.
Loads in a config, rigidsim's own and those you write in Python all derive from ``Load``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.names import written
from rigidsim.model.rotations import Symbolic
from rigidsim.model.si import speaks_si
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.cautions import Caution
from rigidsim.scene.registry import SceneLoad
from rigidsim.scene.scene import Scene
from rigidsim.scene.transitions import narrow_parts, root_parts
from rigidsim.scene.validation_messages import shown

Term = tuple[Vector, Symbolic]
"""A constant vector (mpf) times an expression."""


STATES_READ = ("attitude", "vertical", "flight")
"""What a load can ask for in ``reads``."""


class Load(SceneLoad):
    """Base of all loads; as it stands it does nothing.

    A load of a user takes the state in SI (``rigidsim.model.si.InSI``) and gives SI: torques in N m,
    potentials in J, powers in W. rigidsim's own loads are written in internal units.

    What else a load may define (an orbit, what it conserves, its size, widths of pulses, damping, momentum
    that it carries) are the protocols of ``rigidsim.model.capabilities``, ``scaling`` and ``carriers``: it
    has those whose members it defines.

    Attributes:
        title: name used in reasons and messages.
        reads: states that it must find: "attitude", "vertical", "flight".
        conservative: whether it has a potential that doesn't depend on time.
    """

    title = "load"
    reads: frozenset[str] = frozenset()
    conservative = False
    described = "a load given from Python"

    def __init_subclass__(cls) -> None:
        """Loads of users speak SI; those of rigidsim are in internal units."""
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
