"""Figures of a recorded run: from a Dataset to a matplotlib figure, or a file.

Importing this package loads matplotlib, so import it only where a figure is drawn; ``look.figure_names``
has the names of all figures without it. A figure is an entry of ``catalogue.KINDS``: what it needs, and its
panels: what is found in a dataset (a `Plot`, a `Path`, or a function that draws).

| module | holds |
| --- | --- |
| `catalogue` | all figures by name: panels, composed to a page, or one of them on a slide |
| `surfaces` | polhode, Poinsot's motion, the momentum's sphere of a body with rotors |
| `style` | colours, fonts, the page's heading, keys |
| `spectrum`, `work_precision`, `sweeps` | figures of `analyse`, `tradeoff` and `sweep` |
| `fitted` | the figure of a fit |
"""

from rigidsim.look.figure_names import FIGURES, OVERVIEW
from rigidsim.look.figures.catalogue import (
    available,
    check_name,
    figure,
    figure_format,
    for_slides,
    save_figure,
)

__all__ = [
    "FIGURES", "OVERVIEW", "available", "check_name", "figure", "figure_format", "for_slides", "save_figure",
]  # fmt: skip
