"""A bounded number of a dataset's rows, evenly strided or by extremes, read into memory piece by piece."""

from collections.abc import Hashable
from typing import Any

import numpy as np
import xarray
from numpy.typing import NDArray

ROWS_AT_ONCE = 1 << 19


def thinned_indices(count: int, rows: int) -> NDArray[np.int64]:
    """Indices (R,) into `count` >= 1 rows, evenly strided, R <= `rows` >= 2, with the first and the last;
    ``ValueError`` where these are out of range.
    """
    if count < 1:
        raise ValueError("the dataset has no samples: nothing to show")
    if rows < 2:
        raise ValueError(f"rows must be at least 2 (the first and the last), given {rows}")
    indices = np.arange(0, count, _stride(count, rows), dtype=np.int64)
    return indices if indices[-1] == count - 1 else np.append(indices, count - 1)


def thin(dataset: xarray.Dataset, rows: int) -> xarray.Dataset:
    """The rows of `thinned_indices`, in memory, of variables along time; residuals are left out.

    They are read from `ROWS_AT_ONCE` rows of the file at a time: memory goes with `rows`, not with the run's
    length. ``ValueError`` without a `time` dimension or coordinate, or see `thinned_indices`.
    """
    return _thinned(dataset, rows, extremes=False)[0]


def thin_with_extremes(dataset: xarray.Dataset, rows: int) -> tuple[xarray.Dataset, xarray.Dataset]:
    """The rows of `thin`; and these with, of each component's values, the least and the largest of every two
    strides in turn, so that a fast motion keeps its amplitude as a curve. The first and the last row's values
    are their own. All rows are read once, `ROWS_AT_ONCE` at a time. See `thin` for errors.
    """
    return _thinned(dataset, rows, extremes=True)


def _thinned(dataset: xarray.Dataset, rows: int, *, extremes: bool) -> tuple[xarray.Dataset, xarray.Dataset]:
    if "time" not in dataset.dims or "time" not in dataset.coords:
        raise ValueError("the dataset has no time coordinate: nothing to show along time")
    count = dataset.sizes["time"]
    indices, stride = thinned_indices(count, rows), _stride(count, rows)
    along = {str(n): v for n, v in dataset.data_vars.items() if "time" in v.dims and v.dtype.kind in "fiub"}
    names = [name for name, variable in along.items() if "residual_of" not in variable.attrs]
    plain, shown = dict[Hashable, xarray.Variable](), dict[Hashable, xarray.Variable]()
    for name, variable in dataset[names].variables.items():
        plain[name] = variable
        if "time" in variable.dims:
            bounds: bool = extremes and stride > 1 and name in along and variable.dtype.kind == "f"
            dims = ("time", *(dim for dim in variable.dims if dim != "time"))
            both = _values(variable, indices, stride, extremes=bounds)
            plain[name], shown[name] = (xarray.Variable(dims, found, variable.attrs) for found in both)
    coords = [name for name in plain if name not in along]
    whole = xarray.Dataset(plain, attrs=dataset.attrs).set_coords(coords)
    return whole, xarray.Dataset(plain | shown, attrs=dataset.attrs).set_coords(coords) if extremes else whole


def _values(
    variable: xarray.Variable, indices: NDArray[np.int64], stride: int, *, extremes: bool
) -> tuple[NDArray[Any], NDArray[Any]]:
    """The values at indices, time first, and those or their extremes as in `thin_with_extremes`."""
    count, others = variable.sizes["time"], [n for dim, n in variable.sizes.items() if dim != "time"]
    plain = np.empty((len(indices), *others), variable.dtype)
    shown = np.empty_like(plain) if extremes else plain
    # A slice is a strided read in HDF5; a list of indices would be read index by index.
    step, piece = 1 if extremes else stride, 2 * stride * max(1, ROWS_AT_ONCE // (2 * stride))
    for first in range(0, count, piece):
        part = variable.isel(time=slice(first, min(first + piece, count), step)).transpose("time", ...).values
        strided = part[:: stride // step]
        place = slice(first // stride, first // stride + len(strided))
        plain[place] = strided
        if extremes:
            starts = np.arange(0, len(part), 2 * stride)
            for k, (quick, sure) in enumerate(((np.minimum, np.fmin), (np.maximum, np.fmax))):
                room, found = shown[place][k::2], quick.reduceat(part, starts)
                room[...] = (sure.reduceat(part, starts) if np.isnan(found).any() else found)[: len(room)]
    if indices[-1] % stride:
        plain[-1] = variable.isel(time=-1).values
    shown[[0, -1]] = plain[[0, -1]]
    return plain, shown


def _stride(count: int, rows: int) -> int:
    return max(1, -(-(count - 1) // (rows - 1)))
