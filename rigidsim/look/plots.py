"""What is drawn over time, as values with labels, a unit and colours: one form for figures and timelines."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray

from rigidsim.look.signals import in_words, is_averaged
from rigidsim.look.solids import Array, Color
from rigidsim.scene.readable import scaled, with_unit

HUES: dict[str, tuple[str, Color]] = {
    "red": ("#d1495b", (235, 97, 89)),
    "green": ("#3a9a5b", (104, 190, 110)),
    "blue": ("#2f6fbf", (92, 148, 235)),
    "orange": ("#d9822b", (240, 175, 70)),
    "violet": ("#8f5bb5", (165, 135, 235)),
    "teal": ("#17a2b0", (80, 200, 215)),
    "pink": ("#c2327a", (225, 115, 190)),
    "brown": ("#8c6d46", (200, 170, 120)),
    "grey": ("#6b7280", (170, 170, 175)),
}
"""Colours by name: on paper, and on the dark ground of the screen."""
XYZ = ("red", "green", "blue")
PALETTE = ("blue", "orange", "violet", "green", "red", "teal", "brown", "grey", "pink")
_STILL = 1e-9  # of a curve's size, below which what it does is rounding
_SEEN = 2e-3  # of a curve's range: a narrower band is no wider than the line
_MOST_CURVES = 16  # of one variable, so that a recorded matrix history stays readable
TYPICAL, MOST = 0.5, 50.0
"""In units of tolerance times sqrt(steps): a random walk of one rounding per step (Brouwer 1937), and the
drift above which a summary warns (a few roundings of several operations per step).
"""


def paper(hue: str | Color) -> Any:
    """A colour as matplotlib draws it, by its name or itself."""
    return HUES[hue][0] if isinstance(hue, str) else tuple(x / 255 for x in hue)


def screen(hue: str | Color) -> Color:
    """A colour on the dark ground of the screen, by its name or itself."""
    return HUES[hue][1] if isinstance(hue, str) else hue


@dataclass(frozen=True)
class Plot:
    """Curves over time.

    Attributes:
        name: of its entity, and of the variable that it shows, if that is one.
        values: (rows, curves) in the unit; error: (rows,) to both sides, where that is known and can be seen.
        labels, hues: by curve; a single one needs no label.
        word: what the axis of values says before the unit.
        place: "leading", "more" or "drift".
        begins: the start is shown beside the whole, if that is a solid band.
        sparse: samples too far apart to be joined. log: on a logarithmic axis. from_zero: it begins there.
        levels: values for the whole run by label. band: lower and upper edge (rows,).
        window: rows about the cursor that a timeline shows of a long fast motion; 0 for the whole run.
        recorded: divisor of the recorded variable `name` that the values are; 0 if they are something else.
    """

    name: str
    title: str
    values: Array
    labels: Sequence[str] = ("",)
    unit: str = ""
    hues: Sequence[str | Color] = PALETTE
    word: str = "value"
    place: str = "leading"
    error: Array | None = None
    begins: bool = False
    sparse: bool = False
    log: bool = False
    from_zero: bool = False
    levels: Mapping[str, float] = field(default_factory=dict)
    band: tuple[Array, Array] | None = None
    window: int = 0
    recorded: float = 0.0

    @property
    def heading(self) -> str:
        """Title with the unit."""
        return with_unit(self.title, self.unit) + (", log10" if self.log else "")

    @property
    def steady(self) -> tuple[float, float] | None:
        """Limits for curves that are constant, which don't magnify rounding errors; None for others."""
        low, high = (reduce(self.values, axis=0) for reduce in (np.fmin.reduce, np.fmax.reduce))
        error = 0.0 if self.error is None else float(np.nanmax(self.error, initial=0.0))
        sizes = np.maximum(np.abs(low), np.abs(high))
        if self.log or not (high - low <= np.maximum(_STILL * sizes, 2 * error)).all():
            return None
        margin = 0.05 * float(sizes.max()) or 1.0
        return float(low.min()) - margin, float(high.max()) + margin


def moves(values: Array) -> bool:
    """Whether a curve is more than a constant and its rounding errors."""
    finite = values[np.isfinite(values)]
    return bool(len(finite) and np.ptp(finite) > _STILL * np.abs(finite).max())


def uncertain(dataset: xarray.Dataset, values: Array, divisor: float) -> Array | None:
    """The announced attitude error of angles, growing like t^1.5 to that at the end, if it can be seen."""
    error, finite = dataset.attrs.get("attitude_error"), values[np.isfinite(values)]
    if error is None or not len(finite) or not float(error) / divisor > _SEEN * float(np.ptp(finite)):
        return None
    seconds = np.asarray(dataset["time"].values, dtype=np.float64)
    share = np.abs(seconds - seconds[0]) / (abs(seconds[-1] - seconds[0]) or 1.0)
    return np.asarray(float(error) / divisor * share**1.5)


def drift_plot(dataset: xarray.Dataset) -> Plot | None:
    """Magnitudes of all relative drifts, and of corrections by projection, over the band that rounding
    explains; None without any.
    """
    columns = {}
    for variable, table in _along_time(dataset):
        drifting, projected = (variable.attrs.get(role) for role in ("drift_of", "put_back_of"))
        if drifting or projected:
            size = np.abs(table).max(axis=1)
            name = in_words(str(drifting)) if drifting else f"correction of {in_words(str(projected))}"
            columns[name if (size > 0).any() else f"{name}: exactly 0"] = np.where(size > 0, size, np.nan)
    if not columns:
        return None
    error, law = float(dataset.attrs.get("attitude_error", 0.0)), rounding_law(dataset)
    what = "axis" if is_averaged(dataset.attrs) else "attitude"
    levels = {f"error of the {what} at the end, rad": error} if np.isfinite(error) and error > 0 else {}
    band, table = None if law is None else (TYPICAL * law, MOST * law), np.stack([*columns.values()], axis=1)
    options: dict[str, Any] = {"word": "relative drift", "place": "drift", "log": True}
    return Plot("drift", "Drift of invariants", table, [*columns], levels=levels, band=band, **options)


def rounding_law(dataset: xarray.Dataset) -> Array | None:
    """tolerance sqrt(steps until then) (rows,), steps spread evenly over the run; None if there were none."""
    steps, tolerance = (float(dataset.attrs.get(name) or 0.0) for name in ("steps", "tolerance"))
    seconds = np.asarray(dataset["time"].values, dtype=np.float64)
    span = seconds[-1] - seconds[0]
    if not (steps > 0 and tolerance > 0 and span):
        return None
    return tolerance * np.sqrt(np.maximum(steps * (seconds - seconds[0]) / span, 1.0))


def other_plots(dataset: xarray.Dataset, shown: Sequence[str]) -> list[Plot]:
    """Plots of all further numeric variables along time: of each vector, and of scalars that share a unit.

    A new observable or invariant needs no line anywhere.
    """
    roles = {"drift_of", "put_back_of", "covariance_of"}
    left = [v for v, _ in _along_time(dataset) if str(v.name) not in shown and not roles & set(v.attrs)]
    plots = [variable_plot(dataset, variable) for variable in left if variable.ndim > 1]
    for unit, columns in by_unit([variable for variable in left if variable.ndim == 1]).items():
        table, labels = np.stack([*columns.values()], axis=1), [name.replace("_", " ") for name in columns]
        divisor, shown_unit = scaled(table, unit)
        title = labels[0][:1].upper() + labels[0][1:]
        plots.append(Plot(f"scalars {unit}", title, table / divisor, labels, shown_unit, place="more"))
    return plots


def by_unit(scalars: Iterable[xarray.DataArray]) -> dict[str, dict[str, Array]]:
    """Columns (rows,) of scalars along time by their unit and name."""
    found: dict[str, dict[str, Array]] = {}
    for one in scalars:
        column = np.asarray(one.values, dtype=np.float64)
        found.setdefault(str(one.attrs.get("units", "")), {})[str(one.name)] = column
    return found


def variable_plot(dataset: xarray.Dataset, variable: xarray.DataArray, place: str = "more") -> Plot:
    """The plot of one recorded variable, with the labels of its components."""
    name, table = str(variable.name), _table(variable)
    dimension = str(variable.dims[1]) if variable.ndim == 2 else ""
    named = variable.coords[dimension].values if dimension in variable.coords else range(table.shape[1])
    labels = [str(label) for label in named[: table.shape[1]]] if variable.ndim > 1 else [""]
    hues = XYZ if dimension in ("body_axis", "space_axis") else PALETTE
    divisor, unit = scaled(table, str(variable.attrs.get("units", "")))
    wrapped = "angle" in variable.attrs and "angles_wrapped_from" in dataset.attrs
    title = name[:1].upper() + name[1:].replace("_", " ") + (" within one turn" if wrapped else "")
    return Plot(name, title, table / divisor, labels, unit, hues, place=place, recorded=divisor)


def _along_time(dataset: xarray.Dataset) -> Iterator[tuple[xarray.DataArray, Array]]:
    # Angles before quaternions, because people read them; the rest as recorded.
    for name in sorted(map(str, dataset.data_vars), key=lambda name: name != "euler_angles"):
        if "time" in dataset[name].dims and dataset[name].dtype.kind in "fiub":
            variable = dataset[name].transpose("time", ...)
            yield variable, _table(variable)


def _table(variable: xarray.DataArray) -> Array:
    table = np.asarray(variable.values, dtype=np.float64).reshape(variable.shape[0], -1)
    return table[:, :_MOST_CURVES]
