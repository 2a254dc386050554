"""The gravity gradient of a distant body (MacCullagh): torque, range of the potential energy, and source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rigidsim.model.kinematics import Kinematics, inertia_times
from rigidsim.model.load import Term
from rigidsim.model.orbits.point_mass_states import PointMassPair
from rigidsim.model.placements.placement import Placement
from rigidsim.model.rotations import Symbolic, transpose
from rigidsim.scene.arithmetic import cross, unit_vectors
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene


def tidal_range(scene: Scene, strength: Any, distance: Any) -> Any:
    """(3/2) (G M / R^3) (I_max - I_min): range of the gradient's potential energy at a distance, J."""
    moments = scene.body.principal_moments
    difference = scene.context.maximum(moments) - scene.context.minimum(moments)
    return 3 * strength / distance**3 * difference / 2


def gradient_terms(
    m: Kinematics, direction: list[Symbolic], strength: Any, factor: Symbolic | None = None
) -> list[Term]:
    """Torque 3 strength factor c x (I c) for a unit direction c in body axes (MacCullagh): the constant
    strength (mpf) becomes one coefficient with the moments, the factor is an expression.
    """
    if m.shape is not None:
        turned = cross(direction, inertia_times(m, direction))
        scaled = [[3 * strength * x for x in unit] for unit in unit_vectors(m.scene.context)]
        parts = turned if factor is None else [factor * x for x in turned]
        return list(zip(scaled, parts, strict=True))

    def element(a: int, j: int) -> Symbolic:
        product = direction[a] * direction[j]
        return product if factor is None else factor * product

    return tensor_terms(m, 3 * strength, element)


def tensor_terms(m: Kinematics, strength: Any, element: Callable[[int, int], Symbolic]) -> list[Term]:
    """Torque sum of strength S_aj e_a x (I e_j) of a symmetric tensor S in body axes, I being the constant
    tensor of inertia: the constant strength (mpf) becomes one coefficient with the moments.

    Args:
        element: S_aj, asked for where it has a torque.
    """
    units, columns = unit_vectors(m.scene.context), transpose(m.numbers.inertia)
    terms: list[Term] = []
    for a in range(3):
        for j in range(a, 3):
            vector = cross(units[a], columns[j])
            if j != a:
                vector = [x + y for x, y in zip(vector, cross(units[j], columns[a]), strict=True)]
            if any(x != 0 for x in vector):
                terms.append(([strength * x for x in vector], element(a, j)))
    return terms


@dataclass(frozen=True)
class GradientSource:
    """A distant attracting body, and how it is placed."""

    gravitational_parameter: Any  # m^3/s^2 (mpf)
    placement: Placement

    @property
    def orbit(self) -> KeplerOrbit | None:
        """The Kepler orbit that it is on, if any."""
        return self.placement.orbit

    @property
    def table(self) -> TabulatedOrbit | None:
        """The tabulated orbit that it is on, if any."""
        return self.placement.table

    @property
    def pair(self) -> PointMassPair | None:
        """The point mass that it is, if it is one."""
        return self.placement.pair
