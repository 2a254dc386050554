"""Lanes that carry the neighbours of a family's members, and distances between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.heyoka_expressions import TANGENT
from rigidsim.model.state_blocks import AttitudeStates
from rigidsim.solve.batch.lanes import BatchEngine, BatchSystem
from rigidsim.solve.batch.tracing import TracedSystem
from rigidsim.solve.compiled import compiled_function

_LANES = 8
"""Least number of lanes, two members': with vectors of four, a step of eight takes 1.6 times one of four."""
_PADDED = 64  # columns of a compiled function, so that their bits don't depend on their place
_GROUPS = {
    "rates": ("wx", "wy", "wz"),
    "position": ("x", "y", "z"),
    "velocity": ("vx", "vy", "vz"),
}
_APART = ("pace", "work", "stride")
"""States that nothing depends on."""


class NeighbourLanes:
    """Integrators and functions for the motion alone, without its tangent vectors and events.

    Args:
        width: lanes of the batch that ran the members.
        tolerance: tolerance of their steps; None for epsilon.

    Attributes:
        places: indices of the states of each quantity ("rates", "attitude", "position", "velocity").
        felt: mask of the states that anything depends on, (states,).
        groups: (groups, states), 1 for states that are measured together.
        carried: whether an attitude is carried.
    """

    def __init__(self, traced: TracedSystem, width: int, tolerance: float | None) -> None:
        self._traced, self._width, system = traced, max(width, _LANES), traced.system
        self._moving = traced.moving
        self._rights = [hy.expression(right) for _, right in system.equations[: self._moving]]
        self._lanes = self._engine(tolerance)
        names, attitude = list(system.states[: self._moving]), system.mechanics.attitude
        self.places = {group: [names.index(n) for n in of if n in names] for group, of in _GROUPS.items()}
        self.places["attitude"] = [] if attitude is None else [names.index(n) for n in attitude.names]
        self.felt = np.array([n not in _APART and not n.startswith(TANGENT) for n in names])
        grouped = {place for places in self.places.values() for place in places}
        alone = [[n] for n in range(len(names)) if n not in grouped and self.felt[n]]
        together = [*filter(None, self.places.values()), *alone]
        self.groups = np.zeros((len(together), len(names)))
        for row, places in enumerate(together):
            self.groups[row, places] = 1.0
        self.carried = attitude is not None
        self._attitude = attitude

    # --- what is compiled -----------------------------------------------------------------------------------

    def _engine(self, tolerance: float | None) -> BatchEngine:
        rights = self._traced.as_parameters(self._rights)
        variables = self._traced.system.variables[: self._moving]
        equations = list(zip(variables, rights, strict=True))
        count, compact = len(self._traced.in_equations), self._traced.system.wide
        return BatchEngine(BatchSystem(equations, [], count, tolerance, compact), self._width)

    @cached_property
    def _slopes(self) -> Callable[..., np.ndarray]:
        return self._function(self._rights)

    @cached_property
    def _quaternion(self) -> Callable[..., np.ndarray]:
        assert self._attitude is not None
        return self._function(self._attitude.quaternion)

    def _function(self, expressions: Sequence[Any]) -> Callable[..., np.ndarray]:
        """Compiled function of states (states, n), the traced system's parameters (parameters, n) and times
        (n,).
        """
        variables = [*self._traced.system.variables[: self._moving], *self._traced.parameters.variables]
        compiled: Any = compiled_function(expressions, variables, compact_mode=True, fp_type=float)

        def evaluate(states: np.ndarray, parameters: np.ndarray, times: np.ndarray) -> np.ndarray:
            count = states.shape[1]
            padded = -(-count // _PADDED) * _PADDED
            inputs = np.empty((len(states) + len(parameters), padded))
            inputs[: len(states), :count], inputs[len(states) :, :count] = states, parameters
            inputs[:, count:] = inputs[:, count - 1 : count]
            options = {}
            if compiled.is_time_dependent:
                options["time"] = np.concatenate([times, np.full(padded - count, times[-1])])
            return np.asarray(compiled(inputs, **options))[:, :count]

        return evaluate

    # --- what they tell -------------------------------------------------------------------------------------

    def slopes(self, states: np.ndarray, parameters: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Derivatives of states, (states, n)."""
        return self._slopes(states, parameters, times)

    def angles(self, states: np.ndarray, apart: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Angles (n,), rad, between the attitudes of states (states, n) and of nearby states.

        A quaternion's chord is half the angle; nine direction cosines differ by its sqrt(2)-fold; a planar
        motion has the angle itself.
        """
        attitude: AttitudeStates | None = self._attitude
        if attitude is None:
            return np.zeros(states.shape[1])
        if attitude.orbital is None and attitude.chord is not None:
            chords = np.sqrt((apart[self.places["attitude"]] ** 2).sum(axis=0))
            return np.asarray(attitude.chord * chords)
        # all at one time: a frame that turns with time doesn't change their distances
        nothing = np.zeros(states.shape[1])
        here, there = (self._quaternion(x, parameters, nothing) for x in (states, states + apart))
        return np.asarray(2.0 * np.sqrt(((there - here) ** 2).sum(axis=0)))

    # --- what they do ---------------------------------------------------------------------------------------

    def longest(self, initial: np.ndarray, parameters: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Bounds of the steps of motions from their starts, (n,)."""
        return self._lanes.longest(initial, parameters[self._traced.in_equations], start)

    def onward(
        self,
        states: np.ndarray,
        parameters: np.ndarray,
        begin: np.ndarray,
        end: np.ndarray,
        longest: np.ndarray,
        most: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """States (states, n) and times (n,) of lanes after so many steps, or at their ends.

        Args:
            longest: bounds of steps, (n,).
            most: largest number of steps of each, (n,).
        """
        found, times = np.empty_like(states), np.empty_like(begin)
        read = parameters[self._traced.in_equations]

        def go(some: np.ndarray, steps: int) -> None:
            found[:, some], times[some] = self._lanes.onward(
                states[:, some], read[:, some], begin[some], end[some], longest[some], steps
            )

        for steps in np.unique(most).tolist():
            alike = np.flatnonzero(most == steps)
            go(alike, steps)
            lost = ~np.isfinite(found[:, alike]).all(axis=0)
            for group in np.unique(np.flatnonzero(lost) // self._width).tolist():
                # heyoka stops all lanes if the state of one is lost
                for lane in alike[group * self._width : (group + 1) * self._width].tolist():
                    go(np.array([lane]), steps)
        return found, times

    def again(
        self, initial: np.ndarray, parameters: np.ndarray, begin: np.ndarray, times: np.ndarray, most: int
    ) -> np.ndarray:
        """States (samples, states, n) of motions at their samples, nan from where a motion ended.

        Args:
            initial: (states, n); begin: (n,), times: (samples, n), internal units.
            most: largest number of steps of each.
        """
        read = parameters[self._traced.in_equations]
        return self._lanes.run(initial, read, begin, times, most).states
