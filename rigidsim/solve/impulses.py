"""When velocities change at once along a motion, and to what."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.compiled import compiled_function
from rigidsim.solve.precision import Precision, Scalar


class Due(NamedTuple):
    """A change that is to happen before the next step, by its events."""

    time: Scalar
    events: Sequence[int]


class Impulses:
    """A system's impulses: of those at given times, the ones after its start."""

    def __init__(self, system: System, precision: Precision) -> None:
        self._precision = precision
        later = [kick for kick in system.kicks if kick.time is not None and kick.time > system.start]
        self._events = sorted(later, key=lambda kick: kick.time)
        self._times = [precision.number(kick.time) for kick in self._events]

    def after(self, time: Scalar) -> Due | None:
        """The next one of a given time after a time; None after the last."""
        place = bisect_right(self._times, time)
        return self.at(self._times[place]) if place < len(self._times) else None

    def at(self, time: Scalar) -> Due | None:
        """The one of a given time that is exactly a time."""
        events = self._events[bisect_left(self._times, time) : bisect_right(self._times, time)]
        return Due(time, [kick.index for kick in events]) if events else None

    def changed(self, system: System, due: Due, state: np.ndarray) -> np.ndarray:
        """A state (states,) of the system, or of its partner, after a change."""
        found = np.array(state)
        for kick in (kick for kick in system.kicks if kick.index in due.events):
            function = compiled_function(
                list(kick.states.values()), system.variables, compact_mode=True, **self._precision.options
            )
            values = function(found)
            for name, value in zip(kick.states, values, strict=True):
                found[system.states.index(name)] = value
        return found
