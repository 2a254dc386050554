"""Output of ``rigidsim tradeoff``."""

from __future__ import annotations

from typing import Any

from rigidsim.cli.screens.page import Page
from rigidsim.scene.readable_time import span_text


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
        rows.append([reach, f"{row['cost']:.3g}", f"{row['error']:.1e}{star}", ", ".join(row["keys"])])
    on.table(["attitude error, rad", "cost", "error reached", "keys of [integrator]"], rows)
    if marked:
        less = next(row["seconds"] for row in result["advice"] if row["less"])
        on.say(f"  * over the first {span_text(less)} only: quadruple precision is slow")
    part = over / result["horizon_seconds"]
    how_much = "all" if part >= 1 else f"the first {100 * part:.2g} %"
    on.line("measured", f"{how_much} of {span_text(result['horizon_seconds'])}; nothing is extrapolated")
    on.line("compared", f"{result['compared']}; largest error at up to 38 times")
    on.line("against", result["reference"])
    on.line(
        "cost",
        f"CPU time of integration over that of double precision in quaternions, {result['processes']} fresh "
        f"processes, medians; recording not counted",
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
