"""Changes of angles from point to point, and the turn that outer Euler angles share near their poles.

Near a pole both outer angles swing by up to half a turn at once, in opposite senses, while a + s c
(``rigidsim.model.euler_poles``) advances no faster than the body turns. So its change tells the turns of c
once those of a are chosen; chosen one by one, they may add up to a turn that nobody made.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigidsim.model.outputs import Recorded
from rigidsim.scene.attitude import AXES, parity
from rigidsim.scene.rotations import is_proper

_NEAR = (
    0.5  # singular factor: between two points below it, on one side, the body turns by less than half a turn
)
_TURN = 2 * np.pi


def nearest(jumps: np.ndarray) -> np.ndarray:
    """Changes of angles reduced to half a turn."""
    return jumps - _TURN * np.rint(jumps / _TURN)


def at_poles(sequence: str, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether the sum (1) or the difference (-1) of the outer Euler angles is regular at the nearer pole, and
    the factor that vanishes there.

    Args:
        middle: middle angles, rad.
    """
    sine, cosine = np.sin(middle), np.cos(middle)
    if is_proper(sequence):
        return np.copysign(1.0, cosine), np.abs(sine)
    return parity(*map(AXES.index, sequence[:2])) * np.copysign(1.0, sine), np.abs(cosine)


class AngleSteps:
    """Steps of the angles of some variables, of which those of Euler angles are taken together.

    Args:
        variables: variables that consist of angles, in the order of their columns.
    """

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
