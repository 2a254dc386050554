"""What ``rigidsim run`` and ``resume`` end with: verdict, errors, warnings, and what to do next."""

from __future__ import annotations

import shlex
import sys

from rich.console import Console

from rigidsim.cli.screens.outcome import event_text, print_errors, print_modelling, undefined_text
from rigidsim.cli.screens.page import Page, answer
from rigidsim.cli.screens.summary import print_summary
from rigidsim.cli.screens.words import advice_line, next_lines, verdict_line
from rigidsim.scene.readable import span_text
from rigidsim.store.run import Run
from rigidsim.store.summary import Brief, Summary
from rigidsim.store.summary_parts import ENGINE

_EVENTS = 2
"""Events that are told by their times; of more, ``rigidsim info`` tells."""


def print_run(result: Run, as_json: bool, *, verbose: bool = False) -> int:
    """Print how a run ended, ``verbose`` with all of its summary; returns its exit code."""
    screen = print_summary if verbose else print_closing
    answer(as_json, result.summary, screen, result.outcome, result.place)
    code = result.outcome.exit_code
    if code:
        print(f"rigidsim: {result.outcome.message}", file=sys.stderr)
    return code


def print_closing(summary: Brief, folder: str, out: Console | None = None) -> None:
    """Print some eight lines: what can be relied on first, then cost and what to do next.

    Warnings are never left out. Body, start, invariants and cost by phase are in ``print_summary``.
    """
    on = Page(out)
    color = "green" if summary.status == "finished" else "yellow"
    on.say((summary.name, "bold"), "  ", (summary.status, f"bold {color}"))
    if summary.status != "finished":
        on.say(summary.message)
    if isinstance(summary, Summary):
        _print_found(summary, on)
    _print_next(summary, folder, on)


def _print_found(summary: Summary, on: Page) -> None:
    on.line("verdict", *verdict_line(summary, brief=True))
    for warning in summary.warnings:
        on.line("warning", warning, "bold red")
    print_errors(summary.accuracy, on, "attitude" if summary.modelling is None else "axis", brief=True)
    print_modelling(summary.modelling, on, brief=True)
    if summary.lyapunov is not None:
        found = summary.lyapunov
        what = "chaotic" if found.chaotic else "regular"
        on.line("motion", f"{what}: largest Lyapunov exponent {found.largest_exponent:.3g} 1/s")
    if len(summary.events) <= _EVENTS:
        for name in summary.events:
            on.line("event", event_text(summary, name))
    else:
        on.line("events", ", ".join(f"{name}: {count:,}" for name, count in summary.events.items()))
    if summary.undefined_samples:
        on.line("missing", undefined_text(summary.undefined_samples))
    for advice in filter(None, map(advice_line, summary.advice)):
        on.line("advice", advice, "cyan")
    cost = summary.cost
    seconds = sum(spent for phase, spent in cost.seconds.items() if phase != ENGINE)
    said = f"{cost.steps:,} steps, {summary.samples:,} of {summary.samples_planned:,} samples, "
    on.line("cost", f"{said}{span_text(seconds)} wall, {span_text(cost.cpu_seconds)} CPU")


def _print_next(summary: Brief, folder: str, on: Page) -> None:
    if not folder:
        return
    commands = next_lines(summary.status, summary.exit_code, folder)
    details = f"rigidsim info {shlex.quote(folder)}"
    for number, command in enumerate((*commands, details)):
        text = f"{command}   (invariants, start, cost by phase)" if command is details else command
        on.line("" if number else "next", text, "cyan")
