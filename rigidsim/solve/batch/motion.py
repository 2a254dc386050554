"""Members' motions with their events, tangent vectors beside them, and the lanes of perturbed motions.

As in a single run an event's expression is given a unit in which it is of order one, and is taken off a zero
that the motion begins at (``rigidsim.solve.events``). Both depend on the member, so that they are parameters.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.solve.batch.lanes import BatchEngine, BatchSystem, LaneResults
from rigidsim.solve.batch.tracing import TracedSystem
from rigidsim.solve.compiled import compiled_function, evaluate_rows
from rigidsim.solve.events import BESIDE, STATES, TIMES, exponents_of
from rigidsim.solve.shadow.ensemble import EnsembleCarrier
from rigidsim.solve.shadow.measures import Starts, padded_function

_BITS = 53
_LANES = 8
"""Least number of lanes of perturbed motions: a step of eight in vectors of four costs 1.6 of one of four."""


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


class ShadowLanes:
    """Batch integrator of the motion alone, as wide as the members' or wider; no tolerance is epsilon."""

    def __init__(self, traced: TracedSystem, width: int, tolerance: float | None) -> None:
        self.tolerance, self._traced = tolerance, traced
        self.engine = _engine(traced, traced.moving, max(width, _LANES), tolerance)

    @cached_property
    def slopes(self) -> Any:
        """Function of states (states, n), the traced system's parameters (parameters, n) and times (n,)."""
        system, moving = self._traced.system, self._traced.moving
        rights = [hy.expression(right) for _, right in system.equations[:moving]]
        return padded_function(rights, [*system.variables[:moving], *self._traced.parameters.variables])

    def read(self, starts: Starts) -> np.ndarray:
        """Parameters of the equations, (read, motions)."""
        return starts.parameters[self._traced.in_equations]

    def longest(self, starts: Starts) -> np.ndarray:
        """Bounds of the steps of motions from their starts, (motions,)."""
        return self.engine.longest(starts.states, self.read(starts), starts.begin)

    def at_samples(self, starts: Starts, times: np.ndarray, most: int) -> np.ndarray:
        """States (samples, states, motions) at times (samples, motions), nan from where a motion ended."""
        return self.engine.run(starts.states, self.read(starts), starts.begin, times, most).states


class MemberCarrier:
    """Carrier of members, all of whose stretches of as many steps go together (see ``EnsembleCarrier``)."""

    def __init__(self, lanes: ShadowLanes, starts: Starts) -> None:
        self.tolerance, self._lanes = lanes.tolerance, lanes
        self._every, self._read, self._longest = starts.parameters, lanes.read(starts), lanes.longest(starts)

    def again(self, steps: float) -> EnsembleCarrier:
        """See ``EnsembleCarrier``."""
        return self

    def advance(
        self, which: np.ndarray, states: np.ndarray, begin: np.ndarray, end: np.ndarray, steps: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See ``EnsembleCarrier``: lanes arrive at slightly different times, which the equations even out."""
        beside = begin.shape[1]
        found, times, taken = np.empty_like(states), np.empty_like(begin), np.empty_like(begin)
        for stride in np.unique(steps).tolist():
            alike = np.flatnonzero(steps == stride)
            motions = which[alike]
            there, then, gone = self._lanes.engine.onward(
                int(stride),
                states[:, alike].reshape(len(states), -1),
                np.repeat(self._read[:, motions], beside, axis=1),
                begin[alike].ravel(),
                end[alike].ravel(),
                np.repeat(self._longest[motions], beside),
            )
            found[:, alike] = there.reshape(len(states), -1, beside)
            times[alike], taken[alike] = then.reshape(-1, beside), gone.reshape(-1, beside)
        reached = times[:, 0].copy()
        early = (times - begin) - (reached - begin[:, 0])[:, None]
        slopes = self._lanes.slopes(found[:, :, 0], self._every[:, which], reached)
        found[:, :, 1:] -= slopes[:, :, None] * early[:, 1:]
        return found, taken[:, 0], reached
