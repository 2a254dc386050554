"""The body and a point mass that moves beside it, as two masses left to themselves: their osculating orbit.

It is that of the start. Others perturb it; how much, is told by the size of their tide against the mutual
attraction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rigidsim.scene.arithmetic import Vector, cross, norm
from rigidsim.scene.point_masses import PointMasses


@dataclass(frozen=True)
class PointMassPair:
    """A point mass as seen from the one that the body is.

    Attributes:
        masses: all point masses; one of them is the body's host.
        number: index of the other.
    """

    masses: PointMasses
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

    def semi_major_axis(self, context: Any) -> Any | None:
        """Semi-major axis, m (mpf); None if they aren't bound to each other."""
        speed = norm(context, self._moving)
        inverse = 2 / norm(context, self.place) - speed * speed / self._attraction
        return 1 / inverse if inverse > 0 else None

    def eccentricity(self, context: Any) -> float:
        """Eccentricity of the ellipse of a bound pair."""
        axis = self.semi_major_axis(context)
        assert axis is not None
        momentum = norm(context, cross(self.place, self._moving))
        squared = 1 - momentum * momentum / (self._attraction * axis)
        return float(context.sqrt(squared)) if squared > 0 else 0.0

    def mean_motion(self, context: Any) -> float:
        """Mean motion of a bound pair, rad/s."""
        axis = self.semi_major_axis(context)
        assert axis is not None
        return float(context.sqrt(self._attraction / axis) / axis)

    def encounter(self, context: Any) -> tuple[Any, Any]:
        """Least distance (m) and the angular rate there (rad/s), mpf."""
        return self.masses.encounter(context, self.host, self.number)

    def perturbation(self, context: Any) -> float:
        """Sum of the accelerations by which the other masses change the relative motion, each with its own
        sign left out, over the mutual attraction.
        """
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
