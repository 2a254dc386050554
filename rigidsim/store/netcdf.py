"""Writing netCDF-4 files that xarray, netCDF4, h5py and ncdump all read."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np

from rigidsim.errors import RunFolderError
from rigidsim.store.variables import LABELS, Extra, Variable

CHUNK_ROWS = 8192
GZIP_LEVEL = 4  # with shuffle: every reader opens it (other filters fail in some)
Block = Mapping[str, Sequence[np.ndarray]]
"""Variable name to float64 parts, each of shape (rows, components)."""


def declare(
    file: Any,
    variables: Sequence[Variable],
    rows: int,
    attributes: Mapping[str, Any],
    *,
    compressed: bool,
) -> None:
    """Lay out dimensions, coordinates, variables and attributes in an open h5netcdf file."""
    dims = {dim for variable in variables for dim in variable.dims}
    file.dimensions = {"time": rows, **{d: len(LABELS[d]) for d in LABELS if d in dims}}
    for dim in LABELS:
        if dim in dims:
            labels = file.create_variable(dim, (dim,), h5py.string_dtype())
            labels[...] = np.array(LABELS[dim], dtype=object)
            labels.attrs["long_name"] = dim.replace("_", " ")
    for variable in variables:
        options: dict[str, Any] = {}
        if rows:
            options["chunks"] = (min(CHUNK_ROWS, rows), *variable.shape) if compressed else None
            if compressed:
                options |= {"compression": "gzip", "compression_opts": GZIP_LEVEL, "shuffle": True}
        for part, name in enumerate(variable.part_names()):
            created = file.create_variable(name, ("time", *variable.dims), np.dtype("<f8"), **options)
            for key, value in variable.part_attributes(part).items():
                created.attrs[key] = value
    for key, value in attributes.items():
        file.attrs[key] = value


def add_extras(file: Any, extras: Sequence[Extra]) -> None:
    """Write variables with dimensions of their own."""
    for extra in extras:
        for dim, size in zip(extra.dims, extra.values.shape, strict=True):
            if dim not in file.dimensions:
                file.dimensions[dim] = size
        created = file.create_variable(extra.name, extra.dims, np.dtype("<f8"))
        created[...] = extra.values
        for key, value in extra.attributes.items():
            created.attrs[key] = value


def fill(file: Any, variables: Sequence[Variable], block: Block, first: int, rows: int) -> None:
    """Write one block of rows."""
    for variable in variables:
        for name, values in zip(variable.part_names(), block[variable.name], strict=True):
            file.variables[name][first : first + rows] = values.reshape(rows, *variable.shape)


def image(
    variables: Sequence[Variable],
    block: Block,
    rows: int,
    attributes: Mapping[str, Any],
    groups: Mapping[str, Mapping[str, np.ndarray]],
) -> io.BytesIO:
    """A whole uncompressed file built in memory; ``groups`` hold plain arrays beside the variables."""
    buffer = io.BytesIO()
    with h5netcdf.File(buffer, "w") as file:
        declare(file, variables, rows, attributes, compressed=False)
        if rows:
            fill(file, variables, block, 0, rows)
        for name, arrays in groups.items():
            _add_group(file.create_group(name), arrays)
    return buffer


def _add_group(group: Any, arrays: Mapping[str, np.ndarray]) -> None:
    for name, values in arrays.items():
        if not values.size:  # an array that isn't there reads as empty
            continue
        dims = tuple(f"{name}_{axis}" for axis in range(values.ndim))
        for dim, size in zip(dims, values.shape, strict=True):
            group.dimensions[dim] = size
        created = group.create_variable(name, dims, np.dtype("<i8" if values.dtype.kind == "i" else "<f8"))
        created[...] = values


@contextmanager
def reading(path: Path) -> Iterator[Any]:
    """An HDF5 file open for reading.

    Raises:
        RunFolderError: it is none, or damaged.
    """
    try:
        with h5py.File(path, "r") as file:
            yield file
    except (OSError, KeyError, RuntimeError, ValueError) as error:
        raise RunFolderError(f"{path}: can't be read ({error})") from None


def read_group(path: Path, name: str) -> dict[str, np.ndarray]:
    """The plain arrays of a group; none where there is no such group.

    Raises:
        RunFolderError: it holds something else than numbers.
    """
    with reading(path) as file:
        if not isinstance(file.get(name), h5py.Group):
            return {}
        arrays = {key: np.asarray(data[()]) for key, data in file[name].items() if _is_data(key, data)}
    if any(values.dtype.kind not in "if" for values in arrays.values()):
        raise RunFolderError(f"{path}: its {name} holds something else than numbers")
    return arrays


def _is_data(name: str, item: Any) -> bool:
    dimension = name[-2:-1] == "_" and name[-1:].isdigit()  # netCDF's scales, see _add_group
    return isinstance(item, h5py.Dataset) and not dimension
