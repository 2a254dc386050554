"""Output of ``rigidsim plan --physics``: what each effect is worth, and the least model that will do."""

from __future__ import annotations

from rigidsim.cli.screens.page import Page, Styled
from rigidsim.cli.screens.summary import arcsec_text
from rigidsim.scene.readable import span_text
from rigidsim.workflows.physics.required import ComparedModel, PhysicsPlan

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
        on.line(
            "averaged",
            f"{level.level}: {arcsec_text(level.largest_arcsec)} between the axes; it keeps no attitude",
        )
    on.say("not assessed:")
    for absent in plan.not_assessed:
        on.line("", f"{absent.what}: {absent.why}")
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
    for warning in plan.warnings:
        on.line("warning", warning, "bold red")
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
