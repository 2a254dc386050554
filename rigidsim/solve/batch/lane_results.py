"""Results of members integrated side by side: where their samples go, and when the next lane finishes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

IDLE = -1
"""Marks a lane that has no member."""
_FIRST_STEPS, _LEAST_STEPS = 64, 8
"""Steps at once while a lane's pace is unknown, and when one is about to arrive."""
_SHORTLY = 48
"""Number of steps that takes about as long as the work between two calls of the integrator."""


@dataclass(frozen=True)
class Found:
    """One crossing: its event, lane, time (internal units) and state."""

    event: int
    lane: int
    time: float
    state: np.ndarray


@dataclass
class LaneResults:
    """Results of members integrated side by side.

    Attributes:
        states: (samples, states, members) at the sample times; nan from where a member ended.
        finite: whether the state stayed finite, (members,).
        arrived: whether the last sample was reached, (members,).
        steps: steps taken, (members,).
        found: crossings on the way, for members that have any.
    """

    states: np.ndarray
    finite: np.ndarray
    arrived: np.ndarray
    steps: np.ndarray
    found: dict[int, list[Found]] = field(default_factory=dict)

    @classmethod
    def empty(cls, samples: int, states: int, members: int) -> LaneResults:
        """Results before anything ran; the states are uninitialised."""
        yes = np.ones(members, dtype=bool)
        table = np.empty((samples, states, members))
        return cls(table, yes, yes.copy(), np.zeros(members, dtype=np.int64))

    def put(self, places: np.ndarray, others: LaneResults) -> None:
        """Replace the results of some members."""
        self.states[:, :, places] = others.states
        self.finite[places], self.arrived[places] = others.finite, others.arrived
        self.steps[places] = others.steps

    def lost(self, inside: Sequence[int], taken: Sequence[int], gone: Sequence[bool]) -> list[int]:
        """Note lanes' members whose state is gone, which stopped all; returns the others, to begin again."""
        others = []
        for member, steps, lost in zip(inside, taken, gone, strict=True):
            if member == IDLE:
                continue
            if lost:
                self.steps[member] = steps
                self.finite[member] = self.arrived[member] = False
            else:
                self.found.pop(member, None)
                others.append(member)
        return others


def until_next(
    moments: list[float],
    inside: list[int],
    targets: list[float],
    begun: list[float],
    taken: list[int],
    most_steps: int,
    pace: float,
) -> int:
    """Steps until about the first lane arrives at its pace so far, together with those that arrive shortly
    after.

    Args:
        pace: steps in a unit of time of the member that arrived last, which one that has just begun is taken
            to have as well; 0 where none did.
    """
    expected = []
    for member, moment, target, begin, before in zip(inside, moments, targets, begun, taken, strict=True):
        if member == IDLE:
            continue
        own = before / (moment - begin) if moment > begin else pace
        steps = int((target - moment) * own) + 2 if own else _FIRST_STEPS
        expected.append(min(max(steps, _LEAST_STEPS), most_steps - before))
    soon = min(expected) + _SHORTLY
    return max(1, *(steps for steps in expected if steps <= soon))
