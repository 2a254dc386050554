"""Distances between the attitudes of nearby states, without compiling anything if possible."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigidsim.model.state_blocks import AttitudeStates
from rigidsim.model.system import System
from rigidsim.solve.compiled import compiled_function

_AXES = "xyz"


@dataclass(frozen=True)
class AttitudeChords:
    """Coordinates of an attitude in which small angles are lengths.

    Attributes:
        of: function from states (states, lanes) to coordinates (n, lanes).
        angle: angle (rad) for a distance of 1.
    """

    of: Callable[[np.ndarray], np.ndarray]
    angle: float

    def between(self, states: np.ndarray) -> float:
        """Root mean square angle between the attitudes of all other lanes and that of the first."""
        found = self.of(states)
        apart = found[:, 1:] - found[:, :1]
        return self.angle * math.sqrt(float((apart**2).sum()) / apart.shape[1])


def attitude_chords(system: System) -> AttitudeChords | None:
    """Attitude coordinates of a system; None if it carries no attitude.

    A quaternion's chord is half the angle; nine direction cosines differ by its sqrt(2)-fold. Euler angles
    are turned into a quaternion; any other attitude is compiled (40 ms).
    """
    attitude, names = system.mechanics.attitude, system.states
    if attitude is None:
        return None
    if attitude.quaternion and all(x in system.variables for x in attitude.quaternion):
        places = [system.variables.index(x) for x in attitude.quaternion]
        return AttitudeChords(lambda states: states[places], 2.0)
    held = [names.index(name) for name in attitude.names] if attitude.orbital is None else []
    if held and attitude.chord is not None and not attitude.angles:
        return AttitudeChords(lambda states: states[held], attitude.chord)
    if held and attitude.sequence:
        return AttitudeChords(lambda states: _quaternion(attitude, states[held]), 2.0)
    compiled = compiled_function(attitude.quaternion, system.variables, compact_mode=True, opt_level=0)

    def evaluate(states: np.ndarray) -> np.ndarray:
        """Evaluate all lanes at one time: a frame that turns with time doesn't change their distances."""
        return compiled(np.ascontiguousarray(states), time=np.zeros(states.shape[1]))

    return AttitudeChords(evaluate, 2.0)


def _quaternion(attitude: AttitudeStates, angles: np.ndarray) -> np.ndarray:
    """Product of three rotations (4, lanes) about the axes of the sequence in turn."""
    cosines, sines = np.cos(angles / 2), np.sin(angles / 2)
    found = np.zeros((4, angles.shape[1]))
    found[0] = 1.0
    for axis, c, s in zip(attitude.sequence, cosines, sines, strict=True):
        n = _AXES.index(axis) + 1
        following, before = n % 3 + 1, (n + 1) % 3 + 1
        turned = c * found
        turned[0] -= s * found[n]
        turned[n] += s * found[0]
        turned[following] += s * found[before]
        turned[before] -= s * found[following]
        found = turned
    return found
