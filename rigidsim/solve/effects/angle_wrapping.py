"""Euler angles kept small inside a run, with their full turns counted.

Angles that grow without bound loosen heyoka's step control, which is relative to the largest component;
so they are brought back into (-pi, pi] every few steps, and the turns are counted.
"""

import math
from collections.abc import Mapping
from typing import Any

import mpmath
import numpy as np

from rigidsim.solve.effects.effect import Effect
from rigidsim.solve.precision import Precision
from rigidsim.solve.sample_block import AngleState, pack_angles, unpack_angles
from rigidsim.solve.stepper import Stepper

STEPS_BETWEEN = 32
"""Natural steps from one wrapping to the next: a fixed count, so that bits don't depend on timing."""


class AngleWrapping(Effect):
    """Counts the full turns removed from the angle states, whose unit is 2^unit rad."""

    def __init__(
        self, positions: tuple[int, ...], precision: Precision, context: mpmath.MPContext, unit: int = 0
    ) -> None:
        self.positions = list(positions)
        self.angles = AngleState((0, 0, 0), 0, (0.0, 0.0, 0.0)) if positions else AngleState()
        self._precision = precision
        # 2 pi in two parts: n times the first is exact for small n, the second carries what it lacks
        pi2 = 2 * context.pi
        bits = precision.bits - 8
        whole = context.floor(context.ldexp(pi2, bits - 3))
        high = context.ldexp(whole, 3 - bits)
        self._high = precision.number(high)
        self._low = precision.number(pi2 - high)
        self._turn = math.ldexp(2 * math.pi, -unit)
        self._turn_parts = tuple(precision.number(context.ldexp(x, -unit)) for x in (high, pi2 - high))

    def wrap(self, state: np.ndarray) -> None:
        """Bring the angles of ``state`` into (-pi, pi], in place."""
        scalar = self._precision.scalar
        counted = list(self.angles.turns)
        for n, position in enumerate(self.positions):
            turns = int(np.rint(float(state[position]) / self._turn))
            if turns:
                count = self._precision.indices(turns, turns + 1)[0]
                count = scalar(count) if self._precision.narrow else count
                high, low = self._turn_parts
                state[position] = (state[position] - count * high) - count * low
                counted[n] += turns
        self.angles = self.angles._replace(turns=tuple(counted))

    @property
    def limit(self) -> int:
        return STEPS_BETWEEN

    def apply(self, stepper: Stepper, stride: int) -> bool:
        self.wrap(stepper.state)
        return True

    @property
    def memory(self) -> AngleState:
        return self.angles

    def back_to(self, memory: AngleState, stepper: Stepper) -> None:
        self.angles = memory

    def pack(self, memory: AngleState) -> dict[str, np.ndarray]:
        return {"rhythm_turns": pack_angles([memory])[0]}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> AngleState:
        [angles] = unpack_angles(arrays.get("rhythm_turns", np.zeros(0, dtype=np.int64))[None, :])
        if len(angles.turns) != len(self.angles.turns):
            raise ValueError("the checkpoint has other angles")
        return angles

    def of_samples(self, times: np.ndarray) -> dict[str, Any]:
        return {"angles": self.angles}

    def unwrapped(self, angles: np.ndarray, turns: np.ndarray) -> np.ndarray:
        """Angles (n, 3) plus 2 pi times turns (n, 3), rounded in the run's precision."""
        counts = turns.astype(np.float64)
        counts = counts if self._precision.bits == 53 else counts.astype(self._precision.scalar)
        return (angles + counts * self._low) + counts * self._high
