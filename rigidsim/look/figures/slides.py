"""Figures for slides: one panel of a run, in large letters, on a light or a dark ground."""

from __future__ import annotations

from typing import Any

from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axis import Tick
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.spines import Spine
from matplotlib.text import Text

from rigidsim.look.figures.composing import Shown, draw_first, first_swings, time_axis
from rigidsim.look.figures.panels import Panel
from rigidsim.look.figures.style import PALE, STYLE, blank
from rigidsim.look.plots import Plot

GROUNDS = ("light", "dark")
_DARK, _BRIGHT, _GRID = "#14171d", "#f1f3f5", "#2c323c"
_FADED = "#566071"
_LETTERS = 1.3  # on a page of half a slide's width, which is enlarged again where it is shown
_WIDE, _HIGH = 7.6, 3.6  # inches; with its heading about 16:9
_THICK = 1.5  # lines, times
_LUMINOUS = 0.45  # relative luminance, below which a colour is raised on a dark ground


def slide(shown: Shown, panel: Panel, found: Any, ground: str) -> Figure:
    """One panel of a run; of many swings over time the first, as they can be followed on a wall.

    Raises:
        ValueError: a ground that is none of ``GROUNDS``.
    """
    if ground not in GROUNDS:
        raise ValueError(f"--for-slides: given {ground!r}; {' or '.join(GROUNDS)} is allowed")
    style = {key: _LETTERS * value if _is_size(key) else value for key, value in STYLE.items()}
    style["lines.linewidth"] = _THICK * STYLE["lines.linewidth"]
    with rc_context(style):  # type: ignore[arg-type]
        figure = blank(shown.rows, _WIDE, _HIGH)
        axes = figure.add_subplot()
        begins = first_swings(panel, found, shown) if isinstance(found, Plot) else 0.0
        if begins:
            draw_first(axes, panel, shown, begins)
        else:
            panel.draw(axes, shown.rows, found)
        if isinstance(found, Plot) and not begins:
            time_axis(axes, shown.rows, labelled=True)
        if ground == "dark":
            darkened(figure)
        figure.draw_without_rendering()
    return figure


def _is_size(key: str) -> bool:
    return key.endswith(("size", "titlepad"))


def darkened(figure: Figure) -> None:
    """Turn a drawn figure to a dark ground: letters and lines of the frame bright, dark colours raised."""
    figure.set_facecolor(_DARK)
    for artist in figure.findobj(_coloured):
        _raise(artist)
    for axes in figure.axes:
        axes.set_facecolor(_DARK)
        axes.tick_params(colors=_BRIGHT, grid_color=_GRID)


def _coloured(artist: Artist) -> bool:
    return hasattr(artist, "get_color") or isinstance(artist, Spine)


def _raise(artist: Any) -> None:
    if isinstance(artist, Tick):
        return
    if isinstance(artist, Spine):
        artist.set_edgecolor("#6b7280")
    elif isinstance(artist, Text):
        artist.set_color(_readable(artist.get_color(), 1.0))
        for effect in artist.get_path_effects():  # the pale rim of letters on a light ground
            getattr(effect, "_gc", {}).update(foreground=_DARK)
    else:
        color = artist.get_color()
        if not isinstance(color, str) or color == "none":
            return  # of a collection, coloured by a map
        artist.set_color(_FADED if color == PALE else _readable(color, 0.4))  # what others stand out from


def _readable(color: Any, share: float) -> str:
    """The colour, mixed with that share of the bright one if it is too dark to be seen."""
    rgb = to_rgb(color)
    luminance = sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), rgb, strict=True))
    if luminance >= _LUMINOUS:
        return to_hex(rgb)
    grey = max(rgb) - min(rgb) < 0.2
    part = 1.0 if grey else min(share, 0.45)
    red, green, blue = ((1 - part) * c + part * b for c, b in zip(rgb, to_rgb(_BRIGHT), strict=True))
    return to_hex((red, green, blue))
