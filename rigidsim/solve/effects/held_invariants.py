"""When invariants are projected onto their initial values (``rigidsim.solve.projection``)."""

import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from rigidsim.solve.compiled import interruptible
from rigidsim.solve.effects.effect import Effect
from rigidsim.solve.projection import LATE, Projection
from rigidsim.solve.stepper import Stepper


class HeldInvariants(Effect):
    """Projection from the beginning, or from ``LATE`` steps on."""

    version = 2

    def __init__(self, projection: Projection, interval: int) -> None:
        self._projection, self._interval = projection, interval

    @property
    def limit(self) -> int:
        return self._interval if self._projection.begun or not self._projection.late else sys.maxsize

    def due(self, stepper: Stepper, stride: int) -> bool:
        """See ``Effect``: from the beginning each stride, later the most strides that fit the interval."""
        if not self._projection.late:
            return True
        if not self._projection.begun:
            return stepper.steps >= LATE
        return stepper.steps // stride % max(self._interval // stride, 1) == 0

    def apply(self, stepper: Stepper, stride: int) -> bool:
        projection = self._projection
        projection.use(stepper.chart)
        if projection.begun:
            projection.project(stepper.state, stepper.time)
        else:
            interruptible(lambda: projection.begin(stepper.state, stepper.time))
        return True

    @property
    def memory(self) -> np.ndarray:
        """See ``Effect``: a copy of ``Projection.memory``."""
        return self._projection.memory.copy()

    def back_to(self, memory: np.ndarray, stepper: Stepper) -> None:
        self._projection.memory[...] = memory

    def pack(self, memory: np.ndarray) -> dict[str, np.ndarray]:
        return {"rhythm_held": memory}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> np.ndarray:
        memory = arrays.get("rhythm_held", np.zeros(0))
        if memory.shape != self._projection.memory.shape:
            raise ValueError(f"the checkpoint remembers {memory.shape} numbers of projections")
        return memory

    def of_samples(self, times: np.ndarray) -> dict[str, Any]:
        """See ``Effect``: what was put back before a sample, by all corrections before its own step."""
        return {"put_back": self._projection.corrections}
