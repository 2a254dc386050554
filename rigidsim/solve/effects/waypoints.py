"""A few of a run's step boundaries, spread evenly over it: its errors are followed from there."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rigidsim.solve.effects.effect import Effect
from rigidsim.solve.precision import Scalar
from rigidsim.solve.stepper import Stepper

_MOST = 32


@dataclass(frozen=True)
class Waypoint:
    """A step boundary, internal units."""

    steps: int
    time: float
    state: np.ndarray
    chart: int


@dataclass
class Waypoints(Effect):
    """Evenly spaced boundaries of corrections; the choice depends on the steps alone."""

    _kept: dict[int, Waypoint] = field(default_factory=dict)
    _spacing: int = 1

    def apply(self, stepper: Stepper, stride: int) -> bool:
        """See ``Effect``."""
        steps = stepper.steps
        self.note(steps // stride, steps, stepper.time, stepper.state, stepper.chart)
        return True

    def note(self, number: int, steps: int, time: Scalar, state: np.ndarray, chart: int) -> None:
        """Note the boundary of correction ``number``, unless it is there already."""
        if number % self._spacing:
            return
        # numbers of more than 80 bits aren't numpy's own
        plain = state.astype(np.float64) if state.dtype.kind == "f" else np.array([float(x) for x in state])
        self._kept[number] = Waypoint(steps, float(time), plain, chart)
        if len(self._kept) > _MOST:
            self._spacing *= 2
            self._kept = {n: kept for n, kept in self._kept.items() if n % self._spacing == 0}

    def between(self, first: float, last: float) -> list[Waypoint]:
        """Boundaries between two counts of steps, in order."""
        return sorted(
            (kept for kept in self._kept.values() if first <= kept.steps < last), key=lambda kept: kept.steps
        )
