"""How much is done at once: between two looks at guards and Ctrl-C, and in one block of samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


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
