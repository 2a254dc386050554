"""Assignment of variables to plots, decided by dimensions, units and attributes alone.

A new observable or invariant needs no line here: it gets a plot of its own, or joins the plot of
the scalars that share its unit.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import xarray

from rigidsim.look.signals import in_words, is_averaged, is_own_state
from rigidsim.look.solids import Array, Color
from rigidsim.scene.readable import angle_unit, si_scale

RED: Color = (235, 97, 89)
GREEN: Color = (104, 190, 110)
BLUE: Color = (92, 148, 235)
GREY: Color = (170, 170, 175)
_ERROR: Color = (165, 168, 176)  # seen on dark and on light ground
_VECTOR = (RED, GREEN, BLUE)
_PALETTE: tuple[Color, ...] = (
    *((240, 190, 60), (80, 200, 215), (225, 115, 190), (150, 200, 90)),
    *((165, 135, 235), (235, 140, 80), (120, 165, 200), (200, 200, 120)),
)
DRIFTS = "all"  # name of the drifts together
_MOST_SERIES = 16  # of one variable, so that a recorded matrix history stays readable


@dataclass(frozen=True)
class Series:
    """One variable as it is plotted, or ``DRIFTS``: (rows, components), each with a label and a colour, and
    its uncertainty (rows,) to both sides; None where that isn't known or can't be seen.
    """

    name: str
    labels: list[str]
    colors: list[Color]
    values: Array
    error: Array | None = None


@dataclass(frozen=True)
class Level:
    """A value for the whole run, drawn as a horizontal line."""

    key: str
    label: str
    color: Color
    value: float


@dataclass(frozen=True)
class Plot:
    """One plot: a title with the unit, a place ("leading", "more", "drift"), its variables and levels."""

    key: str
    title: str
    place: str
    series: list[Series] = field(default_factory=list)
    levels: list[Level] = field(default_factory=list)
    window: int = 0  # rows about the cursor that are shown of a long fast motion; 0 for the whole run

    @property
    def range(self) -> tuple[float, float] | None:
        """Limits for constant curves that don't magnify their rounding errors, and for those that the legend
        would cover; None for other plots.
        """
        return self._beside_legend if self._still is None else self._still

    @property
    def _beside_legend(self) -> tuple[float, float] | None:
        """Limits that leave room for the legend where it would cover curves: for drifts, which grow, at the
        lower right, for others at the upper left.
        """
        tables = [series.values for series in self.series]
        if self.place == "more" or len({len(table) for table in tables}) != 1 or not len(tables[0]):
            return None
        drift, rows = self.place == "drift", len(tables[0])
        near = slice(-max(rows // 3, 1), None) if drift else slice(0, max(rows // 3, 1))
        table = np.concatenate(tables, axis=1)
        beside = table if self.window else table[near]
        if not np.isfinite(table).any() or not np.isfinite(beside).any():
            return None
        low, high = float(np.nanmin(table)), float(np.nanmax(table))
        low, high = min([low, *(x.value for x in self.levels)]), max([high, *(x.value for x in self.levels)])
        lines = table.shape[1] + len(self.levels)
        share = min((_LEGEND_LINE * lines + _LEGEND_FRAME) / _PLOT_HEIGHT, 0.6)
        low_near, high_near = float(np.nanmin(beside)), float(np.nanmax(beside))
        room = share * (high - low)
        covered = low_near < low + room if drift else high_near > high - room
        if lines < 2 or high == low or not covered:
            return None
        room, margin = (high - low) * share / (1 - share), 0.04 * (high - low)
        return (low - room, high + margin) if drift else (low - margin, high + room)

    @property
    def _still(self) -> tuple[float, float] | None:
        if self.place == "drift" or not self.series:
            return None
        middles = []
        for series in self.series:
            error = 0.0 if series.error is None else float(np.nanmax(series.error, initial=0.0))
            for column in series.values.T:
                finite = column[np.isfinite(column)]
                if not len(finite) or np.ptp(finite) > max(_STILL * np.abs(finite).max(), 2 * error):
                    return None
                middles.append(float(finite.mean()))
        low, high = min(middles), max(middles)
        margin = 0.05 * max(abs(low), abs(high)) or 1.0
        return low - margin, high + margin


def plan_plots(dataset: xarray.Dataset, leading: Sequence[str] = ()) -> list[Plot]:
    """Plots for every numeric variable along time, in the order in which they are shown: leading ones first.

    Drifts become log10 of their magnitude in a common plot. Scalars of the same unit share a plot; a vector
    has its own, and so has what leads. Angles are in the unit in which they read best.
    """
    plots: dict[str, Plot] = {}
    variables = list(_variables(dataset))
    present = [str(v.name) for v in variables]
    first = [name for name in leading if name in present] or [name for name in _USUAL if name in present]
    first = first[:MOST_LEADING]
    floor = drift_floor([_columns(v) for v in variables if "drift_of" in v.attrs])
    for variable in variables:
        name = str(variable.name)
        unit = str(variable.attrs.get("units", ""))
        factor, shown_unit = _reading(variable, unit)
        if {"drift_of", "put_back_of"} & set(variable.attrs):
            key, title, place = "drift", "Drift of invariants, log10", "drift"
        elif is_own_state(variable):
            key, title, place = f"own {shown_unit}", _with_unit("own states", shown_unit), "leading"
        elif variable.ndim > 1 or name in first:
            # The name, not the long name: it is short, and what the user meets in the dataset.
            key, place = name, "leading" if name in first else "more"
            lost = "angle" in variable.attrs and "angles_wrapped_from" in dataset.attrs
            title = _with_unit(name.replace("_", " ") + (" within one turn" if lost else ""), shown_unit)
        else:
            key, place = f"scalars {shown_unit}", "more"
            title = _with_unit(name.replace("_", " "), shown_unit)
        window = int(variable.attrs.get("shown_rows", 0))
        plot = plots.setdefault(key, Plot(key, title[:1].upper() + title[1:], place, window=window))
        series = _series(variable, len(plot.series), floor)
        if factor != 1.0:
            series = replace(series, values=series.values * factor)
        if place == "leading" and unit == "rad":
            series = replace(series, error=_uncertainty(dataset, series.values, factor))
        plot.series.append(series)
    if "drift" in plots:  # curves that are drawn alike are one entity
        drift = plots["drift"]
        together = Series(
            DRIFTS,
            [label for series in drift.series for label in series.labels],
            [color for series in drift.series for color in series.colors],
            np.concatenate([series.values for series in drift.series], axis=1),
        )
        plots["drift"] = replace(drift, series=[together], levels=_announced(dataset))
    order = {name: number for number, name in enumerate(first)}
    return sorted(
        plots.values(), key=lambda plot: (_ORDER.index(plot.place), order.get(plot.key, len(order)))
    )


def _reading(variable: xarray.DataArray, unit: str) -> tuple[float, str]:
    """Factor to, and symbol of, the unit that suits a variable."""
    if pretty_unit(unit) == "rad/s":  # "rad s-1" in datasets
        divisor, prefixed = si_scale(_columns(variable), "rad/s")
        return (1.0, "rad/s") if prefixed.startswith("1e") else (1 / divisor, prefixed)
    if unit != "rad":
        return 1.0, unit
    values = _columns(variable)
    values = values[np.isfinite(values)]
    found = angle_unit(float(np.abs(values).max(initial=0.0)))
    return found.per_radian, found.symbol


def _uncertainty(dataset: xarray.Dataset, values: Array, factor: float) -> Array | None:
    """The announced attitude error, growing like t^1.5 to that at the end, if large enough to be seen."""
    error = dataset.attrs.get("attitude_error")
    finite = values[np.isfinite(values)]
    if error is None or not len(finite) or not float(error) * factor > _SEEN * float(np.ptp(finite)):
        return None
    seconds = np.asarray(dataset["time"].values, dtype=np.float64)
    share = np.abs(seconds - seconds[0]) / (abs(seconds[-1] - seconds[0]) or 1.0)
    return np.asarray(float(error) * factor * share**1.5)


def _announced(dataset: xarray.Dataset) -> list[Level]:
    """The announced error at the end of the run beside the drifts: far above them where errors grew."""
    error = float(dataset.attrs.get("attitude_error", 0.0))
    if not (np.isfinite(error) and error > 0):
        return []
    what = "axis" if is_averaged(dataset.attrs) else "attitude"
    return [Level("attitude_error", f"error of the {what} at the end, rad", _ERROR, float(np.log10(error)))]


def drift_floor(drifts: list[Array]) -> float:
    """Value at which a drift of exactly zero, which has no logarithm, is drawn: a tenth of the low end of all
    nonzero ones, in any precision.
    """
    some = [values[:: max(len(values) // _FLOOR_ROWS, 1)].ravel() for values in drifts]
    magnitude = np.abs(np.concatenate(some)) if some else np.empty(0)
    nonzero = magnitude[np.isfinite(magnitude) & (magnitude > 0)]
    return max(float(np.percentile(nonzero, 2)) / 10, 1e-300) if len(nonzero) else 1e-20


_LEGEND_LINE, _LEGEND_FRAME, _PLOT_HEIGHT = 23.0, 18.0, 250.0  # points of the screen, about
_ORDER = ("leading", "more", "drift")
_USUAL = ("angular_velocity", "euler_angles")
MOST_LEADING = 3
_SIGNS = ("°", "″")
_FLOOR_ROWS = 5000  # of each drift that are looked at for the floor
_STILL = 1e-9  # of a curve's size, below which what it does is rounding
_TOGETHER = 3e-3  # of a curve's range: what lies nearer is covered by its line
_SEEN = 2e-3  # of a curve's range: a narrower band is no wider than the line


def pretty_unit(unit: str) -> str:
    """A unit as people write it: `kg m2 s-1` (UDUNITS) and `kg m^2/s` both give `kg m²/s`."""
    above: list[str] = []
    below: list[str] = []
    top, *bottom = unit.split("/")
    for part in (top, *bottom):
        for base, power in re.findall(r"([^\W\d_]+|1)\^?(-?\d+)?", part):
            exponent = int(power or 1) * (1 if part is top else -1)
            digits = str(abs(exponent)).translate(_SUPERSCRIPTS) if abs(exponent) != 1 else ""
            if base != "1":
                (above if exponent > 0 else below).append(base + digits)
    numerator = " ".join(above) or ("1" if below else "")
    return "/".join([numerator, *below])


_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def _with_unit(text: str, unit: str) -> str:
    if unit in _SIGNS:
        return f"{text} [{unit}]"
    return f"{text} [{pretty_unit(unit)}]" if pretty_unit(unit) else text


def _variables(dataset: xarray.Dataset) -> Iterator[xarray.DataArray]:
    # Angles before quaternions, because people read them; the rest as recorded.
    names = sorted(map(str, dataset.data_vars), key=lambda name: name != "euler_angles")
    for name in names:
        variable = dataset[name]
        if (
            "time" in variable.dims
            and variable.dtype.kind in "fiub"
            and "covariance_of" not in variable.attrs
        ):
            yield variable.transpose("time", ...)


def _columns(variable: xarray.DataArray) -> Array:
    values = np.asarray(variable.values, dtype=np.float64).reshape(variable.shape[0], -1)
    return values[:, :_MOST_SERIES]


def _series(variable: xarray.DataArray, position: int, floor: float) -> Series:
    name = str(variable.name)
    values = _columns(variable)
    count = values.shape[1]
    drifting, projected = (variable.attrs.get(role) for role in ("drift_of", "put_back_of"))
    if drifting or projected:  # the latter: what the drift would have been
        labels = [in_words(drifting) if drifting else f"correction of {in_words(str(projected))}"]
        values = np.log10(np.maximum(np.abs(values), floor))
    elif variable.ndim == 1:
        labels = [name.replace("_", " ")]
    else:
        labels = []
    across = str(variable.dims[1]) if variable.ndim == 2 else ""
    if across in variable.coords:
        components = [str(label) for label in variable.coords[across].values[:count]]
        labels = [f"{labels[0]} {c}" for c in components] if labels else components
    if len(labels) != count:
        base = labels[0] if labels else name.replace("_", " ")
        labels = [f"{base} {k}" for k in range(count)]
    colors = _colors(variable, count, position)
    if across == "axis":
        labels, colors, values = _told_apart(labels, colors, values)
    return Series(name, labels, colors, values)


def _told_apart(
    labels: list[str], colors: list[Color], values: Array
) -> tuple[list[str], list[Color], Array]:
    """Of axes that coincide only the first, with all their names, since the last would cover the others."""
    kept: list[int] = []
    names: list[str] = []
    for column, label in enumerate(labels):
        shown = values[np.isfinite(values[:, column])]
        for place, first in enumerate(kept):
            apart = np.abs(shown[:, column] - shown[:, first])
            if len(shown) and apart.max() <= _TOGETHER * np.ptp(shown[:, column]):
                names[place] += f", {label}"
                break
        else:
            kept.append(column)
            names.append(label)
    return names, [colors[k] for k in kept], values[:, kept]


def _colors(variable: xarray.DataArray, count: int, position: int) -> list[Color]:
    dimension = variable.dims[1] if variable.ndim == 2 else ""
    if dimension in ("body_axis", "space_axis") and count == 3:
        return list(_VECTOR)
    if dimension == "quaternion_component" and count == 4:
        return [GREY, *_VECTOR]
    return [_PALETTE[(position + k) % len(_PALETTE)] for k in range(count)]
