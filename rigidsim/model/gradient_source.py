"""The source of a gravity gradient, as averages and the equations in paired products know it."""

from __future__ import annotations

from typing import Any

from rigidsim.model.orbits.ephemeris import MEAN_DISTANCE
from rigidsim.scene.arithmetic import Vector, norm
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.records import dataclass


@dataclass(frozen=True)
class GradientSource:
    """Where a distant attracting body is: exactly one of the four places is given.

    Attributes:
        gravitational_parameter: m^3/s^2 (mpf).
        orbit: that it moves on.
        table: by which its orbit goes.
        position: where it rests, space axes, m (mpf).
        ephemeris: name of its series.
        epoch: time 0 of the scene, for the series.
    """

    gravitational_parameter: Any
    orbit: KeplerOrbit | None = None
    table: TabulatedOrbit | None = None
    position: Vector | None = None
    ephemeris: str | None = None
    epoch: Epoch | None = None

    def distance(self, context: Any) -> Any:
        """Semi-major axis, or the distance of a source at rest, or the mean one of the series, m (mpf)."""
        if self.orbit is not None:
            return self.orbit.semi_major_axis
        if self.table is not None:
            return self.table.semi_major_axis
        if self.ephemeris is not None:
            return context.mpf(MEAN_DISTANCE[self.ephemeris])
        assert self.position is not None
        return norm(context, self.position)
