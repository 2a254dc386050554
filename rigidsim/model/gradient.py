"""The torque of a gravity gradient (MacCullagh), whatever its source, and the range of its potential
energy.
"""

from __future__ import annotations

from typing import Any

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Term
from rigidsim.model.numbers import unit_vectors
from rigidsim.model.rotations import Symbolic, transpose
from rigidsim.scene.arithmetic import cross
from rigidsim.scene.scene import Scene
from rigidsim.scene.tracing.numbers import largest_of, smallest_of


def tidal_range(scene: Scene, strength: Any, distance: Any) -> Any:
    """(3/2) (G M / R^3) (I_max - I_min): range of the gradient's potential energy at a distance, J."""
    moments = scene.body.principal_moments
    return 3 * strength / distance**3 * (largest_of(moments) - smallest_of(moments)) / 2


def gradient_terms(
    m: Kinematics, direction: list[Symbolic], strength: Any, factor: Symbolic | None = None
) -> list[Term]:
    """Torque 3 strength factor c x (I c) for a unit direction c in body axes (MacCullagh).

    Args:
        strength: constant part (mpf), which becomes one coefficient with the moments.
        factor: its varying part, as an expression.
    """
    inertia = m.numbers.inertia
    units = unit_vectors(m.scene.context)
    columns = transpose(inertia)
    terms: list[Term] = []
    for a in range(3):
        for j in range(a, 3):
            vector = cross(units[a], columns[j])
            if j != a:
                vector = [x + y for x, y in zip(vector, cross(units[j], columns[a]), strict=True)]
            if any(x != 0 for x in vector):
                product = direction[a] * direction[j]
                scaled = [3 * strength * x for x in vector]
                terms.append((scaled, product if factor is None else factor * product))
    return terms
