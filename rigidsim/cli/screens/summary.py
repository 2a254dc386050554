"""Output of ``rigidsim info``, ``check``, ``verify`` and ``run --verbose``."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console

from rigidsim.cli.screens.outcome import event_text, print_errors, print_modelling, undefined_text
from rigidsim.cli.screens.page import Page, Styled
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
from rigidsim.scene.readable import span_text
from rigidsim.store.summary import Brief, Summary
from rigidsim.store.summary_parts import ENGINE, InvariantDrift, TableErrors

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
    """Print the whole summary, as ``info`` and ``run --verbose`` do; with ``loads`` what acts, too."""
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


def _shortened(states: Sequence[str]) -> list[str]:
    """Names of states, of those that place a kernel's bodies only the first and the last."""
    placing = [name for name in states if name.startswith("kernel_")]
    if len(placing) < 3:
        return list(states)
    first = states.index(placing[0])
    rest = [name for name in states[first:] if name not in placing]
    return [*states[:first], placing[0], "...", placing[-1], *rest]


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
        f"{summary.formulation}, {len(summary.states)} states ({' '.join(_shortened(summary.states))}), "
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
    for name, why in summary.unwatched.items():
        on.line("", f"{name} isn't monitored: {why}")
    if summary.held:
        on.line(
            "projected", "correction: what the drift would have been; the residual is no independent check"
        )
    print_errors(summary.accuracy, on, "attitude" if summary.modelling is None else "axis")
    print_modelling(summary.modelling, on)
    for number, (name, found) in enumerate(summary.tables.items()):
        on.line("" if number else "tables", _interpolated(name, found))
    for number, name in enumerate(summary.events):
        on.line("" if number else "events", event_text(summary, name))
    if summary.undefined_samples:
        on.line("missing", undefined_text(summary.undefined_samples))
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


def _print_invariants(summary: Summary, on: Page) -> None:
    """Print the invariants, without the final drifts if the table doesn't fit."""
    held = ["correction"] if summary.held else []
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
        print(f"rigidsim: {ConfigError(found.problems, found.source)}", file=sys.stderr)
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
    if (reversal := verdict.get("reversal")) is not None:
        on.say(f"  {reversal['words']}")
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
