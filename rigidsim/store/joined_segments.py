"""Segments of an unfinished run joined into one dataset, read lazily: only the requested rows are in
memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidsim.store import netcdf
from rigidsim.store.validated_open import open_dataset
from rigidsim.store.variables import LABELS, OF_THE_RUN

if TYPE_CHECKING:
    import xarray


def join_segments(paths: Sequence[Path], *, status: str, indexed: bool = True) -> xarray.Dataset:
    """Dataset of all samples in a chain of segments.

    Args:
        paths: at least one, in order; their seals have been checked.
        status: the run's status, for the attributes.
        indexed: whether ``time`` becomes an index.

    Raises:
        RunFolderError: a segment can't be read.
    """
    import xarray

    rows = []
    for path in paths:
        with netcdf.reading(path) as file:
            rows.append(int(file["time"].shape[0]))
    starts = np.concatenate([[0], np.cumsum(rows)])
    with open_dataset(paths[0], indexed=False) as first:
        joined: dict[str, xarray.Variable] = {}
        unused = _not_begun(first, paths[-1])
        for name, variable in first.variables.items():
            if name in unused:
                continue
            if variable.dims[:1] == ("time",):
                joined[str(name)] = _joined(paths, starts, str(name), variable)
            elif name in LABELS or name in OF_THE_RUN:
                joined[str(name)] = variable.load()
        attributes = dict(first.attrs, status=status)
        known = [name for name in map(str, first.coords) if name in joined]
    coordinates = {name: joined.pop(name) for name in known}
    if not indexed:
        bare = xarray.Coordinates(coordinates, indexes={})
        return xarray.Dataset(joined, coords=bare, attrs=attributes)
    return xarray.Dataset(joined, coords=coordinates, attrs=attributes)


def _not_begun(first: xarray.Dataset, last: Path) -> set[str]:
    """Names of the variables of corrections put back in a run that ends before its projection begins: they
    are zero throughout, and the dataset leaves them out.
    """
    if "hold_from_step" not in first.attrs:
        return set()
    names = {str(name) for name, variable in first.variables.items() if "put_back_of" in variable.attrs}
    with netcdf.reading(last) as file:
        begun = any(file[name].shape[0] and float(file[name][-1]) != 0.0 for name in names)
    return set() if begun else names


def _joined(paths: Sequence[Path], starts: np.ndarray, name: str, like: xarray.Variable) -> xarray.Variable:
    import xarray
    from xarray.backends import BackendArray
    from xarray.core import indexing

    class Joined(BackendArray):
        """One variable along all segments, read lazily."""

        shape = (int(starts[-1]), *like.shape[1:])
        dtype = like.dtype if like.dtype.kind != "M" else np.dtype(np.float64)

        def __getitem__(self, key: Any) -> Any:
            basic = indexing.IndexingSupport.BASIC
            return indexing.explicit_indexing_adapter(key, self.shape, basic, self._read)

        def _read(self, key: tuple[Any, ...]) -> np.ndarray:
            wanted, rest = key[0], key[1:]
            if not isinstance(wanted, slice):
                row = range(self.shape[0])[wanted]
                return np.asarray(_rows(paths, starts, name, range(row, row + 1), rest)[0])
            return _rows(paths, starts, name, range(*wanted.indices(self.shape[0])), rest)

    if like.dtype.kind != "M":
        return xarray.Variable(like.dims, indexing.LazilyIndexedArray(Joined()), like.attrs)
    stored = dict(like.attrs, **{key: like.encoding[key] for key in ("units", "calendar")})
    numbers = xarray.Variable(like.dims, indexing.LazilyIndexedArray(Joined()), stored)
    dates: xarray.Variable = xarray.conventions.decode_cf_variable(name, numbers)
    return dates


def _rows(paths: Sequence[Path], starts: np.ndarray, name: str, rows: range, rest: tuple[Any, ...]) -> Any:
    """Rows of one variable, from the segments that hold them."""
    if rows.step < 0:
        return _rows(paths, starts, name, rows[::-1], rest)[::-1]
    pieces: list[np.ndarray] = []
    for path, start, stop in zip(paths, starts[:-1], starts[1:], strict=True):
        inside = rows[
            -(-max(start - rows.start, 0) // rows.step) : -(-max(stop - rows.start, 0) // rows.step)
        ]
        if len(inside) or (not pieces and path == paths[-1]):
            with netcdf.reading(path) as file:
                part = (
                    slice(inside.start - start, inside.stop - start, inside.step) if len(inside) else slice(0)
                )
                pieces.append(np.asarray(file[name][(part, *rest)]))
    return np.concatenate(pieces)
