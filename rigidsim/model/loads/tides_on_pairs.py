"""What distant sources of gravity do to a second rigid body, and to its place as seen from the first.

With s the place of a source from ``[body]``, r of the second body, and q = (r^2 - 2 r . s) / s^2, the bodies
as points are accelerated relative to each other by

    G M ((s - r) / |s - r|^3 - s / s^3) = -(G M / s^3) (r + (k - 1) s) / k,    k = (1 + q)^(3/2),
    k - 1 = q (3 + 3 q + q^2) / (1 + k),

which loses no digits where the source is far (Battin 1999, An Introduction to the Mathematics and Methods of
Astrodynamics, section 8.4). Forces on both figures to second degree, and the torque on the second one, follow
``Attraction``, seen from each body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Term, loads_of
from rigidsim.model.loads.gravity import Attraction
from rigidsim.model.placements import Placement, SourcePlace
from rigidsim.model.rotations import Symbolic, along
from rigidsim.model.state_blocks import AttitudeStates, RotatingBody
from rigidsim.scene.bodies.body import RigidBody
from rigidsim.scene.scene import Scene


class Second(NamedTuple):
    """A second body's states in the units whose binary exponents (SI) are given."""

    names: RotatingBody
    body: RigidBody
    place: list[Symbolic]
    quaternion: list[Symbolic]
    matrix: list[list[Symbolic]]
    far: int
    speed: int


@dataclass(frozen=True)
class _Known(Placement):
    """A source whose place is an expression."""

    place: SourcePlace

    def seen(self, m: Kinematics) -> SourcePlace:
        return self.place


@dataclass(frozen=True)
class Tides:
    """Acceleration of the second body relative to the first, units of its speed over time, and the torque on
    it as ``Load.torque`` gives it.
    """

    acceleration: list[Symbolic]
    torque: list[Term]


def sources_of(scene: Scene) -> list[Attraction]:
    """Sources that act on both bodies."""
    return [load for load in loads_of(scene) if isinstance(load, Attraction)]


def tides_on(second: Second, m: Kinematics) -> Tides | None:
    """What all sources do; None without any."""
    found = [_tide(load, second, m) for load in sources_of(m.scene)]
    if not found:
        return None
    return Tides(
        [hy.sum(list(parts)) for parts in zip(*(tide.acceleration for tide in found), strict=True)],
        [term for tide in found for term in tide.torque],
    )


def _tide(load: Attraction, second: Second, m: Kinematics) -> Tides:
    context, scaling, there = m.scene.context, m.scaling, load.placement.seen(m)
    shift, inverse, towards = scaling.time - second.speed, there.inverse, there.direction
    ratio = m.number(context.ldexp(1 / there.unit, second.far)) * inverse  # unit of r over the distance
    part = [ratio * x for x in second.place]
    q = along(part, [x - 2.0 * u for x, u in zip(part, towards, strict=True)])
    k = (1.0 + q) * hy.sqrt(1.0 + q)
    beyond = q * (3.0 + q * (3.0 + q)) / (1.0 + k)
    size = m.number(-load.per_distance(m, there, 2, shift)) * inverse**2 / k
    falling = [size * (x + beyond * u) for x, u in zip(part, towards, strict=True)]
    away = 1.0 / hy.sqrt(1.0 + q)
    line = [away * (u - x) for x, u in zip(part, towards, strict=True)]
    own = _seen_from(second, m)
    other = replace(load, placement=_Known(SourcePlace(line, inverse * away, there.unit)))
    figures = _figure(other, own, second), _figure(load, m, second)
    return Tides(
        [a + b - c for a, b, c in zip(falling, *figures, strict=True)],
        other.torque(own),
    )


def _seen_from(second: Second, m: Kinematics) -> Kinematics:
    """The kinematics of the second body in the place of the first."""
    context, names = m.scene.context, second.names
    inertia = [[context.ldexp(x, -m.scaling.inertia) for x in row] for row in second.body.inertia]
    turned = AttitudeStates(
        names.quaternion, [], [], second.matrix, second.quaternion, quaternion_sign="state"
    )
    numbers, scene = replace(m.numbers, inertia=inertia), replace(m.scene, body=second.body)
    return replace(m, scene=scene, numbers=numbers, attitude=turned, body=names)


def _figure(load: Attraction, m: Kinematics, second: Second) -> Sequence[Symbolic]:
    """Acceleration of a body by its figure."""
    sign, parts = load.acceleration(m)
    unit: Any = m.scaled(sign, m.scaling.speed - second.speed)
    return [unit * x for x in parts]
