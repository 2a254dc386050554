"""Lanes of batches that carry a family's members, and the perturbed motions beside them."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.solve.batch.lanes import BatchEngine, BatchSystem
from rigidsim.solve.batch.tracing import TracedSystem
from rigidsim.solve.shadow.ensemble import EnsembleCarrier
from rigidsim.solve.shadow.measures import Starts, padded_function

_LANES = 8
"""Least number of lanes: with vectors of four, a step of eight takes 1.6 times one of four."""


class ShadowLanes:
    """Batch integrator of the motion alone, as wide as the members' or wider; no tolerance is epsilon."""

    def __init__(self, traced: TracedSystem, width: int, tolerance: float | None) -> None:
        self.tolerance, self._traced, moving = tolerance, traced, traced.moving
        self._variables = traced.system.variables[:moving]
        self._rights = [hy.expression(right) for _, right in traced.system.equations[:moving]]
        equations = list(zip(self._variables, traced.as_parameters(self._rights), strict=True))
        system = BatchSystem(equations, [], tolerance, traced.system.wide)
        self.engine = BatchEngine(system, max(width, _LANES))

    @cached_property
    def slopes(self) -> Any:
        """Function of states (states, n), the traced system's parameters (parameters, n) and times (n,)."""
        return padded_function(self._rights, [*self._variables, *self._traced.parameters.variables])

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
