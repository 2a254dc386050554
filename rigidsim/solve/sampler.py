"""What goes between a driver and its run: progress, checks, the receiver of samples, and how much at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from rigidsim.solve.checkpoint import Position
from rigidsim.solve.corrected_stepper import StepBoundary
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.status import Status


@dataclass
class Progress:
    """Progress of a run; its one mutable record.

    Attributes:
        next_sample: index of the first sample that isn't handed over yet.
        time: time that the integration has reached, s.
        smallest_step, largest_step: extremes of the natural steps so far, internal units.
        redone_steps: steps taken back because they went past a sample.
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


@dataclass(frozen=True)
class Pacing:
    """Amounts; no bit depends on them. A user waits for Ctrl-C no longer than for a chunk and its hand-over.

    Attributes:
        chunk_seconds: time between checks of guards and Ctrl-C; well below the half second that a user waits.
        patience: seconds until samples of a slow run are handed over.
        rows_at_once: samples in a block that is evaluated; more are no faster, and take memory.
        rows_waiting: samples in memory before they are evaluated, however fast they come; no more than are
            evaluated in the time of a chunk.
        solver: numbers by which the solver chooses its ways; None for those that were measured.
    """

    chunk_seconds: float = 0.05
    patience: float = 2.0
    rows_at_once: int = 8192
    rows_waiting: int = 32768
    solver: Any = None


MEASURED = Pacing()
"""The defaults, which cost least where they were measured."""
