"""A dataset as flat tables, read block by block: what CSV, Parquet and the CCSDS messages are written from.

One table has a row per sample; each event, and the Lyapunov estimates, have a table of their own. A vector
becomes a column per component (``angular_velocity_x``), and a column knows the residuals that hold its digits
beyond double.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import xarray

from rigidsim.store.netcdf import CHUNK_ROWS
from rigidsim.store.variables import LABELS

BLOCK_ROWS = 2 * CHUNK_ROWS
_SUFFIXES = ("", "_lo", *(f"_lo{n}" for n in range(2, 40)))


@dataclass(frozen=True)
class Column:
    """One component of a variable.

    Attributes:
        name: ``angular_velocity_x``.
        variable: it is a component of.
        index: of the component, beside the row.
        parts: names of the variables whose sum, smallest first, is the exact value; the nearest double first.
        attributes: units, long_name, ... of the variable.
    """

    name: str
    variable: str
    index: tuple[int, ...]
    parts: tuple[str, ...]
    attributes: dict[str, Any]

    @property
    def units(self) -> str:
        """As in the dataset."""
        return str(self.attributes.get("units", "1"))

    def part_name(self, part: int) -> str:
        """Name of a residual's column: ``angular_velocity_lo_x``."""
        return self.name.replace(self.variable, self.parts[part], 1)


@dataclass(frozen=True)
class Table:
    """Columns along one dimension.

    Attributes:
        dim: "time", or the name of an event, ...
        columns: the coordinate first where there is one.
        pieces: datasets that continue one another along ``dim``.
    """

    dim: str
    columns: tuple[Column, ...]
    pieces: tuple[xarray.Dataset, ...]

    @property
    def rows(self) -> int:
        """In all pieces."""
        return sum(piece.sizes[self.dim] for piece in self.pieces)

    def column(self, name: str) -> Column | None:
        """By name; None where there is none."""
        return next((column for column in self.columns if column.name == name), None)

    def blocks(
        self, columns: Sequence[Column] | None = None, rows: int = BLOCK_ROWS
    ) -> Iterator[list[list[np.ndarray]]]:
        """Parts of each column, block by block: ``block[column][part]`` has shape (at most ``rows``,)."""
        wanted = self.columns if columns is None else columns
        for piece in self.pieces:
            for first in range(0, piece.sizes[self.dim], rows):
                here = slice(first, first + rows)
                read: dict[str, np.ndarray] = {}
                for name in dict.fromkeys(part for column in wanted for part in column.parts):
                    read[name] = piece[name].isel({self.dim: here}).values
                yield [[_column(read[part], column.index) for part in column.parts] for column in wanted]


def _column(values: np.ndarray, index: tuple[int, ...]) -> np.ndarray:
    """One component along the first dimension."""
    key: Any = (slice(None), *index)
    return np.asarray(values[key])


def tables_of(pieces: Sequence[xarray.Dataset]) -> list[Table]:
    """The table along time, then those along other dimensions (of the last piece, which alone has them)."""
    last = pieces[-1]
    names = [str(name) for name in last.variables if last[name].dims and last[name].dtype.kind == "f"]
    names.sort(key=lambda name: name != "time")
    dims = dict.fromkeys(str(last[name].dims[0]) for name in names)
    found = []
    for dim in dims:
        of_dim = [name for name in names if last[name].dims[0] == dim]
        columns = tuple(column for name in of_dim for column in _columns(last, name))
        if columns:
            found.append(Table(dim, columns, tuple(pieces) if dim == "time" else (last,)))
    return found


def _columns(dataset: xarray.Dataset, name: str) -> list[Column]:
    variable = dataset[name]
    if "residual_of" in variable.attrs:
        return []
    stem, parts = _parts(dataset, name)
    labels = []
    for dim in map(str, variable.dims[1:]):
        labels.append(LABELS.get(dim) or [str(n) for n in range(variable.sizes[dim])])
    found = []
    for index in product(*(range(len(names)) for names in labels)):
        suffix = "".join(f"_{names[i]}" for names, i in zip(labels, index, strict=True))
        found.append(Column(stem + suffix, stem, index, parts, dict(variable.attrs)))
    return found


def _parts(dataset: xarray.Dataset, name: str) -> tuple[str, tuple[str, ...]]:
    """Names of the value and its residuals."""
    parts = [name]
    for suffix in _SUFFIXES[1:]:
        if name + suffix not in dataset.variables or "residual_of" not in dataset[name + suffix].attrs:
            break
        parts.append(name + suffix)
    return name, tuple(parts)
