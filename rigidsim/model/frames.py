"""Frames besides the space and body axes: the reference plane, the local frame, and the rotating one.

The reference plane of obliquities and longitudes is fixed in space, or a source's orbital plane. Longitudes
count from X turned by the smallest rotation that takes Z to the plane's normal n,

    X' = X - n_x (Z + n) / (1 + n_z),    Y' = Y - n_y (Z + n) / (1 + n_z)

(and X itself where n = -Z), so that nothing jumps while a plane moves. Space axes of an ephemeris have the
equinox as X.

The local frame of a body and its source: z to the source, y against the orbit's normal, x horizontal, which
on a circular orbit is forward. The normal is that of

- a prescribed orbit: its own plane's, which moves with the node;
- free flight about an attracting point: r x v, the osculating plane's;
- an ephemeris: the pole of the ecliptic (space Z), less its part along z;
- a source at rest, which has no orbit: space Z in the same way, or X where the source lies along Z.

If there are several sources, the first in the config counts. (Hughes, Spacecraft Attitude Dynamics, 1986,
ch. 9; Wertz, Spacecraft Attitude Determination and Control, 1978, ch. 2.)

The frame that turns with a circular orbit has Jacobi's constant H = w . I w / 2 - n o . I w + U, with o the
orbit's normal and n its mean motion. U may come from any number of sources on circles of one plane and one
period, plus any potential that the frame's turning doesn't change, such as a uniform field's along o.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem, required
from rigidsim.model.load import Load, loads_of
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.placements import OrbitPlane, flight_plane, kepler_plane, table_plane
from rigidsim.model.probing import keeps
from rigidsim.model.rotations import Symbolic, along, apply, transpose, unit
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Matrix, Vector, cross, negligible, norm, parallel
from rigidsim.scene.arithmetic import apply as multiply
from rigidsim.scene.frame import ORBIT
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene
from rigidsim.scene.starts import (
    STARTS,
    InitialRotation,
    angle_out_of_range,
    attitude_from_pole,
    from_equator,
    meridian,
)


@dataclass(frozen=True)
class ReferencePlane:
    """Reference plane as right-handed unit vectors, space axes."""

    first: list[Symbolic]  # from which longitudes count
    second: list[Symbolic]
    normal: list[Symbolic]  # from which obliquities count
    described: str  # which plane it is

    def components(self, vector: list[Symbolic]) -> list[Symbolic]:
        """Components along the plane's axes of a vector in space axes."""
        return [along(axis, vector) for axis in (self.first, self.second, self.normal)]


def refuse_without_plane(scene: Scene, loads: Sequence[Load]) -> None:
    """Refuse a scene that lacks the plane named by ``[frame] reference``."""
    if scene.reference is None:
        _orbit_plane(loads)


def flies_in_plane(scene: Scene, loads: Sequence[Load]) -> bool:
    """Whether the plane is the plane of the body's own flight."""
    return scene.reference is None and _orbit_plane(loads).flown


def reference_plane(m: Mechanics) -> ReferencePlane:
    """The plane named by ``[frame] reference``."""
    scene, context = m.scene, m.scene.context
    if scene.reference is not None:
        described = "XY plane of the space axes"
        if not isinstance(scene.config.frame.reference, str):
            given = ", ".join(context.nstr(x, 17) for x in scene.reference)
            described = f"plane with the normal [{given}] in space axes"
        return fixed_plane(m, scene.reference, described)
    return orbit_plane(m, m.loads)


def orbit_plane(m: Mechanics, loads: Sequence[Load]) -> ReferencePlane:
    """The plane of the first load that has one."""
    plane = _orbit_plane(loads)
    if plane.drift == 0:
        return fixed_plane(m, plane.at_start(m.scene), plane.described)
    return _moving(plane.normal(m), plane.described)


def initial_normal(scene: Scene, loads: Sequence[Load]) -> Vector:
    """Approximate normal at the start (mpf, space axes), not of unit length."""
    return scene.reference if scene.reference is not None else _orbit_plane(loads).at_start(scene)


def initial_plane(scene: Scene, load: Load) -> Matrix:
    """X', Y' and the unit normal (mpf) of the plane of a load's source at the start."""
    normal = _orbit_plane([load]).at_start(scene)
    size = norm(scene.context, normal)
    return plane_axes(scene.context, [x / size for x in normal])


def plane_drift(scene: Scene, loads: Sequence[Load]) -> Any | None:
    """Bound of the rate (rad/s) at which the plane turns; None if unknown."""
    return scene.context.zero if scene.reference is not None else _orbit_plane(loads).drift


def plane_of(load: Load | None) -> OrbitPlane | None:
    """Plane in which its source moves, or the body about its source; None if there is none."""
    if load is None or load.plane is not None:
        return None if load is None else load.plane
    if load.orbit is not None:
        return kepler_plane(load.orbit)
    if load.table is not None:
        return table_plane(load.table)
    return None if load.attracting_point is None else flight_plane(load.attracting_point)


def _orbit_plane(loads: Sequence[Load]) -> OrbitPlane:
    """Plane of the first load that has one."""
    for load in loads:
        if (plane := plane_of(load)) is not None:
            return plane
    what = f'given "{ORBIT}", but no load of the scene has an orbit whose plane is known'
    why = next((x.without_plane for x in loads if x.without_plane), "")
    what += f" ({why})" if why else ""
    raise ConfigError(Problem("[frame] reference", what + '; "space" or a normal [x, y, z] is allowed'))


def fixed_plane(m: Mechanics, normal: Vector, described: str) -> ReferencePlane:
    """A plane with a fixed unit normal (mpf, space axes); worked out exactly and rounded once."""
    first, second, normal = map(m.fixed, plane_axes(m.scene.context, normal))
    return ReferencePlane(first, second, normal, described)


def plane_axes(context: Any, normal: Vector) -> Matrix:
    """X', Y' and the unit normal (mpf) of a plane."""
    x, y, z = normal
    one, zero = context.one, context.zero
    level = x == 0 and y == 0
    first = [one, zero, zero] if level else [one - x * x / (1 + z), -x * y / (1 + z), -x]
    return [first, cross(normal, first), normal]


def _moving(normal: list[Symbolic], described: str) -> ReferencePlane:
    x, y, z = normal
    inverse = 1.0 / (1.0 + z)
    cross_term = -(x * y * inverse)
    first = [1.0 - x * x * inverse, cross_term, -x]
    second = [cross_term, 1.0 - y * y * inverse, -y]
    return ReferencePlane(first, second, normal, described)


_SLOW = 2
"""Turns per revolution up to which a scene is taken to be about the attitude in orbit."""


@dataclass(frozen=True)
class LocalFrame:
    """Axes of the local frame as unit vectors in body axes."""

    down: list[Symbolic]  # z, towards the source
    normal: list[Symbolic]  # the orbit's, -y
    described: str  # what the source and the normal are

    @property
    def forward(self) -> list[Symbolic]:
        """Forward axis x = y x z."""
        x: list[Symbolic] = cross(self.down, self.normal)
        return x


def first_source(loads: Iterable[Load]) -> Load | None:
    """The load whose source defines the local frame; None if no load has a source."""
    return next((load for load in loads if load.has_source), None)


def flies_about_source(scene: Scene) -> bool:
    """Whether the source's direction follows from the body's own flight."""
    load = first_source(loads_of(scene))
    plane = plane_of(load)
    return plane is not None and plane.flown


def local_frame(m: Mechanics) -> LocalFrame:
    """The local frame of the first source."""
    load = m.carried(first_source(m.loads))
    down = m.carried(load.source_direction(m))
    normal, described = _normal(m, load, down)
    return LocalFrame(down, normal, f"source: {load.title}, number {m.loads.index(load) + 1}; {described}")


def moves_slowly_in_orbit(m: Mechanics) -> bool:
    """Whether the body starts with at most two turns per revolution, on a prescribed orbit or in flight."""
    plane = plane_of(first_source(m.loads))
    rate = None if plane is None else plane.rate(m.scene)
    return rate is not None and bool(norm(m.scene.context, m.scene.angular_velocity) <= _SLOW * rate)


def _normal(m: Mechanics, load: Load, down: list[Symbolic]) -> tuple[list[Symbolic], str]:
    plane = plane_of(load)
    if plane is not None and plane.called:
        return apply(transpose(m.matrix), plane.normal(m)), plane.called
    which, described = 2, "space Z, across the source's direction, as the normal"
    fixed = load.fixed_source(m.scene)
    if fixed is not None and all(x == 0 for x in fixed[1][:2]):
        which, described = 0, "space X as the normal"
    pole = m.matrix[which]
    part = along(pole, down)
    return unit([a - part * b for a, b in zip(pole, down, strict=True)]), described


# --- the frame that turns with a circular orbit -------------------------------------------------------------


def rotating_orbit(m: Mechanics) -> KeplerOrbit | None:
    """An orbit with whose frame all potentials turn; None if there is none."""
    orbits = [orbit for load in m.turning if (orbit := load.corotating_orbit) is not None]
    if not orbits or m.driven_within:
        return None
    context, first = m.scene.context, orbits[0]
    normal = first.normal(context)
    if not all(
        orbit.mean_motion == first.mean_motion and parallel(context, normal, orbit.normal(context))
        for orbit in orbits[1:]
    ):
        return None
    others = [load for load in m.turning if load.corotating_orbit is None]
    if not all(load.conservative for load in others) or not keeps(m, normal, others):
        return None
    return first


def jacobi_constant(m: Mechanics) -> Symbolic:
    """H, internal units of energy."""
    orbit, context = m.carried(rotating_orbit(m)), m.scene.context
    motion = context.ldexp(orbit.mean_motion, m.scaling.time)
    pairs = zip(orbit.normal(context), m.momentum_space, strict=True)
    carried = [m.number(motion * o) * x for o, x in pairs if o != 0]
    potentials = [m.carried(load.potential(m)) for load in m.turning]
    return m.rotational(kept=True) - hy.sum(carried) + reduce(add, potentials)


# --- starts against the reference plane ---------------------------------------------------------------------


def _from_obliquity(scene: Scene) -> InitialRotation:
    """The attitude of the node on the reference plane and of the obliquity, as the observables."""
    table, context = scene.config.initial, scene.context
    tilt, node = (required(x).at(context) for x in (table.obliquity, table.node_longitude))
    if not 0 <= tilt <= context.pi * (1 + negligible(context)):
        raise angle_out_of_range("obliquity", "", context, tilt, "0 to 180 deg")
    normal = initial_normal(scene, loads_of(scene))
    length = norm(context, normal)
    columns = transpose(plane_axes(context, [x / length for x in normal]))
    to_space = attitude.quaternion_from_matrix(context, columns)
    quaternion = attitude.product(to_space, attitude_from_pole(scene, node, tilt, context.zero))
    if table.prime_meridian is not None:
        w, x, y, z = equator = from_equator(scene, "prime_meridian")
        inside = attitude.rotation_matrix(attitude.product([w, -x, -y, -z], quaternion))
        east, north, up = multiply(inside, scene.figure.pole)
        node, tilt = context.atan2(east, -north), context.atan2(context.hypot(east, north), up)
        quaternion = attitude.product(equator, attitude_from_pole(scene, node, tilt, meridian(scene)))
    return InitialRotation(attitude.unit_quaternion(context, quaternion))


STARTS["obliquity"] = _from_obliquity
