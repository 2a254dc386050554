"""The gravity gradient of a distant body (MacCullagh): torque, range of the potential energy, and source.

Positions of Sun and Moon are heyoka's analytic series: the Sun from VSOP2013 (Simon et al. 2013, A&A 557,
A49: the heliocentric place of the barycentre of Earth and Moon, reversed: it stands for the Earth's, 4,670 km
or 3e-5 of the distance away), the Moon from ELP2000 (Chapront-Touze & Chapront 1983), both in the mean
ecliptic and equinox of J2000, with time counted from J2000 (TDB). Terms below 1e-6 of the distance are left
out. With the barycentre the Sun's torque is right to 1e-4, the Moon's to some 3e-6. The series are explicit
functions of time in double precision, whatever the run's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics, inertia_times, seconds
from rigidsim.model.load import Term
from rigidsim.model.orbits.point_mass_states import PointMassPair
from rigidsim.model.rotations import Symbolic, transpose
from rigidsim.scene.arithmetic import Vector, cross, norm, unit_vectors
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene
from rigidsim.scene.tracing.numbers import plain

_THRESHOLD = 1e-6
_DAY = 86400.0


@dataclass(frozen=True)
class SourcePosition:
    """A geocentric direction and distance."""

    direction: list[Symbolic]  # unit vector, space axes
    inverse_distance: Symbolic  # mean distance over distance


MEAN_DISTANCE = {"sun": 149597870700, "moon": 384400000}  # m


def source_position(body: str, seconds: Symbolic) -> SourcePosition:
    """Position of the Sun ("sun") or the Moon ("moon") at a time in seconds since J2000, an expression."""
    if body == "sun":
        millennia = seconds * (1.0 / (_DAY * 365250.0))
        earth = hy.model.vsop2013_cartesian(3, time_expr=millennia, thresh=_THRESHOLD)
        position: list[Any] = [-x for x in earth[:3]]  # astronomical units
    else:
        centuries = seconds * (1.0 / (_DAY * 36525.0))
        kilometres = hy.model.elp2000_cartesian_e2000(time_expr=centuries, thresh=_THRESHOLD)
        position = [x * (1.0 / 384400.0) for x in kilometres]
    inverse = 1.0 / hy.sqrt(hy.sum([x * x for x in position]))
    return SourcePosition([x * inverse for x in position], inverse)


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
    units, columns = unit_vectors(m.scene.context), transpose(m.numbers.inertia)
    if m.shape is not None:
        turned = cross(direction, inertia_times(m, direction))
        scaled = [[3 * strength * x for x in unit] for unit in units]
        parts = turned if factor is None else [factor * x for x in turned]
        return list(zip(scaled, parts, strict=True))
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


@dataclass(frozen=True)
class GradientSource:
    """A distant attracting body; exactly one of five ways says where it is."""

    gravitational_parameter: Any  # m^3/s^2 (mpf)
    orbit: KeplerOrbit | None = None
    table: TabulatedOrbit | None = None
    position: Vector | None = None  # at rest, space axes, m (mpf)
    ephemeris: str | None = None  # name of its analytic series
    epoch: Epoch | None = None  # date of the scene's time 0, for the series
    pair: PointMassPair | None = None  # the point mass that it is, and the one that the body is

    def distance(self, context: Any) -> Any:
        """Semi-major axis (for a point mass that of the start, or the least distance of one that isn't
        bound), or distance of a source at rest, or mean distance of the series, m (mpf).
        """
        if self.orbit is not None:
            return self.orbit.semi_major_axis
        if self.table is not None:
            return self.table.semi_major_axis
        if self.ephemeris is not None:
            return context.mpf(MEAN_DISTANCE[self.ephemeris])
        if self.pair is not None:
            ellipse = self.pair.ellipse(context)
            return self.pair.encounter(context)[0] if ellipse is None else ellipse[0]
        assert self.position is not None
        return norm(context, self.position)

    def seen(self, m: Kinematics) -> tuple[list[Symbolic], Symbolic | None]:
        """Unit vector to a source other than a point mass, space axes; ``distance`` over a varying one."""
        context = m.scene.context
        if self.position is not None:
            length = norm(context, self.position)
            return m.fixed([x / length for x in self.position]), None
        if self.ephemeris is not None:
            series = source_position(self.ephemeris, seconds(m, since=self.epoch))
            return series.direction, series.inverse_distance
        place = m.orbit(self.orbit) if self.orbit is not None else m.table(m.carried(self.table))
        circular = self.orbit is not None and self.orbit.circular
        return place.direction, None if circular else place.inverse_distance

    def place(self, scene: Scene) -> Vector:
        """Place at the start (mpf, m, space axes) of a source other than a point mass; that of a series in
        double precision.
        """
        context = scene.context
        if self.orbit is not None:
            return self.orbit.place(context, scene.start)
        if self.table is not None:
            return self.table.place(scene.start)
        if self.ephemeris is not None:
            since = 0.0 if self.epoch is None else float(ExactNumber(self.epoch.since_j2000()))
            series = source_position(self.ephemeris, hy.time)
            function = hy.cfunc([*series.direction, series.inverse_distance], [], compact_mode=True)
            *direction, inverse = function([], time=float(plain(scene.start)) + since)
            far = self.distance(context) / context.mpf(inverse)
            return [far * context.mpf(x) for x in direction]
        assert self.position is not None
        return self.position
