"""Datasets and segments as netCDF-4 files, written with HDF5's own calls, for any reader of netCDF.

What makes an HDF5 file a netCDF-4 file is a handful of conventions: named dimensions are dimension scales
(HDF5 Dimension Scale specification), which refer to the variables along them and these to them;
``_Netcdf4Dimid`` and ``_Netcdf4Coordinates`` number them; objects keep the order of their creation;
``_NCProperties`` names the writer (NetCDF Users' Guide, appendix "File Format Specifications").
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5g, h5p, h5s, h5t

from rigidsim.errors import RunFolderError
from rigidsim.store.variables import BARE_DIMENSION, Extra, Variable, used_labels

CHUNK_ROWS = 8192
GZIP_LEVEL = 4  # with shuffle: every reader opens it (other filters fail in some)
Block = Mapping[str, Sequence[np.ndarray]]
"""Float64 parts by variable name, each of shape (rows, components)."""


Created = Mapping[str, h5d.DatasetID]
"""Variables in a file under construction, by the names of their parts."""
_LEAST_CHUNK_ROWS = 1024  # for variables along a dimension that can grow


@dataclass(frozen=True)
class _Type:
    """A type as numpy names it, as it is stored in files, and as HDF5 finds it in numpy's arrays."""

    numpy: np.dtype[Any]
    stored: Any
    held: Any

    @classmethod
    def of(cls, what: Any) -> _Type:
        dtype = np.dtype(what)
        return cls(dtype, h5t.py_create(dtype, logical=True), h5t.py_create(dtype))


_DOUBLE = _Type.of("<f8")
_INTEGER = _Type.of("<i8")
_ID = _Type.of("<i4")
_TEXT = _Type.of(h5py.string_dtype())
_IN_ORDER = h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED
_ONE_VALUE = h5s.create(h5s.SCALAR)


class NetcdfFile:
    """A netCDF-4 file under construction, in a new, empty HDF5 file; see ``writing``."""

    def __init__(self, file: h5py.File) -> None:
        self._root = file.id
        self._sizes: dict[str, int] = {}
        self._variables: dict[str, tuple[h5d.DatasetID, tuple[str, ...]]] = {}
        _attribute(self._root, "_NCProperties", _properties(), _Type.of(f"S{len(_properties())}"))

    def dimension(self, name: str, size: int) -> None:
        """Declare a dimension, possibly again; size 0 makes it unlimited, since netCDF has no empty ones."""
        self._sizes.setdefault(name, size)

    def has(self, name: str) -> bool:
        """Whether a variable of this name was created."""
        return name in self._variables

    def variable(
        self,
        name: str,
        dims: Sequence[str],
        attributes: Mapping[str, Any],
        *,
        chunk: Sequence[int] | None = None,
        gzip: int | None = None,
        whole: bool = False,
    ) -> h5d.DatasetID:
        """Create a variable of doubles, or of integers, along declared dimensions.

        Args:
            attributes: texts and numbers.
            chunk: shape of chunks; a single number for chunks of so many rows; None for contiguous storage.
            gzip: the level at which its chunks are compressed after a byte shuffle.

        Returns:
            The variable, for ``write_rows`` and ``write_box``.
        """
        shape = tuple(self._sizes[dim] for dim in dims)
        if chunk is None and 0 in shape:
            chunk = (_LEAST_CHUNK_ROWS,)
        if chunk is not None:
            chunk = (*chunk, *(max(1, size) for size in shape[len(chunk) :]))
        how = _new_dataset(None if chunk is None else tuple(chunk), gzip)
        return self._created(name, dims, _INTEGER if whole else _DOUBLE, attributes, how)

    def texts(self, name: str, dim: str, texts: Sequence[str], attributes: Mapping[str, Any]) -> None:
        """Write strings along a dimension, of which they may be the labels."""
        self.dimension(dim, len(texts))
        created = self._created(name, (dim,), _TEXT, attributes, _new_dataset())
        _write(created, np.array(texts, dtype=_TEXT.numpy), _TEXT)

    def attributes(self, attributes: Mapping[str, Any]) -> None:
        """Write attributes of the whole file: strings and numbers."""
        _attributes(self._root, attributes)

    def group(self, name: str, arrays: Mapping[str, np.ndarray]) -> None:
        """Write arrays of numbers as a group without labels; an empty group isn't written."""
        group = h5g.create(self._root, name.encode(), gcpl=_new_group())
        for key, values in arrays.items():
            if values.size:
                of = _INTEGER if values.dtype.kind == "i" else _DOUBLE
                space = h5s.create_simple(values.shape) if values.ndim else _ONE_VALUE
                _write(h5d.create(group, key.encode(), of.stored, space, dcpl=_new_dataset()), values, of)

    def _created(
        self, name: str, dims: Sequence[str], of: _Type, attributes: Mapping[str, Any], how: Any
    ) -> h5d.DatasetID:
        shape = tuple(self._sizes[dim] for dim in dims)
        most = tuple(size or h5s.UNLIMITED for size in shape)
        created = h5d.create(self._root, name.encode(), of.stored, h5s.create_simple(shape, most), dcpl=how)
        self._variables[name] = created, tuple(dims)
        numbers = np.array([list(self._sizes).index(dim) for dim in dims])
        _attribute(created, "_Netcdf4Dimid", numbers[0], _ID)
        _attribute(created, "_Netcdf4Coordinates", numbers, _ID)
        _attributes(created, attributes)
        return created

    def finish(self) -> None:
        """Connect variables and dimensions once all of them are there."""
        scales: dict[str, h5d.DatasetID] = {}
        for number, (dim, size) in enumerate(self._sizes.items()):
            own, dims = self._variables.get(dim, (None, ()))
            if own is not None and dims == (dim,):
                h5ds.set_scale(own, dim.encode())
                scales[dim] = own
            else:
                scales[dim] = self._bare(dim, size, number)
        for name, (created, dims) in self._variables.items():
            for axis, dim in enumerate(dims):
                if dims != (name,):
                    h5ds.attach_scale(created, scales[dim], axis)

    def _bare(self, dim: str, size: int, number: int) -> h5d.DatasetID:
        """Create the variable, never written, that stands in the file for a dimension without a
        coordinate.
        """
        how = _new_dataset(None if size else (_LEAST_CHUNK_ROWS,))
        space = h5s.create_simple((size,), (size or h5s.UNLIMITED,))
        scale = h5d.create(self._root, dim.encode(), h5t.IEEE_F32BE, space, dcpl=how)
        h5ds.set_scale(scale, f"{BARE_DIMENSION}{size:10}".encode())
        _attribute(scale, "_Netcdf4Dimid", np.array(number), _ID)
        return scale


@contextmanager
def writing(target: Any) -> Iterator[NetcdfFile]:
    """A new netCDF-4 file in a file object open for reading and writing; complete when the block ends."""
    with h5py.File(target, "w", track_order=True) as file:
        made = NetcdfFile(file)
        yield made
        made.finish()


def write_rows(variable: h5d.DatasetID, first: int, values: np.ndarray) -> None:
    """Write rows ``first ...`` of a variable; values are doubles, in any shape of that many numbers."""
    shape = variable.shape[1:]
    values = np.ascontiguousarray(values, "<f8").reshape(-1, *shape)
    there = variable.get_space()
    there.select_hyperslab((first, *(0 for _ in shape)), values.shape)
    variable.write(h5s.create_simple(values.shape), there, values, mtype=_DOUBLE.held)


def write_box(variable: h5d.DatasetID, first: Sequence[int], values: np.ndarray) -> None:
    """Write a box of a variable whose first corner is given."""
    of = _INTEGER if values.dtype.kind == "i" else _DOUBLE
    values = np.ascontiguousarray(values, of.numpy)
    there = variable.get_space()
    there.select_hyperslab(tuple(first), values.shape)
    variable.write(h5s.create_simple(values.shape), there, values, mtype=of.held)


def _write(created: h5d.DatasetID, values: np.ndarray, of: _Type) -> None:
    created.write(h5s.ALL, h5s.ALL, np.asarray(values, of.numpy, order="C"), mtype=of.held)


def _attributes(owner: Any, attributes: Mapping[str, Any]) -> None:
    """Write attributes: strings, and numbers as netCDF writes them, always as an array."""
    for name, value in attributes.items():
        if isinstance(value, str):
            _attribute(owner, name, value, _TEXT)
        else:
            numbers = np.atleast_1d(np.asarray(value))
            if numbers.dtype.kind not in "if":
                raise TypeError(f"attribute {name}: {value!r} is neither a text nor made of numbers")
            _attribute(owner, name, numbers, _INTEGER if numbers.dtype.kind == "i" else _DOUBLE)


def _attribute(owner: Any, name: str, value: Any, of: _Type) -> None:
    values = np.asarray(value, of.numpy)
    space = h5s.create_simple(values.shape) if values.ndim else _ONE_VALUE
    h5a.create(owner, name.encode(), of.stored, space).write(values, mtype=of.held)


@cache
def _new_dataset(chunk: tuple[int, ...] | None = None, gzip: int | None = None) -> Any:
    """Creation properties of a dataset that tracks the order of its attributes but no times."""
    how = h5p.create(h5p.DATASET_CREATE)
    how.set_attr_creation_order(_IN_ORDER)
    how.set_obj_track_times(False)
    if chunk is not None:
        how.set_chunk(chunk)
    if gzip is not None:
        how.set_shuffle()
        how.set_deflate(gzip)
    return how


@cache
def _new_group() -> Any:
    how = h5p.create(h5p.GROUP_CREATE)
    how.set_attr_creation_order(_IN_ORDER)
    how.set_link_creation_order(_IN_ORDER)
    return how


@cache
def _properties() -> bytes:
    """Description of the writer, for ``_NCProperties``."""
    return f"version=2,h5py={h5py.__version__},hdf5={h5py.version.hdf5_version}".encode()


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
