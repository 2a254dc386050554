"""A motion and its tangents: how small offsets of its states, and of its coefficients, go on.

    y' = f(y, c),    d' = df/dy d + df/dc s

for each tangent d, with s the derivatives of the coefficients c along it. The motion takes natural steps of
these equations together, through pieces as rows of tables and blocks of kernels, and with full turns and the
quaternion's sign continued where equations read them.

Each tangent is carried times a power of two, chosen anew on the way so that step control sees numbers of
order one whatever the tangent's unit and however it grows: the equations are linear in it, and nothing is
rounded thereby.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.rotations import Symbolic
from rigidsim.model.system import System
from rigidsim.solve.compiled import compiled_engine, compiled_function
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.requirements import SetAtKnots
from rigidsim.solve.stepper import longest_step
from rigidsim.solve.switching.turned import Turned

_LARGE, _SMALL = 1, -2  # binary exponents between which a tangent's largest component is left as it is
_LOOK = 64  # steps between two looks at whether to go on
_STRIDE = 16  # steps between two looks at the tangents' sizes where no step is asked for by itself
_SINGLE_STEPS_LOST = 1000  # steps without progress in time, before the motion is given up

Row = dict[int, Symbolic]
"""Derivatives of an expression that aren't zero everywhere, by the number of the variable."""


class LostTangents(Exception):
    """Why tangents can't be followed any further."""


def jacobian_rows(expressions: Sequence[Symbolic], by: Sequence[Symbolic]) -> list[Row]:
    """Derivatives by some variables, a row for each expression."""
    if not by:
        return [{} for _ in expressions]
    found = hy.diff_tensors([hy.expression(x) for x in expressions], diff_args=list(by), diff_order=1)
    zero = hy.expression(0.0)
    return [{i: d for i, d in enumerate(row) if d != zero} for row in found.jacobian]


class Derivatives:
    """Derivatives of a system's right-hand sides, and of outputs after them, by states and by coefficients.

    Args:
        rights: right-hand sides of all states.
        first, count: numbers of the first of the parameters that are coefficients, and how many there are.
        kicks: internal times at which states change at once, and what they are then, by their numbers.
    """

    def __init__(
        self,
        system: System,
        rights: Sequence[Symbolic],
        outputs: Sequence[Symbolic] = (),
        first: int = 0,
        count: int = 0,
        kicks: Sequence[tuple[Any, Mapping[int, Symbolic]]] = (),
    ) -> None:
        self.system, self.rights, self.outputs = system, list(rights), list(outputs)
        self.first, self.count, self.kicks = first, count, list(kicks)
        whole = [*rights, *outputs]
        self.kick_rows: list[dict[int, int]] = []  # of each kick, the row of each state
        for _, states in kicks:
            self.kick_rows.append(dict(zip(states, range(len(whole), len(whole) + len(states)), strict=True)))
            whole += states.values()
        self.by_state = jacobian_rows(whole, system.variables)
        self.by_coefficient = jacobian_rows(whole, [hy.par[first + m] for m in range(count)])

    @classmethod
    def of(cls, system: System) -> Derivatives:
        """Derivatives of a system as it is, without coefficients that vary."""
        return cls(system, [right for _, right in system.equations], first=parameters_of(system))

    def felt(self, begun: Collection[int]) -> list[int]:
        """States whose offsets depend on those of some states and of the coefficients, and that an output
        depends on, if there are outputs. Those that pieces set anew have no tangents.
        """
        rows = {i: [i, *(x[i] for x in self.kick_rows if i in x)] for i in range(len(self.rights))}
        moved = {*begun, *(i for i, of in rows.items() if any(self.by_coefficient[row] for row in of))}
        while more := {
            i for i, of in rows.items() if i not in moved and any(moved & self.by_state[x].keys() for x in of)
        }:
            moved |= more
        if self.outputs:
            after = range(len(self.rights), len(self.rights) + len(self.outputs))
            wanted = {i for row in after for i in self.by_state[row]}
            while more := {
                i for j in wanted for row in rows[j] for i in self.by_state[row] if i not in wanted
            }:
                wanted |= more
            moved &= wanted
        pieces = self.system.pieces
        known = range(0 if pieces is None else min(len(pieces.knots), 8) + 1)
        anew = {name for number in known for name in pieces.states(number)} if pieces is not None else set()
        return sorted(i for i in moved if self.system.states[i] not in anew)

    def slopes(self, tangent: int) -> slice:
        """Numbers of the parameters that are derivatives of coefficients along a tangent."""
        first = int(self.first + self.count * (1 + tangent))
        return slice(first, first + self.count)

    def equations(
        self, moving: Sequence[int], count: int
    ) -> tuple[list[tuple[Symbolic, Symbolic]], list[dict[int, Symbolic]]]:
        """Equations of the motion and of tangents, which some states have, and the variables of these."""
        names = self.system.states
        tangents = [{i: hy.make_vars(f"tangent_{j}_{names[i]}") for i in moving} for j in range(count)]
        found = list(zip(self.system.variables, self.rights, strict=True))
        for j, tangent in enumerate(tangents):
            first = self.slopes(j).start
            found += [(d, self.along(i, tangent, first)) for i, d in tangent.items()]
        return found, tangents

    def along(self, row: int, tangent: Mapping[int, Symbolic], slopes: int) -> Symbolic:
        """Derivative of an expression along a tangent, with the number of the parameter that is the first
        coefficient's derivative along it.
        """
        terms = [d * tangent[i] for i, d in self.by_state[row].items() if i in tangent]
        terms += [d * hy.par[slopes + m] for m, d in self.by_coefficient[row].items()]
        return hy.sum(terms) if terms else hy.expression(0.0)


@dataclass(frozen=True)
class Place:
    """A boundary of steps, all of it: to continue with the same bits."""

    time: tuple[Scalar, Scalar]
    state: np.ndarray  # of the motion and its tangents, as they are carried
    exponents: np.ndarray  # (tangents,) int64, of the powers of two that tangents are carried times
    steps: int = 0  # since the motion was last set
    turns: tuple[float, ...] = ()  # parameters that are full turns, and the sign of the quaternion


class Tangents:
    """A motion of a system with tangents of some of its states, ``moving``.

    Args:
        count: number of tangents.
        options: of the engine, as ``tol`` and ``compact_mode``.

    Attributes:
        numbers: parameters that equations and outputs read: the system's, coefficients, and the derivatives
            of these along each tangent. To be set before ``begin``.
    """

    def __init__(
        self,
        derivatives: Derivatives,
        moving: Sequence[int],
        count: int,
        precision: Precision,
        **options: Any,
    ) -> None:
        self.system, self.precision, self.moving, self.count = derivatives.system, precision, moving, count
        self._made, system, names = derivatives, derivatives.system, derivatives.system.states
        self.states = len(names)
        equations, _ = derivatives.equations(moving, count)
        self.numbers = precision.zeros((self.slopes(count).start,))
        zeros = precision.zeros((len(equations),))
        self._engine = compiled_engine(equations, zeros, **{**precision.options, **options})
        self._longest = precision.of_double(longest_step(self._engine.order, precision.scalar))
        self._knots = None if system.pieces is None else SetAtKnots(system)
        along = {i: hy.make_vars(f"tangent_0_{names[i]}") for i in moving}
        self._kicks = sorted(
            (
                (precision.number(time), self._changing(states, rows, along))
                for (time, states), rows in zip(derivatives.kicks, derivatives.kick_rows, strict=True)
                if time > system.start
            ),
            key=lambda kick: kick[0],
        )
        self._clock = system.parameters - 1 if system.clocked else None
        read = [*system.turning, *system.signed]
        self._read = hy.cfunc(read, system.variables, compact_mode=True) if read else None
        self._stride = 1 if read or system.clocked else _STRIDE
        self._turned: Turned | None = None
        self._place: Place | None = None

    def _changing(
        self, states: Mapping[int, Symbolic], rows: Mapping[int, int], along: Mapping[int, Symbolic]
    ) -> tuple[Any, list[int], list[int]]:
        """What changes at once: values and offsets as a function of state and a tangent, and their places."""
        moved, first = [i for i in rows if i in along], self.slopes(0).start
        changed = [*states.values(), *(self._made.along(rows[i], along, first) for i in moved)]
        variables = [*self.system.variables, *along.values()]
        function = compiled_function(changed, variables, compact_mode=True, **self.precision.options)
        return function, list(states), [list(self.moving).index(i) for i in moved]

    def _kick(self) -> Scalar | None:
        """Change at once what changes here; returns the next time at which something does."""
        engine, first = self._engine, self.slopes(0)
        for function, states, moved in (found for at, found in self._kicks if engine.dtime == (at, 0)):
            before, numbers = np.array(engine.state), self.numbers.copy()
            for j in range(self.count):
                part = self.of(j)
                numbers[first] = self.numbers[self.slopes(j)] * self._power(-int(self._exponents[j]))
                given = {"pars": numbers[: function.nparams]} if function.nparams else {}
                after = function(np.concatenate([before[: self.states], before[part]]), **given)
                engine.state[states] = after[: len(states)]
                engine.state[[part.start + i for i in moved]] = after[len(states) :]
        return next((at for at, _ in self._kicks if at > engine.time), None)

    def slopes(self, tangent: int) -> slice:
        """See ``Derivatives``."""
        return self._made.slopes(tangent)

    def of(self, tangent: int) -> slice:
        """Places of a tangent's components."""
        begin = self.states + tangent * len(self.moving)
        return slice(begin, begin + len(self.moving))

    # --- where it is ------------------------------------------------------------------------------------

    @property
    def place(self) -> Place:
        """Where the latest step began, from which all that follows is done again with the same bits."""
        assert self._place is not None
        return self._place

    @property
    def here(self) -> Place:
        """Where the latest step ended."""
        turns = () if self._turned is None else tuple(self._turned.parameters(*self._plain()))
        return Place(
            self._engine.dtime, np.array(self._engine.state), self._exponents.copy(), self.steps, turns
        )

    def begin(self, place: Place) -> None:
        """Go on from a place, with the present ``numbers``."""
        engine = self._engine
        engine.dtime = place.time
        engine.state[:] = place.state
        self._exponents, self.steps, self._place = place.exponents.copy(), place.steps, place
        self._entered: int | None = None
        self._fresh = True
        if self._read is not None:
            plain = self._plain()
            self._turned = (
                Turned.by(*plain, place.turns) if place.turns else Turned.begun(self.system, *plain)
            )
        engine.pars[:] = self.numbers[: len(engine.pars)]
        self._set_slopes()

    def set(self, time: Scalar, state: np.ndarray) -> None:
        """Go on, at a time within the latest step, in another state of the motion with its tangents."""
        engine = self._engine
        here = np.array(engine.state if time == engine.time else engine.update_d_output(time))
        here[: self.states] = state
        self.begin(Place((time, self.precision.of_double(0.0)), here, self._exponents))

    def restart(self, state: np.ndarray, tangents: np.ndarray) -> None:
        """Go on from here in a state, with tangents (count, moving)."""
        turns, zero = self.here.turns, np.zeros(self.count, dtype=np.int64)
        every = np.concatenate([state, tangents.ravel()]).astype(self.precision.scalar)
        self.begin(Place(self._engine.dtime, every, zero, self.steps, turns))

    # --- steps ------------------------------------------------------------------------------------------

    def sample(self, time: Scalar, go_on: Callable[[], bool] = lambda: True) -> np.ndarray:
        """State, then tangents one after the other, at a time not before the latest step, by dense output.

        Raises:
            LostTangents: they are no longer finite, or steps lead nowhere.
            KeyboardInterrupt: ``go_on`` says no.
        """
        engine = self._engine
        if self._fresh and engine.time == time:
            self._meet()
        self._steps_to(time, self._step, go_on)
        return self._true(engine.state if engine.time == time else engine.update_d_output(time))

    def to(self, time: Scalar, go_on: Callable[[], bool] = lambda: True) -> tuple[np.ndarray, np.ndarray]:
        """Go exactly to a time: state and tangents (count, moving) there; see ``sample``."""
        self._steps_to(time, lambda: self._go(time, self._stride), go_on)
        every = self._true(self._engine.state)
        return every[: self.states], every[self.states :].reshape(self.count, -1)

    def _steps_to(self, time: Scalar, step: Callable[[], None], go_on: Callable[[], bool]) -> None:
        engine, count, stuck = self._engine, 0, 0
        while engine.time < time:
            before = engine.time
            step()
            count += 1
            stuck = stuck + 1 if engine.time == before else 0
            if stuck > _SINGLE_STEPS_LOST:
                raise LostTangents("their steps lead nowhere")
            if count % _LOOK == 0 and not go_on():
                raise KeyboardInterrupt

    def _step(self) -> None:
        self._place = self.here
        self._go(None, 1)

    def _go(self, until: Scalar | None, most: int) -> None:
        """Take natural steps, none beyond a time or what the equations allow."""
        engine, kick = self._engine, self._kick()
        self._scale()
        end = self._meet()
        if kick is not None:
            end = kick if end is None else min(end, kick)
        if until is not None:
            end = until if end is None else min(end, until)
        if end is None:
            outcome, _ = engine.step(self._longest, write_tc=True)
            self.steps += 1
        else:
            options = {"max_steps": most, "max_delta_t": self._longest, "write_tc": True}
            outcome, _, _, taken, *_ = engine.propagate_until(end, **options)
            self.steps += int(taken)
            if kick is not None and abs(engine.time - kick) <= 4 * float(self.precision.epsilon) * abs(kick):
                engine.dtime = (kick, kick * 0)
        if outcome == hy.taylor_outcome.err_nf_state or not np.isfinite(engine.state.astype(float)).all():
            raise LostTangents("they are no longer finite")

    def _true(self, carried: np.ndarray) -> np.ndarray:
        found = np.array(carried)
        for j in range(self.count):
            part = self.of(j)
            found[part] = found[part] * self._power(int(self._exponents[j]))
        return found

    def _scale(self) -> None:
        """Carry tangents that have become large or small times other powers of two."""
        state, changed = self._engine.state, False
        carried = np.abs(state[self.states :].astype(float)).reshape(self.count, -1)
        for j, size in enumerate(carried.max(axis=1, initial=0.0).tolist()):
            exponent = math.frexp(size)[1] if size else 0
            if exponent > _LARGE or (size and exponent < _SMALL and self._worth_more(j, exponent)):
                part = state[self.of(j)]
                part[:] = part * self._power(-exponent)
                self._exponents[j] += exponent
                changed = True
        if changed:
            self._set_slopes()

    def _worth_more(self, tangent: int, exponent: int) -> bool:
        """Whether a small tangent may be carried as a larger one: not if what drives it would be large."""
        slopes = [abs(float(x)) for x in self.numbers[self.slopes(tangent)]]
        return not slopes or math.frexp(max(slopes))[1] - self._exponents[tangent] - exponent <= _LARGE

    def _set_slopes(self) -> None:
        """Derivatives of coefficients, times the powers of two of the tangents."""
        pars = self._engine.pars
        for j in range(self.count if self._made.count else 0):
            where = self.slopes(j)
            scaled = self.numbers[where] * self._power(-int(self._exponents[j]))
            read = pars[where]  # the last ones are no parameters where only outputs read them
            read[:] = scaled[: len(read)]

    def _power(self, exponent: int) -> Scalar:
        return self.precision.of_double(math.ldexp(1.0, max(min(exponent, 1000), -1000)))

    # --- what the equations need ------------------------------------------------------------------------

    def _meet(self) -> Scalar | None:
        """Set what the equations need here; the time at which a step has to end."""
        engine, self._fresh = self._engine, False
        if self._clock is not None:
            engine.pars[self._clock] = self.numbers[self._clock] = engine.dtime[1]
        if self._turned is not None:
            plain = self._plain()
            turns = self._turned.parameters(*plain)
            self._turned = Turned.by(*plain, turns)
            self.numbers[: len(turns)] = turns
            engine.pars[: len(turns)] = self.numbers[: min(len(turns), len(engine.pars))]
        return self._enter()

    def _plain(self) -> tuple[list[float], list[float]]:
        """Angles within one turn, and the quaternion without its sign, that equations read."""
        assert self._read is not None
        found = self._read(np.array(self._engine.state[: self.states])).tolist()
        angles = len(self.system.turning)
        return found[:angles], found[angles:]

    def _enter(self) -> Scalar | None:
        """Set what begins at or before this boundary, as the rows of a table; the time at which to stop."""
        if self._knots is None:
            return None
        number = self._knots.enter(self._engine)
        if self._entered != number:
            values, first = self._knots.pieces.parameters(number), self.system.first_of_pieces
            for pars in (self._engine.pars, self.numbers):
                pars[first : first + len(values)] = values
            self._entered = number
        return self._knots.end_after(self._engine.time)


def parameters_of(system: System) -> int:
    """Number of parameters that a system's equations may use."""
    count = system.parameters
    if system.pieces is not None:
        count = max(count, system.first_of_pieces + len(system.pieces.parameters(0)))
    used = [int(str(p)[1:]) + 1 for p in hy.get_params([right for _, right in system.equations])]
    return max([count, *used])
