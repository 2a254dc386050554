"""Crossings found along the way: their times and states in the run's own precision.

heyoka finds them on the dense output of each step. Their expressions take part in its choice of steps, so
that a run with events differs from one without by rounding. A step that is taken back takes its crossings
with it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.errors import StoppedError
from rigidsim.model.system import System
from rigidsim.solve.precision import Precision

MOST_EVENTS = 1_000_000
_DIRECTIONS = {
    0: hy.event_direction.any,
    1: hy.event_direction.positive,
    -1: hy.event_direction.negative,
}


@dataclass(frozen=True)
class Found:
    """One crossing: which, when (internal units), the state there, full turns of the angle states."""

    index: int
    time: Any
    state: np.ndarray
    turns: np.ndarray


@dataclass
class EventLog:
    """All crossings so far, in the order of time.

    Attributes:
        turns: full turns of the angle states, kept up to date by the winding that owns the array.
        stop: time of the first crossing that ends the run, or None.
    """

    stops: list[bool]
    turns: np.ndarray
    found: list[Found] = field(default_factory=list)
    stop: Any | None = None

    def note(self, index: int, time: Any, state: np.ndarray) -> None:
        """Take a crossing from the engine."""
        if len(self.found) >= MOST_EVENTS:
            raise StoppedError(
                f"more than {MOST_EVENTS} events; give them a direction, or an expression that crosses less"
            )
        if self.stop is not None and time > self.stop:
            return
        self.found.append(Found(index, time, np.array(state), self.turns.copy()))
        if self.stops[index] and self.stop is None:
            self.stop = time

    def back_to(self, count: int) -> None:
        """Forget all but the first ``count``.

        Raises:
            ValueError: they are fewer.
        """
        if count > len(self.found):
            raise ValueError(f"{len(self.found)} events are known, not {count}")
        del self.found[count:]
        self.stop = next((f.time for f in self.found if self.stops[f.index]), None)


def engine_events(system: System, precision: Precision, log: EventLog) -> list[Any]:
    """heyoka's events for a system's crossings."""

    def callback(index: int) -> Any:
        def called(integrator: Any, time: Any, _: int) -> None:
            log.note(index, time, integrator.update_d_output(time))

        return called

    return [
        hy.nt_event(c.expression, callback(i), direction=_DIRECTIONS[c.direction], fp_type=precision.scalar)
        for i, c in enumerate(system.crossings)
    ]
