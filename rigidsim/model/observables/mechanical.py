"""Mechanical quantities: states, momenta, energies and constants of the motion; what is recorded of rotors, a
varying tensor, a fluid core and bodies of a kernel.

**Angles of tops**: tilt, precession and spin of the figure axis against the vertical, and the path of a tip
point. With p the figure axis and v the upward vertical (against gravity) in body axes, e and f the axes of
the figure's equator, and p_X, p_Y the figure axis along the horizontal axes,

    tilt = atan2(hypot(v.e, v.f), v.p),   spin = atan2(v.e, v.f),   precession = atan2(p_X, -p_Y):

the z-x-z Euler angles theta, psi and phi where gravity points down along Z and the figure axis is z (Landau
& Lifshitz, Mechanics, section 35). The horizontal X is the space axis turned by the smallest rotation that
takes Z to the vertical.

**Gradients of fixed sources.** With R from body to space axes, a potential

    U = (1/2) sum s_k c_k . I c_k,  c_k = R^T d_k,  s_k = 3 G M_k / R_k^3     (MacCullagh),

has two integrals besides the energy, for any sources (Bogoyavlensky, Commun. Math. Phys. 94, 1984, 255),
which follow from the Lax pair L(h) = h^2 J^2 + h M + V with J = (tr I) / 2 - I, V = R^T S R and
S = sum s_k d_k d_k^T (Manakov's for S = 0):

    B = |L|^2 - tr(adj(I) V),     adj(I) = det(I) I^-1
    K = L . S L - tr(S) |L|^2 + tr(adj(I) V^2).

For a single source B is Brun's, |L|^2 - 3 (G M / R^3) det(I) (c . I^-1 c) (Brun, Ofvers. Kongl. Svenska
Vet.-Akad. Forh. 7, 1893, 455), and K follows from it and L . d.

**Integrable tops.** Besides Lagrange's two heavy tops are integrable: symmetric bodies (moments A = B and C)
whose centre of mass lies in the equatorial plane. In the axes e1 towards the centre of mass, e3 along the
axis of symmetry and e2 = e3 x e1, with g the vertical seen from the body and k = M g l / C:

    A = 2 C: K = (w1^2 - w2^2 - k g1)^2 + (2 w1 w2 - k g2)^2          (Kovalevskaya 1889)
    A = 4 C: G = w3 (w1^2 + w2^2) - k w1 g3, on L_z = 0 alone          (Goryachev 1900, Chaplygin 1901)
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, NamedTuple

import heyoka as hy

from rigidsim.model.frames import fixed_plane, jacobi_constant
from rigidsim.model.kinematics import Poles, angles_of_matrix, squared_factor
from rigidsim.model.load import Load
from rigidsim.model.loads.changing_tensor import Elasticity
from rigidsim.model.loads.gravity import Attraction
from rigidsim.model.loads.inner_bodies import STATES, core_of, rotors_of
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import (
    BODY,
    ENERGY,
    MOMENTUM,
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
from rigidsim.model.probing import attracting_line, keeps, kept_axes, one_point
from rigidsim.model.rotations import Symbolic, along, transpose, unit
from rigidsim.model.rotations import apply as turned
from rigidsim.model.scaling import loads_amplitude, potential_amplitude, source_rate
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, eigen, negligible, norm, parallel
from rigidsim.scene.scene import Scene

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
    """The same for ``Mechanics.total_energy`` that is kept."""
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
    value = m.scene.body.mass * norm(m.scene.context, m.carried(m.scene.velocity))
    return (value, "initial norm of the linear momentum") if value else (m.scene.context.one, "1 kg m/s")


def attracting_point(m: Mechanics) -> Vector:
    """Position of the (first) attracting point, m, space axes."""
    return next(point for load in m.loads if (point := load.attracting_point) is not None)


def total_momentum_scale(m: Mechanics) -> tuple[Any, str]:
    """abs of the orbital plus the spin angular momentum at the start."""
    scene, context = m.scene, m.scene.context
    velocity = m.carried(scene.velocity)
    offset = [x - a for x, a in zip(m.carried(scene.position), attracting_point(m), strict=True)]
    orbital = scene.body.mass * norm(context, cross(offset, velocity))
    spin, _ = momentum_scale(m)
    rounded = scene.body.mass * norm(context, attracting_point(m)) * norm(context, velocity)
    if rounded > orbital + spin:
        return rounded, "linear momentum times the attracting point's distance from the origin"
    return orbital + spin, "initial orbital plus spin angular momentum"


# --- why they are constant, and their expressions ---------------------------------------------------------


def _torque_free(m: Mechanics) -> str | None:
    return None if m.torque or m.average is not None else "no torque acts"


def _momentum_kept(m: Mechanics) -> str | None:
    if m.average is None:
        return _torque_free(m)
    changes = m.average.driven or m.average.resonance or m.average.tides
    return (
        None
        if changes
        else "averaged over the free rotation, a gravity gradient has no torque along the momentum"
    )


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
    scale = m.scaled(m.scene.body.mass, exponent)
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
    return [m.total_energy(kept=True) - m.number(unit) * hy.make_vars(WORK)]


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
    mass = m.scaled(m.scene.body.mass, -mass_exponent(m))
    return [mass * v for v in m.carried(m.velocity)]


def mass_exponent(m: Mechanics) -> int:
    """Binary exponent of the mass in kg."""
    return m.scene.context.frexp(m.scene.body.mass)[1]


def _in_states(name: str) -> Callable[[Mechanics], bool]:
    return lambda m: m.attitude is not None and name in m.attitude.observables


MECHANICAL = (
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


_KILOMETRE = 10  # exponent of the power of two nearest to 1000 m


def _drawn(m: Mechanics) -> dict[str, str]:
    pictures = [rotor.pictured() for rotor in rotors_of(m.scene)]
    keys = {"rotor_axes": "axis", "rotor_moments": "moment", "rotor_drives": "drive"}
    return {name: json.dumps([one[key] for one in pictures]) for name, key in keys.items()}


def _kept(m: Mechanics) -> str | None:
    if m.energy_stored_by_drives is None or not m.conserves_energy:
        return None
    return "a fixed rate costs its motor the work J s a . (w - w0), which it lends the body"


def _distortion(m: Mechanics) -> list[Any]:
    tensor = m.carried(m.carried(m.shape).distortion)
    return [hy.expression(tensor[i][j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def _positions(m: Mechanics) -> list[Symbolic]:
    sky, context = m.carried(m.sky), m.scene.context
    unit: Any = m.number(context.mpf(1000) / 2**_KILOMETRE)
    return [unit * x for sight in sky.sights for x in sky.seen(sight)]


def _raises_tides(scene: Scene) -> bool:
    return any(isinstance(load, Elasticity) and load.raising for load in scene.loads)


NEEDS |= {
    "moved_mass": Need(lambda m: m.shape is not None and m.rate_correction is None),
    "distorted": Need(lambda m: m.rate_correction is not None),
    "tides": Need(
        lambda m: _raises_tides(m.scene),
        missing=unless(
            _raises_tides, "needs tides: [body] elasticity, and a gravity_gradient that raises them"
        ),
    ),
    "core": Need(
        lambda m: core_of(m.scene) is not None,
        missing=unless(
            core_of,
            "the body has no fluid core, or one of moment 0; give it one by [body] core, or leave this out",
        ),
    ),
}  # fmt: skip

PARTS = (
    Observable(
        "rotor_rate", ("rotor",), "rad s-1", "rates of the rotors about their axes, relative to the body",
        lambda m: [rotor.relative_rate(m) for rotor in rotors_of(m.scene)],
        lambda m: [-m.scaling.time] * len(rotors_of(m.scene)), "body axes", ("rotors",), attributes=_drawn,
    ),
    Observable(
        "body_energy", (), "J", "energy of the body with the rotors at fixed rates locked",
        lambda m: [m.total_energy(kept=True)], same_unit(ENERGY, 1), "", ("energy", "fixed_rotors"),
        _kept, kept_energy_scale,
    ),
    Observable(
        "principal_moments", BODY, "kg m2", "principal moments of inertia",
        lambda m: [hy.expression(m.carried(m.shape).matrix[i][i]) for i in range(3)],
        same_unit(lambda m: m.scaling.inertia, 3), "body axes", ("moved_mass",),
    ),
    Observable(
        "inertia_distortion", ("tensor_component",), "kg m2",
        "what tides and spin add to the inertia tensor", _distortion,
        same_unit(lambda m: m.scaling.inertia, 6), "body axes", ("distorted",),
    ),
    Observable(
        "tidal_power", (), "W", "power that tides put into the distortion: its mean is dissipated",
        lambda m: [load.power(m) for load in m.loads if isinstance(load, Elasticity)],
        same_unit(lambda m: m.scaling.energy - m.scaling.time, 1), "", ("tides",), by_default=only_when_named,
    ),
    Observable(
        "core_angular_velocity", BODY, "rad s-1", "angular velocity of the fluid core",
        lambda m: list(hy.make_vars(*STATES)),
        same_unit(lambda m: m.carried(core_of(m.scene)).unit(m) - m.scaling.time, 3), "body axes", ("core",),
    ),
    Observable(
        "source_position", ("source", *SPACE), "m", "positions of the kernel's bodies, from the host",
        _positions, lambda m: [x.exponent + _KILOMETRE for x in m.carried(m.sky).sights for _ in range(3)],
        "space axes", ("kernel",),
    ),
)  # fmt: skip


def _vertical(m: Mechanics) -> list[Symbolic]:
    """Components of the upward vertical along the figure's equator (two) and the figure axis."""
    figure = m.scene.figure
    up = m.carried(m.vertical)
    return [along(m.fixed(axis), up) for axis in (figure.first, figure.second, figure.pole)]


def tilt(m: Mechanics) -> list[Symbolic]:
    """Angle of the figure axis from the upward vertical, 0 to pi."""
    e, f, p = _vertical(m)
    return [hy.atan2(hy.sqrt(e * e + f * f), p)]


def precession_angle(m: Mechanics) -> list[Angle]:
    """Precession angle of the figure axis about the vertical: line of nodes from the horizontal X."""
    plane = fixed_plane(m, m.carried(m.numbers.up), "horizontal plane")
    u, v, _ = plane.components(unit(m.figure_space))
    return [Angle(u, -v)]


def tip_point(m: Mechanics) -> Vector | None:
    """Body-fixed point whose path is recorded (mpf, m, from the reference point): ``[output] tip``, or the
    centre of mass of a body that turns about another point; None without either.
    """
    given = m.scene.config.output.tip
    if given is not None:
        return [x.at(m.scene.context) for x in given]
    center = m.scene.body.center_of_mass
    return list(center) if any(x != 0 for x in center) else None


def tip(m: Mechanics) -> list[Symbolic]:
    """Position of the tip point, space axes."""
    context, length = m.scene.context, _tip_exponent(m)
    point = [context.ldexp(x, -length) for x in m.carried(tip_point(m))]
    shifted = turned(m.matrix, m.fixed(point))
    if m.position is None:
        return shifted
    return [x + a for x, a in zip(m.position, shifted, strict=True)]


def _tip_exponent(m: Mechanics) -> int:
    return m.scaling.length if m.position is not None else 0


_no_tip = lacking(tip_point, "nothing says which point; give [output] tip = [x, y, z] in body axes, or")


def _is_top(m: Mechanics) -> bool:
    return m.numbers.arm is not None


def _tip_attributes(m: Mechanics) -> dict[str, str]:
    point = tip_point(m)
    components = "" if point is None else ", ".join(m.scene.context.nstr(x, 17) for x in point)
    return {"point": f"[{components}] m in body axes"}


TOP = (
    Observable(
        "tilt", (), "rad", "angle of the figure axis from the upward vertical", tilt,
        needs=("vertical",), by_default=_is_top,
        attributes=described_by("from 0, upright, to pi, hanging", figure=True),
    ),
    continuous_angles(
        "precession_angle", (), "precession of the figure axis about the vertical", precession_angle,
        frame="space axes", needs=("attitude", "vertical"), by_default=_is_top,
        attributes=described_by(
            "of the line of nodes from the horizontal X, about the upward vertical; turns counted; NaN where "
            "the figure axis is vertical",
            figure=True,
        ),
    ),
    continuous_angles(
        "spin_angle", (), "rotation about the figure axis",
        lambda m: [Angle(*_vertical(m)[:2])],
        needs=("attitude", "vertical"), by_default=_is_top,
        attributes=described_by(
            "of the body from the line of nodes; turns counted; NaN where the figure axis is vertical",
            figure=True,
        ),
    ),
    Observable(
        "tip", SPACE, "m", "path of a point of the body", tip, same_unit(_tip_exponent, 3), "space axes",
        ("attitude", "place"), by_default=lambda m: _is_top(m) or m.scene.config.output.tip is not None,
        attributes=_tip_attributes, absent=_no_tip,
    ),
)  # fmt: skip


def _along(m: Mechanics, axis: Vector, vector: list[Symbolic]) -> Symbolic:
    """Component along a constant axis (mpf); its zeros may be rounding."""
    tiny = negligible(m.scene.context)
    return hy.sum([m.number(e) * x for e, x in zip(axis, vector, strict=True) if abs(e) > tiny])


def _across(m: Mechanics, axis: Vector, vector: list[Symbolic]) -> list[Symbolic]:
    """Part of a vector across a constant unit axis (mpf)."""
    unit = [m.number(x) for x in axis]
    along = hy.sum([u * x for u, x in zip(unit, vector, strict=True)])
    return [x - u * along for u, x in zip(unit, vector, strict=True)]


# --- gradients of fixed sources -----------------------------------------------------------------------------


def _sources_alone(m: Mechanics) -> list[tuple[Any, Vector]]:
    """s and d of all fixed sources; none unless all torque comes from them."""
    turning = [] if m.carriers or m.attitude is None else m.turning
    found = [load.fixed_source(m.scene) for load in turning]
    return [] if None in found else [pair for pair in found if pair is not None]


def _several_directions(m: Mechanics) -> bool:
    sources = _sources_alone(m)
    return not all(parallel(m.scene.context, sources[0][1], d) for _, d in sources[1:])


def _source_matrix(m: Mechanics) -> list[Vector]:
    """S, 1/s^2."""
    return [[sum(s * d[i] * d[j] for s, d in _sources_alone(m)) for j in range(3)] for i in range(3)]


def _squares(m: Mechanics) -> tuple[list[tuple[Any, Vector, Symbolic]], Symbolic]:
    """Value s, d, and d . R adj(I) R^T d for each principal direction d of S (internal units); |L|^2."""
    context = m.scene.context
    values, axes = eigen(context, _source_matrix(m))
    a, b, c = m.numbers.inertia
    inertia = [cross(b, c), cross(c, a), cross(a, b)]  # its adjugate
    rows = []
    for value, axis in zip(values, axes, strict=True):
        s = context.ldexp(value, 2 * m.scaling.time)
        if abs(s) <= context.ldexp(max(values), 2 * m.scaling.time) * negligible(context):
            continue
        d = turned(transpose(m.matrix), m.fixed(axis))
        terms = [
            m.number(inertia[i][j]) * (d[i] * d[j]) for i in range(3) for j in range(3) if inertia[i][j] != 0
        ]
        rows.append((s, axis, hy.sum(terms)))
    return rows, hy.sum([x * x for x in m.momentum_body])


def _brun(m: Mechanics) -> list[Symbolic]:
    """B, internal units of momentum squared."""
    rows, squared = _squares(m)
    return [squared - hy.sum([m.number(s) * seen for s, _, seen in rows])]


def _bogoyavlensky(m: Mechanics) -> list[Symbolic]:
    """K, internal units of (momentum / time) squared."""
    rows, squared = _squares(m)
    trace = sum((s for s, _, _ in rows), m.scene.context.zero)
    terms = [m.number(-trace) * squared]
    for s, axis, seen in rows:
        momentum = _along(m, axis, m.momentum_space)
        terms += [m.number(s) * (momentum * momentum), m.number(s * s) * seen]
    return [hy.sum(terms)]


def _brun_scale(m: Mechanics) -> tuple[Any, str]:
    moments, matrix = sorted(m.scene.body.principal_moments), _source_matrix(m)
    trace = sum(matrix[i][i] for i in range(3))
    value = momentum_scale(m)[0] ** 2 + trace * moments[1] * moments[2]
    return value, "squared angular momentum plus 3 G M / R^3 times the largest product of two moments"


def _bogoyavlensky_scale(m: Mechanics) -> tuple[Any, str]:
    matrix = _source_matrix(m)
    value = sum(matrix[i][i] for i in range(3)) * _brun_scale(m)[0]
    return value, "sum of 3 G M / R^3 times the scale of Brun's constant"


# --- tops ---------------------------------------------------------------------------------------------------


class _Top(NamedTuple):
    """A symmetric heavy top whose centre of mass lies in its equatorial plane; mpf, SI."""

    frame: list[Vector]  # e1, e2, e3, body axes
    equatorial: Any  # moments A = B
    axial: Any  # moment C
    strength: Any  # M g l, J


def _top(m: Mechanics, ratio: int) -> _Top | None:
    """The scene as a top with A = B = ratio C, for 4 with L_z = 0; None for others, and under more loads."""
    context, scene = m.scene.context, m.scene
    axis, arm, tiny = m.symmetry_direction, scene.torque_arm, negligible(context)
    if m.vertical is None or axis is None or arm is None or scene.gravity is None or m.carriers:
        return None
    length = norm(context, arm)
    first = [a / length for a in arm]
    equatorial, axial = (dot(e, apply(scene.body.inertia, e)) for e in (first, axis))
    alone = all(load.uniform_field is not None for load in m.turning) and abs(dot(first, axis)) <= tiny
    if not alone or axial == 0 or abs(equatorial - ratio * axial) > equatorial * tiny:
        return None
    momentum = apply(scene.body.inertia, scene.angular_velocity)
    vertical = apply(transpose(attitude.rotation_matrix(scene.quaternion)), scene.gravity)
    if ratio == 4 and abs(dot(momentum, vertical)) > norm(context, momentum) * norm(context, vertical) * tiny:
        return None
    frame = [first, cross(axis, first), list(axis)]
    return _Top(frame, equatorial, axial, length * norm(context, scene.gravity))


def _in_frame(m: Mechanics, ratio: int) -> tuple[list[Symbolic], list[Symbolic], Any]:
    """Rates and vertical in the top's frame, and k, in internal units."""
    top = m.carried(_top(m, ratio))
    rates, vertical = ([_along(m, axis, v) for axis in top.frame] for v in (m.rates, m.carried(m.vertical)))
    return rates, vertical, m.scaled(top.strength / top.axial, 2 * m.scaling.time)


def _kovalevskaya(m: Mechanics) -> list[Symbolic]:
    w, g, k = _in_frame(m, 2)
    real, imaginary = w[0] * w[0] - w[1] * w[1] - k * g[0], 2.0 * (w[0] * w[1]) - k * g[1]
    return [real * real + imaginary * imaginary]


def _goryachev_chaplygin(m: Mechanics) -> list[Symbolic]:
    w, g, k = _in_frame(m, 4)
    return [w[2] * (w[0] * w[0] + w[1] * w[1]) - k * w[0] * g[2]]


def _largest(m: Mechanics, ratio: int) -> tuple[Any, Any, Any]:
    """Bounds of the squared equatorial rate and of the axial rate, all energy in one of them; k."""
    top, w = m.carried(_top(m, ratio)), m.scene.angular_velocity
    twice = dot(w, apply(m.scene.body.inertia, w)) + 4 * top.strength
    return twice / top.equatorial, m.scene.context.sqrt(twice / top.axial), top.strength / top.axial


def _kovalevskaya_scale(m: Mechanics) -> tuple[Any, str]:
    equatorial, _, k = _largest(m, 2)
    return (equatorial + k) ** 2, "largest (w1^2 + w2^2 + M g l / C)^2 by energy"


def _goryachev_chaplygin_scale(m: Mechanics) -> tuple[Any, str]:
    equatorial, axial, k = _largest(m, 4)
    value = axial * equatorial + k * m.scene.context.sqrt(equatorial)
    return value, "largest w3 (w1^2 + w2^2) + M g l w1 / C by energy"


# --- momenta ------------------------------------------------------------------------------------------------


def _line(m: Mechanics) -> Vector | None:
    """Along which the total momentum is constant."""
    return None if m.velocity is None or m.attitude is None else attracting_line(m)


def _beginning(m: Mechanics) -> Vector:
    """Initial direction of L."""
    scene = m.scene
    begun = apply(
        attitude.rotation_matrix(scene.quaternion), apply(scene.body.inertia, scene.angular_velocity)
    )
    return [x / norm(scene.context, begun) for x in begun]


def _damped_alike(m: Mechanics) -> bool:
    """Whether the body turns, under dampings alone that add up to a multiple of the inertia tensor."""
    found = [c for load in m.turning if (c := load.damping()) is not None]
    at_rest = all(w == 0 for w in m.scene.angular_velocity)
    if m.carriers or not found or len(found) < len(m.turning) or at_rest or m.attitude is None:
        return False
    inertia, k = m.scene.body.inertia, max(range(3), key=lambda i: m.scene.body.inertia[i][i])
    total = [sum((c[i] for c in found), m.scene.context.zero) for i in range(3)]
    wanted = [[total[k] / inertia[k][k] * x for x in row] for row in inertia]
    differences = [(total[i] if i == j else 0) - wanted[i][j] for i in range(3) for j in range(3)]
    return all(abs(d) <= total[k] * negligible(m.scene.context) for d in differences)


def _falls_freely(m: Mechanics) -> bool:
    """Whether uniform gravity is the only force on a body in flight."""

    def pulls(load: Load) -> bool:
        return any(x != 0 for vector, _ in load.force(m) for x in vector)

    pulling = [load for load in m.loads if m.velocity is not None and pulls(load)]
    return bool(pulling) and all(load.uniform_field is not None for load in pulling)


def _momentum_along(name: str, words: str, why: str) -> Observable:
    """Angular momentum along one of the ``kept_axes``."""
    return Observable(
        f"angular_momentum_{name}", (), "kg m2 s-1", f"angular momentum along {words}",
        lambda m: [_along(m, kept_axes(m)[name], m.momentum_space)], same_unit(MOMENTUM, 1), "space axes", (),
        lambda _: f"no load has a torque about {why}", momentum_scale,
        absent=lacking(lambda m: m.attitude is not None and name in kept_axes(m)),
    )  # fmt: skip


TOPS = (
    Observable(
        "kovalevskaya_constant", (), "rad4 s-4", "Kovalevskaya's constant", _kovalevskaya,
        same_unit(lambda m: -4 * m.scaling.time, 1), "", (),
        lambda _: "A = B = 2 C, and the centre of mass lies in the equatorial plane (Kovalevskaya)",
        _kovalevskaya_scale, absent=lacking(lambda m: _top(m, 2)),
    ),
    Observable(
        "goryachev_chaplygin_constant", (), "rad3 s-3", "Goryachev's and Chaplygin's constant",
        _goryachev_chaplygin, same_unit(lambda m: -3 * m.scaling.time, 1), "", (),
        lambda _: "A = B = 4 C, the centre of mass lies in the equatorial plane, and L_z = 0 (Goryachev, "
        "Chaplygin)",
        _goryachev_chaplygin_scale, absent=lacking(lambda m: _top(m, 4)),
    ),
)  # fmt: skip

WATCHED = (
    _momentum_along("source", "the axis of the fixed sources", "the direction of a fixed source"),
    _momentum_along("field", "the uniform field", "the direction of the field"),
    *(_momentum_along(x, f"the space axis {x.upper()}", "this axis") for x in "xyz"),
    Observable(
        "angular_momentum_across", SPACE, "kg m2 s-1", "angular momentum across its initial direction",
        lambda m: _across(m, _beginning(m), m.momentum_space), same_unit(MOMENTUM, 3), "space axes", (),
        lambda _: "the damping is in proportion to the inertia tensor", momentum_scale,
        by_default=only_when_named, absent=lacking(_damped_alike),  # zeros
    ),
    Observable(
        "brun_constant", (), "kg2 m4 s-2", "Brun's constant", _brun,
        same_unit(lambda m: 2 * m.scaling.momentum, 1), "", (),
        lambda _: "all torques are gravity gradients of fixed sources (Brun)", _brun_scale,
        absent=lacking(_sources_alone),
    ),
    Observable(
        "bogoyavlensky_constant", (), "kg2 m4 s-4", "Bogoyavlensky's constant", _bogoyavlensky,
        same_unit(lambda m: 2 * (m.scaling.momentum - m.scaling.time), 1), "", (),
        lambda _: "all torques are gravity gradients of fixed sources (Bogoyavlensky)", _bogoyavlensky_scale,
        absent=lacking(_several_directions),
    ),
    Observable(
        "total_angular_momentum_axial", (), "kg m2 s-1",
        "angular momentum along the line of the attracting points, orbital plus spin",
        lambda m: [_along(m, m.carried(_line(m)), total_momentum(m))], same_unit(MOMENTUM, 1), "space axes",
        (),
        lambda _: "no load turns the motion about the line of the attracting points", total_momentum_scale,
        absent=lacking(_line),
    ),
    Observable(
        "linear_momentum_horizontal", SPACE, "kg m s-1", "linear momentum across gravity",
        lambda m: _across(m, m.carried(m.numbers.up), linear_momentum(m)),
        same_unit(lambda m: m.scaling.speed + mass_exponent(m), 3), "space axes", (),
        lambda _: "the only force is uniform gravity", linear_momentum_scale, absent=lacking(_falls_freely),
    ),
)  # fmt: skip
