"""Interfaces of whatever takes a run through its samples: progress, checks and receiver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rigidsim.solve.checkpoint import Position
from rigidsim.solve.corrected_stepper import StepBoundary
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.status import Status


@dataclass
class Progress:
    """Progress of a run; its one mutable record.

    Attributes:
        samples: total number of samples.
        next_sample: index of the first sample that isn't handed over yet.
        steps: natural steps taken.
        time: time that the integration has reached, s.
        smallest_step, largest_step: extremes of the natural steps so far, internal units.
        redone_steps: steps taken back because they went past a sample.
        integration_seconds: wall time in the engine, without recording.
        last_good: last step boundary with a finite state, for a run that broke down.
        detail: why it broke down, if more is known.
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
        """Fraction of the samples that are recorded."""
        return self.next_sample / self.samples


Check = Callable[[Progress], Status | None]
"""Checks guards and interruptions between chunks; a status ends the run."""


States = Callable[[np.ndarray], np.ndarray]
"""Function from sample times (n,) to states (n, states), both in internal units."""


@dataclass(frozen=True)
class Reach:
    """Steps just taken whose samples are still to be taken: one step can hold any number of them.

    Attributes:
        boundary: boundary before the steps.
        states: their dense output.
    """

    boundary: StepBoundary
    states: States


class SampleReceiver(Protocol):
    """Receives samples in order, and is told when they can be saved; the base class never asks for that.

    Attributes:
        last_wanted: index of a sample that ends the run by the guard ``max_drift``; later ones weren't taken.
        rows_together: samples are saved at the least cost in multiples of so many.
    """

    last_wanted: int | None = None
    rows_together: int = 1

    def take(self, block: SampleBlock) -> None:
        """Take the samples that follow those taken before."""

    def due(self) -> bool:
        """Whether it is time to save."""
        return False

    def save(self, position: Position) -> None:
        """Save everything taken so far, and the position to resume from."""
        return None


class Sampler(Protocol):
    """Takes a run from its present state to its last sample (``rigidsim.solve.assembly.sampler``)."""

    progress: Progress

    def run(self) -> Progress:
        """Continue until the last sample is handed over, or a check or the motion itself ends the run."""

    def position(self) -> Position:
        """Position to continue from, at a moment when every sample found was handed over."""
