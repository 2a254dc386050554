"""Figures of a recorded run: from a Dataset to a matplotlib figure, or a file.

Importing this package loads matplotlib, so import it only where a figure is drawn; ``look.figure_names``
has the names of all figures without it. A figure is an entry of ``catalogue.KINDS``: what it needs, and its
panels (``panel.Panel``: what it finds in a dataset, and how that is drawn).

| module | holds |
| --- | --- |
| `catalogue` | all figures by name; `figure`, `save_figure`, and the page that suits the scene |
| `panel`, `composing` | what a panel is, and units of its axes; panels composed to a page |
| `timelines`, `drift` | panels over time |
| `poles`, `polhode` | where axes point, and a body's path; polhode, herpolhode, Poinsot's motion |
| `eye` | bodies in three dimensions on plain axes |
| `librations` | panels of a body that turns one face to its source |
| `slides` | one panel in large letters, on a light or a dark ground |
| `style` | colours, fonts, the page's heading, keys |
| `spectrum`, `work_precision`, `sweep_maps`, `sweep_axes` | figures of `analyse`, `tradeoff` and `sweep` |
| `fitted`, `fitted_members` | figures of a fit, and of a sweep of fits |
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
