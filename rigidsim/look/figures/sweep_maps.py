"""Figures of a sweep: lines along an axis, a map over two or over a sphere, points of a section.

What is drawn is a variable of the dataset: one number of each member. A vector has a line for each component,
or the map of one of them; of two axes one with few values has a line for each. Where the members have more
axes than two, the others are cut at their first value, and the page says so.
"""

import math
from itertools import product
from typing import Any

import numpy as np
import xarray
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from rigidsim.look.figures import sweep_axes
from rigidsim.look.figures.fitted_members import fitted_members_figure, holds_fits
from rigidsim.look.figures.style import GREY, MOST_VECTOR_POINTS, PALE, PALETTE, STYLE, blank, key, titled
from rigidsim.look.figures.sweep_axes import along, label_of, named, title_of, value_text
from rigidsim.look.figures.sweep_units import in_units, tells_nothing
from rigidsim.look.solids import Array

INDICATORS = ("megno", "fli", "lyapunov")
_ALWAYS = (
    *("status", "warnings", "steps", "time_reached", "drift_bound", "attitude_error", "position_error"),
    *("modelling_error", "modelling_error_norm", "modelling_error_energy"),
)
_BESIDE = ("failed_member", "failed_reason")
_LAST = ("_drift_largest", "_drift_final", "_time", "_times", "_count")
_SECTION = "_occurrence"  # dimension of the points of a section
_NO_RESULT = 30  # rank from which on nothing is a result
_MOST_LINES = 16
_FIRST = "_first"
_FEW = 6  # values of a second axis up to which each has a line, and there is no map
_MANY = 400  # values of which a few may lie beyond the colours
_MOST_POINTS = 400_000
_FLAT = 1e-9  # variation of a component, relative to the largest, that is rounding
_FILLED = 2.0  # area of a sphere's dots over that of its map


def drawable(dataset: xarray.Dataset) -> list[str]:
    """Names that a sweep's figure can show, the default first."""
    axes = sweep_axes.axes_of(dataset)
    found = [
        str(name)
        for name, variable in dataset.data_vars.items()
        if set(axes) <= set(map(str, variable.dims))
        and variable.dtype.kind in "fi"
        and not {"time", "sample"} & set(map(str, variable.dims))
        and name not in _BESIDE
    ]
    return sorted(found, key=lambda name: (_rank(dataset, name), found.index(name)))


def default_of(dataset: xarray.Dataset) -> str:
    """What a sweep's figure shows where nothing is named: the first result that tells its members apart, no
    conserved quantity and no rounding; the members' status where nothing does.
    """
    results = (name for name in drawable(dataset) if _rank(dataset, name) < _NO_RESULT)
    return next((name for name in results if not tells_nothing(dataset, name)), "status")


def _rank(dataset: xarray.Dataset, name: str) -> int:
    if name in INDICATORS:
        return INDICATORS.index(name)
    if name.endswith(_FIRST) and name.removesuffix(_FIRST) + "_count" in dataset:
        return 5  # when an event happened: nobody asks for one who wants something else
    if name in _ALWAYS:
        return _NO_RESULT + _ALWAYS.index(name)
    conserved = {str(v.attrs["drift_of"]) for v in dataset.data_vars.values() if "drift_of" in v.attrs}
    if "drift_of" in dataset[name].attrs or any(name.startswith(f"{one}_") for one in conserved):
        return _NO_RESULT + len(_ALWAYS)
    if any(str(dim).endswith(_SECTION) for dim in dataset[name].dims):
        return 12
    told = str(dataset[name].attrs.get("long_name", ""))
    if told.startswith("secular rate"):
        return 8
    if " of the lines of " in told:
        return 14
    return 20 if name.endswith(_LAST) else 10


def save_sweep_figure(dataset: xarray.Dataset, path: Any, what: str | None, *, file_format: str) -> None:
    """Draw a sweep's figure to a file; see ``sweep_figure``."""
    with rc_context(STYLE):  # type: ignore[arg-type]
        sweep_figure(dataset, what).savefig(path, dpi=160, format=file_format)


def sweep_figure(dataset: xarray.Dataset, what: str | None = None) -> Figure:
    """A sweep's page: one variable over its axes, by its name, with ``[INDEX]`` for one component; by default
    the first indicator, else the first time of an event, else a secular rate, else the first quantity kept
    that isn't the same in all members; of fits what they estimated. Times are in the scene's unit, angles in
    a readable one.
    ``ValueError`` names the variables there are where there is none of that name.
    """
    if what is None and holds_fits(dataset):
        with rc_context(STYLE):  # type: ignore[arg-type]
            return fitted_members_figure(dataset)
    names = drawable(dataset)
    name, bracket, index = (what or default_of(dataset)).partition("[")
    if name not in names or (bracket and not index.removesuffix("]").isdigit()):
        raise ValueError(
            f"{what!r} is nothing that this sweep kept; allowed: {', '.join(names)}, of a vector "
            "with [0], [1] ... for one component"
        )
    dataset = in_units(dataset, name)
    variable = dataset[name]
    with rc_context(STYLE):  # type: ignore[arg-type]
        if any(str(dim).endswith(_SECTION) for dim in variable.dims):
            return _points(dataset, variable)
        axes, cut, said = _cut(dataset, variable)
        if bracket:
            cut, said = _component(dataset, cut, axes, int(index.removesuffix("]")), said)
        on_sphere = sweep_axes.directions(dataset, axes[0]) if len(axes) == 1 else None
        longest = max(axes, key=lambda dim: cut.sizes[dim])
        lines = len(axes) == 1 or min(cut.sizes[dim] for dim in axes) <= _FEW < cut.sizes[longest]
        if (not lines or len(axes) > 1 or on_sphere is not None) and set(map(str, cut.dims)) != set(axes):
            cut, said = _component(dataset, cut, axes, 0, said)  # one at a time
        if on_sphere is not None:
            return _sphere(dataset, cut, on_sphere, said)
        return _lines(dataset, cut, longest, said) if lines else _map(dataset, cut, axes, said)


def _cut(dataset: xarray.Dataset, variable: xarray.DataArray) -> tuple[list[str], xarray.DataArray, str]:
    """At most two axes of more than one value, the longest; others are cut at their first value."""
    axes = sweep_axes.axes_of(dataset)
    longest = sorted(axes, key=lambda dim: -dataset.sizes[dim])[:2]
    kept = [dim for dim in axes if dim in longest and dataset.sizes[dim] > 1] or axes[:1]
    said = []
    for dim in axes:
        if dim not in kept:
            said.append(f"{dim.replace('_', ' ')} = {value_text(dataset, dim, 0) or 0}")
            variable = variable.isel({dim: 0})
    return kept, variable, ", ".join(said)


def _component(
    dataset: xarray.Dataset, cut: xarray.DataArray, axes: list[str], index: int, said: str
) -> tuple[xarray.DataArray, str]:
    extra = [str(dim) for dim in cut.dims if dim not in axes]
    count = math.prod(cut.sizes[dim] for dim in extra)
    if index >= count:
        raise ValueError(f"{cut.name} has the components 0 to {count - 1}, given {index}")
    places = np.unravel_index(index, [cut.sizes[dim] for dim in extra]) if extra else ()
    words = [said] if said else []
    for dim, place in zip(extra, places, strict=True):
        words.append(f"{dim.replace('_', ' ')} {label_of(dataset, dim, int(place))}")
        cut = cut.isel({dim: int(place)})
    return cut, ", ".join(words)


def _lines(dataset: xarray.Dataset, cut: xarray.DataArray, axis: str, said: str) -> Figure:
    """Values over one axis, with a line for each component, or value of another axis."""
    figure = blank(dataset, 9.0, 4.4)
    axes = figure.add_subplot()
    place, label, _ = along(dataset, axis)
    values = np.asarray(cut.transpose(axis, ...).values, dtype=np.float64).reshape(len(place), -1)
    extra = [str(dim) for dim in cut.dims if dim != axis]
    labels = [
        " ".join(parts)
        for parts in product(*([label_of(dataset, d, i) for i in range(cut.sizes[d])] for d in extra))
    ]
    order = np.argsort(place, kind="stable")
    joined = _ordered(dataset, axis)
    few = len(place) <= 100
    for column in range(min(values.shape[1], _MOST_LINES)):
        axes.plot(
            place[order], values[order, column], color=PALETTE[column % len(PALETTE)],
            marker="o" if few or not joined else None, ms=3.2 if few else 2.0, lw=None if joined else 0,
            label=labels[column] if len(labels) > 1 else None, rasterized=len(place) > MOST_VECTOR_POINTS,
        )  # fmt: skip
    title = title_of(cut, said)
    if values.shape[1] > _MOST_LINES:
        title += f" (the first {_MOST_LINES} of {values.shape[1]})"
    key(axes, title)
    sweep_axes.number_ticks(axes.xaxis, dataset, axis, along_x=True)
    axes.set(xlabel=label, ylabel=named(cut))
    if sweep_axes.geometric(place):
        axes.set_xscale("log")
    if sweep_axes.spans_decades(values):
        axes.set_yscale("log")
    axes.yaxis.set_offset_position("right")  # the key is on the left
    return figure


def _ordered(dataset: xarray.Dataset, dim: str) -> bool:
    """Whether neighbours along an axis are related, which randomly drawn members aren't."""
    if dim in dataset.coords:
        return dataset[dim].dtype.kind in "fi"
    steps = np.diff(along(dataset, dim)[0])
    known = any(c.dims == (dim,) and "swept_key" in c.attrs for c in dataset.coords.values())
    return known and bool((steps > 0).all() or (steps < 0).all())


def _map(dataset: xarray.Dataset, cut: xarray.DataArray, dims: list[str], said: str) -> Figure:
    """Values over two axes, as colours."""
    figure = blank(dataset, 8.4, 6.0)
    axes = figure.add_subplot()
    (x, x_label, _), (y, y_label, _) = (along(dataset, dim) for dim in dims)
    values = np.asarray(cut.transpose(*dims).values, dtype=np.float64)
    values, x, y = values[np.argsort(x)][:, np.argsort(y)], np.sort(x), np.sort(y)
    logs = [sweep_axes.geometric(place) for place in (x, y)]
    edges = [sweep_axes.edges_of(place, log) for place, log in zip((x, y), logs, strict=True)]
    axes.set_facecolor(PALE)
    scale, extend = _colours(values)
    mesh = axes.pcolormesh(*edges, values.T, cmap="viridis", rasterized=True, **scale)
    axes.grid(visible=False)
    for log, setting in zip(logs, (axes.set_xscale, axes.set_yscale), strict=True):
        if log:
            setting("log")
    for axis, dim in zip((axes.xaxis, axes.yaxis), dims, strict=True):
        sweep_axes.number_ticks(axis, dataset, dim, along_x=axis is axes.xaxis)
    axes.set(xlabel=x_label, ylabel=y_label)
    titled(axes, title_of(cut, said) + ("" if np.isfinite(values).all() else " (grey: no value)"))
    _colour_bar(axes, mesh, cut, extend=extend)
    return figure


def _colours(values: Array) -> tuple[dict[str, Any], str]:
    """Scale of a map's colours, logarithmic if values span decades, and the ends beyond which some lie: of
    many, a hundredth of the values at the ends doesn't take the colours from all others.
    """
    finite = values[np.isfinite(values)]
    if not len(finite):
        return {"vmin": 0.0, "vmax": 1.0}, "neither"
    ends = [0.5, 99.5] if len(finite) >= _MANY else [0, 100]
    decades = sweep_axes.spans_decades(values)
    low, high = np.percentile(finite[finite > 0] if decades else finite, ends)
    if not decades and (high - low < 0.5 * np.ptp(finite) or low == high):  # few different values
        low, high = finite.min(), finite.max()
        high = high if high > low else low + 1.0
    below, above = bool((finite < low).any()), bool((finite > high).any())
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}.get((below, above), "neither")
    return ({"norm": LogNorm(low, high)} if decades else {"vmin": low, "vmax": high}), extend


def _colour_bar(axes: Axes, shown: Any, variable: xarray.DataArray, **options: Any) -> None:
    bar = axes.figure.colorbar(shown, ax=axes, pad=0.02, aspect=30, **options)
    bar.set_label(named(variable))
    bar.outline.set_visible(False)


def _sphere(dataset: xarray.Dataset, cut: xarray.DataArray, vectors: Array, said: str) -> Figure:
    """A Mollweide map, +z at the top and +x in the centre, with a dot for each direction, (members, 3)."""
    figure = blank(dataset, 8.4, 4.8)
    values = np.asarray(cut.values, dtype=np.float64)
    scale, extend = _colours(values)
    axes = figure.add_subplot(projection="mollweide")
    axes.set_facecolor(PALE)
    longitude, latitude = np.arctan2(vectors[:, 1], vectors[:, 0]), np.arcsin(np.clip(vectors[:, 2], -1, 1))
    figure.canvas.draw()  # the layout says how large the map is
    box = axes.get_window_extent()
    area = np.pi / 4 * box.width * box.height * (72 / figure.dpi) ** 2  # of the ellipse, square points
    size = _FILLED * area / len(vectors)
    shown = axes.scatter(
        longitude, latitude, c=values, s=size, lw=0, cmap="viridis", rasterized=True, **scale
    )
    places = {"+x": (0, 0), "+y": (np.pi / 2, 0), "−y": (-np.pi / 2, 0), "+z": (0, 1.35), "−z": (0, -1.35)}
    ground = {"boxstyle": "round,pad=0.2", "facecolor": "white", "alpha": 0.7, "linewidth": 0}
    for name, place in places.items():
        axes.annotate(name, place, ha="center", va="center", fontsize=8, bbox=ground)
    axes.set(xticklabels=[], yticklabels=[])
    axes.grid(visible=False)
    titled(axes, title_of(cut, said))
    _colour_bar(axes, shown, cut, shrink=0.7, extend=extend)
    return figure


def _points(dataset: xarray.Dataset, variable: xarray.DataArray) -> Figure:
    """A section's points of all members: one component against the other, or the axis of the members."""
    members = [dim for dim in variable.dims if dim in sweep_axes.axes_of(dataset)]
    occurrence = next(str(dim) for dim in variable.dims if str(dim).endswith(_SECTION))
    rest = [str(dim) for dim in variable.dims if dim not in members and dim != occurrence]
    table = np.asarray(variable.transpose(*members, occurrence, *rest).values, dtype=np.float64)
    count = math.prod(variable.sizes[dim] for dim in members)
    table = table.reshape(count, variable.sizes[occurrence], -1)
    figure = blank(dataset, 8.4, 6.0)
    axes = figure.add_subplot()
    stride = max(1, -(-table[..., 0].size // _MOST_POINTS))
    which = np.repeat(np.arange(count), table.shape[1])[::stride]
    rows = table.reshape(-1, table.shape[2])[::stride]
    style: dict[str, Any] = {"s": 2.5, "lw": 0, "rasterized": True}
    if rows.shape[1] > 1:
        one, other = _widest(rows)
        first, second = (label_of(dataset, rest[0], i) if len(rest) == 1 else str(i) for i in (one, other))
        axes.scatter(rows[:, one], rows[:, other], c=which, cmap="viridis", **style)
        axes.set(xlabel=f"{named(variable)}, {first}", ylabel=f"{named(variable)}, {second}")
        titled(axes, f"{title_of(variable)}; coloured by member")
        return figure
    place, label = along(dataset, str(members[0]))[:2] if len(members) == 1 else (np.arange(count), "member")
    axes.scatter(np.asarray(place, dtype=np.float64)[which], rows[:, 0], color=GREY, **style)
    axes.set(xlabel=label, ylabel=named(variable))
    titled(axes, title_of(variable))
    return figure


def _widest(rows: Array) -> tuple[int, int]:
    """The first two components that vary: what the section is cut at doesn't, but for rounding."""
    known = rows[np.isfinite(rows).all(axis=1)]
    spread = np.ptp(known, axis=0) if len(known) else np.ones(rows.shape[1])
    order = np.argsort(spread <= _FLAT * np.abs(known).max(initial=0), kind="stable")
    one, other = sorted(order[:2].tolist())
    return one, other
