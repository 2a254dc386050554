"""Mechanical quantities: states, momenta, energies and constants of the motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import heyoka as hy

from rigidsim.model.euler_poles import Poles, angles_of_matrix, squared_factor
from rigidsim.model.frames import jacobi_constant
from rigidsim.model.loads.attraction import Attraction
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import (
    BODY,
    ENERGY,
    MOMENTUM,
    SPACE,
    Observable,
    register_all,
    same_unit,
)
from rigidsim.model.probing import keeps, one_point
from rigidsim.model.rotations import Symbolic, along
from rigidsim.model.scaling import loads_amplitude, potential_amplitude, source_rate
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, norm

WORK = "work"

# --- sizes that drifts of invariants are relative to: what the quantities have or can reach, SI ---------


def _driven(m: Mechanics) -> Any:
    """Energy that loads of unknown size are estimated to add, J."""
    return m.scene.context.zero if m.scaling.drive is None else m.scaling.drive.energy


def momentum_scale(m: Mechanics) -> tuple[Any, str]:
    """abs(L) at the start, or the momentum that gravity can build up, if that is larger."""
    scene, context = m.scene, m.scene.context
    initial = norm(context, apply(scene.turning_inertia, scene.angular_velocity))
    for carrier in m.carriers:
        initial += norm(context, carrier.carried_at_start(scene)[0])
    fed = potential_amplitude(scene) + loads_amplitude(scene) + _driven(m)
    largest = context.maximum(scene.body.principal_moments)
    swing = context.sqrt(2 * largest * fed)
    swing = context.maximum([swing, largest * source_rate(scene)])
    if initial == 0 and swing == 0:
        return context.one, "1 kg m^2/s (the body is at rest)"
    if initial >= swing:
        several = any(x.carried_momentum(m) for x in m.carriers)
        return initial, "initial norm of the angular momentum" + (", of each carrier" if several else "")
    return swing, "angular momentum that the loads can build up"


def rotational_scale(m: Mechanics, *, kept: bool = False) -> tuple[Any, str]:
    """Initial rotational energy, plus M g l about a fixed point; if ``kept``, without what drives lend."""
    scene, context = m.scene, m.scene.context
    momentum = apply(scene.turning_inertia, scene.angular_velocity)
    kinetic = dot(scene.angular_velocity, momentum) / 2
    for carrier in m.carriers:
        if not (kept and carrier.lends(m)):
            kinetic += carrier.carried_at_start(scene)[1]
    carried = context.maximum(scene.body.principal_moments) * source_rate(scene) ** 2 / 2
    amplitude = potential_amplitude(scene) + loads_amplitude(scene) + carried + _driven(m)
    if kinetic + amplitude == 0:
        return context.one, "1 J (the body is at rest)"
    name = "initial rotational energy" + (" plus energy of the loads" if amplitude else "")
    return kinetic + amplitude, name


def kept_energy_scale(m: Mechanics) -> tuple[Any, str]:
    """The same for ``Mechanics.kept_energy``."""
    return energy_scale(m, kept=True)


def energy_scale(m: Mechanics, *, kept: bool = False) -> tuple[Any, str]:
    """Energy scale: ``rotational_scale`` plus the largest kinetic energy of the flight."""
    scene, context = m.scene, m.scene.context
    scale, name = rotational_scale(m, kept=kept)
    if m.velocity is None or scene.velocity is None:
        return scale, name
    pull = norm(context, scene.gravity) if scene.gravity else context.zero
    swiftest = norm(context, scene.velocity) + pull * scene.duration
    if m.scaling.drive is not None:
        swiftest += m.scaling.drive.speed
    flight = scene.body.mass * swiftest**2 / 2
    whole = scale + flight if flight else scale
    # a position far from the origin is rounded as coarsely as it is far, and the potential with it
    pulls = [
        scene.body.mass * load.gravitational_parameter / load.placement.nearest(scene) ** 2
        * norm(context, load.attracting_point)
        for load in m.loads
        if isinstance(load, Attraction) and load.attracting_point is not None
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
    return next(point for load in m.loads if (point := load.attracting_point) is not None)


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


# --- why they are constant, and their expressions ---------------------------------------------------------


def _torque_free(m: Mechanics) -> str | None:
    return None if m.torque or m.turning_rate is not None else "no torque acts"


def _momentum_kept(m: Mechanics) -> str | None:
    return _torque_free(m) if m.turning_rate is None else m.kept_by_average


def _conservative(m: Mechanics) -> str | None:
    if not m.conserves_energy or m.energy_stored_by_drives is not None:
        return None
    return "all loads have a potential that doesn't depend on time" if m.loads else "no load acts"


def _rotation_alone(m: Mechanics) -> str | None:
    return _torque_free(m) if m.scene.free_flight and not m.drives_work else None


def _vertical_only(m: Mechanics) -> str | None:
    if not keeps(m, m.carried(m.numbers.up)):
        return None
    alone = len(m.turning) == 1
    return f"{'gravity has' if alone else 'the loads have'} no torque about the vertical"


def _rests_in_orbit(m: Mechanics) -> str:
    if len(m.turning) == 1:
        return "the only load is a gravity gradient on a circular orbit"
    return "all potentials rest in the frame that turns with a circular orbit"


def _central(m: Mechanics) -> str | None:
    if not one_point(m):
        return None
    return "the only load is a central force" if len(m.acting) == 1 else "all loads are forces to one point"


def total_momentum(m: Mechanics) -> list[Symbolic]:
    """Total angular momentum M r x v + R I w about the (first) attracting point."""
    exponent = m.scaling.length + m.scaling.speed - m.scaling.momentum
    scale = m.number(m.scene.context.ldexp(m.scene.body.mass, exponent))
    orbital = cross(m.offset_from(attracting_point(m)), m.carried(m.velocity))
    return [scale * a + b for a, b in zip(orbital, m.momentum_space, strict=True)]


def _axial(m: Mechanics) -> str | None:
    if not m.keeps_axial:
        return None
    why = "the body is symmetric about its axis"
    if m.numbers.arm is not None:
        why += ", on which the centre of mass lies"
    return why + (", and no torque acts" if not m.torque else "")


def _linear(m: Mechanics) -> str | None:
    pulled = any(x != 0 for vector, _ in m.force for x in vector)
    return "no force acts" if m.velocity is not None and not pulled else None


def _along_symmetry_axis(m: Mechanics) -> list[Symbolic]:
    pairs = zip(m.carried(m.symmetry_direction), m.momentum_body, strict=True)
    return [hy.sum([m.number(e) * x for e, x in pairs if e != 0])]


def _euler(m: Mechanics) -> list[Symbolic]:
    attitude = m.carried(m.attitude)
    if attitude.sequence:  # in the partner's chart ``System`` replaces them
        return attitude.variables
    return angles_of_matrix(m)


def _euler_poles(m: Mechanics) -> Poles | None:
    if m.carried(m.attitude).sequence:
        return None
    return Poles(m.scene.config.integrator.euler_sequence, squared_factor(m))


def _energy_balance(m: Mechanics) -> list[Symbolic]:
    unit = m.scene.context.ldexp(m.scene.context.one, m.work_unit - m.scaling.energy)
    return [m.kept_energy - m.number(unit) * hy.make_vars(WORK)]


def _work(m: Mechanics) -> list[Symbolic]:
    """The state, and what drives have put into what they drive since the start."""
    state = hy.make_vars(WORK)
    if m.energy_stored_by_drives is None:
        return [state]
    unit = m.scene.context.ldexp(m.scene.context.one, m.work_unit - m.scaling.energy)
    lent = [x.carried_at_start(m.scene)[1] for x in m.carriers if x.lends(m)]
    begun = m.scene.context.ldexp(sum(lent, m.scene.context.zero), -m.scaling.energy)
    return [hy.sum([m.number(unit) * state, m.energy_stored_by_drives, hy.expression(m.number(-begun))])]


def _work_exponent(m: Mechanics) -> int:
    return m.work_unit if m.energy_stored_by_drives is None else m.scaling.energy


def linear_momentum(m: Mechanics) -> list[Symbolic]:
    """Linear momentum M v, in units of speed times 2^``mass_exponent``."""
    assert m.velocity is not None
    context = m.scene.context
    mass = context.ldexp(m.scene.body.mass, -mass_exponent(m))
    return [m.number(mass) * v for v in m.velocity]


def mass_exponent(m: Mechanics) -> int:
    """Binary exponent of the mass in kg."""
    return m.scene.context.frexp(m.scene.body.mass)[1]


def _in_states(name: str) -> Callable[[Mechanics], bool]:
    return lambda m: m.attitude is not None and name in m.attitude.observables


register_all(
    Observable(
        "angular_velocity", BODY, "rad s-1", "angular velocity", lambda m: m.rate_states,
        lambda m: [e - m.scaling.time for e in m.scaling.rates], "body axes",
    ),
    Observable(
        "quaternion", ("quaternion_component",), "1", "attitude quaternion, body to space",
        lambda m: m.carried(m.attitude).quaternion, frame="body to space", needs=("attitude",),
        continuity=lambda m: {"state": "", "wrapping": "parity", "nearest": "nearest"}[
            m.carried(m.attitude).quaternion_sign
        ],
    ),
    Observable(
        "euler_angles", ("euler_angle",), "rad", "intrinsic Euler angles, body to space",
        _euler, frame="body to space", needs=("attitude",), by_default=_in_states("euler_angles"),
        continuity=lambda m: "wrapped" if _in_states("euler_angles")(m) else "unwrap", poles=_euler_poles,
    ),
    Observable(
        "rotation_matrix", ("space_axis", "body_axis"), "1", "rotation matrix, body to space",
        lambda m: [x for row in m.matrix for x in row], frame="body to space", needs=("attitude",),
        by_default=_in_states("rotation_matrix"),
    ),
    Observable(
        "angular_momentum", SPACE, "kg m2 s-1", "angular momentum",
        lambda m: m.momentum_space, same_unit(MOMENTUM, 3), "space axes", ("attitude",),
        _torque_free, momentum_scale,
    ),
    Observable(
        "angular_momentum_norm", (), "kg m2 s-1", "norm of the angular momentum",
        lambda m: [hy.sqrt(hy.sum([x * x for x in m.momentum_body]))], same_unit(MOMENTUM, 1), "", (),
        _momentum_kept, momentum_scale,
    ),
    Observable(
        "angular_momentum_vertical", (), "kg m2 s-1", "angular momentum along the vertical",
        lambda m: [along(m.carried(m.vertical), m.momentum_body)], same_unit(MOMENTUM, 1), "space axes",
        ("vertical",), _vertical_only, momentum_scale,
    ),
    Observable(
        "angular_momentum_axial", (), "kg m2 s-1", "angular momentum along the symmetry axis",
        _along_symmetry_axis, same_unit(MOMENTUM, 1), "body axes", ("symmetry",), _axial, momentum_scale,
    ),
    Observable(
        "energy", (), "J", "total energy", lambda m: [m.energy], same_unit(ENERGY, 1), "", ("energy",),
        _conservative, energy_scale,
    ),
    Observable(
        "total_angular_momentum", SPACE, "kg m2 s-1",
        "angular momentum about the attracting point, orbital plus spin",
        total_momentum, same_unit(MOMENTUM, 3), "space axes", ("attractor",), _central, total_momentum_scale,
    ),
    Observable(
        "jacobi_constant", (), "J", "Jacobi's constant", lambda m: [jacobi_constant(m)],
        same_unit(ENERGY, 1), "", ("jacobi",),
        _rests_in_orbit, kept_energy_scale,
    ),
    Observable(
        "work", (), "J", "work of the loads without a potential", _work,
        same_unit(_work_exponent, 1), "", ("work",),
    ),
    Observable(
        "energy_balance", (), "J", "energy less the work done", _energy_balance,
        same_unit(ENERGY, 1), "", ("work",), lambda m: "energy changes by the work of the loads",
        kept_energy_scale,
    ),
    Observable(
        "rotational_energy", (), "J", "kinetic energy of rotation",
        lambda m: [m.rotational_energy], same_unit(ENERGY, 1), "", (),
        _rotation_alone, rotational_scale,
        by_default=lambda m: m.scene.free_flight,
    ),
    Observable(
        "potential_energy", (), "J", "potential energy",
        lambda m: [m.potential_energy], same_unit(ENERGY, 1), "", ("potential",),
    ),
    Observable(
        "position", SPACE, "m", "position of the centre of mass", lambda m: m.carried(m.position),
        same_unit(lambda m: m.scaling.length, 3), "space axes", ("flight",),
    ),
    Observable(
        "velocity", SPACE, "m s-1", "velocity of the centre of mass", lambda m: m.carried(m.velocity),
        same_unit(lambda m: m.scaling.speed, 3), "space axes", ("flight",),
    ),
    Observable(
        "linear_momentum", SPACE, "kg m s-1", "linear momentum", linear_momentum,
        same_unit(lambda m: m.scaling.speed + mass_exponent(m), 3), "space axes", ("flight",),
        _linear, linear_momentum_scale,
    ),
)  # fmt: skip
