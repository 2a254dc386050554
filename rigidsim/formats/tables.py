"""A dataset as flat tables, read block by block, from which CSV, Parquet and the CCSDS messages are written;
and as a Zarr store.

A run's first table has a row per sample; each event, and the Lyapunov estimates, have separate tables. A
sweep's has a row per member; variables with a dimension besides the members' (the samples of whole series,
occurrences of an event, spectral lines) form a long table for that dimension, and every table begins with the
member's number and the values that identify it. A vector becomes a column per component
(``angular_velocity_x``), and a column knows the residuals that hold its digits beyond double.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from rigidsim.formats.digits import RADIAN, converted, texts
from rigidsim.formats.registry import Format, TableSource, named_epoch
from rigidsim.scene.epochs import DIGITS, Epoch
from rigidsim.scene.parts_of_values import parts_in
from rigidsim.scene.readable import AngleUnit
from rigidsim.store.netcdf import CHUNK_ROWS
from rigidsim.store.sweeps.tiles import boxes, chunk_shape
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
        suffix: of the column's name: the component, and the unit of angles where they are converted.
        kind: of numpy: "f", "i", "M" for dates; "U" for all else.
        angle_unit: to which its angles are converted; None if unchanged.
    """

    parts: tuple[str, ...]
    suffix: str
    index: tuple[int, ...]
    attributes: Mapping[str, Any]
    kind: str
    angle_unit: AngleUnit | None

    def part_name(self, part: int) -> str:
        """Name of a residual's column: ``angular_velocity_lo_x``."""
        return self.parts[part] + self.suffix

    @property
    def name(self) -> str:
        """Name of the column: ``angular_velocity_x``, or ``obliquity_figure_deg``."""
        return self.part_name(0)

    @property
    def units(self) -> str:
        """Units as in the dataset, or those to which angles are converted."""
        return self.angle_unit.name if self.angle_unit else str(self.attributes.get("units", "1"))

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
    def rows(self) -> int:
        """Number of rows, or of members."""
        return math.prod(self._outer.values())

    @property
    def extent(self) -> str:
        """Description of its rows, for the comment at a file's top."""
        if not self.members:
            return f"{self.rows} rows along {self.dim}"
        words = f"{self.rows} members along {', '.join(self.members)}"
        return f"{words}, each along {self.dim}" if self._long else words

    def column(self, name: str) -> TableColumn | None:
        """The column with the given name; None if there is none."""
        return next((column for column in self.columns if column.name == name), None)

    def blocks(self, columns: Sequence[TableColumn] | None = None) -> Iterator[list[list[np.ndarray]]]:
        """Parts of each column, block by block: ``block[column][part]`` has shape (rows of the block,)."""
        wanted = self.columns if columns is None else columns
        numbers, outer = sum(len(c.parts) for c in self.columns), self._outer
        each = int(self.dataset.sizes[self.dim]) if self._long else 1  # rows per member
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
        # points of long dimensions become rows; of others, components of vectors, they become columns
        beside = (dim for dim in map(str, dataset[name].dims) if dim not in members)
        dim = next((dim for dim in beside if dim in _LONG or dim.endswith("_occurrence")), MEMBER)
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
    ending = "" if unit is None else f"_{unit.name}"
    labels = []
    for dim in beside:
        own = [str(x) for x in dataset[dim].values] if dim in dataset.coords else None
        labels.append(LABELS.get(dim) or own or [str(n) for n in range(variable.sizes[dim])])
    found = []
    for index in product(*(range(len(names)) for names in labels)):
        suffix = "".join(f"_{names[i]}" for names, i in zip(labels, index, strict=True)) + ending
        found.append(TableColumn(parts, suffix, index, variable.attrs, kind, unit))
    return found


# --- CSV ----------------------------------------------------------------------------------------------------


def write_csv(table: Table, path: Path, source: TableSource) -> None:
    """Write one table with all digits: comment lines, one header line, then decimal text.

        pandas.read_csv(path, comment="#", float_precision="round_trip")

    reads it as float64 (which rounds numbers beyond double to the nearest one); ``dtype=str`` keeps every
    digit.
    """
    columns = [column for column in table.columns if column.kind != "M"]
    dates = _dates(table, source)
    wide = any(len(column.parts) > 1 for column in columns if "significant_bits" not in column.attributes)
    head = [
        f"# {_short(source.title)}: {table.extent}",
        'read with pandas.read_csv(path, comment="#", float_precision="round_trip")',
        "units: " + ", ".join(f"{c.name} [{c.units}]" for c in columns if c.kind != "U"),
        *(f"{column.name}: {column.flags}" for column in columns if column.flags),
    ]
    swept = {c.parts[0]: c.attributes["swept_key"] for c in columns if "swept_key" in c.attributes}
    if swept:
        head.append("axes: " + ", ".join(f"{name} is {_short(key)}" for name, key in swept.items()))
    if wide:
        head.insert(2, f"numbers have {source.bits} bits; dtype=str keeps the digits that float64 can't hold")
    names = [column.name for column in columns]
    if dates is not None:
        epoch, dated = dates
        head.append(f"time 0 is {epoch}; dates are {epoch.scale}, to 1e-{DIGITS} s")
        names.insert(1, f"{dated.parts[0].removesuffix('time')}date")
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write("\n# ".join(head) + "\n")
        file.write(",".join(names) + "\n")
        for block in table.blocks(columns):
            shown = [_shown(c, parts, source) for c, parts in zip(columns, block, strict=True)]
            if dates is not None:
                shown.insert(1, [_date(epoch, time) for time in shown[columns.index(dated)]])
            file.writelines(",".join(row) + "\n" for row in zip(*shown, strict=True))


def _shown(column: TableColumn, parts: list[np.ndarray], source: TableSource) -> list[str]:
    """One column's numbers, or its strings in quotes."""
    if column.kind == "U":
        return [f'"{_on_one_line(text).replace(chr(34), chr(34) * 2)}"' for text in parts[0]]
    return texts(parts, column.bits(source.bits))


def _dates(table: Table, source: TableSource) -> tuple[Epoch, TableColumn] | None:
    """Date of time 0 and the column of times, if known and the calendar covers all rows; else None."""
    if table.members:  # datasets of sweeps hold no dates
        return None
    times = next((c for c in table.columns if re.fullmatch(r"(.*_)?time", c.parts[0])), None)
    if times is None or not table.rows or not (source.naming.epoch or source.attributes.get("epoch")):
        return None
    epoch = named_epoch(source.naming, source.attributes)
    try:
        for row in (0, -1):
            _date(epoch, repr(float(table.dataset[times.parts[0]][row])))
    except (ValueError, ArithmeticError):
        return None
    return epoch, times


def _date(epoch: Epoch, seconds: str) -> str:
    return epoch.after(Decimal(seconds)).calendar()


def _short(text: str) -> str:
    """Text on a single line of limited length."""
    return _on_one_line(text)[:200]


def _on_one_line(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)


# --- Parquet ------------------------------------------------------------------------------------------------


def write_parquet(table: Table, path: Path, source: TableSource) -> None:
    """Write one table as float64 columns, with units in each column's metadata; residuals become columns
    such as ``time_lo``.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    kinds = {"f": pa.float64(), "i": pa.int64(), "M": pa.timestamp("ns"), "U": pa.string()}
    fields = []
    for column in table.columns:
        for part in range(len(column.parts)):
            about = {"units": column.units, "long_name": str(column.attributes.get("long_name", ""))}
            if part:
                about["residual_of"] = column.name
            elif column.flags:
                about["flags"] = column.flags
            elif "exact_value" in column.attributes:
                about["exact_value"] = " + ".join(
                    column.part_name(n) for n in reversed(range(len(column.parts)))
                )
            kind = kinds[column.kind]
            fields.append(pa.field(column.part_name(part), kind, nullable=column.kind == "M", metadata=about))
    schema = pa.schema(fields, metadata={str(key): str(value) for key, value in source.attributes.items()})
    with pq.ParquetWriter(path, schema, compression="zstd", use_dictionary=False) as writer:
        for block in table.blocks():
            arrays = [pa.array(part) for parts in block for part in parts]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))


# --- Zarr ---------------------------------------------------------------------------------------------------

BLOCK_ROWS = 8 * CHUNK_ROWS
_SLAB_BLOCKS = 8  # 128 MB at once: each is an append


def write_zarr(table: Table, path: Path, source: TableSource) -> None:
    """Write a table's whole dataset as a store of format 2, which every reader knows, block by block along
    time or a sweep's first axis: unchanged, including residuals and labels.
    """
    dataset = table.dataset
    attributes = {str(key): _json(value) for key, value in source.attributes.items()}
    members = table.members
    dim = members[0] if members else table.dim
    rows = _slab(table) if members else BLOCK_ROWS
    along = dataset[[name for name in dataset.variables if dim in dataset[name].dims]]
    for first in range(0, max(dataset.sizes[dim], 1), rows):
        block = _plain(along.isel({dim: slice(first, first + rows)}), source)
        if first:
            block = block.drop_vars([name for name in block.variables if dim not in block[name].dims])
            block.to_zarr(path, mode="a", append_dim=dim, zarr_format=2, consolidated=False)
        else:
            block.attrs = attributes
            chunks = {name: {"chunks": _chunks(dataset[name], members)} for name in block.variables
                      if dim in block[name].dims}  # fmt: skip
            block.to_zarr(path, mode="w", encoding=chunks, zarr_format=2, consolidated=False)
    rest = [name for name in dataset.variables if dim not in dataset[name].dims]
    last = _plain(dataset[rest], source)
    last.attrs = attributes
    if members:  # no variable written with a vector's components says that they are a coordinate
        last = last.reset_coords()
        beside = [str(name) for name in dataset.coords if name not in dataset.dims]
        last.attrs = attributes | ({"coordinates": " ".join(beside)} if beside else {})
    last.to_zarr(path, mode="a", zarr_format=2, consolidated=True)


def _plain(dataset: xarray.Dataset, source: TableSource) -> xarray.Dataset:
    """The dataset in memory, with angles in the requested unit, without the HDF5 file's own encodings."""
    loaded = dataset.load().copy()
    for name in map(str, dataset.variables):
        angles = dataset[name].attrs.get("units") == RADIAN and "residual_of" not in dataset[name].attrs
        if source.angle_unit is not None and angles:
            names = parts_in(dataset, name)
            values = converted([dataset[part].values for part in names], source.angle_unit, source.bits)
            for part, found in zip(names, values, strict=True):
                about = dict(dataset[part].attrs, units=source.angle_unit.name)
                loaded = loaded.assign({part: (dataset[part].dims, found, about)})
    for name in map(str, loaded.variables):
        kept = ("units", "calendar", "dtype") if loaded[name].dtype.kind == "M" else ()
        loaded[name].encoding = {key: loaded[name].encoding[key] for key in kept}
        loaded[name].attrs = {key: _json(value) for key, value in loaded[name].attrs.items()}
    loaded.encoding = {}
    return loaded


def _chunks(variable: xarray.DataArray, members: Sequence[str]) -> tuple[int, ...]:
    """Chunk shape: rows along time; for a sweep, members as in its dataset."""
    if not members:
        return (CHUNK_ROWS, *variable.shape[1:])
    of_members = len([dim for dim in variable.dims if dim in members])
    return chunk_shape(variable.shape[:of_members], variable.shape[of_members:])


def _slab(table: Table) -> int:
    """Values of the first axis whose members are held in memory at once."""
    dataset, first = table.dataset, table.members[0]
    numbers = sum(found.size for found in dataset.variables.values() if first in found.dims)
    return max(1, _SLAB_BLOCKS * table.block_numbers * dataset.sizes[first] // max(numbers, 1))


def _json(value: Any) -> Any:
    return value.item() if hasattr(value, "item") and getattr(value, "ndim", 1) == 0 else value


CSV = Format(write_csv, angles=True, side_tables=True, names=("epoch",))
PARQUET = Format(write_parquet, angles=True, side_tables=True, names=())
ZARR = Format(write_zarr, angles=True, names=(), folder=("Zarr store", ".zgroup"))
