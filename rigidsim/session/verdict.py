"""Verdict on a run's soundness from its summary, as one value for decisions; the wording is elsewhere."""

from __future__ import annotations

from enum import Enum

from rigidsim.scene.records import dataclass
from rigidsim.store.summary import Summary
from rigidsim.store.summary_parts import WarningCode


class Soundness(Enum):
    """Degrees of soundness, from best to worst."""

    SOUND = "sound"
    AMPLIFIED = "amplified"
    HELD = "held"
    UNCHECKED = "unchecked"
    INACCURATE = "inaccurate"
    LOST = "lost"
    DRIFTED = "drifted"


@dataclass(frozen=True)
class RunVerdict:
    """Verdict on a run that ended.

    Attributes:
        share: largest drift of any invariant, or correction put back, over what rounding explains; None
            if nothing was checked.
        worst: the invariant with that drift; empty for none.
    """

    soundness: Soundness
    share: float | None
    worst: str


_GONE = {WarningCode.ATTITUDE_UNCERTAIN.value, WarningCode.RATES_UNCERTAIN.value}

_LESS_THAN_ASKED = {
    WarningCode.NOT_CERTIFIED.value,
    WarningCode.MODEL_UNCERTAIN.value,
    WarningCode.MODEL_UNMEASURED.value,
}


def verdict_on(summary: Summary) -> RunVerdict:
    """The worst that can be said of a run: drifts that rounding does not explain, then lost digits, then less
    accuracy than was asked for, or an averaged model's own error too large or unknown.

    A motion may amplify errors whatever its drifts. For projected invariants the corrections put back count,
    since they are the drift that would have been.
    """
    checked = {name: row for name, row in summary.invariants.items() if not row.numerical}
    shares = {
        name: max(row.largest_drift, abs(row.put_back or 0.0)) / row.bound
        for name, row in (checked or summary.invariants).items()
        if row.largest_drift is not None and row.bound > 0
    }
    worst = max(shares, key=lambda name: shares[name], default="")
    share = shares.get(worst)
    return RunVerdict(_soundness(summary, share), share, worst)


def _soundness(summary: Summary, share: float | None) -> Soundness:
    if share is not None and not share <= 1:
        return Soundness.DRIFTED
    if _GONE.intersection(summary.warning_codes):
        return Soundness.LOST
    if _LESS_THAN_ASKED.intersection(summary.warning_codes):
        return Soundness.INACCURATE
    if share is None:
        return Soundness.UNCHECKED
    if summary.held:
        return Soundness.HELD
    amplification = summary.accuracy.amplification
    return Soundness.AMPLIFIED if amplification is not None and amplification > 1 else Soundness.SOUND
