"""All figures by name: panels as matplotlib draws them, composed to a page, alone on a slide, and to files.

A page has curves over time on the left, planes on the right, and the motion's own numbers below.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any, Self

import numpy as np
import xarray
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Tick
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.text import Text

from rigidsim.look import curves, paths, signals, sources
from rigidsim.look.curves import CURVES, HUES, STATES, Plot, crossings, moves, paper, screen
from rigidsim.look.figure_names import FIGURES, OVERVIEW, SPECTRUM
from rigidsim.look.figures import style, surfaces
from rigidsim.look.figures.style import GREY, INK, PALE, START, STYLE, Z, blank, curve, key, square, titled
from rigidsim.look.pages import leading, numbers
from rigidsim.look.paths import PATHS
from rigidsim.look.paths import Path as PlanePath
from rigidsim.look.record import scene_of
from rigidsim.look.signals import clock, from_start, need, optional
from rigidsim.look.thinning import thin
from rigidsim.scene.parts_of_values import BACKWARDS, in_time_order
from rigidsim.scene.readable import scaled, span_text, unit_for, with_unit

_HUES = {"spin axis": "orange", "momentum axis": "violet", "core axis": "pink"}
_BANDS = 400  # parts of a panel's width, each with the least and the largest value in it
MANY = 60  # swings of a curve that can't be followed
_LAST_TURNS = 10  # before a body is locked, in the phase plane
ROWS = 20_000  # that a figure draws

_TELLING = 0.5  # changes of sign to a sample: four samples a swing
_SETTLED, _SHORT = 0.05, 0.15  # of a curve's range, about its median; of a run that is shown enlarged
_CYCLES = 14  # swings shown of the start, where there are many
_NAME = 24  # letters that a name in the table has room for
_CURVE, _PLANE, _FACT = 2.55, 4.7, 0.235  # heights, inches
_WIDE, _NARROW = 12.4, 8.2
_ROW = 5.2  # width and height of planes that stand side by side, inches


Panel = Plot | PlanePath | Callable[[Axes], None]
Find = Callable[[xarray.Dataset], Panel | None]
Finders = Mapping[str, Find]
_Found = list[tuple[str, Panel]]
GROUNDS = ("light", "dark")
_DIM = 0.35  # of a colour map, the darkest that is seen on a dark ground
_DARK, _BRIGHT, _GRID = "#14171d", "#f1f3f5", "#2c323c"
_FADED = "#566071"
_LETTERS = 1.3  # on a page of half a slide's width, which is enlarged again where it is shown
_SLIDE = 7.6, 3.6  # inches; with its heading about 16:9
_THICK = 1.5  # lines, times
SUFFIXES = (".png", ".svg")
_DOTS, _SLIDE_DOTS = 160, 250  # per inch
_TURNS, _ATTITUDE = "angular_velocity recorded", "an attitude recorded"
_AXIS = "an attitude or an axis (figure_axis, momentum_axis, obliquity) recorded"


def draw(axes: Axes, dataset: xarray.Dataset, panel: Panel | None, *, dense: bool = True) -> None:
    """Draw a panel of a dataset in memory, if there is one, with title, labels and units; curves over time of
    `MANY` swings as bands between the extremes, if wanted (`dense`).
    """
    if isinstance(panel, Plot):
        _plot(axes, dataset, panel, dense=dense)
    elif isinstance(panel, PlanePath):
        _path(axes, dataset, panel)
    elif panel is not None:
        panel(axes)


def _plot(axes: Axes, dataset: xarray.Dataset, plot: Plot, *, dense: bool) -> None:
    """Draw curves over time, with bands of their uncertainty or of what is expected of them."""
    time = clock(dataset)[0]
    for column, label, hue in zip(plot.values.T, plot.labels, cycle(plot.hues), strict=False):
        color = paper(hue)
        if plot.log:
            axes.plot(time, np.where(column > 0, column, np.nan), color=color, label=label, lw=0.9)
        elif dense and len(time) >= 4 * _BANDS and crossings(column) > 2 * MANY:
            parts = np.arange(0, len(time), len(time) // _BANDS)
            low, high = np.fmin.reduceat(column, parts), np.fmax.reduceat(column, parts)
            at = np.append(time[parts[:-1]], time[-1])
            axes.fill_between(at, low, high, color=color, alpha=0.35, lw=0.6)
            axes.plot([], [], color=color, label=label)
        else:
            curve(axes, time, column, sparse=plot.sparse, color=color, label=label)
        if plot.error is not None:
            axes.fill_between(time, column - plot.error, column + plot.error, color=color, alpha=0.2, lw=0)
    if plot.log and (plot.band is not None or (plot.values > 0).any()):
        axes.set_yscale("log")
    if plot.band is not None:
        least, most = (
            np.nanpercentile(plot.values, [1, 100])
            if np.isfinite(plot.values).any()
            else plot.band[0][[0, 0]]
        )
        # what cancels to far less than a rounding says nothing, unless nothing else would be seen
        bottom = min(max(min(least, plot.band[0][0]), 0.02 * plot.band[0][0]), most) / 5
        axes.fill_between(time, bottom, plot.band[1], color="#e9edf2", lw=0, zorder=0)
        axes.set_ylim(bottom)
    if plot.steady is not None:
        axes.set_ylim(*plot.steady)
    if plot.from_zero:
        axes.set_ylim(0.0, 1.1 * axes.get_ylim()[1])
    key(axes, plot.title + (" (grey: what rounding explains)" if plot.band else ""))
    axes.set_ylabel(with_unit(plot.word, plot.unit))


def _path(axes: Axes, dataset: xarray.Dataset, path: PlanePath) -> None:
    """Draw a path, a cross at the origin as its center, and its surroundings."""
    later = "earlier" if dataset.attrs.get(BACKWARDS) else "later"
    style.trace(axes, *from_start(dataset, path.points).T, sparse=path.sparse, later=later)
    faint: dict[str, Any] = {"lw": 0.7, "alpha": 0.6, "zorder": 1, "sparse": path.sparse, "in_plane": True}
    for name, points in path.others.items():
        curve(axes, *points.T, color=paper(_HUES[name]), label=name, **faint)
    if path.ellipse is not None:
        axes.plot(*path.ellipse[0].T, color=INK, lw=1.1, ls=(0, (4, 2)), label=path.ellipse[1])
    if path.center:
        axes.plot(0, 0, "+", color=INK, ms=10, mew=1.3)
    if path.alike:
        square(
            axes, *np.vstack([path.points, *path.others.values(), np.zeros((1 if path.center else 0, 2))]).T
        )
    axes.set(xlabel=path.labels[0], ylabel=path.labels[1])
    key(axes, path.title + (f" (+: {path.center})" if path.center else ""))


@optional
def phases(dataset: xarray.Dataset) -> Panel:
    """Rates of libration, or of roll, pitch and yaw, against the angles; librations are closed curves."""
    table, options = need(curves.swings(dataset) or curves.regular(dataset))
    names = options["labels"]
    rate = np.gradient(table, signals.seconds(dataset), axis=0)
    (scale, unit), (speed, speed_unit) = scaled(table, "rad"), scaled(rate, "rad/s", dataset.attrs)

    def drawn(axes: Axes) -> None:
        for x, y, name, hue in zip((table / scale).T, (rate / speed).T, names, style.PALETTE, strict=False):
            curve(axes, x, y, in_plane=True, color=hue, lw=0.8, label=name)
        axes.set(xlabel=f"angle [{unit}]", ylabel=f"rate [{speed_unit}]")
        key(axes, "Phase planes")

    return drawn


@optional
def locking_phases(dataset: xarray.Dataset) -> Panel:
    """Rotation relative to the source against longitude within a turn: waves, and in the end a whirl."""
    longitude, found = need(curves.locked_longitude(dataset)), need(sources.seen(dataset))
    rate = dataset["angular_velocity"].values @ scene_of(dataset).figure
    middle, rate = float(np.mean(longitude[found.last])), rate - np.mean(rate[found.last])
    rest = slice(int(np.argmax(np.abs(longitude - middle) < 2 * np.pi * _LAST_TURNS)), None)
    speed, unit = scaled(rate[rest], "rad/s", dataset.attrs)
    # within half a turn of where it ends, that between -45 and 315 degrees
    centre = np.remainder(middle + np.pi / 4, 2 * np.pi) - np.pi / 4
    within = np.degrees(np.remainder(longitude[rest] - middle + np.pi, 2 * np.pi) - np.pi + centre)

    def drawn(axes: Axes) -> None:
        shades = np.linspace(0, 1, len(within))
        axes.scatter(within, rate[rest] / speed, c=shades, cmap="plasma", s=4, lw=0, rasterized=True)
        axes.set(xlabel="longitude under the source [deg]", ylabel=f"spin less that in the end [{unit}]")
        titled(axes, "Until it is locked (lighter: later)")

    return drawn


def flight(dataset: xarray.Dataset) -> Panel | None:
    """The path of the centre of mass, in a plane or in space."""
    position, flat = signals.place(dataset), paths.flight(dataset)
    if flat is not None or position is None:
        return flat
    position = from_start(dataset, position)
    scale, unit = scaled(position - position[0], "m")

    def drawn(axes: Axes) -> None:
        view = surfaces.View.of(axes, np.array([0.74, -0.52, 0.43]))
        view.line(position / scale, color=Z, lw=1.3, zorder=4)
        axes.plot(*view.flat(position[0] / scale), "o", color=Z, ms=4.5, zorder=5)
        view.box(position / scale, "XYZ", floors=[2])
        titled(axes, f"Path in space [{unit}]", rows=2)  # of the upright axis' label

    return drawn


PLANES: dict[str, Find] = {
    **PATHS,
    "phases": phases,
    "locking_phases": locking_phases,
    "path": flight,
    "polhode": surfaces.polhode,
    "poinsot": surfaces.poinsot,
    "momentum_sphere": partial(surfaces.sphere, row=0),
    "momentum_sphere_at_end": partial(surfaces.sphere, row=-1),
}
"""Square panels by name."""


@dataclass(frozen=True)
class Shown:
    """A dataset's rows as a figure shows them, evenly strided, in memory; and as many consecutive ones from
    the start.
    """

    rows: xarray.Dataset
    start: xarray.Dataset

    @classmethod
    def of(cls, dataset: xarray.Dataset) -> Self:
        """Read the rows that a figure draws of a dataset, possibly lazy."""
        dataset = in_time_order(dataset)
        begun = slice(-ROWS, None) if dataset.attrs.get(BACKWARDS) else slice(0, ROWS)
        parts = [dataset, dataset.isel(time=begun)]
        return cls(*(thin(part, ROWS).assign_attrs(dataset.attrs) for part in parts))

    def begins(self, name: str, plot: Plot) -> float:
        """Seconds of the start that a plot shows by itself, `_CYCLES` swings or how it settles; 0 if the run
        has few more, and takes long.
        """
        begun = CURVES[name](self.start) if plot.begins else None
        length, span = (abs(float(x[-1] - x[0])) for x in map(signals.seconds, (self.start, self.rows)))
        most, settling = 0, 0.0
        for column in () if begun is None else from_start(self.start, begun.values).T:
            values = column[np.isfinite(column)]
            if len(values) >= 50 and moves(values):
                changes = crossings(values)
                if changes < _TELLING * len(values):  # else too sparse to separate swings from a pattern
                    most = max(most, changes)
                away = np.abs(values - np.median(values)) > _SETTLED * np.ptp(values)
                if away[0] and away.mean() < _SHORT:
                    last = np.flatnonzero(away[: round(2 * _SHORT * len(away))])[-1]
                    settling = max(settling, 1.5 * length * last / len(away))
        if length > 0 and most / 2 * span / length > MANY:
            return 2 * _CYCLES * length / most
        return settling

    def draw_first(self, axes: Axes, name: str, begins: float) -> None:
        """Draw a plot over so many seconds of the start, in a unit of time that suits them."""
        start = self.start.assign_attrs(time_unit=unit_for(begins).symbol)
        draw(axes, start, CURVES[name](start), dense=False)
        for line in axes.get_lines():
            if line.get_linestyle() == "None":  # few enough now to be distinguished and followed
                line.set(linestyle="-", linewidth=0.6, markersize=5.0)
        time, unit, _ = clock(start)
        first, length = from_start(start, time)[0], begins / unit.seconds
        limits = (first - length, first) if start.attrs.get(BACKWARDS) else (first, first + length)
        axes.set(xlim=limits, xlabel=f"time [{unit.symbol}]")


def compose(
    shown: Shown, curves: Sequence[str] = (), planes: Sequence[str] = (), *, facts: bool = False
) -> Figure:
    """A page of those panels for which there is data: curves over a common time axis, planes beside
    them or side by side, and below the last of these a table of the motion's own numbers, if wanted.
    """
    rows, table = shown.rows, numbers(shown.rows) if facts else []
    left, right = found_of(CURVES, curves, rows), found_of(PLANES, planes, rows)
    row, both = bool(right and not left and not table), bool(left and right)
    below = _FACT * (len(table) + 1) if table else 0.0
    lines = _CURVE * len(left) if len(left) > 1 else 3.6 * len(left)
    stacked = _PLANE * len(right) if right else lines  # above the table
    height = _ROW if row else max(lines, stacked + below, 2.6)
    width = max(_ROW * len(right), 6.4) if row else _WIDE if both else _NARROW
    with rc_context(STYLE):  # type: ignore[arg-type]
        figure = blank(rows, width, height)
        outer = figure.add_gridspec(1, 1 + both, width_ratios=[1.38, 1.0] if both else None)
        heights = [stacked or 1e-3, below or 1e-3, max(height - stacked - below, 1e-3)]
        column = outer[-1].subgridspec(3, 1, height_ratios=heights)
        upper, lower = column[0], column[1]
        grid = (outer[0] if right else upper).subgridspec(max(len(left), 1), 1)
        for k, (name, panel) in enumerate(left):
            assert isinstance(panel, Plot)
            _curve_panel(figure, grid[k], name, panel, shown, lowest=k == len(left) - 1)
        grid = (outer[-1] if row else upper).subgridspec(
            *((1, len(right)) if row else (max(len(right), 1), 1))
        )
        for k, (_, panel) in enumerate(right):
            draw(figure.add_subplot(grid[k]), rows, panel)
        if table:
            _table(figure.add_subplot(lower), table)
        figure.draw_without_rendering()  # the layout finds its sizes in this round and in drawing
    return figure


def found_of(panels: Finders, names: Sequence[str], rows: xarray.Dataset) -> _Found:
    """Names of those panels that a dataset has something for, with that."""
    return [(name, found) for name in names if (found := panels[name](rows)) is not None]


def _curve_panel(
    figure: Figure, place: SubplotSpec, name: str, plot: Plot, shown: Shown, *, lowest: bool
) -> None:
    """Draw it over the whole run; of more swings than can be seen there as a band between the extremes, with
    the first of them next to it.
    """
    begins = shown.begins(name, plot)
    parts = place.subgridspec(1, 2, width_ratios=[1.7, 1.0], wspace=0.03) if begins else [place]
    whole = figure.add_subplot(parts[0])
    draw(whole, shown.rows, plot)
    time_axis(whole, shown.rows, labelled=lowest or begins > 0)
    if begins:
        first = figure.add_subplot(parts[1])
        shown.draw_first(first, name, begins)
        first.set(ylabel="")
        first.set_title(f"the first {span_text(begins, 2)}", fontweight="normal", color=GREY)
        legend = first.get_legend()
        if legend is not None:
            legend.remove()


def time_axis(axes: Axes, dataset: xarray.Dataset, *, labelled: bool) -> None:
    """Set a panel's limits to the run's; label the lowest panel."""
    time, _, label = clock(dataset)
    if time[0] != time[-1]:
        axes.set_xlim(time[0], time[-1])
    axes.tick_params(labelbottom=labelled)
    axes.set_xlabel(label if labelled else "")


def _table(axes: Axes, lines: list[tuple[str, str]]) -> None:
    axes.set_axis_off()
    for row, (name, value) in enumerate(lines):
        height = 1.0 - (row + 0.5) / (len(lines) + 1)
        fitting = min(9.0, 9.0 * _NAME / len(name))
        axes.text(0.04, height, name, color=GREY, fontsize=fitting, va="center", clip_on=False)
        axes.text(0.5, height, value, color=INK, fontsize=9, va="center", clip_on=False)


def slide(shown: Shown, name: str, panel: Panel, ground: str) -> Figure:
    """One panel of a run; of many swings over time the first, as they can be followed on a wall."""
    style = {k: _LETTERS * value if k.endswith(("size", "titlepad")) else value for k, value in STYLE.items()}
    style["lines.linewidth"] = _THICK * STYLE["lines.linewidth"]
    with rc_context(style):  # type: ignore[arg-type]
        figure = blank(shown.rows, *_SLIDE)
        axes = figure.add_subplot()
        begins = shown.begins(name, panel) if isinstance(panel, Plot) else 0.0
        if begins:
            shown.draw_first(axes, name, begins)
        else:
            draw(axes, shown.rows, panel)
            if isinstance(panel, Plot):
                time_axis(axes, shown.rows, labelled=True)
        if ground == "dark":
            darkened(figure)
        figure.draw_without_rendering()
    return figure


def darkened(figure: Figure) -> None:
    """Turn a drawn figure to a dark ground: letters and frame bright, hues as on the screen."""
    figure.set_facecolor(_DARK)
    hues = {paper(name): to_hex(paper(screen(name))) for name in HUES}
    hues |= {PALE: _FADED, INK: _BRIGHT, GREY: _BRIGHT, START: to_hex(colormaps["plasma"](0.8))}
    for artist in figure.findobj(lambda one: hasattr(one, "get_color") and not isinstance(one, Tick)):
        color: Any = artist.get_color()  # type: ignore[attr-defined]
        if isinstance(color, str) and color != "none":  # else of a collection, coloured by a map
            other = _BRIGHT if isinstance(artist, Text) else color
            artist.set_color(hues.get(color, other))  # type: ignore[attr-defined]
        elif isinstance(artist, LineCollection):  # from dark to light along time
            shades = colormaps["plasma"](np.linspace(_DIM, 1.0, len(artist.get_segments())))
            artist.set_color(shades.tolist())
        for effect in artist.get_path_effects() or ():  # the pale rim of letters on a light ground
            getattr(effect, "_gc", {}).update(foreground=_DARK)
    for axes in figure.axes:
        axes.set_facecolor(_DARK)
        axes.tick_params(colors=_BRIGHT, grid_color=_GRID)
        for spine in axes.spines.values():
            spine.set_edgecolor(_FADED)


@dataclass(frozen=True)
class Kind:
    """A figure that can be asked for (``FIGURES`` has in a line what it shows): what a run must have for it,
    in words, and the names of its panels over time and of its square ones. It can be drawn of a run that has
    something for one of the latter, or without them for one of the former.
    """

    needs: str
    curves: Sequence[str] = ()
    planes: Sequence[str] = ()

    def shows(self, rows: xarray.Dataset) -> bool:
        """Whether it can be drawn of a dataset (in memory)."""
        return bool(
            found_of(PLANES, self.planes, rows) or (not self.planes and found_of(CURVES, self.curves, rows))
        )


KINDS: dict[str, Kind] = {
    "polar_motion": Kind("a spin near a principal axis", ["polar_motion"], ["polar_motion"]),
    "pole_path": Kind(_AXIS, (), ["pole_path", "nutation"]),
    "nutation": Kind("a pole that a torque moves, within half a radian of its mean motion", (), ["nutation"]),
    "obliquity": Kind(_AXIS, ["obliquity", "longitude"]),
    "climate": Kind(
        "climatic_precession or insolation recorded", ["obliquity_of_date", "climatic", "insolation"]
    ),
    "libration": Kind(
        "libration, roll_pitch_yaw, nadir or source_position recorded",
        ["longitude_libration", "latitude_libration", "locking", "libration", "roll_pitch_yaw"],
        ["nadir", "phases", "locking_phases"],
    ),
    "pair": Kind("two rigid bodies", ["yaw", "separation", "mutual_period"], ["path"]),
    "pointing": Kind("air_velocity, or nadir without libration or roll_pitch_yaw, recorded", ["pointing"]),
    "tip": Kind("a top: a body on a fixed point under uniform gravity", ["tilt", "precession"], ["tip"]),
    "polhode": Kind(_TURNS, (), ["polhode", "poinsot"]),
    "momentum_sphere": Kind(
        "angular_velocity and rates of rotors recorded, and a momentum of constant size",
        (),
        ["momentum_sphere", "momentum_sphere_at_end"],
    ),
    "rotors": Kind("rotors whose rates were recorded", ["rotor_tilts", "rotor_rates"]),
    "herpolhode": Kind("an attitude and a constant momentum", (), ["herpolhode"]),
    "path": Kind("position, or rigid_body_position, recorded", (), ["path"]),
    "rates": Kind(_TURNS, ["rates", "spin_down", "moments"]),
    "core": Kind("rates of a fluid core and of the mantle recorded", ["core_axis", "core_slip"]),
    "published": Kind(
        "a published orientation ([output] orientation) and the attitude", ["published", "published_rotation"]
    ),
    "attitude": Kind(_ATTITUDE, ["attitude", "wobble"]),
    "wobble": Kind(
        "a free symmetric body, its attitude, angular_velocity and angular_momentum recorded",
        ["wobble_and_spin"],
    ),
    "states": Kind("user-defined states ([[states]]) recorded", STATES),
    "sensitivity": Kind(
        "sensitivities ([output] sensitivity)",
        ["sensitivity_attitude", "sensitivity_rates", "sensitivity_position"],
    ),
    "drift": Kind("invariants", ["drift"]),
}


def available(dataset: xarray.Dataset) -> list[str]:
    """The figures that a dataset has something for."""
    rows = Shown.of(dataset).rows
    return [OVERVIEW, *(name for name, kind in KINDS.items() if kind.shows(rows))]


def figure(dataset: xarray.Dataset, what: str = OVERVIEW) -> Figure:
    """A figure of a run by its name in `FIGURES`; of a run of any length, possibly lazy, at most 20,000 rows.

    Raises:
        ValueError: no such figure, none for this dataset, or a dataset without samples.
    """
    shown, kind = _asked(dataset, what)
    return compose(shown, kind.curves, kind.planes, facts=what == OVERVIEW)


def _asked(dataset: xarray.Dataset, what: str) -> tuple[Shown, Kind]:
    check_name(what)
    if what == SPECTRUM:
        raise ValueError("figure 'spectrum': is drawn of an analysis: rigidsim.analyse(run).figure()")
    shown = Shown.of(dataset)
    if what == OVERVIEW:
        curves, planes = leading(shown.rows)
        return shown, Kind("", (*curves, "drift"), planes)
    kind = KINDS[what]
    if not kind.shows(shown.rows):
        raise ValueError(
            f"figure {what!r}: needs {kind.needs}; possible for this run: {', '.join(available(dataset))}"
        )
    return shown, kind


def for_slides(dataset: xarray.Dataset, what: str = OVERVIEW, ground: str = "light") -> Figure:
    """The leading panel of a figure of a run, alone and in large letters, on a light or a dark ground.

    Raises:
        ValueError: as for ``figure``, or another ground.
    """
    if ground not in GROUNDS:
        raise ValueError(f"--for-slides: given {ground!r}; {' or '.join(GROUNDS)} is allowed")
    shown, kind = _asked(dataset, what)
    groups: list[tuple[Finders, Sequence[str]]] = [(CURVES, kind.curves), (PLANES, kind.planes)]
    # first what it is named for
    for panels, names in groups if what == OVERVIEW or not kind.planes else reversed(groups):
        for name in names:
            panel = panels[name](shown.rows)
            if panel is not None:
                return slide(shown, name, panel, ground)
    raise ValueError(f"figure {what!r}: this run has no panel of it for a slide")


def check_name(what: str) -> None:
    """Refuse an unknown name by ``ValueError``, with a list of the figures."""
    if what not in FIGURES:
        close = get_close_matches(what, FIGURES, 1)
        hint = f"; did you mean {close[0]!r}?" if close else "."
        raise ValueError(f"figure {what!r}: there is none of that name{hint} Available: {', '.join(FIGURES)}")


def save_figure(
    dataset: xarray.Dataset, path: str | Path, what: str = OVERVIEW, *, file_format: str | None = None,
    slides: str | None = None,
) -> Path:  # fmt: skip
    """Draw a figure of a run to a file (see `figure`), which is whole when this returns its path, in the
    format given or its suffix's; with ``slides``, a ground, its leading panel alone (see `for_slides`).
    ``ValueError`` for another suffix, too.
    """
    path = Path(path)
    page = figure(dataset, what) if slides is None else for_slides(dataset, what, slides)
    dots, ground = _DOTS if slides is None else _SLIDE_DOTS, page.get_facecolor()
    page.savefig(path, dpi=dots, format=file_format or figure_format(path), facecolor=ground)
    return path


def figure_format(path: Path) -> str:
    """File format for a path's suffix: "png" or "svg"; ``ValueError`` for another."""
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(
            f"figure {path.name!r}: the suffix must be one of {', '.join(SUFFIXES)}, given {path.suffix!r}"
        )
    return path.suffix.lower()[1:]
