"""Steps that end at the rows of a table, where parameters and some states of the equations are reset.

A step towards such a knot is cut short to end there, whichever way it is taken: its target is always the next
knot, so that many steps at once give the bits of single ones. What changes at a knot is done at the beginning
of the step after it and depends on the time alone: a checkpoint needs to know nothing of it.
"""

from __future__ import annotations

from collections.abc import Callable

import heyoka as hy
import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.events import EventLog
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.taylor_stepper import TaylorStepper

_CHUNK_TO, _MOST_CHUNKS_TO = 256, 400_000  # steps to a given time at once, and how often


class TableStepper(TaylorStepper):
    """Stepper of a system whose equations change at given times."""

    cuts_steps = careful = True

    def __init__(
        self,
        system: System,
        precision: Precision,
        tolerance: Scalar | None,
        start: Scalar,
        log: EventLog | None = None,
    ) -> None:
        super().__init__(system, precision, tolerance, start, log)
        assert system.pieces is not None
        self._pieces = system.pieces
        self._beyond = self._far
        self._entered: tuple[int, int] | None = None
        self.bound_first_step()
        self.begun = self.mark()

    def bound_first_step(self) -> None:
        """See ``Stepper``."""
        self._enter()
        super().bound_first_step()

    def _enter(self) -> None:
        """Continue with the equations of the piece that begins at this boundary, or contains it."""
        engine, pieces = self._integrator, self._pieces
        high, low = engine.dtime
        number = pieces.number_at(high)
        if number and high == pieces.knots[number - 1]:
            if low != 0:
                engine.dtime = (high, high * 0)
            states, state = self.system.states, engine.state
            for name, value in pieces.states(number).items():
                state[states.index(name)] = value
        if self._entered != (number, id(engine)):
            engine.pars[:] = np.array(pieces.parameters(number), dtype=engine.pars.dtype)
            self._entered = (number, id(engine))
            self._far = pieces.knots[number] if number < len(pieces.knots) else self._beyond

    def step(self) -> bool:
        """See ``Stepper``."""
        self._enter()
        before = self._integrator.dtime
        outcome, smallest, largest, taken, *_ = self._integrator.propagate_until(
            self._far, max_steps=1, max_delta_t=self._longest, callback=self._watched(), write_tc=True
        )
        if not taken:
            self.smallest, self.largest = np.inf, 0.0
            return False
        return self._account(before, outcome, smallest, largest, taken)

    def skip(self, count: int) -> bool:
        """See ``Stepper``; fewer steps if a piece ends."""
        self._enter()
        return super().skip(count)

    def block(self, count: int) -> tuple[bool, Callable[[np.ndarray], np.ndarray]]:
        """See ``Stepper``; fewer steps if a piece ends."""
        self._enter()
        return super().block(count)

    def grid(self, times: np.ndarray, count: int) -> tuple[bool, np.ndarray]:
        """Not available: it would end at the grid's last time and not at a knot."""
        raise NotImplementedError

    def to(self, time: float) -> bool:
        """See ``Stepper``."""
        for _ in range(_MOST_CHUNKS_TO):
            self._enter()
            last = time <= self._far
            outcome = self._integrator.propagate_until(
                time if last else self._far, max_steps=_CHUNK_TO, max_delta_t=self._longest
            )[0]
            if outcome == hy.taylor_outcome.time_limit and last:
                return True
            if outcome not in (hy.taylor_outcome.time_limit, hy.taylor_outcome.step_limit):
                break
        return False
