"""Orbital planes of sources or of the body itself: normals as expressions and at the start, and their drift.

``rigidsim.model.frames.plane_of`` says which a load has. The mean ecliptic of date has its pole at
(P, -Q, sqrt(1 - P^2 - Q^2)) in the ecliptic and equinox of J2000, with P = sin(pi_A) sin(Pi_A) and
Q = sin(pi_A) cos(Pi_A) from Capitaine, Wallace & Chapront 2003 (A&A 412, 567: the ecliptic of IAU 2006).
"""

from __future__ import annotations

from collections.abc import Callable
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


@dataclass(frozen=True)
class OrbitPlane:
    """Plane of a load's source; all vectors are in space axes.

    Attributes:
        normal: unit normal about which the motion is direct (counterclockwise).
        at_start: approximate normal at the start (mpf), not of unit length unless it never turns.
        described: where angles are measured from it.
        called: its normal in a local frame; empty if the source doesn't stay in the plane.
        drift: bound of the rate (rad/s) at which the normal turns; None if unknown, 0 if it never does.
        rate: angular rate (mpf, rad/s) of the motion in the plane, or its mean; None if unknown.
        flown: whether it is the plane of the body's own flight.
    """

    normal: Callable[[Kinematics], list[Symbolic]]
    at_start: Callable[[Scene], Vector]
    described: str
    called: str = ""
    drift: Any | None = None
    rate: Callable[[Scene], Any | None] = lambda _: None
    flown: bool = False


def kepler_plane(orbit: KeplerOrbit) -> OrbitPlane:
    """Plane of a prescribed Kepler orbit, whose node may move."""

    def at_start(scene: Scene) -> Vector:
        turned = orbit.node_rate * scene.start
        return replace(orbit, ascending_node=orbit.ascending_node + turned).normal(scene.context)

    described = "plane of the source's orbit" + (", whose node moves" if orbit.node_rate != 0 else "")
    return OrbitPlane(
        lambda m: m.orbit(orbit).normal, at_start, described, "normal of its orbit",
        abs(orbit.node_rate), lambda _: abs(orbit.mean_motion),
    )  # fmt: skip


def table_plane(table: TabulatedOrbit) -> OrbitPlane:
    """Plane of a tabulated orbit."""
    return OrbitPlane(
        lambda m: m.table(table).normal, lambda scene: list(table.normal(scene.start)),
        "plane of the source's orbit, by its table", "normal of its orbit, by its table",
        table.normal_drift, lambda _: abs(table.mean_motion),
    )  # fmt: skip


def flight_plane(point: Vector) -> OrbitPlane:
    """Plane of the body's own flight about an attracting point (mpf, m): normal r x v."""

    def at_start(scene: Scene) -> Vector:
        if scene.position is None or scene.velocity is None:
            return [scene.context.zero, scene.context.zero, scene.context.one]
        return cross([x - a for x, a in zip(scene.position, point, strict=True)], scene.velocity)

    def rate(scene: Scene) -> Any | None:
        if scene.position is None:
            return None
        squared = sum((x - a) ** 2 for x, a in zip(scene.position, point, strict=True))
        return norm(scene.context, at_start(scene)) / squared

    return OrbitPlane(
        lambda m: unit(cross(m.offset_from(point), m.carried(m.velocity))), at_start,
        "osculating plane of the body's own orbit", "normal of the osculating orbit", rate=rate, flown=True,
    )  # fmt: skip


def ecliptic_plane() -> OrbitPlane:
    """Mean ecliptic of date, in which the Sun of the analytic series moves except for perturbations."""

    def normal(m: Kinematics) -> list[Symbolic]:
        context = m.scene.context
        centuries = seconds(m, since=m.scene.epoch) * m.number(context.one / _CENTURY)

        def series(terms: tuple[str, ...]) -> Symbolic:
            total: Any = constant(0.0)
            for term in reversed(terms):
                total = (total + m.number(context.mpf(term) * _ARCSEC.at(context))) * centuries
            return total

        p, q = series(_P), series(_Q)
        return [p, -q, hy.sqrt(1.0 - p * p - q * q)]

    return OrbitPlane(
        normal, lambda scene: [scene.context.zero, scene.context.zero, scene.context.one],
        "mean ecliptic of date (IAU 2006)", drift=_ECLIPTIC_DRIFT,
    )  # fmt: skip
