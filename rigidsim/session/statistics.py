"""Statistics over all samples of a run, so that its end can be judged without reading them again."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from rigidsim.solve.checkpoint import Arrays, numbers


@dataclass(frozen=True)
class Undefined:
    """Number of NaN samples of a recorded variable, how many of them lead, and the time (s) of the first
    later one.
    """

    count: int = 0
    leading: int = 0
    since: float = math.nan


@dataclass
class SampleStatistics:
    """Statistics of the samples taken so far, in all sessions.

    Attributes:
        singularity_time: time of that sample, s.
        angles_wrapped_from: time of the first sample whose angles are within one turn, since their turns
            aren't known, seconds; nan where all are.
        undefined: NaN samples by recorded variable that has any.
    """

    invariants: Sequence[str] = ()
    recorded: Sequence[str] = ()
    largest: dict[str, float] = field(default_factory=dict)
    final: dict[str, float] = field(default_factory=dict)
    put_back: dict[str, float] = field(default_factory=dict)
    nearest_singularity: float = math.inf
    singularity_time: float = math.nan
    angles_wrapped_from: float = math.nan
    undefined: dict[str, Undefined] = field(default_factory=dict)
    version: ClassVar[int] = 1

    def see(self, invariant: str, drifts: np.ndarray) -> None:
        """Follow one invariant through a block of samples: relative drifts, (samples,)."""
        self.largest[invariant] = float(max(self.largest.get(invariant, 0.0), np.abs(drifts).max()))
        self.final[invariant] = float(drifts[-1])

    def see_undefined(self, variable: str, values: np.ndarray, first: int, times: np.ndarray) -> None:
        """Count the samples of a block, (samples, components), at which a variable is undefined."""
        if not values.size or not math.isnan(values.min()):  # the minimum is NaN if one value is
            return
        bad = np.isnan(values).any(axis=1)
        known = self.undefined.get(variable, Undefined())
        leading, since = known.leading, known.since
        start = 0
        if leading == first:  # none was defined so far
            start = int(np.argmin(bad)) if not bad.all() else len(bad)
            leading += start
        later = np.flatnonzero(bad[start:])
        if len(later) and math.isnan(since):
            since = float(times[start + later[0]])
        self.undefined[variable] = Undefined(known.count + int(bad.sum()), leading, since)

    def see_singular(self, factors: np.ndarray, times: np.ndarray) -> None:
        """Follow the distance from a formulation's singularity: factors and times (s), (samples,) each."""
        size = np.abs(factors.astype(np.float64))
        nearest = int(np.argmin(size))
        if size[nearest] < self.nearest_singularity:
            self.nearest_singularity = float(size[nearest])
            self.singularity_time = float(times[nearest])

    def pack(self) -> Arrays:
        """See ``SavedPart``."""
        arrays = {
            "watched": np.array([self._values(self.largest), self._values(self.final)]),
            "put_back": np.array(self._values(self.put_back)),
            "singularity": np.array([self.nearest_singularity, self.singularity_time]),
        }
        if self.undefined:
            rows = [self.undefined.get(name, Undefined()) for name in self.recorded]
            arrays["undefined"] = np.array([[row.count, row.leading, row.since] for row in rows])
        return arrays

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See ``SavedPart``; older checkpoints hold no undefined samples."""
        largest, final = np.reshape(arrays.get("watched", ()), (2, len(self.invariants)))
        self.largest, self.final = self._by_name(largest), self._by_name(final)
        self.put_back = self._by_name(arrays.get("put_back", ()))
        self.nearest_singularity, self.singularity_time = numbers(arrays, "singularity", 2)
        table = arrays.get("undefined", np.zeros((len(self.recorded), 3)))
        if table.shape != (len(self.recorded), 3):
            raise ValueError(f"the checkpoint counts undefined samples of shape {table.shape}")
        rows = zip(self.recorded, table.tolist(), strict=True)
        self.undefined = {name: Undefined(int(n), int(some), since) for name, (n, some, since) in rows if n}

    def _values(self, found: Mapping[str, float]) -> list[float]:
        """Values in the order of the invariants; nan for missing ones."""
        return [found.get(name, math.nan) for name in self.invariants]

    def _by_name(self, values: Iterable[float]) -> dict[str, float]:
        """Values by invariant, without missing ones."""
        pairs = zip(self.invariants, map(float, values), strict=False)  # older runs have none of some
        return {name: value for name, value in pairs if not math.isnan(value)}
