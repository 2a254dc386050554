"""Zarr (format 2, which every reader knows): the dataset as it is, residuals and labels included."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import xarray

from rigidsim.formats.registry import Format, Source
from rigidsim.formats.tables import Table
from rigidsim.store.netcdf import CHUNK_ROWS

BLOCK_ROWS = 8 * CHUNK_ROWS


def write_zarr(table: Table, path: Path, source: Source) -> None:
    """Write a store, a folder that doesn't exist yet, block by block along time.

    Args:
        table: along time; its whole dataset is written.
        path: the folder.
        source: the run, for the attributes of the store.
    """
    dataset = table.dataset
    along = dataset[[name for name in dataset.variables if "time" in dataset[name].dims]]
    for first in range(0, max(dataset.sizes["time"], 1), BLOCK_ROWS):
        block = _plain(along.isel(time=slice(first, first + BLOCK_ROWS)))
        if first:
            block = block.drop_vars([name for name in block.variables if "time" not in block[name].dims])
            block.to_zarr(path, mode="a", append_dim="time", zarr_format=2, consolidated=False)
        else:
            block.attrs = {str(key): _json(value) for key, value in source.attributes.items()}
            chunks = {name: {"chunks": _chunks(block[name])} for name in block.variables
                      if "time" in block[name].dims}  # fmt: skip
            block.to_zarr(path, mode="w", encoding=chunks, zarr_format=2, consolidated=False)
    rest = [name for name in dataset.variables if "time" not in dataset[name].dims]
    _plain(dataset[rest]).to_zarr(path, mode="a", zarr_format=2, consolidated=True)


def _plain(dataset: xarray.Dataset) -> xarray.Dataset:
    """In memory, without the HDF5 file's own encodings."""
    loaded = dataset.load().copy()
    for name in loaded.variables:
        kept = ("units", "calendar", "dtype") if loaded[name].dtype.kind == "M" else ()
        loaded[name].encoding = {key: loaded[name].encoding[key] for key in kept}
        loaded[name].attrs = {key: _json(value) for key, value in loaded[name].attrs.items()}
    loaded.encoding = {}
    return loaded


def _chunks(variable: xarray.DataArray) -> tuple[int, ...]:
    return (CHUNK_ROWS, *variable.shape[1:])


def _json(value: Any) -> Any:
    return value.item() if hasattr(value, "item") and getattr(value, "ndim", 1) == 0 else value


FORMAT = Format(write_zarr, package="zarr", folder=("Zarr store", ".zgroup"))
