"""The rotating body as a part of a system of equations: names of its states, its momentum and its energy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.scene.arithmetic import Matrix, negligible


@dataclass(frozen=True)
class RotatingBody:
    """A body that turns: everything that is named after it, or follows from its inertia and rates.

    Attributes:
        prefix: begins the names of its states, which tells several bodies apart; empty for the scene's.
    """

    prefix: str = ""

    @property
    def rates(self) -> list[str]:
        """States of the angular velocity, body axes."""
        return self._named("wx", "wy", "wz")

    @property
    def vertical(self) -> list[str]:
        """States of the unit vector against gravity, body axes."""
        return self._named("gx", "gy", "gz")

    @property
    def quaternion(self) -> list[str]:
        """States of the attitude as a quaternion, scalar part first."""
        return self._named("qw", "qx", "qy", "qz")

    @property
    def position(self) -> list[str]:
        """States of the position of the centre of mass, space axes."""
        return self._named("x", "y", "z")

    @property
    def velocity(self) -> list[str]:
        """States of its velocity."""
        return self._named("vx", "vy", "vz")

    def _named(self, *names: str) -> list[str]:
        return [self.prefix + name for name in names]

    def momentum(
        self, inertia: Matrix, rates: list[Symbolic], number: Rounder, context: Any
    ) -> list[Symbolic]:
        """Angular momentum I w, body axes, internal units; moments that are only rounding are left out."""
        least = context.maximum([abs(x) for row in inertia for x in row]) * negligible(context)
        rows = []
        for row in inertia:
            terms = [number(x) * w for x, w in zip(row, rates, strict=True) if abs(x) > least]
            rows.append(hy.sum(terms) if terms else hy.expression(0.0))
        return rows

    def energy(self, rates: list[Symbolic], momentum: list[Symbolic]) -> Symbolic:
        """Kinetic energy of rotation w . I w / 2."""
        return 0.5 * hy.sum([w * x for w, x in zip(rates, momentum, strict=True)])


BODY = RotatingBody()
"""The body of the scene."""
