"""A checkpoint as one value: where the integration resumes, what joins the samples, and the counts so far.

``rigidsim.solve.checkpoint_arrays`` turns it into arrays for a file, and back.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from rigidsim.solve.corrected_stepper import StepBoundary
from rigidsim.solve.turns.joined import Continuity


@dataclass(frozen=True)
class Position:
    """Position from which a run continues with the same bits.

    Attributes:
        boundary: a step boundary past all samples before ``next_sample``.
        next_sample: index of the first sample that isn't handed over.
    """

    boundary: StepBoundary
    next_sample: int


@dataclass(frozen=True)
class Undefined:
    """Number of samples at which a recorded variable is NaN.

    Attributes:
        count: number of such samples so far.
        leading: how many of them precede its first defined sample.
        since: time of the first one after those (s); nan if there is none.
    """

    count: int = 0
    leading: int = 0
    since: float = math.nan


@dataclass(frozen=True)
class Statistics:
    """Counts and extremes from a run's beginning, over all its sessions.

    Attributes:
        largest_drift, final_drift: relative drifts of the samples so far, by invariant.
        put_back: corrections put back until the latest sample, by projected invariant.
        nearest_singularity, singularity_time: smallest singular factor of a chart of Euler angles, and when
            (s).
        undefined: undefined samples by recorded variable that has any.
        smallest_step, largest_step: internal units.
        redone_steps: steps taken back and repeated.
        sessions: number of sessions.
        wall_seconds, cpu_seconds, integration_seconds: time they took; the last in the engine alone.
    """

    largest_drift: dict[str, float]
    final_drift: dict[str, float]
    put_back: dict[str, float]
    nearest_singularity: float
    singularity_time: float
    smallest_step: float
    largest_step: float
    redone_steps: int
    sessions: int
    wall_seconds: float
    cpu_seconds: float
    integration_seconds: float
    undefined: Mapping[str, Undefined] = field(default_factory=dict)


@dataclass(frozen=True)
class Checkpoint:
    """Everything that a later session needs."""

    position: Position
    continuity: Continuity
    statistics: Statistics
