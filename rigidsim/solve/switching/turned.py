"""Full turns of Euler angles, and the quaternion's sign, which expressions may read.

The state alone doesn't give them: both are continued from step to step, and are parameters of the equations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigidsim.model.system import System
from rigidsim.scene.expressions.names import EULER_NAMES

MOST = 2.75
"""Largest angle (rad) that the body may turn from one continuation to the next: well below half a turn."""


@dataclass(frozen=True)
class Turned:
    """The angles with their full turns, and the quaternion with its sign, as of the latest step."""

    angles: list[float]
    quaternion: list[float]

    @classmethod
    def begun(cls, system: System, plain: Sequence[float], quaternion: Sequence[float]) -> Turned:
        """As the scene starts; ``plain`` angles are within one turn, and ``quaternion`` has either sign."""
        scene, names = system.scene, system.plan.surfaces.turning
        begun = dict(zip(EULER_NAMES, scene.euler_angles or (), strict=False))
        asked = [float(begun.get(name, angle)) for name, angle in zip(names, plain, strict=True)]
        given = [float(x) for x in scene.quaternion] if quaternion else []
        return cls(asked, given).followed(plain, quaternion)

    def parameters(self, plain: Sequence[float], quaternion: Sequence[float]) -> list[float]:
        """Full turns to be added to the plain angles, then the quaternion's sign if there is one: the nearest
        continuation.
        """
        turns = [float(np.rint((b - a) / math.tau)) for a, b in zip(plain, self.angles, strict=True)]
        if not quaternion:
            return turns
        return [*turns, 1.0 if np.dot(quaternion, self.quaternion) >= 0 else -1.0]

    @classmethod
    def by(cls, plain: Sequence[float], quaternion: Sequence[float], parameters: Sequence[float]) -> Turned:
        """From plain values and the ``parameters`` there."""
        angles = [a + math.tau * n for a, n in zip(plain, parameters, strict=False)]
        return cls(angles, [parameters[-1] * x for x in quaternion])

    def followed(self, plain: Sequence[float], quaternion: Sequence[float]) -> Turned:
        """Continued to plain angles and a quaternion."""
        return self.by(plain, quaternion, self.parameters(plain, quaternion))
