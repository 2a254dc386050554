"""Verdict on a run's soundness from its summary, as one value for decisions; the wording is elsewhere."""

from dataclasses import dataclass
from enum import Enum

from rigidsim.scene.cautions import WarningCode
from rigidsim.store.summary import Summary


class Soundness(Enum):
    """Degrees of soundness, from best to worst."""

    SOUND = "sound"
    AMPLIFIED = "amplified"
    HELD = "held"
    LIMITED = "limited"
    UNCHECKED = "unchecked"
    INACCURATE = "inaccurate"
    LOST = "lost"
    DRIFTED = "drifted"


@dataclass(frozen=True)
class RunVerdict:
    """Verdict on a run that ended. ``share``: largest drift of any invariant, or correction put back, over
    what rounding explains, None if nothing was checked; ``worst``: the invariant with that drift.
    """

    soundness: Soundness
    share: float | None
    worst: str


LEAST: dict[str, Soundness] = {
    WarningCode.DRIFT: Soundness.DRIFTED,
    WarningCode.ATTITUDE_UNCERTAIN: Soundness.LOST,
    WarningCode.RATES_UNCERTAIN: Soundness.LOST,
    WarningCode.NOT_CERTIFIED: Soundness.INACCURATE,
    WarningCode.MODEL_UNCERTAIN: Soundness.INACCURATE,
    WarningCode.MODEL_UNMEASURED: Soundness.INACCURATE,
    WarningCode.SINGULARITY: Soundness.LIMITED,
    WarningCode.NOT_JOINED: Soundness.LIMITED,
    WarningCode.UNDEFINED: Soundness.LIMITED,
    WarningCode.DELAY_TOO_LONG: Soundness.LIMITED,
    WarningCode.SERIES_DIVERGES: Soundness.LIMITED,
    # of what the config asks for, and of the files: they leave the numbers what they are
    WarningCode.NO_EFFECT: Soundness.SOUND,
    WarningCode.SET_ASIDE: Soundness.SOUND,
    WarningCode.BEGUN_ANEW: Soundness.SOUND,
    WarningCode.ANGLE_WITHOUT_UNIT: Soundness.SOUND,
    WarningCode.EPHEMERIS_OF_EARTH: Soundness.SOUND,
    WarningCode.NEVER_HAPPENS: Soundness.SOUND,
    WarningCode.TIME_WITHOUT_UNIT: Soundness.SOUND,
    WarningCode.LENGTH_WITHOUT_UNIT: Soundness.SOUND,
    WarningCode.BELOW_SURFACE: Soundness.SOUND,
    WarningCode.PERIOD_CONTRADICTS: Soundness.SOUND,
    WarningCode.GRAVITY_UPWARDS: Soundness.SOUND,
    WarningCode.NEAR_RESONANCE: Soundness.SOUND,
    WarningCode.FRICTION_STIFF: Soundness.SOUND,
    WarningCode.STRENGTH_CONTRADICTS: Soundness.SOUND,
    WarningCode.HOST_WITHOUT_GRAVITY: Soundness.SOUND,
}
"""The best that can be said of a run with each warning; of a later version's warnings ``LIMITED``."""
_DEGREES = list(Soundness)


def verdict_on(summary: Summary) -> RunVerdict:
    """The worst that its warnings and its drifts say of a run, so that no warning is contradicted.

    A motion may amplify errors whatever its drifts. For projected invariants the corrections put back count,
    since they are the drift that would have been. What is constant by definition, as a quaternion's norm, is
    named only where it drifted too much, or where nothing else is watched.
    """
    shares = {
        name: max(row.largest_drift, abs(row.put_back or 0.0)) / row.bound
        for name, row in summary.invariants.items()
        if row.largest_drift is not None and row.bound > 0
    }
    physical = {name: share for name, share in shares.items() if not summary.invariants[name].numerical}
    drifted = any(not share <= 1 for share in shares.values())
    named = shares if drifted else physical or shares
    worst = max(named, key=lambda name: named[name], default="")
    degrees = [LEAST.get(code, Soundness.LIMITED) for code in summary.warning_codes]
    degrees.append(Soundness.DRIFTED if drifted else _without_warnings(summary, bool(shares)))
    return RunVerdict(max(degrees, key=_DEGREES.index), named.get(worst), worst)


def _without_warnings(summary: Summary, checked: bool) -> Soundness:
    if not checked:
        return Soundness.UNCHECKED
    if summary.held:
        return Soundness.HELD
    amplification = summary.accuracy.amplification
    return Soundness.AMPLIFIED if amplification is not None and amplification > 1 else Soundness.SOUND
