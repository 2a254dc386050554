"""A checkpoint as one value: where the integration resumes, what joins the samples, and what was counted.

``rigidsim.solve.checkpoint_arrays`` turns it into arrays for a file, and back.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field

from rigidsim.scene.records import dataclass
from rigidsim.solve.corrected_stepper import StepBoundary
from rigidsim.solve.turns.joined import Continuity


@dataclass(frozen=True)
class Position:
    """Where a run's samples go on, with the same bits.

    Attributes:
        boundary: a step boundary past all samples before ``next_sample``.
        next_sample: index of the first sample that isn't handed over.
    """

    boundary: StepBoundary
    next_sample: int


@dataclass(frozen=True)
class Undefined:
    """Samples at which a recorded variable is NaN.

    Attributes:
        count: of them, among those so far.
        leading: of them, those before its first defined sample.
        since: time of the first one past those (s); nan where there is none.
    """

    count: int = 0
    leading: int = 0
    since: float = math.nan


@dataclass(frozen=True)
class Statistics:
    """What was counted and watched from a run's beginning on, over all its sessions.

    Attributes:
        largest_drift, final_drift: relative drifts of the samples so far, by invariant.
        put_back: what was put back until the latest sample, by projected invariant.
        nearest_singularity, singularity_time: smallest singular factor of a chart of Euler angles, and when
            (s).
        undefined: by recorded variable that has such samples.
        smallest_step, largest_step: internal units.
        redone_steps: taken back and taken again.
        sessions: that took part.
        wall_seconds, cpu_seconds, integration_seconds: that they took; the last in the engine alone.
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
    """All that a later session needs."""

    position: Position
    continuity: Continuity
    statistics: Statistics
