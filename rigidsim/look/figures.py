"""The standard figures of a run on one page, as PNG or SVG."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigidsim.look.page import headline, largest_drift
from rigidsim.look.roles import drifts
from rigidsim.look.thinning import thin

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg")
FULL_READ = 2_000_000  # samples up to which all drifts are read for their largest value
POINTS = 4000  # of a curve at most: more than there are pixels to show them

STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlecolor": "#1b2733",
    "axes.titlepad": 7.0,
    "axes.labelcolor": "#333333",
    "axes.edgecolor": "#9aa0a6",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e7eb",
    "grid.linewidth": 0.7,
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "mathtext.fontset": "dejavusans",
    "svg.fonttype": "path",
    "savefig.facecolor": "white",
}


def save_figure(dataset: xarray.Dataset, path: Path, *, file_format: str | None = None) -> Path:
    """Draw rates, attitude, drifts, polhode and, where it was recorded, position.

    Args:
        dataset: of a run; what is missing leaves its place to the others. It may be lazy: at most
            4000 rows are read.
        path: the file; it is whole when this returns.
        file_format: see `figure_format`; by default what the suffix of `path` says.

    Returns:
        `path`.

    Raises:
        ValueError: another suffix, or a dataset without samples.
    """
    file_format = file_format or figure_format(path)
    from matplotlib import rc_context

    shown = thin(dataset, POINTS).assign_attrs(dataset.attrs)
    # A figure of few points shouldn't understate the drifts, unless reading them all takes long.
    complete = dataset.sizes["time"] <= max(FULL_READ, shown.sizes["time"])
    whole = dataset if complete else shown
    largest = {name: largest_drift(drift) for name, drift in drifts(whole).items()}
    # The object-oriented interface: no pyplot, no state that outlives the call.
    with rc_context(STYLE):  # type: ignore[arg-type]
        _page(shown, largest=largest, complete=complete).savefig(path, dpi=160, format=file_format)
    return path


def figure_format(path: Path) -> str:
    """What a file's suffix asks for: "png" or "svg".

    Raises:
        ValueError: another suffix.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(
            f"figure {path.name!r}: the suffix must be one of {', '.join(SUFFIXES)}, given {path.suffix!r}"
        )
    return path.suffix.lower()[1:]


def _page(dataset: xarray.Dataset, *, largest: dict[str, float], complete: bool) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    from rigidsim.look import panels

    curves = [panel for panel in panels.CURVES if panel.shows(dataset)]
    spaces = [panel for panel in panels.SPACES if panel.shows(dataset)]
    rows = max(len(curves), 2)
    size = (12.0 if spaces else 8.0, 2.55 * rows + 0.75 + 1.6 * (len(spaces) > 1))
    figure = Figure(figsize=size, layout=ConstrainedLayoutEngine(h_pad=0.1, w_pad=0.08))
    FigureCanvasAgg(figure)
    figure.suptitle(headline(dataset), x=0.012, ha="left", fontsize=14, fontweight="bold", color="#1b2733")
    widths = [1.38, 1.0] if curves and spaces else [1.0]
    outer = figure.add_gridspec(1, len(widths), width_ratios=widths)
    if curves:
        grid = outer[0].subgridspec(len(curves), 1)
        first = None
        for row, panel in enumerate(curves):
            axes = figure.add_subplot(grid[row], sharex=first)
            first = first or axes
            panel.draw(axes, dataset)
            panels.time_axis(axes, dataset, labelled=row == len(curves) - 1)
    if spaces:
        heights = [1.0] * len(spaces) + [0.42]
        grid = outer[-1].subgridspec(len(heights), 1, height_ratios=heights)
        for row, panel in enumerate(spaces):
            panel.draw(figure.add_subplot(grid[row], projection="3d"), dataset)
        panels.facts(figure.add_subplot(grid[-1]), dataset, largest=largest, complete=complete)
    return figure
