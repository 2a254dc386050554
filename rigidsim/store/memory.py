"""Runs in memory: samples collected without files, and the dataset made of them on request."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from rigidsim.store.chunks import JoinedBlocks
from rigidsim.store.netcdf import Block
from rigidsim.store.run import Run
from rigidsim.store.summary import Brief
from rigidsim.store.variables import Extra, Variable, used_labels

if TYPE_CHECKING:
    import xarray


class MemoryWriter:
    """Takes what a ``SegmentWriter`` takes, and keeps it in memory."""

    due = False

    def __init__(self) -> None:
        self.blocks: list[Block] = []

    def add(self, block: Block) -> None:
        """Take a block of samples."""
        if len(block["time"][0]):
            self.blocks.append(block)

    def flush(self, checkpoint: Mapping[str, np.ndarray], events: Mapping[str, np.ndarray]) -> None:
        """Do nothing: a run in memory can't be resumed."""


@dataclass(frozen=True, repr=False)
class MemoryRun(Run):
    """A run in memory; ``dataset`` equals the one that ``dataset.h5`` would hold, attribute for attribute."""

    outcome: Brief
    variables: Sequence[Variable]
    blocks: Sequence[Block]
    extras: Sequence[Extra]
    attributes: Mapping[str, Any]

    @property
    def place(self) -> str:
        """Description of where the run is kept."""
        return "memory"

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """The dataset, in memory."""
        import xarray

        joined = JoinedBlocks(self.blocks, self.variables)
        found: dict[str, xarray.Variable] = {}
        for variable in self.variables:
            parts = joined[variable.name] if self.blocks else [np.empty(0)] * variable.parts
            for part, (name, values) in enumerate(zip(variable.part_names(), parts, strict=True)):
                shaped = values.reshape(-1, *variable.shape)
                attributes = variable.part_attributes(part)
                found[name] = xarray.Variable(("time", *variable.dims), shaped, attributes)
        for extra in self.extras:
            found[extra.name] = xarray.Variable(extra.dims, extra.values, dict(extra.attributes))
        coordinates = {"time": found.pop("time")}
        for dim, names in used_labels(self.variables).items():
            labels = np.array(names)
            coordinates[dim] = xarray.Variable((dim,), labels, {"long_name": dim.replace("_", " ")})
        coordinates |= {n: found.pop(n) for n in list(found) if found[n].dims == (n,)}
        told = xarray.Dataset(found, coords=coordinates, attrs=dict(self.attributes))
        return xarray.decode_cf(told)  # dates, and coordinates besides time

    def concluded(self, outcome: Brief) -> Self:
        """The same run with another summary."""
        return replace(self, outcome=outcome)
