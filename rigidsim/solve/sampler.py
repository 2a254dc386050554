"""What goes between a driver and its run: progress, checks, and the receiver of samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

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
