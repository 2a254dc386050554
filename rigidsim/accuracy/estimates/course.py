"""A run whose neighbours are followed to learn how its errors grow, and what was found of it."""

from __future__ import annotations

from dataclasses import field

from rigidsim.scene.records import dataclass
from rigidsim.solve.neighbours.pushed import Spread
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.stepper import Stepper
from rigidsim.solve.trail import Waypoints


@dataclass(frozen=True)
class Course:
    """A run whose neighbours are to be followed.

    Attributes:
        start, end: internal units.
        steps: that it took.
        waypoints: boundaries of its steps; None where there are none.
        stepper: of the run; it, or copies of its engine, are used where that is good enough.
        nearest: singular factor of the run's chart where it was smallest; 1 for charts that are changed.
        uneven: its longest step over its shortest.
        lost: errors in epsilons past which nothing is to be learnt.
    """

    prepared: InitialValueProblem
    start: float
    end: float
    steps: int
    waypoints: Waypoints | None
    stepper: Stepper | None
    nearest: float
    uneven: float
    lost: float

    def at(self, share: float) -> float:
        """The time at a share of the run."""
        return self.end if share >= 1 else self.start + (self.end - self.start) * share

    @property
    def carried(self) -> bool:
        """Whether the run carries an attitude."""
        return self.prepared.system.requirements.formulation != "rates"

    @property
    def own(self) -> Stepper | None:
        """The run's stepper where it can carry the neighbours."""
        single = self.prepared.system.partner is None and self.prepared.precision.name == "double"
        return self.stepper if single else None


@dataclass(frozen=True)
class Followed:
    """What was found.

    Attributes:
        share: of the run's time that neighbours were carried along from its start on, be it until no digit is
            left.
        windows: looked at beyond that; ``in_windows``: what part of the run they are.
        more: by how much more errors grow in these than in as much of the beginning, root mean square, by
            quantity; 1 where they don't.
    """

    spread: Spread
    share: float
    windows: int = 0
    in_windows: float = 0.0
    more: dict[str, float] = field(default_factory=dict)
