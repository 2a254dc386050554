"""Datasets opened with distrust: whatever isn't a whole dataset of rigidsim is refused before it is read.

A file may be torn, foreign, from a newer version, or made to hurt: declare rows that it doesn't hold (a few
kilobytes that unpack to terabytes of zeros), or point to other files, whose content it would show as data.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigidsim.errors import RunFolderError
from rigidsim.store.variables import LABELS, OF_THE_RUN, SCHEMA_VERSION, is_bare_dimension

if TYPE_CHECKING:
    import xarray

OLDEST_SCHEMA_VERSION = 1
_MOST_VARIABLES = 10_000
_GROUPS = ("checkpoint", "events")


def open_dataset(path: Path, *, indexed: bool = True) -> xarray.Dataset:
    """A dataset, or a segment, read lazily.

    Args:
        path: the file; its checksum, if known, has been compared already.
        indexed: whether ``time`` becomes an index, which holds all sample times in memory.

    Raises:
        RunFolderError: the file is damaged, foreign, of a newer schema version, or lacks what it declares.
    """
    import xarray

    from rigidsim.store.xarray_reader import NetcdfBackend

    try:
        inspect(path)
        options: dict[str, Any] = {} if indexed else {"create_default_indexes": False}
        opened = xarray.open_dataset(path, engine=NetcdfBackend, **options)
    except RunFolderError:
        raise
    except Exception as error:  # HDF5 and its readers raise many kinds on files that aren't whole
        raise RunFolderError(f"{path}: can't be read ({_first_line(error)})") from None
    return opened


def _first_line(error: Exception) -> str:
    text = str(error).strip() or type(error).__name__
    return text.splitlines()[0][:200]


def inspect(path: Path) -> None:
    """Refuse a file whose content doesn't match what its metadata declare.

    Raises:
        RunFolderError: the content doesn't match.
    """
    import h5py

    if path.is_symlink():
        raise RunFolderError(f"{path}: is a symbolic link; a run's files are files of its folder")
    with h5py.File(path, "r") as file:
        _check_version(file.attrs.get("schema_version"), path)
        if len(file) > _MOST_VARIABLES:
            raise RunFolderError(f"{path}: holds {len(file)} variables; it is no dataset of rigidsim")
        rows: int | None = None
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
            if name not in LABELS and not _names(name, item):
                _check_numbers(item, name, path)
            if name == "time":
                rows = item.shape[0] if item.ndim == 1 else None
        if rows is None:
            raise RunFolderError(f"{path}: has no coordinate time; it is no dataset of rigidsim")


def _names(name: str, item: Any) -> bool:
    """Whether an item is a coordinate of names specific to the run."""
    return name in OF_THE_RUN and item.ndim == 1 and item.dtype.kind == "O"


def _check_version(found: Any, path: Path) -> None:
    """Refuse schema versions that this version of rigidsim doesn't know."""
    version = found.item() if hasattr(found, "item") else found
    if not isinstance(version, int) or isinstance(version, bool):
        raise RunFolderError(f"{path}: names no schema version; it is no dataset of rigidsim")
    if version > SCHEMA_VERSION:
        raise RunFolderError(
            f"{path}: has schema version {version}, newer than this rigidsim reads ({SCHEMA_VERSION}); "
            "update rigidsim"
        )
    if version < OLDEST_SCHEMA_VERSION:
        raise RunFolderError(f"{path}: has schema version {version}, which never was one")


def _check_numbers(item: Any, name: str, path: Path) -> None:
    """Require that every declared row is stored, so that none is read as a fill value."""
    if item.dtype.kind not in "fiuSOV" or item.dtype.hasobject:
        raise RunFolderError(f"{path}: the variable {name!a} holds no numbers")
    if name != "time" and is_bare_dimension(item):
        return
    size = item.size or 0
    if item.chunks is None:
        if item.id.get_storage_size() < size * item.dtype.itemsize:
            raise RunFolderError(f"{path}: the variable {name!a} declares {size} numbers that it lacks")
        return
    wanted = math.prod(-(-length // chunk) for length, chunk in zip(item.shape, item.chunks, strict=True))
    if item.id.get_num_chunks() < wanted:
        raise RunFolderError(f"{path}: the variable {name!a} declares {size} numbers that it lacks")
