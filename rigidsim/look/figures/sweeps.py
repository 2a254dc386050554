"""Figures of a sweep: lines along an axis, a map over two or over a sphere, points of a section, fits.

What is drawn is a variable of the dataset: one number of each member. A vector has a line for each component,
or the map of one of them; of two axes one with few values has a line for each. Where the members have more
axes than two, the others are cut at their first value, and the page says so.
"""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from rigidsim.look.figures.style import GREY, INK, PALE, PALETTE, blank, key, styled, titled
from rigidsim.look.solids import Array
from rigidsim.scene.readable import pretty_unit, scaled, with_unit

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
_FEW = 6  # values of a second axis up to which each has a line, and there is no map
_MANY = 400  # values of which a few may lie beyond the colours
_MOST_POINTS = 400_000
_FILLED = 2.0  # area of a sphere's dots over its map's area
_STILL = 1e-9  # variation between members or components, relative to the largest, that is rounding
_NOISE = 1e-12  # of a signal's own size, below which a line or a secular rate is rounding
_MOST_SHOWN, _CROWDED, _LONGEST = 12, 60, 24  # values shown at their ticks, their letters, and letters of one
_OUTLIERS = 5.0  # per cent of a map's values that are left out of its logarithmic scale
_DECADES = 1.5  # from which on values of one sign have a logarithmic scale
_FEWEST = 12  # directions that make a map
_MOST_PANELS, _COLUMNS, _PANEL = 14, 2, 1.75  # of fits; inches high
_APART = 0.012  # of the axis, between members of different colours
_BAR: dict[str, Any] = {"pad": 0.02, "aspect": 30}


@dataclass(frozen=True)
class Axis:
    """An axis of the members: places (n,) of its values, its label, texts of the values, whether these stand
    at the ticks, whether neighbours are related, which randomly drawn members aren't, and unit vectors (n, 3)
    of directions.
    """

    dim: str
    place: Array
    label: str
    texts: list[str]
    ticks: bool = False
    ordered: bool = False
    directions: Array | None = None

    @classmethod
    def of(cls, dataset: xarray.Dataset, dim: str) -> "Axis":
        """The axis of a dimension."""
        words, count = dim.replace("_", " "), dataset.sizes[dim]
        own = next((dataset[name] for name in (f"{dim}_value", dim) if name in dataset.coords), None)
        zipped = [c for c in dataset.coords.values() if c.dims == (dim,) and "swept_key" in c.attrs]
        for one in (own, *zipped):
            if one is not None and one.ndim == 1 and one.dtype.kind in "fi":
                divisor, unit = _unit_of(dataset, one)
                place = np.asarray(one.values, dtype=np.float64) / divisor
                ordered = str(one.name) == dim or len(set(np.diff(place) > 0)) < 2
                return cls(
                    dim, place, _named(one, unit), [f"{words} {x:.4g}" for x in place], ordered=ordered
                )
        values = np.array([f"{words} {n}" for n in range(count)]) if own is None else own.values
        many = values.shape[1:] == (3,) and count >= _FEWEST
        lengths = np.linalg.norm(values, axis=1, keepdims=True) if many else np.zeros(1)
        directed = lengths.min() > 0 and np.ptp(lengths) <= _STILL * lengths.max()
        few = own is not None and count <= _MOST_SHOWN
        label = _named(own) if few and own is not None else f"{words}, counted from 0"
        texts, directions = [_text(value) for value in values], values / lengths if directed else None
        return cls(dim, np.arange(float(count)), label, texts, few, directions=directions)

    @property
    def log(self) -> bool:
        """Whether its values span decades at equal ratios."""
        ratios = np.diff(np.log(np.unique(self.place))) if spans_decades(self.place) else np.zeros(0)
        return len(ratios) > 0 and not self.ticks and float(np.ptp(ratios)) < 0.01 * float(ratios.mean())

    def show(self, axes: Axes, which: str = "x") -> None:
        """Label an axis; ticks of numbered values have these, if they are few."""
        axes.set(**{f"{which}label": self.label}, **({f"{which}scale": "log"} if self.log else {}))
        if self.ticks:
            turned = which == "x" and sum(map(len, self.texts)) > _CROWDED
            options: dict[str, Any] = {"rotation": 25, "ha": "right"} if turned else {}
            getattr(axes, f"set_{which}ticks")(self.place, self.texts, **options)


def _text(value: Any) -> str:
    if np.ndim(value):
        return f"[{', '.join(format(float(x), '.4g') for x in value)}]"
    text = format(float(value), ".4g") if np.asarray(value).dtype.kind in "fi" else str(value)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."


def _named(variable: xarray.DataArray, unit: str | None = None) -> str:
    """A variable's name and unit; for a sweep's axis also its key."""
    words, swept = str(variable.name).replace("_", " "), str(variable.attrs.get("swept_key", ""))
    if swept and swept != variable.name:
        words += f" ({swept})"
    return with_unit(words, pretty_unit(str(variable.attrs.get("units", ""))) if unit is None else unit)


def _unit_of(dataset: xarray.Dataset, variable: xarray.DataArray) -> tuple[float, str]:
    """Divisor and name of a unit that suits the scene."""
    plain = pretty_unit(str(variable.attrs.get("units", "")))
    asked = bool(dataset.attrs.get("time_unit"))
    if variable.dtype.kind != "f" or plain not in ("s", "rad", *["rad/s"] * asked):
        return 1.0, plain
    return scaled(np.asarray(variable.values), plain, dataset.attrs)


def _members(dataset: xarray.Dataset) -> list[str]:
    return [str(dim) for dim in dataset["status"].dims]


def drawable(dataset: xarray.Dataset) -> list[str]:
    """Names that a sweep's figure can show, the default first."""
    found = [
        str(name)
        for name, variable in dataset.data_vars.items()
        if set(_members(dataset)) <= set(variable.dims)
        and variable.dtype.kind in "fi"
        and not {"time", "sample"} & set(variable.dims)
        and name not in _BESIDE
    ]
    return sorted(found, key=lambda name: _rank(dataset, name))


def default_of(dataset: xarray.Dataset) -> str:
    """What a sweep's figure shows where nothing is named: the first result that differs between members, no
    conserved quantity and no rounding; the members' status where nothing does.
    """
    results = (name for name in drawable(dataset) if _rank(dataset, name) < _NO_RESULT)
    return next((name for name in results if _differs(dataset, name)), "status")


def _rank(dataset: xarray.Dataset, name: str) -> int:
    attributes, dims = dataset[name].attrs, dataset[name].dims
    words = str(attributes.get("long_name", ""))
    conserved = {str(v.attrs["drift_of"]) for v in dataset.data_vars.values() if "drift_of" in v.attrs}
    ranks = {
        0: name in INDICATORS,
        5: name.endswith("_first") and f"{name[:-6]}_count" in dataset,  # when an event happened
        _NO_RESULT: name in _ALWAYS,
        _NO_RESULT + 1: "drift_of" in attributes or any(name.startswith(f"{one}_") for one in conserved),
        12: any(str(dim).endswith(_SECTION) for dim in dims),
        8: words.startswith("secular rate"),
        14: " of the lines of " in words,
        20: name.endswith(_LAST),
    }
    return next((rank for rank, holds in ranks.items() if holds), 10)


def _differs(dataset: xarray.Dataset, name: str) -> bool:
    """Whether a variable differs between members by more than rounding, and isn't rounding itself: a line or
    a secular rate that is too small compared with the signal.
    """
    variable, dims = dataset[name], _members(dataset)
    size = float(np.abs(variable).max())
    if variable.sizes[dims[0]] < 2 or not np.isfinite(size):
        return True
    signal, _, what = name.rpartition("_")
    over = {"amplitude": 1.0, "rate": float(dataset.get("time_reached", xarray.DataArray(1.0)).max())}
    own = float(np.abs(dataset.get(f"{signal}_amplitude", xarray.DataArray(0.0))).max())
    least = _NOISE * max(own, str(variable.attrs.get("units", "")).startswith("rad"))
    spread = float((variable.max(dims) - variable.min(dims)).max())
    return spread > _STILL * size and (what not in over or size * over[what] > least)


@styled
def sweep_figure(dataset: xarray.Dataset, what: str | None = None) -> Figure:
    """A sweep's page: one variable over its axes, by its name, with ``[INDEX]`` for one component; by default
    the first indicator, else the first time of an event, else a secular rate, else the first quantity kept
    that isn't the same in all members; of fits what they estimated. Times are in the scene's unit, angles in
    a readable one.
    ``ValueError`` names the variables there are where there is none of that name.
    """
    longest = sorted((Axis.of(dataset, dim) for dim in _members(dataset)), key=lambda axis: -len(axis.place))
    if what is None and {"value", "sigma", "converged"} <= set(dataset.data_vars):
        return _fits(dataset, longest)
    names, asked = drawable(dataset), re.fullmatch(r"(.+?)(?:\[(\d+)\])?", what or default_of(dataset))
    if asked is None or asked[1] not in names:
        raise ValueError(
            f"{what!r} is nothing that this sweep kept; allowed: {', '.join(names)}, of a vector "
            "with [0], [1] ... for one component"
        )
    found = dataset[asked[1]]
    divisor, unit = _unit_of(dataset, found)
    variable = (found / divisor).assign_attrs({**found.attrs, "units": unit})
    for dim in variable.dims:  # components by the names that people read
        labels = dataset[dim].values if dim in dataset.coords else range(variable.sizes[dim])
        variable = variable.assign_coords({dim: [_text(label) for label in labels]})
    if any(str(dim).endswith(_SECTION) for dim in variable.dims):
        members = [axis for dim in variable.dims for axis in longest if axis.dim == dim]
        return _drawn(dataset, _points, (8.4, 6.0), variable, members)
    kept = [axis for axis in longest[:2] if len(axis.place) > 1] or longest[:1]
    said = [axis.texts[0] for axis in longest if axis not in kept]
    variable = variable.isel({axis.dim: 0 for axis in longest if axis not in kept})
    extra = {str(dim): variable.sizes[dim] for dim in variable.dims if dim not in [a.dim for a in kept]}
    lines = len(kept) == 1 or len(kept[1].place) <= _FEW < len(kept[0].place)
    if asked[2] or (extra and (not lines or len(kept) > 1 or kept[0].directions is not None)):
        number = int(asked[2] or 0)
        if number >= math.prod(extra.values()):
            raise ValueError(
                f"{found.name} has components 0 to {math.prod(extra.values()) - 1}, given {number}"
            )
        place = np.unravel_index(number, tuple(extra.values()))
        variable = variable.isel({dim: int(k) for dim, k in zip(extra, place, strict=True)})
        said += [f"{dim.replace('_', ' ')} {variable[dim].item()}" for dim in extra]
    title = "; ".join([_title(variable), *([", ".join(said)] if said else [])])
    if len(kept) == 1 and kept[0].directions is not None:
        ground: dict[str, Any] = {"projection": "mollweide", "facecolor": PALE}
        return _drawn(dataset, _sphere, (8.4, 4.8), variable, kept[0].directions, title, **ground)
    if lines:
        return _drawn(dataset, _lines, (9.0, 4.4), variable, kept, title)
    kept = sorted(kept, key=lambda axis: variable.dims.index(axis.dim))
    return _drawn(dataset, _map, (8.4, 6.0), variable, kept, title, facecolor=PALE)


def _drawn(
    dataset: xarray.Dataset, draw: Callable[..., None], size: tuple[float, float], *what: Any, **options: Any
) -> Figure:
    """A page with one panel, which a function draws."""
    figure = blank(dataset, *size)
    draw(figure.add_subplot(**options), *what)
    return figure


def _lines(axes: Axes, variable: xarray.DataArray, kept: list[Axis], title: str) -> None:
    """Values over one axis, with a line for each component, or value of another axis."""
    axis, *others = kept
    rest = [dim for dim in variable.dims if dim != axis.dim]
    texts = {dim: variable[dim].values for dim in rest} | {other.dim: other.texts for other in others}
    labels = [" ".join(parts) for parts in product(*(texts[dim] for dim in rest))]
    order = np.argsort(axis.place, kind="stable")
    table = np.asarray(variable.transpose(axis.dim, *rest).values, dtype=np.float64).reshape(len(order), -1)
    marks: dict[str, Any] = {"marker": "o", "ms": 3.2} if len(order) <= 100 or not axis.ordered else {}
    for column, label, color in zip(table.T[:_MOST_LINES], labels, PALETTE * 2, strict=False):
        marks |= {"label": label if len(labels) > 1 else None, "lw": 1.4 if axis.ordered else 0}
        axes.plot(axis.place[order], column[order], color=color, **marks)
    more = f" (the first {_MOST_LINES} of {len(labels)})" if len(labels) > _MOST_LINES else ""
    key(axes, title + more)
    axis.show(axes)
    axes.set(ylabel=_named(variable), **({"yscale": "log"} if spans_decades(table) else {}))
    axes.yaxis.set_offset_position("right")  # the key is on the left


def _map(axes: Axes, variable: xarray.DataArray, kept: list[Axis], title: str) -> None:
    """Values over two axes, as colours."""
    for axis, which in zip(kept, "xy", strict=True):
        variable = variable.assign_coords({axis.dim: axis.place}).sortby(axis.dim)
        axis.show(axes, which)
    missing = "" if np.isfinite(variable).all() else " (grey: no value)"
    bar = {"label": _named(variable), **_BAR}
    options: dict[str, Any] = {"rasterized": True, "add_labels": False, "cbar_kwargs": bar}
    colours = _colours(variable.values)
    if isinstance(colours["norm"], LogNorm):  # lower values have its lowest colour
        variable = variable.clip(min=colours["norm"].vmin, keep_attrs=True)
    variable.plot.pcolormesh(x=kept[0].dim, y=kept[1].dim, ax=axes, **options, **colours)
    axes.grid(visible=False)
    titled(axes, title + missing)


def _colours(values: Array) -> dict[str, Any]:
    """Scale of a map's colours, logarithmic if values span decades, and the ends beyond which some lie: of
    many, a hundredth of the values at the ends doesn't take the colours from all others, nor do some that are
    no more than zero keep them from a logarithmic scale.
    """
    finite = values[np.isfinite(values)] if np.isfinite(values).any() else np.array([0.0, 1.0])
    low, high = np.percentile(finite, [0.5, 99.5] if len(finite) >= _MANY else [0, 100])
    least = float(np.percentile(finite, _OUTLIERS)) if len(finite) >= _MANY else 0.0
    if finite.min() <= 0 < least and (decades := spans_decades(np.maximum(finite, least))):
        low = least
    else:
        decades = spans_decades(values)
    if not decades and (high - low < 0.5 * np.ptp(finite) or low == high):  # few different values
        low, high = finite.min(), max(finite.max(), np.nextafter(finite.min() + 1.0, -np.inf))
    beyond = int((finite < low).any()) + 2 * int((finite > high).any())
    norm = LogNorm(low, high) if decades else Normalize(low, high)
    return {"cmap": "viridis", "norm": norm, "extend": ("neither", "min", "max", "both")[beyond]}


def _sphere(axes: Axes, variable: xarray.DataArray, ways: Array, title: str) -> None:
    """A Mollweide map, +z at the top and +x in the centre, with a dot for each direction, (members, 3)."""
    figure, scale = axes.figure, _colours(np.asarray(variable.values, dtype=np.float64))
    extend = scale.pop("extend")
    longitude, latitude = np.arctan2(ways[:, 1], ways[:, 0]), np.arcsin(np.clip(ways[:, 2], -1, 1))
    figure.canvas.draw()  # the layout says how large the map is
    box = axes.get_window_extent()
    size = _FILLED * np.pi / 4 * box.width * box.height * (72 / figure.dpi) ** 2 / len(ways)  # square points
    dots = axes.scatter(longitude, latitude, c=variable.values, s=size, lw=0, rasterized=True, **scale)
    places = {"+x": (0, 0), "+y": (np.pi / 2, 0), "−y": (-np.pi / 2, 0), "+z": (0, 1.35), "−z": (0, -1.35)}
    ground = {"boxstyle": "round,pad=0.2", "facecolor": "white", "alpha": 0.7, "linewidth": 0}
    for name, place in places.items():
        axes.annotate(name, place, ha="center", va="center", fontsize=8, bbox=ground)
    axes.set(xticklabels=[], yticklabels=[])
    axes.grid(visible=False)
    titled(axes, title)
    figure.colorbar(dots, ax=axes, label=_named(variable), shrink=0.7, extend=extend, **_BAR)


def _points(axes: Axes, variable: xarray.DataArray, members: list[Axis]) -> None:
    """A section's points of all members: one component against the other, or the axis of the members."""
    dims = [axis.dim for axis in members]
    (occurrence,) = [dim for dim in variable.dims if str(dim).endswith(_SECTION)]
    rest = [dim for dim in variable.dims if dim not in (*dims, occurrence)]
    whole = np.asarray(variable.transpose(*dims, occurrence, *rest).values, dtype=np.float64)
    table = whole.reshape(-1, variable.sizes[occurrence], math.prod(variable.sizes[dim] for dim in rest))
    stride = max(1, -(-table[..., 0].size // _MOST_POINTS))
    rows = table.reshape(-1, table.shape[2])[::stride]
    which = np.repeat(np.arange(len(table)), table.shape[1])[::stride]
    if rows.shape[1] > 1:
        # the first two components that vary: what the section is cut at doesn't, but for rounding
        known = rows[np.isfinite(rows).all(axis=1)]
        still = np.ptp(known, axis=0) <= _STILL * np.abs(known).max() if len(known) else [False] * len(rows.T)
        both = sorted(np.argsort(still, kind="stable")[:2].tolist())
        names = [" ".join(parts) for parts in product(*(variable[dim].values for dim in rest))]
        x, y = rows[:, both].T
        across, up = (f"{_named(variable)}, {names[k]}" for k in both)
    else:
        alone = len(members) == 1
        x, y = (members[0].place if alone else np.arange(len(table)))[which], rows[:, 0]
        across, up = members[0].label if alone else "member", _named(variable)
    axes.scatter(x, y, c=which if rows.shape[1] > 1 else GREY, s=2.5, lw=0, rasterized=True)
    axes.set(xlabel=across, ylabel=up)
    titled(axes, _title(variable) + ("; coloured by member" if rows.shape[1] > 1 else ""))


def _title(variable: xarray.DataArray) -> str:
    title = str(variable.attrs.get("long_name") or variable.name).replace("_", " ")
    return title[:1].upper() + title[1:]


def spans_decades(values: Array) -> bool:
    """Whether values are better shown on a logarithmic scale."""
    finite = values[np.isfinite(values)]
    if not len(finite) or finite.min() <= 0:
        return False
    low, high = np.percentile(finite, [2, 98])
    return bool(finite.max() > 10 * finite.min() and math.log10(high / low) > _DECADES)


def _fits(dataset: xarray.Dataset, longest: list[Axis]) -> Figure:
    """A panel for each parameter: estimates with bars of one sigma over the longest axis, in colours by a
    second one; dashed where all fits began, hollow without sigma, crosses where a fit didn't converge. The
    last panel has the residuals in their sigmas.
    """
    axis, second = longest[0], [one for one in longest[1:2] if 1 < len(one.place) <= _FEW]
    beyond = longest[1 + len(second) :]
    cut = dataset.isel({one.dim: 0 for one in beyond})
    count = min(cut.sizes["parameter"], _MOST_PANELS - 1)
    rows = math.ceil((count + 1) / _COLUMNS)
    figure = blank(dataset, 11.0, _PANEL * rows + 1.2)
    panels = np.ravel(figure.subplots(rows, _COLUMNS, squeeze=False))
    for n, axes in enumerate(panels):
        one, fitted = cut.isel(parameter=min(n, count - 1)), n < count
        axes.set_visible(n <= count)
        start = one["start"].values[np.isfinite(one["start"].values)] if fitted else np.ones(1)
        if len(start) and np.ptp(start) <= _NOISE * np.abs(start).max():
            label = "start" if fitted else None
            axes.axhline(float(start[0]), color=GREY, lw=1.0, ls="--", label=label)
        _estimates(axes, one, axis, second, "value" if fitted else "scale")
        title, unit = "; ".join(["Residuals", *(x.texts[0] for x in beyond)]), "in sigmas"
        if fitted:
            title, unit = str(one["parameter"].values), pretty_unit(str(one["parameter_unit"].values))
        (titled if n else key)(axes, title)
        axis.show(axes)
        lowest = n + _COLUMNS > count
        axes.tick_params(labelbottom=lowest)
        axes.set(ylabel="" if unit == "1" else unit, xlabel=axis.label if lowest else "")
    return figure


def _estimates(axes: Axes, one: xarray.Dataset, axis: Axis, second: list[Axis], name: str) -> None:
    texts = second[0].texts if second else ["estimate, 1 sigma"]
    width = _APART * (float(np.ptp(axis.place)) or 1.0) if len(texts) > 1 and not axis.log else 0.0
    for n, (label, color) in enumerate(zip(texts, PALETTE, strict=False)):
        here = one.isel({second[0].dim: n}) if second else one
        value, good = here[name].values, here["converged"].values == 1
        sigma = here["sigma"].values if name == "value" else np.zeros(len(value))
        at, known = axis.place + width * (n - (len(texts) - 1) / 2), good & np.isfinite(sigma)
        style: dict[str, Any] = {"fmt": "o", "ms": 3.6, "lw": 1.2, "color": color, "label": label}
        axes.errorbar(at[known], value[known], yerr=sigma[known], **style)
        axes.plot(at[good & ~known], value[good & ~known], "o", ms=4.2, mfc="none", color=color)
        axes.plot(at[~good], value[~good], "x", ms=4.2, color=INK)
