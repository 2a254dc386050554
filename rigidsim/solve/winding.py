"""Euler angles kept small inside a run, with their full turns counted.

Angles that grow without bound loosen heyoka's step control, which is relative to the largest component;
so they are brought back into (-pi, pi] every few steps, and the turns are counted.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rigidsim.solve.precision import Precision

TURNS, CHART, ANGLES = slice(0, 3), 3, slice(4, 7)
"""What stands where in ``Winding.turns``: full turns of the angle states, the chart that they are of (0: the
asked sequence, 1: its partner), and in the partner chart the bits of the asked angles (float64, rad; see
``rigidsim.solve.charts``)."""

_LENGTH = 7

INTERVAL = 32
"""Steps between two corrections: a fixed count of natural steps, so that bits don't depend on timing."""


class Winding:
    """Full turns of the angle states so far.

    Attributes:
        turns: int64, shape (7,), see ``TURNS``; (0,) without angles.
    """

    def __init__(self, positions: tuple[int, ...], precision: Precision, context: Any) -> None:
        self.positions = list(positions)
        self.turns = np.zeros(_LENGTH if positions else 0, dtype=np.int64)
        self._precision = precision
        # 2 pi in two parts: n times the first is exact for small n, the second carries what it lacks
        pi2 = 2 * context.pi
        bits = precision.bits - 8
        whole = context.floor(context.ldexp(pi2, bits - 3))
        high = context.ldexp(whole, 3 - bits)
        self._high = precision.number(high)
        self._low = precision.number(pi2 - high)

    def wrap(self, state: np.ndarray) -> None:
        """Bring the angles of ``state`` into (-pi, pi], in place."""
        for n, position in enumerate(self.positions):
            turns = int(np.rint(float(state[position]) / (2 * np.pi)))
            if turns:
                count = self._precision.indices(turns, turns + 1)[0]
                scalar = self._precision.scalar
                count = count if not self._precision.narrow else scalar(count)
                state[position] = (state[position] - count * self._high) - count * self._low
                self.turns[n] += turns

    def unwrapped(self, angles: np.ndarray, turns: np.ndarray) -> np.ndarray:
        """Angles (n, 3) plus 2 pi times turns (n, 3), rounded in the run's precision."""
        counts = turns.astype(np.float64)
        counts = counts if self._precision.bits == 53 else counts.astype(self._precision.scalar)
        return (angles + counts * self._low) + counts * self._high
