"""Lazy reading of datasets into xarray through h5py, faster than by a general reader.

xarray's own engine for these files, h5netcdf, looks every attribute of every variable up through the whole
file: to open twenty variables took 0.07 s of CPU, and takes 0.02 s here, most of it xarray's. Commands on
small finished runs did little else. The result is the same, which a test verifies.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import xarray
from xarray.backends import AbstractDataStore, BackendArray, CachingFileManager, StoreBackendEntrypoint
from xarray.backends.locks import HDF5_LOCK
from xarray.core import indexing

from rigidsim.store.variables import is_bare_dimension

# attributes that link a file's variables to each other, or serve only netCDF's library
_HIDDEN = frozenset(
    {
        "CLASS",
        "DIMENSION_LIST",
        "NAME",
        "REFERENCE_LIST",
        "_NCProperties",
        "_Netcdf4Coordinates",
        "_Netcdf4Dimid",
    }
)


class NetcdfBackend(StoreBackendEntrypoint):
    """Engine for ``xarray.open_dataset``: netCDF-4 files that rigidsim wrote."""

    description = "rigidsim's datasets"

    def open_dataset(self, filename_or_obj: Any, **options: Any) -> xarray.Dataset:
        """See ``xarray.open_dataset``."""
        store = _Store(Path(filename_or_obj))
        try:
            return super().open_dataset(store, **options)
        except BaseException:
            store.close()
            raise


class _Store(AbstractDataStore):
    """Variables and attributes of one file, which is reopened if xarray had to close it."""

    def __init__(self, path: Path) -> None:
        self._path = path.absolute()
        self.files = CachingFileManager(h5py.File, self._path, mode="r")

    def load(self) -> tuple[dict[str, xarray.Variable], dict[str, Any]]:
        """All variables, with their values unread, and the attributes of the file."""
        with self.files.acquire_context() as file:
            items = {name: item for name, item in file.items() if isinstance(item, h5py.Dataset)}
            dims = _dimensions(items)
            variables = {
                name: self._variable(name, item, dims[name])
                for name, item in items.items()
                if not is_bare_dimension(item)
            }
            return variables, _attributes(file)

    def get_encoding(self) -> dict[str, Any]:
        """Encoding with the unlimited dimensions: those of size 0, since netCDF has no empty ones."""
        with self.files.acquire_context() as file:
            growing = {
                name
                for name, item in file.items()
                if isinstance(item, h5py.Dataset) and item.is_scale and item.maxshape == (None,)
            }
        return {"unlimited_dims": growing}

    def _variable(self, name: str, item: h5py.Dataset, dims: tuple[str, ...]) -> xarray.Variable:
        text = h5py.check_string_dtype(item.dtype) is not None
        chunks = item.chunks
        encoding = {
            "dtype": str if text else item.dtype,
            "contiguous": chunks is None,
            "chunksizes": chunks,
            "shuffle": item.shuffle,
            "fletcher32": item.fletcher32,
            "zlib": item.compression == "gzip",
            "complevel": item.compression_opts or 0,
            "source": str(self._path),
            "original_shape": item.shape,
        }
        if chunks is not None:
            encoding["preferred_chunks"] = dict(zip(dims, chunks, strict=True))
        array = _Array(self.files, name, item.shape, _TEXT if text else item.dtype, text)
        return xarray.Variable(dims, indexing.LazilyIndexedArray(array), _attributes(item), encoding)

    def close(self) -> None:
        """Close the file."""
        self.files.close()


_TEXT = np.dtype("O", metadata={"element_type": str})  # as xarray marks texts of any length


class _Array(BackendArray):
    """Numbers or strings of one variable, read on access."""

    def __init__(
        self, files: CachingFileManager, name: str, shape: tuple[int, ...], dtype: np.dtype[Any], text: bool
    ) -> None:
        self.files, self.name, self.text = files, name, text
        self.shape, self.dtype = shape, dtype

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        support = indexing.IndexingSupport.OUTER_1VECTOR
        return indexing.explicit_indexing_adapter(key, self.shape, support, self._read)

    def _read(self, key: Any) -> Any:
        with HDF5_LOCK, self.files.acquire_context(needs_lock=False) as file:
            item = file[self.name]
            return (item.asstr() if self.text else item)[key]


def _dimensions(items: Mapping[str, h5py.Dataset]) -> dict[str, tuple[str, ...]]:
    """Dimension names of each variable.

    Raises:
        ValueError: a variable has a dimension without a name.
    """
    # scales are identified by their addresses in the file, since looking up a reference's name takes longer
    places = {h5py.h5o.get_info(item.id).addr: name for name, item in items.items()}
    found: dict[str, tuple[str, ...]] = {}
    for name, item in items.items():
        if item.attrs.get("CLASS") == b"DIMENSION_SCALE":
            found[name] = (name,)
            continue
        lists = item.attrs.get("DIMENSION_LIST", ())
        if len(lists) != item.ndim or any(len(scales) != 1 for scales in lists):
            raise ValueError(f"the variable {name!a} has dimensions without names")
        found[name] = tuple(
            places[h5py.h5o.get_info(h5py.h5r.dereference(scales[0], item.id)).addr] for scales in lists
        )
    return found


def _attributes(owner: Any) -> dict[str, Any]:
    """Attributes: strings and numbers; an array of one number becomes that number."""
    found: dict[str, Any] = {}
    for name, value in owner.attrs.items():
        if name in _HIDDEN:
            continue
        if isinstance(value, bytes):
            value = value.decode("utf-8", "surrogateescape")
        elif isinstance(value, np.ndarray):
            value = value.tolist() if value.dtype.kind in "OS" else value
            value = value[0] if len(value) == 1 else value
        found[name] = value
    return found
