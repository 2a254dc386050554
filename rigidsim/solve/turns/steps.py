"""Changes of angles from point to point, and turns that two samples and their rates determine.

Near a pole both outer Euler angles swing by up to half a turn at once, in opposite senses, while a + s c
(``rigidsim.model.euler_poles``) advances no faster than the body turns. So its change tells the turns of c
once those of a are chosen; chosen one by one, they may add up to a turn that nobody made.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import heyoka as hy
import numpy as np

from rigidsim.model.outputs import Recorded
from rigidsim.model.system import System
from rigidsim.scene.rotations import AXES, is_proper, parity
from rigidsim.solve.compiled import CompiledFunction
from rigidsim.solve.precision import precision_of

_NEAR = (
    0.5  # singular factor: between two points below it, on one side, the body turns by less than half a turn
)
_TURN = 2 * np.pi


@dataclass(frozen=True)
class Place:
    """A sample from which turns are counted, with the run's angles without turns, float64, internal units."""

    time: float
    state: np.ndarray
    angles: np.ndarray


def nearest(jumps: np.ndarray) -> np.ndarray:
    """Changes of angles reduced to half a turn."""
    return jumps - _TURN * np.rint(jumps / _TURN)


def at_poles(sequence: str, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether the outer angles' sum (1) or difference (-1) is regular at the nearer pole, and its factor."""
    sine, cosine = np.sin(middle), np.cos(middle)
    if is_proper(sequence):
        return np.copysign(1.0, cosine), np.abs(sine)
    return parity(*map(AXES.index, sequence[:2])) * np.copysign(1.0, sine), np.abs(cosine)


class AngleSteps:
    """Steps of the angles of some variables, of which those of Euler angles are taken together."""

    def __init__(self, variables: Sequence[Recorded]) -> None:
        ends = np.cumsum([r.count for r in variables]).tolist()
        firsts = [end - r.count for r, end in zip(variables, ends, strict=True)]
        self._split = [(i, r.poles.sequence) for i, r in zip(firsts, variables, strict=True) if r.poles]

    def jumps(self, angles: np.ndarray) -> np.ndarray:
        """Changes (n, angles) from each of n + 1 points to the next, to the nearest."""
        steps = np.diff(angles, axis=0)
        found = nearest(steps)
        for i, sequence in self._split:
            side, factor = at_poles(sequence, angles[:, i + 1])
            near = (np.maximum(factor[:-1], factor[1:]) < _NEAR) & (side[:-1] == side[1:])
            shared = nearest(steps[:, i] + side[1:] * steps[:, i + 2])
            off = side[1:] * (shared - found[:, i]) - found[:, i + 2]
            found[near, i + 2] += _TURN * np.rint(off[near] / _TURN)
        return found

    def turns(self, ahead: np.ndarray, angles: np.ndarray) -> np.ndarray:
        """Full turns (angles,) by which angles that were followed are ahead of the same within one turn."""
        off = (ahead - angles) / _TURN
        found = np.rint(off)
        for i, sequence in self._split:
            side, factor = at_poles(sequence, angles[i + 1])
            if factor < _NEAR:
                found[i + 2] = side * (np.rint(off[i] + side * off[i + 2]) - found[i])
        return found.astype(np.int64)


_OPEN = 0.5
"""Uncertainty (rad) allowed where a turn follows from rates: a sixth of what would miscount it."""


def advances_steadily(system: System, variable: Recorded) -> bool:
    """Whether rates determine the turns of a variable's angles between all samples."""
    if variable.steady is None:
        return False
    spacing = system.scene.samples.largest_spacing
    return variable.steady.uncertainty * spacing + variable.steady.excursion < _OPEN


class SteadyAngles:
    """Angles whose turns between samples follow from their rates."""

    def __init__(self, system: System, variables: list[Recorded]) -> None:
        self._variables = variables
        self._unit = system.scaling.time
        self._system = system
        self._function: CompiledFunction | None = None
        known = [(r.steady, r.count) for r in variables if r.steady is not None]
        self._uncertainty = np.concatenate([[steady.uncertainty] * count for steady, count in known])
        self._excursion = np.concatenate([[steady.excursion] * count for steady, count in known])

    def turns(self, before: Place, here: Place, sizes: np.ndarray) -> np.ndarray | None:
        """Full turns (angles,) from one sample to a later one; None if an angle is too near its pole."""
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
            names = {r.name for r in self._variables}
            found = [r.steady for r in system.recorded if r.name in names]
            rates = [rate for steady in found if steady is not None for rate in steady.rates]
            self._function = hy.cfunc(rates, system.variables, compact_mode=True)
        return np.asarray(self._function(np.ascontiguousarray(place.state), time=place.time))
