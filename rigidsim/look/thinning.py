"""A bounded number of a dataset's rows, evenly strided or by extremes, read into memory piece by piece."""

import numpy as np
import xarray
from numpy.typing import NDArray

ROWS_AT_ONCE = 1 << 21


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
    if "time" not in dataset.dims or "time" not in dataset.coords:
        raise ValueError("the dataset has no time coordinate: nothing to show along time")
    count = dataset.sizes["time"]
    thinned_indices(count, rows)  # refuses what can't be
    wanted, stride = _along_time(dataset), _stride(count, rows)
    # A slice is a strided read in HDF5; a list of indices would be read index by index. Each read makes some
    # kilobytes of notes for every chunk that it touches, hence pieces.
    piece = stride * max(1, ROWS_AT_ONCE // stride)
    slices = [slice(first, min(first + piece, count), stride) for first in range(0, count, piece)]
    if (count - 1) % stride:
        slices.append(slice(count - 1, count))
    parts = [wanted.isel(time=part).load() for part in slices]
    joined = xarray.concat(parts, dim="time", data_vars="all", combine_attrs="override")
    return joined.transpose("time", ...)


def _along_time(dataset: xarray.Dataset) -> xarray.Dataset:
    along = {str(n): v for n, v in dataset.data_vars.items() if "time" in v.dims and v.dtype.kind in "fiub"}
    return dataset[[name for name, variable in along.items() if "residual_of" not in variable.attrs]]


def _stride(count: int, rows: int) -> int:
    return max(1, -(-(count - 1) // (rows - 1)))


def thin_with_extremes(dataset: xarray.Dataset, rows: int) -> tuple[xarray.Dataset, xarray.Dataset]:
    """The rows of `thin`; and these with, of each component's values, the least and the largest of every two
    strides in turn, so that a fast motion keeps its amplitude as a curve. The first and the last row's values
    are their own. All rows are read once, `ROWS_AT_ONCE` at a time. See `thin` for errors.
    """
    count = dataset.sizes.get("time", 0)
    stride = _stride(count, rows) if rows > 1 else 1
    if stride == 1:  # every row is shown, or nothing can be
        found = thin(dataset, rows)
        return found, found
    wanted, piece = _along_time(dataset), 2 * stride * max(1, ROWS_AT_ONCE // (2 * stride))
    plain, extremes = [], []
    for first in range(0, count, piece):
        part = wanted.isel(time=slice(first, min(first + piece, count))).load()
        strided = part.isel(time=slice(None, None, stride))
        plain.append(strided.copy(deep=True))
        extremes.append(strided.map(_extremes, args=(part, 2 * stride)))
    if (count - 1) % stride:
        last = wanted.isel(time=slice(count - 1, count)).load()
        plain.append(last)
        extremes.append(last)
    whole, shown = (
        xarray.concat(parts, dim="time", data_vars="all", combine_attrs="override").transpose("time", ...)
        for parts in (plain, extremes)
    )
    for name in shown.data_vars:
        shown[name].values[[0, -1]] = whole[name].values[[0, -1]]
    return whole, shown


def _extremes(strided: xarray.DataArray, part: xarray.Dataset, pair: int) -> xarray.DataArray:
    found = strided.copy(deep=True)
    if found.dtype.kind == "f":
        along = found.dims.index("time")
        values, target = np.moveaxis(part[found.name].values, along, 0), np.moveaxis(found.values, along, 0)
        starts = np.arange(0, len(values), pair)
        for k, reduce in enumerate((np.fmin, np.fmax)):
            room = target[k::2]
            room[...] = reduce.reduceat(values, starts)[: len(room)]
    return found
