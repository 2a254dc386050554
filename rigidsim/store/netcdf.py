"""Datasets and segments as netCDF-4 files, for any reader of netCDF.

HDF5 compresses with zlib, which is most of the time of writing a dense run. ISA-L (through python-isal) gives
the same format in a tenth of it, so that whole chunks are compressed here; without it, zlib is used. Bytes
that can't be compressed, as the last of most mantissas, are stored as they are: reading takes half the time.
"""

import math
import struct
import sys
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np

from rigidsim.errors import RunFolderError
from rigidsim.store.variables import SCHEMA_VERSION, Extra, Variable, used_labels

_packer: Any
try:
    from isal import isal_zlib as _packer

    _LEVEL = 1  # levels 2 and 3 take 1.2 and 2.2 times as long for 0.02 and 0.2 % less
except ImportError:
    _packer, _LEVEL = zlib, 4

CHUNK_ROWS = 8192
GZIP_LEVEL = 4  # with shuffle: every reader opens it (other filters fail in some)
_ROWS = "rows"
_RAW = -15  # bits of the window, of a deflated stream without head and checksum
_STORED = 0.97  # share of its size that bytes keep if they aren't worth compressing
_SURVEY = 16  # chunks between which it is found out anew which bytes are
Block = Mapping[str, Sequence[np.ndarray]]
"""Float64 parts by variable name, each of shape (rows, components)."""


Watch = Callable[[np.ndarray], None]


class NetcdfFile:
    """A netCDF-4 file under construction, in a new, empty HDF5 file; see ``writing``."""

    def __init__(self, file: h5py.File, labelled: h5netcdf.File) -> None:
        self._file, self._labelled = file, labelled

    def dimension(self, name: str, size: int) -> None:
        """Declare a dimension, possibly again; size 0 makes it unlimited, since netCDF has no empty ones."""
        if name not in self._labelled.dimensions:
            self._labelled.dimensions[name] = size

    def variable(
        self,
        name: str,
        dims: Sequence[str],
        attributes: Mapping[str, Any],
        *,
        chunk: Sequence[int] | None = None,
        gzip: int | None = None,
        whole: bool = False,
    ) -> h5py.Dataset:
        """Create a variable of doubles, or of integers, along declared dimensions; ``chunk`` may be just the
        number of rows; chunks are compressed at the level ``gzip`` after a byte shuffle.
        """
        if chunk is not None:
            sizes = [self._labelled.dimensions[dim].size for dim in dims]
            chunk = (*chunk, *(max(1, size) for size in sizes[len(chunk) :]))
        filters = {} if gzip is None else {"compression": "gzip", "compression_opts": gzip, "shuffle": True}
        return self._created(name, dims, "<i8" if whole else "<f8", attributes, chunks=chunk, **filters)

    def texts(
        self, name: str, texts: Sequence[str], dim: str = "", attributes: Mapping[str, Any] | None = None
    ) -> None:
        """Write strings, unless they are there, along a dimension: by default the one that they label."""
        if name not in self._labelled.variables:
            self.dimension(dim or name, len(texts))
            kind, about = h5py.string_dtype(), label_attributes(name) if attributes is None else attributes
            self._created(name, (dim or name,), kind, about)[...] = np.array(texts, dtype=kind)

    def _created(
        self, name: str, dims: Sequence[str], dtype: Any, attributes: Mapping[str, Any], **how: Any
    ) -> h5py.Dataset:
        self._labelled.create_variable(name, tuple(dims), dtype, **how)
        created = self._file[name]
        _attributes(created, attributes)
        return created

    def attributes(self, attributes: Mapping[str, Any]) -> None:
        """Write attributes of the whole file: strings and numbers."""
        _attributes(self._file, attributes)

    def group(self, name: str, arrays: Mapping[str, np.ndarray]) -> None:
        """Write arrays of numbers as a group without labels; those without elements aren't written."""
        group = self._file.create_group(name, track_order=True)
        for key, values in arrays.items():
            if values.size:
                stored = np.asarray(values, "<i8" if values.dtype.kind == "i" else "<f8")
                group.create_dataset(key, data=stored, track_order=True)


def label_attributes(dim: str) -> dict[str, str]:
    """Attributes of the variable of a dimension's labels."""
    return {"long_name": dim.replace("_", " ")}


@contextmanager
def writing(target: Any) -> Iterator[NetcdfFile]:
    """A new netCDF-4 file in a file object open for reading and writing; complete when the block ends."""
    with h5py.File(target, "w", track_order=True) as file, h5netcdf.File(file, "w") as labelled:
        yield NetcdfFile(file, labelled)


def _attributes(owner: Any, attributes: Mapping[str, Any]) -> None:
    for name, value in attributes.items():
        owner.attrs[name] = attribute(name, value)


def attribute(name: str, value: Any) -> str | np.ndarray:
    """An attribute as it is written: a string, or numbers as netCDF writes them, always as an array."""
    if isinstance(value, str):
        return value
    numbers = np.atleast_1d(np.asarray(value))
    if numbers.dtype.kind not in "if":
        raise TypeError(f"attribute {name}: {value!r} is neither a text nor made of numbers")
    return numbers.astype("<i8" if numbers.dtype.kind == "i" else "<f8")


class ChunkedVariable:
    """Fills a compressed variable with rows as they arrive, a whole chunk at once, which `watch` sees."""

    def __init__(self, variable: h5py.Dataset, watch: Watch | None = None) -> None:
        self._variable, self._watch = variable, watch
        self._chunk = np.zeros(variable.chunks)
        self._filled = self._written = self._stored = 0

    def add(self, values: np.ndarray) -> None:
        """Take rows: doubles in any shape of that many numbers."""
        values = np.reshape(values, (-1, *self._chunk.shape[1:]))
        while len(values):
            taken = values[: len(self._chunk) - self._filled]
            self._chunk[self._filled : self._filled + len(taken)] = taken
            self._filled, values = self._filled + len(taken), values[len(taken) :]
            if self._filled == len(self._chunk):
                self.finish()

    def add_zeros(self, count: int) -> None:
        """Append rows of zeros."""
        self.add(np.zeros((count, *self._chunk.shape[1:])))

    def finish(self) -> None:
        """Write the rows that wait, as a chunk: all first bytes, all second bytes, ..., deflated."""
        if not self._filled:
            return
        if self._watch is not None:
            self._watch(self._chunk[: self._filled])
        self._chunk[self._filled :] = 0.0  # it has full size in the file however few rows there are
        octets = np.ascontiguousarray(self._chunk.view(np.uint8).reshape(-1, 8).T)
        if self._written % (_SURVEY * len(self._chunk)) == 0:
            self._stored = _incompressible(octets)
        place = (self._written, *(0 for _ in self._chunk.shape[1:]))
        self._variable.id.write_direct_chunk(place, _deflated(octets, self._stored))
        self._written, self._filled = self._written + len(self._chunk), 0


def _incompressible(octets: np.ndarray) -> int:
    """How many of these rows of bytes, from the first on, hardly become smaller."""
    rows = enumerate(octets)
    return next((k for k, row in rows if len(_packer.compress(row, _LEVEL)) < _STORED * row.size), 8)


def _deflated(octets: np.ndarray, stored: int) -> bytes:
    """Rows of bytes as one zlib stream (RFC 1950, 1951), the first so many of them without compression."""
    plain, most = octets[:stored].tobytes(), 0xFFFF
    pieces = [plain[first : first + most] for first in range(0, len(plain), most)]
    blocks = [struct.pack("<BHH", 0, len(piece), most - len(piece)) + piece for piece in pieces]
    rest, check = _packer.compress(octets[stored:], _LEVEL, _RAW), _packer.adler32(octets)
    return b"".join([b"\x78\x01", *blocks, rest, check.to_bytes(4, "big")])


def stored_rows(item: h5py.Dataset, rows: slice) -> np.ndarray:
    """Rows of a variable; chunks as ``ChunkedVariable`` writes them are unpacked in half of HDF5's time."""
    filters = (item.compression, item.shuffle, item.fletcher32, item.scaleoffset)
    known = sys.byteorder == "little" and item.dtype == "<f8" and filters == ("gzip", True, False, None)
    if not known or item.chunks[1:] != item.shape[1:]:
        return np.asarray(item[rows])
    height, width, picked = item.chunks[0], math.prod(item.shape[1:]), range(len(item))[rows]
    size, done = 8 * height * width, 0
    found = np.empty((len(picked), *item.shape[1:]))
    octets = found.view(np.uint8).reshape(len(picked), width, 8)
    while done < len(picked):
        chunk, first = divmod(picked[done], height)
        mask, packed = item.id.read_direct_chunk((chunk * height, *(0 for _ in item.shape[1:])))
        if mask:  # of filters that other writers left out
            return np.asarray(item[rows])
        try:
            plain = _packer.decompressobj().decompress(packed, size)
        except (_packer.error, zlib.error) as error:
            raise OSError(f"a chunk can't be unpacked: {error}") from None
        planes = np.frombuffer(plain, np.uint8).reshape(8, height, width)[:, first :: picked.step]
        part = octets[done : done + planes.shape[1]]
        for k, plane in enumerate(planes):
            part[:, :, k] = plane[: len(part)]
        done += len(part)
    return found


def joined_parts(blocks: Sequence[Block], variable: Variable) -> list[np.ndarray]:
    """Parts of a variable along all blocks, each of shape (rows, *variable.shape), row by row as in a file;
    blocks are stored column by column.
    """
    ends = list(accumulate((len(block["time"][0]) for block in blocks), initial=0))
    found = [np.empty((ends[-1], *variable.shape)) for _ in range(variable.parts)]
    for block, (first, stop) in zip(blocks, pairwise(ends), strict=True):
        for part, values in zip(found, block[variable.name], strict=True):
            part[first:stop] = values.reshape(stop - first, *variable.shape)
    return found


def declare(
    file: NetcdfFile,
    variables: Sequence[Variable],
    rows: int,
    attributes: Mapping[str, Any],
    *,
    compressed: bool,
) -> dict[str, h5py.Dataset]:
    """Create dimensions, coordinates, attributes, and the variables returned, by the names of their parts."""
    file.attributes(attributes)
    file.dimension("time", rows)
    for dim, labels in used_labels(variables).items():
        file.texts(dim, labels)
    chunk, gzip = ((min(CHUNK_ROWS, rows),), GZIP_LEVEL) if compressed and rows else (None, None)
    return {
        name: file.variable(
            name, ("time", *variable.dims), variable.part_attributes(part), chunk=chunk, gzip=gzip
        )
        for variable in variables
        for part, name in enumerate(variable.part_names())
    }


def write_blocks(
    file: NetcdfFile,
    variables: Sequence[Variable],
    blocks: Sequence[Block],
    attributes: Mapping[str, Any],
    *,
    labelled: bool,
) -> None:
    """Write all blocks, which may be none, without compression: as labelled variables, each of which takes
    8 ms to declare, or as plain arrays of a group.
    """
    rows = sum(len(block["time"][0]) for block in blocks)
    values = {
        name: part
        for variable in (variables if rows else ())
        for name, part in zip(variable.part_names(), joined_parts(blocks, variable), strict=True)
    }
    if labelled:
        created = declare(file, variables, rows, attributes, compressed=False)
        for name, part in values.items():
            created[name][...] = part
    else:
        file.attributes(attributes)
        file.group(_ROWS, values)


def rows_in(file: h5py.File) -> h5py.Group:
    """Where a dataset or segment has its arrays along time; empty in a segment without rows."""
    return file.get(_ROWS, file)


def add_extras(file: NetcdfFile, extras: Sequence[Extra]) -> None:
    """Write variables with separate dimensions."""
    for extra in extras:
        for dim, size in zip(extra.dims, extra.values.shape, strict=True):
            file.dimension(dim, size)
        file.variable(extra.name, extra.dims, extra.attributes)[...] = extra.values


@contextmanager
def reading(path: Path) -> Iterator[Any]:
    """An HDF5 file open for reading."""
    try:
        with h5py.File(path, "r") as file:
            yield file
    except (OSError, KeyError, RuntimeError, TypeError, ValueError) as error:
        raise RunFolderError(f"{path}: can't be read ({error})") from None


def check_version(version: Any, path: Path) -> None:
    """Refuse all schema versions but this one, with what to do."""
    if not isinstance(version, int) or isinstance(version, bool):
        raise RunFolderError(f"{path}: names no schema version; it is no dataset of rigidsim")
    if version != SCHEMA_VERSION:
        remedy = "update rigidsim" if version > SCHEMA_VERSION else "run its config again, which it holds"
        raise RunFolderError(
            f"{path}: has schema version {version}, and this rigidsim reads {SCHEMA_VERSION}; {remedy}"
        )


def root_attributes(path: Path) -> dict[str, Any]:
    """Root attributes of a dataset or segment as Python values, and its ``rows``."""
    with reading(path) as file:
        found = {
            str(key): value.item()
            if isinstance(value, np.generic | np.ndarray) and value.size == 1
            else value
            for key, value in file.attrs.items()
            if not key.startswith("_")
        }
        rows = rows_in(file)
        return {**found, "rows": len(rows["time"]) if "time" in rows else 0}


def read_group(path: Path, name: str) -> dict[str, np.ndarray]:
    """The plain arrays of a group; empty if there is no such group."""
    with reading(path) as file:
        if not isinstance(file.get(name), h5py.Group):
            return {}
        arrays = {key: np.asarray(data[()]) for key, data in file[name].items()}
    if any(values.dtype.kind not in "if" for values in arrays.values()):
        raise RunFolderError(f"{path}: its {name} holds something else than numbers")
    return arrays
