"""The plane that obliquity and longitudes count from, as expressions: fixed in space, or a source's own.

Longitudes count from X turned by the smallest rotation that takes Z to the plane's normal n,

    X' = X - n_x (Z + n) / (1 + n_z),    Y' = Y - n_y (Z + n) / (1 + n_z)

(and X itself where n = -Z), so that nothing jumps while a plane moves. Space axes of an ephemeris have the
equinox as X.

The mean ecliptic of date: its pole is (P, -Q, sqrt(1 - P^2 - Q^2)) in the ecliptic and equinox of J2000, with
P = sin(pi_A) sin(Pi_A) and Q = sin(pi_A) cos(Pi_A) from Capitaine, Wallace & Chapront 2003 (A&A 412, 567:
the precession of the ecliptic of IAU 2006).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.kinematics import seconds
from rigidsim.model.load import Load
from rigidsim.model.loads.moving_source import MovingSource
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic, constant
from rigidsim.model.two_part import as_factor
from rigidsim.scene.arithmetic import Vector, cross
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.frame import ORBIT
from rigidsim.scene.records import dataclass
from rigidsim.scene.scene import Scene

_CENTURY = 36525 * 86400
_ARCSEC = ExactNumber(Fraction(1, 3600 * 180), pi_power=1)
_P = ("4.199094", "0.1939873", "-0.00022466", "-0.000000912", "0.0000000120")
_Q = ("-46.811015", "0.0510283", "0.00052413", "-0.000000646", "-0.0000000172")
"""Arcseconds by powers of centuries (TDB) from J2000, the first on."""
_ECLIPTIC_DRIFT = 1e-12  # rad/s; 0.47 arcsec a year are 7e-14


@dataclass(frozen=True)
class ReferencePlane:
    """Right-handed unit vectors, space axes.

    Attributes:
        first: from which longitudes count.
        normal: from which obliquities count.
        described: which plane it is.
    """

    first: list[Symbolic]
    second: list[Symbolic]
    normal: list[Symbolic]
    described: str

    def components(self, vector: list[Symbolic]) -> list[Symbolic]:
        """Of a vector in space axes, along the plane's own."""
        return [
            hy.sum([a * b for a, b in zip(axis, vector, strict=True)])
            for axis in (self.first, self.second, self.normal)
        ]


def refuse_without_plane(scene: Scene, loads: Sequence[Load]) -> None:
    """Look whether there is the plane that ``[frame] reference`` names.

    Raises:
        ConfigError: "orbit" in a scene without one.
    """
    if scene.reference is None:
        _source(scene, loads)


def flies_in_plane(scene: Scene, loads: Sequence[Any]) -> bool:
    """Whether the plane is that of the body's own flight."""
    return scene.reference is None and _source(scene, loads).attracting_point is not None


def reference_plane(m: Mechanics) -> ReferencePlane:
    """The plane that ``[frame] reference`` names, see above.

    Raises:
        ConfigError: "orbit" in a scene without one.
    """
    scene, context = m.scene, m.scene.context
    if scene.reference is not None:
        described = "XY plane of the space axes"
        if not isinstance(scene.config.frame.reference, str):
            given = ", ".join(context.nstr(x, 17) for x in scene.reference)
            described = f"plane with the normal [{given}] in space axes"
        return fixed_plane(m, scene.reference, described)
    load = _source(scene, m.loads)
    if load.orbit is not None:
        orbit = load.orbit
        described = "plane of the source's orbit"
        if orbit.node_rate == 0:
            return fixed_plane(m, _normal_of(context, orbit.inclination, orbit.ascending_node), described)
        return _moving(m.orbit(orbit).normal, described + ", whose node moves")
    if isinstance(load, MovingSource):
        return _moving(load.orbit_normal(m), "osculating plane of the source's orbit")
    if load.table is not None:
        return _moving(m.table(load.table).normal, "plane of the source's orbit, by its table")
    if load.attracting_point is not None:
        return _moving(flight_normal(m, load.attracting_point), "osculating plane of the body's own orbit")
    return _moving(_ecliptic_of_date(m), "mean ecliptic of date (IAU 2006)")


def initial_normal(scene: Scene, loads: Sequence[Any]) -> Vector:
    """About where the normal points at the start (mpf, space axes), not of unit length."""
    context = scene.context
    if scene.reference is not None:
        return scene.reference
    load = _source(scene, loads)
    if load.orbit is not None:
        orbit = load.orbit
        node = orbit.ascending_node + orbit.node_rate * scene.start
        return _normal_of(context, orbit.inclination, node)
    if load.table is not None:
        normal: Vector = load.table.normal(scene.start)
        return normal
    if isinstance(load, MovingSource):
        return load.starting_normal(scene)
    if load.attracting_point is not None and scene.position is not None and scene.velocity is not None:
        offset = [x - a for x, a in zip(scene.position, load.attracting_point, strict=True)]
        return cross(offset, scene.velocity)
    return [context.zero, context.zero, context.one]


def plane_drift(scene: Scene, loads: Sequence[Any]) -> Any | None:
    """Bound of the rate (rad/s) at which the plane turns; None where none is known."""
    if scene.reference is not None:
        return scene.context.zero
    load = _source(scene, loads)
    if load.orbit is not None:
        return abs(load.orbit.node_rate)
    if load.table is not None:
        return load.table.normal_drift
    if isinstance(load, MovingSource):
        return None
    return None if load.attracting_point is not None else scene.context.mpf(_ECLIPTIC_DRIFT)


def _normal_of(context: Any, inclination: Any, node: Any) -> Vector:
    sine, cosine = context.sin(inclination), context.cos(inclination)
    return [sine * context.sin(node), -sine * context.cos(node), cosine]


def _source(scene: Scene, loads: Sequence[Any]) -> Any:
    """The first load with a plane of its own."""
    for load in loads:
        ephemeris = getattr(load, "ephemeris", None)
        placed = (load.orbit, load.table, load.attracting_point)
        if any(x is not None for x in placed) or isinstance(load, MovingSource) or ephemeris == "sun":
            return load
    what = f'given "{ORBIT}", but no load of the scene has an orbit whose plane is known'
    if any(getattr(load, "ephemeris", None) == "moon" for load in loads):
        what += " (the series of the Moon alone names none)"
    raise ConfigError(Problem("[frame] reference", what + '; "space" or a normal [x, y, z] is allowed'))


def fixed_plane(m: Mechanics, normal: Vector, described: str) -> ReferencePlane:
    """The plane with a fixed unit normal (mpf, space axes); worked out exactly, and rounded once."""
    context = m.scene.context
    x, y, z = normal
    one, zero = context.one, context.zero
    level = x == 0 and y == 0
    first = [one, zero, zero] if level else [one - x * x / (1 + z), -x * y / (1 + z), -x]
    axes = (first, cross(normal, first), normal)
    first, second, normal = ([as_factor(m.number(a)) for a in axis] for axis in axes)
    return ReferencePlane(first, second, normal, described)


def _moving(normal: list[Symbolic], described: str) -> ReferencePlane:
    x, y, z = normal
    inverse = 1.0 / (1.0 + z)
    cross_term = -(x * y * inverse)
    first = [1.0 - x * x * inverse, cross_term, -x]
    second = [cross_term, 1.0 - y * y * inverse, -y]
    return ReferencePlane(first, second, normal, described)


def flight_normal(m: Mechanics, point: Vector) -> list[Symbolic]:
    """Unit vector along r x v about an attracting point, space axes."""
    context, scaling = m.scene.context, m.scaling
    offset = []
    for x, a in zip(m.carried(m.position), point, strict=True):
        shift = context.ldexp(a, -scaling.length)
        offset.append(x - m.number(shift) if shift != 0 else x)
    found = cross(offset, m.carried(m.velocity))
    size = hy.sqrt(hy.sum([c * c for c in found]))
    return [c / size for c in found]


def _ecliptic_of_date(m: Mechanics) -> list[Symbolic]:
    context, epoch = m.scene.context, m.scene.epoch
    since = seconds(m)
    if epoch is not None:
        start = ExactNumber(epoch.since_j2000()).at(context)
        since = since + m.number(start) if start != 0 else since
    centuries = since * m.number(context.one / _CENTURY)

    def series(terms: tuple[str, ...]) -> Symbolic:
        total: Any = constant(0.0)
        for term in reversed(terms):
            total = (total + m.number(context.mpf(term) * _ARCSEC.at(context))) * centuries
        return total

    p, q = series(_P), series(_Q)
    return [p, -q, hy.sqrt(1.0 - p * p - q * q)]
