"""What takes a run through its samples, seen from outside: its progress, its checks and its receiver."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from rigidsim.scene.records import dataclass
from rigidsim.solve.checkpoint import Position
from rigidsim.solve.corrected_stepper import StepBoundary
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.status import Status


@dataclass
class Progress:
    """How far a run is; the one mutable record of it.

    Attributes:
        samples: their number.
        next_sample: index of the first sample that isn't handed over yet.
        steps: natural steps taken.
        time: where the integration stands, seconds.
        smallest_step, largest_step: of the natural steps so far, internal units.
        redone_steps: taken back since they went past a sample.
        integration_seconds: wall time in the engine, without recording.
        last_good: a step boundary whose state is finite, for a run that broke down.
        detail: why it did, where more is known.
    """

    samples: int
    next_sample: int = 0
    steps: int = 0
    time: float = 0.0
    smallest_step: float = float("inf")
    largest_step: float = 0.0
    redone_steps: int = 0
    status: Status = Status.RUNNING
    integration_seconds: float = 0.0
    last_good: StepBoundary | None = None
    detail: str = ""

    @property
    def fraction(self) -> float:
        """Of the samples that are recorded."""
        return self.next_sample / self.samples


Check = Callable[[Progress], Status | None]
"""Looks at guards and interruptions between chunks; a status ends the run."""


States = Callable[[np.ndarray], np.ndarray]
"""From sample times (n,) to states (n, states), both in internal units."""


@dataclass(frozen=True)
class Reach:
    """Steps just taken, whose samples are still to be taken: in one step there can be any number of them.

    Attributes:
        boundary: before the steps.
        states: their dense output.
    """

    boundary: StepBoundary
    states: States


class SampleReceiver(Protocol):
    """Takes samples in order, and is told when what it took can be saved; by itself it is never due.

    Attributes:
        last_wanted: index of a sample that ends the run by the guard ``max_drift``; those after it were left.
        rows_together: samples are saved at the least cost after a multiple of so many.
    """

    last_wanted: int | None = None
    rows_together: int = 1

    def take(self, block: SampleBlock) -> None:
        """The samples that follow those taken before."""

    def due(self) -> bool:
        """Whether it is time to save."""
        return False

    def save(self, position: Position) -> None:
        """Save everything taken so far, and where to resume."""
        return None


class Sampler(Protocol):
    """Takes a run from where it stands to its last sample (``rigidsim.solve.assembly.sampler``)."""

    progress: Progress

    def run(self) -> Progress:
        """Go on until the last sample is handed over, or a check or the motion itself ends the run."""

    def position(self) -> Position:
        """Where to go on, at a moment when every sample found was handed over."""
