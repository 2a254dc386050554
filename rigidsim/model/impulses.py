"""Velocities that change at once at an event, as the states after it by the states before it.

With u outwards, t along the orbit and n = u x t, a change (a, b, c) along these axes is v + a u + b t + c n.
Backwards u is known, and with w the part of v across u, s = sqrt(w^2 - c^2): t = (s w - c u x w) / w^2. So an
impulse must not turn the orbit's sense round.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.errors import ensure
from rigidsim.model.loads.rigid_bodies import second_body
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic, along, unit
from rigidsim.model.rotations import apply as turned
from rigidsim.model.state_blocks import BODY
from rigidsim.scene.arithmetic import apply, cross
from rigidsim.scene.bodies.body import inverse_inertia
from rigidsim.scene.scene import Impulse


@dataclass(frozen=True)
class Kick:
    """What changes at an event.

    Attributes:
        index: of the event among the scene's.
        time: internal (mpf); None for a root.
        states: values after it, by the names of the states that change.
    """

    index: int
    time: Any
    states: dict[str, Symbolic]


@dataclass(frozen=True)
class _Moving:
    """A body's states, with the binary exponents of their units, SI."""

    moved: Sequence[str]
    spun: Sequence[str]
    place: list[Symbolic] | None
    velocity: list[Symbolic] | None
    speed: int
    rates: Sequence[Symbolic]
    turning: Sequence[int]
    matrix: Any
    inverse: Any
    sign: int  # of what a change of its velocity does to the states


def kicks_of(m: Mechanics) -> list[Kick]:
    """What the impulses of a scene do.

    Raises:
        ConfigError: its states have no such velocities.
    """
    found = []
    for index, event in enumerate(m.scene.events):
        if (impulse := event.impulse) is None:
            continue
        time = None if event.time is None else m.scaling.internal(event.time, m.scene.context)
        found.append(Kick(index, time, _pushed(m, impulse) | _turned(m, impulse)))
    return found


def _moving(m: Mechanics, impulse: Impulse) -> _Moving:
    scene, scaling = m.scene, m.scaling
    second, matrix = second_body(scene), None if m.attitude is None else m.matrix
    own = [e - scaling.time for e in scaling.rates]
    rates = m.rate_states, own, matrix, scene.inverse_inertia
    if second is None:
        return _Moving(BODY.velocity, BODY.rates, m.position, m.velocity, scaling.speed, *rates, 1)
    seen, (_, speed, turning), names = second.seen(m), second.units(scene), second.states
    pushed = seen.place, seen.velocity, speed
    if not impulse.body:
        return _Moving(names.velocity, BODY.rates, *pushed, *rates, -1)
    rates = seen.rate_states, [turning] * 3, seen.matrix, inverse_inertia(scene.context, second.body)
    return _Moving(names.velocity, names.rates, *pushed, *rates, 1)


def _pushed(m: Mechanics, impulse: Impulse) -> dict[str, Symbolic]:
    """States of a velocity after an impulse."""
    if impulse.velocity is None:
        return {}
    moving, axes = _moving(m, impulse), impulse.axes
    sign = moving.sign * m.scaling.direction
    change = [m.scaled(sign * x, -moving.speed) for x in impulse.velocity]
    place, velocity = m.carried(moving.place), m.carried(moving.velocity)
    if axes == "body":
        change = turned(moving.matrix, change)
    elif axes == "rtn":
        outwards = unit(place)
        across = [v - along(outwards, velocity) * u for u, v in zip(outwards, velocity, strict=True)]
        ahead = unit(across)
        if m.scaling.direction < 0 and impulse.velocity[2] != 0:
            square, aside = along(across, across), change[2]
            size = hy.sqrt(square - aside * aside)
            beyond = cross(outwards, across)
            ahead = [(size * w + aside * x) / square for w, x in zip(across, beyond, strict=True)]
        basis = outwards, ahead, cross(outwards, ahead)
        change = [hy.sum([c * axis[i] for c, axis in zip(change, basis, strict=True)]) for i in range(3)]
    return {name: v + x for name, v, x in zip(moving.moved, velocity, change, strict=True)}


def _turned(m: Mechanics, impulse: Impulse) -> dict[str, Symbolic]:
    """States of the angular velocity after an impulse."""
    moving, change = _moving(m, impulse), impulse.rates
    if impulse.momentum is not None:
        what = "given for a body with rotors, or whose tensor of inertia changes; give the change of "
        rigid = m.shape is None and all(x.loose for x in m.carriers)
        ensure(impulse.body or rigid, impulse.fault("angular_impulse", f"{what}angular_velocity instead"))
        change = apply(moving.inverse, impulse.momentum)
    if change is None:
        return {}
    what = "given, but these states hold no angular velocity; "
    what += 'choose formulation = "quaternion", or a body without changes of shape'
    kept = {str(name) for name in m.rate_states} == {*BODY.rates} and m.rate_correction is None
    ensure(impulse.body or kept, impulse.fault("angular_velocity", what))
    pairs = zip(moving.spun, moving.rates, change, moving.turning, strict=True)
    size = m.scaling.direction
    return {name: w + m.scaled(size * x, -e) for name, w, x, e in pairs if x != 0}
