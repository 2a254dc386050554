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
    thinned_indices(count, rows)  # refuses what can't be
    along = {str(n): v for n, v in dataset.data_vars.items() if "time" in v.dims and v.dtype.kind in "fiub"}
    wanted = dataset[[name for name, variable in along.items() if "residual_of" not in variable.attrs]]
    stride = _stride(count, rows)
    # A slice is a strided read in HDF5; a list of indices would be read index by index. Each read makes some
    # kilobytes of notes for every chunk that it touches, hence pieces.
    extremes = extremes and stride > 1
    step, piece = 1 if extremes else stride, 2 * stride * max(1, ROWS_AT_ONCE // (2 * stride))
    plain, shown = [], []
    for first in range(0, count, piece):
        part = wanted.isel(time=slice(first, min(first + piece, count), step)).load()
        strided = part.isel(time=slice(None, None, stride // step))
        plain.append(strided.copy(deep=True))
        if extremes:
            shown.append(strided.map(_extremes, args=(part, 2 * stride)))
    if (count - 1) % stride:
        plain.append(wanted.isel(time=slice(count - 1, count)).load())
        shown.append(plain[-1])
    whole, *curves = (
        xarray.concat(parts, dim="time", data_vars="all", combine_attrs="override").transpose("time", ...)
        for parts in (plain, *([shown] if extremes else []))
    )
    for found in curves:
        for name in found.data_vars:
            found[name].values[[0, -1]] = whole[name].values[[0, -1]]
    return whole, curves[0] if curves else whole


def _stride(count: int, rows: int) -> int:
    return max(1, -(-(count - 1) // (rows - 1)))


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
