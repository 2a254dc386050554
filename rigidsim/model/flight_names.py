"""``altitude`` and ``vrx vry vrz``: height above the body flown about, and velocity relative to its air.

They are those of the first load by which the body in flight is attracted and that has a radius or a rate of
its atmosphere; the first one of all where none has.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.names import in_si
from rigidsim.model.rotations import apply, transpose
from rigidsim.model.sources import SeenSource, free_flight, in_body_axes, sources_of
from rigidsim.model.two_part import rounded
from rigidsim.scene.arithmetic import Vector, cross, norm
from rigidsim.scene.expressions.names import PLACES, NameProvider, Readable, provides
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config

RELATIVE_NAMES = ("vrx", "vry", "vrz")
_FLIGHT = frozenset({"flight", PLACES})


@provides
class FlightNames(NameProvider):
    """Names of a flight about a body with a surface and air."""

    def names(self, config: Config) -> Iterable[Readable]:
        """See ``NameProvider``."""
        source = flown_about(config)
        if source is not None and source.extended:
            yield Readable("altitude", "m", _FLIGHT)
        if source is not None:
            yield from (Readable(name, "m/s", _FLIGHT | {"attitude"}) for name in RELATIVE_NAMES)

    def elsewhere(self, config: Config) -> str:
        """See ``NameProvider``."""
        if (source := flown_about(config)) is None:
            return "altitude, vrx, vry, vrz in flight, with central_gravity"
        return "" if source.extended else "altitude with a radius of the central_gravity"

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        source, context = flown_about(scene.config), scene.context
        if source is None:
            return {}
        load = source.of(scene)
        place = [-x for x in load.source_at_start(scene)]
        swept = cross(_rate(source, scene), place)
        relative = [v - u for v, u in zip(load.motion_at_start(scene), swept, strict=True)]
        found = dict(zip(RELATIVE_NAMES, in_body_axes(scene, relative), strict=True))
        if source.extended:
            found["altitude"] = norm(context, place) - source.radius(context)
        return found

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        source = flown_about(m.scene.config)
        if source is None or not set(names) & {"altitude", *RELATIVE_NAMES}:
            return {}
        load, found = source.of(m.scene), {}
        place = load.source_place(m)
        far = _number(m, place.unit) / place.inverse
        if source.extended:
            found["altitude"] = far - _number(m, source.radius(m.scene.context))
        if set(names) & set(RELATIVE_NAMES):
            relative = [in_si(m, v, m.scaling.speed) for v in load.motion(m)]
            rate = _rate(source, m.scene)
            if any(x != 0 for x in rate):
                swept = cross([_number(m, x) for x in rate], [-far * x for x in place.direction])
                relative = [v - u for v, u in zip(relative, swept, strict=True)]
            found |= zip(RELATIVE_NAMES, apply(transpose(m.matrix), relative), strict=True)
        return found


def flown_about(config: Config) -> SeenSource | None:
    """The load about whose source the body flies through air; None without one."""
    if not free_flight(config):
        return None
    found = [x for x in sources_of(config) if hasattr(x.fields, "atmosphere_rate")]
    told = [x for x in found if x.extended or x.fields.atmosphere_rate is not None]  # type: ignore[attr-defined]
    return next(iter(told or found), None)


def _rate(source: SeenSource, scene: Scene) -> Vector:
    """Angular velocity of the air, rad/s, space axes (mpf)."""
    given = source.fields.atmosphere_rate  # type: ignore[attr-defined]
    return [scene.context.zero] * 3 if given is None else [x.at(scene.context) for x in given]


def _number(m: Kinematics, value: Any) -> Any:
    return hy.expression(rounded(m.number(value)))
