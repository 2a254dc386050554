"""How engines of shadows go on: freely, or through pieces of the equations, as a kernel's blocks are.

Motions that an engine carries side by side enter a piece together, each at the time of its own that is the
edge's: whose clock is late, sees what is set there late. Where a stretch ends within few steps of an edge, it
goes on to that: nearly all steps that begin at an edge are of full length, as those are that stand for many.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.orbits.pieces import Pieces
from rigidsim.model.system import System
from rigidsim.solve.compiled import TaylorEngine
from rigidsim.solve.requirements import propagation
from rigidsim.solve.shadow.ensemble import HOPELESS_STEPS

_ARRIVED, _STOPPED = hy.taylor_outcome.time_limit, hy.taylor_outcome.step_limit
_TO_EDGE = 3
"""Steps that may still be taken to an edge. Half as many as ``_FEW_STEPS`` of the carriers at most: stretches
are halved until they are so short.
"""

Went = tuple[Any, float, float, int]
"""How the first motion ended, its shortest and longest step of those not cut short, and how many it took."""
Onward = Callable[[TaylorEngine, float, float, Any, int], Went]
"""Takes an engine on from where it is: from the begin to the end of the first motion, with the ends of all
that it carries, by at most so many steps of the first.
"""


def onward(system: System, states: Sequence[str]) -> Onward:
    """The way for single and batch engines that carry some of a system's states."""
    if system.pieces is not None:
        return ThroughPieces(system.pieces, states).go
    freely = propagation(system)

    def go(engine: TaylorEngine, begin: float, end: float, until: Any, most: int) -> Went:
        found = freely(engine, until.tolist() if isinstance(until, np.ndarray) else until, most)
        return tuple((engine.propagate_res[0] if _side_by_side(engine) else found)[:4])

    return go


class ThroughPieces:
    """Equations with pieces, whose parameters and states are set for all motions that an engine carries."""

    def __init__(self, pieces: Pieces, states: Sequence[str]) -> None:
        self._pieces = pieces
        self._places = {name: place for place, name in enumerate(states)}

    def number_at(self, time: float) -> int:
        """Number of the piece that begins at or contains a time."""
        return self._pieces.number_at(time)

    def set(self, engine: TaylorEngine, number: int) -> float:
        """Set the parameters of a piece; returns its end."""
        engine.pars.T[...] = np.array(self._pieces.parameters(number), dtype=engine.pars.dtype)
        knots = self._pieces.knots
        return float(knots[number]) if number < len(knots) else math.inf

    def at(self, engine: TaylorEngine, time: float) -> float:
        """The same for the piece that begins at or contains a time."""
        return self.set(engine, self.number_at(time))

    def enter(self, state: np.ndarray, number: int) -> None:
        """Set the states with which a piece begins, (states, ...)."""
        for name, value in self._pieces.states(number).items():
            state[self._places[name]] = value

    def leave(self, state: np.ndarray, number: int, before: np.ndarray) -> None:
        """Go back to the states with which the piece before it ended."""
        for name in self._pieces.states(number):
            state[self._places[name]] = before[self._places[name]]

    def beginning(self, state: np.ndarray, time: float, rounding: float) -> float:
        """Set a state that is at an edge, by a time with some rounding, as the piece begins there; returns
        the edge's time, or the given one elsewhere.
        """
        knots = self._pieces.knots
        number = self._pieces.number_at(time + rounding)
        if not number or float(knots[number - 1]) < time - rounding:
            return time
        self.enter(state, number)
        return float(knots[number - 1])

    def go(self, engine: TaylorEngine, begin: float, end: float, until: Any, most: int) -> Went:
        """See ``Onward``."""
        number, taken, shortest, longest = self._pieces.number_at(begin), 0, math.inf, 0.0
        while True:
            edge = self.set(engine, number)
            within = end < edge
            outcome, low, high, steps = self._to(engine, until if within else edge, most - taken)
            taken, shortest, longest = taken + steps, min(shortest, low), max(longest, high)
            if outcome == _STOPPED and not within and edge - _first(engine) <= _TO_EDGE * high:
                outcome, low, high, steps = self._to(engine, edge, _TO_EDGE)
                taken, shortest, longest = taken + steps, min(shortest, low), max(longest, high)
            if within or outcome != _ARRIVED:
                return outcome, shortest, longest, taken
            number += 1
            engine.set_time(edge) if _side_by_side(engine) else setattr(engine, "time", edge)
            self.enter(engine.state, number)
            if taken >= most or end == edge:
                self.set(engine, number)
                outcome, *_ = self._to(engine, until - end + edge, HOPELESS_STEPS)
                return outcome if end == edge else _STOPPED, shortest, longest, taken

    @staticmethod
    def _to(engine: TaylorEngine, until: Any, most: int) -> Went:
        """Go to times within a piece; motions beside the first are lost if they can't follow it."""
        until = until.tolist() if isinstance(until, np.ndarray) else until
        if not _side_by_side(engine):
            return tuple(engine.propagate_until(until, max_steps=most)[:4])
        engine.propagate_until(until, max_steps=most)
        found = engine.propagate_res[0]
        if found[0] == _ARRIVED and any(result[0] != _ARRIVED for result in engine.propagate_res):
            engine.propagate_until(until, max_steps=HOPELESS_STEPS)
            if any(result[0] != _ARRIVED for result in engine.propagate_res):
                engine.state[:] = np.nan
        return tuple(found)


def _side_by_side(engine: TaylorEngine) -> bool:
    return bool(engine.state.ndim == 2)


def _first(engine: TaylorEngine) -> float:
    """Time of the first motion."""
    return float(np.ravel(engine.time)[0])
