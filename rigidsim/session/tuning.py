"""How much a run spends on guards, saving and advice; no recorded bit depends on it."""

from __future__ import annotations

from dataclasses import dataclass, field

from rigidsim.solve.sampler import Pacing
from rigidsim.store.segments import SegmentLimits


@dataclass(frozen=True)
class AdviceLimits:
    """When a run that resolved every rotation is compared with averaged models.

    Attributes:
        steps: least steps of such a run: the windows in which both are followed have 2e4 to 2e5 of them.
        apart: largest distance of axes, rad, at which a model is advised; two seconds of arc.
    """

    steps: int = 1_000_000
    apart: float = 1e-5


@dataclass(frozen=True)
class Tuning:
    """Intervals and limits of a run; the defaults were measured, see each part. Tests and studies of damage
    save far more often.
    """

    pacing: Pacing = field(default_factory=Pacing)
    segments: SegmentLimits = field(default_factory=SegmentLimits)
    advice: AdviceLimits = AdviceLimits()
