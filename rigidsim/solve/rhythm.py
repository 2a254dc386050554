"""What is done to the state at fixed counts of natural steps, so that bits depend on no clock or sampling.

A step is never clamped to a sample, but some corrections have to be made as a run goes on: angles are brought
back into one turn, and the engine's time, which is a sum of two numbers, is put back on a single one. They
happen at fixed counts of natural steps: on whichever path a run goes through these counts, skipping,
recording or resumed, it does the same there.

That time is a single number at each stride's start is what lets whole strides be recorded by the engine's own
grid output, which starts at such a time only. The move back to it is a step of some 1e-16 of the time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidsim.solve.stepper import Mark, Stepper
from rigidsim.solve.winding import INTERVAL, Winding

STRIDE = 1024
"""Natural steps between two corrections where only time is corrected: half a millisecond, so that the calls
that this takes cost less than a hundredth."""


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
        stride: natural steps between corrections.
        whole_times: whether time is a single number at each stride's start. Not where events are looked
            for: a step back could cross one twice.
        memories: arrays that the corrections change in place, by name.
    """

    def __init__(self, stepper: Stepper, winding: Winding) -> None:
        self.stepper = stepper
        self.winding = winding
        self.stride = INTERVAL if winding.positions else STRIDE
        self.whole_times = not stepper.has_events
        self.memories: dict[str, np.ndarray] = {"turns": winding.turns}

    @property
    def left(self) -> int:
        """Steps until the next corrections, at least 1."""
        return self.stride - self.stepper.steps % self.stride

    def place(self) -> Place:
        """Remember this boundary."""
        return Place(self.stepper.mark(), {name: array.copy() for name, array in self.memories.items()})

    def back_to(self, place: Place) -> None:
        """Return to a boundary."""
        self.stepper.back_to(place.mark)
        for name, array in self.memories.items():
            array[...] = place.memories[name]

    def skip(self, count: int) -> bool:
        """``count`` steps without dense output; False when the state is no longer finite."""
        while count > 0:
            part = min(count, self.left)
            if not self.stepper.skip(part):
                return False
            count -= part
            self.correct()
        return True

    def correct(self) -> None:
        """Make the corrections if they are due; dense output of the latest step is void then."""
        if self.stepper.steps % self.stride:
            return
        if self.whole_times:
            self.stepper.to_whole_time()
        if self.winding.positions:
            self.winding.wrap(self.stepper.state)
