"""A motion's derivatives by numbers of its config: which motions have them, and what is recorded of them.

One integrator carries the motion with its tangents dy/dp for each key p, apart from a run's own
(``rigidsim.solve.tangents``). Many keys of a motion in double precision whose equations stay the same from
the start on may go side by side, one a lane, at a tolerance of 1e-9; the motion itself is then integrated at
epsilon.

Numbers enter the equations on many ways: principal axes are found, units chosen, orbits solved. All of them
pass the one function that rounds a coefficient. The scene is therefore worked out again with each key moved
by a very small amount, in arithmetic of several times the digits, and coefficients and initial values are
compared one by one: the difference quotients are right to far more digits than any run has, and what is
differentiated along the motion are the equations themselves, by their coefficients.

All keys stand a little off their values (2^-40 of the working precision's rounding): where one is zero, or
two moments are equal, the equations of the general case are taken, which need no other ones nearby.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.model.formulations.formulation import ModelPlan, Quaternion
from rigidsim.model.load import Load
from rigidsim.model.model_plan import plan_model
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.system import System, recorded_variables
from rigidsim.scene.arithmetic import context_for, negligible
from rigidsim.scene.choices import FULL
from rigidsim.scene.config import Experiment
from rigidsim.scene.scene import Scene
from rigidsim.scene.varied_keys import VariedKey, scene_of, varied_keys
from rigidsim.solve.compiled import compiled_function, evaluate_rows
from rigidsim.solve.lanes import BatchEngine
from rigidsim.solve.precision import Precision, Scalar, precision_of
from rigidsim.solve.tangents import Derivatives, LostTangents, Place, Tangents, parameters_of

WHERE = "[output] sensitivity"


def refuse_without_derivatives(scene: Scene, system: System, *, has_steps: bool, where: str = WHERE) -> None:
    """Refuse a motion for which variational equations end, or don't exist.

    Raises:
        ConfigError: single precision, an average, a closed form, kinks and jumps, an end by the loads.
    """
    integrator, found = scene.config.integrator, system.plan.surfaces.found
    why = ""
    if integrator.precision == "single":
        why = 'derivatives lose their digits in single precision; choose precision = "double" or a higher one'
    elif scene.config.model.level != FULL:
        why = f'[model] level = "{scene.config.model.level}" has no attitude to differentiate; choose "full"'
    elif not has_steps:
        why = (
            f'[integrator] method = "{integrator.method}" takes no steps with which variational equations '
            'could be integrated; choose "taylor"'
        )
    elif found:
        why = (
            f"the equations switch at a kink or jump of {found[0].text} ({found[0].where}), where "
            f"variational equations end; {found[0].remedy}"
        )
    elif system.switches:
        why = (
            "the equations read full turns of Euler angles or the quaternion's sign, which have jumps; write "
            "the load with products of quaternion components"
        )
    elif len(system.crossings) > len(system.events):
        why = "the motion may end (a body changes, or touches another one), where variational equations end"
    elif any(kick.time is None for kick in system.kicks):
        why = "an impulse acts where an expression vanishes, at a time that changes with it; give it a time"
    elif scene.found_start is not None:
        why = "the start is an equilibrium that is found, not given; give its attitude and rates instead"
    if why:
        raise ConfigError(Problem(where, f"asked for derivatives, but {why}"))


# --- coefficients as parameters -----------------------------------------------------------------------------

_OFF, _STEP = 40, 30
"""Bits below the working precision's rounding by which keys stand off their values, and bits of that by which
each is moved: differences err by 2^-30 of what changes over the former, which is no number of the run's.
"""
_LOOK = Fraction(1, 1 << 20)  # change, of a key's size, by which a dependence that no coefficient has shows
_MOST_PATTERNS = 16  # of the signs in which keys stand off


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
    kicks: list[tuple[Any, dict[int, Symbolic]]]

    @property
    def form(self) -> list[int]:
        """Hashes, since wide expressions share parts that a comparison would walk through again and again."""
        changed = [x for _, states in self.kicks for x in states.values()]
        return [hash(x) for x in (*self.equations, *self.outputs, *changed)]


class Parametrised:
    """A scene's full motion in rates and quaternion, whose coefficients that depend on keys are parameters.

    Attributes:
        keys: the numbers, one by one.
        values: of these, SI.
        context: arithmetic in which all is worked out.
        plain: the same motion in plain numbers, for pieces of the equations and for names.
        equations: right-hand sides with ``hy.par[first + i]`` for coefficient i.
        kicks: times at which states change at once, and what they are then, likewise.
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
        times = [[time for time, _ in one.kicks] for one in (base, *moved)]
        what = "names the time of an impulse; give the derivative by its velocity instead, or shift the start"
        ensure(
            not any(self._differ(x, y) for other in times for x, y in zip(other, times[0], strict=True)),
            ConfigError(Problem(WHERE, what), experiment.source),
        )
        self._varied = [
            i for i, x in enumerate(base.noted) if any(self._differ(m.noted[i], x) for m in moved)
        ]
        self._fixed = {i: x for i, x in enumerate(base.noted) if i not in set(self._varied)}
        made = self._pass(found, self._as_parameters())
        self.equations, self.outputs, self.kicks = made.equations, made.outputs, made.kicks
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
        raise ConfigError(Problem(WHERE, what), self._experiment.source)

    @property
    def _steps(self) -> list[Fraction]:
        return [key.scale(self.context) / 2 ** (self._bits + _OFF + _STEP) for key in self.keys]

    def _standing_off(self, values: Sequence[Fraction]) -> Iterator[list[Fraction]]:
        """Values a little off, each in a different proportion, in patterns of signs: a thin plate's moments,
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
        kicks = [(x.time, {system.states.index(n): y for n, y in x.states.items()}) for x in system.kicks]
        return _Pass(system, noted, [hy.expression(x) for x in outputs], equations, kicks)

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
        what = f"names {names}; one of these changes the form of the equations: leave it out"
        raise ConfigError(Problem(WHERE, what), self._experiment.source)


def _of_motion(experiment: Experiment, more: Sequence[str]) -> Experiment:
    """The experiment of the same motion in rates and quaternion, without what is only watched."""
    config = experiment.config
    record = ["quaternion", "angular_velocity", *(state.name for state in config.states)]
    record += ["position", "velocity"] if config.initial.flies else []
    record += ["rigid_body_position", "rigid_body_quaternion"] if config.rigid_bodies else []
    record += ["rotor_rate"] if config.rotors else []
    record += ["core_angular_velocity"] if config.body.core is not None else []
    record += [name for name in more if name not in record]
    return replace(experiment, config=config.as_motion(record))


def parametrised(
    experiment: Experiment,
    keys: Sequence[str],
    loads: Sequence[Load] = (),
    where: str = WHERE,
    record: Sequence[str] = (),
) -> Parametrised:
    """The system of an experiment with numbers of its config as parameters.

    Raises:
        ConfigError: a key that stands for no number, or by which the equations have no derivative.
    """
    precision = precision_of(experiment.config.integrator.precision)
    found = varied_keys(experiment, keys, where)
    return Parametrised(experiment, found, precision.number, precision.bits, loads, record)


# --- what is recorded -------------------------------------------------------------------------------------

_WIDTH = 4
"""Lanes of a batch: the fastest for a motion with a tangent, even where registers hold eight."""
_IN_LANES = 1e-9
"""Tolerance of lanes, which take a third of the time then: derivatives that are right to some 1e-7."""
_SMALL = -80  # binary exponent of tangents in lanes, whose series have the motion's radius of convergence
_MOST_STATES = 20  # in lanes, beyond which unrolled code takes long to compile
_MOST_STEPS = 10**9


@dataclass(frozen=True)
class Rows:
    """What is recorded of a motion at some times (n,), in SI: (n, components) of each variable, and its
    derivatives by the keys, (n, keys, components).
    """

    values: dict[str, np.ndarray]
    slopes: dict[str, np.ndarray]


class KeyTangents:
    """A motion and its derivatives by the keys of a parametrised system.

    Args:
        quickly: to go in lanes where the motion allows it.
    """

    def __init__(self, made: Parametrised, precision: Precision, *, quickly: bool = False) -> None:
        self.made, self.precision, self.system = made, precision, made.plain
        self.keys, system = len(made.keys), made.plain
        alone = (
            system.pieces is None
            and not made.kicks
            and not system.clocked
            and not system.switches
            and made.first == 0
        )
        small = not system.wide and len(system.states) <= _MOST_STATES
        derivatives = Derivatives(system, made.equations, made.outputs, made.first, made.count, made.kicks)
        slopes = made.coefficients.initial_slopes
        self._moving = derivatives.felt([i for i, row in enumerate(slopes) if any(x != 0 for x in row)])
        equations, (along,) = derivatives.equations(self._moving, 1)
        self._one, self._first_slope = [*system.variables, *along.values()], derivatives.slopes(0).start
        self._lanes: tuple[BatchEngine, BatchEngine] | None = None
        if quickly and precision.name == "double" and alone and small:
            motion = list(zip(system.variables, made.equations, strict=True))
            self._lanes = (
                BatchEngine(motion, 1),
                BatchEngine(equations, _WIDTH, tolerance=_IN_LANES),
            )
        else:
            self.tangents = Tangents(derivatives, self._moving, self.keys, precision, compact_mode=True)
        outputs = range(len(made.equations), len(made.equations) + len(made.outputs))
        self._slopes = [derivatives.along(row, along, self._first_slope) for row in outputs]
        self._options = dict(precision.options, compact_mode=self._lanes is None)
        context = system.scene.context
        self._start = precision.number(system.start)
        units = [context.ldexp(context.one, e) for one in made.recorded for e in one.exponents]
        self._units = precision.array(units)
        self.use(made.coefficients)

    def use(self, found: Coefficients) -> None:
        """Take coefficients and initial values, to begin anew."""
        precision, made = self.precision, self.made
        self._values, self._initial = precision.array(found.values), precision.array(found.initial)
        self._coefficient_slopes, self._initial_slopes = (
            np.array([precision.array(row) for row in rows], dtype=precision.scalar).reshape(
                len(rows), self.keys
            )
            for rows in (found.slopes, [found.initial_slopes[i] for i in self._moving])
        )
        if self._lanes is not None:
            return
        tangents, numbers = self.tangents, self.tangents.numbers
        numbers[made.first : made.first + made.count] = self._values
        exponents, carried = np.zeros(self.keys, dtype=np.int64), []
        for j in range(self.keys):
            numbers[tangents.slopes(j)] = self._coefficient_slopes[:, j]
            sizes = [*self._initial_slopes[:, j], *self._coefficient_slopes[:, j]]
            exponents[j] = math.frexp(max((abs(float(x)) for x in sizes), default=0.0))[1]
            context = self.system.scene.context
            column = [context.ldexp(found.initial_slopes[i][j], -int(exponents[j])) for i in self._moving]
            carried.append(precision.array(column))
        state = np.concatenate([self._initial, *carried])
        self._first = Place((self._start, precision.of_double(0.0)), state, exponents)
        self.begin()

    def begin(self) -> None:
        """Go back to the start."""
        if self._lanes is None:
            self.tangents.begin(self._first)

    def sample(self, time: Scalar, go_on: Callable[[], bool] = lambda: True) -> tuple[np.ndarray, np.ndarray]:
        """State with tangents at a time (``Tangents.sample``), and the parameters there."""
        return self.tangents.sample(time, go_on), self.tangents.numbers.copy()

    def at(self, times: np.ndarray) -> Rows:
        """What is recorded at ascending internal times (n,), n > 0, from the start on.

        Raises:
            LostTangents: the motion or a tangent doesn't stay finite.
        """
        if self._lanes is None:
            return self.of(times, [self.sample(time) for time in times])
        motion, along = self._lanes
        states = self._in_lanes(motion, self._initial[:, None], self._values[:, None], times)[:, :, 0]
        values = self._evaluated(self.made.outputs, states, self._values[:, None], times)
        return self._rows(values, self._along(along, times))

    def of(self, times: np.ndarray, samples: Sequence[tuple[np.ndarray, np.ndarray]]) -> Rows:
        """The same at some samples (``sample``), n > 0 of them."""
        scalar, tangents = self.precision.scalar, self.tangents
        states = np.array([state for state, _ in samples], dtype=scalar)
        numbers = np.array([one for _, one in samples], dtype=scalar).T
        count, known = len(self.system.states), self._first_slope
        along = []
        for j in range(self.keys):
            own = np.concatenate([states[:, :count], states[:, tangents.of(j)]], axis=1)
            read = np.concatenate([numbers[:known], numbers[tangents.slopes(j)]])
            along.append(self._evaluated(self._slopes, own, read, times))
        return self._rows(self._evaluated(self.made.outputs, states[:, :count], numbers, times), along)

    def _rows(self, values: np.ndarray, along: Sequence[np.ndarray]) -> Rows:
        parts = {one.name: slice(one.first, one.first + one.count) for one in self.made.recorded}
        whole, slopes = values * self._units, np.stack(along, axis=1) * self._units
        return Rows(
            {name: whole[:, part] for name, part in parts.items()},
            {name: slopes[:, :, part] for name, part in parts.items()},
        )

    def _evaluated(
        self, expressions: Iterable[Any], states: np.ndarray, numbers: np.ndarray, times: np.ndarray
    ) -> np.ndarray:
        """Values (n, expressions) of the outputs, or along a tangent, in states (n, ...), with parameters."""
        function = compiled_function(list(expressions), self._one[: states.shape[1]], **self._options)
        given = numbers[: function.nparams] if function.nparams else None
        if given is not None and given.shape[1] == 1:
            given = given[:, 0]
        return evaluate_rows(function, np.ascontiguousarray(states), given, times).T

    # --- in lanes ---------------------------------------------------------------------------------------

    def _along(self, engine: BatchEngine, times: np.ndarray) -> list[np.ndarray]:
        """Derivatives of the outputs, (n, outputs), by each key: tangents so small that step control doesn't
        see them.
        """
        found: list[np.ndarray] = []
        states = len(self.system.states)
        for begin in range(0, self.keys, _WIDTH):
            moved, driven = (
                x[:, begin : begin + _WIDTH] for x in (self._initial_slopes, self._coefficient_slopes)
            )
            sizes = np.abs(np.concatenate([moved, driven])).max(axis=0, initial=0.0)
            scales = np.ldexp(1.0, _SMALL - np.frexp(sizes)[1])
            initial, values = (
                np.repeat(x[:, None], len(scales), axis=1) for x in (self._initial, self._values)
            )
            numbers = np.concatenate([values, driven])
            pars = np.concatenate([values, driven * scales])
            there = self._in_lanes(engine, np.concatenate([initial, moved * scales]), pars, times)
            there[:, states:] /= scales
            lanes = range(len(scales))
            found += [
                self._evaluated(self._slopes, there[:, :, i], numbers[:, i : i + 1], times) for i in lanes
            ]
        return found

    def _in_lanes(
        self, engine: BatchEngine, initial: np.ndarray, pars: np.ndarray, times: np.ndarray
    ) -> np.ndarray:
        """States (n, all, lanes) at times (n,)."""
        lanes = initial.shape[1]
        start, every = np.full(lanes, float(self._start)), np.repeat(times[:, None], lanes, axis=1)
        found = engine.run(initial, pars, start, every, _MOST_STEPS)
        if not found.arrived.all() or not np.isfinite(found.states).all():
            raise LostTangents("they are no longer finite")
        return found.states


def turned(quaternion: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Rotation vectors, space axes, per unit of each key: 2 dq/dp q*, from q (n, 4), body axes to space, and
    its derivatives (n, keys, 4); (n, keys, 3).
    """
    w, v = quaternion[:, None, :1], quaternion[:, None, 1:]
    a, b = slopes[:, :, :1], slopes[:, :, 1:]
    (vx, vy, vz), (bx, by, bz) = (np.moveaxis(x, 2, 0) for x in (v, b))
    crossed = np.stack([by * vz - bz * vy, bz * vx - bx * vz, bx * vy - by * vx], axis=2)
    square = w * w + sum(v[:, :, i : i + 1] * v[:, :, i : i + 1] for i in range(3))
    half = w * b - a * v - crossed
    return (half + half) / square
