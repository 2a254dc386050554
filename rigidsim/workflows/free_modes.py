"""Free modes of a body with a fluid core, and of one that turns one face to its source, as known frequencies.

Both are those of the linearised equations. A core adds the free core nutation to the wobble (Poincare 1910;
Sasao, Okubo & Saito 1980). A body in step with its orbit librates in longitude, and its figure axis in two
ways: with the wobble in body axes, and by precessing in space (Eckhardt 1981, The Moon and the Planets 25, 3;
for the Moon 2.9, 75 and 81 years: Rambaux & Williams 2011, Celest. Mech. Dyn. Astr. 109, 85).
"""

from __future__ import annotations

from typing import Any

from rigidsim.analysis.labels import Known
from rigidsim.model.load import loads_of
from rigidsim.model.loads.fluid_core import FluidCore, core_of
from rigidsim.model.loads.gravity_gradient import GravityGradient
from rigidsim.model.loads.point_attraction import MovingGradient
from rigidsim.model.sources import in_body_axes
from rigidsim.scene.arithmetic import Vector, dot, norm
from rigidsim.scene.scene import Scene

SYMMETRIC = 1e-12  # relative difference of two moments, below which a body is symmetric
_SMALL = 1e-5  # relative change of the frequencies of modes by their own amplitude
_TORQUES = 0.02  # the same by torques
_NEAR = 0.3  # of the spin, across it, from which a rotation isn't one about an axis
_IN_STEP = (
    0.35  # relative difference of the spin's square from that of a circular orbit at the start's distance
)
_FACING = 0.85  # cosine between the axis of least moment and the source
_LONGITUDE, _AXIS = (
    0.08,
    0.04,
)  # by how much amplitude, eccentricity and inclination may change these librations


def modes_of_core(scene: Scene) -> list[Known]:
    """Spin, wobble and free core nutation of a body with a core that turns about the core's axis; none for
    other motions.
    """
    core = core_of(scene)
    turning = None if core is None else _turning(scene, core.axis)
    if core is None or turning is None:
        return []
    spin, moments = turning
    rates = [dot(axis, scene.angular_velocity) for axis in scene.body.principal_axes]
    largest = max(range(3), key=lambda i: abs(dot(core.axis, scene.body.principal_axes[i])))
    change = spin_change(scene, spin, rates, largest, moments, FluidCore)
    found = _core_modes(scene, core, spin, moments)
    if found is None:
        return []
    (wobble, fading), (nutation, core_fading) = found
    source = "linearised equations of mantle and core"
    pulled = all(
        x.beside or isinstance(x, GravityGradient | MovingGradient | FluidCore) for x in loads_of(scene)
    )
    rough, symmetric = 0.0 if pulled else _TORQUES, abs(moments[0] - moments[1]) <= SYMMETRIC * moments[2]
    errors = [float(_SMALL * abs(x) + y) for x, y in ((wobble, fading), (nutation, core_fading))]
    exact = change is not None and core.friction == 0
    spinning, error = (0.0, float(change[0] * abs(spin))) if exact and change else (_TORQUES, 0.0)
    where, turned = "body" if exact else "", "body" if exact and symmetric else ""
    known = [
        Known("spin", spin, spinning, "initial rate about the principal axis", error, turned),
        Known("free_core_nutation", nutation + spin, rough, f"{source}, in space", errors[1]),
    ]
    if not synchronous_modes(scene):
        known.append(Known("wobble", wobble, rough, source, errors[0], where))
        if exact:
            known.append(
                Known(
                    "free_nutation", wobble + spin, rough, f"{source}, in space", errors[0] + error, "space"
                )
            )
    return known


def spin_change(
    scene: Scene, spin: Any, rates: Vector, axis: int, moments: Vector, known: type | None = None
) -> tuple[float, float] | None:
    """Relative errors of the spin about a principal axis as at the start, and of the torque-free wobble.

    None where other torques than gravity gradients (and a `known` type, or beside others) act, or where
    the amplitude of a body without symmetry counts.

    Args:
        rates: along all principal axes, rad/s; moments: across the axis, and along it.
    """
    context = scene.context
    low, high, polar = moments
    tides = context.zero
    for load in loads_of(scene):
        source = load.gradient_source
        if source is not None:
            distance = source.placement.nearest(context)
            tides += 3 * source.gravitational_parameter / distance**3 / spin**2
        elif known is None or not (load.beside or isinstance(load, known)):
            return None
    uneven = float(abs(high - low) / polar)
    tumbling = float(sum(w**2 for k, w in enumerate(rates) if k != axis) / spin**2)
    if uneven > SYMMETRIC and tumbling > _SMALL:
        return None
    return uneven * (tumbling + float(tides)), _SMALL + float(tides)


def _turning(scene: Scene, axis: Vector) -> tuple[Any, Vector] | None:
    """Rate about an axis (rad/s) and the body's moments across and along it, the least first; None where the
    rotation isn't about it.
    """
    rate = dot(axis, scene.angular_velocity)
    across = [w - rate * x for w, x in zip(scene.angular_velocity, axis, strict=True)]
    if abs(rate) * _NEAR <= norm(scene.context, across):
        return None
    largest = max(range(3), key=lambda i: abs(dot(axis, scene.body.principal_axes[i])))
    moments = scene.body.principal_moments
    low, high = sorted(moments[i] for i in range(3) if i != largest)
    return rate, [low, high, moments[largest]]


def _core_modes(scene: Scene, core: FluidCore, spin: Any, moments: Vector) -> Any:
    """Frequencies in body axes (rad/s, with the sense of the spin) of the wobble and of the nearly diurnal
    mode, each with the rate at which friction damps it; None where these aren't circular or elliptic motions.
    """
    context, polar, f = scene.context, core.polar, core.flattening
    core_rate = dot(core.axis, core.at_start(scene))
    a, b, c = moments[0] - polar * (1 - f), moments[1] - polar * (1 - f), moments[2] - polar
    push, drag = polar * f * core_rate, core.friction
    pull = core_rate / (1 - f)
    own = drag / (polar * (1 - f))
    back = pull + spin - core_rate
    matrix = context.matrix(
        [
            [-drag / a, (b - c) * spin / a, drag / a, -push / a],
            [(c - a) * spin / b, -drag / b, push / b, drag / b],
            [own, -pull, -own, back],
            [pull, own, -back, -own],
        ]
    )
    values, vectors = context.eig(matrix)
    found = []
    for n, value in enumerate(values):
        # x + i y of a motion exp(i s t) is larger for the s that has its sense
        x, y = (context.mpc(vectors[i, n]) for i in (2, 3))
        if context.im(value) != 0 and abs(x + 1j * y) >= abs(x - 1j * y):
            found.append((context.im(value), abs(context.re(value))))
    if len(found) != 2:
        return None
    found.sort(key=lambda mode: abs(mode[0] / spin + 1))  # the nearly diurnal one is near -1 spin
    return found[1], found[0]


def synchronous_modes(scene: Scene, node_rate: Any = None) -> list[Known]:
    """Free librations of a body that turns one face to the source of a gravity gradient; none for others.

    On a circular orbit, with x towards the source and z along the figure axis, s^2 = -3 n^2 (B - A) / C in
    longitude, and s^4 + n^2 (1 + 3 sx + sx sz) s^2 + 4 n^4 sx sz = 0 for the figure axis with
    sx = (C - A) / B and sz = (C - B) / A (Hughes, Spacecraft Attitude Dynamics, 1986, section 9.2).

    Args:
        node_rate: of a source that isn't on an orbit of its own, rad/s; None if it isn't known.
    """
    context, body = scene.context, scene.body
    if scene.free_flight:
        return []
    least, middle, largest = sorted(range(3), key=lambda i: body.principal_moments[i])
    turning = _turning(scene, body.principal_axes[largest])
    if turning is None:
        return []
    a, b, c = (body.principal_moments[i] for i in (least, middle, largest))
    for load in loads_of(scene):
        source = load.gradient_source
        if source is None or a == 0 or a == b or b == c:
            continue
        place = load.source_at_start(scene)
        distance = norm(context, place)
        facing = dot(body.principal_axes[least], in_body_axes(scene, [x / distance for x in place]))
        in_step = source.gravitational_parameter / distance**3 / turning[0] ** 2
        if abs(facing) < _FACING or abs(in_step - 1) > _IN_STEP:
            continue
        orbit = load.orbit
        n = abs(turning[0]) if orbit is None else orbit.mean_motion + orbit.periapsis_rate + orbit.node_rate
        sx, sz = (c - a) / b, (c - b) / a
        half, product = (1 + 3 * sx + sx * sz) / 2, 4 * sx * sz
        root = context.sqrt(half**2 - product)
        about = "small librations in step with the orbit"
        precession = n - n * context.sqrt(half + root)
        node = orbit.node_rate if orbit is not None else node_rate or context.zero
        along = n * context.sqrt(3 * (b - a) / c)
        return [
            Known("longitude", along, _LONGITUDE, f"{about}: n sqrt(3 (B - A) / C)"),
            Known(
                "wobble", n * context.sqrt(half - root), _AXIS, f"{about}, in body axes",
                frames=(float(n - node),),
            ),
            Known(
                "latitude", precession, _AXIS, f"{about}: precession in space",
                frames=(float(-node), float(n)),
            ),
        ]  # fmt: skip
    return []
