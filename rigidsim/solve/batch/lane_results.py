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
        for mine, theirs in (
            (self.finite, others.finite),
            (self.arrived, others.arrived),
            (self.steps, others.steps),
        ):
            mine[places] = theirs

    def lost(self, inside: Sequence[int], taken: Sequence[int], gone: Sequence[bool]) -> list[int]:
        """Note the members whose state was lost, which stopped all lanes; returns the others, which have to
        begin again.

        Args:
            inside, taken, gone: each lane's member, its steps, and whether its state was lost.
        """
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


def grouped(values: np.ndarray, width: int) -> np.ndarray:
    """Values (.., n) of motions as (groups, .., width), the last group filled with the last motion."""
    count = values.shape[-1]
    groups = -(-count // width)
    if groups * width > count:
        values = values[..., np.minimum(np.arange(groups * width), count - 1)]
    split = values.reshape(*values.shape[:-1], groups, width)
    return np.array(np.moveaxis(split, -2, 0), order="C")


def put_in_place(bundle: np.ndarray, states: np.ndarray) -> None:
    """Groups (groups, samples, states, width) as members side by side, (samples, states, members)."""
    groups, samples, count, width = bundle.shape
    whole = min(states.shape[2] // width, groups)
    states[:, :, : whole * width].reshape(samples, count, whole, width)[:] = bundle[:whole].transpose(
        1, 2, 0, 3
    )
    if whole < groups and (left := states.shape[2] - whole * width):
        states[:, :, whole * width :] = bundle[whole, :, :, :left]


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
    # no min or max in here: this is done for every call of the integrator
    for member, moment, target, begin, before in zip(inside, moments, targets, begun, taken, strict=True):
        if member == IDLE:
            continue
        if before and moment > begin:
            steps = int((target - moment) / (moment - begin) * before) + 2
        else:
            steps = int((target - moment) * pace) if pace else _FIRST_STEPS
        if steps < _LEAST_STEPS:
            steps = _LEAST_STEPS
        expected.append(steps if steps < most_steps - before else most_steps - before)
    expected.sort()
    last = expected[0] + _SHORTLY
    found = 1
    for steps in expected:
        if steps > last:
            break
        found = steps
    return found if found > 1 else 1
