"""The source of a gravity gradient, as averages use it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rigidsim.model.orbits.ephemeris import MEAN_DISTANCE
from rigidsim.model.orbits.point_mass_pair import PointMassPair
from rigidsim.scene.arithmetic import Vector, norm
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit


@dataclass(frozen=True)
class GradientSource:
    """Position of a distant attracting body; exactly one of the five ways to give it is used.

    Attributes:
        gravitational_parameter: m^3/s^2 (mpf).
        orbit: Kepler orbit on which it moves.
        table: tabulated orbit on which it moves.
        position: fixed position, space axes, m (mpf).
        ephemeris: name of its analytic series.
        epoch: date of the scene's time 0, for the series.
        pair: the point mass that it is, and the one that the body is.
    """

    gravitational_parameter: Any
    orbit: KeplerOrbit | None = None
    table: TabulatedOrbit | None = None
    position: Vector | None = None
    ephemeris: str | None = None
    epoch: Epoch | None = None
    pair: PointMassPair | None = None

    def distance(self, context: Any) -> Any:
        """Semi-major axis (that of the start for a point mass, or else the least distance of one that isn't
        bound), distance of a source at rest, or mean distance of the series, m (mpf).
        """
        if self.orbit is not None:
            return self.orbit.semi_major_axis
        if self.table is not None:
            return self.table.semi_major_axis
        if self.ephemeris is not None:
            return context.mpf(MEAN_DISTANCE[self.ephemeris])
        if self.pair is not None:
            axis = self.pair.semi_major_axis(context)
            return self.pair.encounter(context)[0] if axis is None else axis
        assert self.position is not None
        return norm(context, self.position)
