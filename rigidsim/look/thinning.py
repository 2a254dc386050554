"""A bounded number of rows from a dataset of any length: read afterwards, or kept while the run goes on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rigidsim.look.roles import is_residual

if TYPE_CHECKING:
    import xarray

ROWS_AT_ONCE = 1 << 21


def thinned_indices(count: int, rows: int) -> NDArray[np.int64]:
    """Indices (R,) into `count` rows, evenly strided, R <= `rows`, with the first and the last.

    Args:
        count: number of rows there are, >= 1.
        rows: number of rows wanted at most, >= 2.

    Raises:
        ValueError: `count` or `rows` out of range.
    """
    if count < 1:
        raise ValueError("the dataset has no samples: nothing to show")
    if rows < 2:
        raise ValueError(f"rows must be at least 2 (the first and the last), given {rows}")
    indices = np.arange(0, count, _stride(count, rows), dtype=np.int64)
    return indices if indices[-1] == count - 1 else np.append(indices, count - 1)


class KeptRows:
    """The rows of `thinned_indices` of a run, kept as they come, so that nothing has to be read for them.

    Args:
        count: number of rows of the whole run, >= 1.
        rows: number of rows wanted at most, >= 2.
    """

    def __init__(self, count: int, rows: int) -> None:
        self._count = count
        self._stride = _stride(count, rows)
        self._seen = 0
        self._pieces: dict[str, list[NDArray[np.float64]]] = {}

    def take(self, first: int, block: Mapping[str, NDArray[np.float64]]) -> None:
        """Take the rows from `first` on; nothing is kept of a run whose beginning wasn't seen.

        Args:
            block: (rows, ...) by variable, `time` among them.
        """
        if first != self._seen:
            self._pieces = {}
            return
        rows = len(block["time"])
        self._seen = first + rows
        picked = [slice(-first % self._stride, None, self._stride)]
        if self._seen == self._count and (self._count - 1) % self._stride:
            picked.append(slice(rows - 1, None))
        for name, values in block.items():
            self._pieces.setdefault(name, []).extend(values[part].copy() for part in picked)

    def columns(self, count: int) -> dict[str, NDArray[np.float64]] | None:
        """The kept rows of each variable; None if not every row was seen.

        Args:
            count: number of rows that there are now, fewer than there were to be in a run that was stopped.
        """
        if not self._pieces or not self._seen == self._count == count:
            return None
        return {name: np.concatenate(pieces) for name, pieces in self._pieces.items()}


def thin(
    dataset: xarray.Dataset, rows: int, at_once: int = ROWS_AT_ONCE, kept: KeptRows | None = None
) -> xarray.Dataset:
    """The rows of `thinned_indices`, in memory; residuals are left out.

    Only variables that have a time dimension, and of those only the rows asked for, are read:
    memory goes with `rows`, not with the length of the run.

    Args:
        at_once: rows of the file that one read spans.
        kept: rows kept while the run went on, which aren't read again.

    Raises:
        ValueError: no `time` dimension or coordinate, or see `thinned_indices`.
    """
    import xarray

    if "time" not in dataset.dims or "time" not in dataset.coords:
        raise ValueError("the dataset has no time coordinate: nothing to show along time")
    count = dataset.sizes["time"]
    indices = thinned_indices(count, rows)
    names: list[str] = [
        str(name)
        for name, variable in dataset.data_vars.items()
        if "time" in variable.dims and variable.dtype.kind in "fiub" and not is_residual(variable)
    ]
    wanted = dataset[names]
    known = None if kept is None else kept.columns(count)
    if known is not None and known.keys() >= {"time", *names}:
        fields = {
            name: (found.dims, known[str(name)].reshape(-1, *found.shape[1:]), found.attrs)
            for name, found in wanted.data_vars.items()
        }
        labels = {name: found for name, found in wanted.coords.items() if "time" not in found.dims}
        time = {"time": ("time", known["time"].reshape(-1), wanted["time"].attrs)}
        return xarray.Dataset(fields, labels | time, dataset.attrs)
    stride = _stride(count, rows)
    # A slice is a strided read in HDF5; a list of indices would be read index by index. Each read makes some
    # kilobytes of notes for every chunk that it touches, hence pieces.
    piece = stride * max(1, at_once // stride)
    slices = [slice(first, min(first + piece, count), stride) for first in range(0, count, piece)]
    if (count - 1) % stride:
        slices.append(slice(count - 1, count))
    parts = [wanted.isel(time=part).load() for part in slices]
    if len(parts) == 1:
        return parts[0]
    joined = xarray.concat(parts, dim="time", data_vars="all", combine_attrs="override")
    if joined.sizes["time"] != len(indices):  # concat must neither merge nor sort
        raise AssertionError("thinning lost rows")
    return joined.transpose("time", ...)


def _stride(count: int, rows: int) -> int:
    return max(1, -(-(count - 1) // (rows - 1)))
