"""Reading a dataset without xarray, which takes longer to import than a run's picture takes to draw."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py

from rigidsim.errors import RunFolderError
from rigidsim.look.rows import Column, Rows
from rigidsim.store.validated_open import inspect
from rigidsim.store.variables import is_bare_dimension

# bookkeeping of HDF5 and netCDF-4 among a variable's attributes
_OF_THE_FORMAT = {
    "CLASS",
    "NAME",
    "DIMENSION_LIST",
    "REFERENCE_LIST",
    "DIMENSION_LABELS",
    "_FillValue",
    "_NCProperties",
    "_Netcdf4Coordinates",
    "_Netcdf4Dimid",
    "_nc3_strict",
    "coordinates",
}


@contextmanager
def recorded_rows(path: Path) -> Iterator[Rows]:
    """A complete dataset, whose numbers are read on request; dates stay numbers.

    Raises:
        RunFolderError: as for ``validated_open.open_dataset``.
    """
    try:
        inspect(path)
        file = h5py.File(path, "r")
    except (OSError, KeyError, RuntimeError, ValueError) as error:
        raise RunFolderError(f"{path}: can't be read ({error})") from None
    with file:
        yield _rows(file)


def _rows(file: h5py.File) -> Rows:
    items = {name: item for name, item in file.items() if isinstance(item, h5py.Dataset)}
    dims = {name: _dims(item) for name, item in items.items()}
    of_time = _told(file.attrs.get("coordinates"))
    for item in items.values():
        of_time |= _told(item.attrs.get("coordinates"))
    labels = {
        name: Column(
            name, dims[name], _attributes(item), _Text(item) if item.dtype.kind in "OS" else item, {}
        )
        for name, item in items.items()
        if (name in of_time or dims[name] == (name,)) and not is_bare_dimension(item)
    }
    columns = {
        name: Column(
            name, dims[name], _attributes(item), item, {d: labels[d] for d in dims[name] if d in labels}
        )
        for name, item in items.items()
        if name not in labels and not is_bare_dimension(item)
    }
    return Rows(_attributes(file), columns, labels)


def _labels(item: h5py.Dataset) -> Any:
    return _Text(item) if item.dtype.kind in "OS" else item


class _Text:
    """Labels stored as arrays of characters."""

    def __init__(self, item: h5py.Dataset) -> None:
        self._item = item
        self.shape, self.dtype = item.shape, item.dtype

    def __getitem__(self, key: Any) -> Any:
        return self._item.asstr()[key]


def _dims(item: h5py.Dataset) -> tuple[str, ...]:
    """Names of the dimensions, from the scales that are attached to them."""
    if item.attrs.get("CLASS", b"") == b"DIMENSION_SCALE" and item.ndim == 1:
        return (_name(item),)
    return tuple(_name(dim[0]) for dim in item.dims)


def _name(item: h5py.Dataset) -> str:
    return str(item.name).rpartition("/")[2]


def _told(names: Any) -> set[str]:
    return set(str(names).split()) if names is not None else set()


def _attributes(item: Any) -> Mapping[str, Any]:
    return {name: _plain(value) for name, value in item.attrs.items() if name not in _OF_THE_FORMAT}


def _plain(value: Any) -> Any:
    """A value as a scalar if netCDF stored it as an array of one number."""
    return value[0] if getattr(value, "shape", ()) == (1,) else value
