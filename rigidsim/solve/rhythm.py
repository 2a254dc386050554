"""What is done to the state at fixed counts of natural steps, so that bits depend on no clock or sampling.

A step is never clamped to a sample, but some corrections have to be made as a run goes on: angles are brought
back into one turn, and the engine's time, which is a sum of two numbers, is put back on a single one. They
happen at fixed counts of natural steps: on whichever path a run goes through these counts, skipping,
recording or resumed, it does the same there. A chart of Euler angles is changed at the first step boundary
whose state asks for it, likewise.

That time is a single number at each stride's start is what lets whole strides be recorded by the engine's own
grid output, which starts at such a time only. The move back to it is a step of some 1e-16 of the time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidsim.solve.charts import Charts
from rigidsim.solve.hold import Holder
from rigidsim.solve.stepper import Mark, Stepper
from rigidsim.solve.winding import INTERVAL, Winding

STRIDE = 1024
"""Natural steps between two corrections where only time is corrected: half a millisecond, so that the calls
that this takes cost less than a hundredth."""

_NOTHING = np.zeros(0)


@dataclass(frozen=True)
class Place:
    """A step boundary of a run: the engine's mark and what the corrections remember.

    Attributes:
        memories: copies of ``Rhythm.memories``.
    """

    mark: Mark
    memories: dict[str, np.ndarray]

    @property
    def turns(self) -> np.ndarray:
        """Full turns of the angle states."""
        return self.memories["turns"]


class Rhythm:
    """Takes steps and makes the corrections when they are due.

    Attributes:
        holder: puts invariants back, where asked for.
        stride: natural steps between corrections.
        whole_times: whether time is a single number at each stride's start. Not where events are looked
            for: a step back could cross one twice.
        memories: arrays that the corrections change in place, by name.
        charts: of a run in Euler angles; None without.
    """

    def __init__(
        self, stepper: Stepper, winding: Winding, holder: Holder | None = None, *, held_every: int = STRIDE
    ) -> None:
        self.stepper = stepper
        self.winding = winding
        self.holder = holder
        self.stride = INTERVAL if winding.positions else STRIDE
        if holder is not None:
            self.stride = min(self.stride, held_every)
        self.whole_times = not stepper.has_events
        self.memories: dict[str, np.ndarray] = {"turns": winding.turns}
        self.charts: Charts | None = None
        system = stepper.system
        if system.partner is not None:
            self.charts = stepper.watcher = Charts(system, system.partner, stepper.precision, winding.turns)
            self.memories["chart_changes"] = self.charts.changes
            if self.charts.near(stepper.state):  # no change on the way: it begins there
                self._change_chart(self.charts)
                self.charts.changes[:] = 0
        if holder is not None:
            self.memories["held"] = holder.memory

    @property
    def left(self) -> int:
        """Steps until the next corrections, at least 1."""
        return self.stride - self.stepper.steps % self.stride

    def place(self) -> Place:
        """Remember this boundary."""
        return Place(self.stepper.mark(), {name: array.copy() for name, array in self.memories.items()})

    def back_to(self, place: Place) -> None:
        """Return to a boundary."""
        for name, array in self.memories.items():
            array[...] = place.memories[name]
        if self.charts is not None:
            self.stepper.use(self.charts.chart)
            if self.holder is not None:
                self.holder.use(self.charts.chart)
        self.stepper.back_to(place.mark)

    def skip(self, count: int) -> bool:
        """``count`` steps without dense output; False when the state is no longer finite."""
        while count > 0:
            before = self.stepper.steps
            if not self.stepper.skip(min(count, self.left)):
                return False
            count -= self.stepper.steps - before
            self.correct()
        return True

    def rows(self, times: np.ndarray) -> np.ndarray:
        """The row of turns that belongs to each sample of the latest call's steps, before corrections."""
        if self.charts is not None:
            return self.charts.rows(times)
        return np.tile(self.winding.turns, (len(times), 1))

    @property
    def put_back(self) -> np.ndarray:
        """What was put back of each held scalar so far, (held scalars,); corrections are made after the rows
        of a call are taken, so that a sample has those of all corrections before its own step.
        """
        return _NOTHING if self.holder is None else self.holder.corrections

    def correct(self) -> None:
        """Make the corrections if they are due; dense output of the latest step is void then."""
        change = self.charts is not None and self.charts.near(self.stepper.state)
        due = self.stepper.steps % self.stride == 0
        if not (due or change):
            return
        if self.whole_times:
            self.stepper.to_whole_time()
        if due and self.winding.positions:
            self.winding.wrap(self.stepper.state)
        if due and self.holder is not None:
            self.holder.project(self.stepper.state, self.stepper.time)
        if change and self.charts is not None:
            self._change_chart(self.charts)

    def _change_chart(self, charts: Charts) -> None:
        state = charts.change(self.stepper.state)
        self.stepper.use(charts.chart)
        if self.holder is not None:
            self.holder.use(charts.chart)
        self.stepper.state[:] = state
