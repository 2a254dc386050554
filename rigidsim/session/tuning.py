"""How often a run looks at its guards, hands samples over and saves: costs alone, no recorded bit."""

from __future__ import annotations

from dataclasses import field

from rigidsim.scene.records import dataclass
from rigidsim.solve.pacing import Pacing
from rigidsim.store.segments import SegmentLimits


@dataclass(frozen=True)
class Tuning:
    """The defaults were measured, see each part; tests and studies of damage save far more often."""

    pacing: Pacing = field(default_factory=Pacing)
    segments: SegmentLimits = field(default_factory=SegmentLimits)
