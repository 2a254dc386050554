"""Steps whose equations see the time in two numbers: the second is a parameter, set before each step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import heyoka as hy

from rigidsim.model.system import System
from rigidsim.solve.engine import TaylorEngine
from rigidsim.solve.events import EventLog
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.taylor_stepper import CHUNK_TO, MOST_CHUNKS_TO, TaylorStepper, Watcher


class SecondNumber:
    """Watcher that hands the second number of the time to the equations, and each step to another watcher."""

    def __init__(self, place: int, other: Watcher | None = None) -> None:
        self._place, self._other = place, other

    def begin(self, time: Scalar) -> None:
        """See ``Watcher``."""

    def __call__(self, integrator: TaylorEngine) -> bool:
        """See ``Watcher``."""
        integrator.pars[self._place] = integrator.dtime[1]
        return True if self._other is None else self._other(integrator)


def propagation(system: System) -> Callable[[Any, Any, int], Any]:
    """``propagate_until`` for engines, single or batch, of a system that may need both numbers of the time: a
    function of the engine, the time or times, and the most steps.
    """
    each = SecondNumber(system.parameters - 1) if system.clocked and not system.switches else None

    def propagate(integrator: Any, until: Any, most: int) -> Any:
        if each is None:
            return integrator.propagate_until(until, max_steps=most)
        each(integrator)
        return integrator.propagate_until(until, max_steps=most, callback=each)

    return propagate


class ClockedStepper(TaylorStepper):
    """Stepper of a system in which something happens at a moment late in the run, within a short while."""

    def __init__(
        self,
        system: System,
        precision: Precision,
        tolerance: Scalar | None,
        start: Scalar,
        log: EventLog | None = None,
    ) -> None:
        self._place = system.parameters - 1
        super().__init__(system, precision, tolerance, start, log)

    def _watched(self) -> Watcher | None:
        other = super()._watched()
        self._tell()
        return SecondNumber(self._place, other)

    def _tell(self) -> None:
        self._integrator.pars[self._place] = self._integrator.dtime[1]

    def step(self) -> bool:
        """See ``Stepper``."""
        self._tell()
        return super().step()

    def to_whole_time(self) -> bool:
        """See ``Stepper``."""
        self._tell()
        return super().to_whole_time()

    def to(self, time: float) -> bool:
        """See ``Stepper``."""
        self._tell()
        engine, each = self._integrator, SecondNumber(self._place)
        for _ in range(MOST_CHUNKS_TO):
            outcome = engine.propagate_until(
                time, max_steps=CHUNK_TO, max_delta_t=self._longest, callback=each
            )[0]
            if outcome != hy.taylor_outcome.step_limit:
                break
        return bool(outcome == hy.taylor_outcome.time_limit)
