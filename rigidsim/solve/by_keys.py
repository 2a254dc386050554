"""A motion's derivatives by numbers of its config: which motions have them, and what is recorded of them.

One integrator carries the motion with its tangents dy/dp for each key p, apart from a run's own
(``rigidsim.solve.tangents``). Many keys of a motion in double precision whose equations stay the same from
the start on may go side by side, one a lane, at a tolerance of 1e-9; the motion itself is then integrated at
epsilon.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.load import Load
from rigidsim.model.parametrised import Coefficients, Parametrised
from rigidsim.model.system import System
from rigidsim.scene.choices import FULL
from rigidsim.scene.config import Experiment
from rigidsim.scene.scene import Scene
from rigidsim.scene.varied_keys import varied_keys
from rigidsim.solve.compiled import compiled_function, evaluate_rows
from rigidsim.solve.lanes import BatchEngine
from rigidsim.solve.precision import Precision, Scalar, precision_of
from rigidsim.solve.tangents import Derivatives, LostTangents, Place, Tangents

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
        why = "the body changes in a way that may end its motion, where variational equations end"
    elif scene.found_start is not None:
        why = "the start is an equilibrium that is found, not given; give its attitude and rates instead"
    if why:
        raise ConfigError(Problem(where, f"asked for derivatives, but {why}"))


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
        alone = system.pieces is None and not system.clocked and not system.switches and made.first == 0
        small = not system.wide and len(system.states) <= _MOST_STATES
        derivatives = Derivatives(system, made.equations, made.outputs, made.first, made.count)
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
