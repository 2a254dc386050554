"""A formulation: the states in which the rotation of a scene is written, and what can be computed from them.

``Formulation`` is the protocol of all of them, ``formulates`` registers one. Everything else, from the flight
to the invariants, is written in terms of the attitude and the angular velocity as expressions of its states.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, TypeVar

import heyoka as hy

from rigidsim.model.averaged.average import Average
from rigidsim.model.kinematics import in_common_unit
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.orbits.prescribed import Carried, TablePlace
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder, ScaledNumbers, Scaling, largest_rates
from rigidsim.model.state_blocks import BODY, AttitudeStates, StateBlock
from rigidsim.scene.choices import DEFAULT_FORMULATION, FORMULATIONS, Variables
from rigidsim.scene.expressions.tree import readables
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.registry import register_class
from rigidsim.scene.scene import Scene
from rigidsim.scene.surfaces import Surfaces


class Unsuited(ValueError):
    """A formulation doesn't apply to a scene; the message goes on from ``given "name", but``."""


@dataclass(frozen=True)
class Requirements:
    """Which states a scene requires."""

    attitude: bool
    vertical: bool  # as three states of its own (Euler-Poisson equations)
    flight: bool
    record: list[str] | None  # names asked for, or None for everything that the scene has
    why: Mapping[str, str]  # what is carried: "rates", "attitude", "vertical", "flight"
    left_out: Sequence[tuple[str, str]] = ()  # (what, why) for groups that are not carried


@dataclass(frozen=True)
class ModelPlan:
    """The modelling decisions from which a system of equations follows in any precision."""

    scene: Scene  # including loads given from Python
    loads: Sequence[Load]  # all that act, with the uniform fields combined into one
    formulation: Formulation  # of the rotation
    requirements: Requirements
    scaling: Scaling
    numbers: ScaledNumbers
    orbit_tags: Mapping[KeplerOrbit, str]  # that make the state names of prescribed orbits unique
    surfaces: Surfaces  # on which the equations change
    tables: Mapping[TabulatedOrbit, TablePlace] = field(default_factory=dict)  # their states and parameters
    clocked: bool = False  # whether the time takes two numbers (``rigidsim.model.two_part``)

    @property
    def wide(self) -> bool:
        """Whether the equations are too long to be compiled unrolled."""
        read = readables(*self.scene.formulas())
        return self.formulation.wide or any(load.wide for load in self.loads) or any(x.long for x in read)


class Formulation:
    """How the rotation of one scene is written in states; ``formulates`` registers a class of them.

    One of your own needs an ``attitude``, whose derivatives follow from the body rates; all else has a
    default. Numbers are exact (mpf, in the scene's arithmetic) until ``number`` rounds them once.

    Attributes:
        variables: what can be said of it for any scene.
        carries_rates: whether the angular velocity is carried as three states with units of their own.
        resolves_rotation: whether every rotation is followed, rather than averaged over. A motion averaged
            over has an error of its model, which is measured beside it.
        twin: formulation in which questions about the motion itself, such as its stability, are asked in
            double precision; None for this one.
        sequence: sequence of the Euler angles that are states; empty for other states.
        partner: the same motion in the chart that a run changes to near a singularity; None without one.
        why: what speaks for it in this scene, besides that an attitude is needed; shown by ``plan``.
        wide: whether its equations are too long to be compiled unrolled.
        longitude: which longitude along a tabulated orbit it needs.
        average: the average that replaces the motion, if it doesn't resolve rotations.
    """

    variables: ClassVar[Variables]
    carries_rates: ClassVar[bool] = True
    resolves_rotation: ClassVar[bool] = True
    twin: ClassVar[str | None] = DEFAULT_FORMULATION
    sequence: str = ""
    partner: Formulation | None = None
    why: str = ""
    wide: bool = False
    longitude: Carried = Carried.ECCENTRIC
    average: Average | None = None

    @classmethod
    def of(cls, scene: Scene, loads: Sequence[Load]) -> Formulation:
        """The formulation for a scene whose config names it.

        Raises:
            Unsuited: it doesn't apply to the scene, and why.
        """
        return cls()

    @property
    def name(self) -> str:
        """Name in summaries and datasets."""
        return self.variables.name

    def attitude(self, plan: ModelPlan, rates: list[Symbolic], number: Rounder) -> AttitudeStates | None:
        """States of the attitude, their equations and initial values; None if none is carried.

        Args:
            rates: angular velocity, body axes, in units of 1/time.
            number: from an mpf to the working precision's scalar, rounded once.
        """
        raise NotImplementedError

    def rotation(self, plan: ModelPlan, number: Rounder) -> tuple[list[Symbolic], AttitudeStates | None]:
        """Angular velocity, body axes (three states, each in its own unit, or expressions in units of
        1/time), and attitude.
        """
        states = list(hy.make_vars(*BODY.rates))
        rates = in_common_unit(states, plan.numbers.rate_units, number)
        return states, self.attitude(plan, rates, number)

    def blocks(self, m: Mechanics, plan: ModelPlan) -> list[StateBlock]:
        """The states of the rotation with their equations.

        Raises:
            ConfigError: a load that can't be written in these states.
        """
        why = plan.requirements.why
        attitude = m.carried(m.attitude)
        reason = why["attitude"] + (f"; {self.why}" if self.why else "")
        block = StateBlock(attitude.names, attitude.derivatives, attitude.initial, why=reason)
        return [rate_block(m, why["rates"]), block]

    def assembled(self, plan: ModelPlan, number: Rounder) -> tuple[Mechanics, list[StateBlock]] | None:
        """The mechanics and all states of a motion that isn't the full one; None for the full motion, to
        which flight, orbits and other states are added.
        """
        return None

    def asked_angles(self, attitude: AttitudeStates, branch: Symbolic) -> list[Symbolic]:
        """Euler angles of the requested sequence, as expressions of the states of its partner's chart.

        Args:
            branch: see ``rigidsim.model.formulations.euler_angles.across``.
        """
        raise NotImplementedError

    def check_start(self, scene: Scene, attitude: AttitudeStates | None) -> None:
        """Refuse a start at which the states don't exist.

        Raises:
            ConfigError: the start is singular.
        """

    def rate_bound(self, plan: ModelPlan) -> Any:
        """Upper bound (mpf, rad/s) of the rate at which what is carried turns."""
        return plan.scene.context.maximum(largest_rates(plan.scene, plan.scaling.drive))


def rate_block(m: Mechanics, why: str) -> StateBlock:
    """The body rates, by Euler's equations; where the momentum is carried instead, by M' = M x w + N."""
    context, scaling = m.scene.context, m.scaling
    initial = [
        context.ldexp(w, scaling.time - e) for w, e in zip(m.starting_rates, scaling.rates, strict=True)
    ]
    exponents = [e - scaling.time for e in scaling.rates]
    if m.rate_correction is not None:
        why += "; the states are the rates that the undistorted body would have with this angular momentum"
    return StateBlock(BODY.rates, m.accelerations, initial, exponents=exponents, why=why)


REGISTERED: dict[str, type[Formulation]] = {}
"""By the names of their variables."""

F = TypeVar("F", bound=type[Formulation])


def formulates(variables: Variables) -> Callable[[F], F]:
    """Register a formulation, so that ``[integrator] formulation`` finds it (a class decorator).

    Raises:
        ValueError: the name is taken.
    """

    def register(kind: F) -> F:
        register_class(REGISTERED, variables.name, kind, "a formulation named")
        FORMULATIONS[variables.name] = variables
        kind.variables = variables
        return kind

    return register
