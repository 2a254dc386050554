"""A few of a run's step boundaries, spread evenly over it: its errors are followed from there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rigidsim.solve.effects.effect import Effect
from rigidsim.solve.precision import Scalar
from rigidsim.solve.stepper import Stepper

_MOST = 32

Kept = tuple[Mapping[int, "Waypoint"], int]
"""Waypoints by number of their correction, and the spacing of those numbers."""


@dataclass(frozen=True)
class Waypoint:
    """A step boundary, internal units."""

    steps: int
    time: float
    state: np.ndarray
    chart: int


class Waypoints(Effect):
    """Evenly spaced boundaries of corrections; the choice depends on the steps alone."""

    memory: Kept = {}, 1

    def apply(self, stepper: Stepper, stride: int) -> bool:
        steps = stepper.steps
        self.note(steps // stride, steps, stepper.time, stepper.state, stepper.chart)
        return True

    def note(self, number: int, steps: int, time: Scalar, state: np.ndarray, chart: int) -> None:
        """Note the boundary of correction ``number``."""
        kept, spacing = self.memory
        if number % spacing:
            return
        # numbers of more than 80 bits aren't numpy's own
        plain = state.astype(np.float64) if state.dtype.kind == "f" else np.array([float(x) for x in state])
        kept = {**kept, number: Waypoint(steps, float(time), plain, chart)}
        if len(kept) > _MOST:
            spacing *= 2
            kept = {n: waypoint for n, waypoint in kept.items() if n % spacing == 0}
        self.memory = kept, spacing

    def back_to(self, memory: Kept, stepper: Stepper) -> None:
        self.memory = memory

    def pack(self, memory: Kept) -> dict[str, np.ndarray]:
        kept, spacing = memory
        rows = [(number, spacing, found.steps, found.chart) for number, found in kept.items()]
        places = [[found.time, *found.state] for found in kept.values()]
        return {"waypoints": np.array(rows, dtype=np.int64), "waypoint_states": np.array(places)}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> Kept:
        """See ``Effect``; an earlier version saved none."""
        rows, places = arrays.get("waypoints", np.zeros((0, 4))), arrays.get("waypoint_states", np.zeros(0))
        found = {
            number: Waypoint(steps, time, np.array(state), chart)
            for (number, _, steps, chart), (time, *state) in zip(rows.tolist(), places.tolist(), strict=True)
        }
        return found, int(rows[0, 1]) if len(rows) else 1

    def between(self, first: float, last: float) -> list[Waypoint]:
        """Boundaries between two counts of steps, in order."""
        kept = self.memory[0].values()
        return sorted((found for found in kept if first <= found.steps < last), key=lambda found: found.steps)
