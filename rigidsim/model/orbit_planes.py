# ruff: noqa: D102 (methods are those of OrbitPlane)
"""Orbital planes of sources or of the body itself: normals as expressions and at the start, and their drift.

``rigidsim.model.frames.plane_of`` says which a load has. The mean ecliptic of date has its pole at
(P, -Q, sqrt(1 - P^2 - Q^2)) in the ecliptic and equinox of J2000, with P = sin(pi_A) sin(Pi_A) and
Q = sin(pi_A) cos(Pi_A) from Capitaine, Wallace & Chapront 2003 (A&A 412, 567: the ecliptic of IAU 2006).
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics, seconds
from rigidsim.model.rotations import Symbolic, constant, unit
from rigidsim.scene.arithmetic import Vector, cross, norm
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene

_CENTURY = 36525 * 86400
_ARCSEC = ExactNumber(Fraction(1, 3600 * 180), pi_power=1)
_P = ("4.199094", "0.1939873", "-0.00022466", "-0.000000912", "0.0000000120")
_Q = ("-46.811015", "0.0510283", "0.00052413", "-0.000000646", "-0.0000000172")
"""Arcseconds, coefficients of ascending powers of centuries (TDB) from J2000, beginning with the first."""
_ECLIPTIC_DRIFT = 1e-12  # rad/s; 0.47 arcsec a year are 7e-14


class OrbitPlane:
    """Plane of a load's source; all vectors returned are in space axes."""

    described: str  # where angles are measured from it
    called: str = ""  # its normal in a local frame; empty if the source doesn't stay in the plane
    flown: bool = False  # whether it is the plane of the body's own flight

    @abstractmethod
    def normal(self, m: Kinematics) -> list[Symbolic]:
        """Unit normal about which the motion is direct (counterclockwise)."""

    @abstractmethod
    def at_start(self, scene: Scene) -> Vector:
        """Approximate normal at the start (mpf), not of unit length."""

    @abstractmethod
    def drift(self, scene: Scene) -> Any | None:
        """Bound of the rate (rad/s) at which the normal turns; None if unknown."""

    def fixed(self, scene: Scene) -> Vector | None:
        """The unit normal (mpf) if it never turns; None otherwise."""
        return None

    def rate(self, scene: Scene) -> Any | None:
        """Angular rate (mpf, rad/s) of the motion in the plane, or its mean; None if unknown."""
        return None


@dataclass(frozen=True)
class KeplerPlane(OrbitPlane):
    """Plane of a prescribed Kepler orbit, whose node may move."""

    orbit: KeplerOrbit
    called = "normal of its orbit"

    @property
    def described(self) -> str:  # type: ignore[override]
        return "plane of the source's orbit" + (", whose node moves" if self.orbit.node_rate != 0 else "")

    def normal(self, m: Kinematics) -> list[Symbolic]:
        return m.orbit(self.orbit).normal

    def at_start(self, scene: Scene) -> Vector:
        turned = self.orbit.node_rate * scene.start
        return replace(self.orbit, ascending_node=self.orbit.ascending_node + turned).normal(scene.context)

    def fixed(self, scene: Scene) -> Vector | None:
        return None if self.orbit.node_rate != 0 else self.orbit.normal(scene.context)

    def drift(self, scene: Scene) -> Any:
        return abs(self.orbit.node_rate)

    def rate(self, scene: Scene) -> Any:
        return abs(self.orbit.mean_motion)


@dataclass(frozen=True)
class TablePlane(OrbitPlane):
    """Plane of a tabulated orbit."""

    table: TabulatedOrbit
    described = "plane of the source's orbit, by its table"
    called = "normal of its orbit, by its table"

    def normal(self, m: Kinematics) -> list[Symbolic]:
        return m.table(self.table).normal

    def at_start(self, scene: Scene) -> Vector:
        return list(self.table.normal(scene.start))

    def drift(self, scene: Scene) -> Any:
        return self.table.normal_drift

    def rate(self, scene: Scene) -> Any:
        return abs(self.table.mean_motion)


@dataclass(frozen=True)
class FlightPlane(OrbitPlane):
    """Plane of the body's own flight about an attracting point (mpf, m, space axes): normal r x v."""

    point: Vector
    described = "osculating plane of the body's own orbit"
    called = "normal of the osculating orbit"
    flown = True

    def normal(self, m: Kinematics) -> list[Symbolic]:
        return unit(cross(m.offset_from(self.point), m.carried(m.velocity)))

    def at_start(self, scene: Scene) -> Vector:
        if scene.position is None or scene.velocity is None:
            return [scene.context.zero, scene.context.zero, scene.context.one]
        return cross(self._offset(scene.position), scene.velocity)

    def drift(self, scene: Scene) -> None:
        return None

    def rate(self, scene: Scene) -> Any | None:
        if scene.position is None or scene.velocity is None:
            return None
        place = self._offset(scene.position)
        return norm(scene.context, cross(place, scene.velocity)) / sum(x * x for x in place)

    def _offset(self, position: Vector) -> Vector:
        return [x - a for x, a in zip(position, self.point, strict=True)]


class EclipticPlane(OrbitPlane):
    """Mean ecliptic of date, in which the Sun of the analytic series moves except for perturbations."""

    described = "mean ecliptic of date (IAU 2006)"

    def normal(self, m: Kinematics) -> list[Symbolic]:
        context = m.scene.context
        centuries = seconds(m, since=m.scene.epoch) * m.number(context.one / _CENTURY)

        def series(terms: tuple[str, ...]) -> Symbolic:
            total: Any = constant(0.0)
            for term in reversed(terms):
                total = (total + m.number(context.mpf(term) * _ARCSEC.at(context))) * centuries
            return total

        p, q = series(_P), series(_Q)
        return [p, -q, hy.sqrt(1.0 - p * p - q * q)]

    def at_start(self, scene: Scene) -> Vector:
        return [scene.context.zero, scene.context.zero, scene.context.one]

    def drift(self, scene: Scene) -> Any:
        return scene.context.mpf(_ECLIPTIC_DRIFT)
