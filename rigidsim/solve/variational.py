"""The variational equations of a scene by numbers of its config, integrated beside a motion.

A second integrator carries the motion and its tangents: dy/dp for each key p,

    (dy/dp)' = df/dy dy/dp + sum over coefficients c of df/dc dc/dp.

It takes natural steps of its own and gives samples by its dense output. Each tangent is carried times a power
of two, chosen anew at each step so that step control sees numbers of order one whatever the key's unit and
however the tangent grows: the equations are linear in it, and nothing is rounded thereby.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import heyoka as hy
import numpy as np

from rigidsim.model.parametrised import Coefficients, Parametrised
from rigidsim.model.rotations import Symbolic
from rigidsim.solve.compiled import TaylorEngine, compiled_engine, compiled_function, evaluate_rows
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.stepper import longest_step
from rigidsim.solve.tangent_states import jacobian_rows, moving_states

_LARGE, _SMALL = 1, -2  # binary exponents between which a tangent's largest component is left as it is
_LOOK = 64  # steps between two looks at whether to go on
_SINGLE_STEPS_LOST = 1000  # steps without progress in time, before the motion is given up


class LostTangents(Exception):
    """Why tangents can't be followed any further."""


@dataclass(frozen=True)
class TangentPlace:
    """A boundary of the second integrator's steps, all of it: to continue with the same bits."""

    time: tuple[Scalar, Scalar]
    state: np.ndarray  # of the motion and its tangents, as they are carried
    exponents: np.ndarray  # (keys,) int64, of the powers of two that tangents are carried times
    steps: int  # since the motion was last set


@dataclass(frozen=True)
class Rows:
    """What is recorded of a motion at some times (n,), in SI: (n, components) of each variable, and its
    derivatives by the keys, (n, keys, components).
    """

    values: dict[str, np.ndarray]
    slopes: dict[str, np.ndarray]


class Variational:
    """The second integrator of a scene with parameters."""

    def __init__(self, parametrised: Parametrised, precision: Precision) -> None:
        self.parametrised, self.precision = parametrised, precision
        self.system = parametrised.plain
        self.keys, self.states = len(parametrised.keys), len(self.system.states)
        self._pieces = self.system.pieces
        self._clock = self.system.parameters - 1 if self.system.clocked else None
        names = self.system.states
        self._set = set() if self._pieces is None else set(self._all_set_states())
        equations, self._output, self.moving = self._equations()
        self._places = {name: place for place, name in enumerate(names)}
        options = dict(precision.options, compact_mode=True)
        self._engine: TaylorEngine = compiled_engine(equations, precision.zeros((len(equations),)), **options)
        self._longest = precision.of_double(longest_step(self._engine.order, precision.scalar))
        self._first: TangentPlace | None = None
        self._place: TangentPlace | None = None
        self._entered: int | None = None
        self.use(parametrised.coefficients)

    def _all_set_states(self) -> list[str]:
        pieces = self._pieces
        assert pieces is not None
        return [name for number in range(min(len(pieces.knots), 8) + 1) for name in pieces.states(number)]

    # --- equations --------------------------------------------------------------------------------------

    def _equations(self) -> tuple[list[tuple[Symbolic, Symbolic]], list[Symbolic], list[int]]:
        """Equations of the motion and of the tangents that there are, angular velocity with its derivatives,
        and the indices of the states that have tangents.
        """
        made, system = self.parametrised, self.system
        variables, first, count = system.variables, made.first, made.count
        varied = [hy.par[first + i] for i in range(count)]
        jacobian = jacobian_rows([*made.equations, *made.outputs], variables)
        forcing = jacobian_rows([*made.equations, *made.outputs], varied)
        moving = moving_states(made, jacobian, forcing, self._set)
        tangents = {
            (i, j): hy.make_vars(f"tangent_{j}_{system.states[i]}") for i in moving for j in range(self.keys)
        }

        def derivative(row: int, key: int) -> Symbolic:
            terms = [d * tangents[i, key] for i, d in jacobian[row].items() if i in moving]
            terms += [d * hy.par[self._slope(m, key)] for m, d in forcing[row].items()]
            return hy.sum(terms) if terms else hy.expression(0.0)

        found = list(zip(variables, made.equations, strict=True))
        found += [(tangents[i, j], derivative(i, j)) for j in range(self.keys) for i in moving]
        rows = range(self.states, self.states + len(made.outputs))
        output = [*made.outputs, *(derivative(row, j) for j in range(self.keys) for row in rows)]
        self._variables = [variable for variable, _ in found]
        return found, output, moving

    def _slope(self, coefficient: int, key: int) -> int:
        """Number of the parameter that is a coefficient's derivative by a key."""
        made = self.parametrised
        return int(made.first + made.count * (1 + key) + coefficient)

    # --- where it is ------------------------------------------------------------------------------------

    def use(self, coefficients: Coefficients) -> None:
        """Take coefficients and initial values, to begin anew."""
        precision, made = self.precision, self.parametrised
        number, slopes = precision.number, coefficients.slopes
        numbers = precision.zeros((self._slope(0, self.keys),))  # all that equations and outputs may read
        numbers[made.first : made.first + made.count] = precision.array(coefficients.values)
        for j in range(self.keys):
            for m in range(made.count):
                numbers[self._slope(m, j)] = number(slopes[m][j])
        self._numbers = numbers
        state = precision.zeros((len(self._variables),))
        state[: self.states] = precision.array(coefficients.initial)
        exponents = np.zeros(self.keys, dtype=np.int64)
        for j in range(self.keys):
            column = [coefficients.initial_slopes[i][j] for i in self.moving]
            sizes = [abs(float(x)) for x in [*column, *(row[j] for row in slopes)]]
            exponents[j] = math.frexp(max(sizes, default=0.0))[1]
            context = self.system.scene.context
            scaled = [context.ldexp(x, -int(exponents[j])) for x in column]
            state[self._of_key(j)] = precision.array(scaled)
        zero = precision.of_double(0.0)
        start = number(self.system.scene.context.ldexp(self.system.scene.start, -self.system.scaling.time))
        self._first = TangentPlace((start, zero), state, exponents, 0)
        self._begin_at(self._first)

    def begin(self) -> None:
        """Go back to the start."""
        assert self._first is not None
        self._begin_at(self._first)

    @property
    def place(self) -> TangentPlace:
        """Where the latest step began, from which all that follows is done again with the same bits."""
        assert self._place is not None
        return self._place

    def back_to(self, place: TangentPlace) -> None:
        """Return to a place."""
        self._begin_at(place)

    def set(self, time: Scalar, state: np.ndarray) -> None:
        """Continue, at a time within the latest step, in another state of the motion with its tangents."""
        here = np.array(self._engine.update_d_output(time)) if time != self._engine.time else self._here()
        here[: self.states] = state
        place = TangentPlace((time, self.precision.of_double(0.0)), here, self._exponents.copy(), 0)
        self._begin_at(place)

    def _here(self) -> np.ndarray:
        return np.array(self._engine.state)

    def _begin_at(self, place: TangentPlace) -> None:
        engine = self._engine
        engine.dtime = place.time
        engine.state[:] = place.state
        self._exponents, self._steps, self._place = place.exponents.copy(), place.steps, place
        self._entered, self._fresh = None, True
        engine.pars[:] = self._numbers[: len(engine.pars)]
        self._set_slopes()

    @property
    def steps(self) -> int:
        """Steps since the motion was set."""
        return self._steps

    def _of_key(self, key: int) -> slice:
        begin = self.states + key * len(self.moving)
        return slice(begin, begin + len(self.moving))

    # --- steps ------------------------------------------------------------------------------------------

    def to(self, time: Scalar, go_on: Callable[[], bool] = lambda: True) -> np.ndarray:
        """State and tangents, as they are carried, at a time not before the latest step.

        Raises:
            LostTangents: they are no longer finite, or steps lead nowhere.
            KeyboardInterrupt: ``go_on`` says no.
        """
        engine, count, stuck = self._engine, 0, 0
        if self._fresh and engine.time == time:
            self._meet()
        while engine.time < time:
            before = engine.time
            self._step()
            count += 1
            stuck = stuck + 1 if engine.time == before else 0
            if stuck > _SINGLE_STEPS_LOST:
                raise LostTangents("their steps lead nowhere")
            if count % _LOOK == 0 and not go_on():
                raise KeyboardInterrupt
        if engine.time == time:
            return self._here()
        return np.array(engine.update_d_output(time))

    def _step(self) -> None:
        engine = self._engine
        self._place = TangentPlace(engine.dtime, self._here(), self._exponents.copy(), self._steps)
        self._scale()
        until = self._meet()
        if until is None:
            outcome, *_ = engine.step(self._longest, write_tc=True)
        else:
            outcome, *_ = engine.propagate_until(until, max_steps=1, max_delta_t=self._longest, write_tc=True)
        self._steps += 1
        if outcome == hy.taylor_outcome.err_nf_state or not np.isfinite(engine.state.astype(float)).all():
            raise LostTangents("they are no longer finite")

    def _scale(self) -> None:
        """Carry tangents that have become large or small times other powers of two."""
        changed = False
        for j in range(self.keys):
            part = self._engine.state[self._of_key(j)]
            size = max((abs(float(x)) for x in part), default=0.0)
            exponent = math.frexp(size)[1] if size else 0
            if exponent > _LARGE or (size and exponent < _SMALL and self._worth_more(j, exponent)):
                part[:] = part * self._power(-exponent)
                self._exponents[j] += exponent
                changed = True
        if changed:
            self._set_slopes()

    def _worth_more(self, key: int, exponent: int) -> bool:
        """Whether a small tangent may be carried as a larger one: not if what drives it would be large."""
        slopes = [abs(float(x)) for x in self._numbers[self._slopes_of(key)]]
        return not slopes or math.frexp(max(slopes))[1] - self._exponents[key] - exponent <= _LARGE

    def _slopes_of(self, key: int) -> slice:
        return slice(self._slope(0, key), self._slope(0, key + 1))

    def _set_slopes(self) -> None:
        """Derivatives of coefficients, times the powers of two of the tangents."""
        pars = self._engine.pars
        for j in range(self.keys):
            where = self._slopes_of(j)
            scaled = self._numbers[where] * self._power(-int(self._exponents[j]))
            read = pars[where]  # the last ones are no parameters where only outputs read them
            read[:] = scaled[: len(read)]

    def _meet(self) -> Scalar | None:
        """Set what the equations need here; the time at which a step has to end."""
        if self._clock is not None:
            self._engine.pars[self._clock] = self._numbers[self._clock] = self._engine.dtime[1]
        self._fresh = False
        return self._enter()

    def _enter(self) -> Scalar | None:
        """Set what begins at or before this boundary, as the rows of a table; the time at which to stop."""
        pieces, engine = self._pieces, self._engine
        if pieces is None:
            return None
        high, low = engine.dtime
        number = pieces.number_at(high)
        if number and high == pieces.knots[number - 1]:
            if low != 0:
                engine.dtime = (high, high * 0)
            for name, value in pieces.states(number).items():
                engine.state[self._places[name]] = value
        if self._entered != number:
            values, first = pieces.parameters(number), self.system.first_of_pieces
            engine.pars[first : first + len(values)] = values
            self._numbers[first : first + len(values)] = values
            self._entered = number
        return pieces.knots[number] if number < len(pieces.knots) else None

    def _power(self, exponent: int) -> Scalar:
        return self.precision.of_double(math.ldexp(1.0, max(min(exponent, 1000), -1000)))

    # --- samples ----------------------------------------------------------------------------------------

    def sample(self, time: Scalar, go_on: Callable[[], bool] = lambda: True) -> tuple[np.ndarray, np.ndarray]:
        """State with tangents per SI unit of the keys at a time (see ``to``), and the parameters there."""
        carried = self.to(time, go_on)
        for j in range(self.keys):
            part = self._of_key(j)
            carried[part] = carried[part] * self._power(int(self._exponents[j]))
        return carried, self._numbers.copy()

    def rows(self, times: np.ndarray, samples: Sequence[tuple[np.ndarray, np.ndarray]]) -> Rows:
        """What is recorded at such samples (``sample``), n > 0 of them."""
        number, scalar = self.precision.number, self.precision.scalar
        states = np.array([state for state, _ in samples], dtype=scalar)
        parameters = np.array([one for _, one in samples], dtype=scalar).T
        options = dict(self.precision.options, compact_mode=True)
        function = compiled_function(self._output, self._variables, **options)
        given = np.ascontiguousarray(parameters[: function.nparams]) if function.nparams else None
        found = evaluate_rows(function, states, given, times).T
        count, context = len(self.parametrised.outputs), self.system.scene.context
        slopes = found[:, count:].reshape(len(times), self.keys, count)
        rows = Rows({}, {})
        for one in self.parametrised.recorded:
            part = slice(one.first, one.first + one.count)
            units = np.array([number(context.ldexp(context.one, e)) for e in one.exponents], dtype=scalar)
            rows.values[one.name] = found[:, :count][:, part] * units
            rows.slopes[one.name] = slopes[:, :, part] * units
        return rows


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
