"""How members fared that were taken side by side."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Found:
    """One crossing: of which event, in which lane, when (internal units) and where."""

    event: int
    lane: int
    time: float
    state: np.ndarray


@dataclass
class Lanes:
    """How members fared.

    Attributes:
        states: (samples, states, members) at the sample times; not numbers from where one ended.
        finite: whether the state stayed so, (members,).
        arrived: whether it got to the last sample.
        steps: that it took.
        found: crossings on the way, of members that have any.
    """

    states: np.ndarray
    finite: np.ndarray
    arrived: np.ndarray
    steps: np.ndarray
    found: dict[int, list[Found]] = field(default_factory=dict)

    @classmethod
    def empty(cls, samples: int, states: int, members: int) -> Lanes:
        """Before anything ran."""
        yes = np.ones(members, dtype=bool)
        table = np.full((samples, states, members), np.nan)
        return cls(table, yes, yes.copy(), np.zeros(members, dtype=np.int64))

    def put(self, places: np.ndarray, others: Lanes) -> None:
        """How some fared, in place of what was known of them."""
        self.states[:, :, places] = others.states
        for mine, theirs in (
            (self.finite, others.finite),
            (self.arrived, others.arrived),
            (self.steps, others.steps),
        ):
            mine[places] = theirs
