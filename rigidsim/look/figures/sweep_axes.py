"""Axes of a sweep's figure: positions of members along them, with labels and scales, and swept directions."""

import math

import numpy as np
import xarray
from matplotlib.axis import Axis
from matplotlib.ticker import MaxNLocator

from rigidsim.look.solids import Array
from rigidsim.look.units import pretty_unit

_MOST_TOLD = 12  # values that are told at their ticks
_CROWDED = 60  # characters side by side
_LONGEST = 24  # characters of a text
_DECADES = 1.5  # from which on values of one sign have a logarithmic scale
_FEWEST = 12  # directions that make a map
_ALIKE = 1e-9  # lengths, relative


def axes_of(dataset: xarray.Dataset) -> list[str]:
    """Dimensions of the members."""
    return [str(dim) for dim in dataset["status"].dims]


def directions(dataset: xarray.Dataset, dim: str) -> Array | None:
    """Unit vectors (members, 3) of an axis that sweeps directions; None for any other axis."""
    name = f"{dim}_value"
    if name not in dataset.coords or dataset[name].dims[0] != dim or dataset[name].shape[1:] != (3,):
        return None
    vectors = np.asarray(dataset[name].values, dtype=np.float64)
    lengths = np.linalg.norm(vectors, axis=1)
    if len(vectors) < _FEWEST or not lengths.min() > 0 or np.ptp(lengths) > _ALIKE * lengths.max():
        return None
    return np.asarray(vectors / lengths[:, None])


def label_of(dataset: xarray.Dataset, dim: str, place: int) -> str:
    """Label of one place along a dimension: the component x of a vector, or a value of an axis."""
    told = value_text(dataset, dim, place)
    if told is None:
        return str(place)
    return told if dataset[dim].dtype.kind not in "fi" else f"{dim.replace('_', ' ')} {told}"


def value_text(dataset: xarray.Dataset, dim: str, place: int) -> str | None:
    """The value at one place along a dimension: a number, a text or a vector; None if there is none."""
    name = _values_of(dataset, dim)
    if name is None:
        return None
    value = dataset[name].values[place]
    if np.ndim(value):
        return f"[{', '.join(format(float(x), '.4g') for x in value)}]"
    if dataset[name].dtype.kind in "fi":
        return format(float(value), ".4g")
    return str(value) if len(str(value)) <= _LONGEST else str(value)[: _LONGEST - 3] + "..."


def _values_of(dataset: xarray.Dataset, dim: str) -> str | None:
    """Name of the coordinate that holds an axis's values."""
    return next((name for name in (f"{dim}_value", dim) if name in dataset.coords), None)


def along(dataset: xarray.Dataset, dim: str) -> tuple[Array, str, bool]:
    """Positions of an axis's values, its label, and whether they are only numbered, as texts and vectors."""
    if dim in dataset.coords and dataset[dim].ndim == 1 and dataset[dim].dtype.kind in "fi":
        return np.asarray(dataset[dim].values, dtype=np.float64), named(dataset[dim], dim), False
    for name, coordinate in dataset.coords.items():  # a zip's axes lie along its members
        if coordinate.dims == (dim,) and coordinate.dtype.kind == "f" and "swept_key" in coordinate.attrs:
            return np.asarray(coordinate.values, dtype=np.float64), named(coordinate, str(name)), False
    values = _values_of(dataset, dim)
    label = f"{dim.replace('_', ' ')}, counted from 0"
    if values is not None and dataset.sizes[dim] <= _MOST_TOLD:
        label = named(dataset[values], dim)
    return np.arange(dataset.sizes[dim], dtype=np.float64), label, True


def number_ticks(axis: Axis, dataset: xarray.Dataset, dim: str, *, along_x: bool) -> None:
    """Ticks at whole numbers where an axis's values are numbered, few of them with their values."""
    place, _, numbered = along(dataset, dim)
    if not numbered:
        return
    texts = [value_text(dataset, dim, i) or "" for i in range(len(place))] if len(place) <= _MOST_TOLD else []
    if not any(texts):
        axis.set_major_locator(MaxNLocator(8, integer=True))
        return
    axis.set_ticks(place.tolist(), texts)
    if along_x and sum(map(len, texts)) > _CROWDED:
        for tick in axis.get_ticklabels():
            tick.set(rotation=25, ha="right", rotation_mode="anchor")


def named(variable: xarray.DataArray, name: str | None = None) -> str:
    """A variable's name and unit; for a sweep's axis also its key."""
    words = (name or str(variable.name)).replace("_", " ")
    swept = str(variable.attrs.get("swept_key", ""))
    if swept and swept != name:
        words += f" ({swept})"
    unit = pretty_unit(str(variable.attrs.get("units", "")))
    return f"{words} [{unit}]" if unit else words


def title_of(variable: xarray.DataArray, said: str = "") -> str:
    """Title: what a variable is, and where it is cut."""
    title = str(variable.attrs.get("long_name") or variable.name).replace("_", " ")
    title = title[:1].upper() + title[1:]
    return f"{title}; {said}" if said else title


def spans_decades(values: Array) -> bool:
    """Whether values are better shown on a logarithmic scale."""
    finite = values[np.isfinite(values)]
    if not len(finite) or finite.min() <= 0:
        return False
    low, high = np.percentile(finite, [2, 98])
    return bool(math.log10(finite.max() / finite.min()) > 1 and math.log10(high / low) > _DECADES)


def geometric(place: Array) -> bool:
    """Whether an axis's values span decades at equal ratios, so that its scale is logarithmic."""
    if not spans_decades(place):
        return False
    ratios = np.diff(np.log(np.unique(place)))
    return len(ratios) < 2 or float(np.ptp(ratios)) < 0.01 * float(ratios.mean())


def edges_of(place: Array, log: bool) -> Array:
    """Borders of cells about values, (n + 1,)."""
    at = np.log(place) if log else place
    if len(at) == 1:
        at = np.array([at[0] - 0.5, at[0] + 0.5])
    else:
        middles = (at[1:] + at[:-1]) / 2
        at = np.concatenate([[2 * at[0] - middles[0]], middles, [2 * at[-1] - middles[-1]]])
    return np.exp(at) if log else at
