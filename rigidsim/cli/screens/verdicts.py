"""Interpretation of a run's numbers in plain words: the verdict, advice, and what to do next."""

from __future__ import annotations

import shlex

from rigidsim.session.verdict import Soundness, verdict_on
from rigidsim.solve.status import Status
from rigidsim.store.summary import Summary
from rigidsim.store.summary_parts import Advice, AdviceCode

_STYLES = {
    Soundness.LIMITED: "bold yellow",
    Soundness.INACCURATE: "bold yellow",
    Soundness.LOST: "bold yellow",
    Soundness.DRIFTED: "bold red",
}
_SOUND = "sound: every drift is within what rounding explains, {share} of it at most"
_WORDS = {
    Soundness.SOUND: _SOUND,
    Soundness.AMPLIFIED: _SOUND + "; the motion itself amplifies errors",
    Soundness.HELD: "sound: what was put back is within what rounding explains, {share} of it at most; "
    "drifts themselves are projected away",
    Soundness.LIMITED: "sound except for what the warning tells: every drift is within what rounding "
    "explains, {share} of it at most",
    Soundness.UNCHECKED: "unchecked: nothing is conserved here that could be watched",
    Soundness.INACCURATE: "not accurate enough, or not known to be: see the warning; drifts are within what "
    "rounding explains, {share} of it at most",
    Soundness.LOST: "drifts are within what rounding explains, {share} of it at most, but digits are gone at "
    "the end: see the warning",
    Soundness.DRIFTED: "not sound: {worst} drifted by {times} times what rounding explains; see the warning",
}
_ADVICE = {
    AdviceCode.HOLD_INVARIANTS: "hold_invariants = true would bring {now} rad to about {then} for a few "
    "percent more CPU",
    AdviceCode.CLOSED_FORM: 'this scene has a closed form: method = "{code}" is right to {then} rad at '
    "any time, in place of {now}",
    AdviceCode.AVERAGED: '[model] level = "{level}" with short_period = true keeps the axes within {then} '
    "rad of this at 1/{times} of the steps",
}


def verdict_line(summary: Summary) -> tuple[str, str]:
    """The verdict, and its style on a terminal."""
    found = verdict_on(summary)
    words, share = _WORDS[found.soundness], found.share or 0.0
    if found.soundness is Soundness.DRIFTED and not share > 1:  # what drifted has no finite size
        words = "not sound: see the warning"
    told = words.format(share=_percent(share), worst=found.worst, times=f"{share:.2g}")
    model = summary.modelling
    if found.soundness is not Soundness.INACCURATE and model is not None and model.momentum_axis is None:
        told += "; how far the averaged model is from the full one isn't known"
    return told, _STYLES.get(found.soundness, "green")


def _percent(share: float) -> str:
    return "0 %" if share == 0 else f"{100 * share:.2g} %" if share >= 0.001 else "less than 0.1 %"


def advice_line(advice: Advice) -> str | None:
    """One piece of advice; None if it is of a later version."""
    known = {code.value: text for code, text in _ADVICE.items()}
    text = known.get(advice.code)
    if text is None:
        return None
    times = f"{1 / advice.share:.2g}" if advice.share else "1"
    then = f"{advice.then:.1e}" if advice.level else f"{advice.then:.0e}"
    return text.format(code=advice.code, now=f"{advice.now:.1e}", then=then, level=advice.level, times=times)


def next_lines(status: str, exit_code: int, place: str) -> list[str]:
    """Commands that may be useful next; none for a run in memory."""
    if not place:
        return []
    where = shlex.quote(place)
    if exit_code == 0 and status in _DONE:
        return [f"rigidsim view {where}", f"rigidsim plot {where}"]
    return [f"rigidsim resume {where}"] if exit_code == 130 or status in _RESUMABLE else []


_DONE = {s.value for s in (Status.FINISHED, Status.EVENT)}
_RESUMABLE = {s.value for s in (Status.RUNNING, Status.WALL_TIME, Status.MAX_STEPS)}
