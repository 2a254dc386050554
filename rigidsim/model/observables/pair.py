"""What is recorded of two rigid bodies, each from the other one.

With r from ``[body]`` to the second body, v its rate, d = -r / |r| and n the unit vector along r x v,

    separation = |r|,    mutual_period = 2 pi r^2 / |r x v|,    yaw = atan2(e . (n x d), e . d),

where e is the second body's longest axis, the end nearer to ``[body]`` at the start. The period is a
turn's at the present rate of the line between both: on a circular orbit the time of a revolution, while
Kepler's period of the osculating orbit isn't, since the figures attract as well. The mean of ``orbit_angle``
over many turns gives the mean period.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any

import heyoka as hy

from rigidsim.model.frames import reference_plane
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.loads.rigid_bodies import SecondBody, second_body
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.names import in_si
from rigidsim.model.observables.observable import (
    BODY,
    NEEDS,
    SPACE,
    Angle,
    Need,
    Observable,
    continuous_angles,
    described_by,
    lacking,
    only_when_named,
    same_unit,
    unless,
)
from rigidsim.model.rotations import Symbolic, along, length, unit
from rigidsim.model.rotations import apply as turned
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, norm
from rigidsim.scene.expressions.names import NameProvider, Readable, provides
from rigidsim.scene.frame import unique_axis
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config

NEEDS["rigid_bodies"] = Need(
    lambda m: second_body(m.scene) is not None and m.attitude is not None,
    missing=unless(second_body, "there are no [[rigid_bodies]]; add one, or leave it out"),
)
_NEEDED = ("rigid_bodies",)
_EACH = ("rigid_body",)


def _second(m: Mechanics) -> SecondBody:
    return m.carried(second_body(m.scene))


def _states(m: Mechanics) -> Any:
    return _second(m).seen(m)


def _unit(m: Mechanics, which: int) -> int:
    return _second(m).units(m.scene)[which]


def _moment(m: Mechanics) -> list[Symbolic]:
    """r x v, units of place times velocity."""
    return cross(_states(m).place, _states(m).velocity)


def _period(m: Mechanics) -> list[Symbolic]:
    """In units of place over velocity."""
    place = _states(m).place
    return [m.number(2 * m.scene.context.pi) * along(place, place) / length(_moment(m))]


def _long_axis(m: Kinematics) -> Vector | None:
    """Its longest axis, body axes, the end nearer to ``[body]`` at the start; None if several are equal."""
    second = second_body(m.scene)
    axis = None if second is None else unique_axis(second.body, m.scene.context, largest=False)
    if second is None or axis is None:
        return None
    away = dot(apply(attitude.rotation_matrix(second.start.quaternion), axis), second.start.position)
    return [-x for x in axis] if away > 0 else axis


def _libration(m: Mechanics) -> list[Angle]:
    states, axis = _states(m), m.carried(_long_axis(m))
    inwards, normal = [-x for x in unit(states.place)], unit(_moment(m))
    pointing = turned(states.matrix, m.fixed(axis))
    x, y = along(pointing, inwards), along(pointing, cross(normal, inwards))
    return [Angle(y, x), Angle(along(pointing, normal), hy.sqrt(x * x + y * y))]


def _on_plane(m: Mechanics) -> list[Symbolic]:
    return reference_plane(m).components(unit(_moment(m)))


def _tilt(x: list[Symbolic]) -> Symbolic:
    """Angle from the third axis, right to rounding next to it."""
    return hy.atan2(hy.sqrt(x[0] * x[0] + x[1] * x[1]), x[2])


def _to_equator(m: Mechanics) -> list[Symbolic]:
    """The normal of the orbit against the figure axis of ``[body]``."""
    pole, normal = m.figure_space, unit(_moment(m))
    aside = cross(pole, normal)
    return [hy.atan2(length(aside), along(pole, normal))]


def _orbit_angle(m: Mechanics) -> list[Angle]:
    """In the plane of the start, from the place there."""
    context, start = m.scene.context, _second(m).start
    first = [x / norm(context, start.position) for x in start.position]
    normal = cross(start.position, start.velocity)
    normal = [x / norm(context, normal) for x in normal]
    line = unit(_states(m).place)
    return [Angle(along(m.fixed(cross(normal, first)), line), along(m.fixed(first), line))]


def _turns(m: Mechanics) -> bool:
    start = _second(m).start
    return any(x != 0 for x in cross(start.position, start.velocity))


@provides
class PairNames(NameProvider):
    """The distance of both bodies."""

    brings = "separation with [[rigid_bodies]]"

    def names(self, config: Config) -> Iterable[Readable]:
        """See ``NameProvider``."""
        return [Readable("separation", "m")] if config.rigid_bodies else []

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        second = second_body(scene)
        return {} if second is None else {"separation": norm(scene.context, second.start.position)}

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        second = second_body(m.scene) if "separation" in names else None
        if second is None:
            return {}
        return {"separation": in_si(m, length(second.seen(m).place), second.units(m.scene)[0])}


_no_turn = lacking(_turns, "both bodies are on a line and don't go round; leave it out, or")
_no_axis = lambda m: _no_turn(m) or (None if _long_axis(m) else "its two longest axes are equal")  # noqa: E731
PAIR = (
    Observable(
        "rigid_body_quaternion", (*_EACH, "quaternion_component"), "1",
        "attitude quaternion of each further rigid body, body to space", lambda m: _states(m).quaternion,
        frame="body to space", needs=_NEEDED,
    ),
    Observable(
        "rigid_body_angular_velocity", (*_EACH, *BODY), "rad s-1",
        "angular velocity of each further rigid body, in its own axes", lambda m: _states(m).rate_states,
        same_unit(lambda m: _unit(m, 2), 3), "body axes", _NEEDED,
    ),
    Observable(
        "rigid_body_position", (*_EACH, *SPACE), "m", "position of each further rigid body from [body]",
        lambda m: _states(m).place, same_unit(lambda m: _unit(m, 0), 3), "space axes", _NEEDED,
    ),
    Observable(
        "rigid_body_velocity", (*_EACH, *SPACE), "m s-1", "velocity of each further rigid body from [body]",
        lambda m: _states(m).velocity, same_unit(lambda m: _unit(m, 1), 3), "space axes", _NEEDED,
    ),
    Observable(
        "separation", (), "m", "distance of the centres of mass of both rigid bodies",
        lambda m: [length(_states(m).place)], same_unit(lambda m: _unit(m, 0), 1), "", _NEEDED,
    ),
    Observable(
        "mutual_period", (), "s", "time of a turn of the line between both bodies at its rate", _period,
        same_unit(lambda m: _unit(m, 0) - _unit(m, 1), 1), "", _NEEDED,
        attributes=described_by("2 pi r^2 / |r x v|"), absent=_no_turn,
    ),
    continuous_angles(
        "orbit_angle", (), "angle of the line between both bodies from where it starts", _orbit_angle,
        frame="space axes", needs=_NEEDED, absent=_no_turn,
        attributes=described_by("in the plane of the orbit at the start; turns counted"),
    ),
    continuous_angles(
        "yaw", (), "angle of the second body's longest axis from the line to [body]",
        lambda m: _libration(m)[:1], needs=_NEEDED, by_default=lambda m: True, absent=_no_axis,
        attributes=described_by("in the plane of the present orbit, about its normal r x v; turns counted"),
    ),
    continuous_angles(
        "rigid_body_libration", ("libration_angle",),
        "libration of the second body's longest axis from the line to [body]", _libration,
        needs=_NEEDED, absent=_no_axis,
        attributes=described_by("in the plane of the present orbit, as yaw; out of it, towards r x v"),
    ),
    Observable(
        "mutual_inclination", (), "rad", "inclination of the orbit of both bodies",
        lambda m: [_tilt(_on_plane(m))], needs=(*_NEEDED, "plane"), by_default=only_when_named,
        absent=_no_turn, attributes=described_by("angle of r x v from the plane's normal", plane=True),
    ),
    continuous_angles(
        "mutual_node", (), "longitude of the ascending node of the orbit of both bodies",
        lambda m: [Angle(_on_plane(m)[0], -_on_plane(m)[1])], needs=(*_NEEDED, "plane"), absent=_no_turn,
        attributes=described_by(
            "where the second body rises through the plane; turns counted; NaN in the plane", plane=True
        ),
    ),
    Observable(
        "inclination_to_equator", (), "rad", "inclination of the orbit to the equator of [body]", _to_equator,
        needs=_NEEDED, by_default=only_when_named, absent=_no_turn,
        attributes=described_by("angle of r x v from the figure axis of [body]", figure=True),
    ),
    Observable(
        "rigid_body_quaternion_norm", _EACH, "1", "norm of each further rigid body's attitude quaternion",
        lambda m: [hy.sqrt(hy.sum([x * x for x in _states(m).quaternion]))], needs=_NEEDED,
        conserved=lambda _: "1 by definition: any drift is rounding",
        drift_scale=lambda m: (m.scene.context.one, "1"), by_default=only_when_named,
    ),
)  # fmt: skip
