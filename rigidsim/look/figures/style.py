"""Style of figures: colours, fonts, the empty page with its heading, and curves with their key."""

import io
import itertools
import re
import textwrap
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec

import numpy as np
import xarray
from matplotlib import colormaps, rc_context, rcParams
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import MaxNLocator

from rigidsim.look.curves import HUES, XYZ
from rigidsim.look.curves import PALETTE as NAMES
from rigidsim.look.signals import OVER_TIME, finite_rows, joined, title_of
from rigidsim.look.solids import Array

P = ParamSpec("P")
PALETTE = tuple(HUES[name][0] for name in NAMES)
X, Y, Z = (HUES[name][0] for name in XYZ)
BLUE, ORANGE, VIOLET, PINK, GREY = (HUES[n][0] for n in ("blue", "orange", "violet", "pink", "grey"))
INK, PALE = "#1b2733", "#c3cbd5"
START = "#0d0887"

MOST_VECTOR_POINTS = 6000  # of a curve in an SVG; longer ones become pixels there
_KEY_ROW = 12.4  # height of a row of a key, points
_KEY_LETTER, _TITLE_LETTER = 4.9, 6.1  # mean widths of a letter, points
_MARGIN = 0.08  # of a square panel
_HEADING = (0.34, 0.26)  # inches of the page's two heading lines

STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlecolor": INK,
    "axes.titlepad": 7.0,
    "axes.labelcolor": "#333333",
    "axes.edgecolor": "#9aa0a6",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
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


class ShownFigure(Figure):
    """A figure on the Agg canvas that is saved in the style, and that a notebook shows by itself."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        FigureCanvasAgg(self)

    def savefig(self, *args: Any, **options: Any) -> None:
        """As of matplotlib, in the style."""
        with rc_context(STYLE):  # type: ignore[arg-type]
            super().savefig(*args, **{"dpi": 140} | options)

    def _repr_png_(self) -> bytes:
        """PNG picture, which IPython asks for."""
        data = io.BytesIO()
        self.savefig(data, format="png", dpi=100)
        return data.getvalue()


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """A drawing function whose figures have the style."""

    @wraps(draw)
    def drawn(*args: P.args, **options: P.kwargs) -> Figure:
        with rc_context(STYLE):  # type: ignore[arg-type]
            return draw(*args, **options)

    return drawn


def sheet(title: str, width: float, height: float) -> ShownFigure:
    """An empty page (inches) below a title."""
    figure = ShownFigure(figsize=(width, height), layout="constrained")
    figure.suptitle(title, x=0.01, ha="left", fontsize=12.5, fontweight="bold", color=INK)
    return figure


def blank(dataset: xarray.Dataset, width: float, height: float) -> Figure:
    """An empty page (inches; height below the heading) with the run's name and description above."""
    description = " ".join(str(dataset.attrs.get("comment", "")).split())
    title = title_of(dataset)
    if description == title:
        description = ""
    top = _HEADING[0] + (_HEADING[1] if description else 0.0) + 0.08
    whole = height + top
    engine = ConstrainedLayoutEngine(h_pad=0.09, w_pad=0.09, rect=(0.0, 0.0, 1.0, 1.0 - top / whole))
    figure = ShownFigure(figsize=(width, whole), layout=engine)
    for words, down, size, weight, color in (
        (title, 0.12, 13.5, "bold", INK),
        (description, _HEADING[0] + 0.07, 10.0, "normal", GREY),
    ):
        text = figure.text(
            0.14 / width, 1 - down / whole, words, va="top", gid="heading", fontsize=size, fontweight=weight,
            color=color,
        )  # fmt: skip
        share = (width - 0.28) * figure.dpi / max(text.get_window_extent().width, 1.0)
        if share < 1:
            text.set_text(textwrap.shorten(words, int(0.97 * share * len(words)), placeholder=" …"))
    return figure


def titled(axes: Axes, title: str, *, rows: int = 0) -> None:
    """Set a panel's title, broken to its width, with room below for a key of so many rows."""
    text = textwrap.fill(title, max(int(_room(axes) / _TITLE_LETTER), 20))
    axes.set_title(text, pad=7.0 + (3.0 + rows * _KEY_ROW * _larger() if rows else 0.0))


def key(axes: Axes, title: str) -> None:
    """Set the title, and between it and the panel the key to all that has a label."""
    found, labels = axes.get_legend_handles_labels()
    if not found:
        titled(axes, title)
        return
    widths = [len(re.sub(r"[${}_\\]", "", label)) * _KEY_LETTER + 24.0 for label in labels]
    room = _room(axes)
    fits = len(found) if sum(widths) <= room else int(room // max(widths))
    columns = max(1, min(len(found), fits))
    titled(axes, title, rows=-(-len(found) // columns))
    legend = axes.legend(
        handles=found, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.1,
        borderpad=0.15, handlelength=1.2, columnspacing=1.2, handletextpad=0.5, labelspacing=0.25,
    )  # fmt: skip
    for line in legend.get_lines():
        line.set(linewidth=1.8, alpha=1.0, **({"markersize": 9.0} if line.get_marker() == "." else {}))


def _room(axes: Axes) -> float:
    """Approximate width of a panel in points, before the page is laid out, for letters of the usual size."""
    return float(axes.get_position().width * axes.figure.bbox.width / axes.figure.dpi * 79.2 / _larger())


def _larger() -> float:
    """How many times larger letters are than on a page, as on slides."""
    return float(rcParams["legend.fontsize"]) / float(STYLE["legend.fontsize"])


def curve(
    axes: Axes, x: Array, y: Array, *, in_plane: bool = False, sparse: bool = False, **style: Any
) -> None:
    """Draw a curve over time, or in a plane; if the samples aren't dense enough, or are known to be `sparse`,
    its samples as points.

    Long ones are drawn as pixels in an SVG, which otherwise would weigh megabytes.
    """
    style.setdefault("rasterized", len(x) > MOST_VECTOR_POINTS)
    whole = not sparse and (joined(np.stack([x, y], axis=1)) if in_plane else joined(y, OVER_TIME))
    if not whole:
        size = float(np.clip(9000 / max(len(x), 1), 2.0, 4.0))
        style |= {"linestyle": "none", "marker": ".", "markersize": size, "markeredgewidth": 0.0}
    axes.plot(x, y, **style)


def trace(axes: Axes, x: Array, y: Array, *, sparse: bool = False, later: str = "later") -> None:
    """Draw a path in a plane: of many turns about the origin the first stand out, otherwise coloured by time;
    of samples that aren't dense enough, or are known to be `sparse`, the points.

    The start, the first point, is marked. All that stands out has a label. ``later``: what later points are.
    """
    points = np.stack([x, y], axis=1)
    many = len(x) > MOST_VECTOR_POINTS
    axes.plot(x[0], y[0], "o", color=START, ms=4.5, zorder=5, lw=0, label="start")
    if sparse or not joined(points):
        size = float(np.clip(9000 / max(len(x), 1), 1.2, 12.0))
        hues = np.linspace(0.0, 0.86, len(x))
        axes.scatter(x, y, c=hues, cmap="plasma", vmin=0, vmax=1, s=size, lw=0, rasterized=many)
        axes.plot([], [], ".", color=colormaps["plasma"](0.6), lw=0, label=f"lighter: {later}")
        return
    first, label = _first_turns(points)
    if first:
        axes.plot(x[:first], y[:first], color=BLUE, lw=1.5, zorder=3, label=label)
        axes.plot(x[first - 1 :], y[first - 1 :], color=PALE, lw=0.8, label="the rest", rasterized=many)
        return
    # In pieces of one colour: a line per sample would be tens of thousands of objects.
    pieces = min(200, max(len(x) - 1, 1))
    edges = np.linspace(0, len(x) - 1, pieces + 1).astype(int)
    parts = [points[a : b + 1] for a, b in itertools.pairwise(edges)]
    hues = colormaps["plasma"](np.linspace(0.0, 0.86, pieces))
    axes.add_collection(LineCollection(parts, colors=hues, linewidths=1.4, rasterized=many))
    axes.plot([], [], color=colormaps["plasma"](0.6), label=f"lighter: {later}")


def _first_turns(points: Array) -> tuple[int, str]:
    """Rows of the first turns about the origin, and their name; 0 rows if there are few turns in all."""
    if not np.isfinite(points).all():
        return 0, ""
    angle = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    turns = abs(angle[-1] - angle[0]) / (2 * np.pi)
    if turns < 1.6:
        return 0, ""
    count = 1 if turns < 15 else 3
    rows = int(np.flatnonzero(np.abs(angle - angle[0]) > 2 * np.pi * count)[0]) + 1
    radius = np.hypot(*points.T)
    if radius[:rows].max() < 0.6 * radius.max():  # it spirals out of the centre
        return int(np.flatnonzero(radius > 0.98 * radius.max())[0]) + 2, "first way out"
    return rows, "first turn" if count == 1 else f"first {count} turns"


def square(axes: Axes, x: Array, y: Array) -> None:
    """Equal scales on both axes, about all finite points (x, y)."""
    points = finite_rows(np.stack([x, y], axis=1))
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(2), np.ones(2))
    middle = (low + high) / 2
    reach = max((high - low).max() / 2, 1e-12 * np.abs(middle).max()) or 1.0
    low, high = (middle + sign * (1 + 2 * _MARGIN) * reach for sign in (-1, 1))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_aspect("equal", adjustable="box")
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.yaxis.set_major_locator(MaxNLocator(5))
