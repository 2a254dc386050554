"""A dataset as flat tables, read block by block, from which CSV, Parquet and the CCSDS messages are written.

A run's first table has a row per sample; each event, and the Lyapunov estimates, have a table of their own. A
sweep's has a row per member; variables with a dimension besides the members' (the samples of whole series,
occurrences of an event, spectral lines) form a long table for that dimension, and every table begins with the
member's number and the values that identify it. A vector becomes a column per component
(``angular_velocity_x``), and a column knows the residuals that hold its digits beyond double.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import xarray

from rigidsim.formats.digits import RADIAN, converted
from rigidsim.scene.parts_of_values import parts_in
from rigidsim.scene.readable import AngleUnit
from rigidsim.store.sweeps.tiles import boxes
from rigidsim.store.variables import LABELS

BLOCK_NUMBERS = 1 << 21  # 16 MB
MEMBER = "member"
REASON = "failed_reason"
_LONG = ("time", "sample", "line")
_FIRST = ("status", "warnings", "steps")


@dataclass(frozen=True)
class TableColumn:
    """One component of a variable.

    Attributes:
        parts: names of the variables whose sum, smallest first, is the exact value; the nearest double first.
        angle_unit: unit of its angles, with which the column's name ends; None if unchanged.
    """

    variable: str
    suffix: str
    index: tuple[int, ...]
    parts: tuple[str, ...]
    attributes: dict[str, Any]
    kind: str = "f"
    angle_unit: AngleUnit | None = None

    @property
    def name(self) -> str:
        """Name of the column: ``angular_velocity_x``, or ``obliquity_figure_deg``."""
        return self.variable + self.suffix + self._unit

    @property
    def _unit(self) -> str:
        return "" if self.angle_unit is None else f"_{self.angle_unit.name}"

    @property
    def units(self) -> str:
        """Units as in the dataset, or those to which angles are converted."""
        if self.angle_unit is not None:
            return self.angle_unit.name
        return str(self.attributes.get("units", "1"))

    @property
    def flags(self) -> str:
        """Meaning of the values of a status, or of the bits of a mask: "0 finished, 1 ..."; empty for
        others.
        """
        codes = self.attributes.get("flag_values", self.attributes.get("flag_masks", ()))
        names = str(self.attributes.get("flag_meanings", "")).split()
        return ", ".join(f"{code} {name}" for code, name in zip(np.atleast_1d(codes), names, strict=True))

    def bits(self, of_run: int) -> int:
        """Bits of the significand that its digits must show."""
        return int(self.attributes.get("significant_bits", of_run))

    def part_name(self, part: int) -> str:
        """Name of a residual's column: ``angular_velocity_lo_x``."""
        return self.parts[part] + self.suffix + self._unit


@dataclass(frozen=True)
class Table:
    """Columns along one dimension of a run, or along a sweep's members, the last axis varying fastest; in a
    long table a member's own rows follow one another.

    Attributes:
        members: dimensions of a sweep's members; empty for a run.
        values: of a long table, the columns without which a row is left out.
        block_numbers: numbers held in memory at once.
        made: variables of columns that the dataset doesn't have, or has otherwise.
    """

    dim: str
    columns: tuple[TableColumn, ...]
    dataset: xarray.Dataset
    bits: int = 53
    members: tuple[str, ...] = ()
    values: tuple[TableColumn, ...] = ()
    block_numbers: int = BLOCK_NUMBERS
    made: Mapping[str, xarray.Variable] = field(default_factory=dict)

    @property
    def _long(self) -> bool:
        return bool(self.members) and self.dim != MEMBER

    @property
    def _outer(self) -> dict[str, int]:
        """Dimensions of its rows, but a long table's own, with their sizes."""
        return {dim: self.dataset.sizes[dim] for dim in self.members or (self.dim,)}

    @property
    def _each(self) -> int:
        """Rows per member: 1, or in a long table as many as any member has."""
        return int(self.dataset.sizes[self.dim]) if self._long else 1

    @property
    def rows(self) -> int:
        """Largest number of rows: a long table leaves out rows without any number."""
        return math.prod(self._outer.values()) * self._each

    @property
    def extent(self) -> str:
        """Description of its rows, for the comment at a file's top."""
        if not self.members:
            return f"{self.rows} rows along {self.dim}"
        told = f"{math.prod(self._outer.values())} members along {', '.join(self.members)}"
        return f"{told}, each along {self.dim}" if self._long else told

    def column(self, name: str) -> TableColumn | None:
        """The column with the given name; None if there is none."""
        return next((column for column in self.columns if column.name == name), None)

    def blocks(self, columns: Sequence[TableColumn] | None = None) -> Iterator[list[list[np.ndarray]]]:
        """Parts of each column, block by block: ``block[column][part]`` has shape (rows of the block,)."""
        wanted = self.columns if columns is None else columns
        numbers, each, outer = sum(len(c.parts) for c in self.columns), self._each, self._outer
        for first, shape, flat in boxes(list(outer.values()), each * numbers, self.block_numbers):
            width = each if len(flat) > 1 else min(each, max(1, self.block_numbers // numbers))
            for low in range(0, each, width):
                here = {dim: slice(i, i + n) for dim, i, n in zip(outer, first, shape, strict=True)}
                if self._long:
                    here[self.dim] = slice(low, min(low + width, each))
                yield self._block(wanted, here)

    def _block(self, wanted: Sequence[TableColumn], here: Mapping[str, slice]) -> list[list[np.ndarray]]:
        """Parts of some columns; rows of a long table without any number are left out."""
        dims = (*self._outer, self.dim) if self._long else tuple(self._outer)
        block = self.dataset.isel(here)
        sizes = {dim: block.sizes[dim] for dim in dims}

        @cache
        def rows(name: str) -> np.ndarray:
            """A variable with a row for each point of the dimensions, repeated along those that it lacks."""
            made = self.made.get(name)
            variable = block[name].variable if made is None else made.isel(here, missing_dims="ignore")
            own = {str(dim): size for dim, size in variable.sizes.items() if dim not in sizes}
            wide = variable.set_dims(sizes | own).transpose(*sizes, *own)
            return np.asarray(wide.values.reshape(-1, *own.values()))

        def parts(column: TableColumn) -> list[np.ndarray]:
            place: Any = (slice(None), *column.index)
            found = [rows(name)[place] for name in column.parts]
            # members of fewer bits than others have no residuals: nan
            found[1:] = [np.where(np.isnan(x) & ~np.isnan(found[0]), 0.0, x) for x in found[1:]]
            unit = column.angle_unit
            return found if unit is None else converted(found, unit, column.bits(self.bits))

        if not self._long:
            return [parts(column) for column in wanted]
        kept = np.any([~np.isnan(parts(column)[0]) for column in self.values], axis=0)
        return [[part[kept] for part in parts(column)] for column in wanted]


def tables_of(
    dataset: xarray.Dataset, angle_unit: AngleUnit | None, bits: int, block_numbers: int
) -> list[Table]:
    """The table along time, or of a sweep's members, then the others."""
    if dataset.attrs.get("kind") == "sweep":
        return _tables_of_members(dataset, angle_unit, bits, block_numbers)
    variables = dataset.variables
    names = [str(name) for name, found in variables.items() if found.dims and found.dtype.kind in "fM"]
    names.sort(key=lambda name: (name != "time", name not in dataset.coords))
    columns: dict[str, list[TableColumn]] = {}
    for name in names:
        dim = str(variables[name].dims[0])
        columns.setdefault(dim, []).extend(_columns_of(dataset, name, angle_unit, (dim,)))
    return [Table(dim, tuple(found), dataset, bits) for dim, found in columns.items() if found]


def _tables_of_members(
    dataset: xarray.Dataset, angle_unit: AngleUnit | None, bits: int, block_numbers: int
) -> list[Table]:
    """The table of the members, then the long tables."""
    members = tuple(map(str, dataset["status"].dims))
    axes = [str(name) for name, variable in dataset.variables.items() if "swept_key" in variable.attrs]
    axes.sort(key=lambda name: next((i for i, dim in enumerate(members) if name in (dim, f"{dim}_value")), 0))
    kept: dict[str, list[str]] = {MEMBER: []}
    names = [str(name) for name, found in dataset.data_vars.items() if set(members) <= set(found.dims)]
    names.sort(key=lambda name: (_FIRST.index(name) if name in _FIRST else len(_FIRST), name))
    for name in names:
        dim = next((str(dim) for dim in dataset[name].dims if _is_long(str(dim), members)), MEMBER)
        kept.setdefault(dim, []).append(name)
    numbered = np.arange(dataset["status"].size).reshape(dataset["status"].shape)
    made = {MEMBER: _made(members, numbered, "number of the member, the last axis fastest")}
    for dim in kept.keys() - {MEMBER} - set(map(str, dataset.variables)):
        made[dim] = _made((dim,), np.arange(dataset.sizes[dim]), "which of the member's, counted from 0")
    if "failed" in dataset.dims:
        reasons = np.full(numbered.size, "", dtype=object)
        reasons[dataset["failed_member"].values] = dataset[REASON].values
        made[REASON] = _made(members, reasons.reshape(numbered.shape), "why a member didn't end well")
        kept[MEMBER].append(REASON)
    whole = dataset.assign(made)

    def columns(names: Sequence[str], dim: str) -> tuple[TableColumn, ...]:
        rows = (*members, dim)
        return tuple(c for name in names for c in _columns_of(whole, name, angle_unit, rows))

    found = []
    for dim, names in kept.items():
        every = columns([MEMBER, *axes, *([] if dim == MEMBER else [dim]), *names], dim)
        values = columns(names, dim)
        found.append(Table(dim, every, dataset, bits, members, values, block_numbers, made))
    return found


def _is_long(dim: str, members: Sequence[str]) -> bool:
    """Whether a dimension's points become rows; points of others, components of vectors, become columns."""
    return dim not in members and (dim in _LONG or dim.endswith("_occurrence"))


def _made(dims: Sequence[str], values: np.ndarray, long_name: str) -> xarray.Variable:
    """A column that the dataset doesn't have."""
    return xarray.Variable(dims, values, {"units": "1", "long_name": long_name})


def _columns_of(
    dataset: xarray.Dataset, name: str, angle_unit: AngleUnit | None, rows: Sequence[str]
) -> list[TableColumn]:
    """Columns of a variable, one per component; none for a residual, which its value's columns include. Rows
    run along some dimensions.
    """
    variable = dataset[name]
    if "residual_of" in variable.attrs:
        return []
    beside = [str(dim) for dim in variable.dims if str(dim) not in rows]
    parts = tuple(parts_in(dataset, name))
    unit = angle_unit if variable.attrs.get("units") == RADIAN else None
    kind = variable.dtype.kind if variable.dtype.kind in "fMi" else "U"
    labels = []
    for dim in beside:
        own = [str(x) for x in dataset[dim].values] if dim in dataset.coords else None
        labels.append(LABELS.get(dim) or own or [str(n) for n in range(variable.sizes[dim])])
    found = []
    for index in product(*(range(len(names)) for names in labels)):
        suffix = "".join(f"_{names[i]}" for names, i in zip(labels, index, strict=True))
        found.append(TableColumn(name, suffix, index, parts, dict(variable.attrs), kind, unit))
    return found
