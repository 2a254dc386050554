"""What the climate feels of a planet's rotation and orbit: precession, climatic precession, insolation.

In the plane of the orbit, from X' (``rigidsim.model.frames``), the equinox lies where the orbit rises through
the equator, and the perihelion at the longitude of periapsis, whose node counts from X. Both have one zero,
since the smallest rotation that takes Z to the plane's normal turns about the node. With the axis' components
u and v along X' and Y' the equinox is at atan2(-u, v).

The mean insolation of a day at a latitude phi and a longitude of the Sun lambda is (Berger 1978, J. Atmos.
Sci. 35, 2362)

    W = (S0 / pi) ((1 + e cos nu) / (1 - e^2))^2 (H sin phi sin d + cos phi cos d sin H),

with sin d = sin(obliquity) sin(lambda), cos H = -tan phi tan d (within -1 and 1), and nu = lambda - pi less
the longitude of perihelion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import heyoka as hy

from rigidsim.model.frames import ReferencePlane, initial_plane, orbit_plane
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import (
    Angle,
    Observable,
    continuous_angles,
    described_by,
    only_when_named,
    register_all,
)
from rigidsim.model.rotations import Symbolic, unit
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import apply, dot


def _source(m: Mechanics) -> Load | None:
    """The first load whose source is on an orbit of known elements."""
    return next((load for load in m.loads if load.orbit is not None or load.table is not None), None)


def _no_orbit(m: Mechanics) -> str | None:
    if _source(m) is not None:
        return None
    return "no load has an orbit by elements or a table, to which it would refer; leave it out"


def _plane(m: Mechanics) -> ReferencePlane:
    return orbit_plane(m, [m.carried(_source(m))])


def _equinox(m: Mechanics) -> tuple[Symbolic, Symbolic]:
    """Cosine and sine of the equinox's longitude, times the sine of the obliquity."""
    u, v, _ = _plane(m).components(unit(m.figure_space))
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
    pole = apply(attitude.rotation_matrix(scene.quaternion), scene.figure.pole)
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
    table, context = m.scene.config.output.insolation, m.scene.context
    assert table is not None  # else the variable isn't found
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


def _attributes(convention: str) -> Callable[[Mechanics], Mapping[str, str]]:
    return described_by(
        f"{convention}; in the plane of the orbit of the first source with elements", figure=True
    )


_NEEDS = ("attitude",)
_PERIHELION = (
    "elements of the planet about the Sun, as tables of orbital solutions have them, give the usual sign"
)

register_all(
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
        "insolation", (), "W m-2", "mean insolation of a day", _insolation,
        lambda m: [0], needs=_NEEDS, by_default=only_when_named, absent=_no_insolation,
        attributes=_attributes("at the latitude and the longitude of the Sun that [output] insolation gives"),
    ),
)  # fmt: skip
