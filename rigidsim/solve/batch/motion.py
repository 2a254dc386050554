"""Members' motions with their events, and tangent vectors beside them.

As in a single run an event's expression is given a unit in which it is of order one, and is taken off a zero
that the motion begins at (``rigidsim.solve.events``). Both depend on the member, so that they are parameters.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.solve.batch.lanes import BatchEngine, BatchSystem, LaneResults
from rigidsim.solve.batch.tracing import TracedSystem
from rigidsim.solve.compiled import compiled_function
from rigidsim.solve.events import BESIDE, STATES, TIMES, exponents_of

_BITS = 53


class EventExpressions:
    """Events of a family, with ``parameters`` beside those shared with the equations."""

    def __init__(self, traced: TracedSystem) -> None:
        self._traced = traced
        self._meant = [hy.expression(c.expression) for c in traced.system.crossings]
        self.parameters = 2 * len(self._meant)

    def over_parameters(self) -> list[tuple[Any, int]]:
        """Expressions with their directions, each with a shift and a factor as parameters."""
        first = len(self._traced.in_equations)
        expressions = self._traced.as_parameters(self._meant)
        return [
            ((expression + hy.par[first + 2 * n]) * hy.par[first + 2 * n + 1], crossing.direction)
            for n, (expression, crossing) in enumerate(
                zip(expressions, self._traced.system.crossings, strict=True)
            )
        ]

    @cached_property
    def _function(self) -> Any:
        moving = self._traced.system.variables[: self._traced.moving]
        variables = [*moving, *self._traced.parameters.variables]
        return compiled_function(self._meant, variables, compact_mode=True)

    def values(
        self, initial: np.ndarray, swept: np.ndarray, start: np.ndarray, end: np.ndarray
    ) -> np.ndarray:
        """Parameters (2 * events, members) for states (.., members), at internal times (members,)."""
        members = initial.shape[1]
        found = np.zeros((self.parameters, members))
        if not self.parameters:
            return found
        at_start = self._evaluated(initial, swept, start)
        found[0::2] = np.where(at_start == 0, 2.0 ** (-_BITS - BESIDE), 0.0)
        random = np.random.default_rng(0).uniform(-1.0, 1.0, (STATES, len(initial)))
        largest = np.zeros(at_start.shape)
        for part in TIMES:
            for row in range(STATES):
                states = initial if row == 0 else np.repeat(random[row][:, None], members, axis=1)
                values = self._evaluated(states, swept, start + part * (end - start))
                largest = np.fmax(largest, np.where(np.isfinite(values), np.abs(values), 0.0))
        found[1::2] = np.ldexp(1.0, -exponents_of(largest))
        return found

    def _evaluated(self, states: np.ndarray, swept: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Values (events, members), in compact mode, where they don't depend on a member's place."""
        inputs = np.ascontiguousarray(np.concatenate([states, swept]))
        options = {"time": np.ascontiguousarray(times)} if self._function.is_time_dependent else {}
        with np.errstate(all="ignore"):
            return np.asarray(self._function(inputs, **options))


class BatchMotion:
    """Integrators of a traced system with its events, of ``width`` lanes.

    The motion's numbers are those of an integrator without tangent vectors: compiled with them, its equations
    may be rounded otherwise.
    """

    def __init__(self, traced: TracedSystem, crossings: EventExpressions, width: int) -> None:
        self._traced, self._crossings, self._width = traced, crossings, width

    @cached_property
    def _plain(self) -> BatchEngine:
        return self._engine(self._traced.moving, with_events=True)

    @cached_property
    def _along(self) -> BatchEngine | None:
        states = len(self._traced.system.states)
        return self._engine(states, with_events=False) if states > self._traced.moving else None

    def _engine(self, states: int, *, with_events: bool) -> BatchEngine:
        system, tolerance = self._traced.system, self._traced.prepared.tolerance
        rights = self._traced.as_parameters([right for _, right in system.equations[:states]])
        described = BatchSystem(
            list(zip(system.variables[:states], rights, strict=True)),
            self._crossings.over_parameters() if with_events else [],
            None if tolerance is None else float(tolerance),
            system.wide,
        )
        return BatchEngine(described, self._width)

    def compile(self) -> None:
        """Compile the integrators that ``run`` uses."""
        _ = self._plain, self._along

    def run(
        self,
        initial: np.ndarray,
        parameters: np.ndarray,
        start: np.ndarray,
        times: np.ndarray,
        most_steps: int,
    ) -> tuple[LaneResults, np.ndarray | None]:
        """Take members to their last samples, as ``BatchEngine.run``; returns the motion's lanes, and the
        states of motion and tangent vector (samples, states, members), None where the scene has none.

        Args:
            initial: (states, members), tangent vectors included.
            parameters: (parameters, members), those of events after those of the equations.
        """
        motion = self._plain.run(initial[: self._traced.moving], parameters, start, times, most_steps)
        if self._along is None:
            return motion, None
        read = parameters[: len(self._traced.in_equations)]
        return motion, self._along.run(initial, read, start, times, most_steps).states
