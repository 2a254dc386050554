"""Members' motions with their events, and tangent vectors beside them.

As in a single run an event's expression is given a unit in which it is of order one, and is taken off a zero
that the motion begins at (``rigidsim.solve.events``). Both depend on the member, so that they are parameters.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.solve.batch.tracing import TracedSystem
from rigidsim.solve.compiled import compiled_function, evaluate_rows
from rigidsim.solve.events import BESIDE, STATES, TIMES, exponents_of
from rigidsim.solve.lanes import BatchEngine, BatchSystem, LaneResults

_BITS = 53


def _engine(
    traced: TracedSystem, states: int, width: int, tolerance: Any, events: Sequence[tuple[Any, int]] = ()
) -> BatchEngine:
    """Batch integrator of the first states of a system."""
    system = traced.system
    rights = traced.as_parameters([right for _, right in system.equations[:states]])
    equations = list(zip(system.variables[:states], rights, strict=True))
    loose = None if tolerance is None else float(tolerance)
    return BatchEngine(BatchSystem(equations, list(events), loose, system.wide), width)


class BatchMotion:
    """Integrators of a traced system with its events, of ``width`` lanes.

    The motion's numbers are those of an integrator without tangent vectors: compiled with them, its equations
    may be rounded otherwise.
    """

    def __init__(self, traced: TracedSystem, width: int) -> None:
        self._traced, self._width, self._tolerance = traced, width, traced.prepared.tolerance
        self._crossings = [hy.expression(c.expression) for c in traced.system.crossings]

    @cached_property
    def _plain(self) -> BatchEngine:
        """The motion; each event has a shift and a factor as parameters after those of the equations."""
        expressions, first = self._traced.as_parameters(self._crossings), len(self._traced.in_equations)
        events = [
            ((expression + hy.par[first + 2 * n]) * hy.par[first + 2 * n + 1], crossing.direction)
            for n, (expression, crossing) in enumerate(
                zip(expressions, self._traced.system.crossings, strict=True)
            )
        ]
        return _engine(self._traced, self._traced.moving, self._width, self._tolerance, events)

    @cached_property
    def _along(self) -> BatchEngine | None:
        traced, states = self._traced, len(self._traced.system.states)
        return _engine(traced, states, self._width, self._tolerance) if states > traced.moving else None

    def compile(self) -> None:
        """Compile the integrators that ``run`` uses."""
        _ = self._plain, self._along

    def run(
        self, initial: np.ndarray, swept: np.ndarray, start: np.ndarray, times: np.ndarray, most_steps: int
    ) -> tuple[LaneResults, np.ndarray | None]:
        """Take members to their last samples, as ``BatchEngine.run``, from states with tangent vectors and
        all parameters of the traced system; returns the motion's lanes, and the states of motion and tangent
        vector (samples, states, members), None where the scene has none.
        """
        moving, read = initial[: self._traced.moving], swept[self._traced.in_equations]
        parameters = np.concatenate([read, self._of_events(moving, swept, start, times[-1])])
        motion = self._plain.run(moving, parameters, start, times, most_steps)
        if self._along is None:
            return motion, None
        return motion, self._along.run(initial, read, start, times, most_steps).states

    def _of_events(
        self, initial: np.ndarray, swept: np.ndarray, start: np.ndarray, end: np.ndarray
    ) -> np.ndarray:
        """Parameters (2 * events, members) of the events' expressions."""
        members = initial.shape[1]
        found = np.zeros((2 * len(self._crossings), members))
        if not self._crossings:
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

    @cached_property
    def _function(self) -> Any:
        moving = self._traced.system.variables[: self._traced.moving]
        variables = [*moving, *self._traced.parameters.variables]
        return compiled_function(self._crossings, variables, compact_mode=True)

    def _evaluated(self, states: np.ndarray, swept: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Values (events, members) of the events' expressions."""
        with np.errstate(all="ignore"):
            return evaluate_rows(self._function, np.concatenate([states, swept]).T, times=times)
