"""``air_density``: the density of the Earth's air in NRLMSISE-00, for ``drag`` with density = "nrlmsise00".

It is heyoka's network (a thermoNET: Izzo, Acciarini & Biscani 2024, arXiv 2405.19384) of the model of Picone
et al. 2002, Journal of Geophysical Research 107, 1468, at the geodetic place of the body above WGS 84. The
constants of the network are doubles, in every precision.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from datetime import date
from functools import lru_cache
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError, Problem, required
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load_words import length_text, value_text
from rigidsim.model.rotations import Symbolic
from rigidsim.model.sources import flown_about, read_in
from rigidsim.model.two_part import rounded
from rigidsim.scene.arithmetic import Matrix, apply
from rigidsim.scene.bodies.presets import EARTH
from rigidsim.scene.earth_axes import earth_axes, rotation_rate
from rigidsim.scene.expressions.names import PLACES, NameProvider, Readable, provides
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.swept import plain

NRLMSISE = "nrlmsise00"
AIR_DENSITY = "air_density"
LEAST = 150.0
"""Altitude (km) from which the network is used: below, it is wrong by half."""
_EQUATOR, _FLATTENING = 6378.137, 1 / 298.257223563  # km, WGS 84
_ORDINAL_0 = 1721424.5  # Julian date of the day before 0001-01-01
INDICES = ("f107", "f107a", "ap")


@provides
class AirDensity(NameProvider):
    """The density where the body is."""

    brings = f'{AIR_DENSITY} with a drag whose density is "{NRLMSISE}"'

    def names(self, config: Config) -> Iterable[Readable]:
        """See ``NameProvider``."""
        if flown_about(config) is not None and _asking(config):
            yield Readable(AIR_DENSITY, "kg/m^3", frozenset({"flight", PLACES}), long=True)

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """See ``NameProvider``; in double precision, as the network is known."""
        if AIR_DENSITY not in read_in(scene):
            return {}
        place = _geodetic_at_start(scene)
        indices = [float(plain(x)) for x in _indices(scene)]
        values = [*place, *indices, _day(scene) + float(plain(scene.start)) / 86400]
        return {AIR_DENSITY: scene.context.mpf(float(_compiled()[1](np.array(values))[0]))}

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        if AIR_DENSITY not in names:
            return {}
        key = (AIR_DENSITY,)
        if key not in m.made:
            m.made[key] = [_density(m)]
        return {AIR_DENSITY: m.made[key][0]}


def height(m: Kinematics) -> Symbolic:
    """Geodetic altitude, km."""
    return _geodetic(m)[0]


def _geodetic_at_start(scene: Scene) -> list[float]:
    """Altitude (km), latitude and longitude (rad) of the body; refused where the model doesn't hold."""
    context, (source, rows) = scene.context, _known(scene)
    x, y, z = apply(rows, [-x for x in source.source_at_start(scene)])
    turned = rotation_rate(context) * scene.start
    c, s = context.cos(turned), context.sin(turned)
    fixed = [float(plain(e)) / 1e3 for e in (c * x + s * y, c * y - s * x, z)]
    found = [float(e) for e in _compiled()[0](np.array(fixed))]
    if found[0] < LEAST:
        raise _fault(
            scene,
            f'given "{NRLMSISE}", but the body starts {length_text(found[0] * 1e3)} above the Earth; '
            "its "
            f"network holds from {LEAST:g} km on: start higher, or give density, altitude and "
            "scale_height",
        )
    return found


@lru_cache(maxsize=1)
def _compiled() -> tuple[Any, Any]:
    """Geodetic place of x, y, z (km), and density by that, f107, f107a, ap and day."""
    place, seven = hy.make_vars("x", "y", "z"), hy.make_vars("h", "lat", "lon", "f", "fa", "ap", "t")
    density = hy.model.nrlmsise00_tn(seven[:3], *seven[3:])
    return (
        hy.cfunc(hy.model.cart2geo(place, R_eq=_EQUATOR), place, compact_mode=True),
        hy.cfunc([density], seven, compact_mode=True),
    )


def _density(m: Kinematics) -> Symbolic:
    context = m.scene.context
    days = _number(m, context.ldexp(context.one, m.scaling.time) / 86400) * hy.time
    indices = [_number(m, x) for x in _indices(m.scene)]
    day = _number(m, context.mpf(_day(m.scene)))
    return hy.model.nrlmsise00_tn(_geodetic(m), *indices, day + days)


def _geodetic(m: Kinematics) -> list[Symbolic]:
    """Altitude (km), latitude and longitude (rad)."""
    key = ("geodetic",)
    if key not in m.made:
        source, rows = _known(m.scene)
        place = source.source_place(m)
        far = _number(m, place.unit / 1000) / place.inverse
        space = [-far * x for x in place.direction]
        x, y, z = (hy.sum([e * a for e, a in zip(m.fixed(row), space, strict=True)]) for row in rows)
        angle = m.scaled(rotation_rate(m.scene.context), m.scaling.time) * hy.time
        c, s = hy.cos(angle), hy.sin(angle)
        m.made[key] = hy.model.cart2geo([c * x + s * y, c * y - s * x, z], R_eq=_EQUATOR)
    return m.made[key]


def _asking(config: Config) -> list[Any]:
    """Keys of the loads that take it."""
    return [fields for fields in config.loads if getattr(fields, "density", None) == NRLMSISE]


def _indices(scene: Scene) -> list[Any]:
    fields = _asking(scene.config)[0]
    return [getattr(fields, key).at(scene.context) for key in INDICES]


def _day(scene: Scene) -> float:
    """Days of UTC since the year's begin at time 0."""
    days = float(required(scene.epoch).universal_date()) - _ORDINAL_0
    return days - date(date.fromordinal(int(days)).year, 1, 1).toordinal()


def _known(scene: Scene) -> tuple[Any, Matrix]:
    """The load about whose source the air is, and the Earth's axes at time 0 as rows; what the model can't be
    worked out for is refused.
    """
    given = f'given "{NRLMSISE}", '
    known = (
        ("[time] epoch", scene.epoch, 'epoch = "2026-01-01T00:00:00 UTC"'),
        ("[frame] axes", scene.axes, 'axes = "ICRF"'),
    )
    for what, found, example in known:
        if found is None:
            raise _fault(scene, f"{given}a model of date and place, which takes {what}; give {example}")
    epoch, axes = required(scene.epoch), required(scene.axes)
    try:
        epoch.universal_date()
    except ValueError as error:
        raise _fault(scene, f"{given}at {epoch}, but {error}; give a later epoch") from None
    first, *others = _asking(scene.config)
    if any(getattr(x, key) != getattr(first, key) for x in others for key in INDICES):
        raise _fault(
            scene, f"{given}by several loads with different {', '.join(INDICES)}; give them the same"
        )
    source = required(flown_about(scene.config)).of(scene)
    strength = source.gravitational_parameter
    if strength is not None and not EARTH.attracts_by(strength):
        what = f"the Earth's air, where {value_text(strength, 'm^3/s^2')} attracts the body, which isn't the "
        raise _fault(scene, f"{given}{what}Earth; give density, altitude and scale_height of its air")
    return source, earth_axes(epoch, axes, scene.context)


def _fault(scene: Scene, text: str) -> ConfigError:
    number = next(n for n, x in enumerate(scene.config.loads, 1) if getattr(x, "density", None) == NRLMSISE)
    return ConfigError(Problem(f"[[loads]] number {number} density", text))


def _number(m: Kinematics, value: Any) -> Any:
    return hy.expression(rounded(m.number(value)))
