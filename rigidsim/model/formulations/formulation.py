"""Formulations: the states in which the rotation of a scene is written, and what can be computed from them.

``Formulation`` is the protocol of all of them, ``formulates`` registers one. Everything else, from the flight
to the invariants, is written in terms of the attitude and the angular velocity as expressions of its states.

**The quaternion** has four states, no singularity, and is the cheapest and the default. **The rates alone**
are for what needs no attitude; with the vertical in body axes, if a torque reads that.

**Euler angles** of any sequence come in two charts of one attitude: the requested sequence, and a partner
whose singularity is far from its own.

A sequence ijk is singular where body axis k lies along space axis i: its factor is f = sqrt(1 - R_ik^2),
|sin| of the middle angle for proper sequences (k = i) and |cos| for the others. The partner keeps i and j and
ends with another axis k': its factor is f' = sqrt(1 - R_ik'^2), and since the rows of R are unit vectors,
f^2 + f'^2 >= 1. Where one chart breaks down, the other is at its best. A proper sequence's partner is a
Tait-Bryan one (zxz: zxy), and the other way round (xyz: xyx).

Both begin with the same two turns, so that the way across depends on the second and third angle alone:
R_j(b) R_k(c) = R_i(d) R_j(b') R_k'(c') and a' = a + d.

**The canonical formulation** has Euler angles and their conjugate momenta, from the Hamiltonian. With
w = K^-1 q' (K from ``euler_rates``) the momenta are p = K^-T I w, so that the body's angular momentum is
I w = K^T p and H = L . I^-1 L / 2 + U(q), of which heyoka derives Hamilton's equations (Goldstein, ch. 8).
It serves every load with a potential, one that moves with an orbit included.

**Planar motion** is the motion of a body that turns about a principal axis along which all torques point.
A spin about a principal axis along an orbit's normal stays there: neither the gyroscopic term I w x w nor the
torque of a gravity gradient has a part across it. Then the angle about that axis and its rate are the whole
motion (Goldreich & Peale 1966, Astron. J. 71, 425, eq. 1),

    angle' = spin,   I_k spin' = torque . k,

and the stability of a body that is pushed out of the plane isn't examined.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, TypeVar

import heyoka as hy

from rigidsim.errors import ConfigError, Problem, ensure, required
from rigidsim.model import rotations
from rigidsim.model.averaged.average import Average
from rigidsim.model.kinematics import ConstantInertia, in_common_unit
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics, carried_beside
from rigidsim.model.orbits import Carried, TablePlace
from rigidsim.model.probing import turned_out
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder, ScaledNumbers, Scaling, largest_rates
from rigidsim.model.state_blocks import BODY, AttitudeStates, StateBlock
from rigidsim.model.two_part import as_factor
from rigidsim.scene import attitude
from rigidsim.scene import attitude as numeric
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, multiply, negligible, norm, transpose
from rigidsim.scene.attitude import rotation_matrix
from rigidsim.scene.choices import DEFAULT_FORMULATION, FORMULATIONS, Variables
from rigidsim.scene.expressions.tree import readables
from rigidsim.scene.orbit_tables import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.registry import register_class
from rigidsim.scene.rotations import AXES, is_proper, parity
from rigidsim.scene.scene import Scene
from rigidsim.scene.surfaces import Surfaces


class Unsuited(ValueError):
    """A formulation doesn't apply to a scene; the message goes on from ``given "name", but``."""


@dataclass(frozen=True)
class Requirements:
    """Which states a scene requires."""

    attitude: bool
    vertical: bool  # as three states (Euler-Poisson equations)
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

    A user-defined one needs an ``attitude``, whose derivatives follow from the body rates; all else has a
    default. Numbers are exact (mpf, in the scene's arithmetic) until ``number`` rounds them once.

    Attributes:
        variables: what can be said of it for any scene.
        carries_rates: whether the angular velocity is carried as three states with separate units.
        resolves_rotation: whether every rotation is followed, rather than averaged over. A motion averaged
            over has an error of its model, which is measured.
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
            branch: see ``rigidsim.model.formulations.formulation.across``.
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


# --- states that follow the body rates as they are ----------------------------------------------------------


@formulates(FORMULATIONS[DEFAULT_FORMULATION])
class Quaternion(Formulation):
    """q' = q (0, w) / 2."""

    def attitude(self, plan: ModelPlan, rates: list[Symbolic], number: Rounder) -> AttitudeStates:
        return quaternion_states(plan.scene, rates)


def quaternion_states(scene: Scene, rates: list[Symbolic]) -> AttitudeStates:
    """The quaternion in space axes, for rates (body axes) in units of 1/time."""
    names = BODY.quaternion
    q = list(hy.make_vars(*names))
    squared = hy.sum([c * c for c in q])
    return AttitudeStates(
        names,
        rotations.quaternion_kinematics(q, rates),
        list(scene.quaternion),
        rotations.quaternion_matrix(q),
        q,
        "state",
        defect=("quaternion_norm", "norm of the attitude quaternion", hy.sqrt(squared)),
        chord=2.0,
    )


@formulates(FORMULATIONS["rotation_matrix"])
class RotationMatrix(Formulation):
    """The rotation matrix, body to space axes, row by row."""

    def attitude(self, plan: ModelPlan, rates: list[Symbolic], number: Rounder) -> AttitudeStates:
        names = [f"r{i}{j}" for i in "123" for j in "123"]
        flat = list(hy.make_vars(*names))
        r = [flat[0:3], flat[3:6], flat[6:9]]
        p, q, s = rates
        derivatives = []
        for a, b, c in r:
            derivatives += [b * s - c * q, c * p - a * s, a * q - b * p]
        defects = []
        for i in range(3):
            for j in range(i + 1):
                product = hy.sum([r[i][m] * r[j][m] for m in range(3)])
                difference = product - 1.0 if i == j else product
                defects.append(difference * difference)
        defect = (
            "orthogonality_defect",
            "deviation of R from orthogonality, root of the summed squares of R R^T - 1",
            hy.sqrt(hy.sum(defects)),
        )
        return AttitudeStates(
            names,
            derivatives,
            [x for row in rotation_matrix(plan.scene.quaternion) for x in row],
            r,
            rotations.quaternion_from_matrix(r),
            "nearest",
            defect=defect,
            chord=math.sqrt(0.5),
            observables=("rotation_matrix",),
        )


@formulates(FORMULATIONS["rates"])
class Rates(Formulation):
    """Euler's equations, and Poisson's for the vertical."""

    twin = "rates"

    def attitude(self, plan: ModelPlan, rates: list[Symbolic], number: Rounder) -> None:
        return None

    def blocks(self, m: Mechanics, plan: ModelPlan) -> list[StateBlock]:
        why = plan.requirements.why
        blocks = [rate_block(m, why["rates"])]
        if plan.requirements.vertical:
            seen = apply(transpose(rotation_matrix(m.scene.quaternion)), required(m.numbers.up))
            turning = cross(m.carried(m.vertical), m.rates)  # Poisson's g' = g x w
            blocks.append(StateBlock(BODY.vertical, turning, seen, why=why["vertical"]))
        return blocks


ANGLES = ["phi", "theta", "psi"]


# --- Euler angles -------------------------------------------------------------------------------------------


@formulates(FORMULATIONS["euler_angles"])
class EulerAngles(Formulation):
    """The angles of one sequence, with the same motion in the partner sequence, unless this is that one."""

    def __init__(self, sequence: str, partner: EulerAngles | None = None) -> None:
        self.sequence, self.partner = sequence, partner

    @classmethod
    def of(cls, scene: Scene, loads: Sequence[Load]) -> EulerAngles:
        """See ``Formulation``: of the sequence in the config."""
        sequence = scene.config.integrator.euler_sequence
        return cls(sequence, cls(partner_sequence(sequence)))

    def attitude(self, plan: ModelPlan, rates: list[Symbolic], number: Rounder) -> AttitudeStates:
        return euler_states(plan.scene, rates, self.sequence)

    def asked_angles(self, attitude: AttitudeStates, branch: Symbolic) -> list[Symbolic]:
        return across(self.sequence, attitude.variables, hy, branch)


def euler_states(scene: Scene, rates: list[Symbolic], sequence: str) -> AttitudeStates:
    """The angles of a sequence: the requested one, or its partner."""
    asked = scene.config.integrator.euler_sequence
    angles = list(hy.make_vars(*ANGLES))
    derivatives, factor = rotations.euler_rates(sequence, angles, rates)
    matrix = attitude.rotation_matrix(scene.quaternion)
    start = scene.euler_angles or attitude.euler_from_matrix(scene.context, matrix, asked)
    initial = start if sequence == asked else attitude.euler_from_matrix(scene.context, matrix, sequence)
    quaternion = rotations.quaternion_from_euler(sequence, angles)
    if scene.euler_angles is None and _opposite(scene, start):
        quaternion = [-x for x in quaternion]  # in both charts: from one to the other its sign is kept
    return AttitudeStates(
        ANGLES,
        derivatives,
        list(initial),
        rotations.euler_matrix(sequence, angles),
        quaternion,
        "wrapping",
        angles=(0, 1, 2),
        singular_factor=factor,
        sequence=sequence,
        observables=("euler_angles",),
    )


def _opposite(scene: Scene, angles: list[Any]) -> bool:
    """Whether the quaternion of the requested sequence's angles is minus the scene's initial one."""
    made = attitude.quaternion_from_euler(scene.context, angles, scene.config.integrator.euler_sequence)
    return bool(dot(made, list(scene.quaternion)) < 0)


# --- the partner's chart ------------------------------------------------------------------------------------


def partner_sequence(sequence: str) -> str:
    """The sequence that a run changes to near the singularity of another; the relation is mutual."""
    first, second = sequence[0], sequence[1]
    last = (set(AXES) - {first, second}).pop() if is_proper(sequence) else first
    return first + second + last


def across(sequence: str, angles: list[Any], functions: Any, branch: Any = 1.0) -> list[Any]:
    """The same attitude in the partner's angles; the first isn't reduced to one turn.

    No digits are lost anywhere: small sines come from small sines. Every attitude has two triples of angles;
    exactly in the partner's singularity the outer ones are those that atan2(0, 0) = 0 gives.

    Args:
        angles: angles of ``sequence``, radians.
        functions: module that provides ``sin``, ``cos``, ``sqrt`` and ``atan2``: ``math`` or ``heyoka``.
        branch: +1 for a middle angle in [0, pi] or [-pi/2, pi/2], -1 for the other triple.
    """
    first, middle, last = angles
    sine, cosine, atan2 = functions.sin, functions.cos, functions.atan2
    sb, cb, sc, cc = sine(middle), cosine(middle), sine(last), cosine(last)
    signed = float(parity(AXES.index(sequence[0]), AXES.index(sequence[1]))) * branch
    if is_proper(sequence):
        size = functions.sqrt(cb * cb + (sb * sc) * (sb * sc))
        return [
            first + atan2(branch * sc, branch * (cb * cc)),
            atan2(sb * cc, branch * size),
            atan2(-(signed * (sb * sc)), branch * cb),
        ]
    size = functions.sqrt(sb * sb + (cb * sc) * (cb * sc))
    return [
        first + atan2(signed * sc, branch * (sb * cc)),
        atan2(branch * size, cb * cc),
        atan2(-(signed * (cb * sc)), branch * sb),
    ]


def pole_of_partner(sequence: str, angles: list[float], functions: Any) -> float:
    """R_ik' at these angles of ``sequence``, which is +1 or -1 in the partner's singularity, where only the
    sum (+1) or the difference (-1) of the partner's outer angles is defined.
    """
    _, middle, last = angles
    if not is_proper(sequence):
        return float(functions.cos(middle) * functions.cos(last))
    sign = parity(AXES.index(sequence[0]), AXES.index(sequence[1]))
    return float(sign * (functions.sin(middle) * functions.cos(last)))


def singular_factor(sequence: str, middle: float, functions: Any) -> float:
    """Factor that vanishes in the singularity; negative on the branch of the other triple."""
    return float(functions.sin(middle) if is_proper(sequence) else functions.cos(middle))


MOMENTA = ("p_phi", "p_theta", "p_psi")


# --- canonical momenta --------------------------------------------------------------------------------------


@formulates(FORMULATIONS["canonical"])
class Canonical(Formulation):
    """Angles and momenta, of which the body rates are functions."""

    carries_rates = False

    def __init__(self, sequence: str) -> None:
        self.sequence = sequence

    @classmethod
    def of(cls, scene: Scene, loads: Sequence[Load]) -> Canonical:
        """See ``Formulation``: of the sequence in the config."""
        return cls(scene.config.integrator.euler_sequence)

    def rotation(self, plan: ModelPlan, number: Rounder) -> tuple[list[Symbolic], AttitudeStates]:
        angles, momenta = list(hy.make_vars(*ANGLES)), list(hy.make_vars(*MOMENTA))
        columns = []
        for i in range(3):
            unit = [rotations.constant(float(i == j)) for j in range(3)]
            columns.append(rotations.euler_rates(self.sequence, angles, unit)[0])
        body = [hy.sum([k * p for k, p in zip(column, momenta, strict=True)]) for column in columns]
        rates = ConstantInertia.of(plan.numbers, number, plan.scene.context).solved(body)
        return rates, replace(euler_states(plan.scene, rates, self.sequence), momenta=MOMENTA)

    def blocks(self, m: Mechanics, plan: ModelPlan) -> list[StateBlock]:
        attitude = m.carried(m.attitude)
        block = StateBlock(
            [*attitude.names, *MOMENTA],
            _hamilton_equations(m),
            [*attitude.initial, *_initial_momenta(plan.scene, plan.scaling, attitude.initial)],
            exponents=[0] * 3 + [m.scaling.momentum] * 3,
            why=plan.requirements.why["attitude"],
        )
        return [block]

    def check_start(self, scene: Scene, attitude: AttitudeStates | None) -> None:
        """Refuse a start at which canonical momenta of Euler angles don't exist."""
        context, middle = scene.context, required(attitude).initial[1]
        factor = abs(context.sin(middle) if is_proper(self.sequence) else context.cos(middle))
        if factor < context.mpf(2) ** -20:
            raise ConfigError(
                Problem(
                    "[integrator] formulation",
                    f"the motion starts {context.nstr(factor, 3)} rad from the singularity of the sequence "
                    f"{self.sequence} (middle angle {context.nstr(middle, 8)} rad), where Euler angles have "
                    'no momenta; choose formulation = "euler_angles", which changes its sequence there, '
                    '"quaternion", or another euler_sequence',
                )
            )


def _initial_momenta(scene: Scene, scaling: Scaling, angles: list[Any]) -> list[Any]:
    """Projections of the angular momentum on the three axes that the angles turn about."""
    context, sequence = scene.context, scene.config.integrator.euler_sequence
    body = apply(scene.body.inertia, scene.angular_velocity)
    momentum = apply(numeric.rotation_matrix(scene.quaternion), body)
    turned = numeric.rotation_matrix([context.one] + [context.zero] * 3)
    projections = []
    for angle, axis in zip(angles, sequence, strict=True):
        index = "xyz".index(axis)
        direction = [row[index] for row in turned]
        projections.append(context.ldexp(dot(direction, momentum), -scaling.momentum))
        quaternion = numeric.quaternion_from_euler(context, [angle, context.zero, context.zero], axis * 3)
        turned = multiply(turned, numeric.rotation_matrix(quaternion))
    return projections


def _hamilton_equations(m: Mechanics) -> list[Symbolic]:
    """Right-hand sides of the three angles and momenta; refused for a load without a potential."""
    if beside := carried_beside(m.loads):
        raise ConfigError(
            Problem(
                "[integrator] formulation", f'given "canonical", but {beside}; choose another formulation'
            )
        )
    parts = [m.rotational_energy]
    for load in m.loads:
        if not load.torque(m):
            continue
        potential = load.potential(m)
        if potential is None:
            raise ConfigError(
                Problem(
                    "[integrator] formulation",
                    f'given "canonical", but {load.title} has no potential; choose another formulation',
                )
            )
        parts.append(potential)
    hamiltonian = hy.sum(parts)
    angles, momenta = list(hy.make_vars(*ANGLES)), list(hy.make_vars(*MOMENTA))
    # an orbit's phase and a position are no coordinates of the rotation: parameters take their place
    own = {*ANGLES, *MOMENTA}
    foreign = [hy.make_vars(name) for name in hy.get_variables(hamiltonian) if name not in own]
    there = {x: hy.par[i] for i, x in enumerate(foreign)}
    back = {hy.par[i]: x for i, x in enumerate(foreign)}
    derived = hy.hamiltonian(hy.subs(hamiltonian, there), angles, momenta)
    return [hy.subs(right, back) for _, right in derived]


ANGLE, SPIN = "angle", "spin"
ANGLE_UNIT = 20
"""The angle is carried in units of 2**20 rad, so that it never becomes the largest state (to which step
control is relative), however often the body has turned.
"""


# --- planar motion ------------------------------------------------------------------------------------------


@formulates(FORMULATIONS["planar"])
class Planar(Formulation):
    """The angle (initially ``angle``, mpf) about a principal axis (unit, body axes), and its rate.

    It counts from ``origin``, the smallest rotation that takes the axis to its direction in space.
    """

    carries_rates = False
    twin = "planar"

    def __init__(self, axis: Vector, origin: Vector, angle: Any, why: str) -> None:
        self._axis, self._origin, self._angle, self.why = axis, origin, angle, why

    @classmethod
    def of(cls, scene: Scene, loads: Sequence[Load], why: str = "") -> Planar:
        try:
            return cls(*_plane_of(scene, loads), why)
        except Unsuited as against:
            for_what = "it is for a body that turns about a principal axis with every torque along it"
            raise Unsuited(f'{against}; {for_what}, such as the normal of its orbit; choose "auto"') from None

    @classmethod
    def by_gradients(cls, scene: Scene, loads: Sequence[Load]) -> Planar | None:
        """The formulation for a motion that gravity gradients keep in a plane; None for any other."""
        why = "the body turns about a principal axis, along which every torque points and stays "
        why += '(formulation = "quaternion" carries the full motion)'
        try:
            return cls.of(scene, loads, why) if any(load.has_source for load in loads) else None
        except Unsuited:
            return None

    def rotation(self, plan: ModelPlan, number: Rounder) -> tuple[list[Symbolic], AttitudeStates]:
        state, spin = hy.make_vars(ANGLE, SPIN)
        angle = 2.0**ANGLE_UNIT * state
        axis = [as_factor(number(x)) for x in self._axis]
        base = [[as_factor(number(x)) for x in row] for row in attitude.rotation_matrix(self._origin)]
        about = _turn_about(self._axis, angle, number)
        half = 0.5 * angle
        c, s = hy.cos(half), hy.sin(half)
        quaternion = rotations.quaternion_product(
            [as_factor(number(x)) for x in self._origin], [c, *(x * s for x in axis)]
        )
        states = AttitudeStates(
            [ANGLE],
            [2.0**-ANGLE_UNIT * spin],
            [plan.scene.context.ldexp(self._angle, -ANGLE_UNIT)],
            rotations.multiply(base, about),
            quaternion,
            "wrapping",
            angles=(0,),
            angle_unit=ANGLE_UNIT,
            chord=2.0**ANGLE_UNIT,
            momenta=(SPIN,),
        )
        return [x * spin for x in axis], states

    def blocks(self, m: Mechanics, plan: ModelPlan) -> list[StateBlock]:
        states, axis, why = m.carried(m.attitude), self._axis, plan.requirements.why["attitude"]
        spin = m.scene.context.ldexp(dot(m.scene.angular_velocity, axis), m.scaling.time)
        block = StateBlock(
            [*states.names, SPIN],
            [*states.derivatives, self._spin_equation(m)],
            [*states.initial, spin],
            exponents=[ANGLE_UNIT, -m.scaling.time],
            why=why + (f"; {self.why}" if self.why else ""),
        )
        return [block]

    def _spin_equation(self, m: Mechanics) -> Symbolic:
        """Right-hand side of I_k spin' = torque . k, solved for spin'."""
        axis, context = self._axis, m.scene.context
        moment = dot(axis, apply(m.numbers.inertia, axis))
        terms = []
        for vector, expression in m.torque:
            along = dot(axis, vector)
            if abs(along) > negligible(context) * norm(context, vector):
                terms.append(m.number(along / moment) * expression)
        return hy.sum(terms)


def _plane_of(scene: Scene, loads: Sequence[Load]) -> tuple[Vector, Vector, Any]:
    """Axis, origin and angle of a motion that stays in a plane; ``Unsuited`` where that isn't known."""
    ensure(not scene.free_flight, Unsuited("the body has a position and flies"))
    if beside := carried_beside(loads):
        raise Unsuited(beside)
    context = scene.context
    axis = _spin_axis(scene, loads)
    normal = apply(attitude.rotation_matrix(scene.quaternion), axis)
    if (load := turned_out(scene, loads, axis)) is not None:
        raise Unsuited(f"the torque of {load.title} may turn the body out of its plane")
    turned = _least_turn(context, axis, normal)
    # the remaining rotation is about the axis, and the scalar product gives its half angle
    w, *v = attitude.product([turned[0], *(-x for x in turned[1:])], list(scene.quaternion))
    half = context.atan2(dot(v, axis), w)
    angle = 2 * half
    if angle > context.pi:
        angle, turned = angle - 2 * context.pi, [-x for x in turned]
    elif angle <= -context.pi:
        angle, turned = angle + 2 * context.pi, [-x for x in turned]
    return axis, turned, angle


def _spin_axis(scene: Scene, loads: Sequence[Load]) -> Vector:
    """Axis that the body turns about; at rest, the principal axis that lies along an orbit's normal."""
    context, rates = scene.context, scene.angular_velocity
    tiny = negligible(context)
    size = norm(context, rates)
    if size != 0:
        axis = [w / size for w in rates]
        momentum = apply(scene.body.inertia, axis)
        ensure(
            norm(context, cross(axis, momentum)) <= tiny * max(scene.body.principal_moments),
            Unsuited("the body doesn't turn about a principal axis"),
        )
        return axis
    for axis in scene.body.principal_axes[::-1]:
        if turned_out(scene, loads, axis) is None:
            return list(axis)
    raise Unsuited("the body is at rest, and none of its principal axes is one that every torque is along")


def _least_turn(context: Any, axis: Vector, normal: Vector) -> Vector:
    """Quaternion of the smallest rotation that takes one unit vector to another; exact if they coincide."""
    tiny = negligible(context)
    across, along = cross(axis, normal), dot(axis, normal)
    if norm(context, across) <= tiny:
        if along > 0:
            return [context.one] + [context.zero] * 3
        least = min(range(3), key=lambda i: abs(axis[i]))  # half a turn about an axis across it
        other = [context.one if i == least else context.zero for i in range(3)]
        found = cross(axis, other)
        length = norm(context, found)
        return [context.zero, *(x / length for x in found)]
    return attitude.unit_quaternion(context, [1 + along, *across])


def _turn_about(axis: Vector, angle: Symbolic, number: Rounder) -> rotations.SymbolicMatrix:
    """Rotation matrix about a unit axis k (Rodrigues): k k^T + cos (1 - k k^T) + sin [k]x."""
    c, s = hy.cos(angle), hy.sin(angle)
    x, y, z = axis
    skew = [[0 * x, -z, y], [z, 0 * x, -x], [-y, x, 0 * x]]

    def entry(a: int, b: int) -> Symbolic:
        along = axis[a] * axis[b]
        constants = along, (1 if a == b else 0) - along, skew[a][b]
        factors = zip(constants, (rotations.constant(1.0), c, s), strict=True)
        return hy.sum([as_factor(number(k)) * factor for k, factor in factors if k != 0])

    return [[entry(a, b) for b in range(3)] for a in range(3)]
