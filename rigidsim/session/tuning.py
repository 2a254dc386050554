"""What a run spends on guards, saving and advice: costs alone, no recorded bit."""

from __future__ import annotations

from dataclasses import field

from rigidsim.scene.records import dataclass
from rigidsim.solve.pacing import Pacing
from rigidsim.store.segments import SegmentLimits


@dataclass(frozen=True)
class AdviceLimits:
    """When a run that resolved every rotation is compared with averaged models.

    Attributes:
        steps: from which on it is: the windows in which both are followed have some 2e4 of them, 2e5 at most.
        apart: rad, the farthest that axes may be for a model to be advised; two seconds of arc.
    """

    steps: int = 1_000_000
    apart: float = 1e-5


@dataclass(frozen=True)
class Tuning:
    """The defaults were measured, see each part; tests and studies of damage save far more often."""

    pacing: Pacing = field(default_factory=Pacing)
    segments: SegmentLimits = field(default_factory=SegmentLimits)
    advice: AdviceLimits = AdviceLimits()
