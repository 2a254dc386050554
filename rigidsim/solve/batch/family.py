"""Members of a sweep as the batch engine sees them, families of those that share their equations, and their
runs from the start to the last sample, with everything that is recorded of them.

A family's system is built once with the numbers of all its members (``rigidsim.scene.swept``), for whom a
coefficient that depends on what is swept is a parameter.

As in a single run an event's expression is given a unit in which it is of order one, and is taken off a zero
that the motion begins at (``rigidsim.solve.events``). Both depend on the member, so that they are parameters.
Tangent vectors have an integrator and functions apart: compiled with them, the motion might be rounded
otherwise.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property, lru_cache, partial
from typing import Any, TypeAlias

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError
from rigidsim.model.formulations.formulation import ModelPlan
from rigidsim.model.model_plan import plan_model
from rigidsim.model.names import TANGENT
from rigidsim.model.scaling import EstimatedEffect
from rigidsim.model.system import System
from rigidsim.model.tangents import GROWTH
from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.choices import DEFAULT_METHOD, FULL, variables_named
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.paths import Path
from rigidsim.scene.scene import Scene, build_scene, check_start
from rigidsim.scene.sweep import Sweep
from rigidsim.scene.swept import Swept, SweptContext, SweptExact, Untraceable
from rigidsim.solve.compiled import compiled_function, evaluate_rows
from rigidsim.solve.effects.effect import registered_effects
from rigidsim.solve.events import BESIDE, STATES, TIMES, exponents_of
from rigidsim.solve.lanes import LANES_OF_A_TABLE, BatchEngine, LaneResults, recommended_width
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.solve.requirements import SetAtKnots
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.status import Status
from rigidsim.solve.turns import DENSE, DOUBTFUL, nearest, radians_between_samples

_HELD = 1 << 16  # values of axes that are held, each worked out once for all members that share it
_AT_ONCE = 4096  # members whose numbers are worked out together
_MOST_KNOWN = 256  # families that a process keeps for later members
_SWEPT_TABLES = ("body", "initial", "loads", "rotors", "parameters", "tides")
"""Config tables whose numbers may become parameters."""
_DOUBLE = precision_of("double")


NotBatchable = Enum(
    "NotBatchable",
    {
        "PRECISION": "batches compute in double precision only",
        "ARITHMETIC": "heyoka on this machine has no numbers of many digits",
        "CLOSED_FORM": "the closed form takes no steps",
        "METHOD": "batches take the steps of Taylor series only",
        "EFFECT": "a registered effect acts between steps",
        "HELD": "invariants are projected between steps, which batches can't do",
        "ACCURACY": "the accuracy asked for is settled run by run",
        "CHART": "Euler angles may have to change their sequence on the way",
        "ANGLES": "full turns of recorded angles are counted along the motion",
        "IMPULSE": "velocities change at once on the way",
        "SWITCHING": "the equations change along the motion",
        "MOVED_MASS": "the body changes in ways that may end its motion",
        "TABLE": "an orbit goes by a table",
        "MOMENT": "something happens so late, within so short a while, that the time takes two numbers",
        "ORIENTATION": "a published orientation is read with it",
        "BODIES": "point masses move with the body",
        "LYAPUNOV": "the Lyapunov spectrum has another integrator",
        "NUTATION": "wheels make it nutate so fast that coefficients take two numbers each",
        "KEY": "what is swept is not a number of the body, the start, a load, a rotor or a parameter",
        "UNTRACEABLE": "the equations depend on what is swept in a way that can't be determined beforehand",
        "FAMILIES": "too few members share a system of equations",
        "RANGE": "a coefficient is outside the range of double precision",
    },
)
"""Why a member can't run in a batch and is run by itself; the value is shown to users."""


def batchable(experiment: Experiment, keys: Sequence[str]) -> NotBatchable | None:
    """Why members can't run in a batch, as far as experiment and swept keys show; None if they can."""
    config = experiment.config
    integrator = config.integrator
    asked = integrator.accuracy, integrator.accuracy_axis, integrator.accuracy_position
    reasons = {
        NotBatchable.ACCURACY: any(accuracy is not None for accuracy in asked),
        NotBatchable.PRECISION: integrator.precision != "double",
        NotBatchable.ARITHMETIC: not hasattr(hy, "real"),
        NotBatchable.CLOSED_FORM: not integrator.has_steps,
        NotBatchable.METHOD: integrator.method != DEFAULT_METHOD,
        NotBatchable.HELD: integrator.hold_invariants is True,
        NotBatchable.CHART: not variables_named(integrator.formulation).regular,
        NotBatchable.ORIENTATION: config.output.orientation is not None,
        NotBatchable.LYAPUNOV: config.output.lyapunov,
        NotBatchable.KEY: any(Path.of(key).steps[0] not in _SWEPT_TABLES for key in keys),
    }
    return next((reason for reason, holds in reasons.items() if holds), None)


def _reason_of_system(prepared: InitialValueProblem, system: System) -> NotBatchable | None:
    # angles in so large a unit are never wrapped here: what follows from them is joined
    unwrapped = bool(system.angle_states and system.angle_unit)
    known = {"", "wrapped", "parity"} if unwrapped else {"", "nearest"}
    averaged = not system.formulation.resolves_rotation
    known |= {"unwrap"} if averaged else set()
    reasons = {
        NotBatchable.EFFECT: bool(registered_effects(system, _DOUBLE)),
        NotBatchable.IMPULSE: bool(system.kicks),
        NotBatchable.SWITCHING: system.switches,
        NotBatchable.MOVED_MASS: len(system.crossings) > len(system.events),
        NotBatchable.TABLE: (system.pieces is not None and not averaged) or system.mechanics.sky is not None,
        NotBatchable.MOMENT: system.clocked,
        NotBatchable.NUTATION: prepared.system.in_two_parts,
        NotBatchable.BODIES: system.scene.bodies is not None,
        NotBatchable.CHART: system.partner is not None or (system.angle_states and not unwrapped),
        NotBatchable.ANGLES: not {r.continuity for r in system.recorded} <= known,
    }
    return next((reason for reason, holds in reasons.items() if holds), None)


_Prepared: TypeAlias = "tuple[PreparedFamily, np.ndarray] | NotBatchable | ConfigError"
"""The family of a member and its numbers, why it runs by itself, or why it is refused."""


class AxisNumbers:
    """Values of a sweep's axes."""

    def __init__(self, sweep: Sweep) -> None:
        self.sweep = sweep
        self._words: dict[int, dict[str, int]] = {}
        self._reals = lru_cache(_HELD)(self._reals_of)
        self._context = SweptContext(context_for("double"), (), 0)
        self.known: list[Family] = []
        self.alike: list[PreparedFamily] = []
        self.prepared: dict[int, _Prepared] = {}

    @cached_property
    def drive(self) -> EstimatedEffect | None:
        """The estimated effect of loads of unknown size, as the base experiment's build makes it: a power of
        two in the units, which has to be the same whoever is a family's first member.
        """
        try:
            return prepare(self.sweep.base).system.scaling.drive
        except ConfigError as error:
            raise Untraceable(str(error)) from error

    def swept(self, place: int) -> bool:
        """Whether an axis has numbers that can become parameters."""
        axis = self.sweep.axes[place]
        return axis.numeric and Path.of(axis.key).steps[0] in _SWEPT_TABLES

    def _reals_of(self, place: int, index: int) -> list[hy.real]:
        numbers, bits = self.sweep.axes[place].exact(index), self._context.prec
        return [
            self._context.real_of(x.at(self._context.plain))
            if x.pi_power
            else hy.real(x.rational.numerator, bits) / hy.real(x.rational.denominator, bits)
            for x in numbers
        ]

    def columns(self, place: int, which: np.ndarray) -> list[np.ndarray]:
        """The numbers that members have, a column for each key, from the index of each one's value."""
        needed, index = np.unique(which, return_inverse=True)
        columns = zip(*(self._reals(place, i) for i in needed.tolist()), strict=True)
        return [np.array(column)[index] for column in columns]

    def codes(self, place: int, which: np.ndarray) -> np.ndarray:
        """Codes below the axis's length, equal for members whose axis values have the same text."""
        text = self.sweep.axes[place].text
        known = self._words.setdefault(place, {})
        needed, index = np.unique(which, return_inverse=True)
        found = [known.setdefault(text(i), len(known)) for i in needed.tolist()]
        return np.array(found, dtype=np.int64)[index]


class Members:
    """Members of a ``[sweep]`` as the batch engine sees them, renumbered from 0 in the order given, all by
    default. ``keys`` belong to the numbers that become parameters; ``kinds``, (members,), codes of
    everything else that differs: members of different kinds belong to different families.
    """

    def __init__(
        self, sweep: Sweep, members: Sequence[int] | None = None, axes: AxisNumbers | None = None
    ) -> None:
        self._chosen = np.arange(sweep.count) if members is None else np.asarray(members, dtype=np.int64)
        self.axes = AxisNumbers(sweep) if axes is None else axes
        self.sweep, self.count = sweep, len(self._chosen)
        self.keys: list[str] = []
        self.kinds = np.zeros(self.count, dtype=np.int64)
        self._swept: list[tuple[int, np.ndarray]] = []
        rows = np.unravel_index(self._chosen, sweep.shape) if sweep.product else None
        for place, axis in enumerate(sweep.axes):
            which = self._chosen if rows is None else rows[place]
            if self.axes.swept(place):
                self.keys += axis.columns
                self._swept.append((place, which))
            else:
                self.kinds = self.kinds * axis.count + self.axes.codes(place, which)

    def experiment(self, member: int) -> Experiment:
        """A member's own experiment."""
        return self.sweep.worked_out(int(self._chosen[member]))

    def exact(self, member: int) -> list[ExactNumber]:
        """A member's exact numbers for ``keys``, SI."""
        return [x for place, which in self._swept for x in self.sweep.axes[place].exact(int(which[member]))]

    def prepared(self, member: int) -> _Prepared:
        """What a member of an averaged model is sorted by, worked out once."""
        known, number = self.axes.prepared, int(self._chosen[member])
        if number not in known:
            if len(known) >= _HELD:
                known.clear()
            known[number] = self._prepare(member)
        return known[number]

    def _prepare(self, member: int) -> _Prepared:
        try:
            prepared = prepare(self.experiment(member))
        except ConfigError as error:
            return error
        reason = _reason_of_system(prepared, prepared.system)
        if reason is not None:
            return reason
        kind = int(self.kinds[member])
        for family in self.axes.alike:
            if family.kind == kind and (numbers := family.numbers_of(prepared)) is not None:
                return family, numbers
        self.axes.alike.append(PreparedFamily(prepared, kind))
        del self.axes.alike[:-_MOST_KNOWN]
        numbers = self.axes.alike[-1].numbers
        return NotBatchable.UNTRACEABLE if numbers is None else (self.axes.alike[-1], numbers)

    def columns(self, members: np.ndarray) -> list[np.ndarray]:
        """The numbers of some members for each key (see ``AxisNumbers``)."""
        return [x for place, which in self._swept for x in self.axes.columns(place, which[members])]


class Family:
    """Members of a kind that share a system of equations, worked out with the decisions of the first.

    Attributes:
        prepared: the first member's own problem, in plain numbers.
        system: the same system for all, whose coefficients are expressions of ``variables``.
        members: places in ``Members``, (members,).
        initial: (states, members), internal units.
        parameters: values of ``variables``, (parameters, members).
        radians: between samples, of averaged motions whose angles are followed, (members,).
    """

    members: np.ndarray
    radians: np.ndarray
    initial: np.ndarray
    parameters: np.ndarray
    _doubles: dict[int, np.ndarray]

    def __init__(self, prepared: InitialValueProblem, scene: Scene, like: ModelPlan, kind: int) -> None:
        self.prepared, self.context, self.kind = prepared, scene.context, kind
        self._swept: dict[int, tuple[Swept, Any]] = {}
        self.system = System(plan_model(scene, like=like), self._number)
        for part in ("equations", "outputs", "invariants", "crossings", "rate_bound"):
            getattr(self.system, part)
        if not self.context.agree[0]:  # a decision by a number that it hasn't
            raise self.context.out_of_range()

    def of(self, candidates: np.ndarray) -> Family:
        """The family of those that decide as the first member did, and whose numbers doubles can hold."""
        system, scaling = self.system, self.system.scaling
        chosen, count = np.flatnonzero(self.context.agree), len(system.initial)
        numbers = [*system.initial, *(value for value, _ in self._swept.values())]
        found = np.array([self.context.doubles(value)[chosen] for value in numbers])
        within = np.isfinite(found).all(axis=0)
        part, chosen, found = copy.copy(self), chosen[within], found[:, within]
        part.members, part.initial, part.parameters = candidates[chosen], found[:count], found[count:]
        asked = [system.rate_bound, scaling.time, scaling.length, scaling.speed, *system.scene.quaternion]
        asked += [*system.state_exponents, *(x for one in system.recorded for x in one.exponents)]
        part._doubles = {id(x): self.context.doubles(x)[chosen] for x in asked if isinstance(x, Swept)}
        return part

    def _number(self, value: Any) -> Any:
        """A coefficient as a double, rounded once, or as a parameter."""
        if not isinstance(value, Swept):
            return _DOUBLE.number(value)
        name = f"swept_{len(self._swept)}"
        return self._swept.setdefault(id(value), (value, hy.make_vars(name)))[1]

    @property
    def variables(self) -> list[Any]:
        """One variable for each coefficient that depends on what is swept."""
        return [variable for _, variable in self._swept.values()]

    def doubles(self, value: Any) -> np.ndarray:
        """One of the numbers of the scene that runs ask for, for each member, rounded once, (members,)."""
        if isinstance(value, Swept):
            return self._doubles[id(value)]
        return np.full(len(self.members), float(value))

    def whole_numbers(self, value: Any) -> np.ndarray:
        """A whole number of the model for each member, (members,)."""
        return self.doubles(value).astype(np.int64)

    @cached_property
    def knots(self) -> SetAtKnots | None:
        """What is set where pieces of the equations begin, the same for all members; None without."""
        system = self.prepared.system
        return None if system.pieces is None else SetAtKnots(system)

    @cached_property
    def moving(self) -> int:
        """Number of states of the motion; a tangent vector's states follow."""
        return sum(not name.startswith(TANGENT) for name in self.system.states)

    @cached_property
    def in_equations(self) -> list[int]:
        """Indices of the parameters that the motion's equations and events read."""
        expressions = [right for _, right in self.system.equations[: self.moving]]
        expressions += [crossing.expression for crossing in self.system.crossings]
        read = {name for x in expressions for name in hy.get_variables(hy.expression(x))}
        return [k for k, v in enumerate(self.variables) if str(v) in read]

    def as_parameters(self, expressions: Sequence[Any]) -> list[Any]:
        """Expressions with the parameters as ``hy.par``: first of pieces, then ``in_equations``."""
        variables, first = self.variables, 0 if self.knots is None else self.knots.parameters
        table = {variables[k]: hy.par[first + n] for n, k in enumerate(self.in_equations)}
        found = [hy.expression(x) for x in expressions]
        return hy.subs(found, table) if table else found


class PreparedFamily(Family):
    """Members of averaged models, each worked out by itself, whose equations are equal but for numbers: each
    distinct number of the first member is a parameter, but 0, 1 and -1, which make equations simpler.
    """

    def __init__(self, prepared: InitialValueProblem, kind: int) -> None:
        self.prepared, self.kind = prepared, kind
        self._of_number: dict[float, Any] = {}
        self._calls: list[float] = []
        self.system = self._rebuilt(prepared, self._number)
        self.numbers = self.numbers_of(prepared)

    @staticmethod
    def _rebuilt(prepared: InitialValueProblem, number: Callable[[Any], Any]) -> System:
        """A member's system with other numbers, which are asked for always in the same order."""
        system = System(prepared.system.plan, number)
        for part in ("equations", "outputs", "invariants", "crossings"):
            getattr(system, part)
        return system

    def _number(self, value: Any) -> Any:
        number = float(_DOUBLE.number(value))
        self._calls.append(number)
        if number in (-1, 0, 1):
            return number
        return self._of_number.setdefault(number, hy.make_vars(f"swept_{len(self._of_number)}"))

    @property
    def variables(self) -> list[Any]:
        """See ``Family``."""
        return list(self._of_number.values())

    def numbers_of(self, prepared: InitialValueProblem) -> np.ndarray | None:
        """Radians between samples, initial states and values of ``variables`` of a member, (1 + states +
        parameters,); None if its equations differ in more than these.
        """
        calls: list[float] = []

        def noting(value: Any) -> Any:
            calls.append(float(_DOUBLE.number(value)))
            return calls[-1]

        own, system, first = self._rebuilt(prepared, noting), prepared.system, self.prepared.system
        found: dict[float, float] = {}
        for known, number in zip(self._calls, calls, strict=False):
            if found.setdefault(known, number) != number or (known in (-1, 0, 1) and known != number):
                return None
        numbers = {variable: hy.expression(found.get(x, x)) for x, variable in self._of_number.items()}
        units = [
            (x.states, x.scaling, x.state_exponents, [one.exponents for one in x.recorded])
            for x in (system, first)
        ]
        alike = units[0] == units[1] and len(calls) == len(self._calls)
        alike = alike and list(system.plan.tables.items()) == list(first.plan.tables.items())
        if not alike or hy.subs(_expressions(self.system), numbers) != _expressions(own):
            return None
        initial, values = map(_DOUBLE.number, system.initial), (found[x] for x in self._of_number)
        return np.array([radians_between_samples(system), *initial, *values])

    def having(self, members: Sequence[int], numbers: Sequence[np.ndarray]) -> PreparedFamily:
        """The family with members and their numbers (see ``numbers_of``)."""
        part, every = copy.copy(self), np.array(numbers).T
        part.members, states = np.array(members), len(self.system.states)
        part.radians, part.initial, part.parameters = every[0], every[1 : 1 + states], every[1 + states :]
        return part


def _expressions(system: System) -> list[Any]:
    """All of a system's expressions."""
    found = [right for _, right in system.equations] + [one.expression for one in system.crossings]
    found += [x for invariant in system.invariants for x in invariant.expressions]
    return [hy.expression(x) for x in [*found, *system.outputs]]


@dataclass
class Sorted:
    """Members sorted into families."""

    groups: list[Family] = field(default_factory=list)
    alone: dict[int, NotBatchable] = field(default_factory=dict)  # those that run by themselves
    refused: dict[int, ConfigError] = field(default_factory=dict)  # those that no run accepts


class Families:
    """Sorts members into families, each worked out with its first member's decisions.

    Args:
        most_refused: number of refused members after which the rest stays unsorted.
    """

    def __init__(self, members: Members, most_refused: int | None = None) -> None:
        self._members, self._most_refused = members, most_refused
        self._sorted = Sorted()

    def sort(self) -> Sorted:
        """Sort all members."""
        known = self._members.axes.known
        for first in range(0, self._members.count, _AT_ONCE):
            waiting = np.arange(first, min(first + _AT_ONCE, self._members.count))
            for family in known:
                waiting = self._without(waiting, family.kind, partial(self._join, family))
            while len(waiting) and len(self._sorted.refused) != self._most_refused:
                waiting = self._without(waiting, self._members.kinds[waiting[0]], self._take)
        del known[:-_MOST_KNOWN]
        return self._sorted

    def _without(
        self, waiting: np.ndarray, kind: int, take: Callable[[np.ndarray], np.ndarray]
    ) -> np.ndarray:
        """Those still waiting after some of a kind were taken."""
        candidates = waiting[self._members.kinds[waiting] == kind]
        return np.setdiff1d(waiting, take(candidates), assume_unique=True) if len(candidates) else waiting

    def _join(self, family: Family, candidates: np.ndarray) -> np.ndarray:
        """Sort members of a kind that share a family's equations; returns these."""
        family.context.begin(self._members.columns(candidates), len(candidates))
        return self._sort_in(family, candidates)

    def _sort_in(self, family: Family, candidates: np.ndarray) -> np.ndarray:
        taken = candidates[family.context.agree]
        if len(taken):
            part = family.of(candidates)
            self._sorted.groups += [part] if len(part.members) else []
            beyond = np.setdiff1d(taken, part.members).tolist()
            self._sorted.alone |= dict.fromkeys(beyond, NotBatchable.RANGE)
        family.context.forget()
        return taken

    def _take(self, candidates: np.ndarray) -> np.ndarray:
        """Sort the first of some members of a kind, with all that share its equations; returns these."""
        found, first = self._sorted, int(candidates[0])
        columns = self._members.columns(candidates)
        context = SweptContext(context_for("double"), columns, len(candidates))
        try:
            experiment = self._members.experiment(first)
            reason = batchable(experiment, self._members.keys)
            if reason is None and experiment.config.model.level != FULL:
                return self._prepared(candidates)
            if reason is None:
                family = self._worked_out(experiment, first, context)
                reason = _reason_of_system(family.prepared, family.system)
        except ConfigError as error:
            found.refused[first] = error
            return candidates[:1]
        except Untraceable:
            reason = NotBatchable.UNTRACEABLE
        if reason is None:
            self._members.axes.known.append(family)
            return self._sort_in(family, candidates)
        taken = candidates[context.agree]
        found.alone |= dict.fromkeys(taken.tolist(), reason)
        return taken

    def _prepared(self, candidates: np.ndarray) -> np.ndarray:
        """Sort members of averaged models, each worked out by itself, until too many are refused."""
        groups: dict[PreparedFamily, dict[int, np.ndarray]] = {}
        for count, member in enumerate(candidates.tolist()):
            if len(self._sorted.refused) == self._most_refused:
                candidates = candidates[:count]
                break
            found = self._members.prepared(member)
            if isinstance(found, NotBatchable):
                self._sorted.alone[member] = found
            elif isinstance(found, ConfigError):
                self._sorted.refused[member] = found
            else:
                groups.setdefault(found[0], {})[member] = found[1]
        self._sorted.groups += [one.having([*rows], [*rows.values()]) for one, rows in groups.items()]
        return candidates

    def _worked_out(self, experiment: Experiment, first: int, context: SweptContext) -> Family:
        """The family of the first of some members.

        Raises:
            ConfigError: the member is refused, as a single run of it would be.
            Untraceable: something can't be worked out for many members at once.
        """
        prepared, config = prepare(experiment), experiment.config
        plan, members = prepared.system.plan, self._members
        if plan.scaling.drive is not None:
            plan = replace(plan, scaling=replace(plan.scaling, drive=members.axes.drive))
        for place, (key, number) in enumerate(zip(members.keys, members.exact(first), strict=True)):
            path = Path.of(key)
            if not isinstance(path.get(config), ExactNumber):
                raise Untraceable(f"what is swept, {key}, is no number")
            config = path.with_number(config, SweptExact(context.column(place), number), context)
        scene = build_scene(replace(experiment, config=config), context)
        check_start(scene)
        return Family(prepared, scene, plan, int(members.kinds[first]))


# --- from the start to the last sample ----------------------------------------------------------------------

Values = dict[str, np.ndarray]

_VALUES_AT_ONCE = 2_000_000
"""Sample values evaluated together; more would take memory that has to be fetched anew for each operation."""
_MOST_STEPS = 10_000
_STEPS_PER_UNIT = 200.0
"""A natural step is of the order of one internal unit of time. A lane that takes so many more is given up
here, before it holds the others any longer, and run by itself.
"""


@dataclass(frozen=True)
class BatchEvents:
    """Crossings of one event in a block, in the order of members and time (n,)."""

    name: str
    member: np.ndarray  # places in the block
    time: np.ndarray  # seconds
    values: Values  # recorded variables, (n, components), SI


@dataclass(frozen=True)
class BatchBlock:
    """Results of some members of a family; m members and their samples."""

    members: np.ndarray  # indices in the sweep
    places: np.ndarray  # in the numbers from which they were run
    times: np.ndarray  # (samples,), seconds
    start: np.ndarray  # (m,), each member's internal unit of time
    moments: np.ndarray  # (samples, m), likewise
    states: np.ndarray  # of the motion, (samples, states, m), internal units
    values: Values  # recorded variables, (samples, m, components), SI; NaN from where a member ended
    drifts: Values  # relative drifts by the names of the invariants, (samples, m)
    status: np.ndarray  # (m,) objects; None where a lane gave up and the member is to be run by itself
    reached: np.ndarray  # number of samples, (m,)
    steps: np.ndarray
    drift_bound: np.ndarray  # relative drift that rounding alone explains, (m,)
    events: list[BatchEvents]
    width: int  # lanes of the integrator, on which the last bits depend

    def largest_drifts(self) -> np.ndarray:
        """Magnitude of each sample's worst drift, (samples, m); infinite where one has no finite value, and 0
        where no sample was taken.
        """
        worst = np.zeros(self.moments.shape)
        for drift in self.drifts.values():
            worst = np.maximum(worst, np.where(np.isfinite(drift), np.abs(drift), np.inf))
        return np.where(np.arange(len(worst))[:, None] < self.reached, worst, 0.0)


class BatchRun:
    """Runs a family's members; by default with the processor's own width."""

    def __init__(self, family: Family, width: int | None = None) -> None:
        self.width = width or (recommended_width() if family.knots is None else LANES_OF_A_TABLE)
        self._family, self._system = family, family.system
        self._clocks: dict[int, SampleClock] = {}
        system = self._system
        self._crossings = [hy.expression(c.expression) for c in system.crossings]
        self._components = [x for invariant in system.invariants for x in invariant.expressions]
        grown = {r.first for r in system.recorded if r.name == GROWTH}
        self._of_tangents = np.array([row in grown for row in range(len(system.outputs))])
        pairs = list(zip(system.outputs, self._of_tangents, strict=True))
        self._of_motion = [x for x, of_tangents in pairs if not of_tangents]
        self._growth = [x for x, of_tangents in pairs if of_tangents]

    def compile(self) -> None:
        """Compile integrators and functions now rather than when the first members need them."""
        _ = self._plain, self._along
        if self._components:
            self._compiled(self._components)
        self._compiled(self._of_motion)
        if self._growth:
            self._compiled(self._growth, along=True)

    def blocks(self) -> Iterator[BatchBlock]:
        """Run the members, as many at a time as fit into memory."""
        samples = self._family.prepared.clock.count * self._parts
        each = samples * (len(self._system.states) + len(self._system.outputs))
        most = max(_VALUES_AT_ONCE // each // self.width, 1) * self.width
        # members with about as many steps run side by side, so that none waits for long
        order = np.argsort(self._family.doubles(self._system.rate_bound), kind="stable")
        for first in range(0, len(order), most):
            yield self._block(order[first : first + most])

    def _block(self, part: np.ndarray) -> BatchBlock:
        family = self._family
        initial, swept = family.initial[:, part], family.parameters[:, part]
        moving, read = initial[: self._family.moving], swept[self._family.in_equations]
        start, times = self._times(family.whole_numbers(self._system.scaling.time)[part])
        samples, times = slice(None, None, self._parts), self._between(times)
        most = self._most_steps(start, times)
        parameters = np.concatenate([read, self._of_events(moving, swept, start, times[-1])])
        lanes, along = self._plain.run(moving, parameters, start, times, most), None
        if self._along is not None:
            along = self._along.run(initial, read, start, times, most).states
        begun = self._evaluated(self._components, moving[None], swept, start[None])[:, 0]
        found = self._outputs(lanes.states, swept, times, begun, along)
        values, first = self._in_si(found, part), len(found) - len(self._system.invariants)
        doubtful, values = self._join(values, part), {name: x[samples] for name, x in values.items()}
        invariants = enumerate(self._system.invariants)
        drifts = {f"{one.name}_drift": found[first + n][samples] for n, one in invariants}
        lanes, times = replace(lanes, states=lanes.states[samples]), times[samples]
        block = BatchBlock(
            family.members[part],
            part,
            self._family.prepared.clock.labels(0, len(times)),
            start,
            times,
            lanes.states,
            values,
            drifts,
            self._status(lanes, most, doubtful),
            _reached(lanes),
            lanes.steps,
            self._family.prepared.drift_bound(lanes.steps),
            self._events(lanes, swept, part, begun),
            self.width,
        )
        self._ended_by_events(block)
        self._ended_by_drift(block)
        return block

    # --- integrators ------------------------------------------------------------------------------------

    def _engine(self, states: int, events: Sequence[tuple[Any, int]] = ()) -> BatchEngine:
        """Batch integrator of the first states of the system."""
        system, tolerance = self._system, self._family.prepared.tolerance
        rights = self._family.as_parameters([right for _, right in system.equations[:states]])
        equations = list(zip(system.variables[:states], rights, strict=True))
        loose = None if tolerance is None else float(tolerance)
        knots = self._family.knots
        return BatchEngine(
            equations, self.width, events=events, tolerance=loose, compact=system.wide, knots=knots
        )

    @cached_property
    def _plain(self) -> BatchEngine:
        """The motion; each event has a shift and a factor as parameters after the equations' own."""
        expressions, first = self._family.as_parameters(self._crossings), len(self._family.in_equations)
        first += 0 if self._family.knots is None else self._family.knots.parameters
        events = [
            ((expression + hy.par[first + 2 * n]) * hy.par[first + 2 * n + 1], crossing.direction)
            for n, (expression, crossing) in enumerate(zip(expressions, self._system.crossings, strict=True))
        ]
        return self._engine(self._family.moving, events)

    @cached_property
    def _along(self) -> BatchEngine | None:
        states = len(self._system.states)
        return self._engine(states) if states > self._family.moving else None

    def _of_events(
        self, initial: np.ndarray, swept: np.ndarray, start: np.ndarray, end: np.ndarray
    ) -> np.ndarray:
        """Parameters (2 * events, members) of the events' expressions."""
        found = np.zeros((2 * len(self._crossings), len(start)))
        if not self._crossings:
            return found
        random = np.random.default_rng(0).uniform(-1.0, 1.0, (STATES, len(initial)))
        states = np.repeat(random[:, :, None], len(start), axis=2)
        states[0] = initial
        largest: np.ndarray = np.zeros((len(self._crossings), len(start)))
        with np.errstate(all="ignore"):
            at_start = self._evaluated(self._crossings, initial[None], swept, start[None])[:, 0]
            for part in TIMES:
                times = np.broadcast_to(start + part * (end - start), (STATES, len(start)))
                values = self._evaluated(self._crossings, states, swept, times)
                values = np.where(np.isfinite(values), np.abs(values), 0.0)
                largest = np.fmax(largest, values.max(axis=1))
        found[0::2] = np.where(at_start == 0, 2.0 ** (-_DOUBLE.bits - BESIDE), 0.0)
        found[1::2] = np.ldexp(1.0, -exponents_of(largest))
        return found

    def _times(self, units: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Start (m,) and samples (samples, m) in each member's internal unit of time."""
        start, columns = np.empty(len(units)), np.empty((self._family.prepared.clock.count, len(units)))
        for unit in np.unique(units).tolist():
            if unit not in self._clocks:
                scaling = replace(self._system.scaling, time=unit)
                self._clocks[unit] = SampleClock(self._system.scene.samples, _DOUBLE, scaling)
            clock, same = self._clocks[unit], units == unit
            start[same] = clock.start
            columns[:, same] = clock.internal(0, clock.count)[:, None]
        return start, columns

    @cached_property
    def _parts(self) -> int:
        """Parts of what is between samples, at whose ends turns of angles are counted."""
        if all(variable.continuity != "unwrap" for variable in self._system.recorded):
            return 1
        return max(1, math.ceil(self._family.radians.max() / DENSE))

    def _between(self, times: np.ndarray) -> np.ndarray:
        """Times with those between them, (1 + (samples - 1) parts, m)."""
        if self._parts == 1 or len(times) < 2:
            return times
        shares = (np.arange(self._parts) / self._parts)[None, :, None]
        between = times[:-1, None] + shares * np.diff(times, axis=0)[:, None]
        return np.concatenate([between.reshape(-1, times.shape[1]), times[-1:]])

    def _most_steps(self, start: np.ndarray, times: np.ndarray) -> int:
        asked = self._family.prepared.scene.config.limits.max_steps
        longest = float((times[-1] - start).max())
        given_up = _MOST_STEPS + int(min(_STEPS_PER_UNIT * longest, 1e12))
        return given_up if asked is None else min(int(asked), given_up)

    def _status(self, lanes: LaneResults, most: int, doubtful: np.ndarray) -> np.ndarray:
        asked = self._family.prepared.scene.config.limits.max_steps
        short = Status.MAX_STEPS if asked is not None and most == int(asked) else None
        found = np.full(len(lanes.arrived), Status.FINISHED, dtype=object)
        found[~lanes.arrived] = short
        found[~lanes.arrived & ~lanes.finite] = Status.NON_FINITE
        found[doubtful] = None
        return found

    # --- events and guards ----------------------------------------------------------------------------------

    def _events(
        self, lanes: LaneResults, swept: np.ndarray, part: np.ndarray, begun: np.ndarray
    ) -> list[BatchEvents]:
        events, scaling = [], self._system.scaling
        for index, crossing in enumerate(self._system.crossings):
            rows = [(m, f) for m, found in lanes.found.items() for f in found if f.event == index]
            rows.sort(key=lambda row: (row[0], row[1].time))
            place, times = np.array([m for m, _ in rows], dtype=np.int64), np.array([f.time for _, f in rows])
            states = np.array([f.state for _, f in rows]).reshape(len(rows), lanes.states.shape[1])
            at = self._outputs(states.T[None], swept[:, place], times[None], begun[:, place])
            values = {name: x[0] for name, x in self._in_si(at, part[place]).items()}
            units = self._family.whole_numbers(scaling.time)[part[place]]
            events.append(
                BatchEvents(crossing.name, place, scaling.direction * np.ldexp(times, units), values)
            )
        return events

    def _ended_by_events(self, block: BatchBlock) -> None:
        """End motions at the first crossing that stops them; later samples and crossings are dropped."""
        stops = [e for e, c in zip(block.events, self._system.crossings, strict=True) if c.stop]
        first, way = np.full(len(block.members), math.inf), self._system.scaling.direction
        for event in stops:
            np.minimum.at(first, event.member, way * event.time)
        for m in np.flatnonzero(np.isfinite(first)).tolist():
            samples = int(np.searchsorted(way * block.times, first[m], side="right"))
            if samples <= block.reached[m]:
                block.status[m] = Status.EVENT
                _end(block, m, samples)
        for n, event in enumerate(block.events):
            kept = way * event.time <= first[event.member]
            if not kept.all():
                values = {name: v[kept] for name, v in event.values.items()}
                block.events[n] = BatchEvents(event.name, event.member[kept], event.time[kept], values)

    def _ended_by_drift(self, block: BatchBlock) -> None:
        """Apply the guard max_drift: the first sample beyond it is the last."""
        limit = self._family.prepared.scene.config.limits.max_drift
        if limit is None or not block.drifts:
            return
        beyond = block.largest_drifts() > float(limit)
        for m in np.flatnonzero(beyond.any(axis=0)).tolist():
            block.status[m] = Status.MAX_DRIFT
            _end(block, m, int(np.argmax(beyond[:, m])) + 1)

    # --- what is recorded -------------------------------------------------------------------------------

    def _outputs(
        self,
        states: np.ndarray,
        swept: np.ndarray,
        times: np.ndarray,
        begun: np.ndarray,
        along: np.ndarray | None = None,
    ) -> np.ndarray:
        """All outputs (outputs, samples, m) of states (samples, states, m) and times (samples, m), internal
        units; ``along`` has tangent vectors, without which their growth is unknown.
        """
        found = np.full((len(self._system.outputs), *times.shape), np.nan)
        found[~self._of_tangents] = self._evaluated(self._of_motion, states, swept, times, begun)
        if along is not None:
            found[self._of_tangents] = self._evaluated(self._growth, along, swept, times)
        return found

    def _in_si(self, found: np.ndarray, members: np.ndarray) -> Values:
        """Outputs as recorded variables (samples, m, components), SI."""
        values: Values = {}
        for variable in self._system.recorded:
            columns = [
                np.ldexp(found[variable.first + k], self._family.whole_numbers(exponent)[members])
                for k, exponent in enumerate(variable.exponents)
            ]
            values[variable.name] = np.stack(columns, axis=2)
        return values

    def _join(self, values: Values, part: np.ndarray) -> np.ndarray:
        """Give each quaternion the sign nearest to the one before, and count full turns of angles, as in a
        single run. Returns the members whose samples don't show all turns, (m,).
        """
        doubtful: np.ndarray = np.zeros(len(part), dtype=bool)
        for variable in self._system.recorded:
            block = values[variable.name]
            if variable.continuity == "nearest":
                begin = [self._family.doubles(x)[part] for x in self._system.scene.quaternion]
                before = np.concatenate([np.stack(begin, axis=1)[None], block[:-1]])
                products = np.einsum("smc,smc->sm", block, before)
                signs = np.cumprod(np.where(products < 0, -1.0, 1.0), axis=0)
                block *= signs[:, :, None]
            elif variable.continuity == "unwrap":
                steps = np.diff(block, axis=0)
                jumps = nearest(steps)
                block[1:] += 2 * np.pi * np.cumsum(np.rint((jumps - steps) / (2 * np.pi)), axis=0)
                doubtful |= ~(np.abs(jumps) <= DOUBTFUL).all(axis=(0, 2))
        return doubtful

    def _compiled(self, expressions: Sequence[Any], along: bool = False) -> tuple[Any, list[int]]:
        """A compiled function of states, and the indices of the states and parameters that it takes."""
        states = len(self._system.states) if along else self._family.moving
        variables = [*self._system.variables[:states], *self._family.variables]
        names = set(hy.get_variables([hy.expression(x) for x in expressions]))
        read = [n for n, variable in enumerate(variables) if str(variable) in names] or [0]
        taken = [variables[n] for n in read]
        made = compiled_function(expressions, taken, compact_mode=self._system.wide, fp_type=float)
        return made, read

    def _evaluated(
        self,
        expressions: Sequence[Any],
        states: np.ndarray,
        swept: np.ndarray,
        times: np.ndarray,
        begun: np.ndarray | None = None,
    ) -> np.ndarray:
        """Values (expressions, samples, m) for states (samples, states, m) and times (samples, m)."""
        samples, count, m = states.shape
        if not expressions or not times.size:
            return np.empty((len(expressions), samples, m))
        function, read = self._compiled(expressions, count > self._family.moving)
        # parameters of members are inputs like their states
        every = (samples, m)
        rows = [states[:, n] if n < count else np.broadcast_to(swept[n - count], every) for n in read]
        inputs = np.stack(rows).reshape(len(rows), -1)
        constants = None
        if function.nparams and begun is not None:
            constants = np.repeat(begun[:, None], samples, axis=1).reshape(len(begun), -1)
        found = evaluate_rows(function, inputs.T, constants, times.ravel())
        return found.reshape(len(expressions), samples, m)


def _reached(lanes: LaneResults) -> np.ndarray:
    """Number of samples that each member reached, (members,)."""
    return np.logical_and.accumulate(np.isfinite(lanes.states).all(axis=1)).sum(axis=0)


def _end(block: BatchBlock, member: int, samples: int) -> None:
    block.reached[member] = samples
    for values in (*block.values.values(), *block.drifts.values()):
        values[samples:, member] = np.nan
