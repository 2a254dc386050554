"""How a run came out, in lines that the closing words and the whole summary share: errors, models, events."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rigidsim.cli.screens.page import Page
from rigidsim.scene.readable import YEAR, TimeWords, span_text
from rigidsim.store.summary import Summary
from rigidsim.store.summary_parts import Accuracy, Modelling


def event_text(summary: Summary, name: str) -> str:
    """How often an event happened, and when."""
    count, times = summary.events[name], summary.event_times.get(name)
    if times is None:
        return f"{name}: {count:,}"
    early = times.early or (times.first,)
    if count > len(early):  # a few, and the last one
        early = early[:3]
    span = summary.time  # none of an older version
    start, end = (span.start_s, span.end_s) if span else (0.0, summary.time_reached)
    words = TimeWords.of({"epoch": span.epoch, "time_unit": span.unit} if span else {}, start, end)
    told = [words.moment(time) for time in early]
    if count > len(told):
        told += ["..."] * (count > len(told) + 1) + [words.moment(times.last)]
    return f"{name}: {count:,}, at {', '.join(told)}"


def print_errors(accuracy: Accuracy, on: Page, what: str, *, brief: bool = False) -> None:
    """Print announced and certified errors; unless ``brief``, how they were chosen and found as well."""
    if accuracy.chosen and not brief:
        on.line("chosen", f"{accuracy.chosen}: {accuracy.chosen_why}")
    estimate = accuracy.estimated_attitude_error
    if accuracy.certified is not None:
        asked = "" if accuracy.requested is None else f", {accuracy.requested:.1e} asked for"
        text = f"certified to {accuracy.certified:.1e} rad{asked} ({accuracy.how}, "
        on.line(what, f"{text}{accuracy.times_compared} times)")
    elif estimate is not None:
        factor = accuracy.amplification or 1.0
        unstable = f" ({factor:.1g} times a stable motion's)" if factor > 1 and not brief else ""
        size = f"uncertain by about {estimate:.1e} rad at the end{unstable}"
        if what == "axis":
            size = f"momentum's direction integrated to about {estimate:.1e} rad at the end{unstable}"
        on.line(what, size if estimate < math.pi else "unknown at the end")
        share = accuracy.examined_share
        if not brief and share is not None and share < 1 and estimate < math.pi:
            seen = f"the growth of errors was followed over the first {100 * share:.2g} % of the run"
            on.line("examined", f"{seen} (estimated_how in the summary says more)")
    elif accuracy.amplification is None:
        on.line("errors", accuracy.estimated_how)
    if accuracy.certified_position is not None:
        length = accuracy.requested_position or math.nan
        text = f"certified to {accuracy.certified_position:.1e} m, {length:.1e} m asked for"
        on.line("path", text)
        return
    place, speed = accuracy.estimated_position_error, accuracy.estimated_velocity_error
    if place is not None and speed is not None:
        text = f"position uncertain by about {place:.1e} m, velocity by {speed:.1e} m/s, at the end"
        on.line("path", text)


def print_modelling(found: Modelling | None, on: Page, *, brief: bool = False) -> None:
    """Print how far a reduced model is from the full one; unless ``brief``, how that is known."""
    if found is None:
        return
    if found.momentum_axis is None:
        on.line("averaged", f"modelling error {found.how}")
        return
    text = f"momentum's direction within {found.momentum_axis:.1e} rad of the full model's"
    if found.figure_axis is not None:
        text += f", figure axis within {found.figure_axis:.1e} rad"
    on.line("averaged", text)
    if brief:
        return
    if found.angular_momentum_norm is not None and found.energy is not None:
        text = f"size of the angular momentum within {found.angular_momentum_norm:.1e} of itself, energy of "
        on.line("", text + f"rotation within {found.energy:.1e}")
    if not found.whole and found.growth is not None and found.oscillation is not None:
        span = found.windows[0].end - found.windows[0].start
        text = f"{len(found.windows)} spans of {span_text(span)} integrated with every rotation: "
        text += f"{found.oscillation:.1e} rad in each, growing by {found.growth * YEAR:.1e} rad/yr"
        on.line("", text)
    if not (found.short_period or found.resonance or found.energy is not None):
        on.line("", "[model] short_period = true adds the nutation back that averaging removed")


def undefined_text(samples: Mapping[str, int]) -> str:
    """At how many samples variables are undefined."""
    told = [f"{name} at {count:,} sample{'s' * (count > 1)}" for name, count in samples.items()]
    return f"{', '.join(told)}: undefined there, NaN is recorded"
