"""Zarr (format 2, which every reader knows): the dataset unchanged, including residuals and labels."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import xarray

from rigidsim.formats.digits import RADIAN, converted
from rigidsim.formats.registry import Format, TableSource
from rigidsim.formats.tables import Table
from rigidsim.scene.parts_of_values import parts_in
from rigidsim.scene.readable import AngleUnit
from rigidsim.store.netcdf import CHUNK_ROWS
from rigidsim.store.sweeps.tiles import chunk_shape

BLOCK_ROWS = 8 * CHUNK_ROWS
_SLAB_BLOCKS = 8  # 128 MB at once: each is an append


def write_zarr(table: Table, path: Path, source: TableSource) -> None:
    """Write a table's whole dataset as a store, a new folder, block by block along time or a sweep's first
    axis.
    """
    dataset = table.dataset
    attributes = {str(key): _json(value) for key, value in source.attributes.items()}
    members = table.members
    dim = members[0] if members else table.dim
    rows = _slab(table) if members else BLOCK_ROWS
    along = dataset[[name for name in dataset.variables if dim in dataset[name].dims]]
    for first in range(0, max(dataset.sizes[dim], 1), rows):
        block = _plain(along.isel({dim: slice(first, first + rows)}), source)
        if first:
            block = block.drop_vars([name for name in block.variables if dim not in block[name].dims])
            block.to_zarr(path, mode="a", append_dim=dim, zarr_format=2, consolidated=False)
        else:
            block.attrs = attributes
            chunks = {name: {"chunks": _chunks(dataset[name], members)} for name in block.variables
                      if dim in block[name].dims}  # fmt: skip
            block.to_zarr(path, mode="w", encoding=chunks, zarr_format=2, consolidated=False)
    rest = [name for name in dataset.variables if dim not in dataset[name].dims]
    last = _plain(dataset[rest], source)
    last.attrs = attributes
    if members:  # no variable that is written beside a vector's components tells that they are a coordinate
        last = last.reset_coords()
        beside = [str(name) for name in dataset.coords if name not in dataset.dims]
        last.attrs = attributes | ({"coordinates": " ".join(beside)} if beside else {})
    last.to_zarr(path, mode="a", zarr_format=2, consolidated=True)


def _plain(dataset: xarray.Dataset, source: TableSource) -> xarray.Dataset:
    """The dataset in memory, with angles in the requested unit, without the HDF5 file's own encodings."""
    loaded = dataset.load().copy()
    if source.angle_unit is not None:
        loaded = _converted(loaded, source.angle_unit, source.bits)
    for name in loaded.variables:
        kept = ("units", "calendar", "dtype") if loaded[name].dtype.kind == "M" else ()
        loaded[name].encoding = {key: loaded[name].encoding[key] for key in kept}
        loaded[name].attrs = {key: _json(value) for key, value in loaded[name].attrs.items()}
    loaded.encoding = {}
    return loaded


def _converted(dataset: xarray.Dataset, unit: AngleUnit, bits: int) -> xarray.Dataset:
    """The dataset with all angles, and their residuals, in a unit."""
    changed = {}
    for name in map(str, dataset.variables):
        variable = dataset[name]
        if variable.attrs.get("units") != RADIAN or "residual_of" in variable.attrs:
            continue
        names = parts_in(dataset, name)
        values = converted([dataset[part].values for part in names], unit, bits)
        for part, found in zip(names, values, strict=True):
            changed[part] = (dataset[part].dims, found, dict(dataset[part].attrs, units=unit.name))
    return dataset.assign(changed)


def _chunks(variable: xarray.DataArray, members: Sequence[str]) -> tuple[int, ...]:
    """Chunk shape: rows along time; for a sweep, members as in its dataset."""
    if not members:
        return (CHUNK_ROWS, *variable.shape[1:])
    of_members = len([dim for dim in variable.dims if dim in members])
    return chunk_shape(variable.shape[:of_members], variable.shape[of_members:])


def _slab(table: Table) -> int:
    """Values of the first axis whose members are held in memory at once."""
    dataset, first = table.dataset, table.members[0]
    numbers = sum(found.size for found in dataset.variables.values() if first in found.dims)
    return max(1, _SLAB_BLOCKS * table.block_numbers * dataset.sizes[first] // max(numbers, 1))


def _json(value: Any) -> Any:
    return value.item() if hasattr(value, "item") and getattr(value, "ndim", 1) == 0 else value


FORMAT = Format(write_zarr, angles=True, names=(), folder=("Zarr store", ".zgroup"))
