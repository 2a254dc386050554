"""The rows of a dataset that are drawn, as arrays: what a picture needs, and nothing heavier.

``Rows`` and ``Column`` can be used where a picture takes an xarray dataset and its variables.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

if TYPE_CHECKING:
    import xarray

    Table: TypeAlias = "xarray.Dataset | Rows"
    Variable: TypeAlias = "xarray.DataArray | Column"


@dataclass(frozen=True)
class Column:
    """One variable of a dataset.

    Attributes:
        name: name in the dataset.
        dims: names of its dimensions, time first if it has that.
        attrs: its attributes.
        data: its numbers, an array or anything that yields one when sliced.
        coords: labels along its dimensions, by their names.
    """

    name: str
    dims: tuple[str, ...]
    attrs: Mapping[str, Any]
    data: Any
    coords: Mapping[str, Column]

    @property
    def values(self) -> np.ndarray:
        """Its numbers, read if they haven't been."""
        return np.asarray(self.data[...])

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of its numbers."""
        return np.dtype(self.data.dtype)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of its numbers."""
        return tuple(self.data.shape)

    @property
    def ndim(self) -> int:
        """How many dimensions it has."""
        return len(self.dims)

    def transpose(self, first: str, *rest: Any) -> Column:
        """The variable with the given dimension first; time already is."""
        if self.dims[0] != first:
            raise ValueError(f"{self.name}: {first} isn't its first dimension")
        return self

    def taken(self, slices: Sequence[slice]) -> Column:
        """Some of its rows, in memory."""
        return self.replaced(np.concatenate([np.asarray(self.data[rows]) for rows in slices]))

    def replaced(self, rows: np.ndarray) -> Column:
        """The variable with other rows, (rows, components)."""
        return Column(self.name, self.dims, self.attrs, rows.reshape(-1, *self.shape[1:]), self.coords)


@dataclass(frozen=True)
class Rows:
    """A dataset, or some rows of it.

    Attributes:
        attrs: attributes of the dataset.
        data_vars: variables by their names, in the dataset's order.
        coords: coordinates by their names, time among them.
    """

    attrs: Mapping[str, Any]
    data_vars: Mapping[str, Column]
    coords: Mapping[str, Column]

    @property
    def sizes(self) -> dict[str, int]:
        """The lengths of its dimensions."""
        columns = (*self.data_vars.values(), *self.coords.values())
        return {dim: size for column in columns for dim, size in zip(column.dims, column.shape, strict=True)}

    @property
    def dims(self) -> tuple[str, ...]:
        """The names of its dimensions."""
        return tuple(self.sizes)

    def __contains__(self, name: str) -> bool:
        return name in self.data_vars or name in self.coords

    def __getitem__(self, name: str) -> Column:
        return self.data_vars[name] if name in self.data_vars else self.coords[name]

    def taken(self, names: Sequence[str], slices: Sequence[slice]) -> Rows:
        """Some variables and some of their rows, in memory."""
        columns = {name: self.data_vars[name].taken(slices) for name in names}
        return Rows(self.attrs, columns, {"time": self.coords["time"].taken(slices)})

    def replaced(self, names: Sequence[str], known: Mapping[str, np.ndarray]) -> Rows:
        """Some variables with other rows, (rows, components) by name, and the times of these rows."""
        columns = {name: self.data_vars[name].replaced(known[name]) for name in names}
        return Rows(self.attrs, columns, {"time": self.coords["time"].replaced(known["time"])})

    def assign_attrs(self, attrs: Mapping[str, Any]) -> Rows:
        """The dataset with additional attributes."""
        return Rows({**self.attrs, **attrs}, self.data_vars, self.coords)
