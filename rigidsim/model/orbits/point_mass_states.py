"""Point masses under mutual gravity, carried as states beside the body, and the orbit of one about it.

    x_i' = v_i,    v_i' = sum over j of G M_j (x_j - x_i) / |x_j - x_i|^3,

in the units of length and speed of the scene's flight. Where the coupling is full they feel the body's shape
as well: what a load makes of the body's velocity is taken off theirs in proportion to the masses.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import heyoka as hy

from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder, Scaling
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.arithmetic import Vector, cross, norm
from rigidsim.scene.point_masses import PointMasses

_AXES = "xyz"
Pull = tuple[int, Any, list[Symbolic]]
"""Acceleration of a mass (by index), speed over time: a number (mpf) times expressions."""


class PointMassStates:
    """Point masses' states as expressions."""

    def __init__(self, masses: PointMasses, scaling: Scaling, context: Any, number: Rounder) -> None:
        self.masses, self._scaling, self._context, self._number = masses, scaling, context, number

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

    def _accelerations(self, pulls: Sequence[Pull]) -> list[list[Symbolic]]:
        scaling, strengths = self._scaling, self.masses.strengths
        shift = scaling.time - scaling.speed - 2 * scaling.length
        terms: list[list[list[Symbolic]]] = [[[], [], []] for _ in self.masses.names]
        for (i, j), inverse in self.inverse_distances.items():
            place, cubed = self.between(i, j), inverse * inverse * inverse
            own, others = (self._number(self._context.ldexp(strengths[n], shift)) for n in (i, j))
            for a, x in enumerate(place):
                terms[i][a].append(others * (x * cubed))
                terms[j][a].append(-own * (x * cubed))
        for n, factor, pull in pulls:
            for a, x in enumerate(pull):
                terms[n][a].append(x if factor == 1 else self._number(factor) * x)
        return [list(map(hy.sum, three)) for three in terms]

    def relative(self, i: int, j: int) -> tuple[list[Symbolic], list[Symbolic], list[Symbolic]]:
        """Place, velocity and acceleration of mass j as seen from mass i under the mutual gravity of points,
        internal units of length and time.
        """
        scaling = self._scaling
        exponent = scaling.speed + scaling.time - scaling.length
        ratio = self._number(self._context.ldexp(self._context.one, exponent))
        pulled = self._accelerations(())
        pairs = (self.velocities[i], self.velocities[j]), (pulled[i], pulled[j])
        moving = [[ratio * (b - a) for a, b in zip(*pair, strict=True)] for pair in pairs]
        return self.between(i, j), moving[0], moving[1]

    def block(self, pulls: Sequence[Pull] = ()) -> StateBlock:
        """One block with the states of all masses, which feel these pulls of the body's shape."""
        context, scaling, masses = self._context, self._scaling, self.masses
        ratio = self._number(context.ldexp(context.one, scaling.speed + scaling.time - scaling.length))
        names: list[str] = []
        derivatives: list[Symbolic] = []
        initial: list[Any] = []
        accelerations = self._accelerations(pulls)
        for n, name in enumerate(masses.names):
            names += [f"{name}_{x}" for x in _AXES] + [f"{name}_v{x}" for x in _AXES]
            derivatives += [ratio * v for v in self.velocities[n]] + accelerations[n]
            initial += [context.ldexp(x, -scaling.length) for x in masses.positions[n]]
            initial += [context.ldexp(v, -scaling.speed) for v in masses.velocities[n]]
        exponents = ([scaling.length] * 3 + [scaling.speed] * 3) * len(masses.names)
        why = "[[bodies]]: point masses under mutual gravity"
        if pulls:
            why += ", and gravity of the body's shape"
        return StateBlock(names, derivatives, initial, exponents=exponents, why=why)


# --- a pair left to itself ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class PointMassPair:
    """A point mass as seen from the one that the body is."""

    masses: PointMasses  # one of them is the body's host
    number: int

    @property
    def name(self) -> str:
        """Name of the point mass."""
        return self.masses.names[self.number]

    @property
    def host(self) -> int:
        """Index of the one that the body is."""
        assert self.masses.host is not None
        return self.masses.host

    @property
    def place(self) -> Vector:
        """Vector from the body to the point mass at the start, m (mpf)."""
        here, there = self.masses.positions[self.host], self.masses.positions[self.number]
        return [a - b for a, b in zip(there, here, strict=True)]

    @property
    def _moving(self) -> Vector:
        here, there = self.masses.velocities[self.host], self.masses.velocities[self.number]
        return [a - b for a, b in zip(there, here, strict=True)]

    @property
    def _attraction(self) -> Any:
        """Sum of both gravitational parameters, m^3/s^2."""
        return self.masses.strengths[self.host] + self.masses.strengths[self.number]

    def ellipse(self, context: Any) -> tuple[Any, float, float] | None:
        """Semi-major axis (m, mpf), eccentricity and mean motion (rad/s) of a bound pair, or None."""
        speed = norm(context, self._moving)
        inverse = 2 / norm(context, self.place) - speed * speed / self._attraction
        if not inverse > 0:
            return None
        axis, momentum = 1 / inverse, norm(context, cross(self.place, self._moving))
        squared = 1 - momentum * momentum / (self._attraction * axis)
        e = float(context.sqrt(squared)) if squared > 0 else 0.0
        return axis, e, float(context.sqrt(self._attraction / axis) / axis)

    def encounter(self, context: Any) -> tuple[Any, Any]:
        """Least distance (m) and the angular rate there (rad/s), mpf."""
        return self.masses.encounter(context, self.host, self.number)

    def perturbation(self, context: Any) -> float:
        """Sum of the sizes of what other masses change the relative motion by, over the mutual attraction."""
        distance, total = norm(context, self.place), 0.0
        for other, strength in enumerate(self.masses.strengths):
            if other in (self.host, self.number):
                continue
            pulls = [self._pull(context, mass, other) for mass in (self.host, self.number)]
            tide = [a - b for a, b in zip(*pulls, strict=True)]
            total += float(strength * norm(context, tide) * distance**2 / self._attraction)
        return total

    def _pull(self, context: Any, mass: int, other: int) -> Vector:
        """Acceleration of one mass by another one of unit strength, 1/m^2."""
        ends = self.masses.positions[mass], self.masses.positions[other]
        towards = [b - a for a, b in zip(*ends, strict=True)]
        cubed = norm(context, towards) ** 3
        return [x / cubed for x in towards]
