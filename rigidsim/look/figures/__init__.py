"""Figures of a recorded run: from a Dataset to a matplotlib figure, or a file.

Importing this package loads no matplotlib; drawing does.

| module | holds |
| --- | --- |
| `catalogue` | all figures by name, `figure`, and `overview`, the page that suits the scene |
| `rigidsim.look.figure_names` | their names, and what each shows in one line |
| `saving` | `save_figure`: to PNG or SVG |
| `composing` | panels to a page |
| `timelines` | panels over time |
| `poles` | panels of where axes point: polar motion, pole path, nutation, tip, libration |
| `polhode` | polhode, herpolhode, Poinsot's motion |
| `flight` | the path of the centre of mass |
| `drift` | drifts against what rounding explains |
| `eye` | bodies in three dimensions on plain axes |
| `fits` | secular parts, periods and ellipses for labels |
| `scales` | units in which axes read well |
| `style` | colours, fonts, the page's heading, keys |
"""

from rigidsim.look.figure_names import FIGURES, OVERVIEW
from rigidsim.look.figures.catalogue import available, check_name, figure, overview
from rigidsim.look.figures.saving import SUFFIXES, figure_format, save_figure

__all__ = [
    "FIGURES", "OVERVIEW", "SUFFIXES", "available", "check_name", "figure", "figure_format", "overview",
    "save_figure",
]  # fmt: skip
