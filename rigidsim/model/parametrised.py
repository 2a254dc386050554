"""The system of a scene with its coefficients as parameters, and their derivatives by numbers of its config.

Numbers enter the equations on many ways: principal axes are found, units chosen, orbits solved. All of them
pass the one function that rounds a coefficient. The scene is therefore worked out again with each key moved
by a very small amount, in arithmetic of several times the digits, and coefficients and initial values are
compared one by one: the difference quotients are right to far more digits than any run has, and what is
differentiated along the motion are the equations themselves, by their coefficients.

All keys stand a little off their values (2^-40 of the working precision's rounding): where one is zero, or
two moments are equal, the equations of the general case are taken, which need no other ones nearby.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.formulations.formulation import ModelPlan, Quaternion
from rigidsim.model.load import Load
from rigidsim.model.model_plan import plan_model
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.system import System, recorded_variables
from rigidsim.scene.arithmetic import context_for, negligible
from rigidsim.scene.config import Experiment
from rigidsim.scene.varied_keys import VariedKey, scene_of

_OFF, _STEP = 40, 30
"""Bits below the working precision's rounding by which keys stand off their values, and bits of that by which
each is moved: differences err by 2^-30 of what changes over the former, which is no number of the run's.
"""
_LOOK = Fraction(1, 1 << 20)  # change, of a key's size, by which a dependence that no coefficient has shows
_MOST_PATTERNS = 16  # of the signs in which keys stand off
_WHERE = "[output] sensitivity"


@dataclass(frozen=True)
class Coefficients:
    """Numbers at some values of the keys (mpf): coefficients that vary (m,), initial values (states,), and
    the derivatives of both by each key, (m, keys) and (states, keys), per SI unit.
    """

    values: list[Any]
    slopes: list[list[Any]]
    initial: list[Any]
    initial_slopes: list[list[Any]]


@dataclass(frozen=True)
class _Pass:
    """A system as it was worked out once, with the numbers that were rounded on the way (mpf)."""

    system: System
    noted: list[Any]
    outputs: list[Symbolic]
    equations: list[Symbolic]

    @property
    def form(self) -> list[int]:
        """Hashes, since wide expressions share parts that a comparison would walk through again and again."""
        return [hash(x) for x in (*self.equations, *self.outputs)]


class Parametrised:
    """A scene's full motion in rates and quaternion, whose coefficients that depend on keys are parameters.

    Attributes:
        keys: the numbers, one by one.
        values: of these, SI.
        context: arithmetic in which all is worked out.
        plain: the same motion in plain numbers, for pieces of the equations and for names.
        equations: right-hand sides with ``hy.par[first + i]`` for coefficient i.
        outputs: components of what is recorded of it (``recorded``), in the same way.
        recorded: attitude, rates, flight, rotors, core, user-defined states, and what else was asked for.
        first: number of parameters that the equations have themselves.
    """

    def __init__(
        self,
        experiment: Experiment,
        keys: Sequence[VariedKey],
        number: Rounder,
        bits: int,
        loads: Sequence[Load] = (),
        record: Sequence[str] = (),
        values: Sequence[Fraction] | None = None,
    ) -> None:
        self.keys, self._number, self._bits, self._loads = tuple(keys), number, bits, tuple(loads)
        self._experiment = _of_motion(experiment, record)
        precision = experiment.config.integrator.precision
        self.context = context_for(precision, more=2 * bits + _OFF + _STEP)
        self.values = [key.value(self.context) for key in self.keys] if values is None else list(values)
        own = scene_of(self._experiment, self.keys, self.values, context_for(precision))
        self._plan: ModelPlan = plan_model(own, self._loads)
        base, found, moved = self._passes(self.values)
        self.plain = System(base.system.plan, number)  # with all that acts once no number is exactly zero
        self.first = parameters_of(self.plain)
        self._varied = [
            i for i, x in enumerate(base.noted) if any(self._differ(m.noted[i], x) for m in moved)
        ]
        self._fixed = {i: x for i, x in enumerate(base.noted) if i not in set(self._varied)}
        made = self._pass(found, self._as_parameters())
        self.equations, self.outputs = made.equations, made.outputs
        self.recorded = recorded_variables(self.plain.mechanics.observed, self._record)[0]
        self._refuse_hidden(base, found, made)
        self.coefficients = self._coefficients(base, moved)

    @property
    def states(self) -> list[str]:
        """Names of the states."""
        return self.plain.states

    @property
    def count(self) -> int:
        """Number of coefficients that vary."""
        return len(self._varied)

    def at(self, values: Sequence[Fraction]) -> Coefficients | None:
        """Coefficients at other values of the keys (SI); None if the equations have another form there.

        Raises:
            ConfigError: no scene has such values.
        """
        base, _, moved = self._passes(values)
        if len(base.noted) != len(self._varied) + len(self._fixed):
            return None
        for i, x in self._fixed.items():
            if any(self._differ(one.noted[i], x) for one in (base, *moved)):
                return None
        return self._coefficients(base, moved)

    @property
    def _record(self) -> list[str]:
        return list(self._experiment.config.output.record or ())

    def made_at(self, values: Sequence[Fraction]) -> Parametrised:
        """The same at other values, at which the equations may have another form."""
        more = self._loads, self._record, values
        return Parametrised(self._experiment, self.keys, self._number, self._bits, *more)

    # --- passes -----------------------------------------------------------------------------------------

    def _passes(self, values: Sequence[Fraction]) -> tuple[_Pass, list[Fraction], list[_Pass]]:
        """The system a little off some values, these, and those with each key moved by a step from there."""
        refused: ConfigError | None = None
        for off in self._standing_off(values):
            try:
                base = self._pass(off)
                moved = []
                for j, step in enumerate(self._steps):
                    others = [x + step if i == j else x for i, x in enumerate(off)]
                    moved.append(self._pass(others))
            except ConfigError as error:
                refused = refused or error
                continue
            form = len(base.noted), base.system.states
            if all((len(m.noted), m.system.states) == form for m in moved):
                return base, off, moved
        if refused is not None:
            raise refused
        what = "names numbers at which the equations change their form; no derivative by them is known there"
        raise ConfigError(Problem(_WHERE, what), self._experiment.source)

    @property
    def _steps(self) -> list[Fraction]:
        return [key.scale(self.context) / 2 ** (self._bits + _OFF + _STEP) for key in self.keys]

    def _standing_off(self, values: Sequence[Fraction]) -> Iterator[list[Fraction]]:
        """Values a little off, each in a proportion of its own, in patterns of signs: a thin plate's moments,
        for instance, can only change to one side.
        """
        amounts = [
            key.scale(self.context) * (64 + 7 * (5 * j % 9)) / 2 ** (self._bits + _OFF + 6)
            for j, key in enumerate(self.keys)
        ]
        for n, signs in enumerate(product((1, -1), repeat=min(len(amounts), 4))):
            if n >= _MOST_PATTERNS:
                return
            yield [x + signs[j % 4] * a for j, (x, a) in enumerate(zip(values, amounts, strict=True))]

    def _pass(self, values: Sequence[Fraction], number: Callable[[int, Any], Any] | None = None) -> _Pass:
        """Work the system out; ``number`` gives what stands for the i-th number that is rounded."""
        noted: list[Any] = []

        def noting(value: Any) -> Any:
            noted.append(value)
            return self._number(value) if number is None else number(len(noted) - 1, value)

        scene = scene_of(self._experiment, self.keys, values, self.context)
        plan = plan_model(scene, self._loads, self._plan.scaling, like=self._plan)
        system = System(replace(plan, formulation=Quaternion()), noting)
        equations = [right for _, right in system.equations]
        outputs = recorded_variables(system.mechanics.observed, self._record)[1]
        return _Pass(system, noted, [hy.expression(x) for x in outputs], equations)

    def _as_parameters(self) -> Callable[[int, Any], Any]:
        places = {i: self.first + n for n, i in enumerate(self._varied)}
        return lambda i, value: hy.par[places[i]] if i in places else self._number(self._fixed.get(i, value))

    def _differ(self, one: Any, other: Any) -> bool:
        """Whether two numbers differ by more than the arithmetic's own rounding."""
        return bool(abs(one - other) > abs(other) * negligible(self.context))

    def _coefficients(self, base: _Pass, moved: Sequence[_Pass]) -> Coefficients:
        context = self.context
        steps = [context.mpf(step.numerator) / context.mpf(step.denominator) for step in self._steps]

        def slopes(value: Any, others: Sequence[Any]) -> list[Any]:
            pairs = zip(others, steps, strict=True)
            return [(x - value) / step if self._differ(x, value) else context.zero for x, step in pairs]

        initial = list(base.system.initial)
        starts = [list(m.system.initial) for m in moved]
        return Coefficients(
            [base.noted[i] for i in self._varied],
            [slopes(base.noted[i], [m.noted[i] for m in moved]) for i in self._varied],
            initial,
            [slopes(x, [start[n] for start in starts]) for n, x in enumerate(initial)],
        )

    def _refuse_hidden(self, base: _Pass, off: Sequence[Fraction], made: _Pass) -> None:
        """Refuse keys that reach the equations by another way than coefficients, as through a double."""
        scales = [key.scale(self.context) for key in self.keys]
        for sign in (1, -1):
            there = [x + sign * _LOOK * s / (j + 3) for j, (x, s) in enumerate(zip(off, scales, strict=True))]
            try:
                looked = self._pass(there, self._as_parameters())
            except ConfigError:
                continue
            same = len(looked.noted) == len(base.noted) and not any(
                self._differ(looked.noted[i], x) for i, x in self._fixed.items()
            )
            if same and looked.form == made.form:
                return
        names = ", ".join(key.name for key in self.keys)
        what = f"names {names}, of which one changes the form of the equations; leave it out"
        raise ConfigError(Problem(_WHERE, what), self._experiment.source)


def _of_motion(experiment: Experiment, more: Sequence[str]) -> Experiment:
    """The experiment of the same motion in rates and quaternion, without what is only watched."""
    config = experiment.config
    record = ["quaternion", "angular_velocity", *(state.name for state in config.states)]
    record += ["position", "velocity"] if config.initial.flies else []
    record += ["rotor_rate"] if config.rotors else []
    record += ["core_angular_velocity"] if config.body.core is not None else []
    record += [name for name in more if name not in record]
    return replace(experiment, config=config.as_motion(record))


def parameters_of(system: System) -> int:
    """Number of parameters that a system's equations may use."""
    count = system.parameters
    if system.pieces is not None:
        count = max(count, system.first_of_pieces + len(system.pieces.parameters(0)))
    used = [int(str(p)[1:]) + 1 for p in hy.get_params([right for _, right in system.equations])]
    return max([count, *used])
