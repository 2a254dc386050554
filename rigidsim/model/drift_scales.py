"""Scales of invariants' relative drifts: sizes that the quantities have or can reach, SI."""

from __future__ import annotations

from typing import Any

from rigidsim.model.capabilities import Attracting, having
from rigidsim.model.loads.central_gravity import CentralGravity
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.scaling import loads_amplitude, potential_amplitude, source_rate
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, norm


def _driven(m: Mechanics) -> Any:
    """Energy that loads of unknown size are estimated to add, J."""
    return m.scene.context.zero if m.scaling.drive is None else m.scaling.drive.energy


def momentum_scale(m: Mechanics) -> tuple[Any, str]:
    """abs(L) at the start, or the momentum that gravity can build up, if that is larger."""
    scene, context = m.scene, m.scene.context
    initial = norm(context, apply(scene.body.inertia, scene.angular_velocity))
    for carrier in m.carriers:
        initial += norm(context, carrier.carried_at_start(scene)[0])
    fed = potential_amplitude(scene) + loads_amplitude(scene) + _driven(m)
    largest = context.maximum(scene.body.principal_moments)
    swing = context.sqrt(2 * largest * fed)
    swing = context.maximum([swing, largest * source_rate(scene)])
    if initial == 0 and swing == 0:
        return context.one, "1 kg m^2/s (the body is at rest)"
    if initial >= swing:
        return initial, "initial norm of the angular momentum" + (", of each carrier" if m.carriers else "")
    return swing, "angular momentum that the loads can build up"


def rotational_scale(m: Mechanics) -> tuple[Any, str]:
    """Initial rotational energy, plus M g l about a fixed point."""
    scene, context = m.scene, m.scene.context
    momentum = apply(scene.body.inertia, scene.angular_velocity)
    kinetic = dot(scene.angular_velocity, momentum) / 2
    for carrier in m.carriers:
        kinetic += carrier.carried_at_start(scene)[1]
    carried = context.maximum(scene.body.principal_moments) * source_rate(scene) ** 2 / 2
    amplitude = potential_amplitude(scene) + loads_amplitude(scene) + carried + _driven(m)
    if kinetic + amplitude == 0:
        return context.one, "1 J (the body is at rest)"
    name = "initial rotational energy" + (" plus that of the loads" if amplitude else "")
    return kinetic + amplitude, name


def energy_scale(m: Mechanics) -> tuple[Any, str]:
    """Energy scale: ``rotational_scale`` plus the largest kinetic energy of the flight."""
    scene, context = m.scene, m.scene.context
    scale, name = rotational_scale(m)
    if m.velocity is None or scene.velocity is None:
        return scale, name
    pull = norm(context, scene.gravity) if scene.gravity else context.zero
    swiftest = norm(context, scene.velocity) + pull * (scene.end - scene.start)
    if m.scaling.drive is not None:
        swiftest += m.scaling.drive.speed
    flight = scene.body.mass * swiftest**2 / 2
    whole = scale + flight if flight else scale
    # a position far from the origin is rounded as coarsely as it is far, and the potential with it
    pulls = [
        scene.body.mass * load.gravitational_parameter / load.nearest_approach(scene) ** 2
        * norm(context, load.position)
        for load in m.loads
        if isinstance(load, CentralGravity)
    ]  # fmt: skip
    rounded = sum(pulls, context.zero)
    if rounded > whole:
        return rounded, "attraction times the attracting point's distance from the origin"
    return whole, name + " plus the flight's largest kinetic energy"


def linear_momentum_scale(m: Mechanics) -> tuple[Any, str]:
    """M abs(v) at the start."""
    assert m.scene.velocity is not None
    value = m.scene.body.mass * norm(m.scene.context, m.scene.velocity)
    return (value, "initial norm of the linear momentum") if value else (m.scene.context.one, "1 kg m/s")


def attracting_point(m: Mechanics) -> Vector:
    """Position of the (first) attracting point, m, space axes."""
    return having(Attracting, m.loads)[0].attracting_point


def total_momentum_scale(m: Mechanics) -> tuple[Any, str]:
    """abs of the orbital plus the spin angular momentum at the start."""
    scene, context = m.scene, m.scene.context
    assert scene.position is not None
    assert scene.velocity is not None
    offset = [x - a for x, a in zip(scene.position, attracting_point(m), strict=True)]
    orbital = scene.body.mass * norm(context, cross(offset, scene.velocity))
    spin, _ = momentum_scale(m)
    rounded = scene.body.mass * norm(context, attracting_point(m)) * norm(context, scene.velocity)
    if rounded > orbital + spin:
        return rounded, "linear momentum times the attracting point's distance from the origin"
    return orbital + spin, "initial orbital plus spin angular momentum"
