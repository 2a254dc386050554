"""Turns of angles that advance so steadily that two samples and their rates determine them."""

from __future__ import annotations

import math

import heyoka as hy
import numpy as np

from rigidsim.model.outputs import Recorded
from rigidsim.model.system import System
from rigidsim.solve.compiled import CompiledFunction
from rigidsim.solve.precision import precision_of
from rigidsim.solve.turns.count import Place

_OPEN = 0.5
"""Uncertainty (rad) allowed where a turn follows from rates: a sixth of what would miscount it."""


def advances_steadily(system: System, variable: Recorded) -> bool:
    """Whether rates determine the turns of a variable's angles between all samples."""
    if variable.steady is None:
        return False
    spacing = system.scene.samples.largest_spacing
    return variable.steady.uncertainty * spacing + variable.steady.excursion < _OPEN


class SteadyAngles:
    """Angles whose turns between samples follow from their rates.

    Args:
        variables: variables that have ``Recorded.steady``.
    """

    def __init__(self, system: System, variables: list[Recorded]) -> None:
        self.variables = variables
        self._unit = system.scaling.time
        self._system = system
        self._function: CompiledFunction | None = None
        known = [(r.steady, r.count) for r in variables if r.steady is not None]
        self._uncertainty = np.concatenate([[steady.uncertainty] * count for steady, count in known])
        self._excursion = np.concatenate([[steady.excursion] * count for steady, count in known])

    def turns(self, before: Place, here: Place, sizes: np.ndarray) -> np.ndarray | None:
        """Full turns (angles,) from one sample to a later one; None if an angle is too near its pole.

        Args:
            sizes: sizes of the angles' sines and cosines at the later sample.
        """
        time = here.time - before.time
        left_open = self._uncertainty * math.ldexp(time, self._unit) + self._excursion
        if not (left_open < _OPEN * np.minimum(sizes, 1.0)).all():
            return None
        advance = time * (self._rates(before) + self._rates(here)) / 2
        return np.rint((before.angles + advance - here.angles) / (2 * math.pi)).astype(np.int64)

    def _rates(self, place: Place) -> np.ndarray:
        """Rates of the angles, rad per internal unit of time."""
        if self._function is None:
            system = self._system.rounded(precision_of("double").number)
            names = {r.name for r in self.variables}
            found = [r.steady for r in system.recorded if r.name in names]
            rates = [rate for steady in found if steady is not None for rate in steady.rates]
            self._function = hy.cfunc(rates, system.variables, compact_mode=True)
        return np.asarray(self._function(np.ascontiguousarray(place.state), time=place.time))
