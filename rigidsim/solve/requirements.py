"""What equations need set before steps, wherever they are integrated: in a run as well as next to it.

Each depends on the boundary alone where steps begin, so that a checkpoint needs to know nothing of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.compiled import TaylorEngine
from rigidsim.solve.precision import Scalar

_MOST_PIECES = 1024  # that are passed in one call

StepCallback = Callable[[TaylorEngine], bool]
"""Called after each of many steps; False ends the call."""
Far = tuple[Scalar, Scalar, StepCallback]
"""The last time of a call that takes many steps, the length of these, and what to call after each, last."""


class Requirement:
    """Something to be set before steps; by default nothing.

    Attributes:
        each: what to call after each of several steps that are taken at once, for the next.
    """

    each: tuple[StepCallback, ...] = ()

    def meet(self, integrator: TaylorEngine) -> Scalar | None:
        """Set it where the integrator is; returns the time beyond which no step may go, None for any."""
        return None

    def end_after(self, time: Scalar) -> Scalar | None:
        """That time, for steps that begin at a time."""
        return None

    def far(self, begin: tuple[Scalar, Scalar], end: Scalar, until: Scalar | None) -> Far | None:
        """How to take many steps in one call, the first from ``begin`` (two numbers) to ``end``.

        None if that isn't possible with the same bits.
        """
        return None


def requirement_of(system: System) -> Requirement:
    """What a system's equations need; nothing if they switch and see to it themselves."""
    if system.pieces is not None:
        return SetAtKnots(system)
    late = system.clocked and not system.switches
    return SecondNumber(system.parameters - 1) if late else Requirement()


class SetAtKnots(Requirement):
    """Parameters and states set where pieces of the equations begin, and steps end: at rows of tables, say.
    Any number of times gives the same bits.

    Attributes:
        places: of each series' states among the system's.
        parameters: how many there are.
    """

    def __init__(self, system: System) -> None:
        assert system.pieces is not None
        self.pieces = system.pieces
        places = ([system.states.index(name) for name in x.states] for x in self.pieces.series)
        self.places = [_slice_if_any(place) for place in places]
        self.parameters = len(self.pieces.parameters(0))
        self._entered: tuple[int, int] | None = None
        self._equal = _equal_pieces(self.pieces.knots)

    def enter(self, integrator: TaylorEngine) -> int:
        """Continue in the states of the piece that begins at this boundary, or contains it: its number."""
        pieces = self.pieces
        high, low = integrator.dtime
        number = pieces.number_at(high)
        if not number:
            return number
        knot = pieces.knots[number - 1]
        length = abs(knot) if number < 2 else max(abs(knot), knot - pieces.knots[number - 2])
        # a step that ends there may have been rounded to go some last bits beyond
        if length * 4 + (high - knot) == length * 4:
            if high != knot or low != 0:
                integrator.dtime = (knot, knot * 0)
            self._change(integrator, pieces.changes(number))
        return number

    def _change(self, integrator: TaylorEngine, changes: list[tuple[int, np.ndarray]]) -> None:
        for series, values in changes:
            integrator.state[self.places[series]] = values

    def meet(self, integrator: TaylorEngine) -> Scalar | None:
        number = self.enter(integrator)
        if self._entered != (number, id(integrator)):
            integrator.pars[:] = self.pieces.parameters(number)
            self._entered = (number, id(integrator))
        return self._end(number)

    def end_after(self, time: Scalar) -> Scalar | None:
        return self._end(self.pieces.number_at(time))

    def far(self, begin: tuple[Scalar, Scalar], end: Scalar, until: Scalar | None) -> Far | None:
        knots, number = self.pieces.knots, self.pieces.number_at(end)
        if number < 2 or begin != (knots[number - 2], 0):
            return None
        last = self.last_alike(number - 1, _MOST_PIECES)
        while last >= number and until is not None and knots[last] > until:
            last -= 1
        if last < number:
            return None

        coming, self._entered = self.pieces.following(number), None
        knot, parameters, changes = next(coming)
        views: tuple[np.ndarray, np.ndarray] | None = None

        def passed(engine: TaylorEngine) -> bool:
            """Go on in the next piece, if the step ended where it begins."""
            nonlocal knot, parameters, changes, views
            if engine.time != knot:
                return False
            views = views or (engine.pars, engine.state)
            for series, values in changes:
                views[1][self.places[series]] = values
            views[0][:] = parameters
            knot, parameters, changes = next(coming)
            return True

        return knots[last], knots[number - 1] - knots[number - 2], passed

    def last_alike(self, number: int, most: int) -> int:
        """Number of the last knot, at most so many after one, before which all pieces have exactly the length
        of the piece that ends there; a smaller one if that isn't known to be any.
        """
        return min(int(self._equal[number]), number + most) if number < len(self._equal) else number - 1

    def _end(self, number: int) -> Scalar | None:
        knots = self.pieces.knots
        return knots[number] if number < len(knots) else None


def _slice_if_any(places: list[int]) -> Any:
    """Places in a row as a slice, which numpy looks up several times as fast."""
    if places and places == list(range(places[0], places[-1] + 1)):
        return slice(places[0], places[-1] + 1)
    return np.array(places, dtype=int)


def _equal_pieces(knots: list[Any]) -> np.ndarray:
    """For each knot the last one before which all pieces have exactly the length of the one that ends here;
    empty for other types than doubles.
    """
    if not knots or not isinstance(knots[0], float):
        return np.zeros(0, dtype=int)
    lengths = np.diff(np.array([knots[0], *knots]).astype(np.longdouble))
    exact = lengths == lengths.astype(np.float64)
    changes = np.flatnonzero((lengths[1:] != lengths[:-1]) | ~exact[1:])  # after these
    ends = np.append(changes, len(knots) - 1)
    return np.asarray(ends[np.searchsorted(ends, np.arange(len(knots)))])


class SecondNumber(Requirement):
    """The second number of the time, where something happens late in the run, within a short while."""

    def __init__(self, place: int) -> None:
        self._place, self.each = place, (self._set,)

    def _set(self, integrator: TaylorEngine) -> bool:
        integrator.pars[self._place] = integrator.dtime[1]
        return True

    def meet(self, integrator: TaylorEngine) -> None:
        self._set(integrator)
