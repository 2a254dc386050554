"""The registry of observables and invariants: everything that can be recorded, as expressions.

A new observable is one ``Observable`` in ``OBSERVABLES``; a new invariant one whose ``conserved`` says when
and why it holds. It then shows up in the dataset, the summary, the plots and the timeline.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model import integrable, rotations
from rigidsim.model.loads import CentralGravityModel
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Expression
from rigidsim.model.scaling import orbital_rate, potential_amplitude, tidal_amplitude
from rigidsim.scene.context import apply, cross, dot, norm

Dims = tuple[str, ...]
BODY: Dims = ("body_axis",)
SPACE: Dims = ("space_axis",)


def _never(_: Mechanics) -> str | None:
    return None


@dataclass(frozen=True)
class Observable:
    """One recordable quantity.

    Attributes:
        name: of the dataset's variable.
        dims: beside time.
        units: SI.
        long_name: for readers.
        frame: "body axes", "space axes" or "".
        needs: what must be carried: "attitude", "vertical", "flight", "gravity", "symmetry", ...
        expressions: components as expressions of the state, in internal units.
        exponents: binary exponents of the components' internal units.
        conserved: why it is an invariant of this scene, or None where it isn't.
        drift_scale: scale of its drift in SI (mpf), with a name for it.
    """

    name: str
    dims: Dims
    units: str
    long_name: str
    expressions: Callable[[Mechanics], list[Expression]]
    exponents: Callable[[Mechanics], list[int]]
    frame: str = ""
    needs: tuple[str, ...] = ()
    conserved: Callable[[Mechanics], str | None] = _never
    drift_scale: Callable[[Mechanics], tuple[Any, str]] | None = None


def _driven(m: Mechanics) -> Any:
    """Energy that loads of unknown size are estimated to add, J."""
    return m.scene.context.zero if m.scaling.drive is None else m.scaling.drive.energy


def momentum_scale(m: Mechanics) -> tuple[Any, str]:
    """abs(L) at the start, or the momentum that gravity can build up, if that is larger."""
    scene, context = m.scene, m.scene.context
    initial = norm(context, apply(scene.body.inertia, scene.angular_velocity))
    fed = potential_amplitude(scene) + tidal_amplitude(scene) + _driven(m)
    swing = context.sqrt(2 * max(scene.body.principal_moments) * fed)
    swing = max(swing, max(scene.body.principal_moments) * orbital_rate(scene))
    if initial == 0 and swing == 0:
        return context.one, "1 kg m^2/s (the body is at rest)"
    if initial >= swing:
        return initial, "initial norm of the angular momentum"
    return swing, "angular momentum that the loads can build up"


def rotational_scale(m: Mechanics) -> tuple[Any, str]:
    """Initial rotational energy, plus M g l about a fixed point."""
    scene, context = m.scene, m.scene.context
    momentum = apply(scene.body.inertia, scene.angular_velocity)
    kinetic = dot(scene.angular_velocity, momentum) / 2
    carried = max(scene.body.principal_moments) * orbital_rate(scene) ** 2 / 2
    amplitude = potential_amplitude(scene) + tidal_amplitude(scene) + carried + _driven(m)
    if kinetic + amplitude == 0:
        return context.one, "1 J (the body is at rest)"
    name = "initial rotational energy" + (" plus that of the loads" if amplitude else "")
    return kinetic + amplitude, name


def energy_scale(m: Mechanics) -> tuple[Any, str]:
    """As ``rotational_scale``, plus the largest kinetic energy of the flight."""
    scene, context = m.scene, m.scene.context
    scale, name = rotational_scale(m)
    if m.velocity is None or scene.velocity is None:
        return scale, name
    pull = norm(context, scene.gravity) if scene.gravity else context.zero
    swiftest = norm(context, scene.velocity) + pull * (scene.end - scene.start)
    if m.scaling.drive is not None:
        swiftest += m.scaling.drive.speed
    flight = scene.body.mass * swiftest**2 / 2
    return (scale + flight if flight else scale), name + " plus the flight's largest kinetic energy"


def linear_momentum_scale(m: Mechanics) -> tuple[Any, str]:
    """M abs(v) at the start."""
    assert m.scene.velocity is not None
    value = m.scene.body.mass * norm(m.scene.context, m.scene.velocity)
    return (value, "initial norm of the linear momentum") if value else (m.scene.context.one, "1 kg m/s")


WORK = "work"


def work_is_needed(m: Mechanics) -> bool:
    """Whether the energy balance is checked by integrating power: where energy isn't conserved and Jacobi's
    constant doesn't stand in for it.
    """
    has_energy = m.velocity is not None or not m.scene.free_flight
    has_jacobi = m.attitude is not None and m.jacobi is not None
    return has_energy and not m.conserves_energy and not has_jacobi and m.power is not None


def _torque_free(m: Mechanics) -> str | None:
    return None if m.torque else "no torque acts"


def _conservative(m: Mechanics) -> str | None:
    if not m.conserves_energy:
        return None
    return "all loads have a potential that doesn't depend on time" if m.loads else "no load acts"


def _vertical_only(m: Mechanics) -> str | None:
    others = [load for load in m.loads if load.title != "uniform_gravity" and load.torque(m)]
    return None if others else "gravity has no torque about the vertical"


def _central(m: Mechanics) -> str | None:
    centers = [load for load in m.loads if isinstance(load, CentralGravityModel)]
    return "the only load is a central force" if len(m.loads) == len(centers) == 1 else None


def _total_momentum(m: Mechanics) -> list[Expression]:
    """M r x v + R I w about the (first) attracting point."""
    context, scaling = m.scene.context, m.scaling
    center = next(load for load in m.loads if isinstance(load, CentralGravityModel))
    offset = []
    for x, a in zip(m.carried(m.position), center.spec.position, strict=True):
        shift = context.ldexp(a, -scaling.length)
        offset.append(x - m.number(shift) if shift != 0 else x)
    scale = m.number(context.ldexp(m.scene.body.mass, scaling.length + scaling.speed - scaling.momentum))
    x, y, z = offset
    u, v, w = m.carried(m.velocity)
    orbital = [y * w - z * v, z * u - x * w, x * v - y * u]
    return [scale * a + b for a, b in zip(orbital, m.momentum_space, strict=True)]


def total_momentum_scale(m: Mechanics) -> tuple[Any, str]:
    """abs of the orbital plus the spin angular momentum at the start."""
    scene, context = m.scene, m.scene.context
    assert scene.position is not None
    assert scene.velocity is not None
    center = next(load for load in m.loads if isinstance(load, CentralGravityModel))
    offset = [x - a for x, a in zip(scene.position, center.spec.position, strict=True)]
    orbital = scene.body.mass * norm(context, cross(offset, scene.velocity))
    spin, _ = momentum_scale(m)
    return orbital + spin, "initial orbital plus spin angular momentum"


def _axial(m: Mechanics) -> str | None:
    if not m.keeps_axial:
        return None
    why = "the body is symmetric about its axis"
    if m.numbers.arm is not None:
        why += ", on which the centre of mass lies"
    return why + (", and no torque acts" if not m.torque else "")


def _pulled(m: Mechanics) -> bool:
    return any(x != 0 for vector, _ in m.force for x in vector)


def _linear(m: Mechanics) -> str | None:
    return "no force acts" if m.velocity is not None and not _pulled(m) else None


def _along_symmetry_axis(m: Mechanics) -> list[Expression]:
    assert m.symmetry_direction is not None
    pairs = zip(m.symmetry_direction, m.momentum_body, strict=True)
    return [hy.sum([m.number(e) * x for e, x in pairs if e != 0])]


def _along_vertical(m: Mechanics) -> list[Expression]:
    assert m.vertical is not None
    return [hy.sum([v * x for v, x in zip(m.vertical, m.momentum_body, strict=True)])]


def _euler(m: Mechanics) -> list[Expression]:
    assert m.attitude is not None
    sequence = m.scene.config.integrator.euler_sequence
    if m.attitude.kind == "euler_angles" and m.attitude.sequence == sequence:
        return list(hy.make_vars(*m.attitude.names))
    return rotations.euler_from_matrix(sequence, m.matrix)


def _linear_momentum(m: Mechanics) -> list[Expression]:
    assert m.velocity is not None
    context = m.scene.context
    mass = context.ldexp(m.scene.body.mass, -_mass_exponent(m))
    return [m.number(mass) * v for v in m.velocity]


def _mass_exponent(m: Mechanics) -> int:
    return int(m.scene.context.frexp(m.scene.body.mass)[1])


def _same(exponent: Callable[[Mechanics], int], count: int) -> Callable[[Mechanics], list[int]]:
    return lambda m: [exponent(m)] * count


_MOMENTUM = lambda m: m.scaling.momentum  # noqa: E731
_ENERGY = lambda m: m.scaling.energy  # noqa: E731
_NONE = lambda m: 0  # noqa: E731

OBSERVABLES: tuple[Observable, ...] = (
    Observable(
        "angular_velocity", BODY, "rad s-1", "angular velocity", lambda m: m.rate_states,
        lambda m: [e - m.scaling.time for e in m.scaling.rates], "body axes",
    ),
    Observable(
        "quaternion", ("quaternion_component",), "1", "attitude quaternion, body to space",
        lambda m: m.carried(m.attitude).quaternion, _same(_NONE, 4), "body to space", ("attitude",),
    ),
    Observable(
        "euler_angles", ("euler_angle",), "rad", "intrinsic Euler angles, body to space",
        _euler, _same(_NONE, 3), "body to space", ("attitude",),
    ),
    Observable(
        "rotation_matrix", ("space_axis", "body_axis"), "1", "rotation matrix, body to space",
        lambda m: [x for row in m.matrix for x in row], _same(_NONE, 9), "body to space", ("attitude",),
    ),
    Observable(
        "angular_momentum", SPACE, "kg m2 s-1", "angular momentum",
        lambda m: m.momentum_space, _same(_MOMENTUM, 3), "space axes", ("attitude",),
        _torque_free, momentum_scale,
    ),
    Observable(
        "angular_momentum_norm", (), "kg m2 s-1", "norm of the angular momentum",
        lambda m: [hy.sqrt(hy.sum([x * x for x in m.momentum_body]))], _same(_MOMENTUM, 1), "", (),
        _torque_free, momentum_scale,
    ),
    Observable(
        "angular_momentum_vertical", (), "kg m2 s-1", "angular momentum along the vertical",
        _along_vertical, _same(_MOMENTUM, 1), "space axes", ("vertical",),
        _vertical_only, momentum_scale,
    ),
    Observable(
        "angular_momentum_axial", (), "kg m2 s-1", "angular momentum along the symmetry axis",
        _along_symmetry_axis, _same(_MOMENTUM, 1), "body axes", ("symmetry",), _axial, momentum_scale,
    ),
    Observable(
        "energy", (), "J", "total energy", lambda m: [m.energy], _same(_ENERGY, 1), "", ("energy",),
        _conservative, energy_scale,
    ),
    Observable(
        "total_angular_momentum", SPACE, "kg m2 s-1",
        "angular momentum about the attracting point, orbital plus spin",
        _total_momentum, _same(_MOMENTUM, 3), "space axes", ("attractor",), _central, total_momentum_scale,
    ),
    Observable(
        "jacobi_constant", (), "J", "Jacobi's constant", lambda m: [m.carried(m.jacobi)],
        _same(_ENERGY, 1), "", ("jacobi",),
        lambda m: "the only load is a gravity gradient on a circular orbit", energy_scale,
    ),
    Observable(
        "kovalevskaya_constant", (), "rad4 s-4", "Kovalevskaya's constant",
        lambda m: [integrable.kovalevskaya_constant(m)], _same(lambda m: -4 * m.scaling.time, 1), "",
        ("kovalevskaya",),
        lambda m: "A = B = 2 C, and the centre of mass lies in the equatorial plane (Kovalevskaya)",
        integrable.kovalevskaya_scale,
    ),
    Observable(
        "goryachev_chaplygin_constant", (), "rad3 s-3", "Goryachev's and Chaplygin's constant",
        lambda m: [integrable.goryachev_chaplygin_constant(m)], _same(lambda m: -3 * m.scaling.time, 1), "",
        ("goryachev_chaplygin",),
        lambda m: "A = B = 4 C, the centre of mass lies in the equatorial plane, and L_z = 0 (Goryachev, "
        "Chaplygin)",
        integrable.goryachev_chaplygin_scale,
    ),
    Observable(
        "work", (), "J", "work of the loads without a potential", lambda m: [hy.make_vars(WORK)],
        _same(_ENERGY, 1), "", ("work",),
    ),
    Observable(
        "energy_balance", (), "J", "energy less the work done", lambda m: [m.energy - hy.make_vars(WORK)],
        _same(_ENERGY, 1), "", ("work",), lambda m: "energy changes by the work of the loads", energy_scale,
    ),
    Observable(
        "rotational_energy", (), "J", "kinetic energy of rotation",
        lambda m: [m.rotational_energy], _same(_ENERGY, 1), "", (),
        lambda m: _torque_free(m) if m.scene.free_flight else None, rotational_scale,
    ),
    Observable(
        "potential_energy", (), "J", "potential energy",
        lambda m: [m.potential_energy], _same(_ENERGY, 1), "", ("gravity",),
    ),
    Observable(
        "position", SPACE, "m", "position of the centre of mass", lambda m: m.carried(m.position),
        _same(lambda m: m.scaling.length, 3), "space axes", ("flight",),
    ),
    Observable(
        "velocity", SPACE, "m s-1", "velocity of the centre of mass", lambda m: m.carried(m.velocity),
        _same(lambda m: m.scaling.speed, 3), "space axes", ("flight",),
    ),
    Observable(
        "linear_momentum", SPACE, "kg m s-1", "linear momentum", _linear_momentum,
        _same(lambda m: m.scaling.speed + _mass_exponent(m), 3), "space axes", ("flight",),
        _linear, linear_momentum_scale,
    ),
)  # fmt: skip
"""All observables, in the order in which a dataset holds them."""
