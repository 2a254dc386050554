"""Events of a family: expressions that the batch engine watches, with parameters that differ between members.

As in a single run an expression is given a unit in which it is of order one, and is taken off a zero that the
motion begins at (``rigidsim.solve.events``). Both depend on the member, so that they are parameters.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.solve.batch.tracing import TracedSystem
from rigidsim.solve.compiled import compiled_function
from rigidsim.solve.events import BESIDE, STATES, TIMES, exponents_of

_BITS = 53


class EventExpressions:
    """Events of a family, with their parameters.

    Attributes:
        parameters: number of parameters besides those shared with the equations.
    """

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
        """Parameters of the events, (2 * events, members).

        Args:
            initial: motion's states, (states, members); swept: (parameters, members); start, end: (members,),
                internal units.
        """
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
