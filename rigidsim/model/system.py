"""The system of equations that a scene needs, and its outputs: variables that are recorded, quantities that
are conserved, their watched drifts, and which invariants are projected onto their initial values during a
run.

An invariant that follows from others would only make the correction ill-determined, so each set is minimal:
L in space axes stands for its norm, six products of rows for a matrix's orthogonality. Norms are taken
squared, since a root has no gradient where it vanishes.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import heyoka as hy

import rigidsim.model.observables.mechanical  # noqa: F401  (enters what it defines into the registry)
from rigidsim.errors import ConfigError, Problem, ensure, required
from rigidsim.model.formulations.formulation import Formulation, ModelPlan
from rigidsim.model.impulses import Kick, kicks_of
from rigidsim.model.kinematics import Poles
from rigidsim.model.load import Load
from rigidsim.model.loads.rigid_bodies import second_body
from rigidsim.model.loads.tides_on_pairs import sources_of
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.names import above_zero, carries_sign, plain_angles, written
from rigidsim.model.observables.mechanical import WATCHED, WORK
from rigidsim.model.observables.observable import BALANCE, Observable, carries_work, has_balance
from rigidsim.model.orbits import Pieces, PieceSeries, TablePieces
from rigidsim.model.own_states import own_blocks, refuse_taken_names
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.state_blocks import BODY, RotatingBody, StateBlock, joined
from rigidsim.model.step_limiter import pace_block
from rigidsim.model.tangents import GROWTH, tangent_block
from rigidsim.scene.expressions.names import EULER_NAMES
from rigidsim.scene.expressions.tree import bounds
from rigidsim.scene.orbit_tables import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.scene import OwnState


@dataclass(frozen=True)
class Recorded:
    """One recorded variable of the dataset.

    Samples are joined as ``continuity`` says: "" (as they are), "wrapped" (angles that are states), "unwrap"
    (angles that are functions of the state), "parity" and "nearest" (quaternion signs).
    """

    name: str
    dims: tuple[str, ...]
    units: str
    long_name: str
    frame: str
    first: int  # position of its components in ``System.outputs``
    count: int
    exponents: list[int]  # binary, that bring the components to SI
    invariant: bool
    continuity: str = ""
    squared_sizes: list[Symbolic] = field(default_factory=list)  # vanish where angles are undefined
    poles: Poles | None = None  # for Euler angles that are functions of the state
    attributes: Mapping[str, str] = field(default_factory=dict)  # besides units, long name and frame


@dataclass(frozen=True)
class Invariant:
    """A quantity that the motion conserves, and the drift that is watched."""

    name: str
    why: str  # it is conserved
    units: str
    long_name: str
    expressions: list[Symbolic]  # its components, in internal units
    exponents: list[int]  # binary, of the components' units
    scale: Any  # what drifts are relative to, SI (mpf)
    scale_name: str
    numerical: bool = False  # of the numerical representation alone (a quaternion's norm)


def recorded_variables(m: Mechanics, record: Sequence[str] | None) -> tuple[list[Recorded], list[Symbolic]]:
    """The variables of the dataset, and all their components; what a scene lacks is refused."""
    recorded: list[Recorded] = []
    outputs: list[Symbolic] = []
    for observable in [*OBSERVABLES.values(), *(_of_state(m, state) for state in m.scene.states)]:
        wanted = observable.by_default(m) if record is None else observable.name in record
        if not wanted:
            continue
        if not observable.available(m):
            if record is not None:
                why = observable.absent(m) if observable.needed(m) else None
                raise ConfigError(
                    Problem(
                        "[output] record",
                        f'given "{observable.name}": {why or "this scene has none"}; leave it out',
                    )
                )
            continue
        components = observable.expressions(m)
        x, count = observable, len(components)
        sizes = [] if x.angles is None else [angle.squared_size for angle in x.angles(m)]
        variable = Recorded(
            x.name, x.dims, x.units, x.long_name, x.frame, len(outputs), count, x.unit_exponents(m, count),
            _conserved(m, x) is not None, x.continuity(m), sizes, x.poles(m), x.attributes(m),
        )  # fmt: skip
        recorded.append(variable)
        outputs += components
    return recorded, outputs


def _conserved(m: Mechanics, observable: Observable) -> str | None:
    """Why it stays, if it does: of two bodies under tides the energy less the work, across impulses norms."""
    tides = second_body(m.scene) is not None and sources_of(m.scene)
    watched = not m.scene.impulses and (not tides or observable.name == BALANCE[1])
    return observable.conserved(m) if watched or observable.units == "1" else None


def _of_state(m: Mechanics, state: OwnState) -> Observable:
    """The recorded variable of a user-defined state, which default records have."""
    unit = m.scaling.own.get(state.name, 0)
    return Observable(
        state.name, (), state.unit or "1", f"{state.name}, a state of [[states]]",
        lambda _: [hy.make_vars(state.name)], lambda _: [unit],
        attributes=lambda _: {"given_by": "[[states]]"},
    )  # fmt: skip


_UNIT = "1 by definition: any drift is rounding"
_WATCHED = {"orthogonality_defect": "0 by definition: any drift is rounding"}


def find_invariants(m: Mechanics, norms: list[Symbolic]) -> list[Invariant]:
    """All invariants of the scene; ``norms`` of orbits that are states stay 1 by construction."""
    found = []
    for observable in OBSERVABLES.values():
        if observable.drift_scale is None or not observable.available(m):
            continue
        why = _conserved(m, observable)
        if why is None:
            continue
        scale, scale_name = observable.drift_scale(m)
        expressions, x = observable.expressions(m), observable
        exponents = x.unit_exponents(m, len(expressions))
        found.append(Invariant(x.name, why, x.units, x.long_name, expressions, exponents, scale, scale_name))
    one = m.scene.context.one
    watched: list[tuple[str, str, str, Symbolic]] = [
        (f"orbit_norm_{number}", _UNIT, "norm of a cosine and sine that an orbit is carried by", expression)
        for number, expression in enumerate(norms, 1)
    ]
    if m.attitude is not None and m.attitude.defect is not None:
        name, long_name, expression = m.attitude.defect
        watched.append((name, _WATCHED.get(name, _UNIT), long_name, expression))
    if m.attitude is None and m.vertical is not None:
        norm = hy.sqrt(hy.sum([v * v for v in m.vertical]))
        watched.append(("vertical_norm", _UNIT, "norm of the vertical in body axes", norm))
    for name, why, long_name, expression in watched:
        found.append(Invariant(name, why, "1", long_name, [expression], [0], one, "1", numerical=True))
    return found


def drift_outputs(invariants: list[Invariant], context: Any, number: Rounder) -> list[Symbolic]:
    """Relative drifts (value - initial) / scale; for a vector, the norm of the difference over the scale."""
    drifts = []
    first = 0
    for invariant in invariants:
        inverse = number(context.ldexp(1, invariant.exponents[0]) / invariant.scale)
        differences = [x - hy.par[first + n] for n, x in enumerate(invariant.expressions)]
        first += len(differences)
        single = len(differences) == 1
        size = differences[0] if single else hy.sqrt(hy.sum([d * d for d in differences]))
        drifts.append(inverse * size)
    return drifts


_LARGEST_EXPONENT = 1000  # of a recorded variable in SI: float64 ends at 2^1024, and sizes are known roughly
IMPOSSIBLE = "impossible body"
ENDINGS: dict[str, Callable[[Load, Mechanics], list[tuple[str, Symbolic]]]] = {
    IMPOSSIBLE: lambda load, m: load.endings(m),
    "out of range": lambda load, m: load.range_ends(m),
    "contact": lambda load, m: load.contacts(m),
}
"""What ends a motion, by the words of the status."""
_DIRECTIONS = {"any": 0, "up": 1, "down": -1}


@dataclass(frozen=True)
class Crossing:
    """An event as an expression of the states."""

    name: str
    expression: Symbolic
    direction: int  # -1, 0 (any) or 1
    stop: bool
    impossible: str = ""  # why the motion can't go on past it; empty for events of the config
    kind: str = ""  # of that ending, as its status names it
    kicks: bool = False  # whether velocities change at it, as soon as it is found
    known: bool = False  # whether they do at a known time, so that it isn't looked for


class System:
    """First-order equations with scaled states, and everything recorded as expressions of them.

    In a run that goes backwards internal time is the
    scene's with the other sign: of equations written in the scene's time t every right-hand side changes its
    sign, and t is minus the engine's time in all expressions.

    Attributes:
        plan: decisions made before anything was rounded; what follows are parts of it.
        number: rounds an mpf once to the working precision's scalar.
        formulation: of the rotation: the plan's, or its partner (``chart``).
        sequence: sequence of the Euler angles that are states, or that are recorded.
        clocked: whether the second number of the time is the last parameter.
        coefficients: rounds the coefficients of the equations, if not as everything else.
        mechanics: what outputs and invariants are written in.
        blocks: the states, block by block.
        states, variables: names of the states, and the states as heyoka variables.
        state_exponents: binary, that bring the states to SI.
        initial: initial values (mpf), internal units.
        start: of the motion in internal time (mpf).
    """

    def __init__(
        self,
        plan: ModelPlan,
        number: Rounder,
        *,
        chart: Formulation | None = None,
        coefficients: Rounder | None = None,
        initial: Sequence[Any] | None = None,
    ) -> None:
        self.plan, self.number = plan, number
        self.formulation = chart or plan.formulation
        self.sequence = self.formulation.sequence or plan.scene.config.integrator.euler_sequence
        self.scene, self.scaling, self.requirements = plan.scene, plan.scaling, plan.requirements
        self.wide, self.clocked = plan.wide, plan.clocked
        self._chart, self.coefficients, self._initial = chart, coefficients, initial
        self.mechanics, self.blocks = assemble_states(plan, self.formulation, number)
        self._joined = whole = joined(self.blocks)
        self.states, self.variables = list(whole.names), whole.variables
        self.state_exponents = whole.unit_exponents
        self.initial = list(whole.initial if initial is None else initial)
        self.start = self.scaling.internal(self.scene.start, self.scene.context)

    # --- the same motion, rounded otherwise -----------------------------------------------------------------

    def rounded(self, number: Rounder) -> System:
        """The same system in another precision."""
        return System(self.plan, number, chart=self._chart, initial=self._initial)

    def with_coefficients(self, coefficients: Rounder) -> System:
        """The same system with the coefficients of its equations rounded otherwise, as in two parts."""
        other = copy.copy(self)  # keeps everything already worked out except what the coefficients change
        other.coefficients = coefficients
        other.__dict__.pop("equations", None)
        if other.__dict__.get("partner") is not None:
            other.__dict__["partner"] = other.__dict__["partner"].with_coefficients(coefficients)
        return other

    @property
    def in_two_parts(self) -> bool:
        """Whether coefficients of the equations have digits that the working precision can't hold."""
        return self.coefficients is not None

    @cached_property
    def partner(self) -> System | None:
        """The same system in the chart that a run changes to near the singularity; None without a chart.

        Its recorded Euler angles follow this system's sequence, on the branch given by the parameter
        after the invariants' (see ``rigidsim.model.formulations.formulation``).
        """
        partner = self.formulation.partner
        if partner is None:
            return None
        return System(self.plan, self.number, chart=partner, coefficients=self.coefficients)

    @cached_property
    def rate_bound(self) -> Any:
        """See ``Formulation.rate_bound``."""
        return self.formulation.rate_bound(self.plan)

    # --- states ---------------------------------------------------------------------------------------------

    @cached_property
    def equations(self) -> list[tuple[Symbolic, Symbolic]]:
        """(variable, right-hand side)."""
        if self.coefficients is not None:
            return System(self.plan, self.coefficients, chart=self._chart).equations
        rates = self._joined.derivatives
        if self.scaling.direction < 0:
            rates = [-rate for rate in self._in_internal_time(rates)]
        return list(zip(self.variables, rates, strict=True))

    def _in_internal_time(self, expressions: Sequence[Symbolic]) -> list[Symbolic]:
        """Expressions of the scene's time as expressions of internal time."""
        if self.scaling.direction > 0:
            return list(expressions)
        other = {hy.time: -hy.time}
        if self.clocked:
            second = hy.par[self.plan.surfaces.parameters]
            other[second] = -second
        return list(hy.subs([hy.expression(x) for x in expressions], other))

    @property
    def reasons(self) -> list[tuple[str, str]]:
        """(states, why) for each block, and for the chart that a run may change to."""
        found = []
        for block in self.blocks:
            many = len(block.names) > 6
            shown = f"{block.names[0]} ... {block.names[-1]}" if many else " ".join(block.names)
            found.append((shown, block.why))
        if self.partner is not None:
            angles = " ".join(self.mechanics.carried(self.mechanics.attitude).names)
            regular = self.partner.sequence
            why = f"near the singularity of {self.sequence}: angles of {regular}, which is regular there"
            found.append((angles, why))
        return found

    @property
    def unwatched(self) -> dict[str, str]:
        """Invariants of the scene that aren't monitored, and why."""
        if not self.formulation.resolves_rotation or carries_work(self.mechanics):
            return {}
        return (
            {BALANCE[1]: "neither it nor work is recorded, and no max_drift is given"}
            if has_balance(self.mechanics)
            else {}
        )

    @property
    def left_out(self) -> list[tuple[str, str]]:
        """(what, why) for groups of states that aren't carried."""
        work = [("work of the loads", f"{name}: {why}") for name, why in self.unwatched.items()]
        return [*self.requirements.left_out, *work]

    @cached_property
    def flown(self) -> RotatingBody | None:
        """Whose place and velocity are states: the body in flight, or a second body; None for neither."""
        others = (RotatingBody(f"{table.name}_") for table in self.scene.config.rigid_bodies)
        return next((one for one in (BODY, *others) if one.position[0] in self.states), None)

    def flown_units(self) -> tuple[Any, Any]:
        """Binary exponents of the units of that place and velocity."""
        names = required(self.flown)
        place, velocity = (self.states.index(x[0]) for x in (names.position, names.velocity))
        return self.state_exponents[place], self.state_exponents[velocity]

    @property
    def angle_states(self) -> tuple[int, ...]:
        """Indices of states that are angles growing without bound."""
        attitude = self.mechanics.attitude
        if attitude is None:
            return ()
        first = self.states.index(attitude.names[0])
        return tuple(first + i for i in attitude.angles)

    @property
    def angle_unit(self) -> int:
        """Binary exponent of the unit in which growing angles are carried, rad."""
        return 0 if self.mechanics.attitude is None else self.mechanics.attitude.angle_unit

    @property
    def singular_factor(self) -> Symbolic | None:
        """Expression that vanishes where the formulation is singular; None if it is regular everywhere."""
        attitude = self.mechanics.attitude
        return None if attitude is None else attitude.singular_factor

    # --- what is recorded -----------------------------------------------------------------------------------

    @cached_property
    def _recorded(self) -> tuple[list[Recorded], list[Symbolic]]:
        recorded, outputs = recorded_variables(self.mechanics.observed, self.requirements.record)
        drifts = drift_outputs(self.invariants, self.scene.context, self.number)
        attitude = self.mechanics.attitude
        if attitude is not None and self._chart is not None:
            # in the partner chart the angles of the requested sequence replace its own
            branch = hy.par[sum(len(invariant.expressions) for invariant in self.invariants)]
            for variable in recorded:
                if variable.continuity == "wrapped":
                    own = slice(variable.first, variable.first + variable.count)
                    outputs[own] = self.formulation.asked_angles(attitude, branch)
        return recorded, self._in_internal_time(outputs + drifts)

    @property
    def recorded(self) -> list[Recorded]:
        """Variables of the dataset."""
        return self._recorded[0]

    @property
    def outputs(self) -> list[Symbolic]:
        """Components of all recorded variables, then one drift per invariant; initial values of the
        invariants are ``par[..]`` in the order of their components.
        """
        return self._recorded[1]

    @cached_property
    def invariants(self) -> list[Invariant]:
        """All that is conserved."""
        found = find_invariants(self.mechanics.observed, list(self._joined.norms))
        return [replace(one, expressions=self._in_internal_time(one.expressions)) for one in found]

    @cached_property
    def crossings(self) -> list[Crossing]:
        """Events to be located along the motion, and then what ends it because no body can go on or the range
        of a model ends; the time that events read is a single number.
        """
        m, found = self.mechanics, []
        for event in self.scene.events:
            (expression,) = written(m, [event.expression], clocked=False)
            direction = self.scaling.direction * _DIRECTIONS[event.direction]
            one = Crossing(event.name, expression, direction, event.stop)
            kicks, known = event.impulse is not None, event.time is not None
            found.append(replace(one, kicks=kicks and not known, known=kicks and known))
        endings = [(*one, kind) for kind in ENDINGS for load in m.loads for one in ENDINGS[kind](load, m)]
        endings += [
            (f"{expression.where} is negative", above_zero(m, expression), IMPOSSIBLE)
            for expression in self.scene.never_negative()
            if bounds(expression)[0] < 0
        ]
        down = _DIRECTIONS["down"]
        found += [Crossing("", x, down, True, why, kind) for why, x, kind in endings]
        meant = self._in_internal_time([one.expression for one in found])
        return [replace(one, expression=x) for one, x in zip(found, meant, strict=True)]

    @property
    def events(self) -> list[Crossing]:
        """The ``crossings`` that are events of the config."""
        return self.crossings[: len(self.scene.events)]

    @cached_property
    def kicks(self) -> list[Kick]:
        """What changes at once at events."""
        found = kicks_of(self.mechanics)
        what = (
            "given for an impulse, but the equations switch at kinks, jumps or shadows on the way; give time"
        )
        for event in self.scene.impulses if self.switches else ():
            ensure(event.time is not None, required(event.impulse).fault("expression", what))
        return found

    # --- what changes at given times, or is switched --------------------------------------------------------

    @cached_property
    def pieces(self) -> Pieces | None:
        """What is set at given times, where steps must end; None without tables or bodies of a kernel."""
        start = self.scene.start
        parts: list[PieceSeries] = [
            TablePieces(orbit, place, self.scaling, start, self.number)
            for orbit, place in self.plan.tables.items()
        ]
        if (sky := self.mechanics.sky) is not None:
            parts += sky.pieces()
        return Pieces(parts) if parts else None

    @property
    def stepwise(self) -> bool:
        """Whether it needs a stepper rather than the bare engine, because something happens between steps."""
        return self.switches or self.pieces is not None or bool(self.kicks)

    @cached_property
    def surfaces(self) -> list[Symbolic]:
        """Arguments that vanish on switching surfaces; the parameter of the same number is the side, +-1."""
        found = (surface.expression for surface in self.plan.surfaces.found)
        return self._in_internal_time(written(self.mechanics, found))

    @cached_property
    def turning(self) -> list[Symbolic]:
        """Euler angles, less the full turns that are parameters after the sides."""
        names = self.plan.surfaces.turning
        angles = dict(zip(EULER_NAMES, plain_angles(self.mechanics), strict=True)) if names else {}
        return [angles[name] for name in names]

    @cached_property
    def signed(self) -> list[Symbolic]:
        """The quaternion, without its sign, if that sign is the last parameter; empty otherwise."""
        m = self.mechanics
        return list(m.carried(m.attitude).quaternion) if carries_sign(m) else []

    @property
    def parameters(self) -> int:
        """Number of parameters that equations and events may use; of pieces alone, none."""
        if self.switches and self.pieces is not None:
            return self.first_of_pieces + len(self.pieces.parameters(0))
        return self._sides + self.clocked

    @property
    def _sides(self) -> int:
        """Number of parameters that give sides, turns and the sign."""
        return len(self.surfaces) + len(self.turning) + bool(self.signed)

    @property
    def first_of_pieces(self) -> int:
        """Index of the first parameter of ``pieces``."""
        return self.plan.surfaces.parameters if self.plan.formulation.resolves_rotation else 0

    @property
    def switches(self) -> bool:
        """Whether there are switching surfaces, or angles or a quaternion continued from step to step."""
        return self._sides > 0


def build_system(plan: ModelPlan, number: Rounder) -> System:
    """Build the least system that a scene needs.

    Raises:
        ConfigError: a record that the scene or the formulation can't give, or a start in a singularity.
        OverflowError: numbers that neither the states nor the dataset can hold.
    """
    system = System(plan, number)
    system.formulation.check_start(plan.scene, system.mechanics.attitude)
    variables: list[Recorded | Invariant] = [*system.recorded, *system.invariants]
    for value in system.initial:  # after what is recorded, which may be refused for a better reason
        number(value)
    for variable in variables:
        for exponent in variable.exponents:
            ensure(
                abs(exponent) <= _LARGEST_EXPONENT,
                OverflowError(f"{variable.name} would be about 2^{exponent} {variable.units}"),
            )
    return system


# --- its states, block by block -----------------------------------------------------------------------------


def assemble_states(
    plan: ModelPlan, formulation: Formulation, number: Rounder
) -> tuple[Mechanics, list[StateBlock]]:
    """The mechanical quantities of a scene, and its blocks of states in the order of the system."""
    assembled = formulation.assembled(plan, number)
    if assembled is not None:
        return assembled
    requirements, numbers = plan.requirements, plan.numbers
    rates, attitude = formulation.rotation(plan, number)
    flies = requirements.flight
    m = Mechanics.built(
        plan.scene, plan.scaling, numbers, rates, attitude, number,
        vertical=requirements.vertical, flies=flies, loads=list(plan.loads), orbit_tags=plan.orbit_tags,
        surfaces=plan.surfaces, tables=plan.tables, clocked=plan.clocked,
    )  # fmt: skip
    # turns by what takes it
    if m.rate_correction is not None and m.attitude is not None and formulation.carries_rates:
        m = replace(m, attitude=formulation.attitude(plan, m.rates, number))
    blocks = formulation.blocks(m, plan)
    if flies:
        blocks.append(_flight_block(m, plan))
    if m.point_masses is not None:  # which feel the forces that the body exerts on them
        pulls = [part for load in m.loads for part in load.reaction(m)]
        blocks.append(m.point_masses.block(pulls))
    blocks += _load_blocks(m)
    blocks += own_blocks(m)
    if carries_work(m):
        why, unit = "work of the loads without a potential, to check the energy", [m.work_unit]
        blocks.append(
            StateBlock([WORK], [m.carried(m.power)], [m.scene.context.zero], exponents=unit, why=why)
        )
    blocks += pace_block(m, joined(blocks))
    if GROWTH in (requirements.record or ()):
        blocks.append(tangent_block(m, blocks))
    refuse_taken_names(m.scene, blocks)
    return m, blocks


def _flight_block(m: Mechanics, plan: ModelPlan) -> StateBlock:
    """x' = v and v' = force over mass, in the units of position and speed."""
    context, scaling = m.scene.context, m.scaling
    ratio = m.scaled(1, scaling.speed + scaling.time - scaling.length)
    accelerations = [hy.sum([m.number(v[i]) * x for v, x in m.force if v[i] != 0]) for i in range(3)]
    initial = [context.ldexp(x, -scaling.length) for x in m.carried(m.scene.position)]
    initial += [context.ldexp(v, -scaling.speed) for v in m.carried(m.scene.velocity)]
    return StateBlock(
        [*BODY.position, *BODY.velocity],
        [*(ratio * v for v in m.carried(m.velocity)), *accelerations],
        initial,
        exponents=[scaling.length] * 3 + [scaling.speed] * 3,
        why=plan.requirements.why["flight"],
    )


def _load_blocks(m: Mechanics) -> list[StateBlock]:
    """Orbits, each once for all loads on it, and any other states that loads bring."""
    blocks: list[StateBlock] = [] if m.sky is None else [m.sky.block()]
    carried: set[KeplerOrbit | TabulatedOrbit] = set()
    for load in m.loads:
        if (orbit := load.orbit) is not None and orbit not in carried:
            carried.add(orbit)
            titles = ", ".join(dict.fromkeys(x.title for x in m.loads if x.orbit == orbit))
            block = m.orbit(orbit).block
            blocks.append(replace(block, why=block.why or f"{titles}: where its source is"))
        if (table := load.table) is not None and table not in carried:
            carried.add(table)
            block = m.table(table).block
            blocks.append(replace(block, why=f'{load.title}: where its source is, by "{table.name}"'))
        own = load.extra_states(m)
        if own is not None:
            blocks.append(replace(own, why=own.why or f"{load.title}: where its source is"))
    return blocks


@dataclass(frozen=True)
class ProjectedScalar:
    """One scalar equation of a projected invariant, in internal units."""

    name: str  # of the invariant that it belongs to
    expression: Symbolic
    scale: Any  # size that its drift is relative to (mpf)


# invariant: (another one that stands for it if present, why it needn't be projected itself)
_FOLLOWS = {
    "angular_momentum_norm": ("angular_momentum", "its three components are projected"),
    "energy": ("rotational_energy", "its rotational part is projected; nothing turns the flight's velocity"),
}
_ALONE = "it is only monitored: projecting it would change the numbers of earlier runs"
_NEVER = {
    "energy_balance": "it checks a work that is integrated with the motion and doesn't act on it",
    **{observable.name: _ALONE for observable in WATCHED},
}


def _squared_rows(m: Mechanics) -> list[Symbolic]:
    r = m.matrix
    return [hy.sum([r[i][k] * r[j][k] for k in range(3)]) for i in range(3) for j in range(i + 1)]


# squares that stand for roots that can vanish: their scalars, and the relative drift in terms of the root's
_SQUARES: dict[str, tuple[Callable[[Mechanics], list[Symbolic]], int]] = {
    "angular_momentum_norm": (lambda m: [hy.sum([x * x for x in m.momentum_body])], 2),
    "quaternion_norm": (lambda m: [hy.sum([x * x for x in m.carried(m.attitude).variables])], 2),
    "vertical_norm": (lambda m: [hy.sum([x * x for x in m.carried(m.vertical)])], 2),
    "orthogonality_defect": (_squared_rows, 1),
}


def conserves(system: System) -> bool:
    """Whether any projected invariant is one of the motion, not just of its numerical representation."""
    return any(not found.numerical and found.name not in _NEVER for found in system.invariants)


def projected_invariants(system: System) -> tuple[list[ProjectedScalar], list[tuple[str, str]]]:
    """Scalars to project, and (invariant, why) for the invariants that are not projected themselves."""
    m = system.mechanics
    context = m.scene.context
    present = {invariant.name for invariant in system.invariants}
    projected: list[ProjectedScalar] = []
    left_out: list[tuple[str, str]] = []
    for invariant in system.invariants:
        name = invariant.name
        scale = context.ldexp(invariant.scale, -invariant.exponents[0])
        stand_in, why = _FOLLOWS.get(name, ("", ""))
        if stand_in in present:
            left_out.append((name, why))
        elif name in _NEVER:
            left_out.append((name, _NEVER[name]))
        elif name in _SQUARES:
            expressions, factor = _SQUARES[name]
            projected += [
                ProjectedScalar(name, expression, factor * scale * scale) for expression in expressions(m)
            ]
        else:
            projected += [ProjectedScalar(name, expression, scale) for expression in invariant.expressions]
    ensure(
        projected,
        ConfigError(
            Problem(
                "[integrator] hold_invariants",
                f"given true, but the loads leave nothing constant that {system.formulation.name} "
                'carries; set it to false, or choose formulation = "quaternion", whose norm can be projected',
            )
        ),
    )
    return projected, left_out
