"""Commands on configs: ``new``, ``check``, ``plan``, ``tradeoff``, ``schema``."""

from __future__ import annotations

import math
import re
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rigidsim.workflows.check as validation
import rigidsim.workflows.plan as planning
import rigidsim.workflows.tradeoff as measuring
from rigidsim.cli.exits import refuse_options
from rigidsim.cli.screens.page import Page, Styled, answer, print_json, reporting
from rigidsim.cli.screens.summary import arcsec_text, from_step, print_understood
from rigidsim.errors import ConfigError, RigidsimError
from rigidsim.scene.choices import method_named
from rigidsim.scene.readable import bytes_text, span_text
from rigidsim.scene.schema import editor_schema
from rigidsim.scene.sweep import Sweep
from rigidsim.session.progress import clock_text
from rigidsim.workflows.physics import ComparedModel, PhysicsPlan, required_physics
from rigidsim.workflows.plan import LevelCost, RunPlan
from rigidsim.workflows.read import load
from rigidsim.workflows.ready_scenes import by_subject, write_new
from rigidsim.workflows.sweeps.plan import SweepPlan, plan_sweep


def new(scene: str | None, name: str | None) -> None:
    """Write a ready scene, or list them by subject."""
    if scene is None:
        on = Page()
        rows: list[tuple[Styled, Styled]] = []
        for subject, scenes in by_subject():
            rows += [("", ""), ("", (subject, "bold")), *scenes.items()]
        on.table(["scene", "what it is"], rows[1:])
        on.say("rigidsim new SCENE [NAME] writes NAME.toml, and next to it the tables that it reads")
        return
    path, *beside = write_new(scene, name)
    for other in beside:
        print(f"{other}: read by {path}")
    print(f"{path}: edit it, then: rigidsim check {path}; rigidsim {_verb_of(path)} {path}")


def _verb_of(path: Path) -> str:
    return "sweep" if load(path).config.sweep is not None else "run"


def check(configs: list[Path], overrides: list[str] | None, as_json: bool) -> int:
    """Validate configs, and show what was understood of them."""
    valid = True
    for path in configs:
        found = validation.check(path, overrides=overrides or [])
        valid = valid and found.valid
        answer(as_json, found.as_dict(), _print_checked, found)
    return 0 if valid else 2


def _print_checked(found: validation.Checked) -> None:
    """Print the result of a check; errors go to stderr, as for all commands."""
    if not found.valid:
        print(f"rigidsim: {ConfigError(found.problems, found.source)}", file=sys.stderr)
        return
    on = Page()
    on.say((found.source, "bold"), "  ", ("valid", "bold green"))
    print_understood(found, found.loads, on)
    on.lines("warning", found.warnings, "bold red")


def plan(
    config: Path, overrides: list[str] | None, out: Path, physics: str | None, write: Path | None,
    force: bool, as_json: bool,
) -> None:  # fmt: skip
    """Say what would be integrated, of a sweep what one member of it would; or what the scene requires."""
    experiment = load(config, overrides=overrides or [])
    if physics is not None:
        report = reporting(experiment.config.name)
        found = required_physics(experiment, physics, out=out, write=write, force=force, told=report)
        answer(as_json, found.as_dict(), print_physics, found)
        return
    refuse_options('is for --physics ERROR, such as --physics "0.1 arcsec"', write=write, force=force)
    swept = None if experiment.config.sweep is None else plan_sweep(Sweep.of(experiment), out=out)
    made = planning.plan(experiment, out=out) if swept is None else swept.member
    if as_json:
        print_json((swept or made).as_dict())
        return
    if swept is not None:
        print_sweep_plan(swept)
    print_plan(made)


def tradeoff(
    config: Path, overrides: list[str] | None, out: Path, budget: float, repeats: int, full: bool,
    files: list[str] | None, force: bool, as_json: bool,
) -> None:  # fmt: skip
    """Measure speed against accuracy of a scene."""
    experiment = load(config, overrides=overrides or [])
    report = reporting(experiment.config.name)
    result = measuring.tradeoff(
        experiment, others=[_file_and_seconds(text) for text in files or ()],
        out=out, budget=budget, repeats=repeats, full=full, force=force, told=report,
    ).as_dict()  # fmt: skip
    answer(as_json, result, print_tradeoff, result)


def _file_and_seconds(text: str) -> tuple[Path, float]:
    file, _, seconds = text.rpartition(",")
    try:
        return Path(file), float(seconds)
    except ValueError:
        raise RigidsimError(
            f"--with: given {text}; a file and its CPU time in s are allowed: theirs.csv,1.7"
        ) from None


def schema() -> None:
    """Print the config's JSON schema; ``rigidsim.workflows.read`` registers every kind of load."""
    print_json(editor_schema(), indent=2)


# --- output -------------------------------------------------------------------------------------------------

_MOST_LINES = 40  # of equations
_DIGITS = 6
_NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d*)?(?:e[+-]?\d+)?(?![\w.])")


def print_plan(plan: RunPlan) -> None:
    """Print the result of ``rigidsim plan``."""
    on = Page()
    on.say((plan.name, "bold"), f"  {plan.state_count} states, {plan.formulation}")
    print_understood(plan, plan.loads, on)
    for surface in plan.switching:
        on.say(f"  steps end on the kinks and jumps of {surface.surface} ({surface.where})")
    if plan.turning:
        on.say(f"  turns of {', '.join(plan.turning)} count: steps are taken one by one")
    reasons: list[list[Styled]] = [[row.states, row.why] for row in plan.reasons]
    reasons += [[(f"no {row.what}", "dim"), (row.why, "dim")] for row in plan.left_out]
    on.table(["states", "carried because"], reasons)
    _print_equations(plan.shared_terms, plan.equations, on)
    on.table(["invariant", "holds because"], [[row.name, row.why] for row in plan.invariants])
    on.line("recorded", ", ".join(plan.recorded))
    predicted, pilot = plan.predicted, plan.pilot
    held = ", invariants projected" + from_step(plan.hold_from_step) if plan.hold_invariants else ""
    order = "" if plan.taylor_order is None else f", Taylor order {plan.taylor_order}"
    on.line("settings", f"{plan.precision} precision, tolerance {plan.tolerance:.3g}{order}{held}")
    if not method_named(plan.method).has_steps:
        on.line("method", f"{plan.closed_form}: no steps are taken")
    elif plan.closed_form is not None:
        on.line("closed", f'{plan.closed_form}: method = "closed_form" would take no steps')
    _print_levels(plan.levels, on)
    if plan.accuracy is not None:
        on.line("chosen", f"{plan.accuracy.chosen}: {plan.accuracy.why}")
    first = "" if predicted.pace is not None else " at first"
    on.line(
        "forecast",
        f"{predicted.steps:.3g} steps of about {span_text(pilot.step)}{first} "
        f"(pilot of {pilot.steps:.0f}), {span_text(predicted.total_seconds)}, "
        f"{bytes_text(predicted.memory_bytes)} of memory, dataset {bytes_text(predicted.dataset_bytes)}, "
        f"timeline {bytes_text(predicted.timeline_bytes)}",
    )
    if predicted.pace is None:
        on.line("", "with steps as at the start, which torques change: fewer where they brake the rotation")
    on.lines("warning", plan.warnings, "bold red")
    error = predicted.attitude_error_rad
    if error is not None and math.isfinite(error):
        factor = predicted.amplification
        unstable = f", {factor:.1g} times amplified by the motion" if factor > 1 else ""
        law = "invariants projected" if predicted.held else "rounding that grows as t^1.5"
        averaged = plan.formulation.endswith("_averaged")
        words = "momentum's direction integrated to" if averaged else "attitude uncertain by"
        on.line("accuracy", f"{words} about {error:.1e} rad at the end ({law}{unstable})")
        seen = predicted.growth_seconds
        if seen:
            on.line(
                "",
                f"if errors keep growing as in the first {span_text(seen)}; the run reports later growth",
            )


def _print_levels(levels: list[LevelCost], on: Page) -> None:
    """Print what each model would cost, and leave out."""
    rows: list[list[Styled]] = []
    for row in levels:
        known = row.steps is not None and row.cpu_seconds is not None
        cost = [f"{row.steps:,.0f}", span_text(row.cpu_seconds or 0.0, 2)] if known else ["", ""]
        error = "" if row.error_rad is None else f"{row.error_rad:.1e} rad" if row.error_rad else "none"
        rows.append([row.level, *cost, error, row.why_not or ("taken", "bold")])
    if rows:
        on.table(["model", "steps", "CPU", "leaves out", ""], rows)


def _print_equations(shared: Sequence[str], equations: Sequence[str], on: Page) -> None:
    """Shared terms and the equations with them, with numbers to six digits; of many lines the first."""
    on.say(("equations (internal units: powers of two)", "bold"))
    lines: list[str] = []
    for equation in [*shared, *equations]:
        lines += textwrap.wrap(
            _NUMBER.sub(lambda found: f"{float(found[0]):.{_DIGITS}g}", equation),
            max(on.width, 40),
            initial_indent="  ",
            subsequent_indent=" " * 8,
            break_long_words=False,
            break_on_hyphens=False,
        )
    for line in lines[:_MOST_LINES]:
        on.say(line, whole=True)
    more = len(lines) - _MOST_LINES
    if more > 0:
        on.say((f"  and {more} more lines; `--json` has all of them, with all digits", "dim"))


def print_sweep_plan(made: SweepPlan) -> None:
    """Print what a sweep would run, and what it would cost."""
    on = Page()
    on.say((made.name, "bold"), f": {made.members:,} members ({made.mode})")
    rows: list[list[Styled]] = []
    for axis in made.axes:
        unit = axis.unit if axis.unit not in (None, "1") else ""
        ends = _brief(axis.first), f"{_brief(axis.last)} {unit}"
        rows.append([axis.name, axis.key, f"{axis.count:,}", *ends])
    on.table(["axis", "key", "values", "from", "to"], rows, ruled=False)
    predicted = made.predicted
    on.line("keep", ", ".join(made.keep))
    on.line("blocks", f"{made.tiles:,} of {made.tile:,} members (--tiles runs some of them)")
    each = f"{predicted.seconds_per_member:.2g} s a member"
    on.line("time", f"{clock_text(predicted.total_seconds)} on one core, {each}")
    on.line("disk", f"about {predicted.dataset_bytes / 1e6:.3g} MB, and as much for the blocks (tiles/)")
    on.say("")
    on.say("one member:")


def _brief(text: str) -> str:
    return text if len(text) <= 24 else text[:21] + "..."


def print_tradeoff(result: dict[str, Any]) -> None:
    """Print the result of ``rigidsim tradeoff``, from ``Tradeoff.as_dict``."""
    on = Page()
    on.say((result["name"], "bold"), "  for this accuracy, use this")
    rows = []
    over = result["measured_seconds"]
    marked = False
    for row in result["advice"]:
        reach = f"<= {row['at_most']:.0e}"
        if row["more_than"] * 10 < row["at_most"] * 0.5:
            reach += f" to {row['more_than'] * 10:.0e}"
        marked = marked or row["less"]
        star = " *" if row["less"] else ""
        spent = "" if row["cpu_seconds"] is None else span_text(row["cpu_seconds"])
        cost = [f"{row['cost']:.3g}", spent]
        rows.append([reach, *cost, f"{row['error']:.1e}{star}", ", ".join(row["keys"])])
    on.table(["attitude error, rad", "cost", "CPU", "error reached", "keys of [integrator]"], rows)
    if marked:
        less = next(row["seconds"] for row in result["advice"] if row["less"])
        on.say(f"  * over the first {span_text(less)} only: quadruple precision is slow")
    for other in result["others"]:
        on.line(
            "with",
            f"{other['name']}: {other['error_rad']:.1e} rad at {other['cpu_ratio']:.3g}, {other['verdict']}",
        )
    part = over / result["horizon_seconds"]
    how_much = "all" if part >= 1 else f"the first {100 * part:.2g} %"
    some = sum(not row["reason"] for row in result["settings"])
    some_of = f"{some} of {len(result['settings'])} settings, {how_much} of "
    on.line("measured", f"{some_of}{span_text(result['horizon_seconds'])}; nothing is extrapolated")
    on.line("compared", f"{result['compared']}; largest error at up to 38 times")
    on.line("against", result["reference"])
    on.line(
        "cost",
        "CPU time of integration relative to double precision in quaternions, and in seconds on this "
        f"machine for what was measured; {result['processes']} fresh processes, medians, without recording",
    )
    if result["closed_form"] != "yes":
        on.line("exact", f"no: {result['closed_form'].removeprefix('none: ')}")
    _not_measured(on, result["settings"])
    if result["folder"]:
        on.line("folder", result["folder"])


def _not_measured(on: Page, settings: list[dict[str, Any]]) -> None:
    """Print settings without numbers, those with the same reason together."""
    reasons: dict[str, list[str]] = {}
    for row in settings:
        if row["reason"]:
            reasons.setdefault(row["reason"], []).append(row["setting"])
    for reason, names in reasons.items():
        many = f"{len(names)} settings, from {names[0]} on" if len(names) > 4 else "; ".join(names)
        on.line("no data", f"{many}: {reason}", "yellow")


_HEADS = ["left out", "largest", "rms", "operations", "steps", "", "what it is"]


def print_physics(plan: PhysicsPlan) -> None:
    """Print the result of ``rigidsim plan --physics``."""
    on = Page()
    on.say(
        (plan.name, "bold"),
        f"  over {span_text(plan.span_s)}, {plan.samples:,} samples; the full model: "
        f"{plan.full.operations:,} operations, {plan.full.steps:,} steps",
    )
    if plan.compared != "quaternion":
        on.line("compared", f"{plan.compared}, since the config's model keeps no attitude")
    rows: list[list[Styled]] = []
    for row in plan.effects:
        angles = [arcsec_text(x) for x in (row.largest_arcsec, row.rms_arcsec)]
        needed: Styled = ("required", "bold") if row.required else ""
        rows.append([row.code, *angles, f"{row.operations:,}", f"{row.steps:,}", needed, row.words])
    on.table(_HEADS, rows)
    for level in plan.averaged:
        text = f"{level.level}: {arcsec_text(level.largest_arcsec)} between the axes; it keeps no attitude"
        on.line("averaged", text)
    on.say("not assessed:")
    on.lines("", (f"{absent.what}: {absent.why}" for absent in plan.not_assessed))
    least = plan.least
    without = ", ".join(least.left_out) or "nothing: every effect is required"
    on.line("least", f"within {arcsec_text(plan.error_arcsec)} leave out {without}", "bold")
    on.line("", _errors_and_cost(least))
    for model in plan.tried[:-1]:
        on.line("tried", f"without {', '.join(model.left_out)}: {_errors_and_cost(model)}")
    on.line("", "the least found; another set of effects may be smaller or cheaper")
    spent = [row.cpu_seconds for row in plan.effects]
    ends = [span_text(min(spent), 2), span_text(max(spent), 2)]
    whole = plan.full.cpu_seconds + sum(spent) + sum(x.cpu_seconds for x in plan.tried if len(x.left_out) > 1)
    on.line(
        "CPU",
        f"{span_text(plan.full.cpu_seconds, 2)} the full model, {' to '.join(dict.fromkeys(ends))} without "
        f"an effect, {span_text(whole, 2)} all runs",
    )
    on.lines("warning", plan.warnings, "bold red")
    on.line("runs", plan.folder)
    on.line("figure", plan.figure)
    if plan.written is not None:
        on.line("config", f"{plan.written}; rigidsim run {plan.written}")


def _errors_and_cost(model: ComparedModel) -> str:
    return (
        f"{arcsec_text(model.largest_arcsec)} at most, {arcsec_text(model.rms_arcsec)} rms, measured "
        f"({arcsec_text(model.expected_arcsec)} as the sum of its effects); "
        f"{model.operations:,} operations, {model.steps:,} steps"
    )
