"""Output of ``rigidsim run``, ``info``, ``check`` and ``verify``."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console

from rigidsim.cli.screens.page import Page, Styled, answer
from rigidsim.cli.screens.words import (
    advice_line,
    body_text,
    labelled,
    next_lines,
    start_text,
    time_text,
    verdict_line,
)
from rigidsim.errors import ConfigError
from rigidsim.scene.choices import method_named, variables_named
from rigidsim.scene.readable import YEAR, TimeWords, span_text
from rigidsim.store.run import Run
from rigidsim.store.summary import Brief, Summary
from rigidsim.store.summary_parts import ENGINE, Accuracy, InvariantDrift, Modelling, TableErrors

if TYPE_CHECKING:
    from rigidsim.workflows.check import Checked
    from rigidsim.workflows.plan import RunPlan


def _initial(value: float | tuple[float, ...] | None) -> str:
    """A number, or the norm of a vector, to recognise it by; all digits are in summary.json."""
    if value is None:
        return "-"
    return f"|{math.hypot(*value):.6g}|" if isinstance(value, tuple) else f"{value:.6g}"


def _scales(invariants: dict[str, InvariantDrift]) -> str:
    """Scales of the drifts; invariants with the same scale together."""
    names: dict[str, list[str]] = {}
    for name, row in invariants.items():
        names.setdefault(row.scale_name, []).append(name)
    words = {"1": "absolute"}  # norms, and what vanishes for a rotation
    return "; ".join(f"{words.get(scale, scale)} ({', '.join(of)})" for scale, of in names.items())


def _drift(value: float | None) -> str:
    return "-" if value is None else f"{value:.2e}"


def print_summary(summary: Brief, folder: str, out: Console | None = None, *, loads: bool = False) -> None:
    """Print the table at the end of ``run`` and ``info``, with ``loads`` what acts on the body, too."""
    on = Page(out)
    color = "green" if summary.status == "finished" else "yellow"
    on.say((summary.name, "bold"), "  ", (summary.status, f"bold {color}"))
    if summary.description:
        on.say((summary.description, "dim"))
    if summary.status != "finished":
        on.say(summary.message)
    if isinstance(summary, Summary):
        _print_ended(summary, summary.loads if loads else (), on)
    on.line("folder", folder)
    for number, command in enumerate(next_lines(summary.status, summary.exit_code, folder)):
        on.line("" if number else "next", command, "cyan")


def print_run(result: Run, as_json: bool) -> int:
    """Print a run's summary; returns its exit code."""
    answer(as_json, result.summary, print_summary, result.outcome, result.place)
    code = result.outcome.exit_code
    if code:
        print(f"rigidsim: {result.outcome.message}", file=sys.stderr)
    return code


def print_understood(told: Checked | RunPlan | Summary, loads: Sequence[str], on: Page) -> None:
    """Print body, start, time (as far as an older summary has them) and what acts as they were understood."""
    if told.body is not None:
        on.line("body", body_text(told.body))
    if told.start is not None:
        on.line("start", start_text(told.start))
    if told.time is not None:
        on.line("time", time_text(told.time))
    for load in loads:
        on.line(*labelled(load))


def from_step(step: int | None) -> str:
    """From which step on something is done, if that isn't all of them."""
    return "" if step is None else f" from step {step:,} on"


def _print_ended(summary: Summary, loads: Sequence[str], on: Page) -> None:
    print_understood(summary, loads, on)
    how = f"tolerance {summary.tolerance:.3g}"
    method = method_named(summary.method)
    if not method.has_steps:
        how = f"in {method.title}"
    if summary.held:
        how += ", invariants projected" + from_step(summary.hold_from_step)
    on.line(
        "model",
        f"{summary.formulation}, {len(summary.states)} states ({' '.join(summary.states)}), "
        f"{summary.precision} precision, {how}",
    )
    if caveat := variables_named(summary.formulation).caveat:
        on.line("", caveat)
    cost = summary.cost
    seconds = sum(v for k, v in cost.seconds.items() if k != ENGINE)
    on.line(
        "cost",
        f"{cost.steps:,} steps, {summary.samples:,} of {summary.samples_planned:,} samples, "
        f"{span_text(seconds)} wall ({span_text(cost.seconds[ENGINE])} integrating), "
        f"{span_text(cost.cpu_seconds)} CPU",
    )
    if cost.cpu_by_phase:
        spent = [f"{name.replace('_', ' ')} {span_text(s)}" for name, s in cost.cpu_by_phase.items()]
        on.line("CPU", ", ".join(spent))
    _print_invariants(summary, on)
    on.line("drifts", "relative to: " + _scales(summary.invariants))
    if summary.held:
        on.line("held", "put back: what the drift would have been; held drifts are no independent check")
    _print_accuracy(summary.accuracy, on, "attitude" if summary.modelling is None else "axis")
    _print_modelling(summary.modelling, on)
    for number, (name, found) in enumerate(summary.tables.items()):
        on.line("" if number else "tables", _interpolated(name, found))
    for number, name in enumerate(summary.events):
        on.line("" if number else "events", _event(summary, name))
    if summary.undefined_samples:
        counts = summary.undefined_samples.items()
        told = [f"{name} at {count:,} sample{'s' * (count > 1)}" for name, count in counts]
        on.line("missing", f"{', '.join(told)}: undefined there, NaN is recorded")
    chaos = summary.lyapunov
    if chaos is not None:
        what = "chaotic" if chaos.chaotic else "regular"
        moved = f"moved by {chaos.moved_over_second_half:.1g} over the second half"
        on.line("motion", f"{what}: largest Lyapunov exponent {chaos.largest_exponent:.3g} 1/s ({moved})")
    for warning in summary.warnings:
        on.line("warning", warning, "bold red")
    verdict, style = verdict_line(summary)
    on.line("verdict", verdict, style)
    for advice in filter(None, map(advice_line, summary.advice)):
        on.line("advice", advice, "cyan")


def _event(summary: Summary, name: str) -> str:
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


def _print_invariants(summary: Summary, on: Page) -> None:
    """Print the invariants, without the final drifts if the table doesn't fit."""
    held = ["put back"] if summary.held else []
    columns = ["invariant", "initial", "largest drift", "final", "bound", *held]
    rows: list[list[Styled]] = []
    for name, row in summary.invariants.items():
        sound = row.largest_drift is None or row.largest_drift <= row.bound
        largest = (_drift(row.largest_drift), "" if sound else "red")
        rows.append([name, _initial(row.initial), largest, _drift(row.final_drift), _drift(row.bound)])
        rows[-1] += [_drift(row.put_back)] if held else []
    if not on.fits(columns, rows):
        columns, rows = columns[:3] + columns[4:], [row[:3] + row[4:] for row in rows]
    on.table(columns, rows)


def _print_accuracy(accuracy: Accuracy, on: Page, what: str) -> None:
    if accuracy.chosen:
        on.line("chosen", f"{accuracy.chosen}: {accuracy.chosen_why}")
    estimate = accuracy.estimated_attitude_error
    if accuracy.certified is not None:
        asked = "" if accuracy.requested is None else f", {accuracy.requested:.1e} asked for"
        text = f"certified to {accuracy.certified:.1e} rad{asked} ({accuracy.how}, "
        on.line(what, f"{text}{accuracy.times_compared} times)")
    elif estimate is not None:
        factor = accuracy.amplification or 1.0
        unstable = f" ({factor:.1g} times the round-off law)" if factor > 1 else ""
        size = f"uncertain by about {estimate:.1e} rad at the end{unstable}"
        if what == "axis":
            size = f"momentum's direction integrated to about {estimate:.1e} rad at the end{unstable}"
        on.line(what, size if estimate < math.pi else "unknown at the end")
        share = accuracy.examined_share
        if share is not None and share < 1 and estimate < math.pi:
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


def _print_modelling(found: Modelling | None, on: Page) -> None:
    """Print how far a reduced model is from the full one."""
    if found is None:
        return
    if found.momentum_axis is None:
        on.line("averaged", f"modelling error {found.how}")
        return
    text = f"momentum's direction within {found.momentum_axis:.1e} rad of the full model's"
    if found.figure_axis is not None:
        text += f", figure axis within {found.figure_axis:.1e} rad"
    on.line("averaged", text)
    if found.angular_momentum_norm is not None and found.energy is not None:
        text = f"size of the angular momentum within {found.angular_momentum_norm:.1e} of itself, energy of "
        on.line("", text + f"rotation within {found.energy:.1e}")
    if not found.whole and found.growth is not None and found.oscillation is not None:
        span = found.windows[0].end - found.windows[0].start
        text = f"{len(found.windows)} windows of {span_text(span)} with every rotation: "
        text += f"{found.oscillation:.1e} rad in each, growing by {found.growth * YEAR:.1e} rad/yr"
        on.line("", text)
    if not (found.short_period or found.resonance or found.energy is not None):
        on.line("", "[model] short_period = true adds the nutation back that averaging removed")


def _interpolated(name: str, found: TableErrors) -> str:
    """Accuracy of a tabulated orbit's interpolation, in words."""
    expected = found.direction * found.expected
    return (
        f'"{name}": interpolation misses the source by {found.direction:.1e} rad at most with every other '
        f"row left out, by about {expected:.0e} rad with all rows"
    )


def print_checked(found: Checked) -> None:
    """Print the result of a check; errors go to stderr, as for all commands."""
    if not found.valid:
        print(f"rigidsim: {ConfigError(found.problems, found.source).for_command_line()}", file=sys.stderr)
        return
    on = Page()
    on.say((found.source, "bold"), "  ", ("valid", "bold green"))
    print_understood(found, found.loads, on)
    for text in found.warnings:
        on.line("warning", text, "bold red")


def print_verdict(verdict: dict[str, Any], what: str = "sample") -> None:
    """Print a verification in words, from ``Verdict.as_dict``; ``what`` names the things compared."""
    on = Page()
    if verdict["identical"]:
        on.say(f"identical: {verdict['samples']:,} {what}s, every variable, every bit")
    else:
        on.say(f"different: {verdict['path']}")
    for problem in verdict["problems"]:
        on.say(f"  {problem}")
    first = verdict["first_difference"]
    if first is not None:
        on.say(
            f"  first difference: {first['variable']} at {what} {first['sample']}: saved "
            f"{first['saved']!r}, again {first['again']!r}, {first['size']:.3g} apart"
        )
    names = verdict["differing_variables"]
    if names:
        on.say(f"  variables that differ: {', '.join(names)}")
    if verdict["environment"]:
        on.say("  changed since, which can explain other bits:")
        for line in verdict["environment"]:
            on.say(f"    {line}")
    elif names:
        on.say("  versions, CPU features and settings are the same, so they don't explain it")
