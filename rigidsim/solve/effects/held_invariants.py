"""When invariants are projected onto their initial values (``rigidsim.solve.projection``)."""

import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from rigidsim.solve.compiled import interruptible
from rigidsim.solve.effects.effect import Effect
from rigidsim.solve.projection import LATE, NOTED, Projection
from rigidsim.solve.stepper import Stepper


class HeldInvariants(Effect):
    """Projection from the beginning, or from ``LATE`` steps on, until when states are noted."""

    def __init__(self, projection: Projection, interval: int) -> None:
        self._projection, self._interval = projection, interval

    @property
    def limit(self) -> int:
        return self._interval if self._projection.holding else sys.maxsize

    def due(self, stepper: Stepper, stride: int) -> bool:
        """See ``Effect``: from the beginning each stride, later the most strides that fit the interval."""
        if not self._projection.holding:
            return stepper.steps >= LATE or stepper.steps % NOTED == 0
        strides = max(self._interval // stride, 1) if self._projection.late else 1
        return stepper.steps // stride % strides == 0

    def apply(self, stepper: Stepper, stride: int) -> bool:
        projection, state, time = self._projection, stepper.state, stepper.time
        projection.use(stepper.chart)
        if projection.holding:
            projection.project(state, time)
        elif stepper.steps >= LATE:
            interruptible(projection.load)
            projection.begin(state, time)
        else:
            projection.note(state, time, stepper.steps // NOTED - 1)
        return True

    @property
    def memory(self) -> np.ndarray:
        """See ``Effect``: a copy of ``Projection.memory``."""
        return self._projection.memory.copy()

    def back_to(self, memory: np.ndarray, stepper: Stepper) -> None:
        self._projection.memory[...] = memory

    def pack(self, memory: np.ndarray) -> dict[str, np.ndarray]:
        return {"rhythm_held": memory, "late_projection": np.ones(1, dtype=np.int64)}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> np.ndarray:
        memory = arrays.get("rhythm_held", np.zeros(0))
        if memory.shape != self._projection.memory.shape:
            raise ValueError(f"the checkpoint remembers {memory.shape} numbers of projections")
        return memory

    def of_samples(self, times: np.ndarray) -> dict[str, Any]:
        """See ``Effect``: what was put back before a sample, by all corrections before its own step."""
        return {"put_back": self._projection.corrections}
