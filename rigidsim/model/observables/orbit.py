"""Attitude relative to an orbit: roll, pitch and yaw, libration, and the direction of the source.

With c the direction to the source and o the orbit's normal in body axes, and R the matrix whose rows are the
local frame's axes in body axes,

    R = Rz(yaw) Ry(pitch) Rx(roll),   roll = atan2(c_y, c_z),   pitch = -asin(c_x),   yaw = atan2(-o_x, x_x)

with x = c x o. On a circular orbit a satellite at rest in the local frame has all three zero.

Libration of the long axis l (the principal axis of smallest moment): in the plane atan2(l . x, l . c),
positive forward, and out of it asin(l . o), positive to the normal's side. (Hughes, Spacecraft Attitude
Dynamics, 1986, ch. 9; Beletskii, Motion of an Artificial Satellite about its Center of Mass, 1966, ch. 2.)

**Point masses** that move besides the body have positions, velocities, and what their motion conserves. On
their own (coupling "one_way") they conserve energy, momentum and angular momentum; if they feel the body
("full"), the whole system does. Masses in kg are G M / G, where G is chosen so that the host's mass is the
body's own, or is CODATA's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import heyoka as hy

from rigidsim.model.frames import local_frame, moves_slowly_in_orbit
from rigidsim.model.loads.surface_load import Drag
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.mechanical import rotational_scale
from rigidsim.model.observables.observable import (
    BODY,
    SPACE,
    Angle,
    Observable,
    continuous_angles,
    lacking,
    same_unit,
)
from rigidsim.model.rotations import Symbolic, along
from rigidsim.model.scaling import exponent
from rigidsim.model.sources import RELATIVE_NAMES, FlightNames, flown_about
from rigidsim.scene.arithmetic import Vector, cross, norm
from rigidsim.scene.frame import unique_axis
from rigidsim.scene.point_masses import PointMasses


def roll_pitch_yaw(m: Mechanics) -> list[Angle]:
    """3-2-1 angles from the local frame to body axes."""
    frame = local_frame(m)
    c, o = frame.down, frame.normal
    level = hy.sqrt(c[1] * c[1] + c[2] * c[2])
    return [Angle(c[1], c[2]), Angle(-c[0], level), Angle(-o[0], frame.forward[0])]


def libration(m: Mechanics) -> list[Angle]:
    """Libration angles of the long axis, in the orbit's plane and out of it."""
    frame = local_frame(m)
    axis = m.fixed(m.carried(unique_axis(m.scene.body, m.scene.context, largest=False)))
    x, z = along(axis, frame.forward), along(axis, frame.down)
    return [Angle(x, z), Angle(along(axis, frame.normal), hy.sqrt(x * x + z * z))]


def _attributes(convention: str) -> Callable[[Mechanics], Mapping[str, str]]:
    return lambda m: {"convention": convention, "local_frame": local_frame(m).described}


def air_velocity(m: Mechanics) -> list[Symbolic]:
    """Velocity relative to the air that turns with the body flown about, body axes, m/s."""
    found = FlightNames().expressions(m, RELATIVE_NAMES)
    return [found[name] for name in RELATIVE_NAMES]


_NEEDS = ("attitude", "source")

ORBIT = (
    continuous_angles(
        "roll_pitch_yaw", ("roll_pitch_yaw_component",), "roll, pitch and yaw", roll_pitch_yaw,
        frame="local frame to body axes", needs=_NEEDS, by_default=moves_slowly_in_orbit,
        attributes=_attributes(
            "3-2-1 (yaw about z, pitch about y, roll about x) from the local frame (z to the source, y "
            "against the orbit's normal) to body axes; turns counted; roll and yaw are NaN where pitch is a "
            "quarter turn"
        ),
    ),
    continuous_angles(
        "libration", ("libration_angle",), "libration of the axis of smallest moment", libration,
        frame="local frame", needs=_NEEDS,
        absent=lacking(
            lambda m: unique_axis(m.scene.body, m.scene.context, largest=False),
            "the body has no single axis of smallest moment, whose libration it would be",
        ),
        attributes=_attributes(
            "angles of the axis of smallest moment from the direction to the source: in the orbit's plane, "
            "positive forward, turns counted; out of it, positive towards the orbit's normal"
        ),
    ),
    Observable(
        "nadir", BODY, "1", "direction to the source", lambda m: local_frame(m).down,
        frame="body axes", needs=_NEEDS, by_default=moves_slowly_in_orbit,
        attributes=_attributes("unit vector"),
    ),
    Observable(
        "air_velocity", BODY, "m s-1", "velocity relative to the air", air_velocity,
        lambda m: [0, 0, 0], "body axes", ("attitude", "flight"),
        by_default=lambda m: any(isinstance(load, Drag) for load in m.loads),
        absent=lacking(
            lambda m: flown_about(m.scene.config),
            "the body flies about nothing whose air it would meet; give a central_gravity, or leave it out",
        ),
        attributes=lambda m: {
            "convention": "of the centre of mass, in air that turns at the atmosphere_rate of the load flown "
            "about; the air comes from this direction"
        },
    ),
)  # fmt: skip


# --- the angle that a resonance keeps, in motions averaged over rotation and orbit --------------------------


RESONANT_ANGLE = continuous_angles(
    "resonant_angle", (), "angle that the rotation keeps with the orbit",
    lambda m: [Angle(*m.carried(m.commensurable_angle))], needs=("attitude",),
    by_default=lambda m: m.commensurable_angle is not None,
    absent=lacking(
        lambda m: m.commensurable_angle,
        'is of [model] level = "orbit_averaged" where the body is in resonance with its source; leave it out',
    ),
    attributes=lambda m: {
        "convention": "about the angular momentum, at the pericentre: from the direction of the pericentre "
        "to the axis of least moment; 0 or pi where that points at the source there"
    },
)  # fmt: skip


# --- point masses -------------------------------------------------------------------------------------------

EACH = ("point_mass", *SPACE)


def _masses(m: Mechanics) -> PointMasses:
    return m.carried(m.scene.bodies)


def _kilograms(m: Mechanics) -> Vector:
    """Mass of each point mass, kg."""
    masses = _masses(m)
    constant = masses.constant(m.scene.context, m.scene.body.mass)
    return [x / constant for x in masses.strengths]


def _moving(m: Mechanics) -> list[tuple[Any, list[Symbolic], list[Symbolic], Vector, Vector]]:
    """Mass, position, velocity (now and at the start) of all that moves, with a body that they feel."""
    states, masses = m.carried(m.point_masses), _masses(m)
    states_, starts = (states.positions, states.velocities), (masses.positions, masses.velocities)
    found = list(zip(_kilograms(m), *states_, *starts, strict=True))
    if masses.full and masses.host is None:
        start = m.carried(m.scene.position), m.carried(m.scene.velocity)
        found.append((m.carried(m.scene.body.mass), m.carried(m.position), m.carried(m.velocity), *start))
    return found


# --- sizes at the start, SI -------------------------------------------------------------------------------


def _pairs(count: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(count) for j in range(i + 1, count)]


def _energy_scale(m: Mechanics) -> tuple[Any, str]:
    context, masses, kilograms = m.scene.context, _masses(m), _kilograms(m)
    size = sum((k * norm(context, v) ** 2 / 2 for k, _, _, _, v in _moving(m)), context.zero)
    for i, j in _pairs(len(masses.names)):
        place = [a - b for a, b in zip(masses.positions[i], masses.positions[j], strict=True)]
        size += kilograms[i] * masses.strengths[j] / norm(context, place)
    name = "kinetic energy plus size of the potential energy at the start"
    if masses.full:
        size += rotational_scale(m)[0]
    return (size or context.one), name


def _angular_scale(m: Mechanics) -> tuple[Any, str]:
    context = m.scene.context
    size = sum((k * norm(context, cross(x, v)) for k, _, _, x, v in _moving(m)), context.zero)
    if _masses(m).full:
        size += norm(context, m.starting_momentum)
    return (size or context.one), "sum of the sizes of all angular momenta at the start"


def _linear_scale(m: Mechanics) -> tuple[Any, str]:
    size = sum((k * norm(m.scene.context, v) for k, _, _, _, v in _moving(m)), m.scene.context.zero)
    return (size or m.scene.context.one), "sum of the sizes of all momenta at the start"


def _unit(scale: Any) -> Any:
    return lambda m: exponent(m.scene.context, scale(m)[0])


_ENERGY, _ANGULAR, _LINEAR = _unit(_energy_scale), _unit(_angular_scale), _unit(_linear_scale)

# --- expressions ------------------------------------------------------------------------------------------


def _energy(m: Mechanics) -> list[Symbolic]:
    scaling, masses, unit = m.scaling, _masses(m), _ENERGY(m)
    kilograms, states = _kilograms(m), m.carried(m.point_masses)
    terms = []
    for mass, _, velocity, _, _ in _moving(m):
        half = m.scaled(mass / 2, 2 * scaling.speed - unit)
        terms.append(half * hy.sum([v * v for v in velocity]))
    for (i, j), inverse in states.inverse_distances.items():
        pair = kilograms[i] * masses.strengths[j]
        terms.append(m.scaled(-pair, -scaling.length - unit) * inverse)
    if masses.full:
        own = m.scaled(1, scaling.energy - unit)
        terms.append(own * m.rotational_energy)
        terms += [own * m.carried(load.potential(m)) for load in m.acting]
    return [hy.sum(terms)]


def _angular(m: Mechanics) -> list[Symbolic]:
    scaling, unit = m.scaling, _ANGULAR(m)
    terms = _summed(m, scaling.length + scaling.speed - unit, cross)
    if _masses(m).full:
        own = m.scaled(1, scaling.momentum - unit)
        for found, x in zip(terms, m.momentum_space, strict=True):
            found.append(own * x)
    return [hy.sum(found) for found in terms]


def _linear(m: Mechanics) -> list[Symbolic]:
    terms = _summed(m, m.scaling.speed - _LINEAR(m), lambda place, velocity: velocity)
    return [hy.sum(found) for found in terms]


def _summed(
    m: Mechanics, exponent: int, of: Callable[[list[Symbolic], list[Symbolic]], list[Symbolic]]
) -> list[list[Symbolic]]:
    """Terms of each component of the sum of masses times a vector of place and velocity."""
    terms: list[list[Symbolic]] = [[], [], []]
    for mass, place, velocity, _, _ in _moving(m):
        factor = m.scaled(mass, exponent)
        for found, x in zip(terms, of(place, velocity), strict=True):
            found.append(factor * x)
    return terms


def _flat(vectors: Sequence[list[Symbolic]]) -> list[Symbolic]:
    return [x for vector in vectors for x in vector]


# --- when they are constant -------------------------------------------------------------------------------


def _kept(m: Mechanics) -> str | None:
    if not _masses(m).full:
        return "the point masses feel each other's gravity alone"
    if m.drives_work or not all(load.reacts for load in m.acting):
        return None
    return "all forces act between the bodies"


def _alone(m: Mechanics) -> str | None:
    return "the bodies feel this one, too (system_...); leave it out" if _masses(m).full else None


def _whole(m: Mechanics) -> str | None:
    if not _masses(m).full:
        return 'the bodies don\'t feel this one (orbital_...); leave it out, or set [body] coupling = "full"'
    return None if _kept(m) else "loads act that don't come from the bodies; leave it out"


_POINTS = ("point_masses",)
_WITH_BODY = ("point_masses", "attitude", "place")
POINT_MASSES = (
    Observable(
        "point_mass_position", EACH, "m", "positions of the point masses",
        lambda m: _flat(m.carried(m.point_masses).positions),
        lambda m: [m.scaling.length] * 3 * len(_masses(m).names), "space axes", _POINTS,
    ),
    Observable(
        "point_mass_velocity", EACH, "m s-1", "velocities of the point masses",
        lambda m: _flat(m.carried(m.point_masses).velocities),
        lambda m: [m.scaling.speed] * 3 * len(_masses(m).names), "space axes", _POINTS,
    ),
    *(
        Observable(
            f"{which}_{name}", dims, units, long_name, expressions, same_unit(unit, 3 if dims else 1),
            "space axes" if dims else "", needs, _kept, scale, absent=absent,
        )
        for which, needs, absent, of in (
            ("orbital", _POINTS, _alone, "of the point masses"),
            ("system", _WITH_BODY, _whole, "of body and point masses together"),
        )
        for name, dims, units, long_name, expressions, unit, scale in (
            ("energy", (), "J", f"energy {of}", _energy, _ENERGY, _energy_scale),
            ("angular_momentum", SPACE, "kg m2 s-1", f"angular momentum {of}", _angular,
             _ANGULAR, _angular_scale),
            ("linear_momentum", SPACE, "kg m s-1", f"linear momentum {of}", _linear, _LINEAR, _linear_scale),
        )
    ),
)  # fmt: skip
