"""Members of a sweep as the batch engine sees them, and families of those that share their equations.

A family's system is built once with the numbers of all its members (``rigidsim.scene.swept``), for whom a
coefficient that depends on what is swept is a parameter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property, lru_cache, partial
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError
from rigidsim.model.formulations.formulation import ModelPlan
from rigidsim.model.model_plan import plan_model
from rigidsim.model.names import TANGENT
from rigidsim.model.scaling import EstimatedEffect
from rigidsim.model.system import System
from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.choices import DEFAULT_METHOD, FULL, variables_named
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.initial_values import check_start
from rigidsim.scene.paths import Path
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.scene.sweep import Sweep
from rigidsim.scene.swept import Swept, SweptContext, SweptExact, Untraceable
from rigidsim.solve.effects.effect import registered_effects
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import InitialValueProblem, prepare

_HELD = 1 << 16  # values of axes that are held, each worked out once for all members that share it
_AT_ONCE = 4096  # members whose numbers are worked out together
_SWEPT_TABLES = ("body", "initial", "loads", "rotors", "parameters")
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
        "AVERAGED": "averages over the rotation are worked out for each body by itself",
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
        NotBatchable.AVERAGED: config.model.level != FULL,
        NotBatchable.ORIENTATION: config.output.orientation is not None,
        NotBatchable.LYAPUNOV: config.output.lyapunov,
        NotBatchable.KEY: any(Path.of(key).steps[0] not in _SWEPT_TABLES for key in keys),
    }
    return next((reason for reason, holds in reasons.items() if holds), None)


def _reason_of_system(prepared: InitialValueProblem, system: System) -> NotBatchable | None:
    # angles in so large a unit are never wrapped here: what follows from them is joined
    unwrapped = bool(system.angle_states and system.angle_unit)
    known = {"", "wrapped", "parity"} if unwrapped else {"", "nearest"}
    reasons = {
        NotBatchable.EFFECT: bool(registered_effects(system, _DOUBLE)),
        NotBatchable.SWITCHING: system.switches,
        NotBatchable.MOVED_MASS: len(system.crossings) > len(system.events),
        NotBatchable.TABLE: system.pieces is not None,
        NotBatchable.MOMENT: system.clocked,
        NotBatchable.NUTATION: prepared.system.in_two_parts,
        NotBatchable.BODIES: system.scene.bodies is not None,
        NotBatchable.CHART: system.partner is not None or (system.angle_states and not unwrapped),
        NotBatchable.ANGLES: not {r.continuity for r in system.recorded} <= known,
    }
    return next((reason for reason, holds in reasons.items() if holds), None)


class AxisNumbers:
    """Values of a sweep's axes."""

    def __init__(self, sweep: Sweep) -> None:
        self.sweep = sweep
        self._words: dict[int, dict[str, int]] = {}
        self._reals = lru_cache(_HELD)(self._reals_of)
        self._context = SweptContext(context_for("double"), 0)

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

    def columns(self, members: np.ndarray) -> list[np.ndarray]:
        """The numbers of some members for each key (see ``AxisNumbers``)."""
        return [x for place, which in self._swept for x in self.axes.columns(place, which[members])]


class Family:
    """Members that share a system of equations, and their numbers.

    Attributes:
        prepared: the first member's own problem, in plain numbers.
        system: the same system for all, whose coefficients are expressions of ``variables``.
        members: places in ``Members``, (members,).
        initial: (states, members), internal units.
        parameters: values of ``variables``, (parameters, members).
    """

    def __init__(
        self, prepared: InitialValueProblem, scene: Scene, like: ModelPlan, candidates: np.ndarray
    ) -> None:
        self.prepared, self._context = prepared, scene.context
        self._swept: dict[int, tuple[Swept, Any]] = {}
        self.system = System(plan_model(scene, like=like), self._number)
        for part in ("equations", "outputs", "invariants", "crossings", "rate_bound"):
            getattr(self.system, part)
        self._chosen = np.flatnonzero(self._context.agreed())
        numbers = [*self.system.initial, *(value for value, _ in self._swept.values())]
        found = np.array([self.doubles(value) for value in numbers])
        within = np.isfinite(found).all(axis=0)
        self._chosen, found = self._chosen[within], found[:, within]
        self.members = candidates[self._chosen]
        self.initial, self.parameters = np.split(found, [len(self.system.initial)])

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
        """A number of the scene for each member, rounded once, (members,)."""
        return self._context.doubles(value)[self._chosen]

    def whole_numbers(self, value: Any) -> np.ndarray:
        """A whole number of the model for each member, (members,)."""
        return self.doubles(value).astype(np.int64)

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
        """Expressions with the parameters as ``hy.par``, numbered as in ``in_equations``."""
        variables = self.variables
        table = {variables[k]: hy.par[n] for n, k in enumerate(self.in_equations)}
        found = [hy.expression(x) for x in expressions]
        return hy.subs(found, table) if table else found


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
        for first in range(0, self._members.count, _AT_ONCE):
            waiting = np.arange(first, min(first + _AT_ONCE, self._members.count))
            while len(waiting) and len(self._sorted.refused) != self._most_refused:
                kinds = self._members.kinds[waiting]
                waiting = np.setdiff1d(waiting, self._take(waiting[kinds == kinds[0]]), assume_unique=True)
        return self._sorted

    def _take(self, candidates: np.ndarray) -> np.ndarray:
        """Sort the first of some members of a kind, with all that share its equations; returns these."""
        found, first = self._sorted, int(candidates[0])
        context = SweptContext(context_for("double"), len(candidates))
        try:
            experiment = self._members.experiment(first)
            reason = batchable(experiment, self._members.keys)
            if reason is None:
                family = self._worked_out(experiment, candidates, context)
                reason = _reason_of_system(family.prepared, family.system)
        except ConfigError as error:
            found.refused[first] = error
            return candidates[:1]
        except Untraceable:
            reason = NotBatchable.UNTRACEABLE
        taken = candidates[context.agree]
        alone = taken
        if reason is None:
            alone, reason = np.setdiff1d(taken, family.members), NotBatchable.RANGE
            if len(family.members):
                found.groups.append(family)
        found.alone |= dict.fromkeys(alone.tolist(), reason)
        return taken

    def _worked_out(self, experiment: Experiment, candidates: np.ndarray, context: SweptContext) -> Family:
        """The family of the first of some members.

        Raises:
            ConfigError: the member is refused, as a single run of it would be.
            Untraceable: something can't be worked out for many members at once.
        """
        prepared, config = prepare(experiment), experiment.config
        plan, members = prepared.system.plan, self._members
        if plan.scaling.drive is not None:
            plan = replace(plan, scaling=replace(plan.scaling, drive=members.axes.drive))
        columns = members.columns(candidates)
        for key, number, column in zip(members.keys, members.exact(int(candidates[0])), columns, strict=True):
            path = Path.of(key)
            if not isinstance(path.get(config), ExactNumber):
                raise Untraceable(f"what is swept, {key}, is no number")
            config = path.with_number(
                config, SweptExact(Swept(context, partial(np.asarray, column)), number), context
            )
        scene = build_scene(replace(experiment, config=config), context)
        check_start(scene)
        return Family(prepared, scene, plan, candidates)
