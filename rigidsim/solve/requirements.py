"""What equations need set before steps, wherever they are integrated: in a run as well as next to it.

Each depends on the boundary alone where steps begin, so that a checkpoint needs to know nothing of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rigidsim.model.system import System
from rigidsim.solve.compiled import TaylorEngine
from rigidsim.solve.precision import Scalar


class Requirement:
    """Something to be set before steps; by default nothing.

    Attributes:
        each: what to call after each of several steps that are taken at once, for the next.
    """

    each: tuple[Callable[[TaylorEngine], bool], ...] = ()

    def meet(self, integrator: TaylorEngine) -> Scalar | None:
        """Set it where the integrator is; returns the time beyond which no step may go, None for any."""
        return None

    def end_after(self, time: Scalar) -> Scalar | None:
        """That time, for steps that begin at a time."""
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
    """

    def __init__(self, system: System) -> None:
        assert system.pieces is not None
        self.pieces = system.pieces
        self._places = {name: place for place, name in enumerate(system.states)}
        self._entered: tuple[int, int] | None = None

    def enter(self, integrator: TaylorEngine) -> int:
        """Continue in the states of the piece that begins at this boundary, or contains it: its number."""
        pieces = self.pieces
        high, low = integrator.dtime
        number = pieces.number_at(high)
        if number and high == pieces.knots[number - 1]:
            if low != 0:
                integrator.dtime = (high, high * 0)
            state = integrator.state
            for name, value in pieces.states(number).items():
                state[self._places[name]] = value
        return number

    def meet(self, integrator: TaylorEngine) -> Scalar | None:
        number = self.enter(integrator)
        if self._entered != (number, id(integrator)):
            integrator.pars[:] = self.pieces.parameters(number)
            self._entered = (number, id(integrator))
        return self._end(number)

    def end_after(self, time: Scalar) -> Scalar | None:
        return self._end(self.pieces.number_at(time))

    def _end(self, number: int) -> Scalar | None:
        knots = self.pieces.knots
        return knots[number] if number < len(knots) else None


class SecondNumber(Requirement):
    """The second number of the time, where something happens late in the run, within a short while."""

    def __init__(self, place: int) -> None:
        self._place, self.each = place, (self._set,)

    def _set(self, integrator: TaylorEngine) -> bool:
        integrator.pars[self._place] = integrator.dtime[1]
        return True

    def meet(self, integrator: TaylorEngine) -> None:
        self._set(integrator)


def propagation(system: System) -> Callable[[Any, Any, int], Any]:
    """``propagate_until`` of single or batch engines of a system without tables: to times, by most steps."""
    requirement = requirement_of(system)

    def propagate(integrator: Any, until: Any, most: int) -> Any:
        requirement.meet(integrator)
        return integrator.propagate_until(until, max_steps=most, callback=list(requirement.each) or None)

    return propagate
