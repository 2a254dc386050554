"""The page that the viewer opens with for several runs side by side.

Imports rerun when it is loaded, so load it only where a recording is written.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import rerun.blueprint as rrb

from rigidsim.look.blueprint import PIXELS, legend_view, plot_view, space_view, tabs, time_panel
from rigidsim.look.clock import Clock
from rigidsim.look.plots import Plot
from rigidsim.look.plotting import legend_lines, legend_of

if TYPE_CHECKING:
    from rigidsim.look.drawn import DrawnRun


def build_comparison(runs: Sequence[DrawnRun], clock: Clock, difference: Plot | None) -> rrb.Blueprint:
    """The layout for runs side by side.

    Args:
        runs: each with one stage, under names of its own.
        clock: clock of all times.
        difference: distances between their attitudes, if known.
    """
    spaces = [space_view(run.picture.stages[0], run.clock, narrow=True, subject=run.subject) for run in runs]
    legend = legend_of(runs[0].picture.stages)
    height = 30.0 + 24.0 * legend_lines(legend)
    texts = [
        rrb.TextDocumentView(origin=f"/{page.lower()}", name=run.picture.stages[0].title.split(":")[0])
        for run in runs
        for page in run.pages
    ]
    half = -(-len(spaces) // 2)
    scene = (
        rrb.Horizontal(*spaces)
        if len(spaces) <= 3
        else rrb.Vertical(rrb.Horizontal(*spaces[:half]), rrb.Horizontal(*spaces[half:]))
    )
    shares = [PIXELS * 0.7 - height, height, PIXELS * 0.3]
    left = rrb.Vertical(scene, legend_view(legend), tabs(texts), row_shares=shares)
    common: dict[str, list[Plot]] = {}
    for run in runs:
        for plot in run.plots:
            common.setdefault(plot.key, []).append(plot)
    joined = [
        replace(
            same[0],
            series=[one for plot in same for one in plot.series],
            levels=[one for plot in same for one in plot.levels],
        )
        for same in common.values()
    ]
    views = [] if difference is None else [plot_view(difference)]
    views += [plot_view(plot) for plot in joined if plot.place == "leading"][: 4 - len(views)]
    views += [plot_view(plot) for plot in joined if plot.place == "drift"]
    turns = max(run.turns for run in runs)
    return rrb.Blueprint(
        rrb.Horizontal(left, rrb.Vertical(*views), column_shares=[5, 3.4]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        time_panel(clock, turns, following=False),
    )
