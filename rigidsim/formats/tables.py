"""A dataset as flat tables, read block by block, from which CSV, Parquet and the CCSDS messages are written.

One table has a row per sample; each event, and the Lyapunov estimates, have a table of their own. A vector
becomes a column per component (``angular_velocity_x``), and a column knows the residuals that hold its digits
beyond double.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np
import xarray

from rigidsim.formats.digits import RADIAN, converted
from rigidsim.scene.readable import AngleUnit
from rigidsim.store.netcdf import CHUNK_ROWS
from rigidsim.store.variables import LABELS, parts_in

BLOCK_ROWS = 2 * CHUNK_ROWS
BLOCK_NUMBERS = 1 << 21  # 16 MB


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
    """Columns along one dimension.

    Attributes:
        main: dimension of the table that carries the run's name.
        dated: whether its times may be given as dates.
    """

    main: ClassVar[str] = "time"
    dated: ClassVar[bool] = True
    dim: str
    columns: tuple[TableColumn, ...]
    dataset: xarray.Dataset
    bits: int = 53

    @property
    def rows(self) -> int:
        """Number of rows."""
        return int(self.dataset.sizes[self.dim])

    @property
    def extent(self) -> str:
        """Description of its rows, for the comment at a file's top."""
        return f"{self.rows} rows along {self.dim}"

    def column(self, name: str) -> TableColumn | None:
        """The column with the given name; None if there is none."""
        return next((column for column in self.columns if column.name == name), None)

    def blocks(
        self, columns: Sequence[TableColumn] | None = None, rows: int = BLOCK_ROWS
    ) -> Iterator[list[list[np.ndarray]]]:
        """Parts of each column, block by block: ``block[column][part]`` has shape (at most ``rows``,)."""
        wanted = self.columns if columns is None else columns
        names = dict.fromkeys(part for column in wanted for part in column.parts)
        for first in range(0, self.rows, rows):
            here = {self.dim: slice(first, first + rows)}
            read = {name: self.dataset[name].isel(here).values for name in names}
            yield [self._values(column, read) for column in wanted]

    def _values(self, column: TableColumn, read: Mapping[str, np.ndarray]) -> list[np.ndarray]:
        """Parts of one column."""
        key: Any = (slice(None), *column.index)
        parts = [np.asarray(read[part][key]) for part in column.parts]
        unit = column.angle_unit
        return parts if unit is None else converted(parts, unit, column.bits(self.bits))


def tables_of(dataset: xarray.Dataset, angle_unit: AngleUnit | None = None, bits: int = 53) -> list[Table]:
    """The table along time, then those along other dimensions."""
    variables = dataset.variables
    names = [str(name) for name, found in variables.items() if found.dims and found.dtype.kind in "fM"]
    names.sort(key=lambda name: (name != "time", name not in dataset.coords))
    columns: dict[str, list[TableColumn]] = {}
    for name in names:
        columns.setdefault(str(variables[name].dims[0]), []).extend(columns_of(dataset, name, angle_unit))
    return [Table(dim, tuple(found), dataset, bits) for dim, found in columns.items() if found]


def columns_of(
    dataset: xarray.Dataset, name: str, angle_unit: AngleUnit | None = None, rows: Sequence[str] = ()
) -> list[TableColumn]:
    """Columns of a variable, one per component; none for a residual, which its value's columns include. Rows
    run along some dimensions, by default the variable's first.
    """
    variable = dataset[name]
    if "residual_of" in variable.attrs:
        return []
    beside = [str(dim) for dim in variable.dims if str(dim) not in (rows or (variable.dims[0],))]
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
