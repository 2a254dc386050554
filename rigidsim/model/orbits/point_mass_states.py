"""Point masses under mutual gravity, carried as states beside the body.

    x_i' = v_i,    v_i' = sum over j of G M_j (x_j - x_i) / |x_j - x_i|^3,

in the units of length and speed of the scene's flight. Where the coupling is full they feel the body's shape
as well: what a load makes of the body's velocity is taken off theirs in proportion to the masses.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import heyoka as hy

from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder, Scaling
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.point_masses import PointMasses

_AXES = "xyz"


class PointMassStates:
    """Point masses' states as expressions.

    Attributes:
        masses: the point masses with their initial conditions.
    """

    def __init__(self, masses: PointMasses, scaling: Scaling, context: Any, number: Rounder) -> None:
        self.masses, self._scaling, self._context, self._number = masses, scaling, context, number
        self._pulls: list[tuple[int, Any, list[Symbolic]]] = []

    @cached_property
    def positions(self) -> list[list[Symbolic]]:
        """Position of each mass, space axes, internal units of length."""
        return [list(hy.make_vars(*(f"{name}_{x}" for x in _AXES))) for name in self.masses.names]

    @cached_property
    def velocities(self) -> list[list[Symbolic]]:
        """Velocity of each mass, space axes, internal units of speed."""
        return [list(hy.make_vars(*(f"{name}_v{x}" for x in _AXES))) for name in self.masses.names]

    @cached_property
    def inverse_distances(self) -> dict[tuple[int, int], Symbolic]:
        """Inverse distance of each pair (i, j), i < j, internal units."""
        found, count = {}, len(self.masses.names)
        for i in range(count):
            for j in range(i + 1, count):
                place = self.between(i, j)
                found[i, j] = 1.0 / hy.sqrt(hy.sum([x * x for x in place]))
        return found

    def between(self, i: int, j: int) -> list[Symbolic]:
        """Vector from mass i to mass j, internal units of length."""
        return [b - a for a, b in zip(self.positions[i], self.positions[j], strict=True)]

    def react(self, pulls: list[tuple[int, Any, list[Symbolic]]]) -> None:
        """Add accelerations besides the mutual attraction of the points.

        Args:
            pulls: accelerations of some masses as a number (mpf) times expressions in units of speed over
                time.
        """
        self._pulls = pulls

    def _accelerations(self) -> list[list[Symbolic]]:
        scaling, strengths = self._scaling, self.masses.strengths
        shift = scaling.time - scaling.speed - 2 * scaling.length
        terms: list[list[list[Symbolic]]] = [[[], [], []] for _ in self.masses.names]
        for (i, j), inverse in self.inverse_distances.items():
            place, cubed = self.between(i, j), inverse * inverse * inverse
            own, others = (self._number(self._context.ldexp(strengths[n], shift)) for n in (i, j))
            for a, x in enumerate(place):
                terms[i][a].append(others * (x * cubed))
                terms[j][a].append(-own * (x * cubed))
        for n, factor, pull in self._pulls:
            for a, x in enumerate(pull):
                terms[n][a].append(x if factor == 1 else self._number(factor) * x)
        return [[hy.sum(found) if found else hy.expression(0.0) for found in three] for three in terms]

    def block(self) -> StateBlock:
        """One block with the states of all masses."""
        context, scaling, masses = self._context, self._scaling, self.masses
        ratio = self._number(context.ldexp(context.one, scaling.speed + scaling.time - scaling.length))
        names: list[str] = []
        derivatives: list[Symbolic] = []
        initial: list[Any] = []
        accelerations = self._accelerations()
        for n, name in enumerate(masses.names):
            names += [f"{name}_{x}" for x in _AXES] + [f"{name}_v{x}" for x in _AXES]
            derivatives += [ratio * v for v in self.velocities[n]] + accelerations[n]
            initial += [context.ldexp(x, -scaling.length) for x in masses.positions[n]]
            initial += [context.ldexp(v, -scaling.speed) for v in masses.velocities[n]]
        exponents = ([scaling.length] * 3 + [scaling.speed] * 3) * len(masses.names)
        why = "[[bodies]]: point masses under mutual gravity"
        if self._pulls:
            why += ", and that of the body's shape"
        return StateBlock(names, derivatives, initial, exponents=exponents, why=why)
