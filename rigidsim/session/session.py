"""The work of one process on a run."""

from __future__ import annotations

from dataclasses import dataclass, field

from rigidsim.session.guards import Observer
from rigidsim.session.timings import Effort, Phases
from rigidsim.session.tuning import Tuning
from rigidsim.store.summary_parts import Caution


@dataclass
class Session:
    """The work of one process on a run: all of it, or what was left.

    Attributes:
        mixed: what changed in versions or machine since the run began; empty if nothing did.
    """

    observer: Observer
    remarks: list[Caution] = field(default_factory=list)
    mixed: str = ""
    effort: Effort = field(default_factory=Effort)
    phases: Phases = field(default_factory=Phases)
    tuning: Tuning = field(default_factory=Tuning)

    def another(self) -> Session:
        """Session for the next attempt after this one missed the accuracy; its cost includes this one's."""
        return Session(
            self.observer, effort=self.effort, phases=self.phases.begin_again(), tuning=self.tuning
        )
