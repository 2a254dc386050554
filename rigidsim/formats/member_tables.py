"""The dataset of a sweep as flat tables: one row per member, or per member and sample, event or spectral
line.

The first table has a row for each member. Variables with a dimension besides the members' (the samples of
whole series, occurrences of an event, spectral lines) form a long table for that dimension. Every table
begins with the member's number and the values that identify it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import xarray

from rigidsim.formats.digits import converted
from rigidsim.formats.tables import BLOCK_NUMBERS, Table, TableColumn, columns_of
from rigidsim.scene.readable import AngleUnit
from rigidsim.store.sweeps.dataset import boxes

MEMBER = "member"
REASON = "failed_reason"
_FAILED = "failed"
_LONG = ("time", "sample", "line")
_FIRST = ("status", "warnings", "steps")


@dataclass(frozen=True)
class MemberTable(Table):
    """A table of members, the last axis varying fastest; in a long table a member's own rows follow one
    another.
    """

    main: ClassVar[str] = MEMBER
    dated: ClassVar[bool] = False  # datasets of sweeps hold no dates
    members: tuple[str, ...] = ()
    values: tuple[TableColumn, ...] = ()
    reasons: dict[int, str] = field(default_factory=dict)
    block_numbers: int = BLOCK_NUMBERS

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of members along each of their dimensions."""
        return tuple(self.dataset.sizes[dim] for dim in self.members)

    @property
    def each(self) -> int:
        """Rows per member: 1, or in a long table as many as any member has."""
        return 1 if self.dim == MEMBER else int(self.dataset.sizes[self.dim])

    @property
    def rows(self) -> int:
        """Largest number of rows: a long table leaves out rows without any number."""
        return math.prod(self.shape) * self.each

    @property
    def extent(self) -> str:
        """Extent of the table, for the comment at a file's top."""
        told = f"{math.prod(self.shape)} members along {', '.join(self.members)}"
        return told if self.dim == MEMBER else f"{told}, each along {self.dim}"

    def blocks(
        self, columns: Sequence[TableColumn] | None = None, rows: int = 0
    ) -> Iterator[list[list[np.ndarray]]]:
        """As of ``Table``; the number of columns decides how many rows a block has."""
        wanted = self.columns if columns is None else columns
        numbers = sum(len(column.parts) for column in self.columns)
        for first, shape, flat in boxes(self.shape, self.each * numbers, self.block_numbers):
            width = self.each if len(flat) > 1 else min(self.each, max(1, self.block_numbers // numbers))
            for low in range(0, self.each, width):
                here = {dim: slice(i, i + n) for dim, i, n in zip(self.members, first, shape, strict=True)}
                steps = range(low, min(low + width, self.each))
                if self.dim != MEMBER:
                    here[self.dim] = slice(steps.start, steps.stop)
                yield self._block(wanted, _Block(self.dataset.isel(here), flat, steps))

    def _block(self, wanted: Sequence[TableColumn], block: _Block) -> list[list[np.ndarray]]:
        """Parts of some columns; rows of a long table without any number are left out."""
        if self.dim == MEMBER:
            return [self._parts(column, block) for column in wanted]
        numbers = [self._parts(column, block)[0] for column in self.values]
        kept = np.any([~np.isnan(values) for values in numbers], axis=0)
        return [[part[kept] for part in self._parts(column, block)] for column in wanted]

    def _parts(self, column: TableColumn, block: _Block) -> list[np.ndarray]:
        """The parts of one column, (rows of the block,) each."""
        if column.name == MEMBER:
            return [np.repeat(np.arange(block.members.start, block.members.stop), len(block.steps))]
        if column.name == REASON:
            return [np.array([self.reasons.get(member, "") for member in block.members], dtype=object)]
        if column.name == self.dim and self.dim not in self.dataset.variables:
            return [np.tile(np.arange(block.steps.start, block.steps.stop), len(block.members))]
        dims = self.members if self.dim == MEMBER else (*self.members, self.dim)
        key: Any = (slice(None), *column.index)
        parts = [block.rows(name, dims)[key] for name in column.parts]
        for number in range(1, len(parts)):  # members of fewer bits than others have no residuals: nan
            empty = np.isnan(parts[number]) & ~np.isnan(parts[0])
            parts[number] = np.where(empty, 0.0, parts[number])
        unit = column.angle_unit
        return parts if unit is None else converted(parts, unit, column.bits(self.bits))


class _Block:
    """Members, with some of their samples, that are read together."""

    def __init__(self, dataset: xarray.Dataset, members: range, steps: range) -> None:
        self.members, self.steps = members, steps
        self._dataset = dataset
        self._read: dict[str, np.ndarray] = {}

    def rows(self, name: str, dims: Sequence[str]) -> np.ndarray:
        """A variable with one row for each point of some dimensions, (rows, *components), repeated along
        those that it lacks.
        """
        if name not in self._read:
            variable = self._dataset[name].variable
            own = {str(dim): size for dim, size in variable.sizes.items() if dim not in dims}
            wide = variable.set_dims({dim: self._dataset.sizes[dim] for dim in dims} | own)
            self._read[name] = wide.transpose(*dims, *own).values.reshape(-1, *own.values())
        return self._read[name]


def member_tables(
    dataset: xarray.Dataset,
    angle_unit: AngleUnit | None = None,
    bits: int = 53,
    block_numbers: int = BLOCK_NUMBERS,
) -> list[MemberTable]:
    """The table of the members, then the long tables."""
    members = tuple(map(str, dataset["status"].dims))
    axes = [str(name) for name, variable in dataset.variables.items() if "swept_key" in variable.attrs]
    axes.sort(key=lambda name: next((i for i, dim in enumerate(members) if name in (dim, f"{dim}_value")), 0))
    labels = [c for name in axes for c in columns_of(dataset, name, angle_unit, members)]
    kept: dict[str, list[TableColumn]] = {MEMBER: []}
    names = [str(name) for name, found in dataset.data_vars.items() if set(members) <= set(found.dims)]
    names.sort(key=lambda name: (_FIRST.index(name) if name in _FIRST else len(_FIRST), name))
    for name in names:
        dim = next((str(dim) for dim in dataset[name].dims if _is_long(str(dim), members)), MEMBER)
        rows = (*members, dim)
        kept.setdefault(dim, []).extend(columns_of(dataset, name, angle_unit, rows))
    reasons: dict[int, str] = {}
    if _FAILED in dataset.dims:
        numbers, texts = dataset["failed_member"].values, dataset[REASON].values
        reasons = {int(member): str(text) for member, text in zip(numbers, texts, strict=True)}
    found = []
    for dim, values in kept.items():
        columns = [_made(MEMBER, "i", "number of the member, the last axis fastest"), *labels]
        if dim != MEMBER:
            told = columns_of(dataset, dim, None, (dim,)) if dim in dataset.variables else []
            columns += told or [_made(dim, "i", "which of the member's, counted from 0")]
        columns += values
        if dim == MEMBER and reasons:
            columns.append(_made(REASON, "U", "why a member didn't end well"))
        found.append(
            MemberTable(dim, tuple(columns), dataset, bits, members, tuple(values), reasons, block_numbers)
        )
    return found


def _is_long(dim: str, members: Sequence[str]) -> bool:
    """Whether a dimension's points become rows; points of others, components of vectors, become columns."""
    return dim not in members and (dim in _LONG or dim.endswith("_occurrence"))


def _made(name: str, kind: str, long_name: str) -> TableColumn:
    """A column that isn't a variable of the dataset."""
    return TableColumn(name, "", (), (name,), {"units": "1", "long_name": long_name}, kind)
