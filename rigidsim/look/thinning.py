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

    Memory goes with `rows`, not with the run's length. ``ValueError`` without a `time` dimension or
    coordinate, or see `thinned_indices`.
    """
    return _thinned(dataset, rows, extremes=False)[0]


def thin_with_extremes(
    dataset: xarray.Dataset, rows: int, known: "Thinning | None" = None
) -> tuple[xarray.Dataset, xarray.Dataset]:
    """The rows of `thin`; and these with, of each component's values, the least and the largest of every two
    strides in turn, so that a fast motion keeps its amplitude as a curve. The first and the last row's values
    are their own. All rows are read once, `ROWS_AT_ONCE` at a time, but for `known` ones. See `thin` for
    errors.
    """
    return _thinned(dataset, rows, extremes=True, known=known)


class Thinning:
    """The rows and extremes of `thin_with_extremes`, of variables whose values arrive in pieces."""

    def __init__(self, count: int, rows: int) -> None:
        self._count, self._rows, self._columns = count, rows, dict[str, _Column]()

    def add(self, name: str, values: NDArray[Any]) -> None:
        """Take further rows (rows, ...) of a variable."""
        if name not in self._columns:
            self._columns[name] = _Column(self._count, self._rows, values)
        self._columns[name].add(values)

    def of(self, variable: xarray.Variable, name: str) -> tuple[NDArray[Any], NDArray[Any]]:
        """Its rows and extremes, time first; they are read from the variable unless they have arrived."""
        if name not in self._columns:
            piece = 2 * _stride(self._count, self._rows)
            piece *= max(1, ROWS_AT_ONCE // piece)
            for first in range(0, self._count, piece):
                part = variable.isel(time=slice(first, min(first + piece, self._count)))
                self.add(name, part.transpose("time", ...).values)
        return self._columns[name].plain, self._columns[name].extremes


class _Column:
    """Those of one variable."""

    def __init__(self, count: int, rows: int, like: NDArray[Any]) -> None:
        self._last, self._stride, self._taken, self._rest = count - 1, _stride(count, rows), 0, like[:0]
        self.plain = np.empty((len(thinned_indices(count, rows)), *like.shape[1:]), like.dtype)
        self.extremes = np.empty_like(self.plain)

    def add(self, values: NDArray[Any]) -> None:
        """Take further rows; those after the last whole pair of strides wait."""
        values, pair = np.concatenate([self._rest, values]) if len(self._rest) else values, 2 * self._stride
        ends = self._taken + len(values) > self._last
        whole = len(values) if ends else len(values) - len(values) % pair
        part, self._rest, first = values[:whole], values[whole:].copy(), self._taken // self._stride
        self._taken += whole
        strided = part[:: self._stride]
        self.plain[first : first + len(strided)] = strided
        starts = np.arange(0, whole, pair)
        for k, (quick, sure) in enumerate(((np.minimum, np.fmin), (np.maximum, np.fmax))):
            room = self.extremes[first : first + len(strided)][k::2]
            found = quick.reduceat(part, starts) if whole else part
            room[...] = (sure.reduceat(part, starts) if np.isnan(found).any() else found)[: len(room)]
        if ends:
            self.plain[-1] = values[-1]
            self.extremes[[0, -1]] = self.plain[[0, -1]]


def _thinned(
    dataset: xarray.Dataset, rows: int, *, extremes: bool, known: Thinning | None = None
) -> tuple[xarray.Dataset, xarray.Dataset]:
    if "time" not in dataset.dims or "time" not in dataset.coords:
        raise ValueError("the dataset has no time coordinate: nothing to show along time")
    count = dataset.sizes["time"]
    thinned_indices(count, rows)  # refuses what can't be
    stride, thinning = _stride(count, rows), known or Thinning(count, rows)
    along = {str(n): v for n, v in dataset.data_vars.items() if "time" in v.dims and v.dtype.kind in "fiub"}
    wanted = dataset[[name for name, variable in along.items() if "residual_of" not in variable.attrs]]
    # A slice is a strided read in HDF5; a list of indices would be read index by index.
    ends = wanted.isel(time=slice(count - 1 if (count - 1) % stride else count, count))
    plain, shown = dict[Hashable, xarray.Variable](), dict[Hashable, xarray.Variable]()
    for name, variable in wanted.variables.items():
        plain[name] = variable
        if "time" in variable.dims:
            dims = ("time", *(dim for dim in variable.dims if dim != "time"))
            if extremes and stride > 1 and name in along and variable.dtype.kind == "f":
                both = thinning.of(variable, str(name))
            else:
                parts = (variable.isel(time=slice(None, None, stride)), ends.variables[name])
                both = (np.concatenate([part.transpose("time", ...).values for part in parts]),) * 2
            plain[name], shown[name] = (xarray.Variable(dims, found, variable.attrs) for found in both)
    coords = [name for name in plain if name not in along]
    whole = xarray.Dataset(plain, attrs=dataset.attrs).set_coords(coords)
    return whole, xarray.Dataset(plain | shown, attrs=dataset.attrs).set_coords(coords) if extremes else whole


def _stride(count: int, rows: int) -> int:
    return max(1, -(-(count - 1) // (rows - 1)))
