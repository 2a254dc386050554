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
    along = {str(n): v for n, v in dataset.data_vars.items() if "time" in v.dims and v.dtype.kind in "fiub"}
    wanted = dataset[[name for name, variable in along.items() if "residual_of" not in variable.attrs]]
    stride = _stride(count, rows)
    # A slice is a strided read in HDF5; a list of indices would be read index by index. Each read makes some
    # kilobytes of notes for every chunk that it touches, hence pieces.
    piece = stride * max(1, ROWS_AT_ONCE // stride)
    slices = [slice(first, min(first + piece, count), stride) for first in range(0, count, piece)]
    if (count - 1) % stride:
        slices.append(slice(count - 1, count))
    parts = [wanted.isel(time=part).load() for part in slices]
    joined = xarray.concat(parts, dim="time", data_vars="all", combine_attrs="override")
    return joined.transpose("time", ...)


def _stride(count: int, rows: int) -> int:
    return max(1, -(-(count - 1) // (rows - 1)))


def by_extremes(dataset: xarray.Dataset, rows: int) -> xarray.Dataset:
    """The rows of `thin`, but of each component's values the least and the largest of every two strides in
    turn, so that a fast motion keeps its amplitude as a curve; times are those of `thin`, the first and the
    last row's values are their own. All rows are read, `ROWS_AT_ONCE` at a time. See `thin` for errors.
    """
    found, count = thin(dataset, rows), dataset.sizes["time"]
    pair = 2 * _stride(count, rows)
    if pair == 2:  # every row is shown
        return found
    piece = pair * max(1, ROWS_AT_ONCE // pair)
    for first in range(0, count, piece):
        part = dataset[list(found.data_vars)].isel(time=slice(first, min(first + piece, count))).load()
        starts = np.arange(0, part.sizes["time"], pair)
        place = 2 * (first // pair)
        for name in found.data_vars:
            if found[name].dtype.kind != "f":
                continue
            values = np.moveaxis(np.asarray(part[name].values), part[name].dims.index("time"), 0)
            low, high = np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)
            target = found[name].values  # time first, in memory
            room = target[place : place + 2 * len(starts)]
            for k, extremes in enumerate((low, high)):
                inner = room[k::2]
                inner[...] = extremes[: len(inner)]
    for row in (0, -1):
        ends = dataset[list(found.data_vars)].isel(time=row).load()
        for name in found.data_vars:
            if found[name].dtype.kind == "f":
                found[name].values[row] = ends[name].values
    return found
