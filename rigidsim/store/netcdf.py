"""Datasets and segments as netCDF-4 files, which xarray, netCDF4, h5py and ncdump all read."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import h5py
import numpy as np
from h5py import h5d, h5ds

from rigidsim.errors import RunFolderError
from rigidsim.store.netcdf_file import NetcdfFile, write_rows, writing
from rigidsim.store.variables import Extra, Variable, used_labels

CHUNK_ROWS = 8192
GZIP_LEVEL = 4  # with shuffle: every reader opens it (other filters fail in some)
Block = Mapping[str, Sequence[np.ndarray]]
"""Float64 parts by variable name, each of shape (rows, components)."""


Created = Mapping[str, h5d.DatasetID]
"""Variables in a file under construction, by the names of their parts."""


def declare(
    file: NetcdfFile,
    variables: Sequence[Variable],
    rows: int,
    attributes: Mapping[str, Any],
    *,
    compressed: bool,
) -> Created:
    """Create dimensions, coordinates, variables and attributes."""
    file.attributes(attributes)
    file.dimension("time", rows)
    for dim, labels in used_labels(variables).items():
        file.texts(dim, dim, labels, {"long_name": dim.replace("_", " ")})
    chunk, gzip = ((min(CHUNK_ROWS, rows),), GZIP_LEVEL) if compressed and rows else (None, None)
    return {
        name: file.variable(
            name, ("time", *variable.dims), variable.part_attributes(part), chunk=chunk, gzip=gzip
        )
        for variable in variables
        for part, name in enumerate(variable.part_names())
    }


def add_extras(file: NetcdfFile, extras: Sequence[Extra]) -> None:
    """Write variables with dimensions of their own."""
    for extra in extras:
        for dim, size in zip(extra.dims, extra.values.shape, strict=True):
            file.dimension(dim, size)
        write_rows(file.variable(extra.name, extra.dims, extra.attributes), 0, extra.values)


class FileRows(Protocol):
    """Values of all variables of a file."""

    rows: int

    @property
    def compressed(self) -> bool:
        """Whether the rows are written as compressed chunks."""

    def write(self, created: Created) -> None:
        """Write the rows."""


def image(
    variables: Sequence[Variable],
    rows: FileRows | None,
    attributes: Mapping[str, Any],
    groups: Mapping[str, Mapping[str, np.ndarray]],
) -> io.BytesIO:
    """A whole file built in memory; ``groups`` hold plain arrays besides the variables."""
    buffer = io.BytesIO()
    with writing(buffer) as file:
        count, compressed = (0, False) if rows is None else (rows.rows, rows.compressed)
        created = declare(file, variables, count, attributes, compressed=compressed)
        if rows is not None and count:
            rows.write(created)
        for name, arrays in groups.items():
            file.group(name, arrays)
    return buffer


@contextmanager
def reading(path: Path) -> Iterator[Any]:
    """An HDF5 file open for reading."""
    try:
        with h5py.File(path, "r") as file:
            yield file
    except (OSError, KeyError, RuntimeError, ValueError) as error:
        raise RunFolderError(f"{path}: can't be read ({error})") from None


def root_attributes(path: Path) -> dict[str, Any]:
    """Root attributes of a dataset or segment as Python values, and its ``rows``."""
    try:
        with h5py.File(path, "r") as file:
            found = {
                str(key): value.item()
                if isinstance(value, np.generic | np.ndarray) and value.size == 1
                else value
                for key, value in file.attrs.items()
                if not key.startswith("_")
            }
            return {**found, "rows": int(file["time"].shape[0])}
    except (OSError, KeyError, AttributeError, IndexError, RuntimeError, ValueError) as error:
        raise RunFolderError(f"{path}: can't be read as a dataset of rigidsim ({error})") from None


def read_group(path: Path, name: str) -> dict[str, np.ndarray]:
    """The plain arrays of a group; empty if there is no such group."""
    with reading(path) as file:
        if not isinstance(file.get(name), h5py.Group):
            return {}
        arrays = {key: np.asarray(data[()]) for key, data in file[name].items() if _is_data(key, data)}
    if any(values.dtype.kind not in "if" for values in arrays.values()):
        raise RunFolderError(f"{path}: its {name} holds something else than numbers")
    return arrays


def _is_data(name: str, item: Any) -> bool:
    """Whether an item is an array; older files also hold dimension scales of each array."""
    dimension = name[-2:-1] == "_" and name[-1:].isdigit()
    return isinstance(item, h5py.Dataset) and not (dimension and h5ds.is_scale(item.id))
