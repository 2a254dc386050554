"""Statistics over all samples of a run, so that its end can be judged without reading them again."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from rigidsim.solve.checkpoint import Undefined


@dataclass
class SampleStatistics:
    """Statistics of the samples taken so far, in all sessions.

    Attributes:
        largest, final: largest and last relative drift by invariant.
        put_back: corrections put back into projected invariants before the latest sample.
        nearest_singularity: smallest absolute singular factor at a sample.
        singularity_time: time of that sample, s.
        angles_wrapped_from: time of the first sample whose angles are within one turn, since their turns
            aren't known, seconds; nan where all are.
        undefined: NaN samples by recorded variable that has any.
    """

    largest: dict[str, float] = field(default_factory=dict)
    final: dict[str, float] = field(default_factory=dict)
    put_back: dict[str, float] = field(default_factory=dict)
    nearest_singularity: float = math.inf
    singularity_time: float = math.nan
    angles_wrapped_from: float = math.nan
    undefined: dict[str, Undefined] = field(default_factory=dict)

    def see(self, invariant: str, drifts: np.ndarray) -> None:
        """Follow one invariant through a block of samples.

        Args:
            drifts: relative drifts, shape (samples,).
        """
        self.largest[invariant] = float(max(self.largest.get(invariant, 0.0), np.abs(drifts).max()))
        self.final[invariant] = float(drifts[-1])

    def see_undefined(self, variable: str, values: np.ndarray, first: int, times: np.ndarray) -> None:
        """Count the samples in a block at which a recorded variable is undefined.

        Args:
            values: shape (samples, components).
            first: index of the block's first sample.
            times: seconds, shape (samples,).
        """
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
        """Follow the distance from a formulation's singularity.

        Args:
            factors: singular factors, shape (samples,).
            times: seconds, same shape.
        """
        size = np.abs(factors.astype(np.float64))
        nearest = int(np.argmin(size))
        if size[nearest] < self.nearest_singularity:
            self.nearest_singularity = float(size[nearest])
            self.singularity_time = float(times[nearest])
