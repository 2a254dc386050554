"""A scene's constants in internal units, and the rounding that brings them to the working precision.

Every coefficient is worked out in the scene's arithmetic (mpmath with guard bits) and rounded once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.rotations import Symbolic, SymbolicMatrix
from rigidsim.model.scaling import Scaling
from rigidsim.scene.arithmetic import Matrix, Vector, norm
from rigidsim.scene.scene import Scene

Rounder = Callable[[Any], Any]
"""Rounds an mpf once to the working precision's scalar."""


@dataclass(frozen=True)
class ScaledNumbers:
    """The scene's constants in internal units (see ``Scaling``), as mpf.

    Attributes:
        inertia, inverse_inertia: 3x3.
        rate_units: the unit of each of the three body rates.
        arm: M com |g|, body axes: the potential energy is ``arm . vertical``; None without a torque.
        up: unit vector against gravity, space axes; None without gravity.
    """

    inertia: Matrix
    inverse_inertia: Matrix
    rate_units: Vector
    arm: Vector | None
    up: Vector | None

    def vertical_of(self, matrix: SymbolicMatrix, number: Rounder) -> list[Symbolic]:
        """Unit vector against gravity in body axes, R^T up."""
        assert self.up is not None
        terms = [[number(u) * matrix[i][k] for i, u in enumerate(self.up) if u != 0] for k in range(3)]
        return [hy.sum(column) for column in terms]


def scaled_numbers(scene: Scene, scaling: Scaling) -> ScaledNumbers:
    """Bring the scene's constants to internal units; powers of two only, so nothing is rounded."""
    context = scene.context
    one = context.one
    up = arm = None
    if scene.gravity is not None and any(g != 0 for g in scene.gravity):
        strength = norm(context, scene.gravity)
        up = [-g / strength for g in scene.gravity]
    if scene.torque_arm is not None:
        assert scene.gravity is not None
        strength = norm(context, scene.gravity)
        arm = [context.ldexp(a * strength, -scaling.energy) for a in scene.torque_arm]
    return ScaledNumbers(
        [[context.ldexp(x, -scaling.inertia) for x in row] for row in scene.body.inertia],
        [[context.ldexp(x, scaling.inertia) for x in row] for row in scene.inverse_inertia],
        [context.ldexp(one, e) for e in scaling.rates],
        arm,
        up,
    )


def unit_vectors(context: Any) -> Matrix:
    """The three unit vectors along the axes."""
    return [[context.one if i == j else context.zero for j in range(3)] for i in range(3)]
