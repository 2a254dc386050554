"""Members of a sweep as the batch engine sees them, and families of those that share their equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property, lru_cache
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError
from rigidsim.model.scaling import EstimatedEffect
from rigidsim.scene.choices import DEFAULT_METHOD, FULL, variables_named
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.paths import Path
from rigidsim.scene.sweep import Sweep
from rigidsim.scene.tracing import Traced, Untraceable
from rigidsim.solve.batch.tracing import TRACED_TABLES, Reals, Replay, TracedSystem, real_of, trace
from rigidsim.solve.effects.effect import registered_effects
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import prepare

_HELD = 1 << 16  # values of axes that are held, each worked out once for all members that share it
_AT_ONCE = 2048  # members whose numbers are worked out together


class NotBatchable(Enum):
    """Why a member can't run in a batch and is run by itself; the value is shown to users."""

    PRECISION = "batches compute in double precision only"
    ARITHMETIC = "heyoka on this machine has no numbers of many digits"
    CLOSED_FORM = "the closed form takes no steps"
    METHOD = "batches take the steps of Taylor series only"
    EFFECT = "a registered effect acts between steps"
    HELD = "invariants are projected between steps, which batches can't do"
    ACCURACY = "the accuracy asked for is settled run by run"
    CHART = "Euler angles may have to change their sequence on the way"
    ANGLES = "full turns of recorded angles are counted along the motion"
    SWITCHING = "the equations change along the motion"
    MOVED_MASS = "the body changes in ways that may end its motion"
    TABLE = "an orbit goes by a table"
    MOMENT = "something happens so late, within so short a while, that steps need the time in two numbers"
    ORIENTATION = "a published orientation is read with it"
    BODIES = "point masses move with the body"
    LYAPUNOV = "the Lyapunov spectrum has another integrator"
    NUTATION = "wheels make it nutate so fast that coefficients take two numbers each"
    KEY = "what is swept is not a number of the body, the start, a load, a rotor or a parameter"
    UNTRACEABLE = "the equations depend on what is swept in a way that can't be determined beforehand"
    FAMILIES = "too few members share a system of equations"
    AVERAGED = "averages over the rotation are worked out for each body by itself"
    RANGE = "a coefficient is outside the range of double precision"


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
        NotBatchable.KEY: any(Path.of(key).steps[0] not in TRACED_TABLES for key in keys),
    }
    return next((reason for reason, holds in reasons.items() if holds), None)


def _reason_of_system(traced: TracedSystem) -> NotBatchable | None:
    system = traced.system
    # angles in so large a unit are never wrapped here: what follows from them is joined
    unwrapped = bool(system.angle_states and system.angle_unit)
    known = {"", "wrapped", "parity"} if unwrapped else {"", "nearest"}
    reasons = {
        NotBatchable.EFFECT: bool(registered_effects(system, precision_of("double"))),
        NotBatchable.SWITCHING: system.switches,
        NotBatchable.MOVED_MASS: len(system.crossings) > len(system.events),
        NotBatchable.TABLE: system.pieces is not None,
        NotBatchable.MOMENT: system.clocked,
        NotBatchable.NUTATION: traced.prepared.system.in_two_parts,
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

    def traced(self, place: int) -> bool:
        """Whether an axis has numbers that can become parameters."""
        axis = self.sweep.axes[place]
        return axis.numeric and Path.of(axis.key).steps[0] in TRACED_TABLES

    def _reals_of(self, place: int, index: int) -> list[hy.real]:
        return [real_of(number) for number in self.sweep.axes[place].exact(index)]

    def columns(self, place: int, which: np.ndarray) -> list[Reals]:
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
        self._axes = AxisNumbers(sweep) if axes is None else axes
        self.sweep, self.count = sweep, len(self._chosen)
        self.keys: list[str] = []
        self.kinds = np.zeros(self.count, dtype=np.int64)
        self._traced: list[tuple[int, np.ndarray]] = []
        rows = np.unravel_index(self._chosen, sweep.shape) if sweep.product else None
        for place, axis in enumerate(sweep.axes):
            which = self._chosen if rows is None else rows[place]
            if self._axes.traced(place):
                self.keys += axis.columns
                self._traced.append((place, which))
            else:
                self.kinds = self.kinds * axis.count + self._axes.codes(place, which)

    def experiment(self, member: int) -> Experiment:
        """A member's own experiment."""
        return self.sweep.experiment_of(int(self._chosen[member]))

    def exact(self, member: int) -> list[ExactNumber]:
        """A member's exact numbers for ``keys``, SI."""
        return [x for place, which in self._traced for x in self.sweep.axes[place].exact(int(which[member]))]

    def columns(self, members: np.ndarray) -> list[Reals]:
        """The numbers of some members for each key (see ``AxisNumbers``)."""
        return [x for place, which in self._traced for x in self._axes.columns(place, which[members])]


@dataclass
class Family:
    """Members that share the equations of a traced system, and their kind (see ``Members``)."""

    traced: TracedSystem
    kind: int


class Numbers:
    """Numbers of a family's members (indices), float64.

    Attributes:
        initial: (states, members), internal units.
        parameters: of the traced system, (parameters, members).
    """

    def __init__(self, traced: TracedSystem, members: np.ndarray, replay: Replay, places: np.ndarray) -> None:
        # places among the numbers of ``replay``
        self.members, self._replay, self._places = members, replay, places
        self.initial = np.array([self.doubles(value) for value in traced.system.initial])
        found = [replay.doubles(node)[places] for node in traced.parameters.nodes]
        self.parameters = np.array(found).reshape(len(found), len(members))

    def doubles(self, value: Any) -> np.ndarray:
        """A number of the scene for each member, rounded once, (members,)."""
        if isinstance(value, Traced):
            return self._replay.doubles(value.node)[self._places]
        return np.full(len(self.members), float(value))

    def whole_numbers(self, value: Any) -> np.ndarray:
        """A whole number of the model for each member, (members,)."""
        return self.doubles(value).astype(np.int64)


@dataclass
class Sorted:
    """Members sorted into families."""

    groups: list[tuple[Family, Numbers]] = field(default_factory=list)
    alone: dict[int, NotBatchable] = field(default_factory=dict)  # those that run by themselves
    refused: dict[int, ConfigError] = field(default_factory=dict)  # those that no run accepts


class Families:
    """Sorts members into families, each traced when its first member is met.

    Args:
        most_refused: number of refused members after which the rest stays unsorted.
        most_untraced: number of members that can't be traced after which no other is tried; no limit by
            default, since a process would run others one by one than one that begins elsewhere.
    """

    def __init__(
        self, members: Members, most_refused: int | None = None, most_untraced: int | None = None
    ) -> None:
        self._members = members
        self._most_refused, self._most_untraced = most_refused, most_untraced
        self.known: list[Family] = []

    def sort(self) -> Sorted:
        """Sort all members."""
        result = Sorted()
        for first in range(0, self._members.count, _AT_ONCE):
            self._sort_some(np.arange(first, min(first + _AT_ONCE, self._members.count)), result)
        return result

    def _sort_some(self, waiting: np.ndarray, result: Sorted) -> None:
        for family in list(self.known):
            waiting = self._taken(family, waiting, result)
        while len(waiting):
            first = int(waiting[0])
            made = self._traced(first)
            if isinstance(made, ConfigError):
                result.refused[first] = made
                if self._most_refused is not None and len(result.refused) >= self._most_refused:
                    return
                waiting = waiting[1:]
            elif isinstance(made, NotBatchable):
                result.alone[first] = made
                waiting = waiting[1:]
                if self._most_untraced is not None and len(result.alone) >= self._most_untraced:
                    result.alone |= dict.fromkeys(waiting.tolist(), made)
                    return
            else:
                self.known.append(made)
                waiting = self._taken(made, waiting, result)

    @cached_property
    def _drive(self) -> EstimatedEffect | None:
        """The load estimate as the base experiment's build makes it."""
        try:
            return prepare(self._members.sweep.base).system.scaling.drive
        except ConfigError as error:
            raise Untraceable(str(error)) from error

    def _traced(self, member: int) -> Family | ConfigError | NotBatchable:
        try:
            experiment = self._members.experiment(member)
            reason = batchable(experiment, self._members.keys)
            if reason is not None:
                return reason
            traced = trace(experiment, self._members.keys, self._members.exact(member), lambda: self._drive)
        except ConfigError as error:
            return error
        except Untraceable:
            return NotBatchable.UNTRACEABLE
        return _reason_of_system(traced) or Family(traced, int(self._members.kinds[member]))

    def _taken(self, family: Family, waiting: np.ndarray, result: Sorted) -> np.ndarray:
        """Put the waiting members of a family into the result; returns those that are left."""
        candidates = waiting[self._members.kinds[waiting] == family.kind]
        if not len(candidates):
            return waiting
        graph = family.traced.graph
        replay = Replay(graph, self._members.columns(candidates), len(candidates))
        agree = np.flatnonzero(replay.agreeing())
        taken = candidates[agree]
        if not len(taken):
            return waiting
        numbers = Numbers(family.traced, taken, replay, agree)
        within = np.isfinite(numbers.initial).all(axis=0) & np.isfinite(numbers.parameters).all(axis=0)
        if not within.all():
            result.alone |= dict.fromkeys(taken[~within].tolist(), NotBatchable.RANGE)
            numbers = Numbers(family.traced, taken[within], replay, agree[within])
        if len(numbers.members):
            result.groups.append((family, numbers))
        return waiting[~np.isin(waiting, taken)]
