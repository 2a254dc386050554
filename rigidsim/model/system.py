"""The system of equations that a scene needs, ready to be integrated and recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.applied import AppliedModel, state_names
from rigidsim.model.canonical import MOMENTA, canonical_states, hamilton_equations
from rigidsim.model.catalogue import load_models
from rigidsim.model.charts import across, partner_sequence
from rigidsim.model.drive import estimate_drive
from rigidsim.model.dynamics import (
    Number,
    flight_equations,
    rate_equations,
    scaled_numbers,
    vertical_equations,
    vertical_from_attitude,
)
from rigidsim.model.formula import to_heyoka
from rigidsim.model.formulations import BUILDERS, AttitudeStates, euler_states
from rigidsim.model.loads import LoadModel
from rigidsim.model.mechanics import Mechanics, in_common_unit
from rigidsim.model.observables import WORK, work_is_needed
from rigidsim.model.orbital import note_orbital_frame, orbital_load, orbital_states
from rigidsim.model.pace import PACE, arguments, pace_derivative
from rigidsim.model.recording import Invariant, Recorded, drift_outputs, find_invariants, recorded_variables
from rigidsim.model.requirements import Requirements, choose_requirements
from rigidsim.model.rotations import Expression
from rigidsim.model.scaling import Scaling, choose_scaling, largest_rates
from rigidsim.scene import attitude as numeric
from rigidsim.scene.context import apply, transpose
from rigidsim.scene.scene import Scene

_LARGEST_EXPONENT = 1000
"""Of a recorded variable in SI: float64 ends at 2^1024, and the size of a variable is known roughly."""


@dataclass(frozen=True)
class Crossing:
    """An event as an expression of the states; ``direction`` is -1, 0 (any) or 1."""

    name: str
    expression: Expression
    direction: int
    stop: bool


@dataclass(frozen=True)
class System:
    """First-order equations with scaled states, and everything recorded as expressions of them.

    Attributes:
        states: names.
        equations: (variable, right-hand side).
        initial: mpf, in internal units.
        state_exponents: binary exponents that bring the states to SI.
        outputs: components of all recorded variables, then one drift per invariant, whose initial values
            are ``par[..]`` in the order of the invariants' components.
        angle_states: positions of states that are angles growing without bound.
        singular_factor: expression that vanishes where the formulation breaks down, or None.
        crossings: events to be found along the way.
        wide: whether the equations are too long to be compiled unrolled.
        mechanics: the quantities that outputs and invariants are written in.
        rate_bound: upper bound of the absolute angular velocity, rad/s (mpf).
        sequence: of the Euler angles that are states, or that are recorded.
        partner: the same in the chart that a run changes to near the singularity: the same states but for
            the angles. Its recorded Euler angles are those of this system's sequence, on the branch that
            the parameter after the invariants' gives (see ``rigidsim.model.charts``). None without a chart.
    """

    scene: Scene
    scaling: Scaling
    requirements: Requirements
    states: list[str]
    equations: list[tuple[Expression, Expression]]
    initial: list[Any]
    state_exponents: list[int]
    recorded: list[Recorded]
    invariants: list[Invariant]
    outputs: list[Expression]
    angle_states: tuple[int, ...]
    singular_factor: Expression | None
    sequence: str
    rate_bound: Any
    crossings: list[Crossing]
    wide: bool
    mechanics: Mechanics
    partner: System | None = None

    @property
    def variables(self) -> list[Expression]:
        """The states as heyoka variables."""
        return [variable for variable, _ in self.equations]


def build_system(
    scene: Scene, number: Number, extra_loads: Sequence[LoadModel] = (), *, sequence: str | None = None
) -> System:
    """Build the least system that the scene needs.

    Args:
        number: from an mpf to the working precision's scalar, rounded once.
        extra_loads: beside those of the config.
        sequence: of the Euler angles that are states, where it is not the scene's.

    Raises:
        ConfigError: a record that the scene or the formulation can't give, or a start in a singularity.
    """
    loads = [*load_models(scene), *extra_loads]
    requirements = choose_requirements(scene, loads)
    unknown = [load for load in loads if isinstance(load, AppliedModel)] + list(extra_loads)
    scaling = choose_scaling(scene, estimate_drive(scene, unknown, requirements))
    numbers = scaled_numbers(scene, scaling)
    context = scene.context

    attitude: AttitudeStates | None = None
    vertical: list[Expression] | None = None
    canonical = requirements.formulation == "canonical"
    names: list[str] = []
    derivatives: list[Expression] = []
    if canonical:
        scaling = replace(scaling, rates=(0, 0, 0))
        numbers = scaled_numbers(scene, scaling)
        states = canonical_states(scene, scaling, numbers, number)
        attitude, rate_states = states.attitude, states.rates
        names += [*attitude.names, *MOMENTA]
        initial = [*attitude.initial, *states.initial_momenta]
        exponents = [0] * 3 + [scaling.momentum] * 3
    else:
        names += ["wx", "wy", "wz"]
        rate_states = list(hy.make_vars(*names))
        initial = [
            context.ldexp(w, scaling.time - e)
            for w, e in zip(scene.angular_velocity, scaling.rates, strict=True)
        ]
        exponents = [e - scaling.time for e in scaling.rates]
    rates = in_common_unit(rate_states, numbers.rate_units, number)
    if not canonical and requirements.formulation != "rates":
        if requirements.formulation == "euler_angles":
            attitude = euler_states(scene, rates, sequence)
        elif (orbiting := orbital_load(scene, loads, requirements.formulation)) is not None:
            unit = context.ldexp(context.one, scaling.time)
            attitude = orbital_states(scene, rates, orbiting, unit, number)
            note_orbital_frame(requirements.reasons)
        else:
            attitude = BUILDERS[requirements.formulation](scene, rates)
        names += attitude.names
        derivatives += attitude.derivatives
        initial += attitude.initial
        exponents += [0] * len(attitude.names)
    if attitude is not None:
        if numbers.arm is not None:
            vertical = vertical_from_attitude(attitude.matrix, numbers, number)
    elif requirements.vertical:
        vertical_names = ["gx", "gy", "gz"]
        vertical = list(hy.make_vars(*vertical_names))
        names += vertical_names
        derivatives += vertical_equations(vertical, rates)
        assert numbers.up is not None
        initial += apply(transpose(numeric.rotation_matrix(scene.quaternion)), numbers.up)
        exponents += [0] * 3
    position = velocity = None
    if requirements.flight:
        assert scene.position is not None
        assert scene.velocity is not None
        position = list(hy.make_vars("x", "y", "z"))
        velocity = list(hy.make_vars("vx", "vy", "vz"))
        names += ["x", "y", "z", "vx", "vy", "vz"]
        initial += [context.ldexp(x, -scaling.length) for x in scene.position]
        initial += [context.ldexp(v, -scaling.speed) for v in scene.velocity]
        exponents += [scaling.length] * 3 + [scaling.speed] * 3
    mechanics = Mechanics(
        scene, scaling, numbers, rate_states, attitude, vertical, position, velocity, number, loads
    )
    turning = hamilton_equations(mechanics) if canonical else rate_equations(mechanics, mechanics.torque)
    derivatives = turning + derivatives
    if requirements.flight:
        x_rates, v_rates = flight_equations(mechanics, mechanics.force)
        derivatives += x_rates + v_rates
    norms: list[Expression] = []
    for load in loads:
        extra = load.extra_states(mechanics)
        if extra is not None:
            names += extra.names
            derivatives += extra.derivatives
            initial += extra.initial
            exponents += [0] * len(extra.names)
            norms += extra.norms
            requirements.reasons.append((" ".join(extra.names), f"{load.title}: where its source is"))
    if work_is_needed(mechanics):
        names.append(WORK)
        assert mechanics.power is not None
        derivatives.append(mechanics.power)
        initial.append(context.zero)
        exponents.append(scaling.energy)
        requirements.reasons.append((WORK, "work of the loads without a potential, to check the energy"))
    watched = arguments(mechanics)
    if watched:
        carried = dict(zip(names, derivatives, strict=True))
        names.append(PACE)
        derivatives.append(pace_derivative([u for _, u in watched], carried))
        initial.append(context.zero)
        exponents.append(0)
        titles = ", ".join(dict.fromkeys(title for title, _ in watched))
        requirements.reasons.append((PACE, f"{titles}: no step may pass over what is narrow in it"))
    if canonical:
        _refuse_singular_start(scene, attitude)
    recorded, outputs = recorded_variables(mechanics, requirements)
    invariants = find_invariants(mechanics, norms)
    outputs += drift_outputs(invariants, context, number)
    asked = scene.config.integrator.euler_sequence
    partner = None
    if requirements.formulation == "euler_angles":
        assert attitude is not None
        if attitude.sequence != asked:
            branch = hy.par[sum(len(invariant.expressions) for invariant in invariants)]
            _ask_of_partner(recorded, outputs, attitude, branch)
        elif sequence is None:
            partner = build_system(scene, number, extra_loads, sequence=partner_sequence(asked))
            why = f"near the singularity of {asked}: angles of {partner.sequence}, which is regular there"
            requirements.reasons.append((" ".join(attitude.names), why))
    first_angle = 0 if canonical else 3
    angle_states = tuple(first_angle + i for i in attitude.angles) if attitude else ()
    _refuse_out_of_range(initial, [*recorded, *invariants], number)
    return System(
        scene=scene,
        scaling=scaling,
        requirements=requirements,
        states=names,
        equations=list(zip(hy.make_vars(*names), derivatives, strict=True)),
        initial=initial,
        state_exponents=exponents,
        recorded=recorded,
        invariants=invariants,
        outputs=outputs,
        angle_states=angle_states,
        singular_factor=attitude.singular_factor if attitude else None,
        sequence=sequence or asked,
        rate_bound=max(largest_rates(scene, scaling.drive)),
        crossings=_crossings(mechanics),
        wide=any(load.wide for load in loads),
        mechanics=mechanics,
        partner=partner,
    )


def _crossings(m: Mechanics) -> list[Crossing]:
    signs = {"any": 0, "up": 1, "down": -1}
    return [
        Crossing(
            event.name,
            to_heyoka(event.expression, state_names(m, event.reads), m.number, m.scene.context),
            signs[event.direction],
            event.stop,
        )
        for event in m.scene.events
    ]


def _ask_of_partner(
    recorded: list[Recorded], outputs: list[Expression], attitude: AttitudeStates, branch: Expression
) -> None:
    """Put the asked sequence's angles in the place of the partner's own among the outputs."""
    angles = list(hy.make_vars(*attitude.names))
    for variable in recorded:
        if variable.name == "euler_angles":
            place = slice(variable.first, variable.first + variable.count)
            outputs[place] = across(attitude.sequence, angles, hy, branch)


def _refuse_singular_start(scene: Scene, attitude: AttitudeStates | None) -> None:
    if attitude is None or attitude.singular_factor is None:
        return
    context = scene.context
    middle = attitude.initial[1]
    proper = attitude.sequence[0] == attitude.sequence[2]
    factor = abs(context.sin(middle) if proper else context.cos(middle))
    if factor < context.mpf(2) ** -20:
        raise ConfigError(
            Problem(
                "[integrator] formulation",
                f"the motion starts {context.nstr(factor, 3)} rad from the singularity of the sequence "
                f"{attitude.sequence} (middle angle {context.nstr(middle, 8)} rad), where Euler angles have "
                'no momenta; choose formulation = "euler_angles", which changes its sequence there, '
                '"quaternion", or another euler_sequence',
            )
        )


def _refuse_out_of_range(
    initial: list[Any], variables: Sequence[Recorded | Invariant], number: Number
) -> None:
    """Raise OverflowError for what neither the states nor the dataset's float64 numbers can hold."""
    for value in initial:
        number(value)
    for variable in variables:
        largest = max(variable.exponents, key=abs)
        if abs(largest) > _LARGEST_EXPONENT:
            raise OverflowError(f"{variable.name} would be about 2^{largest} {variable.units}")
