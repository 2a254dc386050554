"""A run whose neighbours are followed to learn how its errors grow, and the result."""

from __future__ import annotations

from dataclasses import dataclass, field

from rigidsim.solve.effects.waypoints import Waypoints
from rigidsim.solve.neighbours.spread import Spread
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.taylor_stepper import TaylorStepper


@dataclass(frozen=True)
class Course:
    """A run whose neighbours are to be followed.

    Attributes:
        start, end: times, internal units.
        steps: steps that it took.
        waypoints: some of its step boundaries; None if there are none.
        stepper: the run's stepper; it, or copies of its engine, are used if good enough.
        nearest: smallest singular factor of the run's chart; 1 for charts that are changed.
        uneven: ratio of its longest step to its shortest.
        lost: errors in epsilons past which nothing can be learnt.
    """

    prepared: InitialValueProblem
    start: float
    end: float
    steps: int
    waypoints: Waypoints | None
    stepper: TaylorStepper | None
    nearest: float
    uneven: float
    lost: float

    def at(self, share: float) -> float:
        """The time at a share of the run."""
        return self.end if share >= 1 else self.start + (self.end - self.start) * share

    @property
    def carried(self) -> bool:
        """Whether the run carries an attitude."""
        return self.prepared.system.requirements.attitude

    @property
    def own(self) -> TaylorStepper | None:
        """The run's stepper if it can carry the neighbours; None otherwise."""
        single = self.prepared.system.partner is None and self.prepared.precision.name == "double"
        return self.stepper if single else None


@dataclass(frozen=True)
class Followed:
    """Result of following neighbours.

    Attributes:
        share: share of the run's time over which neighbours were carried from its start, possibly until no
            digit is left.
        windows, in_windows: windows examined beyond that, and the part of the run they cover.
        more: how much more errors grow in these than in as much of the beginning, root mean square, by
            quantity; 1 if they don't.
    """

    spread: Spread
    share: float
    windows: int = 0
    in_windows: float = 0.0
    more: dict[str, float] = field(default_factory=dict)
