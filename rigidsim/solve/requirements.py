"""What equations need set before steps, wherever they are integrated: in a run as well as beside it.

Each depends on the boundary alone where steps begin, so that a checkpoint needs to know nothing of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from rigidsim.model.system import System
from rigidsim.solve.compiled import TaylorEngine
from rigidsim.solve.precision import Scalar


class Requirement(Protocol):
    """Something to be set before steps.

    Attributes:
        each: whether before each single step, rather than before several that are taken at once.
    """

    each: bool

    def meet(self, integrator: TaylorEngine) -> Scalar | None:
        """Set it where the integrator is; returns the time beyond which no step may go, None for any."""

    def end_after(self, time: Scalar) -> Scalar | None:
        """That time, for steps that begin at a time."""


def requirement_of(system: System) -> Requirement | None:
    """What a system's equations need; None if nothing, or if they switch and see to it themselves."""
    if system.pieces is not None:
        return SetAtKnots(system)
    return SecondNumber(system.parameters - 1) if system.clocked and not system.switches else None


class SetAtKnots:
    """Parameters and states set where pieces of the equations begin, and steps end: at rows of tables, say.
    Any number of times gives the same bits.
    """

    each = False

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
        """See ``Requirement``."""
        pieces, number = self.pieces, self.enter(integrator)
        if self._entered != (number, id(integrator)):
            integrator.pars[:] = pieces.parameters(number)
            self._entered = (number, id(integrator))
        return self._end(number)

    def end_after(self, time: Scalar) -> Scalar | None:
        """See ``Requirement``."""
        return self._end(self.pieces.number_at(time))

    def _end(self, number: int) -> Scalar | None:
        knots = self.pieces.knots
        return knots[number] if number < len(knots) else None


class SecondNumber:
    """The second number of the time, where something happens late in the run, within a short while."""

    each = True

    def __init__(self, place: int) -> None:
        self._place = place

    def meet(self, integrator: TaylorEngine) -> None:
        integrator.pars[self._place] = integrator.dtime[1]

    def end_after(self, time: Scalar) -> None:
        """See ``Requirement``."""


def after_each_step(
    requirement: Requirement | None, *watchers: Callable[[TaylorEngine], bool] | None
) -> Callable[[TaylorEngine], bool] | None:
    """What to call after each of many steps: the watchers, and before them what the next step needs."""
    calls = [watcher for watcher in watchers if watcher is not None]
    if requirement is None or not requirement.each:
        if len(calls) < 2:
            return calls[0] if calls else None
        return lambda integrator: _all(integrator, calls)

    def after(integrator: TaylorEngine) -> bool:
        requirement.meet(integrator)
        return _all(integrator, calls)

    return after


def _all(integrator: TaylorEngine, calls: list[Callable[[TaylorEngine], bool]]) -> bool:
    """Whether all want to go on; all are called in any case."""
    going = True
    for call in calls:
        going = call(integrator) and going
    return going


def propagation(system: System) -> Callable[[Any, Any, int], Any]:
    """``propagate_until`` of single or batch engines of a system without tables: to times, by most steps."""
    requirement = requirement_of(system)

    def propagate(integrator: Any, until: Any, most: int) -> Any:
        if requirement is None:
            return integrator.propagate_until(until, max_steps=most)
        requirement.meet(integrator)
        after = after_each_step(requirement)
        return integrator.propagate_until(until, max_steps=most, callback=after)

    return propagate
