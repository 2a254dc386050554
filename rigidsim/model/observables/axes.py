"""Directions and angles: of the figure, spin and momentum axes in space, against the reference plane and an
orbit, and places of point masses.

With a unit axis a = (u, v, s) along the plane's X', Y' and normal n
(``rigidsim.model.frames``):

    obliquity = atan2(|n x a|, n . a),    node longitude = atan2(u, -v),

the latter of n x a, where the equator whose pole is a rises through the plane: luni-solar precession makes it
decrease. Neither loses digits at any angle.

The kind decides what is recorded by default: a planet that precesses has directions and their angles; a body
that turns nearly about its figure axis has polar motion, wobble and a rotation angle; other bodies have
neither.

**Rotation about the momentum, and Andoyer's variables.** With the reference plane (X', Y', n), the unit
vector k of the angular momentum G k, and the figure's axes (e1, e2, e3), the attitude is R3(h) R1(I) R3(g)
R1(J) R3(l) with cos I = k . n = H / G, cos J = k . e3 = L / G (Andoyer 1923; Deprit 1967, Am. J. Phys. 35,
424). Each angle is the arc tangent of two products that vanish only where it is undefined: h with sin I, l
with sin J, g with sin I sin J.

The rotation angle is their sum h + g + l, which is defined where they aren't (with -h if the momentum starts
opposite to n, with -l if it starts opposite to e3, each axis then reversed below): the turn about k from X',
carried there by the smallest rotation that takes n to k, to e1, carried there by the smallest that takes e3
to k. For a free body that turns nearly about its figure axis it grows uniformly.

Polar motion is the spin relative to the figure axis, seen from the body: m1 = w1 / w3, m2 = w2 / w3 along the
figure's equator (Munk & MacDonald 1960, The Rotation of the Earth, eq. 6.1.1; IERS: x_p = m1, y_p = -m2).

**What the climate feels**: precession, climatic precession, insolation. In the plane of the orbit, from X'
(``rigidsim.model.frames``), the equinox lies where the orbit rises through the equator, and the perihelion at
the longitude of periapsis, whose node counts from X. Both have one zero, since the smallest rotation that
takes Z to the plane's normal turns about the node. With the axis' components u and v along X' and Y' the
equinox is at atan2(-u, v).

The mean insolation of a day at a latitude phi and a longitude of the Sun lambda is (Berger 1978, J. Atmos.
Sci. 35, 2362)

    W = (S0 / pi) ((1 + e cos nu) / (1 - e^2))^2 (H sin phi sin d + cos phi cos d sin H),

with sin d = sin(obliquity) sin(lambda), cos H = -tan phi tan d (within -1 and 1), and nu = lambda - pi less
the longitude of perihelion.

**Attitude relative to an orbit**: roll, pitch and yaw, libration, and the direction of the source. With c the
direction to the source and o the orbit's normal in body axes, and R the matrix whose rows are the local
frame's axes in body axes,

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

from rigidsim.model.averaged.tides import Tides
from rigidsim.model.frames import (
    initial_normal,
    initial_plane,
    local_frame,
    moves_slowly_in_orbit,
    orbit_plane,
    reference_plane,
)
from rigidsim.model.load import Load
from rigidsim.model.loads.surface_load import Drag
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.mechanical import rotational_scale
from rigidsim.model.observables.observable import (
    BODY,
    MOMENTUM,
    SPACE,
    Angle,
    Observable,
    continuous_angles,
    described_by,
    lacking,
    only_when_named,
    same_unit,
)
from rigidsim.model.rotations import Symbolic, along, apply, length, unit
from rigidsim.model.scaling import exponent, source_rate
from rigidsim.model.sources import RELATIVE_NAMES, FlightNames, flown_about
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Vector, cross, dot, norm
from rigidsim.scene.arithmetic import apply as multiply
from rigidsim.scene.frame import unique_axis
from rigidsim.scene.point_masses import PointMasses
from rigidsim.scene.space_axes import ECLIPTIC, obliquity, to_equator

AXIS = ("axis",)


def three_axes(m: Mechanics) -> list[list[Symbolic]]:
    """Unit vectors in the order of the labels of the dimension ``axis``, space axes."""
    return [unit(m.figure_space), unit(m.spin_space), unit(m.momentum_space)]


def _on_plane(m: Mechanics) -> list[list[Symbolic]]:
    """Components of each axis along the reference plane's X', Y' and normal."""
    plane = reference_plane(m)
    return [plane.components(axis) for axis in three_axes(m)]


def _on_sky(m: Mechanics, axes: list[list[Symbolic]]) -> list[list[Symbolic]]:
    """Components of axes along equatorial axes: the space axes, unless these are the ecliptic's."""
    if m.scene.axes != ECLIPTIC:
        return axes
    c, s = m.fixed(list(obliquity(m.scene.context)))
    return [to_equator(axis, (c, s)) for axis in axes]


def _meridian(m: Mechanics) -> list[Angle]:
    """W: with the pole (x, y, z) and the prime meridian f, the node is along (-y, x, 0), and W is
    atan2(f_z, x f_y - y f_x), times the cosine of the declination.
    """
    figure = m.scene.figure
    (x, y, _), (fx, fy, fz) = _on_sky(m, [m.figure_space, apply(m.matrix, m.fixed(figure.first))])
    return [Angle(fz, x * fy - y * fx)]


_no_meridian = lacking(
    lambda m: m.scene.axes,
    "it counts from the equator of J2000, but what the space axes are isn't known; set [frame] axes",
)


def _sky(convention: str) -> Callable[[Mechanics], Mapping[str, str]]:
    def against(m: Mechanics) -> str:
        turned = m.scene.axes == ECLIPTIC
        where = "mean equator and equinox of J2000" if turned else "the space axes' XY plane and X"
        return f"{convention}, against {where}"

    return described_by(against, figure=True)


# --- the kind of rotation, by which some variables are recorded by default ----------------------------------

_AXIAL = 0.1
"""Angle (rad) between spin and figure axis up to which a body turns nearly about it."""
_FAST = 10
"""Ratio of a planet's spin to its sources' rates; a slower body librates or tumbles with its source."""


def _turns_about_its_figure(m: Mechanics) -> bool:
    """Whether the body starts turning nearly about its figure axis, a principal one."""
    scene, context = m.scene, m.scene.context
    spin, pole = scene.angular_velocity, scene.figure.pole
    if all(w == 0 for w in spin):
        return False
    aligned, across = abs(dot(spin, pole)), norm(context, cross(pole, spin))
    turned = multiply(scene.body.inertia, pole)
    principal = norm(context, cross(turned, pole)) <= norm(context, turned) * 1e-12
    return bool(across <= _AXIAL * aligned) and principal


def is_planet(m: Mechanics) -> bool:
    """Whether a fast spin precesses under gravity gradients of orbiting or ephemeris bodies."""
    if m.attitude is None or not m.turning:
        return False
    distant = [x for x in m.turning if x.orbit or x.table or x.placement.moves or x.reacts]
    fast = norm(m.scene.context, m.scene.angular_velocity) >= _FAST * source_rate(m.scene)
    return len(distant) == len(m.turning) and bool(fast) and _turns_about_its_figure(m)


def is_nearly_axial(m: Mechanics) -> bool:
    """Whether a torque-free body or a planet turns nearly, but not exactly, about its figure axis."""
    if m.carriers or (m.torque and not is_planet(m)):
        return False
    scene, pole = m.scene, m.scene.figure.pole
    wobbles = norm(scene.context, cross(pole, scene.angular_velocity)) != 0
    return _turns_about_its_figure(m) and (bool(wobbles) or bool(m.torque))


# --- the observables ----------------------------------------------------------------------------------------

_AT_REST = "unit vector; NaN where the body is at rest"

AXES = (
    Observable(
        "figure_axis", SPACE, "1", "direction of the figure axis", lambda m: unit(m.figure_space),
        frame="space axes", needs=("attitude",), by_default=is_planet,
        attributes=described_by("unit vector", figure=True),
    ),
    Observable(
        "spin_axis", SPACE, "1", "direction of the angular velocity", lambda m: unit(m.spin_space),
        frame="space axes", needs=("attitude",), by_default=only_when_named,
        attributes=described_by(_AT_REST),
    ),
    Observable(
        "momentum_axis", SPACE, "1", "direction of the angular momentum",
        lambda m: unit(m.momentum_space),
        frame="space axes", needs=("attitude",), by_default=only_when_named,
        attributes=described_by(_AT_REST),
    ),
    continuous_angles(
        "right_ascension", AXIS, "right ascension of the figure, spin and momentum axes",
        lambda m: [Angle(y, x) for x, y, _ in _on_sky(m, three_axes(m))],
        frame="space axes", needs=("attitude",),
        attributes=_sky("longitude from X towards Y, turns counted; NaN at the poles"),
    ),
    Observable(
        "declination", AXIS, "rad", "declination of the figure, spin and momentum axes",
        lambda m: [hy.atan2(z, hy.sqrt(x * x + y * y)) for x, y, z in _on_sky(m, three_axes(m))],
        frame="space axes", needs=("attitude",), by_default=only_when_named,
        attributes=_sky("positive north of the equator"),
    ),
    continuous_angles(
        "prime_meridian", (), "angle of the prime meridian, the IAU's W", _meridian,
        frame="space axes", needs=("attitude",), absent=_no_meridian,
        attributes=described_by(
            "from where the equator of the figure axis rises through the mean equator of J2000, along it in "
            "the direct sense to the figure's first axis; turns counted; NaN at the poles",
            figure=True,
        ),
    ),
    Observable(
        "obliquity", AXIS, "rad", "obliquity of the figure, spin and momentum axes",
        lambda m: [hy.atan2(hy.sqrt(u * u + v * v), s) for u, v, s in _on_plane(m)],
        frame="space axes", needs=("attitude", "plane"), by_default=is_planet,
        attributes=described_by("angle from the reference plane's normal, 0 to pi", figure=True, plane=True),
    ),
    continuous_angles(
        "node_longitude", AXIS,
        "longitude of the node of the equator of the figure, spin and momentum axes",
        lambda m: [Angle(u, -v) for u, v, _ in _on_plane(m)],
        frame="space axes", needs=("attitude", "plane"), by_default=is_planet,
        attributes=described_by(
            "where the equator whose pole is the axis rises through the reference plane, from X turned by "
            "the smallest rotation that takes Z to the normal, in the direct sense; turns counted; NaN where "
            "the obliquity is 0 or pi",
            figure=True, plane=True,
        ),
    ),
)  # fmt: skip


# --- rotation about the momentum ----------------------------------------------------------------------------


def _rotation_rate(m: Mechanics) -> Symbolic:
    """Of an averaged body, which has one as long as tides slow it."""
    tides = None if m.average is None else m.average.tides
    if tides is None:
        return length(m.rates)
    return m.scaled(tides.spin, m.scaling.time) * tides.spin_ratio(m)


def _andoyer_momenta(m: Mechanics) -> list[Symbolic]:
    momentum, plane = m.momentum_body, reference_plane(m)
    figure = along(m.fixed(m.scene.figure.pole), momentum)
    return [figure, length(momentum), along(plane.normal, m.momentum_space)]


def _andoyer_angles(m: Mechanics) -> list[Angle]:
    figure, plane = m.scene.figure, reference_plane(m)
    k = unit(m.momentum_body)
    u, v, s = plane.components(apply(m.matrix, k))
    # k x e3 from body components: they are small there, so it keeps its digits
    q0, q1, q2 = plane.components(apply(m.matrix, cross(k, m.fixed(figure.pole))))
    across = (u * u + v * v) * q2 - s * (u * q0 + v * q1)
    return [
        Angle(along(m.fixed(figure.first), k), along(m.fixed(figure.second), k)),
        Angle(across, u * q1 - v * q0),
        Angle(u, -v),
    ]


def _senses(m: Mechanics) -> tuple[int, int]:
    """Side of the reference plane, and of the figure's equator, on which the momentum starts: +1 or -1."""
    scene = m.scene
    momentum = m.starting_momentum
    in_space = multiply(attitude.rotation_matrix(scene.quaternion), momentum)
    above = dot(in_space, initial_normal(scene, m.loads))
    return (-1 if above < 0 else 1), (-1 if dot(momentum, scene.figure.pole) < 0 else 1)


def _rotation_angle(m: Mechanics) -> list[Angle]:
    figure, plane = m.scene.figure, reference_plane(m)
    north, upright = _senses(m)

    def seen(vector: list[Symbolic], sign: int = 1) -> list[Symbolic]:
        """Components along X', Y', n, or X', -Y', -n for sign -1, so that the momentum's last is positive."""
        x, y, z = plane.components(vector)
        signs = (sign, sign * north, sign * north)
        return [a if s > 0 else -a for a, s in zip((x, y, z), signs, strict=True)]

    u, v, s = seen(unit(m.momentum_space))
    first = seen(apply(m.matrix, m.fixed(figure.first)))
    second = seen(apply(m.matrix, m.fixed(figure.second)), upright)
    inverse = 1.0 / (1.0 + s)
    x = [1.0 - u * u * inverse, -(u * v * inverse), -u]
    y = [-(u * v * inverse), 1.0 - v * v * inverse, -v]
    return [Angle(along(y, first) - along(x, second), along(x, first) + along(y, second))]


def _rotation_sum(m: Mechanics) -> str:
    """The rotation angle as a sum of Andoyer's: h and l count backwards on the momentum's other side."""
    north, upright = _senses(m)
    if north > 0 and upright > 0:
        return "h + g + l"
    return f"g {'+' if north > 0 else '-'} h {'+' if upright > 0 else '-'} l"


ROTATION = (
    continuous_angles(
        "rotation_angle", (), "angle of rotation about the angular momentum", _rotation_angle,
        frame="space axes", needs=("attitude", "plane"), by_default=is_nearly_axial,
        attributes=described_by(
            lambda m: f"{_rotation_sum(m)} of andoyer_angles: from X, carried to the momentum's equator by "
            "the smallest rotations, to the figure's first axis; in the direct sense about the momentum; "
            "turns counted",
            figure=True, plane=True,
        ),
    ),
    Observable(
        "rotation_rate", (), "rad s-1", "instantaneous rate of rotation", lambda m: [_rotation_rate(m)],
        same_unit(lambda m: -m.scaling.time, 1), by_default=only_when_named,
        attributes=described_by("norm of the angular velocity"),
    ),
    Observable(
        "rotation_period", (), "s", "instantaneous period of rotation (sidereal length of day)",
        lambda m: [m.number(2 * m.scene.context.pi) / _rotation_rate(m)],
        same_unit(lambda m: m.scaling.time, 1), by_default=only_when_named,
        attributes=described_by("2 pi / rotation_rate, against the stars; infinite at rest"),
    ),
    Observable(
        "andoyer_momenta", ("andoyer_momentum",), "kg m2 s-1", "Andoyer momenta", _andoyer_momenta,
        same_unit(MOMENTUM, 3), needs=("attitude", "plane"), by_default=only_when_named,
        attributes=described_by(
            "L along the figure axis, G the norm, H along the reference plane's normal",
            figure=True, plane=True,
        ),
    ),
    continuous_angles(
        "andoyer_angles", ("andoyer_angle",), "Andoyer angles", _andoyer_angles,
        needs=("attitude", "plane"),
        attributes=described_by(
            "l about the figure axis, g about the momentum, h about the reference plane's normal: attitude = "
            "R3(h) R1(I) R3(g) R1(J) R3(l), cos I = H/G, cos J = L/G; turns counted; NaN where undefined",
            figure=True, plane=True,
        ),
    ),
)  # fmt: skip


# --- relative to the figure axis, seen from the body --------------------------------------------------------


def _polar_motion(m: Mechanics) -> list[Symbolic]:
    figure = m.scene.figure
    w1, w2, w3 = (along(m.fixed(axis), m.rates) for axis in (figure.first, figure.second, figure.pole))
    off = hy.gt(w1 * w1 + w2 * w2, w3 * w3)
    kept = hy.select(off, 0.0, 1.0)
    kept = kept / kept  # NaN where it is off, and 1 elsewhere
    return [kept * (w1 / w3), kept * (w2 / w3)]


def _no_polar_motion(m: Mechanics) -> str | None:
    """Why there is no polar motion: the spin starts outside the cone where it is recorded."""
    context, figure = m.scene.context, m.scene.figure
    aligned = abs(dot(m.scene.angular_velocity, figure.pole))
    across = norm(context, [dot(m.scene.angular_velocity, e) for e in (figure.first, figure.second)])
    if aligned == 0 and across == 0:
        return "the body starts at rest, without a spin that could have a pole"
    if across > aligned:
        degrees = context.nstr(context.degrees(context.atan2(across, aligned)), 4)
        return (
            f"the spin starts {degrees} deg from the figure axis ({figure.described}), and polar motion is "
            "recorded up to 45 deg; choose another [frame] figure_axis, or record wobble_angle"
        )
    return None


def _angle_between(a: list[Symbolic], b: list[Symbolic]) -> Symbolic:
    """Angle atan2(|a x b|, a . b), 0 to pi, which loses no digits anywhere; NaN if either vector is zero."""
    aligned = along(a, b)
    across = length(cross(a, b))
    size = hy.sqrt(aligned * aligned + across * across)
    return hy.atan2(across / size, aligned / size)


def _wobble_angle(m: Mechanics) -> list[Symbolic]:
    largest = m.carried(unique_axis(m.scene.body, m.scene.context, largest=True))
    return [_angle_between(m.fixed(largest), m.momentum_body)]


_no_largest = lacking(
    lambda m: unique_axis(m.scene.body, m.scene.context, largest=True),
    "the two largest principal moments are equal, so that no single axis has the largest; record "
    "nutation_angle",
)


def _polar_attributes(m: Mechanics) -> Mapping[str, str]:
    first = ", ".join(m.scene.context.nstr(x, 17) for x in m.scene.figure.first)
    convention = "m1 = w1/w3, m2 = w2/w3 (IERS: x_p = m1, y_p = -m2); NaN where the spin is more than 45 "
    shown = dict(described_by(convention + "degrees from the figure axis", figure=True)(m))
    return {"convention": shown["convention"], "first_axis": f"[{first}] in body axes"} | shown


_NO_SPIN = "0 to pi; NaN where the body is at rest"

POLE = (
    Observable(
        "polar_motion", ("polar_motion_component",), "rad", "polar motion", _polar_motion,
        frame="body axes", by_default=is_nearly_axial, attributes=_polar_attributes,
        absent=_no_polar_motion,
    ),
    Observable(
        "wobble_angle", (), "rad", "angle of the angular momentum from the axis of largest moment",
        _wobble_angle, frame="body axes", by_default=is_nearly_axial,
        attributes=described_by(_NO_SPIN), absent=_no_largest,
    ),
    Observable(
        "nutation_angle", (), "rad", "angle of the figure axis from the angular momentum",
        lambda m: [_angle_between(m.fixed(m.scene.figure.pole), m.momentum_body)],
        frame="body axes", by_default=is_nearly_axial,
        attributes=described_by(_NO_SPIN, figure=True),
    ),
)  # fmt: skip


# --- what the climate feels ---------------------------------------------------------------------------------


def _source(m: Mechanics) -> Load | None:
    """The first load whose source is on an orbit of known elements."""
    return next((load for load in m.loads if load.orbit is not None or load.table is not None), None)


_no_orbit = lacking(
    _source, "no load has an orbit by elements or a table, to which it would refer; leave it out"
)


def _equinox(m: Mechanics) -> tuple[Symbolic, Symbolic]:
    """Cosine and sine of the equinox's longitude, times the sine of the obliquity."""
    u, v, _ = orbit_plane(m, [m.carried(_source(m))]).components(unit(m.figure_space))
    return v, -u


def _eccentric(m: Mechanics) -> tuple[Symbolic, Symbolic]:
    load = m.carried(_source(m))
    states = m.table(load.table) if load.table is not None else m.orbit(m.carried(load.orbit))
    k, h = m.carried(states.eccentric)
    return hy.expression(k), hy.expression(h)


def _precession(m: Mechanics) -> list[Angle]:
    """From the equinox of the start, whose cosine and sine are numbers."""
    scene, (c, s) = m.scene, _equinox(m)
    axes = initial_plane(scene, m.carried(_source(m)))
    pole = multiply(attitude.rotation_matrix(scene.quaternion), scene.figure.pole)
    u, v = (dot(axis, pole) for axis in axes[:2])
    size = scene.context.hypot(u, v)
    if size == 0:  # no equinox
        return [Angle(s, c)]
    begun_c, begun_s = m.number(v / size), m.number(-u / size)
    return [Angle(begun_c * s - begun_s * c, begun_c * c + begun_s * s)]


def _perihelion(m: Mechanics) -> tuple[Symbolic, Symbolic]:
    """e cos and e sin of the longitude of perihelion from the moving equinox, times sin(obliquity)."""
    (c, s), (k, h) = _equinox(m), _eccentric(m)
    return k * c + h * s, h * c - k * s


def _climatic(m: Mechanics) -> list[Symbolic]:
    c, s = _equinox(m)
    return [_perihelion(m)[1] / hy.sqrt(c * c + s * s)]


def _bounded(x: Symbolic) -> Symbolic:
    """A number within -1 and 1."""
    return 0.5 * (hy.sqrt((x + 1.0) * (x + 1.0)) - hy.sqrt((x - 1.0) * (x - 1.0)))


def _insolation(m: Mechanics) -> list[Symbolic]:
    table, context = m.carried(m.scene.config.output.insolation), m.scene.context
    (c, s), (k, h) = _equinox(m), _eccentric(m)
    sine = hy.sqrt(c * c + s * s)  # of the obliquity
    solar, latitude = table.solar_longitude.at(context), table.latitude.at(context)
    along, across = (x / sine for x in _perihelion(m))
    # e cos(nu), with nu = lambda - perihelion - pi
    nearer = -(m.number(context.cos(solar)) * along + m.number(context.sin(solar)) * across)
    up = m.number(context.sin(solar)) * sine  # sine of the declination
    level = hy.sqrt(1.0 - up * up)
    rise, flat = m.number(context.sin(latitude)) * up, m.number(context.cos(latitude)) * level
    hour = hy.acos(_bounded(-rise / flat))
    rest = 1.0 - k * k - h * h
    ratio = (1.0 + nearer) / rest
    size = m.number(table.constant.at(context) / context.pi)
    return [size * (ratio * ratio) * (hour * rise + flat * hy.sin(hour))]


def _no_insolation(m: Mechanics) -> str | None:
    if m.scene.config.output.insolation is None:
        return "it needs [output] insolation = {latitude, solar_longitude}; add it, or leave it out"
    return _no_orbit(m)


def _tides(m: Mechanics) -> Tides | None:
    return None if m.average is None else m.average.tides


def _no_tides(m: Mechanics) -> str | None:
    return None if _tides(m) is not None else "it needs [tides]; add them, or leave it out"


def _tidal_distance(m: Mechanics) -> list[Symbolic]:
    tides = m.carried(_tides(m))
    first = tides.raising[0]
    return [m.number(first.source.of.placement.distance(m.scene.context)) * tides.distance_ratio(m, first)]


def _attributes(convention: str) -> Callable[[Mechanics], Mapping[str, str]]:
    return described_by(
        f"{convention}; in the plane of the orbit of the first source with elements", figure=True
    )


_NEEDS = ("attitude",)
_PERIHELION = (
    "elements of the planet about the Sun, as tables of orbital solutions have them, give the usual sign"
)

CLIMATE = (
    continuous_angles(
        "precession", (), "precession of the equinox along the orbit", _precession,
        needs=_NEEDS, absent=_no_orbit,
        attributes=_attributes("from the equinox of the start, in the direct sense; turns counted"),
    ),
    continuous_angles(
        "longitude_of_perihelion_of_date", (), "longitude of perihelion from the moving equinox",
        lambda m: [Angle(*reversed(_perihelion(m)))],
        needs=_NEEDS, absent=_no_orbit, attributes=_attributes(f"turns counted; {_PERIHELION}"),
    ),
    Observable(
        "climatic_precession", (), "1", "climatic precession", _climatic,
        needs=_NEEDS, by_default=only_when_named, absent=_no_orbit,
        attributes=_attributes(f"e sin of longitude_of_perihelion_of_date; {_PERIHELION}"),
    ),
    Observable(
        "orbit_eccentricity", (), "1", "eccentricity of the orbit",
        lambda m: [hy.sqrt(sum((x * x for x in _eccentric(m)), hy.expression(0.0)))],
        by_default=only_when_named, absent=_no_orbit,
        attributes=described_by("of the first source with elements"),
    ),
    Observable(
        "tidal_distance", (), "m", "distance of the first source that raises tides", _tidal_distance,
        lambda m: [0], by_default=only_when_named, absent=_no_tides,
    ),
    Observable(
        "insolation", (), "W m-2", "mean insolation of a day", _insolation,
        lambda m: [0], needs=_NEEDS, by_default=only_when_named, absent=_no_insolation,
        attributes=_attributes("at the latitude and the longitude of the Sun that [output] insolation gives"),
    ),
)  # fmt: skip


# --- relative to an orbit -----------------------------------------------------------------------------------


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


def _seen_in_orbit(convention: str) -> Callable[[Mechanics], Mapping[str, str]]:
    return lambda m: {"convention": convention, "local_frame": local_frame(m).described}


def air_velocity(m: Mechanics) -> list[Symbolic]:
    """Velocity relative to the air that turns with the body flown about, body axes, m/s."""
    found = FlightNames().expressions(m, RELATIVE_NAMES)
    return [found[name] for name in RELATIVE_NAMES]


_IN_ORBIT = ("attitude", "source")

ORBIT = (
    continuous_angles(
        "roll_pitch_yaw", ("roll_pitch_yaw_component",), "roll, pitch and yaw", roll_pitch_yaw,
        frame="local frame to body axes", needs=_IN_ORBIT, by_default=moves_slowly_in_orbit,
        attributes=_seen_in_orbit(
            "3-2-1 (yaw about z, pitch about y, roll about x) from the local frame (z to the source, y "
            "against the orbit's normal) to body axes; turns counted; roll and yaw are NaN where pitch is a "
            "quarter turn"
        ),
    ),
    continuous_angles(
        "libration", ("libration_angle",), "libration of the axis of smallest moment", libration,
        frame="local frame", needs=_IN_ORBIT,
        absent=lacking(
            lambda m: unique_axis(m.scene.body, m.scene.context, largest=False),
            "the body has no single axis of smallest moment, whose libration it would be",
        ),
        attributes=_seen_in_orbit(
            "angles of the axis of smallest moment from the direction to the source: in the orbit's plane, "
            "positive forward, turns counted; out of it, positive towards the orbit's normal"
        ),
    ),
    Observable(
        "nadir", BODY, "1", "direction to the source", lambda m: local_frame(m).down,
        frame="body axes", needs=_IN_ORBIT, by_default=moves_slowly_in_orbit,
        attributes=_seen_in_orbit("unit vector"),
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


_OF_MASSES = ("point_masses",)
_WITH_BODY = ("point_masses", "attitude", "place")
POINT_MASSES = (
    Observable(
        "point_mass_position", EACH, "m", "positions of the point masses",
        lambda m: _flat(m.carried(m.point_masses).positions),
        lambda m: [m.scaling.length] * 3 * len(_masses(m).names), "space axes", _OF_MASSES,
    ),
    Observable(
        "point_mass_velocity", EACH, "m s-1", "velocities of the point masses",
        lambda m: _flat(m.carried(m.point_masses).velocities),
        lambda m: [m.scaling.speed] * 3 * len(_masses(m).names), "space axes", _OF_MASSES,
    ),
    *(
        Observable(
            f"{which}_{name}", dims, units, long_name, expressions, same_unit(unit, 3 if dims else 1),
            "space axes" if dims else "", needs, _kept, scale, absent=absent,
        )
        for which, needs, absent, of in (
            ("orbital", _OF_MASSES, _alone, "of the point masses"),
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
