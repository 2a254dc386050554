"""Output of runs and plans on models: how far an averaged one is from the full one, and at what cost."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rigidsim.cli.screens.page import Page, Styled
from rigidsim.scene.readable_time import span_text
from rigidsim.store.summary_parts import Modelling, TableErrors

if TYPE_CHECKING:
    from rigidsim.workflows.plan_levels import LevelCost

_YEAR = 365.25 * 86400  # s


def print_modelling(found: Modelling | None, on: Page) -> None:
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
        text += f"{found.oscillation:.1e} rad in each, growing by {found.growth * _YEAR:.1e} rad/yr"
        on.line("", text)
    if not (found.short_period or found.resonance or found.energy is not None):
        on.line("", "[model] short_period = true adds the nutation back that averaging removed")


def interpolated(name: str, found: TableErrors) -> str:
    """Accuracy of a tabulated orbit's interpolation, in words."""
    expected = found.direction * found.expected
    return (
        f'"{name}": interpolation misses the source by {found.direction:.1e} rad at most with every other '
        f"row left out, by about {expected:.0e} rad with all rows"
    )


def print_levels(levels: list[LevelCost], on: Page) -> None:
    """Print what each model would cost, and leave out."""
    rows: list[list[Styled]] = []
    for row in levels:
        known = row.steps is not None and row.cpu_seconds is not None
        cost = [f"{row.steps:,.0f}", span_text(row.cpu_seconds or 0.0, 2)] if known else ["", ""]
        error = "" if row.error_rad is None else f"{row.error_rad:.1e} rad" if row.error_rad else "none"
        rows.append([row.level, *cost, error, row.why_not or ("taken", "bold")])
    if rows:
        on.table(["model", "steps", "CPU", "leaves out", ""], rows)
