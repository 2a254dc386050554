"""The one reader of datasets: a run's, a sweep's, or what the segments of an unfinished run hold, lazily.

Files are opened with distrust. One may be torn, foreign, from another version, or made to hurt: declare rows
that it doesn't hold (a few kilobytes that unpack to terabytes of zeros), or point to other files, whose
content it would show as data. Whatever isn't a whole dataset of rigidsim is refused before it is read.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import xarray
from xarray.backends import AbstractDataStore, BackendArray, InMemoryDataStore
from xarray.core import indexing

from rigidsim.errors import RunFolderError
from rigidsim.store.netcdf import (
    Block,
    attribute,
    check_version,
    joined_parts,
    label_attributes,
    reading,
    root_attributes,
    rows_in,
    stored_rows,
)
from rigidsim.store.variables import LABELS, OF_THE_RUN, Extra, Variable, used_labels

_MOST_VARIABLES = 10_000
_GROUPS = ("checkpoint", "events")
_BARE = b"This is a netCDF dimension but not a netCDF variable"
"""Beginning of the ``NAME`` of the empty variable that netCDF-4 keeps for a dimension without coordinates."""
_OF_NETCDF = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "_Netcdf4Dimid"}
_OF_NETCDF |= {"_Netcdf4Coordinates", "_NCProperties"}
_AT_ONCE = 1 << 16
"""Numbers of a variable that are read when its file is opened (half a megabyte)."""


def open_dataset(
    path: Path, *more: Path, status: str | None = None, indexed: bool = True, decoded: bool = True
) -> xarray.Dataset:
    """A dataset, of which only the requested rows are read, whatever their number.

    Args:
        path: the file; whether its content is what its seal says has been checked already.
        more: segments that follow, if it is one.
        status: the run's status, in place of the file's attribute.
        indexed: whether ``time`` becomes an index, which holds all sample times in memory.
        decoded: whether dates become dates; otherwise every variable is as it is stored.

    Returns:
        Values beyond double precision have residuals next to them, see ``parts_of_values.parts_in``.

    Raises:
        RunFolderError: a file is damaged, foreign, of another schema version, or lacks what it declares.
    """
    try:
        inspect(path)
        opened = xarray.open_dataset(
            _Files([path, *more], status),
            engine="store",
            decode_cf=decoded,
            create_default_indexes=indexed,
        )
        opened.encoding["source"] = str(path)
    except RunFolderError:
        raise
    except Exception as error:  # HDF5 and its readers raise many kinds on files that aren't whole
        text = str(error).strip() or type(error).__name__
        raise RunFolderError(f"{path}: can't be read ({text.splitlines()[0][:200]})") from None
    return opened


def in_memory(
    variables: Sequence[Variable],
    blocks: Sequence[Block],
    extras: Sequence[Extra],
    attributes: Mapping[str, Any],
) -> xarray.Dataset:
    """The dataset that ``open_dataset`` would read from a file of this content, without the file."""
    parts: list[tuple[str, tuple[str, ...], np.ndarray, Mapping[str, Any]]] = [
        (name, ("time", *variable.dims), values, variable.part_attributes(part))
        for variable in variables
        for part, (name, values) in enumerate(
            zip(variable.part_names(), joined_parts(blocks, variable), strict=True)
        )
    ]
    parts += [(extra.name, extra.dims, extra.values.astype(float), extra.attributes) for extra in extras]
    content = {
        dim: xarray.Variable(dim, np.array(labels, str), label_attributes(dim))
        for dim, labels in used_labels(variables).items()
    }
    for name, dims, values, recorded in parts:
        content[name] = xarray.Variable(dims, values, _as_read(recorded), {"dtype": values.dtype})
    return xarray.decode_cf(InMemoryDataStore(content, _as_read(attributes))).load()


def _as_read(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes as readers of a file give them: a single number isn't an array."""
    stored = {name: attribute(name, value) for name, value in attributes.items()}
    return {
        name: value if len(value) != 1 or isinstance(value, str) else value[0]
        for name, value in stored.items()
    }


def inspect(path: Path) -> None:
    """Refuse a file whose content doesn't match what its metadata declare."""
    if path.is_symlink():
        raise RunFolderError(f"{path}: is a symbolic link; a run's files are files of its folder")
    with h5py.File(path, "r") as file:
        version = file.attrs.get("schema_version")
        check_version(version.item() if hasattr(version, "item") else version, path)
        if len(file) > _MOST_VARIABLES:
            raise RunFolderError(f"{path}: holds {len(file)} variables; it is no dataset of rigidsim")
        of_sweep = file.attrs.get("kind") == "sweep"
        for name in file:
            link = file.get(name, getlink=True)
            item = file[name] if isinstance(link, h5py.HardLink) else None
            if name in _GROUPS and isinstance(item, h5py.Group):
                continue  # of a segment; read by themselves, as plain numbers
            if not isinstance(item, h5py.Dataset):
                raise RunFolderError(f"{path}: {name!a} is no variable, but a link or a group")
            if item.is_virtual or item.external:
                raise RunFolderError(f"{path}: the variable {name!a} lies in another file")
            if name in LABELS and item.shape != (len(LABELS[name]),):
                raise RunFolderError(f"{path}: the coordinate {name} isn't labelled {LABELS[name]}")
            names = item.ndim == 1 and item.dtype.kind == "O" and (of_sweep or name in OF_THE_RUN)
            if name not in LABELS and not names:
                _check_numbers(item, name, path)
        if not of_sweep and ("time" not in file or file["time"].ndim != 1):
            raise RunFolderError(f"{path}: has no coordinate time; it is no dataset of rigidsim")


def _check_numbers(item: Any, name: str, path: Path) -> None:
    """Require that every declared row is stored, so that none is read as a fill value."""
    if item.dtype.kind not in "fiuSOV" or item.dtype.hasobject:
        raise RunFolderError(f"{path}: the variable {name!a} holds no numbers")
    if name != "time" and _without_coordinates(item):
        return
    size = item.size or 0
    if item.chunks is None:
        lacking = item.id.get_storage_size() < size * item.dtype.itemsize
    else:
        chunks = [-(-length // chunk) for length, chunk in zip(item.shape, item.chunks, strict=True)]
        lacking = item.id.get_num_chunks() < math.prod(chunks)
    if lacking:
        raise RunFolderError(f"{path}: the variable {name!a} declares {size} numbers that it lacks")


class _Files(AbstractDataStore):
    """A dataset, or the segments of an unfinished run as one file, for xarray: what h5netcdf reads, in a
    third of its time.
    """

    def __init__(self, paths: Sequence[Path], status: str | None) -> None:
        self._paths, self._status = paths, status

    def load(self) -> tuple[dict[str, xarray.Variable], dict[str, Any]]:
        """All variables, and the attributes of the first file."""
        first = self._paths[0]
        with reading(first) as file:
            attributes = _read_attributes(file.attrs)
            if self._status is not None:
                attributes["status"] = self._status
            items = {
                name: item
                for name, item in file.items()
                if isinstance(item, h5py.Dataset) and not _without_coordinates(item)
            }
            for name in _not_begun(file, self._paths[-1]) if self._status is not None else ():
                del items[name]
            rows = [root_attributes(path)["rows"] for path in self._paths] if len(self._paths) > 1 else []
            starts = np.concatenate([[0], np.cumsum(rows, dtype=int)])
            return {name: self._variable(name, item, starts) for name, item in items.items()}, attributes

    def _variable(self, name: str, item: h5py.Dataset, starts: np.ndarray) -> xarray.Variable:
        dims = [dim[0].name.lstrip("/") if len(dim) else name for dim in item.dims]
        values: Any
        if item.dtype.kind == "O":
            values = item.asstr()[()].astype(str)
        elif len(self._paths) == 1 and item.size <= _AT_ONCE:
            values = item[()]
        else:
            joins = len(self._paths) > 1 and dims[0] == "time"
            along = (self._paths, starts) if joins else (self._paths[:1], np.array([0, len(item)]))
            values = indexing.LazilyIndexedArray(_Joined(*along, name, item.shape[1:], item.dtype))
        return xarray.Variable(dims, values, _read_attributes(item.attrs), {"dtype": item.dtype})


def _read_attributes(stored: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes of an HDF5 object, without the ones by which netCDF-4 holds dimensions."""
    return {
        name: value[0] if np.shape(value) == (1,) else value
        for name, value in stored.items()
        if name not in _OF_NETCDF
    }


def _without_coordinates(item: h5py.Dataset) -> bool:
    """Whether a dataset only stands for a dimension that has no coordinates."""
    return bytes(item.attrs.get("NAME", b"")).startswith(_BARE)


def _not_begun(first: h5py.File, last: Path) -> set[str]:
    """Names of the variables of corrections put back in a run that ends before its projection begins: they
    are zero throughout, and the dataset leaves them out.
    """
    if "hold_from_step" not in first.attrs:
        return set()
    names = {name for name, item in first.items() if "put_back_of" in item.attrs}
    with reading(last) as file:
        rows = rows_in(file)
        begun = any(name in rows and len(rows[name]) and float(rows[name][-1]) != 0.0 for name in names)
    return set() if begun else names


class _Joined(BackendArray):
    """One variable along all segments, read on access."""

    def __init__(
        self, paths: Sequence[Path], starts: np.ndarray, name: str, shape: tuple[int, ...], dtype: np.dtype
    ) -> None:
        self._paths, self._starts, self._name = paths, starts, name
        self.shape, self.dtype = (int(starts[-1]), *shape), dtype

    def __getitem__(self, key: Any) -> Any:
        basic = indexing.IndexingSupport.BASIC
        return indexing.explicit_indexing_adapter(key, self.shape, basic, self._read)

    def _read(self, key: tuple[Any, ...]) -> np.ndarray:
        rows, rest = range(self.shape[0])[key[0]], key[1:]
        if not isinstance(rows, range):
            return np.asarray(self._rows(range(rows, rows + 1), rest)[0])
        return self._rows(rows, rest) if rows.step > 0 else self._rows(rows[::-1], rest)[::-1]

    def _rows(self, rows: range, rest: tuple[Any, ...]) -> np.ndarray:
        """Rows, from the segments that hold them."""
        pieces: list[np.ndarray] = []
        for path, start, stop in zip(self._paths, self._starts[:-1], self._starts[1:], strict=True):
            first, end = (-(-max(edge - rows.start, 0) // rows.step) for edge in (start, stop))
            inside = rows[first:end]
            if len(inside) or path == self._paths[0]:
                part = slice(inside.start - start, inside.stop - start, inside.step) if inside else slice(0)
                with reading(path) as file:
                    pieces.append(stored_rows(rows_in(file)[self._name], part)[:, *rest])
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)
